"""The pictures of a comparison: the gap against run time, and the targets reached."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from domino_env.core.colours import FAINT, INK, OURS, PALE, SOFT
from domino_env.core.plot_style import (
    HEAD,
    LEGEND,
    headings,
    method_lines,
    new_figure,
    new_panels,
    plain_numbers,
    style,
    write_png,
)
from optimize.comparison.runner import Comparison

Floats = NDArray[np.float64]
Curve = tuple[Floats, Floats, Floats]  # over the times, in per cent: what is drawn, and its band

MOST_TOGETHER = 7  # methods whose colours are told apart at a glance; more get a panel each
ACROSS = 6  # of such panels
SMALL = (1.75, 1.45)  # [in]
TITLE = 0.35  # [in] for the name of a scene


def draw_gaps(comparison: Comparison, path: Path) -> None:
    """Draw the gap to the best known against run time.

    Lines are medians over the seeds, bands their range.
    """
    times = comparison.times()
    curves = {}
    for scene in comparison.scenes:
        curves[scene] = {
            method: _middle_and_range(
                np.array([100.0 * comparison.gaps(r, times) for r in comparison.of(scene, method)])
            )
            for method in comparison.methods
            if comparison.of(scene, method)
        }

    def scale(axes: Axes) -> None:
        axes.set_yscale("log")  # before what is drawn: where all gaps are one, none is guessed
        axes.set_ylim(1e-4, 30.0)

    figure = _figure(comparison, times, curves, scale, "Gap to the best known", "medians over", 1.0)
    write_png(figure, path)


def draw_targets(comparison: Comparison, path: Path) -> None:
    """Draw the part of the targets reached against run time, for each scene and for all."""
    times, names = comparison.times(), comparison.scenes
    curves = {}
    for scene in [*names, "all scenes"] if len(names) > 1 else names:
        one = scene if scene in names else None
        parts = {
            method: 100.0 * comparison.reached(method, times, one)
            for method in comparison.methods
            if one is None or comparison.of(one, method)
        }
        curves[scene] = {method: (part, part, part) for method, part in parts.items()}

    def scale(axes: Axes) -> None:
        axes.set_ylim(0.0, 100.0)

    write_png(
        _figure(comparison, times, curves, scale, "Targets reached", "all runs of", -1.0), path
    )


def _middle_and_range(values: Floats) -> Curve:
    return np.median(values, axis=0), values.min(axis=0), values.max(axis=0)


def _figure(
    comparison: Comparison,
    times: Floats,
    curves: Mapping[str, Mapping[str, Curve]],
    scale: Any,
    what: str,
    over: str,
    sign: float,
) -> Figure:
    """All methods in one panel a scene, or, where they are too many for that, a panel each.

    sign: of the best of two values, 1 where it is the lower.
    """
    clock = "seconds" if comparison.unit == "s" else "rows simulated"
    seeds = len({r.seed for r in comparison.results})
    over = "one seed" if seeds == 1 else f"{over} {seeds} seeds"
    budget = f"{comparison.evaluations} rows"
    if comparison.unit == "s":
        budget = f"{comparison.seconds:g} s"
    headline, subtitle = f"{what} against {clock}", f"{budget} for each run, {over}"

    def prepare(axes: Axes) -> None:
        scale(axes)
        axes.set_xscale("log")
        plain_numbers(axes.xaxis, (1,))
        axes.set_xlim(times[0], times[-1])
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g} %"))

    if len(comparison.methods) <= MOST_TOGETHER:
        return _together(times, curves, prepare, headline, subtitle, (what, clock))
    subtitle += "; best first, all others behind each in grey"
    order = {
        scene: sorted(found, key=lambda m: (sign * found[m][0][-1], sign * found[m][0].mean()))
        for scene, found in curves.items()
    }
    return _apart(times, curves, order, prepare, headline, subtitle, clock)


def _together(
    times: Floats,
    curves: Mapping[str, Mapping[str, Curve]],
    prepare: Any,
    headline: str,
    subtitle: str,
    labels: tuple[str, str],
) -> Figure:
    figure, panels = new_panels(len(curves), 3, (3.6, 2.9), (1.9, 0.5), headline, subtitle)
    methods = list(dict.fromkeys(m for found in curves.values() for m in found))
    lines = {m: {**line, "linewidth": 1.4} for m, line in method_lines(methods).items()}
    lines["auto"] |= {"linewidth": 2.6, "zorder": 3.0}  # it stands out
    drawn: dict[str, Any] = {}
    for (scene, found), axes in zip(curves.items(), panels, strict=True):
        style(axes, scene)
        prepare(axes)
        axes.set_xlabel(labels[1])
        for method, (middle, low, high) in found.items():
            drawn[method] = axes.plot(times, middle, **lines[method])[0]
            axes.fill_between(times, low, high, color=lines[method]["color"], alpha=0.10, lw=0)
    panels[0].set_ylabel(labels[0])
    figure.legend(list(drawn.values()), list(drawn), loc="outside right center", **LEGEND)
    return figure


def _apart(
    times: Floats,
    curves: Mapping[str, Mapping[str, Curve]],
    order: Mapping[str, Sequence[str]],
    prepare: Any,
    headline: str,
    subtitle: str,
    clock: str,
) -> Figure:
    down = {scene: -(-len(methods) // ACROSS) for scene, methods in order.items()}
    heights = [TITLE + 0.3 + SMALL[1] * down[scene] for scene in curves]
    figure = new_figure(0.4 + SMALL[0] * ACROSS, HEAD + sum(heights))
    headings(figure, headline, subtitle)
    blocks = figure.subfigures(len(curves), 1, height_ratios=heights, squeeze=False).ravel()
    for block, (scene, found) in zip(blocks, curves.items(), strict=True):
        block.suptitle(scene, x=0.12 / (0.4 + SMALL[0] * ACROSS), ha="left", size=11, color=INK)
        panels = block.subplots(down[scene], ACROSS, sharex=True, sharey=True, squeeze=False)
        for axes in panels.ravel()[len(order[scene]) :]:
            axes.set_visible(False)
        for axes, method in zip(panels.ravel(), order[scene], strict=False):
            style(axes)
            prepare(axes)
            axes.tick_params(labelsize=7.5)
            axes.set_title(method, loc="left", size=9, color=OURS, pad=3)
            for other, (middle, _, _) in found.items():
                axes.plot(times, middle, color=FAINT if other != "uniform" else PALE, linewidth=0.9)
            middle, low, high = found[method]
            axes.fill_between(times, low, high, color=OURS, alpha=0.18, linewidth=0)
            axes.plot(times, middle, color=OURS, linewidth=1.8)
        block.supxlabel(clock, size=9, color=SOFT)
    return figure
