"""Error against run time of the simulator and of general ODE solvers on the same layouts.

The error of a run is the largest |t_k / T_k - 1| over its arrival times t_k. The exact times T_k
are those of the simulator at its tightest tolerance, which tests compare with `precise`. A run
time is the shortest processor time of repeated calls, after compilation.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import EngFormatter

from domino_env.core.colours import AMBER, BLUE, GREEN, INK, PALE, PINK, RED, SHADE, SKY, SOFT
from domino_env.core.plot_style import LEGEND, new_panels, own_style, style, write_png
from domino_env.core.results import as_json
from domino_env.core.tables import csv_table, text_table
from domino_env.kernels.jit.interpreted import compiled
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import MIN_RTOL, Outcome, Wave, simulate
from domino_env.rigid.simulation import largest_difference
from domino_env.validation.edge_cases import RTOL, TIPPING_PUSH, CaseResult, EdgeCase
from domino_env.validation.ode import ADAPTIVE, FIXED, integrate

SIMULATE = "simulate"  # name of the simulator among the solvers
SOLVERS = (SIMULATE, *FIXED, *ADAPTIVE)
LEVELS = (1e-3, 1e-6, 1e-9, 1e-12)  # errors at which run times are compared
MIN_MEASURED_TIME = 0.01  # [s] total of repeated calls


@dataclass(frozen=True)
class Measurement:
    """Error and run time of one solver with one setting on one layout.

    Attributes
    ----------
    example
        Short name of the layout.
    solver
        One of `SOLVERS`.
    setting
        Step [s] or relative tolerance.
    error
        Largest relative error of the arrival times; inf if the outcome is wrong.
    estimate
        Error estimate of the simulator; nan for ODE solvers, which have none.
    seconds
        Run time of one call [s], the shortest of several.
    """

    example: str
    solver: str
    setting: float
    error: float
    estimate: float
    seconds: float


def standard_examples() -> list[EdgeCase]:
    """Return four examples: classic, random with face impacts, near a stall, and stiff."""
    gaps = np.random.default_rng(3).uniform(0.002, 0.040, 39)
    tight = Layout([0.02, 0.012, 0.004, *[0.015] * 36], 0.0075)
    weak = Physics(push=TIPPING_PUSH / math.sqrt(1.0 - 1e-3))
    return [
        EdgeCase(
            "classic", "100 equal dominoes, pitch 16 mm", Layout.uniform(100, pitch=0.016),
            Physics(0.25, 9.8, 5.0 * math.pi),
        ),
        EdgeCase(
            "face-impacts", "40 dominoes at random gaps of 2 to 40 mm", Layout(gaps, 0.0075),
            Physics(),
        ),
        EdgeCase("near-stall", "40 dominoes; the first keeps a thousandth of its ω²", tight, weak),
        EdgeCase(
            "stiff", "60 equal dominoes, gaps of 1.5 mm, friction 0.6",
            Layout.uniform(60, spacing=0.0015), Physics(0.6, 9.81, 200.0),
        ),
    ]  # fmt: skip


def settings(solver: str, example: EdgeCase, quick: bool = False) -> tuple[float, ...]:
    """Return the steps [s] or tolerances of a solver, from coarse to fine.

    Steps are 0.1 ms times powers of two for a standard domino on Earth, and in proportion to √(L/g)
    for others.
    """
    if solver == SIMULATE:
        return tuple(10.0**-p for p in ((3, 6, 9, 12) if quick else range(3, 13)))
    if solver in ADAPTIVE:
        return tuple(10.0**-p for p in ((4, 8) if quick else range(3, 14)))
    time_scale = math.sqrt(float(example.layout.height.min()) / example.physics.gravity)
    unit = 1e-4 * time_scale / math.sqrt(0.048 / 9.81)  # 0.048 m: height of the standard domino
    return tuple(unit * 2.0**k for k in (range(4, 0, -1) if quick else range(6, -12, -1)))


def measure(
    examples: Iterable[EdgeCase],
    seconds: float = 3.0,
    quick: bool = False,
    progress: Callable[[str], object] = str,
) -> Iterator[Measurement]:
    """Measure every solver on every example.

    Parameters
    ----------
    examples
        Layouts, each with a short name as its group.
    seconds
        Time limit of one solver on one example [s]. Settings after the first that are expected to
        exceed it are left out.
    quick
        Use few settings.
    progress
        Function that is called with a line of text before every run; the default has no effect.

    Yields
    ------
    Measurement
        Error and run time of each setting, coarse to fine.
    """
    for example in examples:
        with compiled():
            exact = simulate(example.layout, example.physics, rtol=MIN_RTOL)
        for solver in SOLVERS:
            if solver != SIMULATE:
                with compiled():
                    integrate(Layout.uniform(3, pitch=0.016), Physics(), solver, 1e-3)
            growth = 2.2 if solver in FIXED else 4.0  # largest expected increase of the run time
            used = 0.0
            for setting in settings(solver, example, quick):
                progress(f"{example.group}: {solver} at {setting:.3g}")
                measurement = _measure_setting(example, exact, solver, setting)
                yield measurement
                used += measurement.seconds
                if used + growth * measurement.seconds > seconds:
                    break


def _measure_setting(example: EdgeCase, exact: Wave, solver: str, setting: float) -> Measurement:
    """Measure one setting by repeated calls, for at least `MIN_MEASURED_TIME` in total."""
    seconds: list[float] = []
    estimate = math.nan
    while sum(seconds) < MIN_MEASURED_TIME:
        start = time.process_time()  # excludes other processes
        if solver == SIMULATE:
            wave = simulate(example.layout, example.physics, rtol=setting)
            outcome, times, estimate = wave.outcome, wave.arrival_times, wave.error_estimate
        else:
            outcome, times = integrate(example.layout, example.physics, solver, setting)
        seconds.append(time.process_time() - start)
    is_right = outcome == exact.outcome
    error = largest_difference(times, exact.arrival_times) if is_right else math.inf
    return Measurement(example.group, solver, setting, error, estimate, min(seconds))


def time_to_reach(runs: Iterable[Measurement], level: float) -> float:
    """Return the shortest run time of runs with at most this error [s]; nan if there is none."""
    return min((m.seconds for m in runs if m.error <= level), default=math.nan)


def compare(measurements: Sequence[Measurement]) -> list[str]:
    """Return the lines of tables of run times to reach errors, over those of `simulate`."""
    lines, levels = [], [f"{level:.0e}" for level in LEVELS]
    for example in dict.fromkeys(m.example for m in measurements):
        table, simulated = [], _runs(measurements, example, SIMULATE)
        for solver in SOLVERS:
            runs, cells = _runs(measurements, example, solver), []
            for level in LEVELS:
                seconds = time_to_reach(runs, level)
                cells.append(f"{seconds:.2e} ({seconds / time_to_reach(simulated, level):.0f})")
                if math.isnan(seconds):
                    cells[-1] = f"at best {min((m.error for m in runs), default=math.inf):.0e}"
            table.append((solver, *cells))
        lines += ["", f"{example}: run time [s] to reach an error (multiple of that of simulate)"]
        lines += text_table(("", *levels), table, right=levels)
    return lines


def _runs(measurements: Iterable[Measurement], example: str, solver: str) -> list[Measurement]:
    return [m for m in measurements if (m.example, m.solver) == (example, solver)]


def as_csv(records: Sequence[Any]) -> str:
    """Return measurements or case results as CSV in SI units; missing numbers are empty cells."""
    names = [field.name for field in fields(records[0])]
    return csv_table(names, (as_json(astuple(record)) for record in records))


# Plots --------------------------------------------------------------------------------------------

LEAST_ERROR = 1e-16  # smaller errors are below rounding, and are drawn there

# colour and label of each solver
STYLES = {
    SIMULATE: (BLUE, "simulate"),
    "euler": (PALE, "Euler, events at step ends"),
    "rk4-step": (SOFT, "RK4, events at step ends"),
    "rk4": (INK, "RK4, events located"),
    "RK45": (SKY, "SciPy RK45"),
    "DOP853": (PINK, "SciPy DOP853"),
    "Radau": (GREEN, "SciPy Radau"),
    "LSODA": (AMBER, "SciPy LSODA"),
}
OUTCOME_COLOURS = {
    "PROPAGATED": BLUE, "STALLED": AMBER, "JAMMED": RED, "OUT_OF_REACH": SOFT,
    "NO_RIGID_ANSWER": PINK,
}  # fmt: skip


@own_style()
def draw_accuracy(
    examples: Sequence[EdgeCase], measurements: Sequence[Measurement], path: Path
) -> None:
    """Draw error against run time into a PNG file, one panel per example."""
    across = 2  # panels in a line
    figure, panels = new_panels(
        len(examples), across, (4.6, 3.4), (0.0, 0.5),
        "Error against run time of eight solvers of the same equations", "lower left is better",
        sharex=True, sharey=True,
    )  # fmt: skip
    for axes, example in zip(panels, examples, strict=True):
        for solver, (colour, label) in STYLES.items():
            runs = _runs(measurements, example.group, solver)
            times = [m.seconds for m in runs]
            errors = [min(max(m.error, LEAST_ERROR), 10.0) for m in runs]  # 10: a wrong outcome
            width = 2.4 if solver == SIMULATE else 1.3
            axes.loglog(times, errors, color=colour, label=label, marker="o", lw=width, ms=4)
        axes.set_ylim(0.4 * LEAST_ERROR, 30.0)
        axes.xaxis.set_major_formatter(EngFormatter("s"))
        style(axes, example.name)
    for axes in panels[-across:]:
        axes.set_xlabel("processor time (logarithmic)")
    for axes in panels[::across]:
        axes.set_ylabel("relative error of arrival times (log.)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, **LEGEND)
    write_png(figure, path)


@own_style()
def draw_stability(results: Sequence[CaseResult], path: Path) -> None:
    """Draw every edge case as a column: a dot for the true error, a bar for its estimate."""
    faulty = sum(bool(result.faults) for result in results)
    figure, (axes,) = new_panels(
        1, 1, (10.0, 6.0),
        headline=f"True error and error estimate of {len(results)} layouts at limits of the model",
        subtitle="each column is a layout: the dot is its true error, the bar its error estimate "
        f"(at the top: infinite); wrong results or estimates: {faulty or 'none'}",
    )  # fmt: skip
    groups = list(dict.fromkeys(result.group for result in results))
    results = sorted(results, key=lambda result: groups.index(result.group))
    numbers = np.array([groups.index(result.group) for result in results])
    places = np.arange(len(results)) + 2.5 * numbers  # with space between groups
    columns = [places[numbers == k] for k in range(len(groups))]
    for group_places in columns[::2]:
        axes.axvspan(group_places[0] - 1.5, group_places[-1] + 1.5, color=SHADE, zorder=0)
    outcomes = np.array([result.outcome for result in results])
    # 10: a wrong outcome, or an outcome that rounding decides
    drawn = np.clip([(result.error, result.estimate) for result in results], LEAST_ERROR, 10.0)
    for outcome, colour in OUTCOME_COLOURS.items():
        x, (errors, estimates) = places[outcomes == outcome], drawn[outcomes == outcome].T
        if not len(x):
            continue
        ending = "completes" if outcome == "PROPAGATED" else Outcome[outcome].label
        axes.vlines(x, errors, estimates, color=colour, linewidth=1.0, alpha=0.45)
        axes.plot(x, estimates, "_", color=colour, markersize=6)
        label = f"{ending} ({len(x)})"
        axes.plot(x, errors, "o", color=colour, markersize=3.2, label=label)
    axes.axhline(RTOL, color=INK, linewidth=0.8, linestyle="--", label=f"tolerance {RTOL:g}")
    axes.set_xlim(-2.5, places[-1] + 3.5)
    axes.set_yscale("log")
    axes.set_ylim(0.4 * LEAST_ERROR, 30.0)
    axes.set_xticks([places.mean() for places in columns], groups, rotation=60, ha="right")
    axes.set_ylabel("relative error of arrival times (logarithmic)")
    axes.grid(axis="x", visible=False)
    axes.legend(loc="upper right", ncols=3, **LEGEND)
    write_png(figure, path)
