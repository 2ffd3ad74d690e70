"""Short rows solved in a hundred digits, good to twenty and more: what is held to be true.

Written from the bodies, not from the formulas of the program: contact points and arms are vectors,
ratios of velocities are differences of positions, forces and impulses come from one dense linear
solve of Newton and Euler's equations, friction opposes the sliding that the positions show.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import mpmath as mp
import numpy as np

from domino_env.layout import Layout
from domino_env.physics import Physics
from domino_env.wave import Outcome

DIGITS = 100
NUDGE = mp.mpf(10) ** -25  # [rad] of differences: they err by its square
NODES = 24
GOOD = mp.mpf(10) ** -22  # relative, of u and time over an interval
TOGETHER = mp.mpf(10) ** -9  # [rad] links flush within this switch in one impact


@dataclass(frozen=True)
class TrueWave:
    """Arrival times [s] of the dominoes that are struck, and why the wave ended."""

    outcome: Outcome
    arrival_times: list[mp.mpf]
    flushes: int
    lowest: mp.mpf  # smallest u over its value at release, of all falls, at the nodes

    def relative_error(self, arrival_times: np.ndarray) -> float:
        """Largest |t_k / true t_k - 1| over the dominoes struck; inf where others are."""
        struck = np.flatnonzero(np.isfinite(arrival_times))
        if len(struck) != len(self.arrival_times):
            return float("inf")
        pairs = zip(arrival_times[struck][1:], self.arrival_times[1:], strict=True)
        with mp.workdps(DIGITS):
            return float(max((abs(mp.mpf(float(t)) / true - 1) for t, true in pairs), default=0))


def true_wave(layout: Layout, physics: Physics) -> TrueWave:
    """The wave of a row whose numbers are taken to be exact."""
    with mp.workdps(DIGITS):
        return _Row(layout, physics).topple()


class _Row:
    def __init__(self, layout: Layout, physics: Physics) -> None:
        def exact(values: np.ndarray) -> list[mp.mpf]:
            return [mp.mpf(float(x)) for x in values]

        self.count = layout.count
        self.height, self.thick = exact(layout.height), exact(layout.thickness)
        self.gap, density = exact(layout.spacing), exact(layout.density)
        self.mu, self.g = mp.mpf(physics.friction), mp.mpf(physics.gravity)
        self.push = mp.mpf(physics.push)
        self.mass = [r * h * d for r, h, d in zip(density, self.height, self.thick, strict=True)]
        self.inertia = [
            m * (h * h + d * d) / 3
            for m, h, d in zip(self.mass, self.height, self.thick, strict=True)
        ]
        self.state = ["tip"] * self.count
        self.back = 0  # the last domino still in contact
        self.flushes = 0

    # where everything is ---------------------------------------------------------------------
    def pitch(self, i: int) -> mp.mpf:
        return self.gap[i] + self.thick[i + 1]

    def behind(self, i: int, angle: mp.mpf) -> mp.mpf:
        """Lean of domino i where i+1 leans by `angle`."""
        length, p, d = self.height[i], self.pitch(i), self.thick[i + 1]
        if self.state[i] == "tip":
            return angle + mp.asin((p * mp.cos(angle) - d) / length)
        return mp.atan2(p - d * mp.cos(angle), d * mp.sin(angle))

    def angles(self, n: int, angle: mp.mpf, last: int) -> dict[int, mp.mpf]:
        """Leans of dominoes n … last where n leads."""
        lean = {n: angle}
        for i in range(n - 1, last - 1, -1):
            lean[i] = self.behind(i, lean[i + 1])
        return lean

    # forces ----------------------------------------------------------------------------------
    def arms(self, i: int, lean: dict, rate: dict) -> tuple[mp.mpf, mp.mpf]:
        """Clockwise torque of the contact force per unit of normal force, on i and on i+1."""
        a, b = lean[i], lean[i + 1]
        face = (mp.sin(b), mp.cos(b))  # up along the back of i+1
        ahead = (mp.cos(b), -mp.sin(b))
        edge = tuple(-self.thick[i + 1] * x for x in ahead)  # rear bottom edge from pivot i+1
        shift = (self.pitch(i), mp.mpf(0))  # from pivot i to pivot i+1
        if self.state[i] == "tip":
            at_i = (self.height[i] * mp.sin(a), self.height[i] * mp.cos(a))
            at_next = (at_i[0] - shift[0], at_i[1])
            normal, along = ahead, face
        else:
            at_next = edge
            at_i = (edge[0] + shift[0], edge[1])
            normal, along = (mp.cos(a), -mp.sin(a)), (mp.sin(a), mp.cos(a))

        def velocity(place: tuple, speed: mp.mpf) -> tuple:
            return (speed * place[1], -speed * place[0])

        mine, its = velocity(at_i, rate[i]), velocity(at_next, rate[i + 1])
        sliding = sum((x - y) * t for x, y, t in zip(mine, its, along, strict=True))
        force = [n + self.mu * mp.sign(sliding) * t for n, t in zip(normal, along, strict=True)]

        def torque(place: tuple) -> mp.mpf:
            return place[1] * force[0] - place[0] * force[1]

        return torque(at_i), torque(at_next)

    def motion(self, n: int, angle: mp.mpf) -> tuple[dict, dict, dict]:
        """Leans, their first and their second derivatives to the leader's."""
        here, less, more = (self.angles(n, angle + k * NUDGE, self.back) for k in (0, -1, 1))
        rate = {i: (more[i] - less[i]) / (2 * NUDGE) for i in here}
        bend = {i: (more[i] - 2 * here[i] + less[i]) / NUDGE**2 for i in here}
        return here, rate, bend

    def solve(self, n: int, lean: dict, rate: dict, rhs: list[dict]) -> list[mp.mpf]:
        """x with I_k J_k x = rhs_k + torques of the contacts, for each right-hand side."""
        size = n - self.back + 1
        matrix = mp.matrix(size, size)
        for k in range(self.back, n + 1):
            matrix[k - self.back, 0] = self.inertia[k] * rate[k]
        for i in range(self.back, n):
            on_i, on_next = self.arms(i, lean, rate)
            column = i - self.back + 1
            matrix[i - self.back, column] = on_i
            matrix[i + 1 - self.back, column] = -on_next
        if size == 1:
            return [r[n] / matrix[0, 0] for r in rhs]
        columns = [mp.matrix([r[k] for k in range(self.back, n + 1)]) for r in rhs]
        return [mp.lu_solve(matrix, column)[0] for column in columns]

    def forces(self, n: int, angle: mp.mpf) -> tuple[mp.mpf, mp.mpf]:
        """P and Q of u' = 2P + 2Qu."""
        lean, rate, bend = self.motion(n, angle)
        weight = {
            k: self.mass[k] * self.g / 2
            * (self.height[k] * mp.sin(lean[k]) - self.thick[k] * mp.cos(lean[k]))
            for k in lean
        }  # fmt: skip
        speed = {k: -self.inertia[k] * bend[k] for k in lean}
        p, q = self.solve(n, lean, rate, [weight, speed])
        return p, q

    def effective_inertia(self, n: int, angle: mp.mpf) -> mp.mpf:
        """1 over the leader's acceleration by a unit torque on it."""
        lean, rate, _ = self.motion(n, angle)
        unit = {k: mp.mpf(k == n) for k in lean}
        return 1 / self.solve(n, lean, rate, [unit])[0]

    # one interval ----------------------------------------------------------------------------
    def panel(self, n: int, a: mp.mpf, b: mp.mpf, u: mp.mpf) -> tuple:
        """(u at b, time, least u at a node) by collocation; None where u is not positive."""
        x, w, running = _rule()
        h = b - a
        pq = [self.forces(n, a + h * xi) for xi in x]
        matrix = mp.eye(NODES)
        rhs = mp.matrix(NODES, 1)
        for j in range(NODES):
            rhs[j] = u
            for k, (p, q) in enumerate(pq):
                matrix[j, k] -= 2 * h * running[j][k] * q
                rhs[j] += 2 * h * running[j][k] * p
        at = mp.lu_solve(matrix, rhs)
        end = u + 2 * h * sum(wk * (p + q * uk) for wk, (p, q), uk in zip(w, pq, at, strict=True))
        low = min(*at, end)
        if low <= 0:
            return None
        return end, h * sum(wk / mp.sqrt(uk) for wk, uk in zip(w, at, strict=True)), low

    def interval(self, n: int, a: mp.mpf, b: mp.mpf, u: mp.mpf, depth: int = 0) -> tuple | None:
        """The same, halved until both halves agree with the whole; None where it stalls."""
        whole = self.panel(n, a, b, u)
        middle = (a + b) / 2
        first = self.panel(n, a, middle, u)
        second = self.panel(n, middle, b, first[0]) if first else None
        if whole and first and second:
            time = first[1] + second[1]
            if abs(second[0] - whole[0]) <= GOOD * u and abs(time - whole[1]) <= GOOD * time:
                return second[0], time, min(first[2], second[2])
        if depth > 60:
            return None
        first = self.interval(n, a, middle, u, depth + 1)
        if first is None:
            return None
        second = self.interval(n, middle, b, first[0], depth + 1)
        if second is None:
            return None
        return second[0], first[1] + second[1], min(first[2], second[2])

    # switches --------------------------------------------------------------------------------
    def due(self, i: int) -> tuple[mp.mpf, str]:
        """Lean of i+1 at which link i switches, and to what."""
        length, p, d = self.height[i], self.pitch(i), self.thick[i + 1]
        cosine = (p * p + d * d - length * length) / (2 * p * d)
        free = mp.acos(cosine) if cosine > -1 else mp.inf
        if self.state[i] == "tip" and p * p - d * d < length * length:
            return mp.acos(d / p), "corner"
        return free, "released"

    def next_switch(self, n: int, a: mp.mpf, b: mp.mpf) -> mp.mpf | None:
        """The leader's least angle in (a, b] at which a link switches."""
        lean = self.angles(n, b, self.back)
        found = None
        for i in range(n - 1, self.back - 1, -1):
            goal, _ = self.due(i)
            if lean[i + 1] < goal - mp.mpf(10) ** -40:
                continue
            low, high = a, b  # bisection: nothing smooth is asked of the chain of contacts
            for _ in range(200):
                middle = (low + high) / 2
                over = self.angles(n, middle, i + 1)[i + 1] - goal
                low, high = (low, middle) if over >= 0 else (middle, high)
            found = high if found is None else min(found, high)
        return found

    def switch(self, n: int, angle: mp.mpf, u: mp.mpf) -> mp.mpf | None:
        """Switch what is due, all flush links together; u after it, None where it jams."""
        lean, rate, _ = self.motion(n, angle)
        flushed = False
        for i in range(n - 1, self.back - 1, -1):
            goal, to = self.due(i)
            if to == "released" and lean[i + 1] >= goal - mp.mpf(10) ** -30:
                self.back = i + 1
                break
            if to == "corner" and abs(lean[i] - lean[i + 1]) <= TOGETHER:
                self.state[i] = "corner"
                self.flushes += 1
                flushed = True
        if not flushed:
            return u
        _, new_rate, _ = self.motion(n, angle)
        before = {k: self.inertia[k] * rate[k] for k in new_rate}
        ratio = self.solve(n, lean, new_rate, [before])[0]
        return u * ratio * ratio if ratio > 0 else None

    # the row ---------------------------------------------------------------------------------
    def topple(self) -> TrueWave:
        u, now, times, lowest = self.push**2, mp.mpf(0), [mp.mpf(0)], mp.mpf(1)

        def ended(outcome: Outcome) -> TrueWave:
            return TrueWave(outcome, times, self.flushes, lowest)

        for n in range(self.count):
            strikes = n + 1 < self.count and self.gap[n] < self.height[n]
            if strikes:
                b = mp.asin(self.gap[n] / self.height[n])
            else:
                b = mp.atan(self.thick[n] / self.height[n])
            a, released = mp.mpf(0), u
            while a < b:
                end = self.next_switch(n, a, b) or b
                if end > a:
                    done = self.interval(n, a, end, u)
                    if done is None:
                        return ended(Outcome.STALLED)
                    u, spent, low = done
                    now += spent
                    lowest = min(lowest, low / released)
                a = end
                if end < b or self.next_switch(n, a - NUDGE, b) is not None:
                    after = self.switch(n, end, u)
                    if after is None:
                        return ended(Outcome.JAMMED)
                    u = after
            if not strikes:
                return ended(Outcome.PROPAGATED if n + 1 == self.count else Outcome.OUT_OF_REACH)
            times.append(now)
            lean, rate, _ = self.motion(n + 1, mp.mpf(0))
            before = {k: self.inertia[k] * rate[k] * (k <= n) for k in lean}
            ratio = self.solve(n + 1, lean, rate, [before])[0]
            if not 0 < ratio < 1:
                return ended(Outcome.JAMMED)
            u *= ratio * ratio
        raise AssertionError("a row ends with its last domino")


def _legendre(x: mp.mpf) -> list[mp.mpf]:
    """P_0 … P_NODES at x."""
    values = [mp.mpf(1), x]
    for m in range(1, NODES):
        values.append(((2 * m + 1) * x * values[m] - m * values[m - 1]) / (m + 1))
    return values


@cache
def _rule() -> tuple[list, list, list]:
    """Gauss-Legendre on [0, 1]: nodes, weights, and the integrals from 0 to each node."""
    nodes, weights = [], []
    for k in range(NODES):
        x = mp.cos(mp.pi * (k + mp.mpf("0.75")) / (NODES + mp.mpf("0.5")))
        for _ in range(9):  # Newton's method doubles the digits each time
            *_, before, last = _legendre(x)
            slope = NODES * (before - x * last) / (1 - x * x)
            x -= last / slope
        nodes.append(x)
        weights.append(2 / ((1 - x * x) * slope * slope))
    values = [_legendre(x) for x in nodes]
    running = []
    for x, here in zip(nodes, values, strict=True):
        parts = [x + 1]  # ∫ P_m from -1 to x, times m + 1/2
        parts += [(here[m + 1] - here[m - 1]) / (2 * m + 1) for m in range(1, NODES)]
        parts = [part * (m + mp.mpf("0.5")) for m, part in enumerate(parts)]
        row = [
            w * sum(there[m] * part for m, part in enumerate(parts)) / 2
            for there, w in zip(values, weights, strict=True)
        ]
        running.append(row)
    return [(x + 1) / 2 for x in nodes], [w / 2 for w in weights], running
