"""Strip with a slot for each domino, for a laser cutter, and safety gaps."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from domino_env.core.checks import require
from domino_env.physics.layout import Layout
from domino_env.view.ground import positions_along

MM = 1000.0  # [mm/m]
LEAD = 10.0  # [mm] of a strip before the first domino and after the last
BESIDE = 13.0  # [mm] of a strip on each side of the dominoes
BETWEEN = 5.0  # [mm] between two pieces
WEB = 0.5  # [mm] least material between two slots
LATE = 3  # dominoes of a safety gap
CUT = 'fill="none" stroke="#f00" stroke-width="0.1"'
ENGRAVED = 'fill="#00f" font-family="sans-serif"'


def safety_gaps(layout: Layout, every: float) -> set[int]:
    """Return the indices of dominoes that are left out until the end.

    Parameters
    ----------
    layout
        The layout.
    every
        Length of the row between two safety gaps [mm], each of three dominoes; 0 for none.

    Returns
    -------
    set of int
        Indices of the dominoes.
    """
    require("safety", every, low=0.0, unit="mm")
    front, left = MM * positions_along(layout), set[int]()
    first, after = 1, every
    while every > 0.0 and first + LATE < layout.count:
        if front[first] >= after:
            left.update(range(first, first + LATE))
            after = front[first + LATE] + every
        first += 1
    return left


def strip_svg(
    layout: Layout, tolerance: float = 0.3, piece: float = 300.0, safety: float = 0.0
) -> str:
    """Return the outline of a strip with a slot for each domino as an SVG file.

    Parameters
    ----------
    layout
        The layout.
    tolerance
        Amount by which slots are longer and wider than a domino [mm].
    piece
        Largest length of a piece [mm].
    safety
        Length between safety gaps [mm], whose dominoes have their numbers in brackets; 0 for none.

    Returns
    -------
    str
        The file, in millimetres, as the page writes it: red lines are cut, blue texts engraved.

    Raises
    ------
    ValueError
        If too little material remains between two slots, and for pieces that are too short.
    """
    require("tolerance", tolerance, low=0.0, unit="mm")
    front = MM * positions_along(layout)
    rear = front - MM * layout.thickness
    gaps = rear[1:] - front[:-1]
    if (narrow := np.flatnonzero(gaps - tolerance < WEB)).size:
        raise ValueError(
            f"gap {narrow[0] + 1} is {gaps[narrow[0]]:.2f} mm wide: with slots {tolerance:g} mm "
            f"larger than the dominoes, {WEB} mm of material have to remain; give a smaller "
            "tolerance or a wider gap"
        )
    middles, end = 0.5 * (front[:-1] + rear[1:]), front[-1] + LEAD
    cuts = [rear[0] - LEAD]
    while end - cuts[-1] > piece:
        fitting = middles[(middles <= cuts[-1] + piece) & (middles > cuts[-1])]
        if not fitting.size:
            least = math.ceil(np.diff([cuts[0], *middles, end]).max())
            raise ValueError(
                f"pieces of {piece:g} mm: give at least {least} mm, a domino with the gaps beside "
                "it"
            )
        cuts.append(fitting[-1])
    cuts.append(end)
    late, width = safety_gaps(layout, safety), MM * layout.width
    high, last, parts = width + 2.0 * BESIDE, layout.count - 1, list[str]()
    for k, (begin, stop) in enumerate(pairwise(cuts)):
        y = k * (high + BETWEEN)
        parts.append(_box(0.0, y, stop - begin, high, "piece"))
        parts.append(_text(2.0, y + 4.0, f"{k + 1}/{len(cuts) - 1}", ENGRAVED))
        for i in np.flatnonzero((front > begin) & (front < stop)).tolist():
            label = str(i + 1) if (i + 1) % 10 == 0 or i == last else ""
            label = "→ 1" if i == 0 else f"({i + 1})" if i in late else label
            long, edge = front[i] - rear[i] + tolerance, 0.5 * tolerance
            x = rear[i] - edge - begin
            parts.append(_box(x, y + BESIDE - edge, long, width + tolerance, "slot"))
            if label:
                x, style = 0.5 * (rear[i] + front[i]) - begin, f'{ENGRAVED} text-anchor="middle"'
                parts.append(_text(x, y + high - 4.0, label, style))
    wide = _number(max(np.diff(cuts)))
    total = _number(len(cuts) * (high + BETWEEN) - high - 2.0 * BETWEEN)
    size = f'width="{wide}mm" height="{total}mm" viewBox="0 0 {wide} {total}"'
    content = "\n".join(parts)
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n{content}\n</svg>\n'


def _number(value: float) -> str:
    return f"{round(value, 4) + 0.0:.4f}".rstrip("0").rstrip(".")  # + 0: no negative zero


def _box(x: float, y: float, wide: float, high: float, kind: str) -> str:
    place = f'x="{_number(x)}" y="{_number(y)}"'
    size = f'width="{_number(wide)}" height="{_number(high)}"'
    return f'<rect {place} {size} {CUT} class="{kind}"/>'


def _text(x: float, y: float, words: str, style: str) -> str:
    return f'<text x="{_number(x)}" y="{_number(y)}" font-size="3" {style}>{words}</text>'
