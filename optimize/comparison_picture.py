"""The pictures of a comparison: the gap against run time, and the targets reached."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from domino_env.files import write_bytes
from optimize.comparison import Comparison

INK, SOFT, FAINT = "#1d2126", "#5c636d", "#dfe2e6"
OURS = "#0b6e99"  # the default method's colour and width stand out
DASHES = ("-", "--", "-.", ":")


def draw_gaps(comparison: Comparison, path: Path) -> None:
    """The gap to the best known against run time, a panel a scene; median and range over seeds."""
    figure, panels = _panels(comparison.scenes, comparison.unit)
    times = comparison.times()
    for scene, axes in panels.items():
        axes.set_yscale("log")  # before what is drawn: where all gaps are one, none is guessed
        axes.set_ylim(1e-4, 30.0)
        for method in comparison.methods:
            runs = comparison.of(scene, method)
            if not runs:
                continue
            gaps = np.array([comparison.gaps(r, times) for r in runs])
            middle = np.sort(gaps, axis=0)[(len(gaps) - 1) // 2]
            style = _style(comparison, method)
            axes.plot(times, 100.0 * middle, label=method, **style)
            low, high = gaps.min(axis=0), gaps.max(axis=0)
            axes.fill_between(
                times, 100.0 * low, 100.0 * high, color=style["color"], alpha=0.10, linewidth=0
            )
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g} %"))
    next(iter(panels.values())).set_ylabel("gap to the best known", color=SOFT)
    _save(figure, panels, path)


def draw_targets(comparison: Comparison, path: Path) -> None:
    """The part of the targets reached against run time, a panel a scene and one for all."""
    names = comparison.scenes
    panelled = [*names, "all scenes"] if len(names) > 1 else names
    figure, panels = _panels(panelled, comparison.unit)
    times = comparison.times()
    for scene, axes in panels.items():
        for method in comparison.methods:
            if scene in names and not comparison.of(scene, method):
                continue
            part = comparison.reached(method, times, scene if scene in names else None)
            axes.plot(times, 100.0 * part, label=method, **_style(comparison, method))
        axes.set_ylim(0.0, 100.0)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g} %"))
    next(iter(panels.values())).set_ylabel("targets reached", color=SOFT)
    _save(figure, panels, path)


def _panels(names: list[str], unit: str) -> tuple[Figure, dict[str, Axes]]:
    columns = min(len(names), 3)
    rows = -(-len(names) // columns)
    figure = Figure(figsize=(1.9 + 3.6 * columns, 0.5 + 2.9 * rows), facecolor="white")
    FigureCanvasAgg(figure)
    figure.set_layout_engine("constrained")
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in grid[len(names) :]:
        axes.remove()
    panels = dict(zip(names, grid, strict=False))
    for name, axes in panels.items():
        axes.set_title(name, loc="left", color=INK, size=11, weight="bold")
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axes.set_xlabel("seconds" if unit == "s" else "rows simulated", color=SOFT)
        axes.grid(color=FAINT, linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(SOFT)
        axes.tick_params(colors=SOFT, labelsize=9)
    return figure, panels


def _style(comparison: Comparison, method: str) -> dict[str, Any]:
    if method == "auto":
        return {"color": OURS, "linewidth": 2.6, "zorder": 3.0}
    if method == "uniform":
        return {"color": SOFT, "linewidth": 1.2, "linestyle": ":"}
    others = [m for m in comparison.methods if m not in ("auto", "uniform")]
    i = others.index(method)
    colour = colormaps["tab10"](i % 10)
    as_text = "#" + "".join(f"{round(255 * c):02x}" for c in colour[:3])
    return {"color": as_text, "linewidth": 1.2, "linestyle": DASHES[i // 10 % len(DASHES)]}


def _save(figure: Figure, panels: dict[str, Axes], path: Path) -> None:
    lines, names = next(iter(panels.values())).get_legend_handles_labels()
    figure.legend(lines, names, loc="outside right upper", frameon=False, fontsize=9)
    write_bytes(path, lambda file: figure.savefig(file, format="png", dpi=140))
