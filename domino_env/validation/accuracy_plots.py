"""Plots of errors: against run time, and of edge cases beside their estimates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from domino_env.core.colours import (
    AMBER,
    BLUE,
    GREEN,
    INK,
    PALE,
    PINK,
    RED,
    SHADE,
    SKY,
    SOFT,
    UNIFORM,
)
from domino_env.core.plot_style import LEGEND, new_panels, style, write_png
from domino_env.validation.accuracy import SIMULATE, Measurement, time_to_reach
from domino_env.validation.edge_cases import RTOL, Answer, EdgeCase

FLOOR = 1e-16  # errors below rounding are drawn here

# one colour per family: the simulator, fixed steps, SciPy
LOOKS = {
    SIMULATE: (BLUE, "o", "simulate"),
    "euler": (PALE, "v", "Euler, hits to the step"),
    "rk4-step": (SOFT, "^", "RK4, hits to the step"),
    "rk4": (INK, "s", "RK4, hits located"),
    "RK45": (SKY, "D", "SciPy RK45"),
    "DOP853": (PINK, "D", "SciPy DOP853"),
    "Radau": (GREEN, "P", "SciPy Radau"),
    "LSODA": (AMBER, "X", "SciPy LSODA"),
}
OUTCOMES = {
    "PROPAGATED": (BLUE, "completes"),
    "STALLED": (AMBER, "stalled"),
    "JAMMED": (RED, "jammed"),
    "OUT_OF_REACH": (UNIFORM, "out of reach"),
    "NO_RIGID_ANSWER": (PINK, "no rigid answer"),
}


def draw_accuracy(
    examples: Sequence[EdgeCase], measurements: Sequence[Measurement], path: Path
) -> None:
    """Draw error against run time, one panel per example; best is the lower left corner."""
    across = 2
    figure, panels = new_panels(
        len(examples), across, (5.6, 4.1), (0.0, 0.4),
        "Error against run time of eight solvers of the same equations",
        "lower left is better; arrows: run time of RK4 with located hits over that of simulate",
        sharex=True, sharey=True,
    )  # fmt: skip
    for axes, example in zip(panels, examples, strict=True):
        runs = [m for m in measurements if m.example == example.group]
        for solver, (colour, marker, label) in LOOKS.items():
            mine, ours = [m for m in runs if m.solver == solver], solver == SIMULATE
            good = [m for m in mine if math.isfinite(m.error)]
            axes.plot(
                [m.seconds for m in good], [max(m.error, FLOOR) for m in good], color=colour,
                marker=marker, markersize=6 if ours else 4, linewidth=2.4 if ours else 1.3,
                label=label, zorder=5 if ours else 3,
            )  # fmt: skip
            bad = [m.seconds for m in mine if not math.isfinite(m.error)]
            axes.plot(bad, np.full(len(bad), 10.0), color=colour, marker="x", linestyle="none")
        axes.set_xscale("log")
        for level in (1e-6, 1e-12):
            _draw_ratio(axes, runs, level)
        _errors(axes, 30.0)
        axes.xaxis.set_major_formatter(FuncFormatter(_seconds))
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
    for outcome, (colour, label) in OUTCOMES.items():
        mine = [(p, one) for p, one in zip(places, answers, strict=True) if one.outcome == outcome]
        if not mine:
            continue
        where = [p for p, _ in mine]
        errors = [max(one.error, FLOOR) for _, one in mine]
        estimates = [max(one.estimate, FLOOR) for _, one in mine]
        axes.vlines(where, errors, estimates, color=colour, linewidth=1.0, alpha=0.45)
        axes.plot(where, estimates, linestyle="none", marker="_", color=colour, markersize=6)
        axes.plot(where, errors, linestyle="none", marker="o", color=colour, markersize=3.2)
        axes.plot([], [], color=colour, linewidth=3, label=f"{label} ({len(mine)})")
    axes.axhline(RTOL, color=INK, linewidth=0.8, linestyle="--")
    axes.text(right, RTOL, f" tolerance\n {_power(RTOL)}", va="center", fontsize=8, color=INK)
    axes.set_xlim(-2.5, right)
    _errors(axes, 10.0)
    axes.set_xticks(ticks, names, rotation=60, ha="right")
    axes.set_ylabel("relative error of arrival times (logarithmic)")
    axes.grid(axis="x", visible=False)
    axes.tick_params(axis="x", length=0)
    axes.legend(loc="upper right", ncols=5, **LEGEND)
    write_png(figure, path)


def _errors(axes: Axes, highest: float) -> None:
    """Scale the vertical axis for errors down to rounding."""
    axes.set_yscale("log")
    axes.set_ylim(0.4 * FLOOR, highest)
    axes.yaxis.set_major_locator(LogLocator(base=100.0, numticks=20))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(_power))


def _draw_ratio(axes: Axes, runs: Sequence[Measurement], level: float) -> None:
    """Draw the ratio of the run times of RK4 and of the simulator to the same error."""
    ours, best = (
        time_to_reach([m for m in runs if m.solver == solver], level)
        for solver in (SIMULATE, "rk4")
    )
    if best > 1.3 * ours:
        arrow = {"arrowstyle": "<->", "color": INK, "linewidth": 0.9}
        axes.annotate("", (best, level), (ours, level), arrowprops=arrow)
        axes.annotate(
            f"{float(f'{best / ours:.1e}'):g} ×", (math.sqrt(ours * best), level), (0, 3),
            textcoords="offset points", ha="center", fontsize=9, color=INK,
        )  # fmt: skip


def _power(value: float, _: object = None) -> str:
    return f"$10^{{{round(math.log10(value))}}}$"


def _seconds(value: float, _: object = None) -> str:
    if value < 1e-3:
        return f"{value * 1e6:g} µs"
    return f"{value * 1e3:g} ms" if value < 1.0 else f"{value:g} s"
