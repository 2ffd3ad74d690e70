"""Error against run time: the steppers of the field and our solver on the same rows.

The error of a run is the largest |t_k / exact t_k - 1| over the arrival times, exact being our
solver at its tightest tolerance (which the tests hold against a hundred digits).  Run times are
the best of repeated calls, warmed up, on one core.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from domino_env.core.tables import csv_table
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import TIGHTEST, Outcome, Wave, simulate
from domino_env.scenes.scene import Scene
from domino_env.validation.accuracy.edge_rows import dipping_push
from domino_env.validation.accuracy.steppers import ADAPTIVE, FIXED, step_row

Floats = NDArray[np.float64]
Progress = Callable[[str], object]

OURS = "ours"
SOLVERS = (OURS, *FIXED, *ADAPTIVE)
LEVELS = (1e-3, 1e-6, 1e-9, 1e-12)  # errors at which run times are compared
TURNS = 3  # after the first
GROWTH = {"step": 2.2, "tolerance": 4.0}  # how much longer the next finer setting may take


@dataclass(frozen=True, eq=False)
class Row:
    """A row to be measured on.

    Attributes
    ----------
    name
        A short one, for tables and files.
    title
        What makes it worth measuring on.
    layout
        What stands.
    physics
        What makes it fall.
    """

    name: str
    title: str
    layout: Layout
    physics: Physics


@dataclass(frozen=True)
class Measurement:
    """One run.

    Attributes
    ----------
    row
        Name of the row.
    solver
        One of `SOLVERS`.
    setting
        Step [s] or relative tolerance.
    error
        Largest relative error of the arrival times; inf where the wave ended otherwise than the
        exact one.
    estimate
        What our solver says its error is; nan for steppers, which do not say.
    seconds
        Run time of one call, the best of several.
    evaluations
        Of the stack's acceleration; 0 for ours, which has none.
    outcome
        Name of the wave's `Outcome`; UNFINISHED where a stepper did not get there.
    """

    row: str
    solver: str
    setting: float
    error: float
    estimate: float
    seconds: float
    evaluations: int
    outcome: str


def standard_rows() -> list[Row]:
    """List the classic row, a random one with flushes, one that nearly stalls and a stiff one."""
    rng = np.random.default_rng(3)
    hesitant = Layout([0.02, 0.012, 0.004, *[0.015] * 36], 0.0075)
    push = dipping_push(hesitant, Physics(), 1e-3)
    return [
        Row(
            "classic",
            "100 equal dominoes, pitch 16 mm",
            Layout.uniform(100, pitch=0.016),
            Physics(0.25, 9.8, 5.0 * math.pi),
        ),
        Row(
            "flushes",
            "40 dominoes at random gaps of 2 to 40 mm",
            Layout(rng.uniform(0.002, 0.040, 39), 0.0075),
            Physics(),
        ),
        Row(
            "near-stall",
            "40 dominoes; the third keeps a thousandth of its ω²",
            hesitant,
            replace(Physics(), push=push),
        ),
        Row(
            "stiff",
            "60 equal dominoes, gaps of 1.5 mm, friction 0.6",
            Layout.uniform(60, spacing=0.0015),
            Physics(0.6, 9.81, 200.0),
        ),
    ]


def scene_rows(scene: Scene) -> list[Row]:
    """List a scene's best uniform row and, where gaps are free, a random row that propagates."""
    best = scene.uniform().layout
    rows = [Row("uniform", f"{scene.name}: the best uniform row", best, scene.physics)]
    rng = np.random.default_rng(0)
    for _ in range(200 if scene.free_spacing and scene.length is None else 0):
        gaps = rng.uniform(*scene.spacing, scene.count - 1)
        thick = rng.uniform(*scene.thickness, scene.count - 1) if scene.free_thickness else None
        layout = scene.layout(gaps, thick)
        if simulate(layout, scene.physics, rtol=1e-6).outcome == Outcome.PROPAGATED:
            rows.append(Row("random", f"{scene.name}: a random row", layout, scene.physics))
            break
    return rows


def error_of(arrival_times: Floats, exact: Floats) -> float:
    """Return the largest relative error; inf where other dominoes are struck."""
    struck = np.isfinite(exact)
    if not np.array_equal(np.isfinite(arrival_times), struck):
        return math.inf
    struck[0] = False  # the push is the zero of time
    return float(np.max(np.abs(arrival_times[struck] / exact[struck] - 1.0), initial=0.0))


def settings(solver: str, row: Row, quick: bool = False) -> tuple[float, ...]:
    """List the steps or tolerances of a solver, coarse to fine.

    Steps are 0.1 ms times powers of two for a standard domino on Earth, in units of √(L/g) for
    others.
    """
    if solver == OURS:
        return tuple(10.0**-p for p in ((3, 6, 9, 12) if quick else range(3, 13)))
    if solver in ADAPTIVE:
        return tuple(10.0**-p for p in ((4, 8) if quick else range(3, 14)))
    swing = math.sqrt(float(row.layout.height.min()) / row.physics.gravity)
    unit = 1e-4 * swing / math.sqrt(0.048 / 9.81)
    return tuple(unit * 2.0**k for k in (range(4, 0, -1) if quick else range(6, -12, -1)))


def measure(
    rows: Iterable[Row],
    budget: float = 3.0,
    quick: bool = False,
    progress: Progress | None = None,
) -> Iterator[Measurement]:
    """Measure every solver on every row.

    Parameters
    ----------
    rows
        What is toppled.
    budget
        Time for one solver on one row [s]; finer settings that would not fit are left out.
    quick
        Few settings, each measured once.
    progress
        Called with a line of text before every run.
    """
    for row in rows:
        wave = simulate(row.layout, row.physics, rtol=TIGHTEST)
        for solver in SOLVERS:
            _warm_up(solver, row)
            yield from _curve(row, wave, solver, budget, quick, progress)


def _curve(
    row: Row, exact: Wave, solver: str, budget: float, quick: bool, progress: Progress | None
) -> list[Measurement]:
    """Measure one solver on one row.

    What is quick is measured again in later turns: other programs may keep the machine busy for a
    while.
    """
    found: dict[float, Measurement] = {}
    spent, growth = 0.0, GROWTH["step" if solver in FIXED else "tolerance"]
    for setting in settings(solver, row, quick):
        if progress is not None:
            progress(f"{row.name}: {solver} at {setting:.3g}")
        found[setting] = one = _measure(row, exact, solver, setting)
        spent += one.seconds
        if spent + growth * one.seconds > budget:
            break
    for _ in range(0 if quick else TURNS):
        for setting, one in found.items():
            if one.seconds < 0.2:
                again = _measure(row, exact, solver, setting)
                found[setting] = min(one, again, key=lambda m: m.seconds)
    return list(found.values())


def _warm_up(solver: str, row: Row) -> None:
    """Compile, so that no run pays for it."""
    if solver == OURS:
        simulate(row.layout, row.physics, rtol=1e-6)
    else:
        short = Layout.uniform(3, pitch=0.016)
        step_row(short, Physics(), solver, 1e-3)


def _measure(row: Row, exact: Wave, solver: str, setting: float) -> Measurement:
    """One setting: the best of as many runs as fit into 10 ms."""
    seconds: list[float] = []
    estimate = math.nan
    evaluations = 0
    while sum(seconds) < 0.01:
        began = time.process_time()  # whatever else the machine does
        if solver == OURS:
            wave = simulate(row.layout, row.physics, rtol=setting)
            outcome: Outcome | None = wave.outcome
            times, estimate = wave.arrival_times, wave.error_estimate
        else:
            stepped = step_row(row.layout, row.physics, solver, setting)
            times, outcome = stepped.arrival_times, stepped.outcome
            evaluations = stepped.evaluations
        seconds.append(time.process_time() - began)
    right = outcome == exact.outcome
    return Measurement(
        row=row.name,
        solver=solver,
        setting=setting,
        error=error_of(times, exact.arrival_times) if right else math.inf,
        estimate=estimate,
        seconds=min(seconds),
        evaluations=evaluations,
        outcome="UNFINISHED" if outcome is None else outcome.name,
    )


def time_to_reach(runs: Iterable[Measurement], level: float) -> float:
    """Return the seconds of the fastest way to an error of `level`; nan where no run came so close.

    Between the settings measured, along the line in the logarithms.
    """
    points = sorted((m.seconds, m.error) for m in runs if math.isfinite(m.error))
    best = math.nan
    before: tuple[float, float] | None = None
    for seconds, error in points:
        if error <= level:
            best = seconds
            if before is not None and before[1] > level and error > 0.0:
                share = math.log(before[1] / level) / math.log(before[1] / error)
                best = before[0] * (seconds / before[0]) ** share
            break
        before = (seconds, error)
    return best


def compare(measurements: list[Measurement]) -> list[str]:
    """Tabulate the run time to reach each level of error, and how many times ours it is."""
    lines = []
    for row in dict.fromkeys(m.row for m in measurements):
        lines += ["", f"{row}: seconds to an error of (times ours)"]
        lines.append(f"{'':10}" + "".join(f"{level:>22.0e}" for level in LEVELS))
        mine = {}
        for solver in SOLVERS:
            runs = [m for m in measurements if m.row == row and m.solver == solver]
            cells = ""
            for level in LEVELS:
                seconds = time_to_reach(runs, level)
                if solver == OURS:
                    mine[level] = seconds
                if math.isnan(seconds):
                    floor = min((m.error for m in runs), default=math.inf)
                    cells += f"{f'ends at {floor:.0e}':>22}"
                else:
                    cells += f"{f'{seconds:.2e} ({seconds / mine[level]:.0f})':>22}"
            lines.append(f"{solver:10}{cells}")
    return lines


def as_csv(measurements: list[Measurement]) -> str:
    """Write all runs as a table in CSV; SI units."""
    names = ("row", "solver", "setting", "error", "estimate", "seconds", "evaluations", "outcome")
    rows = (
        (
            m.row, m.solver, f"{m.setting:.6g}", "" if math.isinf(m.error) else f"{m.error:.3e}",
            "" if math.isnan(m.estimate) else f"{m.estimate:.3e}", f"{m.seconds:.4e}",
            m.evaluations, m.outcome,
        )
        for m in measurements
    )  # fmt: skip
    return csv_table(names, rows)
