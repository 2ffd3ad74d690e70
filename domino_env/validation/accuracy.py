"""Error against run time of the simulator and of general ODE solvers on the same layouts.

The error of a run is the largest |t_k / exact t_k - 1| over the arrival times, where the exact ones
are those of the simulator at its tightest tolerance (which the tests compare with a hundred
digits). Run times are the best of repeated calls on one core, after a first one.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.ticker import EngFormatter

from domino_env.core.colours import AMBER, BLUE, GREEN, INK, PALE, PINK, RED, SHADE, SKY, SOFT
from domino_env.core.plot_style import LEGEND, new_panels, style, write_png
from domino_env.core.results import as_json
from domino_env.core.tables import csv_table, text_table
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import TIGHTEST, Wave, simulate
from domino_env.validation.edge_cases import RTOL, TIP, Answer, EdgeCase, error_of
from domino_env.validation.ode import ADAPTIVE, FIXED, integrate

Progress = Callable[[str], object]

SIMULATE = "simulate"
SOLVERS = (SIMULATE, *FIXED, *ADAPTIVE)
LEVELS = (1e-3, 1e-6, 1e-9, 1e-12)  # errors at which run times are compared
LONG_ENOUGH = 0.01  # [s] of repeated runs


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
        Largest relative error of the arrival times; inf where the outcome is wrong.
    estimate
        Error estimate of the simulator; nan for ODE solvers, which have none.
    seconds
        Run time of one call [s], the best of several.
    """

    example: str
    solver: str
    setting: float
    error: float
    estimate: float
    seconds: float


def standard_examples() -> list[EdgeCase]:
    """Return a classic layout, a random one with face impacts, one near a stall, a stiff one."""
    random = np.random.default_rng(3).uniform(0.002, 0.040, 39)
    tight = Layout([0.02, 0.012, 0.004, *[0.015] * 36], 0.0075)
    equal, stiff = Layout.uniform(100, pitch=0.016), Layout.uniform(60, spacing=0.0015)
    near = Physics(push=TIP / math.sqrt(1.0 - 1e-3))
    examples = {
        "classic": ("100 equal dominoes, pitch 16 mm", equal, Physics(0.25, 9.8, 5.0 * math.pi)),
        "face-impacts": (
            "40 dominoes at random gaps of 2 to 40 mm", Layout(random, 0.0075), Physics()
        ),
        "near-stall": ("40 dominoes; the first keeps a thousandth of its ω²", tight, near),
        "stiff": (
            "60 equal dominoes, gaps of 1.5 mm, friction 0.6", stiff, Physics(0.6, 9.81, 200.0)
        ),
    }  # fmt: skip
    return [EdgeCase(group, *rest) for group, rest in examples.items()]


def settings(solver: str, example: EdgeCase, quick: bool = False) -> tuple[float, ...]:
    """Return the steps or tolerances of a solver, coarse to fine.

    Steps are 0.1 ms times powers of two for a standard domino on Earth, in units of √(L/g) for
    others.
    """
    if solver == SIMULATE:
        return tuple(10.0**-p for p in ((3, 6, 9, 12) if quick else range(3, 13)))
    if solver in ADAPTIVE:
        return tuple(10.0**-p for p in ((4, 8) if quick else range(3, 14)))
    swing = math.sqrt(float(example.layout.height.min()) / example.physics.gravity)
    unit = 1e-4 * swing / math.sqrt(0.048 / 9.81)
    return tuple(unit * 2.0**k for k in (range(4, 0, -1) if quick else range(6, -12, -1)))


def measure(
    examples: Iterable[EdgeCase],
    seconds: float = 3.0,
    quick: bool = False,
    progress: Progress = lambda line: None,
) -> Iterator[Measurement]:
    """Measure every solver on every example.

    Parameters
    ----------
    examples
        Layouts, each with a short name as its group.
    seconds
        Time limit of one solver on one example [s]; finer settings that exceed it are left out.
    quick
        Use few settings.
    progress
        Function that is called with a line of text before every run.
    """
    for example in examples:
        exact = simulate(example.layout, example.physics, rtol=TIGHTEST)
        for solver in SOLVERS:
            if solver != SIMULATE:  # compile it
                integrate(Layout.uniform(3, pitch=0.016), Physics(), solver, 1e-3)
            growth = 2.2 if solver in FIXED else 4.0  # largest factor to the next setting
            used = 0.0
            for setting in settings(solver, example, quick):
                progress(f"{example.group}: {solver} at {setting:.3g}")
                one = _measured(example, exact, solver, setting)
                yield one
                used += one.seconds
                if used + growth * one.seconds > seconds:
                    break


def _measured(example: EdgeCase, exact: Wave, solver: str, setting: float) -> Measurement:
    """Return the best of as many runs of one setting as fit into `LONG_ENOUGH`."""
    seconds: list[float] = []
    estimate = math.nan
    while sum(seconds) < LONG_ENOUGH:
        began = time.process_time()  # which excludes other work of the machine
        if solver == SIMULATE:
            wave = simulate(example.layout, example.physics, rtol=setting)
            outcome, times, estimate = wave.outcome, wave.arrival_times, wave.error_estimate
        else:
            stepped = integrate(example.layout, example.physics, solver, setting)
            outcome, times = stepped.outcome, stepped.arrival_times
        seconds.append(time.process_time() - began)
    error = error_of(times, exact.arrival_times) if outcome == exact.outcome else math.inf
    return Measurement(example.group, solver, setting, error, estimate, min(seconds))


def time_to_reach(runs: Iterable[Measurement], level: float) -> float:
    """Return the shortest run time [s] with an error of at most `level`; nan without one."""
    return min((m.seconds for m in runs if m.error <= level), default=math.nan)


def compare(measurements: Sequence[Measurement]) -> list[str]:
    """Return a table of run times to each error, with their ratios to that of `simulate`."""
    lines, levels = [], [f"{level:.0e}" for level in LEVELS]
    for example in dict.fromkeys(m.example for m in measurements):
        table, runs = [], [m for m in measurements if m.example == example]
        ours = [m for m in runs if m.solver == SIMULATE]
        for solver in SOLVERS:
            mine = [m for m in runs if m.solver == solver]
            best = min((m.error for m in mine), default=math.inf)
            cells = []
            for level in LEVELS:
                seconds, first = time_to_reach(mine, level), time_to_reach(ours, level)
                reached = f"{seconds:.2e} ({seconds / first:.0f})"
                cells.append(f"at best {best:.0e}" if math.isnan(seconds) else reached)
            table.append((solver, *cells))
        lines += ["", f"{example}: seconds to an error of (times those of simulate)"]
        lines += text_table(("", *levels), table, right=levels)
    return lines


def as_csv(records: Sequence[Any]) -> str:
    """Return measurements or answers as CSV in SI units, with empty cells for missing numbers."""
    names = [field.name for field in fields(records[0])]
    return csv_table(names, (as_json(astuple(one)) for one in records))


# Plots --------------------------------------------------------------------------------------------

FLOOR = 1e-16  # errors below rounding are drawn here

# one colour per family: the simulator, fixed steps, SciPy
LOOKS = {
    SIMULATE: (BLUE, "simulate"),
    "euler": (PALE, "Euler, hits to the step"),
    "rk4-step": (SOFT, "RK4, hits to the step"),
    "rk4": (INK, "RK4, hits located"),
    "RK45": (SKY, "SciPy RK45"),
    "DOP853": (PINK, "SciPy DOP853"),
    "Radau": (GREEN, "SciPy Radau"),
    "LSODA": (AMBER, "SciPy LSODA"),
}
OUTCOMES = {
    "PROPAGATED": BLUE, "STALLED": AMBER, "JAMMED": RED, "OUT_OF_REACH": SOFT,
    "NO_RIGID_ANSWER": PINK,
}  # fmt: skip


def draw_accuracy(
    examples: Sequence[EdgeCase], measurements: Sequence[Measurement], path: Path
) -> None:
    """Draw error against run time, one panel per example; best is the lower left corner."""
    across = 2
    figure, panels = new_panels(
        len(examples), across, (5.6, 4.1), (0.0, 0.4),
        "Error against run time of eight solvers of the same equations", "lower left is better",
        sharex=True, sharey=True,
    )  # fmt: skip
    for axes, example in zip(panels, examples, strict=True):
        for solver, (colour, label) in LOOKS.items():
            mine = [m for m in measurements if (m.example, m.solver) == (example.group, solver)]
            times = [m.seconds for m in mine]
            errors = [min(max(m.error, FLOOR), 10.0) for m in mine]  # a wrong outcome at the top
            width = 2.4 if solver == SIMULATE else 1.3
            axes.loglog(times, errors, color=colour, label=label, marker="o", lw=width, ms=4)
        axes.set_ylim(0.4 * FLOOR, 30.0)
        axes.xaxis.set_major_formatter(EngFormatter("s"))
        style(axes, example.name)
    for axes in panels[-across:]:
        axes.set_xlabel("processor time (logarithmic)")
    for axes in panels[::across]:
        axes.set_ylabel("relative error of arrival times (log.)")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, **LEGEND)
    write_png(figure, path)


def draw_stability(answers: Sequence[Answer], path: Path) -> None:
    """Draw every edge case as a column: a dot for the true error, a bar for its estimate."""
    wrong = sum(bool(one.faults) for one in answers)
    figure, (axes,) = new_panels(
        1, 1, (10.0, 6.0),
        headline=f"{len(answers)} edge cases: {wrong or 'none'} with a fault",
        subtitle="a column per layout; dot: true error; bar: error estimate, never below its dot",
    )  # fmt: skip
    groups = list(dict.fromkeys(one.group for one in answers))
    answers = sorted(answers, key=lambda one: groups.index(one.group))
    places: list[float] = []
    ticks, names, right = [], [], 0.0
    for k, (name, group) in enumerate(groupby(answers, lambda one: one.group)):
        columns = right + np.arange(len(list(group)))
        if k % 2 == 0:
            axes.axvspan(right - 1.5, columns[-1] + 1.5, color=SHADE, zorder=0)
        places.extend(columns)
        ticks.append(columns.mean())
        names.append(name)
        right = columns[-1] + 3.5
    for outcome, colour in OUTCOMES.items():
        mine = [(p, one) for p, one in zip(places, answers, strict=True) if one.outcome == outcome]
        if not mine:
            continue
        where = [p for p, _ in mine]
        errors = [max(one.error, FLOOR) for _, one in mine]
        estimates = [max(one.estimate, FLOOR) for _, one in mine]
        ended = "completes" if outcome == "PROPAGATED" else outcome.lower().replace("_", " ")
        label = f"{ended} ({len(mine)})"
        axes.vlines(where, errors, estimates, color=colour, linewidth=1.0, alpha=0.45)
        axes.plot(where, estimates, "_", color=colour, markersize=6)
        axes.plot(where, errors, "o", color=colour, markersize=3.2, label=label)
    axes.axhline(RTOL, color=INK, linewidth=0.8, linestyle="--", label=f"tolerance {RTOL:g}")
    axes.set_xlim(-2.5, right)
    axes.set_yscale("log")
    axes.set_ylim(0.4 * FLOOR, 10.0)
    axes.set_xticks(ticks, names, rotation=60, ha="right")
    axes.set_ylabel("relative error of arrival times (logarithmic)")
    axes.grid(axis="x", visible=False)
    axes.legend(loc="upper right", ncols=3, **LEGEND)
    write_png(figure, path)
