"""Rows as SVG, for notebooks: small, to scale, and without Matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from domino_env.chain.layout import Layout
from domino_env.chain.wave import Wave
from domino_env.support.colours import OURS, UNIFORM

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
    long = 1e3 * max(layout.length + float(layout.thickness[0]) for layout, _, _ in rows)
    across = min(long, LONGEST * tall)
    drawn = "".join(_svg(*row, across, tall) for row in rows)
    return f'<div style="margin:.3em 0"><code>{escape(sentence)}</code>{drawn}</div>'


def _svg(layout: Layout, hit: int, colour: str, across: float, tall: float) -> str:
    """One row, in millimetres."""
    front = 1e3 * (layout.positions + layout.thickness[0])
    thick, height = 1e3 * layout.thickness, 1e3 * layout.height
    dots = ""
    if front[-1] > across:  # the two ends
        half = 0.5 * across - 0.5 * tall
        first, last = front <= half, front - thick >= front[-1] - half
        front = np.where(last, front - front[-1] + across, front)
        shown = np.flatnonzero(first | last)
        middle, size = 0.5 * across, 0.4 * tall
        dots = f'<text x="{middle:g}" y="{tall:g}" font-size="{size:g}" text-anchor="middle" '
        dots += 'fill="currentColor">…</text>'
    else:
        shown = np.arange(layout.count)
    boxes = "".join(
        f'<rect x="{front[i] - thick[i]:.3f}" y="{tall - height[i]:.3f}" width="{thick[i]:.3f}" '
        f'height="{height[i]:.3f}" fill="{colour}" opacity="{1 if i < hit else PALE}"/>'
        for i in shown
    )
    width = min(WIDEST, round(1e-3 * across * PIXELS))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {across:.2f} {tall + 1.0:.2f}" '
        f'style="display:block;width:{width}px;max-width:100%;margin:.4em 0" role="img">{boxes}'
        f'<path d="M0 {tall + 0.5:.2f}H{across:.2f}" stroke="currentColor"/>{dots}</svg>'
    )
