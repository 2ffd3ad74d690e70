"""Figures of a design: the dominoes to scale at one instant, and curves along the chain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from bokeh.events import Pan, PanEnd, PanStart
from bokeh.models import (
    ColumnDataSource,
    CustomJS,
    HoverTool,
    Label,
    PointDrawTool,
    Range1d,
    Span,
)
from bokeh.plotting import figure

from domino_env.core.colours import FAINT, INK, KNOWN, OURS, SOFT, UNIFORM
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.motion import outlines
from domino_env.physics.wave import Wave
from domino_env.view.drawing import FALLS, LEADS, STANDS
from domino_env.view.ground import ground_line

Handler = Callable[[Any], None]

MM = 1e3
EDGES = 2.0  # heights beside a chain
LONGEST = 60.0  # heights of a chain that is shown whole; of a longer one the beginning
AHEAD = 0.7  # of the width: furthest place of the leading domino
HALF = 0.5  # of the height of a picture above the middle of the ground


def new_view(layout: Layout) -> Range1d:
    """Return the range of places [m] that all figures of a layout share."""
    view = Range1d(0.0, 1.0)
    set_view(view, layout)
    return view


def set_view(view: Range1d, layout: Layout, leader: float | None = None) -> None:
    """Show a chain from its beginning, or the part of a long one around the leader's place [m]."""
    tall = float(layout.height.max())
    first = -float(layout.thickness[0]) - 0.3 * EDGES * tall
    length = float(layout.pivots[-1, 0]) + EDGES * tall - first
    wide = min(length, LONGEST * tall)
    begin = (
        first if leader is None else max(first, min(leader - AHEAD * wide, first + length - wide))
    )
    view.update(start=begin, end=begin + wide, bounds=(first, first + length))


class Chain:
    """Picture of a chain to scale at one instant.

    Parameters
    ----------
    view
        Range of places [m].
    """

    def __init__(self, view: Range1d) -> None:
        self.figure = _figure(view, 130, "xpan", "")
        up = Range1d(-0.05, 0.1)
        self.figure.y_range = up
        self.figure.yaxis.visible = self.figure.xaxis.visible = False
        self.figure.grid.visible = False
        # one scale for both axes, which the page alone knows
        keep = CustomJS(
            args={"f": self.figure, "x": view, "y": up},
            code="const h = (x.end - x.start) * f.inner_height / f.inner_width;"
            "if (isFinite(h)) y.end = y.start + h",
        )
        for model, changes in (
            (view, "start end"), (up, "start"), (self.figure, "inner_width inner_height"),
        ):  # fmt: skip
            for change in changes.split():
                model.js_on_change(change, keep)
        self._up = up
        self._parts = [ColumnDataSource({"x": [], "y": []}) for _ in range(4)]
        self.figure.line("x", "y", source=self._parts[3], color=SOFT)
        for part, colour in zip(self._parts, (STANDS, FALLS, LEADS), strict=False):
            self.figure.patch(
                "x", "y", source=part, color=colour, line_color="white", line_width=0.5
            )
        self._finish = Span(location=0, dimension="height", line_color=INK, line_dash="dashed")
        self._stop = Label(
            x=0, y=0, visible=False, text_color=KNOWN, text_align="center", text_font_size="13px"
        )
        for annotation in (self._finish, self._stop):
            self.figure.add_layout(annotation)

    def draw(self, layout: Layout, leans: Floats, leader: int, stop: int | None) -> None:
        """Draw the chain at one instant, with a mark where it stops.

        Parameters
        ----------
        layout
            The layout.
        leans
            (N,) leans from the vertical [rad].
        leader
            Number of the leading domino; -1 before the push.
        stop
            Number of the leading domino with which the wave stops; None where it completes.
        """
        pivots, corners = layout.pivots, outlines(layout, leans)
        closed = np.concatenate([corners, np.full((layout.count, 1, 2), np.nan)], axis=1)
        number = np.arange(layout.count)
        groups = number > leader, number < leader, number == leader
        for part, which in zip(self._parts, groups, strict=False):
            x, y = closed[which].reshape(-1, 2).T
            part.data = {"x": x, "y": y}
        tall = float(layout.height.max())
        line = ground_line(layout, tall, tall)
        self._parts[3].data = {"x": line[:, 0], "y": line[:, 1]}
        self._up.start = float(np.ptp(line[:, 1]) * -HALF + line[:, 1].min()) - 0.4 * tall
        self._finish.location = float(pivots[-1, 0])
        at = pivots[stop or 0]
        self._stop.update(x=float(at[0]), y=float(at[1]) + 1.15 * tall, visible=stop is not None,
                          text=f"▼ the wave stops here (domino {stop})")  # fmt: skip


class Curve:
    """Curve along the chain, beside those of the uniform baseline and of another layout.

    Parameters
    ----------
    view
        Range of places [m].
    name
        Quantity and unit: "gap [mm]", "thickness [mm]" or "local speed [m/s]".
    """

    def __init__(self, view: Range1d, name: str) -> None:
        self._speed, self._thickness = name.startswith("local"), name.startswith("thick")
        hint = "dashed: uniform baseline" if self._speed else "drag the points up and down"
        self.figure = _figure(view, 190, "", f"{name[0].upper()}{name[1:]} – {hint}")
        self.figure.y_range = self._up = Range1d(0.0, 1.0)
        self.sources = [ColumnDataSource({"x": [], "y": [], "n": []}) for _ in range(3)]
        looks = ((OURS, "solid"), (UNIFORM, "dashed"), (KNOWN, "dotted"))
        for source, (colour, dash) in zip(self.sources, looks, strict=True):
            self.figure.line("x", "y", source=source, color=colour, line_dash=dash)
        if not self._speed:
            points = self.figure.scatter(
                "x", "y", source=self.sources[0], color=OURS, size=8, nonselection_alpha=1.0,
                selection_color=KNOWN, hover_color=KNOWN,
            )  # fmt: skip
            tips = [("number", "@n"), (name, "@y{0.000}")]
            self.figure.add_tools(HoverTool(renderers=[points], tooltips=tips))
        else:
            self.figure.xaxis.axis_label = "place along the chain [m]"

    def draw(self, waves: Sequence[Wave | None]) -> None:
        """Draw the layout's wave, that of the uniform baseline and another one; None for none."""
        top = 0.0
        for source, wave in zip(self.sources, waves, strict=True):
            x = y = np.empty(0)
            if wave is not None:
                place, thick = wave.layout.pivots[:, 0], wave.layout.thickness
                x = 0.5 * (place[:-1] + place[1:] - thick[1:])
                y = wave.local_speed if self._speed else MM * wave.layout.spacing
                if self._thickness:
                    x, y = place[1:] - 0.5 * thick[1:], MM * thick[1:]
                top = max(top, float(np.nanmax(y, initial=0.0)))
            source.data = {"x": x, "y": y, "n": np.arange(len(x)) + self._thickness}
        if self._speed:
            self.fit(0.0, top)

    def fit(self, low: float, high: float) -> None:
        """Set the range of values."""
        room = 0.08 * (high - low) or 0.1 * high or 1.0
        self._up.update(start=low - room, end=high + room)


def let_drag(curve: Curve, begin: Handler, go: Handler, end: Handler) -> None:
    """Let points of a curve be dragged: call functions with the place and value of the pointer."""
    nothing = curve.figure.scatter([], [])  # the tool keeps a touch from scrolling the page
    tool = PointDrawTool(renderers=[nothing], add=False)
    curve.figure.add_tools(tool)
    curve.figure.toolbar.active_drag = tool
    for kind, react in ((PanStart, begin), (Pan, go), (PanEnd, end)):
        curve.figure.on_event(kind, react)


def _figure(view: Range1d, height: int, tools: str, title: str) -> Any:
    """Return an empty figure in the style of all drawings."""
    made = figure(
        x_range=view, height=height, sizing_mode="stretch_width", tools=tools, title=title,
        toolbar_location=None, min_border_left=48, min_border_right=12, outline_line_color=None,
    )  # fmt: skip
    made.title.text_font_size, made.title.text_color, made.title.text_font_style = (
        "13px",
        INK,
        "normal",
    )
    made.grid.grid_line_color, made.axis.axis_line_color = FAINT, SOFT
    made.axis.major_label_text_color = made.axis.axis_label_text_color = SOFT
    made.axis.minor_tick_line_color = None
    made.toolbar.logo = None
    return made
