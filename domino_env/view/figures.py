"""Figures of layouts: drawn to scale, and below them spacing, thickness and wave speed.

Inches on paper, millimetres along the row; over hills, everything stands at its horizontal place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from domino_env.core.colours import FAINT, INK, OURS, SOFT, UNIFORM
from domino_env.core.plot_style import HEAD, headings, new_figure, plain_numbers, style
from domino_env.core.types import Floats, Ints
from domino_env.physics.layout import Layout
from domino_env.physics.motion import outlines
from domino_env.physics.wave import Wave
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import gain
from domino_env.view.ground import ground_line

WIDTH, LEFT, RIGHT = 11.0, 0.85, 0.35
SPAN = WIDTH - LEFT - RIGHT
LABEL, PANEL, BETWEEN, UNDER_AXIS, FOOT = 0.30, 1.75, 0.18, 0.62, 0.55

LONGEST = 45.0  # heights; of a longer row the two ends are shown
SHORTEST = 8.0  # heights; a shorter row leaves room
SHORTEST_GROWING = 3.0  # of the tallest
SMALL = 0.36  # inches a domino's height takes in a long row
SPLIT = 0.4  # inches between the two ends


@dataclass(frozen=True)
class Shown:
    """A row of the picture.

    Attributes
    ----------
    layout
        The row.
    wave
        How it falls; None where it only stands.
    name
        What it is called.
    colour
        Of the row and of its curves.
    """

    layout: Layout
    wave: Wave | None
    name: str
    colour: str = OURS


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
        return -1e3 * float(layout.pivots[-1, 0]) if self.from_end else 0.0


def rows_picture(
    rows: Sequence[Shown],
    headline: str,
    subtitle: str,
    scene: Scene | None = None,
    last: Callable[[Axes], None] | None = None,
) -> Figure:
    """Draw rows below each other on one scale, and their curves along them.

    Parameters
    ----------
    rows
        The last is the one that matters: its gaps are marked one by one.
    headline, subtitle
        What is said above.
    scene
        What they were made for, whose bounds are shown.
    last
        Draws a panel of another kind below the others.

    Returns
    -------
    Figure
        Matplotlib's global state is not touched.
    """
    windows, scale, tall = _windows(rows, scene)
    panels = _panels(rows, scene)
    row = (tall + max(_relief(one.layout, w) for one in rows for w in windows)) * scale + LABEL
    height = HEAD + len(rows) * row + len(panels) * (PANEL + BETWEEN) + FOOT
    height += UNDER_AXIS + PANEL if last else 0.0
    figure = new_figure(WIDTH, height, placed=True)
    headings(figure, headline, subtitle, LEFT)
    y = height - HEAD
    for shown in rows:
        y -= row
        for window in windows:
            axes = _axes(figure, window.left, y, window.width, row)
            _row(axes, shown, window, row / scale)
        at = LEFT / WIDTH, (y + row - 0.15) / height
        figure.text(*at, _row_label(shown), va="center", size=9.5, color=shown.colour)
    for panel in panels:
        y -= BETWEEN + PANEL
        for window in windows:
            axes = _axes(figure, window.left, y, window.width, PANEL)
            panel(axes, rows, window, scene)
            axes.set_xlim(window.low, window.high)
            axes.tick_params(labelbottom=panel is panels[-1])
            if panel is panels[-1]:
                where = "position" if all(one.layout.is_flat for one in rows) else "horizontally"
                origin = "last" if window.from_end else "first"
                axes.set_xlabel(f"{where} from the {origin} pivot [mm]")
            if window is not windows[0]:
                axes.set_ylabel("")
                axes.tick_params(labelleft=False)
    if last:
        last(_axes(figure, LEFT, FOOT, SPAN, PANEL))
    return figure


def plot_layout(layout: Layout) -> Figure:
    """Draw a row to scale, and its gaps along it."""
    number, _, sizes = repr(layout)[len("Layout(") : -1].partition(": ")
    return rows_picture([Shown(layout, None, "as it stands")], number, sizes)


def plot_wave(wave: Wave) -> Figure:
    """Draw the row of a wave to scale, and gaps and speed along it."""
    physics, ended = wave.physics, wave.outcome.name.lower().replace("_", " ")
    headline = f"{wave.mean_speed:.4f} m/s" if wave.mean_speed > 0.0 else ended
    subtitle = (
        f"{wave.layout.count} dominoes, friction {physics.friction:g}, "
        f"push {physics.push:g} rad/s, gravity {physics.gravity:g} m/s²"
    )
    return rows_picture([Shown(wave.layout, wave, "the row")], headline, subtitle)


def beside_uniform(
    scene: Scene,
    layout: Layout,
    wave: Wave,
    score: float,
    name: str,
    last: Callable[[Axes], None] | None = None,
) -> Figure:
    """Draw a row and the best uniform one of its scene.

    Parameters
    ----------
    scene
        What it was made for.
    layout
        The row.
    wave
        Its wave.
    score
        What the scene gives for it.
    name
        What the row is called, such as by what it was found.
    last
        Draws how it was found, in a panel below.
    """
    mark = scene.uniform()
    rows = [Shown(mark.layout, mark.wave, "best uniform pitch", UNIFORM), Shown(layout, wave, name)]
    physics = scene.physics
    subtitle = (
        f"{scene.title} · {scene.count} dominoes, friction {physics.friction:g}, "
        f"push {physics.push:g} rad/s"
    )
    return rows_picture(rows, _headline(scene, wave, score), subtitle, scene, last)


def _headline(scene: Scene, wave: Wave, score: float) -> str:
    mark = scene.uniform()
    if score <= 0.0:
        return f"{scene.name}: no row found that topples to the end"
    if not scene.criterion.is_mean_speed:
        found = scene.in_words(score, wave)
        return f"{scene.name}: {found} (uniform: {scene.in_words(mark.score, mark.wave)})"
    lead = gain(score, mark.score)
    if lead is None:
        return f"{scene.name}: {score:.4f} m/s, where no uniform pitch topples to the end"
    compared = "faster" if lead >= 0.0 else "slower"
    return f"{scene.name}: {score:.4f} m/s, {abs(lead):.2%} {compared} than the best uniform pitch"


_Panel = Callable[[Axes, Sequence[Shown], _Window, Scene | None], None]


def _panels(rows: Sequence[Shown], scene: Scene | None) -> list[_Panel]:
    """What is drawn along the rows: sizes only where they are free, or differ."""
    free = {
        "thickness": scene is not None and scene.free_thickness,
        "height": scene is not None and scene.free_height,
    }
    panels: list[_Panel] = [partial(_sizes, "spacing")] if rows[0].layout.count > 1 else []
    for name, is_free in free.items():
        if is_free or any(np.ptp(getattr(one.layout, name)) > 0 for one in rows):
            panels.append(partial(_sizes, name))
    if any(one.wave for one in rows) and rows[0].layout.count > 1:
        panels.append(_speed)
    return panels


def _windows(rows: Sequence[Shown], scene: Scene | None) -> tuple[list[_Window], float, float]:
    """What is shown of the rows, inches a millimetre, and height of the tallest domino [mm]."""
    layouts = [one.layout for one in rows]
    tall = 1e3 * max(layout.height.max() for layout in layouts)
    low = -1e3 * layouts[-1].thickness[0] - 0.8 * tall
    shortest = SHORTEST if scene is None or scene.growth is None else SHORTEST_GROWING
    longest = 1e3 * max(float(layout.pivots[-1, 0]) for layout in layouts)
    high = max(longest + 0.25 * tall, low + shortest * tall)
    if high - low <= LONGEST * tall:
        return [_Window(LEFT, SPAN, low, high, False)], SPAN / (high - low), tall
    scale = SMALL / tall
    half = 0.5 * (SPAN - SPLIT)
    shown = half / scale
    first = _Window(LEFT, half, low, low + shown, False)
    last = _Window(LEFT + half + SPLIT, half, 0.4 * tall - shown, 0.4 * tall, True)
    return [first, last], scale, tall


def _axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at a place in inches."""
    across, up = figure.get_size_inches()
    axes = figure.add_axes((left / across, bottom / up, width / across, height / up))
    style(axes)
    return axes


def _row_label(shown: Shown) -> str:
    layout, wave = shown.layout, shown.wave
    if wave is None:
        return f"{shown.name}: {layout.length * 1e3:.1f} mm"
    if wave.mean_speed == 0.0:
        ended = wave.outcome.name.lower().replace("_", " ")
        return f"{shown.name}: {ended}, {wave.hit} of {layout.count} were struck"
    return (
        f"{shown.name}: {layout.length * 1e3:.1f} mm in {wave.arrival_times[-1]:.4f} s, "
        f"{wave.mean_speed:.4f} m/s"
    )


def _row(axes: Axes, shown: Shown, window: _Window, room: float) -> None:
    """Dominoes from the side, to scale; pale where the wave did not come.

    room: what the height of the axes stands for [mm].
    """
    layout, wave = shown.layout, shown.wave
    axes.set_xlim(window.low, window.high)
    axes.set_ylim(-0.02 * room, 0.98 * room)
    axes.grid(visible=False)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[["left", "bottom"]].set_visible(False)
    inside = _inside(layout, window)
    stand = 1e3 * outlines(layout, layout.tilt)[inside]
    lowest = float(stand[..., 1].min()) if len(inside) else 0.0
    reach = 1e-3 * (window.high - window.low)
    shift = np.array([window.shift(layout), -lowest])
    axes.plot(*(1e3 * ground_line(layout, reach, reach) + shift).T, color=INK, linewidth=0.8)
    boxes = [Polygon(corners) for corners in stand + shift]
    hit = layout.count if wave is None else wave.hit
    colours = [shown.colour if i < hit else FAINT for i in inside]
    axes.add_collection(PatchCollection(boxes, facecolor=colours, edgecolor="none"))
    if wave is not None and not window.from_end:
        push = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.0}
        # at the rear face of the first, 0.88 of its height up
        rear, top = stand[0, 3] + shift, stand[0, 2] + shift
        x, z = rear + 0.88 * (top - rear)
        axes.annotate("", (x, z), (x - 600.0 * layout.height[0], z), arrowprops=push)


def _inside(layout: Layout, window: _Window) -> Ints:
    """Which dominoes a window shows, as they stand."""
    front = 1e3 * layout.pivots[:, 0] + window.shift(layout)
    return np.flatnonzero((front > window.low) & (front - 1e3 * layout.thickness < window.high))


def _relief(layout: Layout, window: _Window) -> float:
    """How much the ground rises and falls in a window [mm]."""
    feet = 1e3 * outlines(layout, layout.tilt)[_inside(layout, window)][:, [0, 3], 1]
    return float(np.ptp(feet)) if len(feet) else 0.0


def _curves(axes: Axes, rows: Sequence[Shown], window: _Window, values: Sequence[Floats]) -> None:
    """What rows have at each gap, drawn halfway between its pivots."""
    for shown, one in zip(rows, values, strict=True):
        places = shown.layout.pivots[:, 0]
        middles = 500.0 * (places[:-1] + places[1:]) + window.shift(shown.layout)
        marked = shown is rows[-1] or len(one) == 1
        axes.plot(
            middles, one, color=shown.colour, linewidth=1.5, marker="o" if marked else "",
            markersize=3.0,
        )  # fmt: skip


def _sizes(
    name: str, axes: Axes, rows: Sequence[Shown], window: _Window, scene: Scene | None
) -> None:
    """Spacing, thickness or height; the scene's bounds, dashed, where they are near."""
    values = [1e3 * getattr(one.layout, name)[1 - one.layout.count :] for one in rows]
    if name != "height":
        low, high = min(v.min() for v in values), max(v.max() for v in values)
        room = max(0.12 * (high - low), 0.02 * high)
        axes.set_ylim(low - room, high + room)
        for bound in getattr(scene, name) if scene and not scene.in_heights else ():
            axes.axhline(1e3 * bound, color=SOFT, linewidth=0.8, linestyle=(0, (4, 4)))
    _curves(axes, rows, window, values)
    axes.set_ylabel(f"{name} [mm]")


def _speed(axes: Axes, rows: Sequence[Shown], window: _Window, _: Scene | None) -> None:
    fallen = [one for one in rows if one.wave]
    values: list[Any] = [one.wave.local_speed for one in fallen if one.wave]
    _curves(axes, fallen, window, values)
    axes.set_ylabel("local wave speed [m/s]")
    told = np.concatenate(values)
    told = told[np.isfinite(told)]
    if len(told) == 0:
        axes.set_yticks([])
        came = "neither wave came" if len(fallen) == 2 else "the wave did not come"
        axes.text(0.5, 0.5, f"{came} to the second domino", color=SOFT, ha="center",
                  va="center", transform=axes.transAxes)  # fmt: skip
        return
    low, high = told.min(), told.max()
    if high > 2.0 * low:  # a tight gap at the end would flatten everything else
        axes.set_yscale("log")
        plain_numbers(axes.yaxis, (1, 1.5, 2, 3, 5, 7))
    axes.set_ylim(0.93 * low, 1.07 * high)
