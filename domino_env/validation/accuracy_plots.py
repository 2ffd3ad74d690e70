"""Plots of errors: against run time, and of edge cases beside their estimates."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
from matplotlib.ticker import EngFormatter

from domino_env.core.colours import AMBER, BLUE, GREEN, INK, PALE, PINK, RED, SHADE, SKY, SOFT
from domino_env.core.plot_style import LEGEND, new_panels, style, write_png
from domino_env.validation.accuracy import SIMULATE, Measurement
from domino_env.validation.edge_cases import RTOL, Answer, EdgeCase

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
        label = f"{outcome.lower().replace('_', ' ')} ({len(mine)})"
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
