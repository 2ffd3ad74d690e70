"""Template: the footprints of a layout at 1:1 on paper, on which the dominoes are placed."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence, Set
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import Name, PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from domino_env.core.colours import INK, SOFT
from domino_env.core.files import amount, write_bytes
from domino_env.core.plot_style import escape_dollars, own_style
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import simulate
from domino_env.view.ground import positions_along
from domino_env.view.slots import safety_gaps

PAPERS = {"a4": (0.297, 0.210), "letter": (0.2794, 0.2159)}  # [m] landscape
MAX_SHEETS = 1_000  # enough for several hundred metres
MARGIN = 0.014  # [m] of blank paper at the left and right of a sheet
LEAST_MARGIN = 0.006  # [m] that printers need; used if it saves a sheet
LEAD = 0.010  # [m] of paper before the first domino and after the last
HEAD, FOOT = 0.024, 0.026  # [m] of a sheet for its title and for its scale bar
BESIDE = 0.013  # [m] of a strip on each side of the dominoes, for their numbers
NUMBER = 2.4  # [mm] half the width of a number
BAR = 0.100  # [m] length of the scale bar
INCH, MM = 0.0254, 1000.0  # [m] in an inch, millimetres in a metre
SUBTITLE = 140  # letters in a line of a subtitle, at most
LINE = 0.4  # [pt] width of thin lines


@dataclass(frozen=True)
class Strip:
    """Strip of paper with a part of the layout, cut out and joined to the strip before.

    Attributes
    ----------
    number
        Number of the strip, from 1.
    sheet
        Number of its sheet of paper, from 1.
    middle
        Distance of its centre line from the bottom of the sheet [m].
    begin
        Position of its left end along the ground from the first pivot [m].
    end
        Position of its right end [m], where the next strip begins.
    dominoes
        Indices of the dominoes with a part of their footprint on it; on paper they are numbered
        from 1.
    margin
        Width of the blank margins at its left and right [m].
    """

    number: int
    sheet: int
    middle: float
    begin: float
    end: float
    dominoes: tuple[int, ...]
    margin: float


def strips(layout: Layout, paper: str = "a4") -> list[Strip]:
    """Cut a layout into strips, as many on a sheet of paper as fit.

    The margins are narrower if that saves a sheet.

    Parameters
    ----------
    layout
        The layout.
    paper
        "a4" or "letter".

    Returns
    -------
    list of Strip
        Strips from the first domino to the last.

    Raises
    ------
    ValueError
        For dominoes wider than the paper, and for more than 1 000 sheets.
    """
    wide, high = PAPERS[paper]
    across = layout.width + 2.0 * BESIDE  # width of a strip
    per_sheet = int((high - HEAD - FOOT) / across)  # strips
    if per_sheet < 1:
        most = high - HEAD - FOOT - 2.0 * BESIDE
        raise ValueError(f"width = {layout.width} m: give at most {most:.3g} m for {paper} paper")
    front = positions_along(layout)
    rear = front - layout.thickness
    begin, margin = float(rear[0]) - LEAD, MARGIN
    paper_length = float(front[-1]) + LEAD - begin
    total = math.ceil(paper_length / (wide - 2.0 * margin))
    fewer = (total - 1) // per_sheet * per_sheet  # strips of one sheet less
    if fewer and paper_length <= fewer * (wide - 2.0 * LEAST_MARGIN):
        total, margin = fewer, 0.5 * (wide - paper_length / fewer)
    length = wide - 2.0 * margin
    if total > MAX_SHEETS * per_sheet:
        raise ValueError(
            f"a layout of {layout.length:.6g} m takes {-(-total // per_sheet):,} sheets of paper: "
            f"at most {MAX_SHEETS:,} are drawn; check that its sizes are in metres"
        )
    cut = []
    for k in range(total):
        left, right = begin + k * length, begin + (k + 1) * length
        inside = np.flatnonzero((front > left) & (rear < right))
        sheet, place = divmod(k, per_sheet)
        middle = high - HEAD - (place + 0.5) * across
        cut.append(Strip(k + 1, sheet + 1, middle, left, right, tuple(inside.tolist()), margin))
    return cut


def write_template(
    layout: Layout,
    path: Path,
    paper: str = "a4",
    title: str = "Template",
    physics: Physics | None = None,
    designed: int | None = None,
    safety: float = 0.0,
) -> str:
    """Write a PDF: a page of advice, then the sheets.

    Parameters
    ----------
    layout
        The layout.
    path
        Output file, PDF.
    paper
        "a4" or "letter".
    title
        Title of every page.
    physics
        Physics whose push and time of the last hit are printed; None for neither.
    designed
        Number of designed dominoes; the boxes of those after them, the run-out, are grey. None for
        all.
    safety
        Length between safety gaps [mm], whose boxes are crossed out; 0 for none.

    Returns
    -------
    str
        Numbers of pages, sheets and strips, and an instruction to print them.

    Raises
    ------
    ValueError
        For dominoes wider than the paper, and for more than 1 000 sheets.
    """
    all_strips, designed = strips(layout, paper), designed or layout.count
    late = safety_gaps(layout, safety)
    total = all_strips[-1].sheet
    buffer = io.BytesIO()
    # without a date, equal layouts give equal files
    with (
        own_style(),
        rc_context({"pdf.compression": 9, "pdf.fonttype": 42}),
        PdfPages(buffer, metadata={"CreationDate": None, "Title": title}) as pages,
    ):
        _forbid_scaling(pages)
        with _page(pages, paper, title, repr(layout)[len("Layout(") : -1]) as axes:
            _write_advice(axes, _advice(all_strips, layout, physics, designed, late))
        for number in range(1, total + 1):
            with _page(pages, paper, title, f"sheet {number} of {total}") as axes:
                for strip in all_strips:
                    if strip.sheet == number:
                        _draw_one_strip(axes, layout, strip, len(all_strips), designed, late)
                _draw_bar(axes)
    write_bytes(path, lambda file: file.write(buffer.getvalue()))
    pages = f"a page of advice and {amount(total, 'sheet')} with {amount(len(all_strips), 'strip')}"
    return f"{pages}: print at 100 % and check the scale bar"


def _forbid_scaling(pages: Any, name: Any = Name) -> None:
    """Ask viewers to print the pages of a file at 100 %; many fit pages to the paper otherwise."""
    file = pages._ensure_file()
    # written before: the later one is in the table of objects
    file.writeObject(file.rootObject, {
        "Type": name("Catalog"), "Pages": file.pagesObject,
        "Version": name("1.6"), "ViewerPreferences": {"PrintScaling": name("None")},
    })  # fmt: skip


def _advice(
    all_strips: Sequence[Strip],
    layout: Layout,
    physics: Physics | None,
    designed: int | None = None,
    late: Set[int] = frozenset(),
) -> list[str]:
    """Return the steps of building the layout with the strips."""
    steps = ["Print at 100 %, not fitted to the page, and check the scale bar with a ruler."]
    if len(all_strips) > 1:
        steps.append(
            "Cut the strips out along the thin lines. Cut the left end of each along its dashed "
            "line, and lay it on the dashed line at the right end of the strip before."
        )
    steps.append("Tape the paper down flat: it must not slip, and where it bends, gaps are wrong.")
    if not layout.is_flat:
        steps[-1] = (
            "Tape the paper along the ground so that it lies on it everywhere: distances between "
            "the boxes are measured along the surface. Slopes are printed above the boxes where "
            "they change, in degrees, positive downhill: check them as well as the gaps."
        )
    empty = "the crossed boxes" if late else "a few boxes"
    steps.append(
        f"Stand a domino on every box, its faces along the lines. Leave {empty} empty and fill "
        "them last: a domino that falls early then topples only some of the others."
    )
    if designed is not None and designed < layout.count:
        steps[-1] += (
            f" The grey boxes, {designed + 1} to {layout.count}, are the run-out, whose gaps are "
            "fixed."
        )
    start, push = "Push domino 1 at its top", ""
    if physics is not None:
        if physics.is_released(layout):
            start, push = "Tip domino 1 slowly until it falls by itself", "Tipped like this, with"
        else:
            top = f"{physics.push * float(layout.height[0]):.2f} m/s at the top edge"
            push = f"With a push of {physics.push:.3g} rad/s ({top}) and"
    steps.append(f"{start}; the wave runs to higher numbers.")
    if physics is not None:
        wave = simulate(layout, physics)
        steps.append(
            f"{push} a friction of {physics.friction:g} between the dominoes, the last domino is "
            f"hit after {wave.arrival_times[-1]:.3f} s in the model; most published rows differ "
            "from it by less than 20 %; one that was timed by hand took 46 % less."
            if wave.mean_speed > 0.0
            else f"In the model the wave stops: {wave.explanation}"
        )
    return steps


@contextmanager
def _page(pages: Any, paper: str, title: str, subtitle: str) -> Iterator[Axes]:
    """Yield axes of a page in millimetres, with its title, and add the page when they are drawn."""
    wide, high = PAPERS[paper]
    figure = Figure(figsize=(wide / INCH, high / INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, wide * MM), ylim=(0.0, high * MM))
    axes.set_axis_off()
    left, top = MARGIN * MM, high * MM
    text = escape_dollars(title)
    axes.text(left, top - 14.0, text, va="center", size=13, weight="bold", color=INK)
    text = "\n".join(wrap(subtitle, SUBTITLE))
    axes.text(left, top - 18.0, text, va="top", size=9, color=SOFT)
    yield axes
    pages.savefig(figure)


def _write_advice(axes: Axes, steps: Sequence[str]) -> None:
    """Write the steps of building the layout."""
    left, y = MARGIN * MM, axes.get_ylim()[1] - 32.0
    axes.text(left, y, "How to build it", size=11, color=INK, weight="bold")
    for number, step in enumerate(steps, 1):
        y -= 9.0
        lines = wrap(f"{number}  {step}", 110, subsequent_indent="    ")
        axes.text(left, y, "\n".join(lines), size=9.5, color=INK, va="top", linespacing=1.35)
        y -= 4.9 * (len(lines) - 1)


def _draw_one_strip(
    axes: Axes, layout: Layout, strip: Strip, total: int, designed: int, late: Set[int]
) -> None:
    """Draw a strip: its edges, its dominoes, and the lines that join it to its neighbours.

    total: number of strips. designed: number of dominoes before the run-out. late: dominoes that
    are left out until the end.
    """
    middle, half = strip.middle * MM, 0.5 * layout.width * MM
    positions, left = positions_along(layout), strip.margin * MM
    right = left + (strip.end - strip.begin) * MM
    edge, labels = half + BESIDE * MM, [f"{tilt:+.1f}" for tilt in np.degrees(layout.tilt)]
    axes.plot([left, right], [middle, middle], color="0.6", lw=LINE, ls="-.")
    axes.hlines((middle - edge, middle + edge), 0.0, right + left, color="0.7", lw=LINE)
    for i in strip.dominoes:
        d = layout.thickness[i] * MM
        x = left + (positions[i] - strip.begin) * MM - d
        colour = "none" if i < designed else "0.85"
        box = Rectangle((x, middle - half), d, 2.0 * half, fc=colour, lw=LINE, ec="black")
        axes.add_patch(box)
        if i in late:
            ends = [middle - half, middle + half]
            axes.plot([x, x + d], ends, [x, x + d], ends[::-1], color="0.5", lw=LINE)
        # on both strips if the domino is on two; at two heights, as gaps may be narrow
        label, y = np.clip(x + d / 2.0, left + NUMBER, right - NUMBER), 3.0 if i % 2 == 0 else 7.0
        axes.text(label, middle - half - y, str(i + 1), ha="center", va="center", fontsize=6)
        is_new = i == strip.dominoes[0] or labels[i] != labels[i - 1]
        if not layout.is_flat and is_new and left <= x + d / 2.0 < right:
            y = middle + half + (2.0 if i % 2 == 0 else 4.5)
            axes.text(x + d / 2.0, y, labels[i], ha="center", va="center", fontsize=5)
    y = middle + edge - 4.0
    axes.text(0.5 * (left + right), y, f"strip {strip.number}", ha="center", va="center", size=7)
    for x, neighbour, align in (left, strip.number - 1, "left"), (right, strip.number + 1, "right"):
        if 1 <= neighbour <= total:
            axes.vlines(x, middle - edge, middle + edge, color="black", lw=LINE, ls="--")
            axes.text(x, y, f"  joins strip {neighbour}  ", ha=align, va="center", size=7)


def _draw_bar(axes: Axes) -> None:
    """Draw the scale bar, with a tick for each centimetre."""
    ticks, y = MARGIN * MM + np.linspace(0.0, BAR * MM, 11), 14.0
    axes.hlines(y, ticks[0], ticks[-1], color="black", lw=0.8)
    axes.vlines(ticks, y, y + 3.0, color="black", lw=LINE)
    text = f"{BAR * MM:.0f} mm: if not, print at 100 %, not fitted to the page"
    axes.text(ticks[-1] + 3.0, y, text, va="center", size=7)
