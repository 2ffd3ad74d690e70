"""The pictures of the accuracy reports: error against run time, estimate against true error."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
from domino_env.core.plot_style import (
    HEAD,
    LEGEND,
    headings,
    new_figure,
    new_panels,
    style,
    write_png,
)
from domino_env.validation.accuracy.measurement import (
    OURS,
    SOLVERS,
    Measurement,
    Row,
    time_to_reach,
)
from domino_env.validation.accuracy.stability import RTOL, Verdict

FLOOR = 1e-16  # errors below rounding are drawn here

# one colour a family: ours, fixed steps, SciPy's
LOOKS = {
    OURS: (BLUE, "o", "our solver"),
    "euler": (PALE, "v", "Euler, hits to the step"),
    "rk4-step": (SOFT, "^", "RK4, hits to the step"),
    "rk4": (INK, "s", "RK4, hits located"),
    "RK45": (SKY, "D", "SciPy RK45"),
    "DOP853": (PINK, "D", "SciPy DOP853"),
    "Radau": (GREEN, "P", "SciPy Radau"),
    "LSODA": (AMBER, "X", "SciPy LSODA"),
}


def draw_accuracy(rows: Sequence[Row], measurements: Sequence[Measurement], path: Path) -> None:
    """Draw run time against error, a panel a row; best is the lower left corner."""
    across = 2
    figure, panels = new_panels(
        len(rows),
        across,
        (5.6, 4.1),
        (0.0, 0.4),
        "What accuracy costs: the same equations, eight ways",
        "best is below, on the left; arrows: how many times longer RK4 with located hits takes",
        sharex=True,
        sharey=True,
    )
    for panel, row in zip(panels, rows, strict=True):
        _draw_panel(panel, row, [m for m in measurements if m.row == row.name])
    for panel in panels[-across:]:
        panel.set_xlabel("processor time")
    for panel in panels[::across]:
        panel.set_ylabel("true relative error of the times")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, **LEGEND)
    write_png(figure, path)


def _draw_panel(axes: Axes, row: Row, runs: Sequence[Measurement]) -> None:
    for solver in SOLVERS:
        mine = [m for m in runs if m.solver == solver]
        colour, marker, label = LOOKS[solver]
        good = [m for m in mine if math.isfinite(m.error)]
        axes.plot(
            [m.seconds for m in good],
            [max(m.error, FLOOR) for m in good],
            color=colour,
            marker=marker,
            markersize=6 if solver == OURS else 4,
            linewidth=2.4 if solver == OURS else 1.3,
            label=label,
            zorder=5 if solver == OURS else 3,
        )
        bad = [m.seconds for m in mine if not math.isfinite(m.error)]
        axes.plot(bad, np.full(len(bad), 10.0), color=colour, marker="x", linestyle="none")
    axes.set_xscale("log")
    axes.set_yscale("log")
    for level in (1e-6, 1e-12):
        _draw_gap(axes, runs, level)
    axes.set_ylim(0.4 * FLOOR, 30.0)
    axes.yaxis.set_major_locator(LogLocator(base=100.0, numticks=20))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(_power))
    axes.xaxis.set_major_formatter(FuncFormatter(_seconds))
    style(axes, row.title)


def _draw_gap(axes: Axes, runs: Sequence[Measurement], level: float) -> None:
    """How many times longer our best stepper of order four takes to the same error."""
    ours, best = (
        time_to_reach([m for m in runs if m.solver == solver], level) for solver in (OURS, "rk4")
    )
    if not best > 1.3 * ours:
        return
    axes.annotate(
        "",
        (best, level),
        (ours, level),
        arrowprops={"arrowstyle": "<->", "color": INK, "linewidth": 0.9},
    )
    axes.annotate(
        f"{_rounded(best / ours)} ×",
        (math.sqrt(ours * best), level),
        (0, 3),
        textcoords="offset points",
        ha="center",
        fontsize=9,
        color=INK,
    )


def _rounded(ratio: float) -> str:
    """Two figures."""
    digits = math.floor(math.log10(ratio)) - 1
    return f"{round(ratio / 10.0**digits) * 10.0**digits:g}"


def _power(value: float, _: object = None) -> str:
    return f"$10^{{{round(math.log10(value))}}}$"


def _seconds(value: float, _: object = None) -> str:
    if value < 1e-3:
        return f"{value * 1e6:g} µs"
    return f"{value * 1e3:g} ms" if value < 1.0 else f"{value:g} s"


OUTCOMES = {
    "PROPAGATED": (BLUE, "ran through"),
    "STALLED": (AMBER, "stalled"),
    "JAMMED": (RED, "jammed"),
    "OUT_OF_REACH": (UNIFORM, "a gap out of reach"),
    "NO_RIGID_ANSWER": (PINK, "no rigid answer"),
}


def draw_stability(verdicts: Sequence[Verdict], path: Path) -> None:
    """Draw every row at the edge as a column: a dot for the true error, a bar for its estimate."""
    figure = new_figure(13.0, 5.8 + HEAD)
    wrong = sum(bool(v.complaints) for v in verdicts)
    judged = f"{wrong} not as they should be" if wrong else "no bar below its dot"
    headings(
        figure,
        f"{len(verdicts)} rows at the edge: {judged}",
        "dots: true error; bars: what the run itself says it is",
    )
    axes = figure.add_subplot()
    axes.set_yscale("log")
    places, ticks, x, last = [], [], 0.0, ""
    for v in verdicts:
        if v.group != last:
            x += 2.5 if last else 0.0
            ticks.append([x, x])
            last = v.group
        ticks[-1][1] = x
        places.append(x)
        x += 1.0
    for k, (low, high) in enumerate(ticks):
        if k % 2 == 0:
            axes.axvspan(low - 1.5, high + 1.5, color=SHADE, zorder=0)
    for name, (colour, label) in OUTCOMES.items():
        mine = [(p, v) for p, v in zip(places, verdicts, strict=True) if v.outcome == name]
        if not mine:
            continue
        where = [p for p, _ in mine]
        errors = [max(v.error, FLOOR) for _, v in mine]
        estimates = [max(v.estimate, FLOOR) for _, v in mine]
        axes.vlines(where, errors, estimates, color=colour, linewidth=1.0, alpha=0.45)
        axes.plot(where, estimates, linestyle="none", marker="_", color=colour, markersize=6)
        axes.plot(where, errors, linestyle="none", marker="o", color=colour, markersize=3.2)
        axes.plot([], [], color=colour, linewidth=3, label=f"{label} ({len(mine)})")
    axes.axhline(RTOL, color=INK, linewidth=0.8, linestyle="--")
    axes.text(
        x + 1.5, RTOL, " tolerance\n" + f" {_power(RTOL)}", va="center", fontsize=8, color=INK
    )
    axes.set_ylim(0.3 * FLOOR, 10.0)
    axes.set_xlim(-2.5, x + 1.5)
    axes.yaxis.set_major_locator(LogLocator(base=100.0, numticks=20))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(_power))
    names = list(dict.fromkeys(v.group for v in verdicts))
    axes.set_xticks([0.5 * (a + b) for a, b in ticks], names, rotation=28, ha="right")
    axes.set_ylabel("relative error of the times")
    style(axes)
    axes.grid(axis="x", visible=False)
    axes.tick_params(axis="x", length=0)
    axes.legend(loc="upper right", ncols=5, **LEGEND)
    write_png(figure, path)
