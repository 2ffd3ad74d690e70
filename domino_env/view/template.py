"""Template: the footprints of a layout at 1:1 on paper, to lay under the dominoes."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from domino_env.core.checks import require_choice
from domino_env.core.colours import INK, SOFT
from domino_env.core.files import write_bytes
from domino_env.core.plot_style import escaped
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import simulate
from domino_env.view.ground import places_along

PAPERS = {"a4": (0.297, 0.210), "letter": (0.2794, 0.2159)}  # [m] landscape
MOST_SHEETS = 1_000  # of a layout some hundred metres long
MARGIN = 0.014  # [m] that stays white
LEAST_MARGIN = 0.006  # [m] that printers need, where that saves a sheet
LEAD = 0.010  # [m] of paper before the first domino and after the last
HEAD, FOOT = 0.024, 0.026  # [m] for the title, for the scale bar
BESIDE = 0.013  # [m] of a strip on both sides of the dominoes, for their numbers
BAR = 0.100  # [m] length of the scale bar
MOST_GAPS = 240  # in the list on the page of advice
INCH, MM = 0.0254, 1000.0
LINE = 0.4  # [pt]


@dataclass(frozen=True)
class Strip:
    """Part of the layout on a strip of paper, which is cut out and joined to the one before.

    Attributes
    ----------
    number
        Number of the strip, from 1.
    total
        Number of all strips.
    sheet
        Number of its sheet of paper, from 1.
    middle
        Height of its middle on the sheet [m].
    begin
        Place of its left end along the ground [m], from the first pivot.
    end
        Place of its right end [m]; neighbours share an end, which is a joining line on both.
    dominoes
        Indices of the dominoes whose footprint touches it; on paper they are numbered from 1.
    margin
        Width of the white margin on its left and right [m].
    """

    number: int
    total: int
    sheet: int
    middle: float
    begin: float
    end: float
    dominoes: tuple[int, ...]
    margin: float


def strips(layout: Layout, paper: str = "a4") -> list[Strip]:
    """Cut a layout into strips, as many on a sheet of paper as fit.

    The margins are narrower where that saves a sheet.

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
        For an unknown paper, for dominoes wider than the paper, and for more than 1 000 sheets.
    """
    require_choice("paper", paper, PAPERS)
    wide, high = PAPERS[paper]
    across = layout.width + 2.0 * BESIDE
    on_a_sheet = int((high - HEAD - FOOT) / across)
    if on_a_sheet < 1:
        raise ValueError(f"width = {layout.width} m: the dominoes are wider than {paper} paper")
    front = places_along(layout)
    rear = front - layout.thickness
    begin = float(rear[0]) - LEAD
    whole = float(front[-1]) + LEAD - begin
    margin, total = MARGIN, _strip_count(whole, wide - 2.0 * MARGIN)
    papers = -(-total // on_a_sheet)
    fewer = (papers - 1) * on_a_sheet
    if fewer and whole <= fewer * (wide - 2.0 * LEAST_MARGIN):
        papers, total = papers - 1, fewer
        margin = 0.5 * (wide - whole / fewer)
    stretch = wide - 2.0 * margin
    if papers > MOST_SHEETS:
        raise ValueError(
            f"a layout of {layout.length:.6g} m takes {papers:,} sheets of paper: at most "
            f"{MOST_SHEETS:,} are drawn; check that its sizes are in metres"
        )
    strips = []
    for k in range(total):
        low, high_end = begin + k * stretch, begin + (k + 1) * stretch
        inside = np.flatnonzero((front > low) & (rear < high_end))
        sheet, place = divmod(k, on_a_sheet)
        middle = high - HEAD - (place + 0.5) * across
        dominoes = tuple(int(i) for i in inside)
        strips.append(Strip(k + 1, total, sheet + 1, middle, low, high_end, dominoes, margin))
    return strips


def _strip_count(length: float, stretch: float) -> int:
    return int(np.ceil(length / stretch - 1e-9))


def write_template(
    layout: Layout,
    path: Path,
    paper: str = "a4",
    title: str = "Template",
    physics: Physics | None = None,
) -> str:
    """Write a PDF: a page of advice, then the sheets.

    Parameters
    ----------
    layout
        The layout.
    path
        Output file.
    paper
        "a4" or "letter".
    title
        Title of every page.
    physics
        Physics of the push and the expected time that are printed; None for neither.

    Returns
    -------
    str
        Amount of paper, and the first thing to do.

    Raises
    ------
    ValueError
        As of `strips`.
    """
    plan = strips(layout, paper)
    total = plan[-1].sheet
    buffer = io.BytesIO()
    # uncompressed and without a date: equal layouts give equal files with lengths one can check
    with (
        rc_context({"pdf.compression": 0, "pdf.fonttype": 42}),
        PdfPages(buffer, metadata={"CreationDate": None, "Title": title}) as pages,
    ):
        with _page(pages, paper, title, repr(layout)[len("Layout(") : -1]) as axes:
            _advise(axes, layout, plan, physics)
        for number in range(1, total + 1):
            with _page(pages, paper, title, f"sheet {number} of {total}") as axes:
                for strip in plan:
                    if strip.sheet == number:
                        _draw(axes, layout, strip)
                _draw_bar(axes)
    write_bytes(path, lambda file: file.write(buffer.getvalue()))
    sheets = "one sheet" if total == 1 else f"{total} sheets"
    strip_count = "one strip" if len(plan) == 1 else f"{len(plan)} strips"
    return (
        f"a page of advice and {sheets} with {strip_count}: print at 100 % and check the scale bar"
    )


def _advice(plan: Sequence[Strip], layout: Layout, physics: Physics | None) -> list[str]:
    """Return the steps of building the layout with the strips."""
    steps = ["Print at 100 %, not fitted to the page, and check the scale bar with a ruler."]
    if len(plan) > 1:
        steps.append(
            "Cut the strips out along the thin lines. Cut the left end of each along its dashed "
            "line, and lay it on the dashed line at the right end of the strip before, so that "
            "the circles meet."
        )
    tape = "Tape the paper down flat: where it bends, gaps are wrong, and it must not slip."
    stand = "Stand a domino upright on every box, its faces along the lines."
    if not layout.is_flat:
        tape = (
            "Tape the paper along the ground so that it lies on it everywhere: the boxes are "
            "apart as measured along the surface. Slopes are printed above the boxes where they "
            "change, in degrees, positive downhill: check them as well as the gaps."
        )
        stand = "Stand a domino on every box, flat on the ground, its faces along the lines."
    return [
        *steps,
        tape,
        f"{stand} Leave a few places empty and fill them last: a domino that falls early then "
        "topples only some of the others.",
        "Push domino 1 at its top; the wave runs along the arrows.",
        *([] if physics is None else [_expectation(layout, physics)]),
    ]


def _expectation(layout: Layout, physics: Physics) -> str:
    """Return the push and the time of the wave, in a sentence."""
    wave, top = simulate(layout, physics), physics.push * float(layout.height[0])
    push = f"With a push of {physics.push:.3g} rad/s ({top:.2f} m/s at the top edge)"
    given = f"at a friction of {physics.friction:g} between the dominoes"
    if wave.mean_speed == 0.0:
        return f"{push} {given} the model expects that the wave stops: {wave.explanation}"
    return (
        f"{push} the last domino is hit after {wave.arrival_times[-1]:.3f} s {given} in the model; "
        "published measurements differ from it by some 10 %."
    )


@contextmanager
def _page(pages: Any, paper: str, title: str, subtitle: str) -> Iterator[Axes]:
    """Yield axes of a sheet of paper in millimetres, with its title."""
    wide, high = PAPERS[paper]
    figure = Figure(figsize=(wide / INCH, high / INCH))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, wide * MM), ylim=(0.0, high * MM))
    axes.set_axis_off()
    left, top = MARGIN * MM, high * MM
    axes.text(left, top - 14.0, escaped(title), va="center", size=13, weight="bold", color=INK)
    right = (wide - MARGIN) * MM
    axes.text(right, top - 14.0, subtitle, va="center", ha="right", size=9, color=SOFT)
    yield axes
    pages.savefig(figure)


def _advise(axes: Axes, layout: Layout, plan: Sequence[Strip], physics: Physics | None) -> None:
    """Write the steps on the left, and the gaps of a layout that is not too long on the right."""
    left, top = MARGIN * MM, axes.get_ylim()[1] - 32.0
    axes.text(left, top, "How to build it", size=11, color=INK, weight="bold")
    y = top - 9.0
    for number, step in enumerate(_advice(plan, layout, physics), 1):
        lines = wrap(step, 68)
        axes.text(left, y, f"{number}", size=9.5, color=SOFT, va="top")
        axes.text(left + 6.0, y, "\n".join(lines), size=9.5, color=INK, va="top", linespacing=1.35)
        y -= 4.9 * len(lines) + 3.0
    if not 1 < layout.count <= MOST_GAPS + 1:
        return
    x = 0.52 * axes.get_xlim()[1]
    heading, columns, wide = "Gap in front of each domino [mm]", 6, 23.0
    lines = [f"{i:3d} {1e3 * gap:6.2f}" for i, gap in enumerate(layout.spacing, 1)]
    if not layout.is_flat:
        heading, columns, wide = f"{heading}, slope under it [°]", 5, 29.0
        gaps = [*(f"{1e3 * gap:6.2f}" for gap in layout.spacing), " " * 6]
        both = enumerate(zip(gaps, _slope_labels(layout), strict=True), 1)
        lines = [f"{i:3d} {gap} {slope}" for i, (gap, slope) in both]
    down = max(40, -(-len(lines) // columns))
    axes.text(x, top, heading, size=11, color=INK, weight="bold")
    for k in range(0, len(lines), down):
        text = "\n".join(lines[k : k + down])
        axes.text(x, top - 9.0, text, size=8, color=INK, va="top", family="monospace")
        x += wide


def _draw(axes: Axes, layout: Layout, strip: Strip) -> None:
    """Draw a strip: its edges, its dominoes, and the lines that join it to its neighbours."""
    middle, half = strip.middle * MM, 0.5 * layout.width * MM
    places, left = places_along(layout), strip.margin * MM
    right = left + (strip.end - strip.begin) * MM
    edge, labels = half + BESIDE * MM, _slope_labels(layout)
    axes.plot([left, right], [middle, middle], color="0.6", lw=LINE, dashes=(8, 3, 1, 3))
    for y in (middle - edge, middle + edge):
        axes.plot([0.0, right + left], [y, y], color="0.7", lw=LINE)
    window = Rectangle((0.0, 0.0), right + left, axes.get_ylim()[1], transform=axes.transData)
    for i in strip.dominoes:
        thick = layout.thickness[i] * MM
        x = left + (places[i] - strip.begin) * MM - thick
        box = Rectangle((x, middle - half), thick, 2.0 * half, fill=False, lw=LINE, ec="black")
        axes.add_patch(box)
        box.set_clip_path(window)
        if left <= x + thick / 2.0 < right:
            # numbers stand at two heights, as narrow gaps leave no room side by side
            y = middle - half - (3.0 if i % 2 == 0 else 7.0)
            axes.text(x + thick / 2.0, y, str(i + 1), ha="center", va="center", fontsize=6)
            if not layout.is_flat and (i == strip.dominoes[0] or labels[i] != labels[i - 1]):
                y = middle + half + (2.0 if i % 2 == 0 else 4.5)
                axes.text(x + thick / 2.0, y, labels[i], ha="center", va="center", fontsize=5)
    for x, neighbour in (left, strip.number - 1), (right, strip.number + 1):
        if not 1 <= neighbour <= strip.total:
            continue
        axes.plot([x, x], [middle - edge, middle + edge], color="black", lw=LINE, dashes=(12, 8))
        for y in (middle - edge + 4.0, middle + edge - 4.0):
            axes.plot(x, y, marker="o", ms=6, mfc="none", mec="black", mew=LINE)
        side, shift = ("left", 4.0) if x == left else ("right", -4.0)
        word = f"joins strip {neighbour}"
        axes.text(x + shift, middle + edge - 4.0, word, ha=side, va="center", fontsize=7)
    at, y = 0.5 * (left + right), middle + edge - 4.0
    axes.text(at, y, f"strip {strip.number}", ha="right", va="center", fontsize=7)
    axes.annotate("", (at + 24.0, y), (at + 4.0, y), arrowprops={"arrowstyle": "->", "lw": 0.8})


def _slope_labels(layout: Layout) -> list[str]:
    """Return the slope of the ground under each domino [°] in words, positive downhill."""
    return [f"{slope:+5.1f}" for slope in np.degrees(layout.tilt)]


def _draw_bar(axes: Axes) -> None:
    left, y = MARGIN * MM, 14.0
    axes.plot([left, left + BAR * MM], [y, y], color="black", lw=0.8)
    for k in range(11):
        x = left + 0.1 * k * BAR * MM
        axes.plot([x, x], [y, y + (3.0 if k % 5 == 0 else 1.5)], color="black", lw=LINE)
    axes.text(
        left + BAR * MM + 3.0, y, f"{BAR * MM:.0f} mm: if not, print at 100 %, not fitted to the "
        "page", va="center", fontsize=7,
    )  # fmt: skip
