"""The picture of a run: both rows to scale, spacing and wave speed along them, the search.

Inches on paper, millimetres along the row.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from domino_env.chain.layout import Layout
from domino_env.chain.wave import Wave
from domino_env.scenes.scene import Scene
from domino_env.support.plot_style import (
    FAINT,
    INK,
    OURS,
    SOFT,
    UNIFORM,
    escaped,
    new_figure,
    style,
    write_png,
)
from optimize.evaluation.result import SearchResult
from optimize.problem import Floats

WIDTH, LEFT, RIGHT = 11.0, 0.85, 0.35
SPAN = WIDTH - LEFT - RIGHT
HEAD, LABEL, PANEL, BETWEEN, UNDER_AXIS, FOOT = 0.85, 0.30, 1.75, 0.18, 0.62, 0.55

LONGEST = 45.0  # heights; of a longer row the two ends are shown
SHORTEST = 8.0  # heights; a shorter row leaves room
SHORTEST_GROWING = 3.0  # of the tallest
SMALL = 0.36  # inches a domino's height takes in a long row
SPLIT = 0.4  # inches between the two ends


@dataclass(frozen=True)
class _Window:
    """A part of the row: where on paper [in], and what of the row [mm].

    from_end: whether places count from the last pivot.
    """

    left: float
    width: float
    low: float
    high: float
    from_end: bool

    def shift(self, layout: Layout) -> float:
        """What to add to a place along the row [mm]."""
        return -1e3 * layout.length if self.from_end else 0.0


def draw(result: SearchResult, path: Path) -> None:
    """Draw the result of a search into a PNG file."""
    write_png(picture(result), path)


def picture(result: SearchResult) -> Figure:
    """Draw the figure, from top to bottom; Matplotlib's global state is not touched."""
    windows, scale, tall = _windows(result)
    panels: list[Callable[[Axes, SearchResult, _Window], None]] = [_spacing, _speed]
    if result.scene.free_thickness:
        panels.insert(1, _thickness)
    if result.scene.free_height:
        panels.insert(-1, _heights)
    row = tall * scale + LABEL
    along = len(panels) * (PANEL + BETWEEN)
    height = HEAD + 2 * row + along + UNDER_AXIS + PANEL + FOOT
    figure = new_figure(WIDTH, height, placed=True)

    def text(y: float, words: str, **looks: Any) -> None:
        figure.text(LEFT / WIDTH, y / height, words, va="center", **looks)

    text(height - 0.30, _headline(result), size=14.5, color=INK, weight="bold")
    text(height - 0.58, _subtitle(result), size=9.5, color=SOFT)
    y = height - HEAD
    for layout, wave, colour, name in _pairs(result):
        y -= row
        for window in windows:
            axes = _axes(figure, window.left, y, window.width, row)
            _row(axes, layout, wave, colour, window, row / scale)
        text(y + row - 0.15, _row_label(layout, wave, name), size=9.5, color=colour)
    for panel in panels:
        y -= BETWEEN + PANEL
        for window in windows:
            axes = _axes(figure, window.left, y, window.width, PANEL)
            panel(axes, result, window)
            axes.set_xlim(window.low, window.high)
            axes.tick_params(labelbottom=panel is panels[-1])
            if panel is panels[-1]:
                axes.set_xlabel(f"position from the {_origin(window)} pivot [mm]")
            if window is not windows[0]:
                axes.set_ylabel("")
                axes.tick_params(labelleft=False)
    _search(_axes(figure, LEFT, FOOT, SPAN, PANEL), result)
    return figure


def _pairs(result: SearchResult) -> list[tuple[Layout, Wave, str, str]]:
    mark = result.uniform
    return [
        (mark.layout, mark.wave, UNIFORM, "best uniform pitch"),
        (result.layout, result.wave, OURS, f"found by {result.method}"),
    ]


def _windows(result: SearchResult) -> tuple[list[_Window], float, float]:
    """What is shown of the rows, inches a millimetre, and height of the tallest domino [mm]."""
    layouts = [layout for layout, _, _, _ in _pairs(result)]
    tall = 1e3 * max(layout.height.max() for layout in layouts)
    low = -1e3 * result.layout.thickness[0] - 0.8 * tall
    shortest = SHORTEST if result.scene.growth is None else SHORTEST_GROWING
    high = max(1e3 * max(layout.length for layout in layouts) + 0.25 * tall, low + shortest * tall)
    if high - low <= LONGEST * tall:
        return [_Window(LEFT, SPAN, low, high, False)], SPAN / (high - low), tall
    scale = SMALL / tall
    half = 0.5 * (SPAN - SPLIT)
    shown = half / scale
    first = _Window(LEFT, half, low, low + shown, False)
    last = _Window(LEFT + half + SPLIT, half, 0.4 * tall - shown, 0.4 * tall, True)
    return [first, last], scale, tall


def _origin(window: _Window) -> str:
    return "last" if window.from_end else "first"


def _axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at a place in inches."""
    across, up = figure.get_size_inches()
    axes = figure.add_axes((left / across, bottom / up, width / across, height / up))
    style(axes)
    return axes


# words ------------------------------------------------------------------------------------------


def _headline(result: SearchResult) -> str:
    name, speed, gain = result.scene.name, result.wave.mean_speed, result.gain
    if result.score <= 0.0:
        return f"{name}: no row found that topples to the end"
    if not result.scene.criterion.is_mean_speed:
        scene, mark = result.scene, result.uniform
        found = scene.in_words(result.score, result.wave)
        return f"{name}: {found} (uniform: {scene.in_words(mark.score, mark.wave)})"
    if gain is None:
        return f"{name}: {speed:.4f} m/s, where no uniform pitch topples to the end"
    compared = "faster" if gain >= 0.0 else "slower"
    return f"{name}: {speed:.4f} m/s, {abs(gain):.2%} {compared} than the best uniform pitch"


def _subtitle(result: SearchResult) -> str:
    physics = result.scene.physics
    title = escaped(result.scene.title)
    return (
        f"{title} · {result.scene.count} dominoes, friction {physics.friction:g}, "
        f"push {physics.push:g} rad/s"
    )


def _row_label(layout: Layout, wave: Wave, name: str) -> str:
    if wave.mean_speed == 0.0:
        ended = wave.outcome.name.lower().replace("_", " ")
        return f"{name}: {ended}, {wave.hit} of {layout.count} were struck"
    return (
        f"{name}: {layout.length * 1e3:.1f} mm in {wave.arrival_times[-1]:.4f} s, "
        f"{wave.mean_speed:.4f} m/s"
    )


# along the row ----------------------------------------------------------------------------------


def _row(axes: Axes, layout: Layout, wave: Wave, colour: str, window: _Window, room: float) -> None:
    """Dominoes from the side, to scale; pale where the wave did not come.

    room: what the height of the axes stands for [mm].
    """
    axes.set_xlim(window.low, window.high)
    axes.set_ylim(-0.02 * room, 0.98 * room)
    axes.grid(visible=False)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[["left", "bottom"]].set_visible(False)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    front = 1e3 * layout.positions + window.shift(layout)
    thick, tall = 1e3 * layout.thickness, 1e3 * layout.height
    shown = np.flatnonzero((front > window.low) & (front - thick < window.high))
    boxes = [Rectangle((front[i] - thick[i], 0.0), thick[i], tall[i]) for i in shown]
    colours = [colour if i < wave.hit else FAINT for i in shown]
    axes.add_collection(PatchCollection(boxes, facecolor=colours, edgecolor="none"))
    if not window.from_end:
        push = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.0}
        at = 0.88 * tall[0]
        axes.annotate("", (-thick[0], at), (-thick[0] - 0.6 * tall[0], at), arrowprops=push)


def _curves(axes: Axes, result: SearchResult, window: _Window, mark: Floats, best: Floats) -> None:
    """What the two rows have at each gap, drawn halfway between its pivots."""
    line: dict[str, Any] = {"linewidth": 1.5, "marker": "o" if len(mark) == 1 else ""}
    for layout, values, colour in (
        (result.uniform.layout, mark, UNIFORM),
        (result.layout, best, OURS),
    ):
        middles = 500.0 * (layout.positions[:-1] + layout.positions[1:]) + window.shift(layout)
        axes.plot(middles, values, color=colour, **line)
        line |= {"marker": "o", "markersize": 3.0}


def _spacing(axes: Axes, result: SearchResult, window: _Window) -> None:
    mark, best = 1e3 * result.uniform.layout.spacing, 1e3 * result.layout.spacing
    _bounds(axes, result.scene, result.scene.spacing, mark, best)
    _curves(axes, result, window, mark, best)
    axes.set_ylabel("spacing [mm]")


def _thickness(axes: Axes, result: SearchResult, window: _Window) -> None:
    mark, best = 1e3 * result.uniform.layout.thickness[1:], 1e3 * result.layout.thickness[1:]
    _bounds(axes, result.scene, result.scene.thickness, mark, best)
    _curves(axes, result, window, mark, best)
    axes.set_ylabel("thickness [mm]")


def _heights(axes: Axes, result: SearchResult, window: _Window) -> None:
    mark, best = 1e3 * result.uniform.layout.height[1:], 1e3 * result.layout.height[1:]
    _curves(axes, result, window, mark, best)
    axes.set_ylabel("height [mm]")


def _bounds(axes: Axes, scene: Scene, bounds: tuple[float, float], *values: Floats) -> None:
    """The scene's bounds, dashed, where they are near what is drawn; not those in heights."""
    low, high = min(v.min() for v in values), max(v.max() for v in values)
    room = max(0.12 * (high - low), 0.02 * high)
    axes.set_ylim(low - room, high + room)
    for bound in bounds if not scene.in_heights else ():
        axes.axhline(1e3 * bound, color=SOFT, linewidth=0.8, linestyle=(0, (4, 4)))


def _speed(axes: Axes, result: SearchResult, window: _Window) -> None:
    mark = result.uniform.wave.local_speed
    best = result.wave.local_speed
    _curves(axes, result, window, mark, best)
    axes.set_ylabel("local wave speed [m/s]")
    both = np.concatenate([mark, best])
    both = both[np.isfinite(both)]
    if len(both) == 0:
        axes.set_yticks([])
        axes.text(0.5, 0.5, "neither wave came to the second domino", color=SOFT, ha="center",
                  va="center", transform=axes.transAxes)  # fmt: skip
        return
    low, high = both.min(), both.max()
    if high > 2.0 * low:  # a tight gap at the end would flatten everything else
        axes.set_yscale("log")
        _plain(axes.yaxis, [a * 10.0**k for k in range(-4, 4) for a in (1, 1.5, 2, 3, 5, 7)])
    axes.set_ylim(0.93 * low, 1.07 * high)


# the search -------------------------------------------------------------------------------------


def _search(axes: Axes, result: SearchResult) -> None:
    """Best score against time, with the uniform pitch's score as a line."""
    times = np.array([t for _, _, t, _ in result.trace])
    scores = np.array([score for _, _, _, score in result.trace])
    mark, last = result.uniform.score, scores[-1]
    axes.axhline(mark, color=UNIFORM, linewidth=1.5)
    axes.step(times, scores, color=OURS, linewidth=1.5, where="post")
    above = scores[0] < mark  # where the curve is not
    _beside(axes, f"best uniform pitch {mark:.4f}", 0.005, mark, UNIFORM, above=above)
    _beside(axes, f"{result.method} {last:.4f}", 1.0, last, OURS, above=last >= mark)
    lowest = scores[scores > 0.0].min() if last > 0.0 else scores.min()
    if last > 0.0:  # how it began would flatten the rest
        lowest = max(lowest, 0.85 * last)
    low, high = min(lowest, mark if mark > 0.0 else lowest), max(last, mark)
    room = 0.2 * (high - low) + 0.005 * abs(high)
    axes.set_ylim(low - room, high + room)
    if times[-1] > 30.0 * times[0]:  # most happens early
        axes.set_xscale("log")
        _plain(axes.xaxis, [a * 10.0**k for k in range(-6, 7) for a in (1, 3)])
    axes.set_xlim(times[0], max(times[-1], times[0] + 1e-3))
    unit = f" [{result.scene.unit}]" if result.scene.unit else ""
    axes.set_ylabel(f"best score{unit}" if high > 0.0 else "best score (below 0: it dies)")
    axes.set_xlabel(
        f"seconds of search ({result.method}, seed {result.seed}, {result.evaluations} rows)"
    )


def _beside(axes: Axes, words: str, x: float, y: float, colour: str, *, above: bool) -> None:
    """Words at a height of the curves, just above or below it; x is a part of the width."""
    axes.annotate(
        words, (x, y), (0.0, 4.0 if above else -4.0), size=9, color=colour,
        xycoords=("axes fraction", "data"), textcoords="offset points",
        ha="left" if x < 0.5 else "right", va="bottom" if above else "top",
    )  # fmt: skip


def _plain(axis: Axis, ticks: list[float]) -> None:
    """Plain numbers on a logarithmic axis."""
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
