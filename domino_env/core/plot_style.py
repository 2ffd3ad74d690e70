"""Style of all figures, which no settings of the user change."""

from __future__ import annotations

import io
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context, rcdefaults
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from domino_env.core.colours import COLOURS, FAINT, INK, RESULT, SOFT
from domino_env.core.files import write_bytes
from domino_env.core.types import Floats

HEAD = 0.85  # height of headline and subtitle [in]
RIGHT = 0.20  # width to the right of the longest headline [in]
MIN_WIDTH = 7.5  # of a figure with a headline [in]
LEGEND: dict[str, Any] = {"frameon": False, "fontsize": 9}  # arguments of `Axes.legend`

_SETTINGS = threading.RLock()  # Matplotlib's settings are those of the process


@contextmanager
def own_style() -> Iterator[None]:
    """Open a context, also as a decorator, in which figures have the defaults of Matplotlib.

    Without it, figures follow the matplotlibrc of the user: `savefig.bbox: tight`, for example,
    changes the size of a page. Every function that makes a figure or writes a file opens it, other
    than one that draws into axes of the user.
    """
    with _SETTINGS, rc_context():
        rcdefaults()
        yield


def method_lines(methods: Sequence[str]) -> dict[str, dict[str, Any]]:
    """Return a distinct line style for each search method.

    Parameters
    ----------
    methods
        Names. The default method always has the colour `RESULT`, the uniform baseline a grey
        dotted line.

    Returns
    -------
    dict
        `color` and `linestyle` by name. Lines of the second half of `COLOURS` are dashed; further
        methods repeat the first styles.
    """
    styles = {"auto": (RESULT, "-"), "uniform": (SOFT, ":")}
    for k, method in enumerate([name for name in methods if name not in styles]):
        index = 1 + k % (len(COLOURS) - 1)  # COLOURS[0] is that of the default method
        styles[method] = COLOURS[index], "--" if index > len(COLOURS) // 2 else "-"
    return {method: {"color": c, "linestyle": line} for method, (c, line) in styles.items()}


class Picture(Figure):
    """Figure that notebooks show without pyplot."""

    @own_style()  # ticks are made when they are drawn
    def draw(self, renderer: Any) -> None:
        """Draw the figure."""
        super().draw(renderer)

    def _repr_png_(self) -> bytes:
        return png(self)


def new_figure(
    width: float, height: float, *, placed: bool = False, register: bool = False
) -> Figure:
    """Return an empty figure.

    Parameters
    ----------
    width, height
        Size [in].
    placed
        True if the caller places the axes; otherwise they fill the figure.
    register
        True to have `pyplot.show` show the figure, if pyplot is imported; notebooks always show it.
    """
    options: dict[str, Any] = {"facecolor": "white", "layout": None if placed else "constrained"}
    pyplot = sys.modules.get("matplotlib.pyplot")
    # the inline backend of notebooks would show the figure a second time
    if register and pyplot is not None and "inline" not in pyplot.get_backend():
        figure: Figure = pyplot.figure(FigureClass=Picture, figsize=(width, height), **options)
        return figure
    figure = Picture((width, height), **options)
    FigureCanvasAgg(figure)
    return figure


def new_axes(
    width: float, height: float, title: str = "", **properties: Any
) -> tuple[Figure, Axes]:
    """Return a figure [in] with one panel after `style`; properties: as for `Axes.set`."""
    figure = new_figure(width, height)
    axes = figure.add_subplot()
    style(axes, title)
    axes.set(**properties)
    return figure, axes


def new_panels(
    number: int,
    max_columns: int,
    size: tuple[float, float],
    margins: tuple[float, float] = (0.0, 0.0),
    headline: str = "",
    subtitle: str = "",
    **sharing: Any,
) -> tuple[Figure, list[Axes]]:
    """Return a figure with a grid of panels.

    Parameters
    ----------
    number
        Number of panels.
    max_columns
        Largest number of panels side by side.
    size
        Width and height of each panel [in].
    margins
        Width and height to add to those of the panels, such as for a legend [in].
    headline, subtitle
        Text above all panels; an empty headline leaves out both.
    sharing
        `sharex` and `sharey` of `Figure.subplots`.

    Returns
    -------
    tuple
        The figure and its panels, from left to right and from top to bottom, after `style`.
    """
    columns = min(number, max_columns)
    lines = -(-number // columns)  # rounded up
    head = HEAD if headline else 0.0
    width, height = margins[0] + size[0] * columns, margins[1] + size[1] * lines + head
    figure = new_figure(max(width, MIN_WIDTH if headline else 0.0), height)
    if headline:
        add_headings(figure, headline, subtitle)
    panels = list(figure.subplots(lines, columns, squeeze=False, **sharing).ravel())
    for axes in panels[number:]:
        axes.remove()
    for axes in panels[:number]:
        style(axes)
    return figure, panels[:number]


def style(axes: Axes, title: str = "") -> None:
    """Set grid, spines and colours of axes, and their title if there is one."""
    axes.grid(color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["left", "bottom"]].set_color(SOFT)
    axes.tick_params(which="both", colors=SOFT, labelsize=9)
    axes.xaxis.label.set_color(SOFT)
    axes.yaxis.label.set_color(SOFT)
    if title:
        axes.set_title(escape_dollars(title), loc="left", color=INK, size=11)


def add_headings(figure: Figure, headline: str, subtitle: str, left: float = 0.12) -> None:
    """Write headline and subtitle at the top of a figure, `left` inches from its left edge.

    A text that is too long for the figure has smaller letters.
    """
    width, height = figure.get_size_inches()
    layout: Any = figure.get_layout_engine()
    if layout is not None:
        layout.set(rect=(0.0, 0.0, 1.0, 1.0 - HEAD / height))
    # y: the centre of the line of text, from the top [in]
    for text, y, size, colour, weight in (
        (headline, 0.30, 14.5, INK, "bold"), (subtitle, 0.58, 9.5, SOFT, "normal"),
    ):  # fmt: skip
        line = figure.text(left / width, 1.0 - y / height, escape_dollars(text), va="center")
        line.set(size=size, color=colour, weight=weight)
        while line.get_window_extent().width > figure.dpi * (width - left - RIGHT):
            size *= 0.95
            line.set_fontsize(size)


def set_time_axis(axes: Axes, times: Sequence[float] | Floats) -> None:
    """Set the scale and the limits of a time axis to rising times.

    The axis is logarithmic from the first time if the ratio of the last to it is above 30, else
    linear from 0.
    """
    begin = times[0] if times[-1] > 30.0 * times[0] else 0.0
    if begin > 0.0:
        axes.set_xscale("log")
        label_plainly(axes.xaxis, (1, 3))
    axes.set_xlim(begin, max(times[-1], 1e-3))  # Matplotlib warns of equal limits


def set_wide_axis(axes: Axes, values: Floats) -> bool:
    """Set a logarithmic y axis if positive values differ by more than a factor of 20.

    Values that are not finite are ignored. Return True if the axis is logarithmic.
    """
    values = values[np.isfinite(values)]
    if not len(values) or values.max() <= 20.0 * values.min():
        return False
    axes.set_yscale("log")
    axes.set_ylim(0.5 * values.min(), 5.0 * values.max())  # with space for a legend
    label_plainly(axes.yaxis, (1,) if values.max() > 1e3 * values.min() else (1, 3))
    return True


def label_plainly(axis: Axis, digits: Sequence[float]) -> None:
    """Label a logarithmic axis at `digits` times powers of ten, 1e-7 to 1e7, with plain numbers."""
    axis.set_major_locator(FixedLocator([a * 10.0**k for k in range(-7, 8) for a in digits]))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))


def escape_dollars(text: str) -> str:
    """Escape the dollar signs of a text, between which Matplotlib would typeset a formula."""
    return text.replace("$", r"\$")


@own_style()
def png(figure: Figure) -> bytes:
    """Return the bytes of a PNG file; equal figures give equal bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=140, metadata={"Software": None})
    return buffer.getvalue()


def write_png(figure: Figure, path: Path) -> None:
    """Write the figure as a PNG file."""
    write_bytes(path, lambda file: file.write(png(figure)))
