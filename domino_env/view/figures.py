"""Figures of layouts: the dominoes to scale; below them gaps, thicknesses, heights and wave speed.

Figures are measured in inches, layouts in millimetres. On uneven ground x is horizontal.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from domino_env.core.checks import require_type
from domino_env.core.colours import FAINT, INK, RESULT, SOFT, UNIFORM
from domino_env.core.plot_style import (
    HEAD,
    LEGEND,
    add_headings,
    label_plainly,
    new_figure,
    own_style,
    style,
)
from domino_env.core.types import Floats, Ints
from domino_env.physics.layout import Layout
from domino_env.physics.motion import outlines
from domino_env.physics.physics import require_layout
from domino_env.physics.wave import Wave, require_wave
from domino_env.scenes.scene import Scene
from domino_env.view.ground import ground_line

WIDTH, LEFT, RIGHT = 9.0, 0.85, 0.35  # [in] of a figure, of its margins
SPAN = WIDTH - LEFT - RIGHT  # [in] width of axes
# [in] heights: text above a layout, panel, space above a panel, below an x axis, at the foot
LABEL, PANEL, BETWEEN, UNDER_AXIS, FOOT = 0.30, 1.75, 0.18, 0.62, 0.55

# width of the axes in heights of the tallest domino
LONGEST = 45.0  # of a longer layout only the first dominoes are drawn
SHORTEST = 8.0  # a shorter layout leaves space at its right
SHORTEST_GROWING = 3.0  # the same if heights grow


@dataclass(frozen=True)
class DrawnLayout:
    """Layout to draw in a figure.

    Attributes
    ----------
    layout
        The layout.
    wave
        Its wave; None if it was not simulated.
    name
        Label in the figure.
    colour
        Colour of dominoes and curves.
    designed
        Number of designed dominoes; those after them, the run-out, are drawn as outlines. None for
        all.
    """

    layout: Layout
    wave: Wave | None
    name: str
    colour: str = RESULT
    designed: int | None = None


def draw_layouts(
    layouts: Sequence[DrawnLayout],
    headline: str,
    subtitle: str,
    scene: Scene | None = None,
    draw_last: Callable[[Axes], None] | None = None,
    *,
    ax: Axes | None = None,
    panel: _Panel | None = None,
    register: bool = False,
) -> Figure:
    """Draw layouts below each other on one scale, and below them panels of their curves.

    Parameters
    ----------
    layouts
        Layouts; the curves of the last one have markers.
    headline, subtitle
        Texts above all layouts.
    scene
        Scene whose bounds are drawn; None for none.
    draw_last
        Function that draws one more panel below the others; None for no such panel.
    ax
        Axes for one panel and nothing else; None for a new figure.
    panel
        Function that draws the panel in `ax`; None for that of the gaps.
    register
        True if `pyplot.show` is to show the figure, if pyplot is in use.

    Returns
    -------
    Figure
        The figure.

    Raises
    ------
    TypeError
        For `ax` that are not Matplotlib axes.
    """
    require_type("ax", ax, Axes | None, "Matplotlib axes, or None for a new figure")
    if ax is not None:
        (panel or partial(_sizes, "spacing"))(ax, layouts, scene)
        ax.set_xlabel(_x_label(layouts))
        if len(layouts) > 1:
            ax.legend(**LEGEND)
        return cast("Figure", ax.figure)
    return _draw_figure(layouts, headline, subtitle, scene, draw_last, register)


@own_style()
def _draw_figure(
    layouts: Sequence[DrawnLayout],
    headline: str,
    subtitle: str,
    scene: Scene | None,
    draw_last: Callable[[Axes], None] | None,
    register: bool,
) -> Figure:
    """Draw layouts and panels in a new figure; see `draw_layouts`."""
    tallest = 1e3 * float(max(entry.layout.height.max() for entry in layouts))
    low, high = _range(layouts, scene, tallest)
    end = min(high, low + LONGEST * tallest)
    scale = SPAN / (end - low)  # [in/mm]
    panels = _panels(layouts, scene)
    relief = max(np.ptp(_ground(entry.layout, low, end)[:, 1]) for entry in layouts)
    strip = (tallest + float(relief)) * scale + LABEL
    height = HEAD + len(layouts) * strip + len(panels) * (PANEL + BETWEEN) + FOOT
    height += UNDER_AXIS + PANEL if draw_last else 0.0
    figure = new_figure(WIDTH, height, placed=True, register=register)
    add_headings(figure, headline, subtitle, LEFT)
    y = height - HEAD
    for entry in layouts:
        y -= strip
        axes = _axes(figure, y, strip)
        axes.set_xlim(low, end)
        _draw_dominoes(axes, entry, strip / scale)
        place = LEFT / WIDTH, (y + strip - 0.5 * LABEL) / height
        drawn = len(_inside(entry.layout, low, end))
        note = "; only the first dominoes are drawn" * (drawn < entry.layout.count)
        figure.text(*place, _label(entry) + note, va="center", size=9.5, color=entry.colour)
    for panel in panels:
        y -= BETWEEN + PANEL
        axes = _axes(figure, y, PANEL)
        panel(axes, layouts, scene)
        axes.set_xlim(low, high)
        axes.tick_params(labelbottom=panel is panels[-1])
        if panel is panels[-1]:
            axes.set_xlabel(_x_label(layouts))
    if draw_last:
        draw_last(_axes(figure, FOOT, PANEL))
    return figure


def plot_layout(layout: Layout, ax: Axes | None = None, register: bool = True) -> Figure:
    """Draw a layout to scale, and its sizes.

    Parameters
    ----------
    layout
        The layout.
    ax
        Axes for the gaps and nothing else; None for a new figure.
    register
        True if `pyplot.show` is to show the figure, if pyplot is in use.

    Returns
    -------
    Figure
        The figure.

    Raises
    ------
    TypeError
        For `ax` that are not Matplotlib axes, or a layout of another type.
    """
    require_layout(layout)
    # such as "Layout(12 dominoes over 0.3 m: gaps 4 to 30 mm, 4 to 12 mm thick, 48 mm high)"
    headline, _, subtitle = repr(layout)[len("Layout(") : -1].partition(": ")
    layouts = [DrawnLayout(layout, None, "the layout")]
    return draw_layouts(layouts, headline, subtitle, ax=ax, register=register)


def plot_wave(wave: Wave, ax: Axes | None = None, register: bool = True) -> Figure:
    """Draw the layout of a wave to scale, its sizes, and the speed of the wave.

    Parameters
    ----------
    wave
        The wave.
    ax
        Axes for the speed and nothing else; None for a new figure.
    register
        True if `pyplot.show` is to show the figure, if pyplot is in use.

    Returns
    -------
    Figure
        The figure.

    Raises
    ------
    TypeError
        For `ax` that are not Matplotlib axes, or a wave of another type.
    """
    require_wave("wave", wave)
    physics = wave.physics
    layouts = [DrawnLayout(wave.layout, wave, "the layout")]
    headline = f"{wave.mean_speed:.4f} m/s" if wave.mean_speed > 0.0 else wave.outcome.label
    subtitle = (
        f"{wave.layout.count} dominoes, friction {physics.friction:g}, "
        f"push {physics.push:g} rad/s, gravity {physics.gravity:g} m/s²"
    )
    return draw_layouts(layouts, headline, subtitle, ax=ax, panel=_speed, register=register)


def draw_with_uniform(
    result: Any,
    name: str,
    draw_last: Callable[[Axes], None] | None = None,
    ax: Axes | None = None,
    *,
    register: bool = False,
) -> Figure:
    """Draw the layout of a result and the uniform baseline of its scene.

    Parameters
    ----------
    result
        Result with `scene`, `layout`, `wave` and `score`, such as a `SceneResult`.
    name
        Label of the layout.
    draw_last
        Function that draws one more panel below the others; None for no such panel. It is not
        called for a score of 0 or less, that of a failure.
    ax
        Axes for the gaps of both layouts and nothing else; None for a new figure.
    register
        True if `pyplot.show` is to show the figure, if pyplot is in use.

    Returns
    -------
    Figure
        The figure.

    Raises
    ------
    TypeError
        For `ax` that are not Matplotlib axes.
    """
    scene, uniform, physics = result.scene, result.scene.uniform(), result.scene.physics
    uniform_name = "uniform baseline"
    if scene.hand:  # its score, with which layouts are compared, is not that of the order drawn
        uniform_name += f", mean {uniform.score:.4f} {scene.unit}; here one order of the pieces"
    layouts = [
        DrawnLayout(scene.row(layout), wave, label, colour, scene.count)
        for layout, wave, label, colour in (
            (uniform.layout, uniform.wave, uniform_name, UNIFORM),
            (result.layout, result.wave, name, RESULT),
        )
    ]
    subtitle = (
        f"{scene.title} · {scene.row_count} dominoes, friction {physics.friction:g}, "
        f"push {physics.push:g} rad/s"
    )
    draw_last = draw_last if result.score > 0.0 else None
    headline = f"{scene.name}: {result.score_text}"
    return draw_layouts(layouts, headline, subtitle, scene, draw_last, ax=ax, register=register)


# function that draws the curves of layouts along x
_Panel = Callable[[Axes, Sequence[DrawnLayout], Scene | None], None]


def _panels(layouts: Sequence[DrawnLayout], scene: Scene | None) -> list[_Panel]:
    """Return the panels below the layouts; there is none for a size that is fixed and equal."""
    panels: list[_Panel] = [partial(_sizes, "spacing")] if layouts[0].layout.count > 1 else []
    parts = (None, None) if scene is None else scene.space.parts[1:]
    for name, part in zip(("thickness", "height"), parts, strict=True):
        is_free = part is not None and part.is_free
        if is_free or any(np.ptp(getattr(entry.layout, name)) > 0 for entry in layouts):
            panels.append(partial(_sizes, name))
    if any(entry.wave for entry in layouts) and layouts[0].layout.count > 1:
        panels.append(_speed)
    return panels


def _x_label(layouts: Sequence[DrawnLayout]) -> str:
    """Return the label of the x axis."""
    flat = all(entry.layout.is_flat for entry in layouts)
    return f"{'position' if flat else 'horizontal position'} from the first pivot [mm]"


def _range(layouts: Sequence[DrawnLayout], scene: Scene | None, unit: float) -> tuple[float, float]:
    """Return the range of x from the first pivot [mm]; unit: height of the tallest domino [mm]."""
    # at the left there is room for the arrow of the push
    low = -1e3 * float(layouts[-1].layout.thickness[0]) - 0.8 * unit
    shortest = SHORTEST if scene is None or scene.growth is None else SHORTEST_GROWING
    longest = 1e3 * max(float(entry.layout.pivots[-1, 0]) for entry in layouts)
    return low, max(longest + 0.25 * unit, low + shortest * unit)


def _axes(figure: Figure, bottom: float, height: float) -> Axes:
    """Return new axes of the common width; bottom, height: their place [in]."""
    w, h = figure.get_size_inches()
    axes = figure.add_axes((LEFT / w, bottom / h, SPAN / w, height / h))
    style(axes)
    return axes


def _label(entry: DrawnLayout) -> str:
    """Return the text above a layout: its length, and the result of its wave."""
    name, length, wave = entry.name, f"{entry.layout.length * 1e3:.1f} mm", entry.wave
    if wave is None:
        return f"{name}: {length}"
    if wave.mean_speed == 0.0:
        return f"{name}: {wave.outcome.label}, {wave.hit} of {entry.layout.count} were hit"
    return f"{name}: {length} in {wave.arrival_times[-1]:.4f} s, {wave.mean_speed:.4f} m/s"


def _draw_dominoes(axes: Axes, entry: DrawnLayout, height: float) -> None:
    """Draw the standing dominoes to scale from the side, pale if the wave did not hit them.

    height: height of the axes [mm].
    """
    layout, wave, (low, high) = entry.layout, entry.wave, axes.get_xlim()
    axes.set_ylim(-0.02 * height, 0.98 * height)  # the line of the ground is not clipped
    axes.grid(visible=False)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[["left", "bottom"]].set_visible(False)
    inside = _inside(layout, low, high)
    corners, ground = 1e3 * outlines(layout, layout.tilt)[inside], _ground(layout, low, high)
    shift = np.array([0.0, -float(ground[:, 1].min())])  # the lowest ground is at 0
    axes.plot(*(ground + shift).T, color=INK, linewidth=0.8)
    boxes = [Polygon(box) for box in corners + shift]
    hit = layout.count if wave is None else wave.hit
    colours = [entry.colour if i < hit else FAINT for i in inside]
    designed = entry.designed or layout.count
    faces = [c if i < designed else "none" for i, c in zip(inside, colours, strict=True)]
    edges = ["none" if i < designed else c for i, c in zip(inside, colours, strict=True)]
    axes.add_collection(PatchCollection(boxes, facecolor=faces, edgecolor=edges, linewidth=0.4))
    if wave is not None:
        push = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.0}
        # an arrow to 0.88 of the height of the first domino's rear face, 0.6 of its height long
        top, bottom = corners[0, 2:] + shift
        x, z = bottom + 0.88 * (top - bottom)
        axes.annotate("", (x, z), (x - 600.0 * layout.height[0], z), arrowprops=push)


def _inside(layout: Layout, low: float, high: float) -> Ints:
    """Return the indices of the standing dominoes between two values of x [mm]."""
    front = 1e3 * layout.pivots[:, 0]
    return np.flatnonzero((front > low) & (front - 1e3 * layout.thickness < high))


def _ground(layout: Layout, low: float, high: float) -> Floats:
    """Return the line of the ground between two values of x, points (M, 2) [mm]."""
    beyond = 1e-3 * (high - low)  # [m] enough at both ends
    line = 1e3 * ground_line(layout, beyond, beyond)
    x = np.unique(np.clip(line[:, 0], low, high))
    return np.stack([x, np.interp(x, *line.T)], axis=-1)


def _curves(axes: Axes, layouts: Sequence[DrawnLayout], values: Sequence[Floats]) -> None:
    """Draw a value for each gap of each layout, halfway between its pivots."""
    for entry, curve in zip(layouts, values, strict=True):
        x = 1e3 * entry.layout.pivots[:, 0]
        middles = 0.5 * (x[:-1] + x[1:])
        marker = "o" if entry is layouts[-1] or len(curve) == 1 else ""  # one value has no line
        line: dict[str, Any] = {"color": entry.colour, "linewidth": 1.5, "markersize": 3.0}
        axes.plot(middles, curve, marker=marker, label=entry.name, **line)


def _sizes(name: str, axes: Axes, layouts: Sequence[DrawnLayout], scene: Scene | None) -> None:
    """Draw spacing, thickness or height [mm], and as dashed lines the bounds that are in range."""
    # one value per gap: the gap, or the thickness or height of the domino ahead of it
    values = [1e3 * getattr(entry.layout, name)[1 - entry.layout.count :] for entry in layouts]
    if name != "height" and len(values[0]):
        low, high = min(v.min() for v in values), max(v.max() for v in values)
        margin = max(0.12 * (high - low), 0.02 * high)
        axes.set_ylim(low - margin, high + margin)
        # with `in_heights` the bounds differ from domino to domino
        for bound in getattr(scene, name) if scene and not scene.in_heights else ():
            axes.axhline(1e3 * bound, color=SOFT, linewidth=0.8, linestyle=(0, (4, 4)))
    _curves(axes, layouts, values)
    axes.set_ylabel(f"{'gap' if name == 'spacing' else name} [mm]")


def _speed(axes: Axes, layouts: Sequence[DrawnLayout], _: Scene | None) -> None:
    """Draw the local speed of each wave [m/s]."""
    simulated = [entry for entry in layouts if entry.wave]
    values: list[Any] = [entry.wave.local_speed for entry in simulated if entry.wave]
    _curves(axes, simulated, values)
    axes.set_ylabel("local speed [m/s]")
    speeds = np.concatenate(values)
    speeds = speeds[np.isfinite(speeds)]
    if len(speeds) == 0:
        axes.set_yticks([])
        text = "no wave reached the second domino"
        axes.text(0.5, 0.5, text, color=SOFT, ha="center", va="center", transform=axes.transAxes)
        return
    low, high = speeds.min(), speeds.max()
    if high > 2.0 * low:  # a narrow gap at the end would flatten everything else
        axes.set_yscale("log")
        axes.set_ylabel("local speed [m/s] (log.)")
        label_plainly(axes.yaxis, (1, 1.5, 2, 3, 5, 7))
    axes.set_ylim(0.93 * low, 1.07 * high)
