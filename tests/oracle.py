"""An independent, slow solution of a toppling chain, to test the simulator against.

The whole Newton-Euler system, with nothing eliminated: one torque equation per domino about its
pivot, one condition per contact, forces and arms as plane vectors, solved at every instant as one
dense linear system for all angular accelerations and contact forces.  DOP853 integrates it over
time; hits, face impacts, separations and stalls are located on its dense output.  Impacts are dense
solves for all angular velocities and impulses at once.  It uses no weights, no leading angle as the
variable, no closed form of a change of contact, and shares no code with the package.

Axes: x along the chain, z up.  Angles and torques are positive in the direction of the fall.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

TIP, CORNER = 0, 1
TOGETHER = 1e-9  # [rad] contacts whose faces are this close change in one impact
PARADOX = 1e-5  # of the leader's inertia: less effective inertia counts as none (steps get tiny)


@dataclass
class Result:
    """Result of a wave; times and velocities have one entry per domino that it reached."""

    outcome: str = ""  # name of a domino_env.Outcome
    hit: int = 1  # dominoes struck, with the first, and with one that the hit does not move
    toppled: int = 0  # dominoes past their tipping angle
    reach: float = 0.0  # intervals between hits, with the fraction of the last, over all
    arrival: list[float] = field(default_factory=lambda: [0.0])  # [s]
    release_velocity: list[float] = field(default_factory=list)  # just after being hit [rad/s]
    impact_velocity: list[float] = field(default_factory=list)  # just before hitting [rad/s]
    margin: list[float] = field(default_factory=list)  # per interval: lowest ω² over first
    flushes: int = 0
    releases: int = 0
    largest_flush_loss: float = 0.0


def up(angle):
    """Return the unit vector from the foot of a domino to its top."""
    return np.stack([np.sin(angle), np.cos(angle)], axis=-1)


def ahead(angle):
    """Return the unit vector normal to its front: the derivative of `up`; its own is -`up`."""
    return np.stack([np.cos(angle), -np.sin(angle)], axis=-1)


def dot(a, b):
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1]


def torque(arm, force):
    """Return the torque in the direction of the fall."""
    return arm[..., 1] * force[..., 0] - arm[..., 0] * force[..., 1]


class Contacts(NamedTuple):
    """Contacts of a stack, one entry each: i behind, i+1 ahead.

    condition(θ_i, θ_{i+1}) = 0 while they touch; its derivatives.  Arms point from
    either pivot to the contact.  normal: direction of the force on the one ahead; along: surface.
    """

    first: np.ndarray  # (m, 2) by θ_i and θ_{i+1}
    second: np.ndarray  # (m, 3) by θ_i twice, θ_i and θ_{i+1}, θ_{i+1} twice
    arm_behind: np.ndarray  # (m, 2)
    arm_ahead: np.ndarray
    normal: np.ndarray
    along: np.ndarray


class Chain:
    """A layout, the kinds of its contacts, and the equations of its stack."""

    def __init__(
        self, spacing, thickness, height, density, friction, gravity, width=0.024, rise=0.0,
        tilt=0.0, turned=0.0,
    ):  # fmt: skip
        self.d = np.asarray(thickness, float)
        count = len(self.d)
        self.s = np.asarray(spacing, float)
        self.stand = np.broadcast_to(np.asarray(tilt, float), count)  # lean at rest
        self.height = np.broadcast_to(np.asarray(height, float), count)
        self.mass = np.broadcast_to(np.asarray(density, float), count) * self.height * self.d
        self.mass = self.mass * width
        self.inertia = self.mass * (self.height**2 + self.d**2) / 3.0
        self.tipping = np.arctan2(self.d, self.height)
        # pivot to pivot: the free gap ends at the rear face of the next domino
        step = np.zeros((count - 1, 2))
        step[:, 1] = rise
        face = ahead(self.stand[1:])
        step[:, 0] = (self.s + self.d[1:] - step[:, 1] * face[:, 1]) / face[:, 0]
        self.foot = np.concatenate((np.zeros((1, 2)), np.cumsum(step, axis=0)))
        self.friction = friction
        self.gravity = gravity * np.array([np.sin(turned), -np.cos(turned)])  # a vector
        self.state = np.full(count - 1, TIP)  # kind of the contact of i and i+1
        self.back = 0  # the last domino that still leans on another

    # geometry ---------------------------------------------------------------------------------
    def angles(self, n, lead):
        """Return the angles of back … n where n leans by `lead` and each touches the next."""
        theta = [lead]
        for i in range(n - 1, self.back - 1, -1):
            b = theta[-1]
            pivots = self.foot[i + 1] - self.foot[i]
            if self.state[i] == TIP:  # its tip lies in the plane of the rear face of the next
                gap = dot(pivots, ahead(b)) - self.d[i + 1]
                theta.append(b + np.arcsin(gap / self.height[i]))
            else:  # its front face passes through the rear bottom edge of the next
                edge = pivots - self.d[i + 1] * ahead(b)
                theta.append(np.arctan2(edge[0], edge[1]))
        return np.array(theta[::-1])

    def contacts(self, n, theta, state=None):
        """Return the contacts of back … n, of the kinds given or those of the chain."""
        pairs = slice(self.back, n)
        state = self.state if state is None else state
        a, b = theta[:-1], theta[1:]
        d, length = self.d[self.back + 1 : n + 1, None], self.height[pairs, None]
        # of the one behind, from the pivot of the one ahead
        foot = self.foot[pairs] - self.foot[self.back + 1 : n + 1]
        ua, fa, ub, fb = up(a), ahead(a), up(b), ahead(b)

        # tip on the rear face:  tip · ahead_b + d = 0,  tip from the pivot of the one ahead
        tip = foot + length * ua
        on_tip = Contacts(
            first=np.stack([dot(length * fa, fb), -dot(tip, ub)], -1),
            second=np.stack([-dot(length * ua, fb), -dot(length * fa, ub), -dot(tip, fb)], -1),
            arm_behind=length * ua, arm_ahead=tip, normal=fb, along=ub,
        )  # fmt: skip
        # rear bottom edge on the front face:  edge · ahead_a = 0,  edge from the pivot behind
        edge = -foot - d * fb
        on_edge = Contacts(
            first=np.stack([-dot(edge, ua), dot(d * ub, fa)], -1),
            second=np.stack([-dot(edge, fa), -dot(d * ub, ua), dot(d * fb, fa)], -1),
            arm_behind=edge, arm_ahead=-d * fb, normal=fa, along=ua,
        )  # fmt: skip
        is_tip = (state[pairs] == TIP)[:, None]
        return Contacts(*(np.where(is_tip, *parts) for parts in zip(on_tip, on_edge, strict=True)))

    def ratios(self, contacts):
        """Return ω_i/ω_n of back … n, from the derivatives of the conditions."""
        each = -contacts.first[:, 1] / contacts.first[:, 0]  # ω_i/ω_{i+1}
        return np.append(np.cumprod(each[::-1])[::-1], 1.0)

    # equations --------------------------------------------------------------------------------
    def system(self, n, contacts):
        """Return the matrix of torque equations and contact conditions.

        Unknowns: angular accelerations (or velocities after an impact) of back … n, then the
        normal forces (or impulses) of their contacts, each with its friction.
        """
        ratio = self.ratios(contacts)[:, None]
        # material points move at ω (z, -x) of their arms
        turn = np.array([[0.0, -1.0], [1.0, 0.0]])
        sliding = dot(
            ratio[:-1] * (contacts.arm_behind @ turn) - ratio[1:] * (contacts.arm_ahead @ turn),
            contacts.along,
        )
        # behind a face contact nothing moves yet: it will slide down
        sense = np.where(np.abs(sliding) < 1e-13, -1.0, np.sign(sliding))
        force = contacts.normal + self.friction * sense[:, None] * contacts.along  # on the next
        size = len(ratio)
        matrix = np.zeros((2 * size - 1, 2 * size - 1))
        k = np.arange(size)
        j = k[:-1]
        matrix[k, k] = self.inertia[self.back : n + 1]
        matrix[j, size + j] = torque(contacts.arm_behind, force)  # it gets the opposite force
        matrix[j + 1, size + j] = -torque(contacts.arm_ahead, force)
        matrix[size + j, j], matrix[size + j, j + 1] = contacts.first.T
        return matrix

    def motion(self, n, lead, speed):
        """Return (accelerations of back … n, normal forces, effective inertia of the leader).

        The last is a unit torque on the leader over the acceleration it causes: where it is not
        positive, rigid bodies have no answer (Painlevé).
        """
        theta = self.angles(n, lead)
        contacts = self.contacts(n, theta)
        omega = self.ratios(contacts) * speed
        size = len(theta)
        stack = slice(self.back, n + 1)
        centre = 0.5 * (self.height[stack, None] * up(theta) - self.d[stack, None] * ahead(theta))
        right = np.zeros((2 * size - 1, 2))
        right[:size, 0] = torque(centre, self.mass[stack, None] * self.gravity)
        a, b = omega[:-1], omega[1:]
        squares = np.stack([a * a, 2.0 * a * b, b * b], -1)
        right[size:, 0] = -(contacts.second * squares).sum(axis=1)
        right[size - 1, 1] = 1.0
        solution = np.linalg.solve(self.system(n, contacts), right)
        return solution[:size, 0], solution[size:, 0], 1.0 / solution[size - 1, 1]

    def impact(self, n, theta, omega, state):
        """Return (angular velocities, impulses) of an inelastic impact into given contacts."""
        size = len(theta)
        momenta = np.zeros(2 * size - 1)
        momenta[:size] = self.inertia[self.back : n + 1] * omega
        solution = np.linalg.solve(self.system(n, self.contacts(n, theta, state)), momenta)
        return solution[:size], solution[size:]

    # switches ---------------------------------------------------------------------------------
    def short_of_flush(self, n, lead):
        """Return the angle of each contact to face contact; inf where the faces have met."""
        theta = self.angles(n, lead)
        return np.where(self.state[self.back : n] == TIP, theta[:-1] - theta[1:], np.inf)

    def short_of_slipping(self, n, lead):
        """Return the distance of each contact from the end of its face, over the height."""
        theta = self.angles(n, lead)
        pairs = slice(self.back, n)
        contacts = self.contacts(n, theta)
        edge = -self.d[self.back + 1 : n + 1, None] * ahead(theta[1:])
        above_edge = dot(contacts.arm_ahead - edge, contacts.along)
        below_top = self.height[pairs] - dot(contacts.arm_behind, contacts.along)
        return np.where(self.state[pairs] == TIP, above_edge, below_top) / self.height[pairs]


def topple(
    spacing, thickness, friction=0.25, gravity=9.81, push=8.0, height=0.048, density=1040.0,
    rtol=1e-13, rise=0.0, tilt=0.0, turned=0.0,
):  # fmt: skip
    """Simulate a layout: the reference for `simulate`.

    turned: angle by which gravity is turned forward [rad].
    """
    chain = Chain(
        spacing, thickness, height, density, friction, gravity, rise=rise, tilt=tilt, turned=turned
    )
    count = len(chain.d)
    result = Result()
    time, speed = 0.0, push
    for n in range(count):
        strikes = n + 1 < count and chain.s[n] < chain.height[n]
        target, stand = chain.tipping[n], chain.stand[n]
        if strikes:  # the next stands: its rear face is still
            target = chain.stand[n + 1] + np.arcsin(chain.s[n] / chain.height[n])
        result.release_velocity.append(speed)
        start, lead, lowest = speed, stand, speed

        def ended(outcome, *, falls=n, at=target, goal=target, stand=stand):
            result.outcome = outcome
            result.reach = (falls + (at - stand) / (goal - stand)) / count
            past = chain.angles(falls, at) > chain.tipping[chain.back : falls + 1]
            # a leader that has come to its tipping angle goes on
            falling = outcome in ("PROPAGATED", "OUT_OF_REACH")
            result.toppled = falls + 1 if falling else chain.back + int(past.sum())
            return result

        while lead < target:
            if not chain.motion(n, lead, speed)[2] > PARADOX * chain.inertia[n]:
                return ended("NO_RIGID_ANSWER", at=lead)
            lead, speed, spent, low, event = advance(chain, n, lead, speed, target, rtol)
            time += spent
            lowest = min(lowest, low)
            if event == "stall":
                result.margin.append(0.0)
                return ended("STALLED", at=lead)
            if event == "paradox":
                return ended("NO_RIGID_ANSWER", at=lead)
            if event == "flush":
                before = speed
                speed = flush(chain, n, lead, speed, result)
                if not speed > 0.0:
                    return ended("JAMMED", at=lead)
                lowest = min(lowest, speed)
                loss = 1.0 - speed / before
                result.largest_flush_loss = max(result.largest_flush_loss, loss)
            if event == "slip":
                release(chain, n, lead, result)
        result.margin.append((lowest / start) ** 2)
        if not strikes:
            return ended("PROPAGATED" if n + 1 == count else "OUT_OF_REACH")
        result.hit += 1
        result.arrival.append(time)
        result.impact_velocity.append(speed)
        theta = chain.angles(n, target)
        omega = chain.ratios(chain.contacts(n, theta)) * speed
        theta, omega = np.append(theta, chain.stand[n + 1]), np.append(omega, 0.0)
        struck = chain.impact(n + 1, theta, omega, chain.state)
        speed = struck[0][-1]
        if not speed > 0.0:
            return ended("JAMMED")
    raise AssertionError("the last domino ends every wave")


def advance(chain, n, lead, speed, target, rtol):
    """Advance n to the target or the next event: (angle, speed, time, lowest speed, event)."""

    def fall(_, y):
        return [y[1], chain.motion(n, y[0], y[1])[0][-1]]

    events = {
        "hit": lambda _, y: target - y[0],
        "stall": lambda _, y: y[1],
        "paradox": lambda _, y: chain.motion(n, y[0], y[1])[2] - PARADOX * chain.inertia[n],
    }
    if n > chain.back:
        events["flush"] = lambda _, y: min(1.0, chain.short_of_flush(n, y[0]).min())
        events["slip"] = lambda _, y: chain.short_of_slipping(n, y[0]).min()
    for event in events.values():
        event.terminal, event.direction = True, -1
    run = solve_ivp(
        fall, (0.0, np.inf), [lead, speed], "DOP853", events=list(events.values()), rtol=rtol,
        atol=[1e-14, 1e-14 * speed], dense_output=True, max_step=(target - lead) / speed / 8.0,
    )  # fmt: skip
    if run.status != 1:  # the acceleration grows beyond all bounds on the way to a paradox
        assert run.status == -1, run.message
        return run.y[0, -1], run.y[1, -1], run.t[-1], run.y[1].min(), "paradox"
    which = next(k for k, times in enumerate(run.t_events) if len(times))
    name, t, (angle, end) = list(events)[which], run.t_events[which][0], run.y_events[which][0]
    if name == "hit":
        angle = target
        if n > chain.back and chain.short_of_flush(n, target).min() < 1e-11:
            name = "flush"  # both at the same angle: flush first
    return angle, end, t, lowest_speed(run.sol, t), name


def lowest_speed(solution, end):
    times = np.linspace(0.0, end, 200)
    speeds = solution(times)[1]
    k = int(np.argmin(speeds))
    near = (times[max(k - 1, 0)], times[min(k + 1, len(times) - 1)])
    inner = minimize_scalar(lambda t: solution(t)[1], bounds=near, method="bounded")
    return float(min(inner.fun, speeds[k]))


def flush(chain, n, lead, speed, result):
    """Apply the face impact of all contacts within TOGETHER; return the speed after it."""
    theta = chain.angles(n, lead)
    omega = chain.ratios(chain.contacts(n, theta)) * speed
    now = chain.short_of_flush(n, lead) <= TOGETHER
    chain.state[chain.back : n][now] = CORNER
    result.flushes += int(now.sum())
    return chain.impact(n, theta, omega, chain.state)[0][-1]


def release(chain, n, lead, result):
    """Separate the foremost contact that slips off, with all behind it."""
    slipping = np.flatnonzero(chain.short_of_slipping(n, lead) < 1e-9)
    chain.back += int(slipping[-1]) + 1
    result.releases += 1
