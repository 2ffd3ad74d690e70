"""Figures of layouts: drawn to scale, and below them spacing, thickness and wave speed.

Paper is measured in inches, layouts in millimetres. On uneven ground x is horizontal.
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
from domino_env.core.plot_style import HEAD, LEGEND, add_headings, label_plainly, new_figure, style
from domino_env.core.types import Floats, Ints
from domino_env.physics.layout import Layout
from domino_env.physics.motion import outlines
from domino_env.physics.wave import Wave
from domino_env.scenes.scene import Scene
from domino_env.view.ground import ground_line

WIDTH, LEFT, RIGHT = 11.0, 0.85, 0.35
SPAN = WIDTH - LEFT - RIGHT
LABEL, PANEL, BETWEEN, UNDER_AXIS, FOOT = 0.30, 1.75, 0.18, 0.62, 0.55

LONGEST = 45.0  # domino heights; of a longer layout the first dominoes are drawn
SHORTEST = 8.0  # domino heights on paper; beside a shorter layout space is left
SHORTEST_GROWING = 3.0  # heights of the tall domino on paper, where heights grow


@dataclass(frozen=True)
class DrawnLayout:
    """Layout of a figure.

    Attributes
    ----------
    layout
        The layout.
    wave
        Its wave; None for a layout that only stands.
    name
        Label.
    colour
        Colour of dominoes and curves.
    """

    layout: Layout
    wave: Wave | None
    name: str
    colour: str = RESULT


def layouts_figure(
    layouts: Sequence[DrawnLayout],
    headline: str,
    subtitle: str,
    scene: Scene | None = None,
    last: Callable[[Axes], None] | None = None,
    *,
    ax: Axes | None = None,
    panel: _Panel | None = None,
    register: bool = False,
) -> Figure:
    """Draw layouts below each other on one scale, and their curves along them.

    Parameters
    ----------
    layouts
        Layouts; the gaps of the last one have markers.
    headline, subtitle
        Text above all.
    scene
        Scene whose bounds are drawn; None for none.
    last
        Function that draws another panel below the others.
    ax
        Axes that get one panel, along whole layouts, and nothing else; None for a new figure.
    panel
        The panel that `ax` get; None for the gaps.
    register
        True if pyplot is to show the figure, if the caller uses pyplot.

    Returns
    -------
    Figure
        The figure.
    """
    require_type("ax", ax, Axes | None, "Matplotlib axes, or None for a new figure")
    if ax is not None:
        (panel or partial(_sizes, "spacing"))(ax, layouts, scene)
        ax.set_xlabel(_x_label(layouts))
        if len(layouts) > 1:
            ax.legend(**LEGEND)
        return cast("Figure", ax.figure)
    tall = 1e3 * float(max(drawn.layout.height.max() for drawn in layouts))
    low, high = _range(layouts, scene, tall)
    end = min(high, low + LONGEST * tall)
    scale = SPAN / (end - low)  # [in/mm]
    panels = _panels(layouts, scene)
    strip = (tall + max(_relief(drawn.layout, low, end) for drawn in layouts)) * scale + LABEL
    height = HEAD + len(layouts) * strip + len(panels) * (PANEL + BETWEEN) + FOOT
    height += UNDER_AXIS + PANEL if last else 0.0
    figure = new_figure(WIDTH, height, placed=True, register=register)
    add_headings(figure, headline, subtitle, LEFT)
    y = height - HEAD
    for drawn in layouts:
        y -= strip
        axes = _axes(figure, y, strip)
        axes.set_xlim(low, end)
        _draw_dominoes(axes, drawn, strip / scale)
        place = LEFT / WIDTH, (y + strip - 0.15) / height
        first = "; the first dominoes are drawn" * (end < high)
        figure.text(*place, _label(drawn) + first, va="center", size=9.5, color=drawn.colour)
    for panel in panels:
        y -= BETWEEN + PANEL
        axes = _axes(figure, y, PANEL)
        panel(axes, layouts, scene)
        axes.set_xlim(low, high)
        axes.tick_params(labelbottom=panel is panels[-1])
        if panel is panels[-1]:
            axes.set_xlabel(_x_label(layouts))
    if last:
        last(_axes(figure, FOOT, PANEL))
    return figure


def plot_layout(layout: Layout, ax: Axes | None = None, register: bool = True) -> Figure:
    """Draw a layout to scale and its gaps, or its gaps alone into axes."""
    count, _, sizes = repr(layout)[len("Layout(") : -1].partition(": ")
    layouts = [DrawnLayout(layout, None, "as it stands")]
    return layouts_figure(layouts, count, sizes, ax=ax, register=register)


def plot_wave(wave: Wave, ax: Axes | None = None, register: bool = True) -> Figure:
    """Draw the layout of a wave to scale, its gaps and its speed, or its speed alone into axes."""
    physics = wave.physics
    layouts = [DrawnLayout(wave.layout, wave, "the layout")]
    headline = f"{wave.mean_speed:.4f} m/s" if wave.mean_speed > 0.0 else wave.outcome.label
    subtitle = (
        f"{wave.layout.count} dominoes, friction {physics.friction:g}, "
        f"push {physics.push:g} rad/s, gravity {physics.gravity:g} m/s²"
    )
    return layouts_figure(layouts, headline, subtitle, ax=ax, panel=_speed, register=register)


def draw_with_uniform(
    result: Any,
    name: str,
    last: Callable[[Axes], None] | None = None,
    ax: Axes | None = None,
    *,
    register: bool = False,
) -> Figure:
    """Draw a layout and the uniform baseline of its scene.

    Parameters
    ----------
    result
        Result with `scene`, `layout`, `wave` and `score`, such as a `SceneResult`.
    name
        Label of the layout.
    last
        Function that draws another panel below the others.
    ax
        Axes that get the gaps of both layouts and nothing else; None for a figure of its own.
    register
        True if pyplot is to show the figure, if the caller uses pyplot.

    Returns
    -------
    Figure
        The figure.
    """
    scene, uniform, physics = result.scene, result.scene.uniform(), result.scene.physics
    layouts = [
        DrawnLayout(uniform.layout, uniform.wave, "uniform baseline", UNIFORM),
        DrawnLayout(result.layout, result.wave, name),
    ]
    subtitle = (
        f"{scene.title} · {scene.count} dominoes, friction {physics.friction:g}, "
        f"push {physics.push:g} rad/s"
    )
    headline = f"{scene.name}: {scene.format_with_gain(result.score, result.wave)}"
    return layouts_figure(layouts, headline, subtitle, scene, last, ax=ax, register=register)


_Panel = Callable[[Axes, Sequence[DrawnLayout], Scene | None], None]


def _panels(layouts: Sequence[DrawnLayout], scene: Scene | None) -> list[_Panel]:
    """Return the panels along the layouts; sizes that are fixed and equal have none."""
    panels: list[_Panel] = [partial(_sizes, "spacing")] if layouts[0].layout.count > 1 else []
    for name in ("thickness", "height"):
        free = scene is not None and getattr(scene, f"free_{name}")
        if free or any(np.ptp(getattr(drawn.layout, name)) > 0 for drawn in layouts):
            panels.append(partial(_sizes, name))
    if any(drawn.wave for drawn in layouts) and layouts[0].layout.count > 1:
        panels.append(_speed)
    return panels


def _x_label(layouts: Sequence[DrawnLayout]) -> str:
    """Return the label of the x axis."""
    place = "position" if all(drawn.layout.is_flat for drawn in layouts) else "horizontally"
    return f"{place} from the first pivot [mm]"


def _range(layouts: Sequence[DrawnLayout], scene: Scene | None, tall: float) -> tuple[float, float]:
    """Return the range of x from the first pivot; tall: height of the tall domino [mm]."""
    low = -1e3 * float(layouts[-1].layout.thickness[0]) - 0.8 * tall
    shortest = SHORTEST if scene is None or scene.growth is None else SHORTEST_GROWING
    longest = 1e3 * max(float(drawn.layout.pivots[-1, 0]) for drawn in layouts)
    return low, max(longest + 0.25 * tall, low + shortest * tall)


def _axes(figure: Figure, bottom: float, height: float) -> Axes:
    """Return new axes at a height in inches, as wide as all others."""
    across, up = figure.get_size_inches()
    axes = figure.add_axes((LEFT / across, bottom / up, SPAN / across, height / up))
    style(axes)
    return axes


def _label(drawn: DrawnLayout) -> str:
    name, length, wave = drawn.name, f"{drawn.layout.length * 1e3:.1f} mm", drawn.wave
    if wave is None:
        return f"{name}: {length}"
    if wave.mean_speed == 0.0:
        return f"{name}: {wave.outcome.label}, {wave.hit} of {drawn.layout.count} were hit"
    return f"{name}: {length} in {wave.arrival_times[-1]:.4f} s, {wave.mean_speed:.4f} m/s"


def _draw_dominoes(axes: Axes, drawn: DrawnLayout, room: float) -> None:
    """Draw dominoes from the side, to scale; pale where the wave did not reach them.

    room: height that the axes cover [mm].
    """
    layout, wave, (low, high) = drawn.layout, drawn.wave, axes.get_xlim()
    axes.set_ylim(-0.02 * room, 0.98 * room)
    axes.grid(visible=False)
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[["left", "bottom"]].set_visible(False)
    inside = _inside(layout, low, high)
    stand = 1e3 * outlines(layout, layout.tilt)[inside]
    up = np.array([0.0, -float(stand[..., 1].min())])
    reach = 1e-3 * (high - low)
    axes.plot(*(1e3 * ground_line(layout, reach, reach) + up).T, color=INK, linewidth=0.8)
    boxes = [Polygon(corners) for corners in stand + up]
    hit = layout.count if wave is None else wave.hit
    colours = [drawn.colour if i < hit else FAINT for i in inside]
    axes.add_collection(PatchCollection(boxes, facecolor=colours, edgecolor="none"))
    if wave is not None:
        push = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.0}
        # at 0.88 of the height of the first domino's rear face
        rear, top = stand[0, 3] + up, stand[0, 2] + up
        x, z = rear + 0.88 * (top - rear)
        axes.annotate("", (x, z), (x - 600.0 * layout.height[0], z), arrowprops=push)


def _inside(layout: Layout, low: float, high: float) -> Ints:
    """Return the numbers of the standing dominoes that are drawn between two x [mm]."""
    front = 1e3 * layout.pivots[:, 0]
    return np.flatnonzero((front > low) & (front - 1e3 * layout.thickness < high))


def _relief(layout: Layout, low: float, high: float) -> float:
    """Return the range of the heights of the ground that is drawn [mm]."""
    feet = 1e3 * outlines(layout, layout.tilt)[_inside(layout, low, high)][:, [0, 3], 1]
    return float(np.ptp(feet))


def _curves(axes: Axes, layouts: Sequence[DrawnLayout], values: Sequence[Floats]) -> None:
    """Draw a value for each gap of each layout, halfway between its pivots."""
    for drawn, heights in zip(layouts, values, strict=True):
        places = drawn.layout.pivots[:, 0]
        middles = 500.0 * (places[:-1] + places[1:])
        marker = "o" if drawn is layouts[-1] or len(heights) == 1 else ""
        look: dict[str, Any] = {"color": drawn.colour, "linewidth": 1.5, "markersize": 3.0}
        axes.plot(middles, heights, marker=marker, label=drawn.name, **look)


def _sizes(name: str, axes: Axes, layouts: Sequence[DrawnLayout], scene: Scene | None) -> None:
    """Draw spacing, thickness or height, and the scene's bounds as dashed lines if in range."""
    values = [1e3 * getattr(drawn.layout, name)[1 - drawn.layout.count :] for drawn in layouts]
    if name != "height" and len(values[0]):
        low, high = min(v.min() for v in values), max(v.max() for v in values)
        room = max(0.12 * (high - low), 0.02 * high)
        axes.set_ylim(low - room, high + room)
        for bound in getattr(scene, name) if scene and not scene.in_heights else ():
            axes.axhline(1e3 * bound, color=SOFT, linewidth=0.8, linestyle=(0, (4, 4)))
    _curves(axes, layouts, values)
    axes.set_ylabel(f"{'gap' if name == 'spacing' else name} [mm]")


def _speed(axes: Axes, layouts: Sequence[DrawnLayout], _: Scene | None) -> None:
    """Draw the local speed of each wave."""
    fallen = [drawn for drawn in layouts if drawn.wave]
    values: list[Any] = [drawn.wave.local_speed for drawn in fallen if drawn.wave]
    _curves(axes, fallen, values)
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
