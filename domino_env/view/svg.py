"""Rows as SVG, for notebooks: small, to scale, and without Matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from domino_env.core.colours import OURS, UNIFORM
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.view.ground import ground_line

LONGEST = 45.0  # heights; of a longer row the two ends are shown
WIDEST = 900  # [px] on the screen
PALE = 0.3  # opacity: on white paper and on a dark screen
PIXELS = 1500.0  # a metre on the screen, where there is room


def layout_html(layout: Layout) -> str:
    """Draw a row under its sentence."""
    return rows_html(repr(layout), [(layout, layout.count, OURS)])


def wave_html(wave: Wave) -> str:
    """Draw the row of a wave under its sentence."""
    return rows_html(repr(wave), [(wave.layout, wave.hit, OURS)])


def beside_uniform_html(sentence: str, uniform: Layout, wave: Wave) -> str:
    """Draw the best uniform row, and below it the one found, to the same scale."""
    found = (wave.layout, wave.hit, OURS)
    return rows_html(sentence, [(uniform, uniform.count, UNIFORM), found])


def rows_html(sentence: str, rows: Sequence[tuple[Layout, int, str]]) -> str:
    """Draw rows under a sentence.

    Parameters
    ----------
    sentence
        Plain text.
    rows
        Layout, how many of its dominoes were struck (the others are pale), colour.
    """
    tall = 1e3 * max(float(layout.height.max()) for layout, _, _ in rows)
    long = 1e3 * max(float(layout.pivots[-1, 0] + layout.thickness[0]) for layout, _, _ in rows)
    across = min(long, LONGEST * tall)
    drawn = "".join(_svg(*row, across, tall) for row in rows)
    return f'<div style="margin:.3em 0"><code>{escape(sentence)}</code>{drawn}</div>'


def _svg(layout: Layout, hit: int, colour: str, across: float, tall: float) -> str:
    """One row, in millimetres."""
    feet, ground = 1e3 * layout.pivots[:, 1], 1e3 * ground_line(layout)
    front = 1e3 * (layout.pivots[:, 0] + layout.thickness[0])
    ground[:, 0] += front[0]
    thick, height = 1e3 * layout.thickness, 1e3 * layout.height
    parts = [ground]
    if front[-1] > across:  # the two ends
        half = 0.5 * across - 0.5 * tall
        first, last = front <= half, front - thick >= front[-1] - half
        parts = [_cut(ground, 0.0, half), _cut(ground, front[-1] - half, front[-1])]
        parts[1] += across - front[-1], parts[0][-1, 1] - parts[1][0, 1]
        feet = np.where(last, feet + parts[1][-1, 1] - ground[-1, 1], feet)
        front = np.where(last, front - front[-1] + across, front)
        shown = np.flatnonzero(first | last)
    else:
        shown = np.arange(layout.count)
    # higher ground raises the top of the picture; who leans may reach beyond its sides
    top = tall + max(float(part[:, 1].max()) for part in parts)
    depth = top - min(float(part[:, 1].min()) for part in parts)
    beside = tall * float(np.abs(np.sin(layout.tilt)).max())
    boxes = "".join(
        f'<rect x="{front[i] - thick[i]:.3f}" y="{top - feet[i] - height[i]:.3f}" '
        f'width="{thick[i]:.3f}" height="{height[i]:.3f}" fill="{colour}" '
        f'opacity="{1 if i < hit else PALE}"{_turned(layout, i, front[i], top - feet[i])}/>'
        for i in map(int, shown)
    )
    dots = ""
    if len(parts) == 2:
        middle, size, y = 0.5 * across, 0.4 * tall, top - parts[0][-1, 1]
        dots = f'<text x="{middle:g}" y="{y:g}" font-size="{size:g}" text-anchor="middle" '
        dots += 'fill="currentColor">…</text>'
    width = min(WIDEST, round(1e-3 * across * PIXELS))
    box = f"{0.0 - beside:.4g} 0 {across + 2.0 * beside:.2f} {depth + 1.0:.2f}"
    line = "".join(
        "M" + "L".join(f"{x:.2f} {top + 0.5 - z:.2f}" for x, z in part) for part in parts
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" '
        f'style="display:block;width:{width}px;max-width:100%;margin:.4em 0" role="img">{boxes}'
        f'<path d="{line}" fill="none" stroke="currentColor"/>{dots}</svg>'
    )


def _cut(line: Floats, low: float, high: float) -> Floats:
    """The part of a line between two places."""
    x, z = line.T
    inside = line[(x > low) & (x < high)]
    ends = np.array([[place, np.interp(place, x, z)] for place in (low, high)])
    return np.concatenate([ends[:1], inside, ends[1:]])


def _turned(layout: Layout, i: int, x: float, y: float) -> str:
    """How a domino stands on its slope: turned about its front bottom edge."""
    tilt = layout.tilt[i]
    return f' transform="rotate({np.degrees(tilt):.4f} {x:.3f} {y:.3f})"' if tilt else ""
