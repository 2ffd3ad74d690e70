"""Figures of a draft: curves of its gaps, thicknesses and local speeds along the row."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from bokeh.events import Pan, PanEnd, PanStart
from bokeh.models import ColumnDataSource, HoverTool, Range1d, Span
from bokeh.plotting import figure

from domino_env.core.colours import BEST_KNOWN, RESULT, UNIFORM
from domino_env.core.types import Floats
from optimize.interactive.draft import SPACING, THICKNESS

MM = 1e3  # [mm/m]
SPEED = "speed"
TITLES = {
    SPACING: "Gap [mm]: drag the points",
    THICKNESS: "Thickness [mm]: drag the points",
    SPEED: "Local speed [m/s] – grey: the other row",
}
# title of the curve of speeds with a schedule
LATENESS = "Lateness of each hit [ms] – grey: the other row"


class Curve:
    """Values along the row, for a draft and the row that it races.

    Parameters
    ----------
    view
        Range of x [m], shared by all figures.
    quantity
        One of `TITLES`.

    Attributes
    ----------
    figure
        Figure with the curves.
    follows_pointer
        True if points can be dragged; not with a finger, whose swipes scroll the page.
    """

    def __init__(self, view: Range1d, quantity: str) -> None:
        self._quantity, self.follows_pointer = quantity, True
        self.figure = figure(
            x_range=view, height=170, sizing_mode="stretch_width", tools="",
            title=TITLES[quantity], toolbar_location=None, min_border_left=48, min_border_right=12,
            outline_line_color=None, y_range=Range1d(0.0, 1.0), styles={"user-select": "none"},
        )  # fmt: skip
        self.figure.title.text_font_style = "normal"
        self.sources = [ColumnDataSource({"x": [], "y": []}) for _ in range(2)]
        for source, colour in zip(self.sources, (RESULT, UNIFORM), strict=True):
            self.figure.line("x", "y", source=source, color=colour, nonselection_alpha=1.0)
        if quantity == SPEED:
            self.figure.xaxis.axis_label = "position [m]"
            # the place of the wave, which row.js moves
            pointer = Span(dimension="height", line_color=BEST_KNOWN, visible=False)
            pointer.name = "pointer"
            self.figure.add_layout(pointer)

    def draw(self, rows: tuple[Any, Any], schedule: Floats | None) -> None:
        """Draw the curves of a draft and of the row that it races.

        Parameters
        ----------
        rows
            Objects with the `layout` and its `wave`, which also has the run-out; None for no row.
        schedule
            Scheduled times of dominoes 1 … N-1 [s], for the lateness instead of the speed.
        """
        for source, row in zip(self.sources, rows, strict=True):
            x = y = np.empty(0)
            if row is not None:
                layout = row.wave.layout if self._quantity == SPEED else row.layout
                pivots, thickness = layout.pivots[:, 0], layout.thickness[1:]
                x, y = 0.5 * (pivots[:-1] + pivots[1:] - thickness), MM * layout.spacing
                if self._quantity == THICKNESS:
                    x, y = pivots[1:] - 0.5 * thickness, MM * thickness
                elif self._quantity == SPEED and schedule is None:
                    y = row.wave.local_speed
                elif self._quantity == SPEED:
                    x, y = pivots[1:], MM * (row.wave.arrival_times[1:] - schedule)
            source.data = {"x": x, "y": y}
        if self._quantity == SPEED:
            self.figure.title.text = TITLES[SPEED] if schedule is None else LATENESS
            values = np.concatenate([np.nan_to_num(source.data["y"]) for source in self.sources])
            self.fit(min(0.0, values.min()), values.max())

    def fit(self, low: float, high: float) -> None:
        """Set the range of y to values from `low` to `high` [unit of the curve] and a margin."""
        margin = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
        self.figure.y_range.update(start=low - margin, end=high + margin)

    def enable_drag(self, drag: Callable[[int, float], object], drop: Callable[[], object]) -> None:
        """Make the points of the first curve draggable by a mouse.

        Parameters
        ----------
        drag
            Function that is called with the index of the dragged point and its new value [m].
        drop
            Function that is called at the end of a drag.
        """
        source = self.sources[0]
        points = self.figure.scatter(
            "x", "y", source=source, color=RESULT, size=8, nonselection_alpha=1.0,
            selection_color=BEST_KNOWN, hover_color=BEST_KNOWN,
        )  # fmt: skip
        tips = [("number", "$index"), (self._quantity, "@y{0.000} mm")]
        self.figure.add_tools(HoverTool(renderers=[points], tooltips=tips))
        offset = 0.0  # [mm] from the pointer to the point

        def begin(event: Any) -> None:
            nonlocal offset
            if self.follows_pointer:
                nearest = int(np.argmin(np.abs(source.data["x"] - event.x)))
                offset, source.selected.indices = source.data["y"][nearest] - event.y, [nearest]

        def move(event: Any) -> None:
            for index in source.selected.indices:
                drag(index, (event.y + offset) / MM)

        def end(_: Any) -> None:
            if source.selected.indices:
                source.selected.indices = []
                drop()

        for kind, handler in ((PanStart, begin), (Pan, move), (PanEnd, end)):
            self.figure.on_event(kind, handler)
