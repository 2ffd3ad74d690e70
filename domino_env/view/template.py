"""Template: every footprint of a row at 1:1 on paper, to lay under the dominoes."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from domino_env.chain.layout import Layout
from domino_env.support.files import write_bytes
from domino_env.support.plot_style import escaped

PAPERS = {"a4": (0.297, 0.210), "letter": (0.2794, 0.2159)}  # lying on the long side [m]
MOST_SHEETS = 1_000  # of a row 270 m long
MARGIN = 0.014  # [m] printers leave the rim white
LEAD = 0.010  # [m] of paper before the first domino and after the last
BAR = 0.100  # [m] the scale bar
INCH, MM = 0.0254, 1000.0
LINE = 0.4  # [pt]


@dataclass(frozen=True)
class Sheet:
    """One sheet of paper.

    Attributes
    ----------
    number
        From 1.
    total
        Of all sheets.
    begin
        Where the stretch of row on it begins [m], from the first rear face less a lead.
    end
        Where the stretch ends [m]; neighbours share an end, which is a joining line on both.
    dominoes
        Numbers of those whose footprint touches the stretch.
    """

    number: int
    total: int
    begin: float
    end: float
    dominoes: tuple[int, ...]


def sheets(layout: Layout, paper: str = "a4") -> list[Sheet]:
    """Cut a row into sheets of paper.

    Raises
    ------
    ValueError
        For an unknown paper, too wide a domino, or more sheets than `MOST_SHEETS`.
    """
    if paper not in PAPERS:
        raise ValueError(f"paper '{paper}': known are {', '.join(PAPERS)}")
    wide, high = PAPERS[paper]
    if layout.width > high - 2.0 * MARGIN - 0.06:
        raise ValueError(f"width = {layout.width} m: the dominoes are wider than {paper} paper")
    stretch = wide - 2.0 * MARGIN
    rear, front = layout.positions - layout.thickness, layout.positions
    begin = float(rear[0]) - LEAD
    total = int(np.ceil((float(front[-1]) + LEAD - begin) / stretch - 1e-9))
    if total > MOST_SHEETS:
        raise ValueError(
            f"a row of {layout.length:.6g} m takes {total:,} sheets of paper, where at most "
            f"{MOST_SHEETS:,} are drawn: are its sizes metres?"
        )
    found = []
    for k in range(total):
        low, high_end = begin + k * stretch, begin + (k + 1) * stretch
        inside = np.flatnonzero((front > low) & (rear < high_end))
        found.append(Sheet(k + 1, total, low, high_end, tuple(int(i) for i in inside)))
    return found


def write_template(layout: Layout, path: Path, paper: str = "a4", title: str = "") -> int:
    """Write the PDF whole, and return the number of sheets; refuses as `sheets` does."""
    plan = sheets(layout, paper)
    wide, high = PAPERS[paper]
    buffer = io.BytesIO()
    # plain, so that the same row gives the same file and a reader can check the lengths
    with (
        rc_context({"pdf.compression": 0, "pdf.fonttype": 42}),
        PdfPages(buffer, metadata={"CreationDate": None, "Title": title or "Template"}) as pages,
    ):
        for sheet in plan:
            figure = Figure(figsize=(wide / INCH, high / INCH))
            axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
            axes.set(xlim=(0.0, wide * MM), ylim=(0.0, high * MM))
            axes.set_axis_off()
            _draw(axes, layout, sheet, high * MM, title)
            pages.savefig(figure)
    write_bytes(path, lambda file: file.write(buffer.getvalue()))
    return len(plan)


def _draw(axes: Axes, layout: Layout, sheet: Sheet, high: float, title: str) -> None:
    middle, half = high / 2.0, 0.5 * layout.width * MM
    left = MARGIN * MM
    right = left + (sheet.end - sheet.begin) * MM
    axes.plot([left, right], [middle, middle], color="0.6", lw=LINE, dashes=(8, 3, 1, 3))
    window = Rectangle((0.0, 0.0), right + left, high, transform=axes.transData)
    for i in sheet.dominoes:
        thick = layout.thickness[i] * MM
        x = left + (layout.positions[i] - sheet.begin) * MM - thick
        box = Rectangle((x, middle - half), thick, 2.0 * half, fill=False, lw=LINE, ec="black")
        axes.add_patch(box)
        box.set_clip_path(window)
        if left <= x + thick / 2.0 < right:
            # numbers stand in two heights, as tight rows leave no room side by side
            y = middle - half - (3.0 if i % 2 == 0 else 7.0)
            axes.text(x + thick / 2.0, y, str(i), ha="center", va="center", fontsize=6)
    for x, there, word in (
        (left, sheet.number > 1, f"joins sheet {sheet.number - 1}"),
        (right, sheet.number < sheet.total, f"joins sheet {sheet.number + 1}"),
    ):
        if not there:
            continue
        axes.plot([x, x], [middle - 45.0, middle + 45.0], color="black", lw=LINE, dashes=(4, 3))
        for y in (middle - 35.0, middle + 35.0):
            axes.plot([x - 5.0, x + 5.0], [y, y], color="black", lw=LINE)
            axes.plot(x, y, marker="o", ms=6, mfc="none", mec="black", mew=LINE)
        side = "left" if x == left else "right"
        shift = 3.0 if x == left else -3.0
        axes.text(x + shift, middle + 41.0, word, ha=side, va="center", fontsize=7)
    axes.annotate(
        "", (left + 30.0, middle + half + 12.0), (left + 5.0, middle + half + 12.0),
        arrowprops={"arrowstyle": "->", "lw": 0.8},
    )  # fmt: skip
    axes.text(left + 32.0, middle + half + 12.0, "the wave runs this way", va="center", fontsize=7)
    bar = left, left + BAR * MM
    axes.plot(bar, [20.0, 20.0], color="black", lw=0.8)
    for k in range(11):
        x = left + 0.1 * k * BAR * MM
        axes.plot([x, x], [20.0, 23.0 if k % 5 == 0 else 21.5], color="black", lw=LINE)
    axes.text(
        bar[1] + 3.0, 20.0, f"{BAR * MM:.0f} mm: if not, print at 100 %, not fitted to the page",
        va="center", fontsize=7,
    )  # fmt: skip
    head = escaped(title)
    head += f"   sheet {sheet.number} of {sheet.total}"
    head += f"   {layout.count} dominoes, {layout.length * MM:.1f} mm first pivot to last"
    axes.text(left, high - 16.0, head.strip(), va="center", fontsize=9)


def words(plan: list[Sheet]) -> str:
    """Say what to do with the sheets."""
    if len(plan) == 1:
        return "one sheet: print at 100 % and check the scale bar"
    return (
        f"{len(plan)} sheets: print at 100 %, check the scale bar, cut along the dashed line on "
        "the left, and lay it on the dashed line of the sheet before"
    )
