"""An independent, slow solution of a toppling chain, to test the kernel against.

The full Newton-Euler system: one torque equation a domino about its pivot, one contact condition a
link, forces and arms as plane vectors, one dense linear solve per instant, DOP853 in time, events
located on its dense output.  Impacts are dense solves for all impulses at once.  No weights, no
elimination, no integration in the leading angle, and no code shared with the package.

Axes: x along the row, z up; angles and torques are positive in the direction of the fall.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

TIP, CORNER, RELEASED = "tip", "corner", "released"
TOGETHER = 1e-9  # [rad] links this close to flush switch in one impact


@dataclass
class Result:
    """What became of the wave; lists grow by one entry a fall."""

    outcome: str = ""
    leader: int = 0
    arrival: list[float] = field(default_factory=lambda: [0.0])
    release_velocity: list[float] = field(default_factory=list)
    impact_velocity: list[float] = field(default_factory=list)
    margin: list[float] = field(default_factory=list)
    flushes: int = 0
    releases: int = 0
    largest_flush_loss: float = 0.0


def up(a):
    """Unit vector from the foot of a domino to its top."""
    return np.array([np.sin(a), np.cos(a)])


def ahead(a):
    """Unit vector normal to its front face; the derivative of `up` by the angle."""
    return np.array([np.cos(a), -np.sin(a)])


def torque(arm, force):
    """In the direction of the fall."""
    return arm[1] * force[0] - arm[0] * force[1]


class Chain:
    """A row, its contact states, and the equations of its stack."""

    def __init__(self, spacing, thickness, height, density, friction, gravity, width=0.024):
        self.d = np.asarray(thickness, float)
        n = len(self.d)
        self.s = np.asarray(spacing, float)
        self.height = np.broadcast_to(np.asarray(height, float), n)
        mass = np.broadcast_to(np.asarray(density, float), n) * self.height * self.d * width
        self.mass = mass
        self.inertia = mass * (self.height**2 + self.d**2) / 3.0
        self.x = np.concatenate(([0.0], np.cumsum(self.s + self.d[1:])))
        self.mu, self.g = friction, gravity
        self.state = [TIP] * (n - 1)
        self.back = 0

    # geometry ---------------------------------------------------------------------------------

    def angles(self, n, lead):
        """Angles of back … n when n leans by `lead`: each rests against the next."""
        theta = np.zeros(n + 1)
        theta[n] = lead
        for i in range(n - 1, self.back - 1, -1):
            b = theta[i + 1]
            reach = self.x[i + 1] - self.x[i]
            if self.state[i] == TIP:  # L sin(θ_i - θ_b) = (P_b - P_i)·f_b - d
                theta[i] = b + np.arcsin((reach * np.cos(b) - self.d[i + 1]) / self.height[i])
            else:  # the front face of i points at the rear bottom edge of b
                edge = np.array([reach, 0.0]) - self.d[i + 1] * ahead(b)
                theta[i] = np.arctan2(edge[0], edge[1])
        return theta

    def contact(self, i, theta, state):
        """Contact of i and i+1: first and second derivatives of the condition, arms, directions."""
        a, b = theta[i], theta[i + 1]
        foot = np.array([self.x[i] - self.x[i + 1], 0.0])  # of i, seen from the foot of i+1
        d, length = self.d[i + 1], self.height[i]
        if state == TIP:  # tip on the rear face of b: (tip - foot_b)·f_b + d = 0
            tip = foot + length * up(a)
            first = (length * ahead(a) @ ahead(b), -tip @ up(b))
            second = (-length * up(a) @ ahead(b), -length * ahead(a) @ up(b), -tip @ ahead(b))
            arm_a, arm_b = length * up(a), tip
            normal, along = ahead(b), up(b)
            slides = 1.0  # the tip slides over b
        else:  # rear bottom edge of b on the front face of a: (edge - foot_a)·f_a = 0
            edge = -foot - d * ahead(b)
            first = (-edge @ up(a), d * up(b) @ ahead(a))
            second = (-edge @ ahead(a), -d * up(b) @ up(a), d * ahead(b) @ ahead(a))
            arm_a, arm_b = edge, -d * ahead(b)
            normal, along = ahead(a), up(a)
            slides = -1.0  # the edge of b slides over a
        return first, second, arm_a, arm_b, normal, along, slides

    def velocity_ratios(self, n, theta, states):
        """ω_i/ω_n of back … n from the contact conditions."""
        ratio = np.zeros(n + 1)
        ratio[n] = 1.0
        for i in range(n - 1, self.back - 1, -1):
            first = self.contact(i, theta, states[i])[0]
            ratio[i] = -first[1] / first[0] * ratio[i + 1]
        return ratio

    def force_on_next(self, i, theta, state, ratio):
        """Force of i on i+1 per unit of normal force, friction against the sliding, and arms."""
        _, _, arm_a, arm_b, normal, along, slides = self.contact(i, theta, state)
        # velocity of a material point of a domino: ω (z, -x) of its arm
        v_a = ratio[i] * np.array([arm_a[1], -arm_a[0]])
        v_b = ratio[i + 1] * np.array([arm_b[1], -arm_b[0]])
        sliding = (v_a - v_b) @ along  # of i past i+1
        if abs(sliding) < 1e-13:
            sliding = -1.0
        return normal + self.mu * np.sign(sliding) * along, arm_a, arm_b

    # motion -----------------------------------------------------------------------------------

    def acceleration(self, n, lead, speed):
        """(α of back … n, normal forces): one dense solve."""
        theta = self.angles(n, lead)
        ratio = self.velocity_ratios(n, theta, self.state)
        omega = ratio * speed
        first_one, size = self.back, n + 1 - self.back
        matrix = np.zeros((2 * size - 1, 2 * size - 1))
        right = np.zeros(2 * size - 1)
        for i in range(first_one, n + 1):
            k = i - first_one
            weight = np.array([0.0, -self.mass[i] * self.g])
            centre = 0.5 * self.height[i] * up(theta[i]) - 0.5 * self.d[i] * ahead(theta[i])
            matrix[k, k] = self.inertia[i]
            right[k] = torque(centre, weight)
            if i == n:
                continue
            force, arm_a, arm_b = self.force_on_next(i, theta, self.state[i], ratio)
            matrix[k, size + k] += torque(arm_a, force)  # i gets the opposite force
            matrix[k + 1, size + k] -= torque(arm_b, force)
            (fa, fb), (faa, fab, fbb), *_ = self.contact(i, theta, self.state[i])
            a, b = omega[i], omega[i + 1]
            matrix[size + k, k], matrix[size + k, k + 1] = fa, fb
            right[size + k] = -(faa * a * a + 2.0 * fab * a * b + fbb * b * b)
        solution = np.linalg.solve(matrix, right)
        return solution[:size], solution[size:]

    def impact(self, n, theta, omega, states):
        """Angular velocities of back … n after an inelastic impact into `states`."""
        ratio = self.velocity_ratios(n, theta, states)
        size = n + 1 - self.back
        matrix = np.zeros((2 * size - 1, 2 * size - 1))
        right = np.zeros(2 * size - 1)
        for i in range(self.back, n + 1):
            k = i - self.back
            matrix[k, k] = self.inertia[i]
            right[k] = self.inertia[i] * omega[i]
            if i == n:
                continue
            force, arm_a, arm_b = self.force_on_next(i, theta, states[i], ratio)
            matrix[k, size + k] += torque(arm_a, force)
            matrix[k + 1, size + k] -= torque(arm_b, force)
            first = self.contact(i, theta, states[i])[0]
            matrix[size + k, k], matrix[size + k, k + 1] = first
        return np.linalg.solve(matrix, right)[:size]

    # events -----------------------------------------------------------------------------------

    def to_flush(self, n, lead):
        """Smallest angle by which a tip link that can still flush is short of it."""
        theta = self.angles(n, lead)
        found = [1.0]
        for i in range(self.back, n):
            if self.state[i] == TIP:
                found.append(theta[i] - theta[i + 1])
        return min(found)

    def to_release(self, n, lead):
        """Smallest distance, over the height, by which a contact is short of slipping off."""
        theta = self.angles(n, lead)
        found = [1.0]
        for i in range(self.back, n):
            _, _, arm_a, arm_b, _, along, _ = self.contact(i, theta, self.state[i])
            if self.state[i] == TIP:  # the tip above the bottom edge of the face it rests on
                edge = -self.d[i + 1] * ahead(theta[i + 1])
                found.append((arm_b - edge) @ along / self.height[i])
            else:  # the edge below the top of the face
                found.append((self.height[i] - arm_a @ along) / self.height[i])
        return min(found)


def topple(
    spacing, thickness, friction=0.25, gravity=9.81, push=8.0, height=0.048, density=1040.0,
    rtol=1e-12,
):  # fmt: skip
    """Let a row fall; the reference for `simulate`."""
    chain = Chain(spacing, thickness, height, density, friction, gravity)
    count = len(chain.d)
    result = Result()
    time, speed = 0.0, push
    for n in range(count):
        last = n == count - 1 or chain.s[n] >= chain.height[n]
        if last:
            target = np.arctan2(chain.d[n], chain.height[n])
        else:
            target = np.arcsin(chain.s[n] / chain.height[n])
        result.leader = n
        result.release_velocity.append(speed)
        start, lead, lowest = speed, 0.0, speed
        while lead < target:
            lead, speed, time, low, event = _advance(chain, n, lead, speed, time, target, rtol)
            lowest = min(lowest, low)
            if event == "stall":
                result.outcome = "STALLED"
                result.margin.append(0.0)
                return result
            if event == "flush":
                speed, loss = _flush(chain, n, lead, speed, result)
                result.largest_flush_loss = max(result.largest_flush_loss, loss)
                if speed <= 0.0:
                    result.outcome = "JAMMED"
                    return result
            if event == "release":
                _release(chain, n, lead, result)
        result.margin.append((lowest / start) ** 2)
        if last:
            result.outcome = "PROPAGATED" if n == count - 1 else "OUT_OF_REACH"
            return result
        result.arrival.append(time)
        result.impact_velocity.append(speed)
        theta = np.append(chain.angles(n, target), 0.0)
        before = np.append(chain.velocity_ratios(n, theta, chain.state)[: n + 1] * speed, 0.0)
        after = chain.impact(n + 1, theta, before, chain.state)
        speed = after[-1]
        if speed <= 0.0:
            result.outcome = "JAMMED"
            return result
    return result


def _advance(chain, n, lead, speed, time, target, rtol):
    """Integrate until the target or the next event; (angle, speed, time, lowest speed, event)."""

    def motion(_, y):
        return [y[1], chain.acceleration(n, y[0], y[1])[0][-1]]

    def hit(_, y):
        return y[0] - target

    def stall(_, y):
        return y[1]

    def flush(_, y):
        return chain.to_flush(n, y[0])

    def release(_, y):
        return chain.to_release(n, y[0])

    events = [hit, stall]
    if n > chain.back:
        events += [flush, release]
    for event in events:
        event.terminal = True
    hit.direction, stall.direction = 1, -1
    flush.direction = release.direction = -1
    horizon = 3.0 * (target - lead) / speed + 1.0
    run = solve_ivp(
        motion, (0.0, horizon), [lead, speed], "DOP853", events=events, rtol=rtol, atol=1e-14,
        dense_output=True, max_step=(target - lead) / speed / 12.0,
    )  # fmt: skip
    which = next(k for k, times in enumerate(run.t_events) if len(times))
    t, y = run.t_events[which][0], run.y_events[which][0]
    fine = run.sol(np.linspace(0.0, t, 400))[1]
    name = ("hit", "stall", "flush", "release")[which]
    at = target if name == "hit" else y[0]
    if name == "hit" and n > chain.back and chain.to_flush(n, target) < 1e-11:
        name = "flush"  # both at the same angle: flush first
    return at, y[1], time + t, float(fine.min()), name


def _flush(chain, n, lead, speed, result):
    """The impact that lays links flush; (speed after, part lost)."""
    theta = chain.angles(n, lead)
    before = chain.velocity_ratios(n, theta, chain.state) * speed
    states = list(chain.state)
    for i in range(chain.back, n):
        if states[i] == TIP and theta[i] - theta[i + 1] <= TOGETHER:
            states[i] = CORNER
            result.flushes += 1
    after = chain.impact(n, theta, before[: n + 1], states)[-1]
    chain.state = states
    return after, 1.0 - after / speed


def _release(chain, n, lead, result):
    """The foremost link that slips off leaves with all behind it."""
    theta = chain.angles(n, lead)
    for i in range(n - 1, chain.back - 1, -1):
        _, _, arm_a, arm_b, _, along, _ = chain.contact(i, theta, chain.state[i])
        edge = -chain.d[i + 1] * ahead(theta[i + 1])
        tip = chain.state[i] == TIP
        room = (arm_b - edge) @ along if tip else chain.height[i] - arm_a @ along
        if room / chain.height[i] < 1e-9:
            chain.state[i] = RELEASED
            chain.back = i + 1
            result.releases += 1
            return
