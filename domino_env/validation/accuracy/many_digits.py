"""Short rows solved in sixty digits: the truth that all else is held against.

Written from the bodies, not from the formulas of the solver: contact points and arms are vectors,
ratios of velocities are differences of positions, forces and impulses come from one dense linear
solve of Newton and Euler's equations, friction opposes the sliding that the positions show.  The
result is good to about 18 digits where u does not dip.  Needs mpmath.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import mpmath as mp
import numpy as np
from numpy.typing import NDArray

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome

Number = Any  # mpmath's, which has no types
Pair = tuple[Number, Number]
Leans = dict[int, Number]
Ride = tuple[Number, Number, Number]
Floats = NDArray[np.float64]

DIGITS = 60
NODES = 24
GOOD = mp.mpf(10) ** -24  # relative, of u over an interval
TIME_GOOD = mp.mpf(10) ** -18
TOGETHER = mp.mpf(10) ** -9  # [rad] links flush within this switch in one impact


@dataclass(frozen=True)
class TrueWave:
    """Arrival times of a wave to many digits, and why it ended.

    Attributes
    ----------
    outcome
        As `Wave.outcome`.
    arrival_times
        Of the dominoes that are struck [s], numbers of mpmath.
    flushes
        Links that turned from tip to corner contact.
    lowest
        The smallest u over its value at release that was met, over all falls.
    """

    outcome: Outcome
    arrival_times: list[Number]
    flushes: int
    lowest: float

    def relative_error(self, arrival_times: Floats) -> float:
        """Largest |t_k / true t_k - 1| over the dominoes struck; inf where others are."""
        struck = np.flatnonzero(np.isfinite(arrival_times))
        if len(struck) != len(self.arrival_times):
            return float("inf")
        pairs = zip(arrival_times[struck][1:], self.arrival_times[1:], strict=True)
        with mp.workdps(DIGITS):
            return float(max((abs(mp.mpf(float(t)) / true - 1) for t, true in pairs), default=0))


def true_wave(layout: Layout, physics: Physics, digits: int = DIGITS) -> TrueWave:
    """Solve for the wave of a row whose numbers are taken to be exact.

    Takes seconds for half a dozen dominoes.

    Parameters
    ----------
    layout
        What stands.
    physics
        What makes it fall.
    digits
        Carried along; more than 60 are needed where a gap is a hair from out of reach.
    """
    with mp.workdps(digits):
        return _Row(layout, physics, digits).topple()


def _solved(matrix: list[list[Number]], columns: list[list[Number]]) -> list[list[Number]]:
    """Solve matrix x = column for each column: elimination with pivots."""
    rows = [[*line, *(c[i] for c in columns)] for i, line in enumerate(matrix)]
    size = len(rows)
    for i in range(size):
        best = max(range(i, size), key=lambda k: abs(rows[k][i]))
        rows[i], rows[best] = rows[best], rows[i]
        for k in range(i + 1, size):
            if rows[k][i] != 0:
                share = rows[k][i] / rows[i][i]
                rows[k] = [0] * (i + 1) + [
                    x - share * y for x, y in zip(rows[k][i + 1 :], rows[i][i + 1 :], strict=True)
                ]
    found = []
    for j in range(size, size + len(columns)):
        x: list[Number] = [0] * size
        for i in reversed(range(size)):
            rest = sum(rows[i][k] * x[k] for k in range(i + 1, size))
            x[i] = (rows[i][j] - rest) / rows[i][i]
        found.append(x)
    return found


class _Row:
    def __init__(self, layout: Layout, physics: Physics, digits: int) -> None:
        self.nudge = mp.mpf(10) ** -(digits // 4)  # [rad] of differences: they err by its square

        def exact(values: Floats) -> list[Number]:
            return [mp.mpf(float(x)) for x in values]

        self.count = layout.count
        self.height, self.thick = exact(layout.height), exact(layout.thickness)
        self.gap, density = exact(layout.spacing), exact(layout.density)
        self.tilt, self.rise = exact(layout.tilt), exact(layout.rise)
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
    def shift(self, i: int) -> Pair:
        """From pivot i to pivot i+1: upright to the rear face of i+1 lies the gap before it."""
        slope, e = self.tilt[i + 1], self.rise[i]
        way = self.gap[i] + self.thick[i + 1] + e * mp.sin(slope)
        return way / mp.cos(slope), e

    def behind(self, i: int, angle: Number) -> Number:
        """Lean of domino i where i+1 leans by `angle`."""
        length, (p, e), d = self.height[i], self.shift(i), self.thick[i + 1]
        if self.state[i] == "tip":
            return angle + mp.asin((p * mp.cos(angle) - e * mp.sin(angle) - d) / length)
        return mp.atan2(p - d * mp.cos(angle), e + d * mp.sin(angle))

    def angles(self, n: int, angle: Number, last: int) -> Leans:
        """Leans of dominoes n … last where n leads."""
        lean = {n: angle}
        for i in range(n - 1, last - 1, -1):
            lean[i] = self.behind(i, lean[i + 1])
        return lean

    # forces ----------------------------------------------------------------------------------
    def arms(self, i: int, lean: Leans, rate: Leans) -> Pair:
        """Clockwise torque of the contact force per unit of normal force, on i and on i+1."""
        a, b = lean[i], lean[i + 1]
        face = (mp.sin(b), mp.cos(b))  # up along the back of i+1
        ahead = (mp.cos(b), -mp.sin(b))
        edge = (
            -self.thick[i + 1] * ahead[0],
            -self.thick[i + 1] * ahead[1],
        )  # rear bottom edge from pivot i+1
        shift = self.shift(i)
        if self.state[i] == "tip":
            at_i = (self.height[i] * mp.sin(a), self.height[i] * mp.cos(a))
            at_next = (at_i[0] - shift[0], at_i[1] - shift[1])
            normal, along = ahead, face
        else:
            at_next = edge
            at_i = (edge[0] + shift[0], edge[1] + shift[1])
            normal, along = (mp.cos(a), -mp.sin(a)), (mp.sin(a), mp.cos(a))

        def velocity(place: Pair, speed: Number) -> Pair:
            return (speed * place[1], -speed * place[0])

        mine, its = velocity(at_i, rate[i]), velocity(at_next, rate[i + 1])
        sliding = sum((x - y) * t for x, y, t in zip(mine, its, along, strict=True))
        force = [n + self.mu * mp.sign(sliding) * t for n, t in zip(normal, along, strict=True)]

        def torque(place: Pair) -> Number:
            return place[1] * force[0] - place[0] * force[1]

        return torque(at_i), torque(at_next)

    def motion(self, n: int, angle: Number) -> tuple[Leans, Leans, Leans]:
        """Leans, their first and their second derivatives to the leader's."""
        here, less, more = (self.angles(n, angle + k * self.nudge, self.back) for k in (0, -1, 1))
        rate = {i: (more[i] - less[i]) / (2 * self.nudge) for i in here}
        bend = {i: (more[i] - 2 * here[i] + less[i]) / self.nudge**2 for i in here}
        return here, rate, bend

    def solve(
        self, n: int, lean: Leans, rate: Leans, rhs: list[Leans], sliding: Leans | None = None
    ) -> list[Number]:
        """Find x with I_k J_k x = rhs_k + torques of the contacts, for each right-hand side.

        sliding: rates of motion that friction opposes, where they are not `rate`.
        """
        order = range(self.back, n + 1)
        matrix = [[self.inertia[k] * rate[k], *[mp.mpf(0)] * (n - self.back)] for k in order]
        for i in range(self.back, n):
            on_i, on_next = self.arms(i, lean, sliding or rate)
            matrix[i - self.back][i - self.back + 1] = on_i
            matrix[i + 1 - self.back][i - self.back + 1] = -on_next
        return [x[0] for x in _solved(matrix, [[r[k] for k in order] for r in rhs])]

    def forces(self, n: int, angle: Number) -> Pair:
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

    # one interval ----------------------------------------------------------------------------
    def panel(self, n: int, a: Number, b: Number, u: Number) -> list[Number]:
        """Find u at the nodes and at b, by collocation."""
        x, w, running = _rule()
        h = b - a
        pq = [self.forces(n, a + h * xi) for xi in x]
        matrix = [
            [mp.mpf(j == k) - 2 * h * running[j][k] * pq[k][1] for k in range(NODES)]
            for j in range(NODES)
        ]
        column = [
            u + 2 * h * sum(running[j][k] * pq[k][0] for k in range(NODES)) for j in range(NODES)
        ]
        (at,) = _solved(matrix, [column])
        end = u + 2 * h * sum(wk * (p + q * uk) for wk, (p, q), uk in zip(w, pq, at, strict=True))
        return [*at, end]

    def interval(self, n: int, a: Number, b: Number, u: Number, depth: int = 0) -> Ride | None:
        """Find u at b, the time, the least u; halved until the halves agree with the whole.

        None where the leader stops.
        """
        whole = self.panel(n, a, b, u)
        middle = (a + b) / 2
        first = self.panel(n, a, middle, u)
        second = self.panel(n, middle, b, first[-1])
        half = _polynomial(whole[:-1])(mp.mpf("0.5"))
        off = max(abs(second[-1] - whole[-1]), abs(half - first[-1]))
        if off <= GOOD * u or depth == 40:
            rides = [_slow_time(_polynomial(part[:-1]), middle - a) for part in (first, second)]
            if None in rides:
                return None
            (time, low), (more, lower) = rides  # type: ignore[misc]
            return second[-1], time + more, min(low, lower)
        early = self.interval(n, a, middle, u, depth + 1)
        late = self.interval(n, middle, b, early[0], depth + 1) if early else None
        if early is None or late is None:
            return None
        return late[0], early[1] + late[1], min(early[2], late[2])

    # switches --------------------------------------------------------------------------------
    def due(self, i: int) -> tuple[Number, str]:
        """Lean of i+1 at which link i switches, and to what."""
        length, (p, e), d = self.height[i], self.shift(i), self.thick[i + 1]
        far, up = mp.sqrt(p * p + e * e), mp.atan2(e, p)  # of pivot i+1, seen from pivot i
        cosine = (far * far + d * d - length * length) / (2 * far * d)
        free = mp.acos(cosine) - up if cosine > -1 else mp.inf
        if self.state[i] == "tip" and far * far - d * d < length * length:
            return mp.acos(d / far) - up, "corner"
        return free, "released"

    def next_switch(self, n: int, a: Number, b: Number) -> Number | None:
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

    def switch(self, n: int, angle: Number, u: Number) -> Number | None:
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
        # all behind a flush is stopped: during the impact it still slides as it did before
        ratio = self.solve(n, lean, new_rate, [before], sliding=rate)[0]
        return u * ratio * ratio if ratio > 0 else None

    # the row ---------------------------------------------------------------------------------
    def topple(self) -> TrueWave:
        u, now, times, lowest = self.push**2, mp.mpf(0), [mp.mpf(0)], mp.mpf(1)

        def ended(outcome: Outcome) -> TrueWave:
            return TrueWave(outcome, times, self.flushes, float(lowest))

        for n in range(self.count):
            strikes = n + 1 < self.count and self.gap[n] < self.height[n]
            if strikes:
                b = self.tilt[n + 1] + mp.asin(self.gap[n] / self.height[n])
            else:
                b = mp.atan(self.thick[n] / self.height[n])
            a, released = self.tilt[n], u
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
                if end < b or self.next_switch(n, a - self.nudge, b) is not None:
                    after = self.switch(n, end, u)
                    if after is None:
                        return ended(Outcome.JAMMED)
                    u = after
            if not strikes:
                return ended(Outcome.PROPAGATED if n + 1 == self.count else Outcome.OUT_OF_REACH)
            times.append(now)
            lean, rate, _ = self.motion(n + 1, self.tilt[n + 1])
            before = {k: self.inertia[k] * rate[k] * (k <= n) for k in lean}
            ratio = self.solve(n + 1, lean, rate, [before])[0]
            if not 0 < ratio < 1:
                return ended(Outcome.JAMMED)
            u *= (ratio / rate[n]) ** 2  # the leader struck as fast as it turns in the new stack
        raise AssertionError("a row ends with its last domino")


def _polynomial(values: list[Number]) -> Callable[[Number], Number]:
    """The polynomial on [0, 1] through values at the nodes."""
    nodes, weights, _ = _rule()
    table = [_legendre(2 * x - 1) for x in nodes]
    terms = [
        (2 * m + 1) * sum(w * v * p[m] for w, v, p in zip(weights, values, table, strict=True))
        for m in range(NODES)
    ]

    def at(x: Number) -> Number:
        return sum(t * p for t, p in zip(terms, _legendre(2 * x - 1), strict=False))

    return at


def _slow_time(u: Callable[[Number], Number], h: Number) -> Pair | None:
    """∫ h dx/√u over [0, 1] and the least u met; None where u is not positive everywhere."""
    x, w, _ = _rule()

    def integral(a: Number, b: Number) -> Pair | None:
        values = [u(a + (b - a) * xi) for xi in x]
        if min(values) <= 0:
            return None
        return (b - a) * sum(wi / mp.sqrt(v) for wi, v in zip(w, values, strict=True)), min(values)

    total, low = mp.mpf(0), u(mp.mpf(1))
    todo = [(mp.mpf(0), mp.mpf(1), integral(mp.mpf(0), mp.mpf(1)))]
    while todo:
        a, b, whole = todo.pop()
        middle = (a + b) / 2
        parts = integral(a, middle), integral(middle, b)
        if whole is None or parts[0] is None or parts[1] is None:
            return None
        time = parts[0][0] + parts[1][0]
        low = min(low, parts[0][1], parts[1][1])
        if abs(time - whole[0]) <= TIME_GOOD * time:
            total += time
        else:
            todo += [(a, middle, parts[0]), (middle, b, parts[1])]
    return (h * total, low) if low > 0 else None


def _legendre(x: Number) -> list[Number]:
    """P_0 … P_NODES at x."""
    values = [mp.mpf(1), x]
    for m in range(1, NODES):
        values.append(((2 * m + 1) * x * values[m] - m * values[m - 1]) / (m + 1))
    return values


@cache
def _rule() -> tuple[list[Number], list[Number], list[list[Number]]]:
    """Gauss-Legendre on [0, 1]: nodes, weights, and the integrals from 0 to each node."""
    with mp.workdps(3 * DIGITS):
        nodes, weights = [], []
        for k in range(NODES):
            x = -mp.cos(mp.pi * (k + mp.mpf("0.75")) / (NODES + mp.mpf("0.5")))
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
