"""Figures of a design: curves of its gaps, thicknesses and local speeds along the row."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from bokeh.events import Pan, PanEnd, PanStart
from bokeh.models import ColumnDataSource, HoverTool, PointDrawTool, Range1d, Span
from bokeh.plotting import figure

from domino_env.core.colours import BEST_KNOWN, FAINT, INK, RESULT, SOFT, UNIFORM
from domino_env.core.types import Floats
from domino_env.physics.wave import Wave
from optimize.interactive.design import SPACING, THICKNESS

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
    """Values along the row, for a design and the row that it races.

    Parameters
    ----------
    view
        Range of x [m], shared by all figures.
    quantity
        One of `TITLES`.
    """

    def __init__(self, view: Range1d, quantity: str) -> None:
        self._quantity = quantity
        self.figure = figure(
            x_range=view, height=170, sizing_mode="stretch_width", tools="",
            title=TITLES[quantity], toolbar_location=None, min_border_left=48, min_border_right=12,
            outline_line_color=None, y_range=Range1d(0.0, 1.0),
        )  # fmt: skip
        self.figure.title.update(text_font_size="13px", text_color=INK, text_font_style="normal")
        self.figure.grid.grid_line_color, self.figure.axis.axis_line_color = FAINT, SOFT
        self.figure.axis.major_label_text_color = self.figure.axis.axis_label_text_color = SOFT
        self.figure.axis.minor_tick_line_color = None
        self.sources = [ColumnDataSource({"x": [], "y": [], "index": []}) for _ in range(2)]
        for source, colour in zip(self.sources, (RESULT, UNIFORM), strict=True):
            self.figure.line("x", "y", source=source, color=colour, nonselection_alpha=1.0)
        if quantity == SPEED:  # the place of the wave, which row.js moves
            self.figure.xaxis.axis_label = "position [m]"
            pointer = Span(dimension="height", line_color=BEST_KNOWN, visible=False)
            pointer.name = "pointer"
            self.figure.add_layout(pointer)

    def draw(self, waves: Sequence[Wave | None], schedule: Floats | None = None) -> None:
        """Draw the curves of a design and of the row that it races; None for no such row.

        Parameters
        ----------
        waves
            The waves.
        schedule
            Scheduled times of dominoes 1 … N-1 [s], for the lateness instead of the speed.
        """
        for source, wave in zip(self.sources, waves, strict=True):
            x = y = np.empty(0)
            if wave is not None:
                pivots, thickness = wave.layout.pivots[:, 0], wave.layout.thickness[1:]
                x, y = 0.5 * (pivots[:-1] + pivots[1:] - thickness), MM * wave.layout.spacing
                if self._quantity == SPEED and schedule is not None:
                    x, y = pivots[1:], MM * (wave.arrival_times[1:] - schedule)
                elif self._quantity == SPEED:
                    y = wave.local_speed
                elif self._quantity == THICKNESS:
                    x, y = pivots[1:] - 0.5 * thickness, MM * thickness
            # of gaps 0 to N-2, or of dominoes 1 to N-1
            index = np.arange(len(x)) + (self._quantity == THICKNESS)
            source.data = {"x": x, "y": y, "index": index}
        if self._quantity == SPEED:
            self.figure.title.text = TITLES[SPEED] if schedule is None else LATENESS
            values = np.concatenate([np.nan_to_num(source.data["y"]) for source in self.sources])
            self.fit(min(0.0, values.min()), values.max())

    def fit(self, low: float, high: float) -> None:
        """Set the range of y to values from `low` to `high` [unit of the curve] and a margin."""
        margin = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
        self.figure.y_range.update(start=low - margin, end=high + margin)

    def enable_drag(self, *handlers: Callable[[Any], None]) -> None:
        """Make the points of the first curve draggable.

        Parameters
        ----------
        *handlers
            Functions that are called with the events at the begin, the moves and the end.
        """
        points = self.figure.scatter(
            "x", "y", source=self.sources[0], color=RESULT, size=8, nonselection_alpha=1.0,
            selection_color=BEST_KNOWN, hover_color=BEST_KNOWN,
        )  # fmt: skip
        tips = [("number", "@index"), (TITLES[self._quantity].split()[0].lower(), "@y{0.000} mm")]
        # this tool has no points to move; it prevents a mouse from selecting text
        tool = PointDrawTool(renderers=[self.figure.scatter([], [])], add=False)
        self.figure.add_tools(HoverTool(renderers=[points], tooltips=tips), tool)
        self.figure.toolbar.active_drag = tool
        for kind, handler in zip((PanStart, Pan, PanEnd), handlers, strict=True):
            self.figure.on_event(kind, handler)
