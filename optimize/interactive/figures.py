"""Figures of a design: its dominoes to scale at one instant, and curves along the chain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from bokeh.events import Pan, PanEnd, PanStart
from bokeh.models import ColumnDataSource, CustomJS, HoverTool, Label, PointDrawTool, Range1d, Span
from bokeh.plotting import figure

from domino_env.core.colours import BEST_KNOWN, FAINT, INK, RESULT, SOFT, UNIFORM
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.motion import outlines
from domino_env.physics.wave import Wave
from domino_env.view.drawing import FALLEN_COLOUR, LEADER_COLOUR, STANDING_COLOUR
from domino_env.view.ground import ground_line
from optimize.interactive.design import SPACING, THICKNESS

Handler = Callable[[Any], None]

MM = 1e3  # [mm/m]
MARGIN = 2.0  # [heights of the tallest domino] space ahead of a chain; 0.3 of it is behind
MAX_LENGTH = 60.0  # [heights of the tallest domino] largest width of the view
LEADER_PLACE = 0.7  # distance of the leading domino from the left, over the width of the view
SPEED = "speed"
COLUMNS = "x", "y", "width", "height", "angle", "colour"  # of the rectangles that are dominoes
COLOURS = [f"#{bytes(colour).hex()}" for colour in (FALLEN_COLOUR, LEADER_COLOUR, STANDING_COLOUR)]

TITLES = {
    SPACING: "Gap [mm] – drag the points up and down",
    THICKNESS: "Thickness [mm] – drag the points up and down",
    SPEED: "Local speed [m/s] – dashed: uniform baseline",
}


def set_view(view: Range1d, layout: Layout, leader: float | None = None) -> None:
    """Set the range of x to a whole chain, or to a part of a long one.

    Parameters
    ----------
    view
        Range of x [m], which is changed.
    layout
        The layout.
    leader
        x of the leading domino [m], around which the part is shown; None to keep its start.
    """
    height = float(layout.height.max())
    low = -float(layout.thickness[0]) - 0.3 * MARGIN * height
    length = float(layout.pivots[-1, 0]) + MARGIN * height - low
    width = min(length, MAX_LENGTH * height)
    begin = view.start if leader is None else leader - LEADER_PLACE * width
    begin = max(low, min(begin, low + length - width))
    view.bounds = low, low + length  # set first, as bounds limit start and end
    view.update(start=begin, end=begin + width)


class ChainPicture:
    """Picture of a chain to scale at one instant.

    Parameters
    ----------
    view
        Range of x [m], shared by all figures.
    """

    def __init__(self, view: Range1d) -> None:
        self.figure = _figure(view, 130, "xpan", "")
        self.figure.y_range = y_range = self._y_range = Range1d(-0.05, 0.1)
        self.figure.yaxis.visible = self.figure.xaxis.visible = False
        self.figure.grid.visible = False
        # equal scales of both axes; their sizes in pixels are available in the browser only
        equal_scale = CustomJS(
            args={"f": self.figure, "x": view, "y": y_range},
            code="const h = (x.end - x.start) * f.inner_height / f.inner_width;"
            "if (isFinite(h)) y.end = y.start + h",
        )
        for model, changes in (
            (view, "start end"), (y_range, "start"), (self.figure, "inner_width inner_height"),
        ):  # fmt: skip
            for change in changes.split():
                model.js_on_change(change, equal_scale)
        self._ground = self.figure.line([], [], color=SOFT).data_source
        self._dominoes = ColumnDataSource({key: [] for key in COLUMNS})
        self.figure.rect(*COLUMNS[:5], source=self._dominoes, color="colour", line_color="white",
                         line_width=0.5)  # fmt: skip
        self._finish = Span(dimension="height", line_color=INK, line_dash="dashed")
        self._stop = Label(x=0, y=0, visible=False, text_color=BEST_KNOWN, text_font_size="13px")
        for annotation in (self._finish, self._stop):
            self.figure.add_layout(annotation)

    def draw(self, layout: Layout, leans: Floats, leader: int, stop: int | None) -> None:
        """Draw the chain at one instant, with an arrow where the wave stops.

        Parameters
        ----------
        layout
            The layout.
        leans
            (N,) leans from the vertical [rad].
        leader
            Index of the leading domino; -1 before the push.
        stop
            Index of the leading domino with which the wave stops; None if it completes.
        """
        pivots, centres = layout.pivots, outlines(layout, leans).mean(axis=1)
        state = np.sign(np.arange(layout.count) - leader) + 1  # index in COLOURS
        values = *centres.T, layout.thickness, layout.height, -leans, np.take(COLOURS, state)
        self._dominoes.data = dict(zip(COLUMNS, values, strict=True))
        height = float(layout.height.max())
        line = ground_line(layout, height, height)
        self._ground.data = {"x": line[:, 0], "y": line[:, 1]}
        # space below the ground, more on a slope
        self._y_range.start = float(line[:, 1].min() - 0.5 * np.ptp(line[:, 1]) - 0.4 * height)
        self._finish.location = float(pivots[-1, 0])
        pivot, text = pivots[stop or 0], f"the wave stops at domino {stop}"
        right = (stop or 0) > layout.count // 2  # in the right half; the text is left of the arrow
        self._stop.update(
            x=float(pivot[0]), y=float(pivot[1]) + 1.15 * height, visible=stop is not None,
            x_offset=5 if right else -5, text_align="right" if right else "left",
            text=f"{text} ▼" if right else f"▼ {text}",
        )  # fmt: skip


class Curve:
    """Gap, thickness or local speed along the chain, for a design and two other layouts.

    Parameters
    ----------
    view
        Range of x [m], shared by all figures.
    quantity
        One of `TITLES`.
    """

    def __init__(self, view: Range1d, quantity: str) -> None:
        self._quantity = quantity
        self.figure = _figure(view, 190, "", TITLES[quantity])
        self.figure.y_range = self._y_range = Range1d(0.0, 1.0)
        # only the lowest figure has a label
        self.figure.xaxis.axis_label = "horizontal position [m]" if quantity == SPEED else None
        self.sources = [ColumnDataSource({"x": [], "y": [], "index": []}) for _ in range(3)]
        styles = ((RESULT, "solid"), (UNIFORM, "dashed"), (BEST_KNOWN, "dotted"))
        for source, (colour, dash) in zip(self.sources, styles, strict=True):
            style = {"color": colour, "line_dash": dash, "nonselection_alpha": 1.0}
            self.figure.line("x", "y", source=source, **style)

    def draw(self, waves: Sequence[Wave | None]) -> None:
        """Draw three curves.

        Parameters
        ----------
        waves
            Waves of the design, of the uniform baseline and of a compared layout; None for none.
        """
        for source, wave in zip(self.sources, waves, strict=True):
            x = y = np.empty(0)
            if wave is not None:
                pivots, thickness = wave.layout.pivots[:, 0], wave.layout.thickness[1:]
                x, y = 0.5 * (pivots[:-1] + pivots[1:] - thickness), MM * wave.layout.spacing
                if self._quantity == SPEED:
                    y = wave.local_speed
                elif self._quantity == THICKNESS:
                    x, y = pivots[1:] - 0.5 * thickness, MM * thickness
            # of gaps 0 to N-2, or of dominoes 1 to N-1
            index = np.arange(len(x)) + (self._quantity == THICKNESS)
            source.data = {"x": x, "y": y, "index": index}
        if self._quantity == SPEED:
            highest = [np.nan_to_num(source.data["y"]).max(initial=0.0) for source in self.sources]
            self.fit(0.0, max(highest))

    def fit(self, low: float, high: float) -> None:
        """Set the range of y to values from `low` to `high` [unit of the curve] and a margin."""
        margin = 0.08 * (high - low) or 0.1 * high or 1.0
        self._y_range.update(start=low - margin, end=high + margin)

    def enable_drag(self, begin: Handler, move: Handler, end: Handler) -> None:
        """Make the points of the first curve draggable.

        Parameters
        ----------
        begin, move, end
            Functions that are called with the events of the pointer.
        """
        points = self.figure.scatter(
            "x", "y", source=self.sources[0], color=RESULT, size=8, nonselection_alpha=1.0,
            selection_color=BEST_KNOWN, hover_color=BEST_KNOWN,
        )  # fmt: skip
        tips = [("number", "@index"), (TITLES[self._quantity].split()[0].lower(), "@y{0.000} mm")]
        # this tool has no points to move; it prevents a touch from scrolling the page
        tool = PointDrawTool(renderers=[self.figure.scatter([], [])], add=False)
        self.figure.add_tools(HoverTool(renderers=[points], tooltips=tips), tool)
        self.figure.toolbar.active_drag = tool
        for kind, handler in ((PanStart, begin), (Pan, move), (PanEnd, end)):
            self.figure.on_event(kind, handler)


def _figure(view: Range1d, height: int, tools: str, title: str) -> Any:
    """Return an empty figure in the style of all drawings."""
    plot = figure(
        x_range=view, height=height, sizing_mode="stretch_width", tools=tools, title=title,
        toolbar_location=None, min_border_left=48, min_border_right=12, outline_line_color=None,
    )  # fmt: skip
    plot.title.update(text_font_size="13px", text_color=INK, text_font_style="normal")
    plot.grid.grid_line_color, plot.axis.axis_line_color = FAINT, SOFT
    plot.axis.major_label_text_color = plot.axis.axis_label_text_color = SOFT
    plot.axis.minor_tick_line_color = None
    return plot
