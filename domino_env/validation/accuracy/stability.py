"""Rows at the edge, run and judged.

Is the answer right, and does the run say how right it is?
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib.util import find_spec

import numpy as np

from domino_env.core.tables import csv_table, text_table
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import TIGHTEST, Outcome, Wave, simulate
from domino_env.validation.accuracy.edge_rows import Extreme, extremes
from domino_env.validation.accuracy.measurement import error_of

Progress = Callable[[str], object]

RTOL = 1e-8  # the tolerance that rows are judged at
CLOSE = 1e-9  # stall margins below this leave it to rounding whether a wave stalls
SAME = 1e-12  # dimensionless answers of similar rows agree to this


@dataclass(frozen=True)
class Verdict:
    """How one row at the edge went.

    Attributes
    ----------
    group
        What is extreme.
    name
        How much.
    outcome
        Name of the wave's `Outcome`.
    error
        True relative error of the arrival times.
    estimate
        What the run said it is.
    converged
        As `Wave.converged`.
    against
        What the error was taken against: "60 digits", "tightest run" or "similar row".
    seconds
        Run time.
    complaints
        All that is not as it should be, in words; empty where the answer is right.
    """

    group: str
    name: str
    outcome: str
    error: float
    estimate: float
    converged: bool
    against: str
    seconds: float
    complaints: tuple[str, ...]


def judge(extreme: Extreme, rtol: float = RTOL) -> Verdict:
    """Run a row and hold its answer against sixty digits (where cheap) or the tightest run."""
    began = time.perf_counter()
    wave = simulate(extreme.layout, extreme.physics, rtol=rtol)
    seconds = time.perf_counter() - began
    if extreme.exact and find_spec("mpmath") is not None:
        from domino_env.validation.accuracy.many_digits import true_wave

        true = true_wave(extreme.layout, extreme.physics)
        error, right, slack = true.relative_error(wave.arrival_times), true.outcome, 4e-16
        against, lowest = "60 digits", true.lowest
    else:
        tight = simulate(extreme.layout, extreme.physics, rtol=TIGHTEST)
        error, right = error_of(wave.arrival_times, tight.arrival_times), tight.outcome
        against, lowest = "tightest run", float(np.nanmin(tight.stall_margin))
        slack = tight.error_estimate
    undecided = wave.outcome != right and min(lowest, _lowest(wave)) < CLOSE
    complaints = of_itself(wave)
    if wave.outcome != right and not undecided:
        complaints.append(f"the outcome is {right.name} by the {against}")
    if extreme.expected is not None and wave.outcome not in extreme.expected:
        wanted = " or ".join(o.name for o in sorted(extreme.expected))
        complaints.append(f"the row was built for {wanted}")
    if not undecided:
        if error > wave.error_estimate + slack:
            complaints.append(f"the true error {error:.1e} exceeds its estimate")
        if wave.converged and error > rtol + slack:
            complaints.append(f"the true error {error:.1e} exceeds the tolerance {rtol:g}")
    return Verdict(
        extreme.group,
        extreme.name,
        wave.outcome.name,
        error,
        wave.error_estimate,
        wave.converged,
        against,
        seconds,
        tuple(complaints),
    )


def _lowest(wave: Wave) -> float:
    return float(np.nanmin(wave.stall_margin))


def of_itself(wave: Wave) -> list[str]:
    """List what is wrong with a wave whatever the truth."""
    complaints = []
    times = wave.arrival_times
    struck = np.isfinite(times)
    if np.isnan(times).any() or not np.all(np.diff(times[struck]) > 0.0):
        complaints.append("arrival times do not grow")
    if int(struck.sum()) != wave.hit:
        complaints.append(f"{wave.hit} dominoes are said to be struck, {struck.sum()} have a time")
    if not (wave.error_estimate < math.inf or not wave.converged) or wave.error_estimate < 0.0:
        complaints.append(f"the error estimate is {wave.error_estimate}")
    reached = wave.release_velocity[struck]
    if np.isnan(reached[:-1]).any() or not np.all(reached[:-1] > 0.0):
        complaints.append("a leader has no velocity")
    if (wave.outcome == Outcome.PROPAGATED) != (wave.reach == 1.0):
        complaints.append(f"reach {wave.reach} does not fit {wave.outcome.name}")
    return complaints


def similar_rows() -> Iterator[Verdict]:
    """Judge one random row at sizes from micrometres to kilometres, gravity from 1e-6 to 1e3.

    Times in units of √(L/g) are the same for all; densities may be anything, too.
    """
    rng = np.random.default_rng(5)
    gaps, thick = rng.uniform(0.05, 0.8, 29), rng.uniform(0.1, 0.25, 30)
    for friction in (0.25, 0.0):
        unit = _dimensionless(gaps, thick, friction, 1.0, 1.0, 1000.0)[0]
        for size in (1e-6, 1e-3, 0.048, 1.0, 1e3):
            for gravity in (1e-6, 9.81, 1e3):
                began = time.perf_counter()
                times, wave = _dimensionless(gaps, thick, friction, size, gravity, 1.0 / size)
                error = error_of(times, unit)
                complaints = of_itself(wave)
                if not error <= SAME:
                    complaints.append(f"off the same row of another size by {error:.1e}")
                yield Verdict(
                    "sizes and gravity",
                    f"μ = {friction:g}, L = {size:g} m, g = {gravity:g} m/s²",
                    wave.outcome.name,
                    error,
                    wave.error_estimate,
                    wave.converged,
                    "similar row",
                    time.perf_counter() - began,
                    tuple(complaints),
                )


def _dimensionless(
    gaps: np.ndarray,
    thick: np.ndarray,
    friction: float,
    size: float,
    gravity: float,
    density: float,
) -> tuple[np.ndarray, Wave]:
    swing = math.sqrt(size / gravity)
    row = Layout(gaps * size, thick * size, height=size, width=0.5 * size, density=density)
    wave = simulate(row, Physics(friction, gravity, push=1.5 / swing), rtol=1e-13)
    return wave.arrival_times / swing, wave


def stability(quick: bool = False, progress: Progress | None = None) -> Iterator[Verdict]:
    """Judge every row at the edge, then the same row at many sizes.

    Parameters
    ----------
    quick
        Long rows shortened, and all held against the tightest run only.
    progress
        Called with a line of text before every row.
    """
    for case in extremes(million=not quick):
        if progress is not None:
            progress(f"{case.group}: {case.name}")
        yield judge(replace(case, exact=case.exact and not quick))
    yield from similar_rows()


def as_table(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """Tabulate the verdicts, each with its complaints below it; yields lines."""
    names = ("", "row", "outcome", "true error", "estimate", "converged", "time", "against")
    rows, group = [], ""
    for v in verdicts:
        rows.append((
            v.group if v.group != group else "", v.name, v.outcome, f"{v.error:.1e}",
            f"{v.estimate:.1e}", "yes" if v.converged else "no", f"{v.seconds * 1e3:.2f} ms",
            v.against,
        ))  # fmt: skip
        group = v.group
    head, *lines = text_table(names, rows, right=("true error", "estimate", "time"))
    yield head
    for line, v in zip(lines, verdicts, strict=True):
        yield line
        yield from (f"  !! {complaint}" for complaint in v.complaints)


def as_csv(verdicts: Iterable[Verdict]) -> str:
    """Write the verdicts as a table in CSV."""
    names = (
        "group", "name", "outcome", "error", "estimate", "converged", "against", "seconds",
        "complaints",
    )  # fmt: skip
    rows = (
        (
            v.group, v.name, v.outcome, f"{v.error:.3e}", f"{v.estimate:.3e}",
            str(v.converged).lower(), v.against, f"{v.seconds:.4e}", "; ".join(v.complaints),
        )
        for v in verdicts
    )  # fmt: skip
    return csv_table(names, rows)
