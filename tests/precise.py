"""Multi-precision solution of short layouts, the reference of all other solvers.

It does not use the formulas of the simulator: contact points and arms of forces are vectors,
ratios of velocities are differences of positions, forces and impulses follow from one dense linear
solve of Newton's and Euler's equations, and friction opposes the sliding that follows from the
positions. In an interval between hits, u = ω² of the leader obeys u' = 2P + 2Qu, by its angle. This
equation is solved by Gauss-Legendre collocation on panels that are halved until the halves agree
with the whole. The result has about 18 correct digits unless u is nearly 0 somewhere.

``python -m tests.precise`` writes the waves of `edge_cases.short_cases` into `REFERENCE` (three
minutes).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from fractions import Fraction
from functools import cache
from typing import Any

import mpmath as mp

from domino_env.core.files import write_text
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome
from domino_env.validation.edge_cases import REFERENCE, PreciseWave, short_cases

Number = Any  # of mpmath, which has no types
Pair = tuple[Number, Number]
Panel = tuple[Number, Number, Number]  # u at the end, time [s], lowest u
Angles = dict[int, Number]  # by domino [rad], or derivatives of angles

DIGITS = 100  # of the arithmetic; 60 suffice if no gap is nearly out of reach
STORED_DIGITS = 30  # of an arrival time, more than are correct
NODES = 24  # of the rule on a panel
U_RTOL, TIME_RTOL = 1e-24, 1e-18  # relative errors allowed in a panel
MAX_HALVINGS = 40  # of an interval
IMPACT_TOLERANCE = 1e-9  # [rad] faces that meet within this angle do so in one impact


def precise_wave(layout: Layout, physics: Physics) -> PreciseWave:
    """Compute the wave of a layout to many digits; for half a dozen dominoes it takes seconds.

    Parameters
    ----------
    layout, physics
        See `simulate`.

    Returns
    -------
    PreciseWave
        Outcome and arrival times.
    """
    with mp.workdps(DIGITS):
        return _Chain(layout, physics).topple()


class _StallError(Exception):
    """Signal that the leader stops."""


class _Chain:
    """Chain, with the states of its contacts and the equations of its stack.

    Dominoes are numbered from 0; n is the leading one, and contact i that of dominoes i and i+1.
    """

    def __init__(self, layout: Layout, physics: Physics) -> None:
        def exact(values: Floats) -> list[Number]:
            return [mp.mpf(float(x)) for x in values]

        self.step = mp.mpf(10) ** -(DIGITS // 4)  # [rad] step of central differences
        self.count = layout.count
        self.height, self.thickness = exact(layout.height), exact(layout.thickness)
        self.gap, density = exact(layout.spacing), exact(layout.density)
        self.tilt, self.rise = exact(layout.tilt), exact(layout.rise)
        self.mu, self.g = mp.mpf(physics.friction), mp.mpf(physics.gravity)
        self.push = mp.mpf(physics.push)
        sizes = list(zip(density, self.height, self.thickness, strict=True))
        self.mass = [r * h * d for r, h, d in sizes]  # per width, which has no influence
        self.inertia = [r * h * d * (h * h + d * d) / 3 for r, h, d in sizes]
        self.is_corner = [False] * self.count  # of each contact; else it is a tip contact
        self.back = 0  # last domino of the stack
        self.flushes = 0
        self.least = mp.mpf(1)  # smallest u since the latest event

    # positions --------------------------------------------------------------------------------
    def shift(self, i: int) -> Pair:
        """Return the vector (x, y) from pivot i to pivot i+1 [m]."""
        tilt, e = self.tilt[i + 1], self.rise[i]
        # the gap is the distance of pivot i from the rear face of the standing domino i+1
        return (self.gap[i] + self.thickness[i + 1] + e * mp.sin(tilt)) / mp.cos(tilt), e

    def angles(self, n: int, angle: Number, last: int) -> Angles:
        """Return the angles of dominoes n … last, for an angle of the leader n."""
        lean = {n: angle}
        for i in range(n - 1, last - 1, -1):
            (p, e), d, b = self.shift(i), self.thickness[i + 1], lean[i + 1]
            if self.is_corner[i]:
                lean[i] = mp.atan2(p - d * mp.cos(b), e + d * mp.sin(b))
            else:
                lean[i] = b + mp.asin((p * mp.cos(b) - e * mp.sin(b) - d) / self.height[i])
        return lean

    def motion(self, n: int, angle: Number) -> tuple[Angles, Angles, Angles]:
        """Return the angles of the stack, and their first two derivatives by the leader's angle."""
        lean, low, high = (self.angles(n, angle + k * self.step, self.back) for k in (0, -1, 1))
        rate = {i: (high[i] - low[i]) / (2 * self.step) for i in lean}
        second = {i: (high[i] - 2 * lean[i] + low[i]) / self.step**2 for i in lean}
        return lean, rate, second

    # forces -----------------------------------------------------------------------------------
    def arms(self, i: int, lean: Angles, rate: Angles) -> Pair:
        """Return the clockwise torques of a unit normal force of contact i on i and on i+1.

        They include friction. rate: rates of the motion that friction opposes.
        """
        a, b = lean[i], lean[i + 1]
        shift = self.shift(i)
        if self.is_corner[i]:  # at_i, at_next: from either pivot to the point of contact
            at_next = -self.thickness[i + 1] * mp.cos(b), self.thickness[i + 1] * mp.sin(b)
            at_i = at_next[0] + shift[0], at_next[1] + shift[1]
            normal, along = (mp.cos(a), -mp.sin(a)), (mp.sin(a), mp.cos(a))
        else:
            at_i = self.height[i] * mp.sin(a), self.height[i] * mp.cos(a)
            at_next = at_i[0] - shift[0], at_i[1] - shift[1]
            normal, along = (mp.cos(b), -mp.sin(b)), (mp.sin(b), mp.cos(b))

        def torque(arm: Pair, force: Pair) -> Number:
            return arm[1] * force[0] - arm[0] * force[1]

        # a point (x, y) moves with ω (y, -x): its speed along the face is ω times a torque
        sliding = rate[i] * torque(at_i, along) - rate[i + 1] * torque(at_next, along)
        friction = self.mu * mp.sign(sliding)
        force = normal[0] + friction * along[0], normal[1] + friction * along[1]
        return torque(at_i, force), torque(at_next, force)

    def solve(self, n: int, lean: Angles, rate: Angles, rhs: Angles, sliding: Angles) -> Number:
        """Return x of the equations I_k J_k x = rhs_k + torques of the contacts on domino k.

        rate: J_k. sliding: rates of the motion that friction opposes.
        """
        size = n + 1 - self.back
        matrix, column = mp.zeros(size), mp.zeros(size, 1)
        for line, k in enumerate(range(self.back, n + 1)):
            matrix[line, 0], column[line] = self.inertia[k] * rate[k], rhs[k]
            if k < n:
                on_i, on_next = self.arms(k, lean, sliding)
                matrix[line, line + 1], matrix[line + 1, line + 1] = on_i, -on_next
        return mp.lu_solve(matrix, column)[0]

    def coefficients(self, n: int, angle: Number) -> Pair:
        """Return P and Q of u' = 2P + 2Qu."""
        lean, rate, second = self.motion(n, angle)
        gravity = {  # torque on each domino
            k: self.mass[k] * self.g / 2
            * (self.height[k] * mp.sin(lean[k]) - self.thickness[k] * mp.cos(lean[k]))
            for k in lean
        }  # fmt: skip
        inertia = {k: -self.inertia[k] * second[k] for k in lean}
        return self.solve(n, lean, rate, gravity, rate), self.solve(n, lean, rate, inertia, rate)

    # one interval between hits ----------------------------------------------------------------
    def panel(self, n: int, a: Number, b: Number, u: Number) -> Panel:
        """Return u at b, the time from a to b, and the lowest u, by collocation from u at a."""
        x, w, running = _rule()
        h = b - a
        p, q = zip(*(self.coefficients(n, a + h * xi) for xi in x), strict=True)
        matrix = mp.eye(NODES) - 2 * h * running * mp.diag(q)
        inside = mp.lu_solve(matrix, u * mp.ones(NODES, 1) + 2 * h * running * mp.matrix(p))
        end = u + 2 * h * sum(w[k] * (p[k] + q[k] * inside[k]) for k in range(NODES))
        if (low := min([*inside, end])) <= 0:
            return end, mp.inf, low
        return end, h * sum(wk / mp.sqrt(v) for wk, v in zip(w, inside, strict=True)), low

    def interval(
        self, n: int, a: Number, b: Number, u: Number, whole: Panel | None = None, depth: int = 0
    ) -> tuple[Number, Number]:
        """Return u at b and the time from a to b; halve panels until the halves agree.

        whole: the panel from a to b, if it has been computed. depth: number of halvings so far.
        """
        end, time, _ = whole or self.panel(n, a, b, u)
        middle = (a + b) / 2
        first = self.panel(n, a, middle, u)
        second = self.panel(n, middle, b, first[0])
        if abs(second[0] - end) <= U_RTOL * u or depth == MAX_HALVINGS:
            self.least = min(self.least, first[2], second[2])
            if self.least <= 0:
                raise _StallError
            total = first[1] + second[1]
            if abs(total - time) <= TIME_RTOL * total or depth == MAX_HALVINGS:
                return second[0], total
        u_middle, first_time = self.interval(n, a, middle, u, first, depth + 1)
        u_end, last_time = self.interval(n, middle, b, u_middle, None, depth + 1)
        return u_end, first_time + last_time

    # changes of contact -----------------------------------------------------------------------
    def change_angle(self, i: int) -> tuple[Number, bool]:
        """Return the angle of i+1 at which contact i changes, and True for a face impact.

        Otherwise the contact separates.
        """
        length, (p, e), d = self.height[i], self.shift(i), self.thickness[i + 1]
        r, rise = mp.sqrt(p * p + e * e), mp.atan2(e, p)  # polar coordinates of pivot i+1 from i
        if not self.is_corner[i] and r * r - d * d < length * length:  # before the tip slips off
            return mp.acos(d / r) - rise, True
        cosine = (r * r + d * d - length * length) / (2 * r * d)
        return (mp.acos(cosine) - rise if cosine > -1 else mp.inf), False

    def next_change(self, n: int, a: Number, b: Number) -> Number | None:
        """Return the leader's least angle in (a, b] at which a contact changes, or None."""
        lean = self.angles(n, b, self.back)
        first = None
        for i in range(n - 1, self.back - 1, -1):
            threshold, _ = self.change_angle(i)
            if lean[i + 1] < threshold - mp.mpf(10) ** -40:  # by more than rounding
                continue
            low, high = a, b  # bisection, because the angles are not smooth
            for _ in range(200):  # to 60 digits
                middle = (low + high) / 2
                reached = self.angles(n, middle, i + 1)[i + 1] >= threshold
                low, high = (low, middle) if reached else (middle, high)
            first = high if first is None else min(first, high)
        return first

    def change(self, n: int, angle: Number, u: Number) -> Number | None:
        """Change the contacts that are due, in one impact; return u after it, None for a jam."""
        lean, rate, _ = self.motion(n, angle)
        flushes_before = self.flushes
        for i in range(n - 1, self.back - 1, -1):
            threshold, is_impact = self.change_angle(i)
            # an angle at a threshold is known to the 60 digits of the bisection
            if not is_impact and lean[i + 1] >= threshold - mp.mpf(10) ** -30:
                self.back = i + 1
                break
            if is_impact and abs(lean[i] - lean[i + 1]) <= IMPACT_TOLERANCE:
                self.is_corner[i] = True
                self.flushes += 1
        if self.flushes == flushes_before:
            return u
        _, new_rate, _ = self.motion(n, angle)
        momenta = {k: self.inertia[k] * rate[k] for k in new_rate}
        # a face impact stops all dominoes behind it, which still slide during the impact
        ratio = self.solve(n, lean, new_rate, momenta, rate)
        return u * ratio * ratio if ratio > 0 else None

    # the chain --------------------------------------------------------------------------------
    def topple(self) -> PreciseWave:
        """Compute one interval after another until the wave ends."""
        u, time, times, lowest = self.push**2, mp.mpf(0), [Fraction(0)], mp.mpf(1)

        def result(outcome: Outcome) -> PreciseWave:
            return PreciseWave(outcome, tuple(times), self.flushes, float(lowest))

        for n in range(self.count):
            strikes_next = n + 1 < self.count and self.gap[n] < self.height[n]
            if strikes_next:
                b = self.tilt[n + 1] + mp.asin(self.gap[n] / self.height[n])
            else:
                b = mp.atan(self.thickness[n] / self.height[n])
            a, u_start = self.tilt[n], u
            while a < b:
                end = self.next_change(n, a, b) or b
                if end > a:
                    self.least = u
                    try:
                        u, duration = self.interval(n, a, end, u)
                    except _StallError:
                        return result(Outcome.STALLED)
                    time += duration
                    lowest = min(lowest, self.least / u_start)
                a = end
                if end < b or self.next_change(n, a - self.step, b) is not None:
                    u_new = self.change(n, end, u)
                    if u_new is None:
                        return result(Outcome.JAMMED)
                    u = u_new
            if not strikes_next:
                return result(Outcome.PROPAGATED if n + 1 == self.count else Outcome.OUT_OF_REACH)
            times.append(Fraction(mp.nstr(time, mp.mp.dps)))
            lean, rate, _ = self.motion(n + 1, self.tilt[n + 1])
            momenta = {k: self.inertia[k] * rate[k] * (k <= n) for k in lean}
            ratio = self.solve(n + 1, lean, rate, momenta, rate)
            if not 0 < ratio < 1:
                return result(Outcome.JAMMED)
            u *= (ratio / rate[n]) ** 2  # rate[n]: ω of the old leader over that of the new one
        raise AssertionError("a wave ends with the last domino")


def _wave_entry(layout: Layout, physics: Physics) -> dict[str, object]:
    """Return the entry of a wave in `REFERENCE`."""
    wave, digits = precise_wave(layout, physics), STORED_DIGITS
    with mp.workdps(digits):
        times = [mp.nstr(mp.mpf(t.numerator) / t.denominator, digits) for t in wave.arrival_times]
    return {
        "outcome": wave.outcome.name,
        "flushes": wave.flushes,
        "lowest": wave.lowest,
        "arrival_times": times,
    }


def write_reference(cases: Mapping[str, tuple[Layout, Physics]]) -> None:
    """Compute the waves of cases in parallel, and store them in `REFERENCE` by name."""
    with ProcessPoolExecutor() as pool:
        jobs = {name: pool.submit(_wave_entry, *case) for name, case in cases.items()}
        waves = {name: job.result() for name, job in jobs.items()}
    write_text(REFERENCE, json.dumps(waves, indent=1, ensure_ascii=False) + "\n")


@cache
def _rule() -> tuple[list[Number], list[Number], Number]:
    """Return Gauss-Legendre nodes and weights on [0, 1], and the matrix of integrals to nodes."""
    with mp.workdps(2 * DIGITS):
        nodes, weights = mp.gauss_quadrature(NODES, "legendre")
        nodes = [(x + 1) / 2 for x in nodes]
        powers = mp.matrix([[x**m for m in range(NODES)] for x in nodes])
        areas = mp.matrix([[x ** (m + 1) / (m + 1) for m in range(NODES)] for x in nodes])
        return nodes, [w / 2 for w in weights], areas * mp.inverse(powers)


if __name__ == "__main__":
    write_reference({str(case): (case.layout, case.physics) for case in short_cases()})
