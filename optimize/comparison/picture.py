"""The pictures of a comparison: the gap against run time, and the targets reached."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from domino_env.support.plot_style import LEGEND, method_lines, new_panels, style, write_png
from optimize.comparison.runner import Comparison


def draw_gaps(comparison: Comparison, path: Path) -> None:
    """Draw the gap to the best known against run time, a panel a scene.

    Lines are medians over the seeds, bands their range.
    """
    figure, panels = _panels(comparison.scenes, comparison.unit)
    times = comparison.times()
    lines = _lines(comparison)
    for scene, axes in panels.items():
        axes.set_yscale("log")  # before what is drawn: where all gaps are one, none is guessed
        axes.set_ylim(1e-4, 30.0)
        for method in comparison.methods:
            runs = comparison.of(scene, method)
            if not runs:
                continue
            gaps = np.array([comparison.gaps(r, times) for r in runs])
            middle = np.sort(gaps, axis=0)[(len(gaps) - 1) // 2]
            axes.plot(times, 100.0 * middle, label=method, **lines[method])
            low, high = 100.0 * gaps.min(axis=0), 100.0 * gaps.max(axis=0)
            colour = lines[method]["color"]
            axes.fill_between(times, low, high, color=colour, alpha=0.10, linewidth=0)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g} %"))
    next(iter(panels.values())).set_ylabel("gap to the best known")
    _save(figure, panels, path)


def draw_targets(comparison: Comparison, path: Path) -> None:
    """Draw the part of the targets reached against run time, a panel a scene and one for all."""
    names = comparison.scenes
    panelled = [*names, "all scenes"] if len(names) > 1 else names
    figure, panels = _panels(panelled, comparison.unit)
    times = comparison.times()
    lines = _lines(comparison)
    for scene, axes in panels.items():
        for method in comparison.methods:
            if scene in names and not comparison.of(scene, method):
                continue
            part = comparison.reached(method, times, scene if scene in names else None)
            axes.plot(times, 100.0 * part, label=method, **lines[method])
        axes.set_ylim(0.0, 100.0)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g} %"))
    next(iter(panels.values())).set_ylabel("targets reached")
    _save(figure, panels, path)


def _panels(names: list[str], unit: str) -> tuple[Figure, dict[str, Axes]]:
    figure, found = new_panels(len(names), 3, (3.6, 2.9), (1.9, 0.5))
    panels = dict(zip(names, found, strict=True))
    for name, axes in panels.items():
        style(axes, name)
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
        axes.set_xlabel("seconds" if unit == "s" else "rows simulated")
    return figure, panels


def _lines(comparison: Comparison) -> dict[str, dict[str, Any]]:
    lines = {m: {**line, "linewidth": 1.2} for m, line in method_lines(comparison.methods).items()}
    lines["auto"] |= {"linewidth": 2.6, "zorder": 3.0}  # it stands out
    return lines


def _save(figure: Figure, panels: dict[str, Axes], path: Path) -> None:
    lines, names = next(iter(panels.values())).get_legend_handles_labels()
    figure.legend(lines, names, loc="outside right upper", **LEGEND)
    write_png(figure, path)
