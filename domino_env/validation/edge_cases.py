"""Edge cases: layouts at the limits of what can be simulated, and the errors of their waves.

Each wave must have an error below its estimate and, if it converged, below the tolerance, and the
outcome of its reference.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path

import numpy as np

from domino_env.core.files import read_json
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import MIN_RTOL, Outcome, Wave, simulate
from domino_env.rigid.simulation import largest_difference

# waves of `short_cases` to thirty digits, by group and name: outcome, arrival times and others
REFERENCE = Path(__file__).with_name("reference.json")
H, D = 0.048, 0.0075  # height and thickness of the standard domino [m]
TIPPING_PUSH = math.sqrt(3.0 * 9.81 / (H * H + D * D) * (math.hypot(H, D) - H))  # [rad/s] smallest
RTOL = 1e-8  # tolerance of the examined waves
UNDECIDED = 1e-9  # stall margin below which rounding decides whether a wave stalls
COMPLETES, STALLS, JAMS = Outcome.PROPAGATED, Outcome.STALLED, Outcome.JAMMED


@dataclass(frozen=True, eq=False)
class EdgeCase:
    """One layout at a limit.

    Attributes
    ----------
    group
        The extreme property.
    name
        Value of the property.
    layout, physics
        See `simulate`.
    expected
        Accepted outcomes; empty if they are not known in advance.
    """

    group: str
    name: str
    layout: Layout
    physics: Physics
    expected: tuple[Outcome, ...] = ()

    def __str__(self) -> str:
        return f"{self.group}: {self.name}"


@dataclass(frozen=True)
class CaseResult:
    """Result of one edge case, compared with its reference.

    Attributes
    ----------
    group, name
        Group and name of the case.
    outcome
        Name of the wave's `Outcome`.
    error
        Largest relative error of the arrival times, from the reference.
    estimate
        Error estimate of the wave.
    converged
        See `Wave.converged`.
    against
        Name of the reference: "many digits" or "tightest run".
    faults
        Sentences about what is wrong; empty for a right result.
    """

    group: str
    name: str
    outcome: str
    error: float
    estimate: float
    converged: bool
    against: str
    faults: str


def edge_cases(longest: int = 1_000_000) -> Iterator[EdgeCase]:
    """Yield all cases, group by group, with at most `longest` dominoes."""
    yield from short_cases()
    for mu in (0.25, 0.0):
        for group, name, layout, push in _layouts():
            physics = Physics(mu, push=push)
            yield EdgeCase(group, f"μ = {mu:g}, {name}", layout, physics)
    yield from _friction()
    yield from _face_impacts()
    yield from _sizes()
    for factor in (1.05, 1.2, 1.4, 1.5, 1.53, 1.54, 1.55, 1.6, 2.0, 1 / 1.05):
        scale = factor ** np.arange(16)
        layout = Layout(0.6 * H * scale[:-1], D * scale, height=H * scale)
        name, physics = f"factor {factor:.4g}", Physics(push=30.0)
        yield EdgeCase("growing heights", name, layout, physics, (COMPLETES, STALLS))
    gaps = np.random.default_rng(1).uniform(0.010, 0.025, longest - 1)
    uniform = Layout.uniform(longest, pitch=0.016)
    yield EdgeCase("long", f"{longest} equal dominoes", uniform, Physics())
    yield EdgeCase("long", f"{longest} at random gaps", Layout(gaps, D), Physics())


def short_cases() -> Iterator[EdgeCase]:
    """Yield the cases whose arrival times are stored to many digits."""
    tight = Layout([0.02, 0.012, 0.004, 0.015], D)
    for mu in (0.25, 0.0):
        for power in (1, 3, 6, 9, 12, 14):
            physics = Physics(mu, push=TIPPING_PUSH / math.sqrt(1.0 - 10.0**-power))
            expected = (COMPLETES,) if power < 13 else (COMPLETES, STALLS)
            # u = ω² of the leader, over its value at the push
            name = f"μ = {mu:g}, u dips to 1e-{power}"
            yield EdgeCase("near stall", name, tight, physics, expected)
        for sign in (1, -1):
            for power in (3, 6, 9, 12):
                name = f"μ = {mu:g}, tipping push times 1 {'+-'[sign < 0]} 1e-{power}"
                physics = Physics(mu, push=TIPPING_PUSH * (1 + sign * 10.0**-power))
                outcome = COMPLETES if sign > 0 else STALLS
                yield EdgeCase("smallest push", name, tight, physics, (outcome,))
        high = Layout([0.02, 0.012, 0.02], D, rise=[0.0199, 0.0119, -0.0035])
        for name, (layout, push) in {
            "nearly stairs": (high, 20.0),
            "nearly touching": (Layout([1e-6 * H, 0.015], D), 30.0),
            "nearly out of reach": (Layout([H * (1.0 - 1e-6), 0.015], D), 30.0),
            "one face impact": (Layout([0.005, 0.02, 0.025], D), 8.0),
            "two in one face impact": (Layout([0.004, 0.004, 0.034], D), 12.0),
            "contacts open": (Layout([0.044, 0.042, 0.02], 0.01), 10.0),
            "stalls in a tight gap": (Layout.uniform(3, spacing=0.002), 2.9),
            "out of reach": (Layout([0.02, 0.05], D), 8.0),
        }.items():
            yield EdgeCase("short", f"μ = {mu:g}, {name}", layout, Physics(mu, push=push))
    jam = Physics(7.0, push=50.0)
    yield EdgeCase("short", "jams", Layout.uniform(3, spacing=0.012), jam, (JAMS,))
    rng = np.random.default_rng(25)
    for k in range(15):
        mu, count = (0.0, 0.25, 0.6)[k % 3], 3 + k % 3
        gaps, thickness = rng.uniform(0.006, 0.035, count - 1), rng.uniform(0.004, 0.01, count)
        height, density = rng.uniform(0.0475, 0.0485, count), 10.0 ** rng.uniform(2.5, 3.5, count)
        tilt = rng.uniform(-0.05, 0.05, count) * (k % 2)
        rise = -(gaps + thickness[1:]) * np.sin(0.5 * (tilt[1:] + tilt[:-1]))
        layout = Layout(gaps, thickness, height, density=density, rise=rise, tilt=tilt)
        ground = "uneven ground" if k % 2 else "flat"
        yield EdgeCase("short", f"random {k}, {ground}, μ = {mu:g}", layout, Physics(mu, push=15.0))


def _layouts() -> Iterator[tuple[str, str, Layout, float]]:
    """Yield group, name, layout and push of the cases that run with friction and without."""
    group = "near touching"
    for power in (2, 4, 6, 8):
        gap, gaps = 10.0**-power * H, np.full(19, 0.015)
        gaps[9] = gap
        thin, thick = (Layout.uniform(20, spacing=gap, thickness=d) for d in (0.001 * H, D))
        yield group, f"one gap 1e-{power} of the height", Layout(gaps, D), 30.0
        yield group, f"d/L = 0.001, all gaps 1e-{power} of the height", thin, 1e3
        yield group, f"all gaps 1e-{power} of the height", thick, 1e4
    yield group, "gaps of 1e-4 downhill", Layout.uniform(20, spacing=1e-4 * H, slope=0.1), 20.0
    # gaps that the top edge barely bridges or does not
    gaps, group = np.full(11, 0.015), "out of reach"
    for power in (2, 4, 6, 8, 10, 12):
        gaps[5] = H * (1.0 - 10.0**-power)
        all_gaps = Layout.uniform(12, spacing=gaps[5])
        yield group, f"one gap 1 - s/L = 1e-{power}", Layout(gaps, D), 8.0
        yield group, f"all gaps 1 - s/L = 1e-{power}", all_gaps, 8.0
    for gap in (H, np.nextafter(H, 1.0), 2.0 * H):
        gaps[5] = gap
        yield group, f"s - L = {gap - H:.1e} m", Layout(gaps, D), 8.0
    # from thin sheets to cubes, and neighbours that differ a thousandfold
    for d in (1e-6, 1e-4, 1e-2, 0.1, 0.3, 0.6, 1.0):
        for s in (0.3, 0.8):
            layout = Layout.uniform(20, spacing=s * H, thickness=d * H)
            yield "slenderness", f"d/L = {d:g}, s/L = {s:g}", layout, 60.0
    gaps, group = np.full(19, 0.02), "unequal neighbours"
    for ratio in (10.0, 100.0, 1000.0):
        factors = np.where(np.arange(20) % 2, ratio, 1.0)
        thin_first, thick_first = D / 100.0 * factors, D * ratio / 100.0 / factors
        yield group, f"1 : {ratio:g} in thickness, thin first", Layout(gaps, thin_first), 200.0
        yield group, f"1 : {ratio:g} in thickness, thick first", Layout(gaps, thick_first), 200.0
        yield group, f"1 : {ratio:g} in density", Layout(gaps, D, density=1040.0 * factors), 50.0
    # ground that is nearly too steep, too curved or too stepped
    steepest, tilt = math.atan(D / H), 0.12 * np.cos(1.6 * np.arange(20))
    rise = -0.0275 * np.sin(0.5 * (tilt[1:] + tilt[:-1]))
    turn = math.asin(0.01 / H) * (1.0 - 1e-6)  # between dominoes 0 and 1, which nearly touch
    for name, layout in {
        "0.9999 of the limit downhill": Layout.uniform(20, spacing=0.015, slope=0.9999 * steepest),
        "0.9999 of the limit uphill": Layout.uniform(20, spacing=0.015, slope=-0.9999 * steepest),
        "crest after hollow": Layout(np.full(19, 0.02), D, rise=rise, tilt=tilt),
        "tops nearly touch": Layout([0.01, 0.015], D, rise=0.0019, tilt=[turn / 2, -turn / 2, 0]),
    }.items():
        yield "uneven ground", name, layout, 20.0
    for factor in (1.0 + 1e-9, 1.001, 1.5, 10.0, 100.0, 1000.0):
        name = f"{factor:.10g} times the tipping push"
        yield "push", name, Layout.uniform(30, spacing=0.016), TIPPING_PUSH * factor


def _friction() -> Iterator[EdgeCase]:
    """Yield cases of friction up to the jam of the stack, and beyond."""
    layout = Layout.uniform(20, spacing=0.012)
    for mu in (0.5, 1.0, 2.0, 4.0, 6.0, 6.2, 6.19, 6.3, 8.0, 20.0, 1e3, 1e6):
        yield EdgeCase("friction", f"μ = {mu:g}, gap 12 mm", layout, Physics(mu, push=100.0))
    # the friction μ* at which B = L cos Δ - μ d, the lever arm of the first hit, is 0
    limit, layout = math.sqrt(H * H - 0.012**2) / D, Layout.uniform(5, spacing=0.012)
    for excess in (-1e-3, -1e-6, -1e-9, -1e-12, 0.0, 1e-12, 1e-6):
        name = f"μ = μ* (1 {excess:+g}), jams above μ* = {limit:.4f}"
        outcomes = (JAMS,) if excess > 0 else (JAMS, STALLS)
        yield EdgeCase("friction", name, layout, Physics(limit * (1 + excess), push=100), outcomes)


def _face_impacts() -> Iterator[EdgeCase]:
    """Yield cases of single face impacts, many at once, and many within a tiny interval."""
    for name, gaps in {
        "at every contact": np.linspace(0.004, 0.036, 30),
        "twelve at once": np.concatenate([np.full(12, 0.005), np.full(8, 0.030)]),
        "clusters of three": np.tile([0.003, 0.003, 0.003, 0.034], 8),
    }.items():
        for mu in (0.25, 0.6, 0.0):
            physics = Physics(mu, push=12.0)
            yield EdgeCase("face impacts", f"μ = {mu:g}, {name}", Layout(gaps, D), physics)
    for power in (4, 6, 7, 8, 8.5, 9, 10, 12, 15):
        for sign, trend in ((1, "growing"), (-1, "shrinking")):
            graded = 0.005 * (1.0 + sign * 10.0**-power * np.arange(12))
            layout = Layout(np.concatenate([graded, np.full(8, 0.030)]), D)
            name = f"gaps {trend} by 1e-{power:g} each"
            yield EdgeCase("face impacts close together", name, layout, Physics())


def _sizes() -> Iterator[EdgeCase]:
    """Yield a random layout in sizes from 1 µm to 1 km, at gravity from 1e-6 to 1e3 m/s²."""
    rng = np.random.default_rng(5)
    gaps, thickness = rng.uniform(0.05, 0.8, 29), rng.uniform(0.1, 0.25, 30)
    for mu in (0.25, 0.0):
        for size in (1.0, 1e-6, 1e-3, 0.048, 1e3):
            for gravity in (1.0, 1e-6, 9.81, 1e3):
                layout = Layout(gaps * size, thickness * size, size, 0.5 * size, 1.0 / size)
                physics = Physics(mu, gravity, push=1.5 * math.sqrt(gravity / size))
                name = f"μ = {mu:g}, L = {size:g} m, g = {gravity:g} m/s²"
                yield EdgeCase("sizes and gravity", name, layout, physics)


# Results of the cases ----------------------------------------------------------------------------


@dataclass(frozen=True)
class PreciseWave:
    """Outcome of a wave and its arrival times to many digits.

    Attributes
    ----------
    outcome
        See `Wave.outcome`.
    arrival_times
        Arrival times of the dominoes that are hit [s], as fractions.
    flushes
        Number of contacts that changed from tip to corner contacts, in face impacts.
    lowest
        Smallest u over its value at the start of the interval, over all intervals.
    """

    outcome: Outcome
    arrival_times: tuple[Fraction, ...]
    flushes: int
    lowest: float

    def relative_error(self, arrival_times: Floats) -> float:
        """Return the largest |t_k / T_k - 1| over the dominoes hit; inf if others are hit.

        Parameters
        ----------
        arrival_times
            (N,) arrival times t_k to compare [s]; not finite for dominoes that are not hit.
        """
        times = arrival_times[np.isfinite(arrival_times)].tolist()
        if len(times) != len(self.arrival_times):
            return float("inf")
        pairs = zip(times[1:], self.arrival_times[1:], strict=True)
        return float(max((abs(Fraction(t) / true - 1) for t, true in pairs), default=0))


@cache
def reference_waves() -> dict[str, PreciseWave]:
    """Return the waves in `REFERENCE`, which `tests/precise.py` computes, by group and name."""
    return {
        name: PreciseWave(
            Outcome[wave["outcome"]], tuple(map(Fraction, wave["arrival_times"])), wave["flushes"],
            wave["lowest"],
        )
        for name, wave in read_json(REFERENCE).items()
    }  # fmt: skip


def examine(case: EdgeCase, rtol: float = RTOL) -> CaseResult:
    """Simulate a case and compare its wave with the solution to many digits or the tightest run.

    Parameters
    ----------
    case
        The case.
    rtol
        Tolerance of the wave.

    Returns
    -------
    CaseResult
        Error and faults. An outcome that differs from the reference's is no fault if rounding
        decides whether the wave stalls.
    """
    wave = simulate(case.layout, case.physics, rtol=rtol)
    margin = float(np.nanmin(wave.stall_margin))
    if (stored := reference_waves().get(str(case))) is not None:
        error, right = stored.relative_error(wave.arrival_times), stored.outcome
        against, margin = "many digits", min(margin, stored.lowest)
        slack = 4e-16  # rounding of an arrival time
    else:
        tight = simulate(case.layout, case.physics, rtol=MIN_RTOL)
        error, right = largest_difference(wave.arrival_times, tight.arrival_times), tight.outcome
        against, margin = "tightest run", min(margin, float(np.nanmin(tight.stall_margin)))
        slack = tight.error_estimate
    faults = inconsistencies(wave)
    if case.expected and wave.outcome not in case.expected:
        faults.append(f"expected {' or '.join(outcome.name for outcome in case.expected)}")
    if wave.outcome == right or margin >= UNDECIDED:
        if wave.outcome != right:
            faults.append(f"outcome {wave.outcome.name}, {right.name} in the reference")
        if error > wave.error_estimate + slack:
            faults.append(f"error {error:.1e} above its estimate")
        if wave.converged and error > rtol + slack:
            faults.append(f"error {error:.1e} above the tolerance {rtol:g}")
    return CaseResult(
        case.group, case.name, wave.outcome.name, error, wave.error_estimate, wave.converged,
        against, "; ".join(faults),
    )  # fmt: skip


def inconsistencies(wave: Wave) -> list[str]:
    """Return the contradictions within a wave, one sentence each."""
    times, is_hit = wave.arrival_times, np.isfinite(wave.arrival_times)
    velocities = wave.release_velocity[is_hit][:-1]
    checks = {
        "arrival times do not grow": np.all(np.diff(times[is_hit]) > 0.0)
        and not np.isnan(times).any(),
        f"hit is {wave.hit}, {is_hit.sum()} arrival times are finite": is_hit.sum() == wave.hit,
        f"error estimate {wave.error_estimate}": wave.error_estimate >= 0.0
        and (wave.error_estimate < math.inf or not wave.converged),
        "a leading domino has no velocity": np.all(velocities > 0.0),
        f"reach {wave.reach} with outcome {wave.outcome.name}": (wave.outcome == COMPLETES)
        == (wave.reach == 1.0),
    }
    return [fault for fault, right in checks.items() if not right]
