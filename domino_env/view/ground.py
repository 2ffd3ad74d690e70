"""Ground: the line under a row, for all that draws it."""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Floats
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.motion import outlines

PIECES = 12  # straight ones of the curve between two dominoes
AHEAD = 200  # and of what lies ahead of a row


def ground_line(
    layout: Layout, before: float = 0.0, after: float = 0.0, ground: Ground | None = None
) -> Floats:
    """Return the line of the ground as points (M, 2) [m], x forward and z up, pivot 0 at (0, 0).

    A row knows its ground by the bases alone: straight under each domino, a cubic that goes on
    smoothly from one base to the next, straight on before the first and behind the last unless the
    ground is told.

    Parameters
    ----------
    layout
        The row.
    before
        How far the line reaches behind the first domino, horizontally [m].
    after
        How far it reaches ahead of the last pivot, horizontally [m].
    ground
        What the row stands on, if that is known: the line ahead of the row follows it.
    """
    if layout.is_flat and ground is None:
        return np.array([[-layout.thickness[0] - before, 0.0], [layout.length + after, 0.0]])
    rear, front = _bases(layout)
    down = np.tan(layout.tilt[[0, -1]])
    first = rear[0] - before * np.array([1.0, -down[0]])
    last = (front[-1] + after * np.array([1.0, -down[1]]))[None]
    if ground is not None:
        x = front[-1, 0] + after * np.linspace(0.0, 1.0, AHEAD + 1)[1:]
        last = np.stack([x, ground.height(x) - ground.height(0.0)], axis=-1)
    between = _between(layout)
    inner = np.concatenate([rear[:-1, None], between[:, :-1]], axis=1).reshape(-1, 2)
    return np.concatenate([first[None], inner, rear[-1:], front[-1:], last])


def places_along(layout: Layout) -> Floats:
    """Return the places of the pivots measured along the ground (N,), the first at 0 [m]."""
    if layout.is_flat:
        return layout.positions
    pieces = np.diff(_between(layout), axis=1)
    gaps = np.hypot(pieces[..., 0], pieces[..., 1]).sum(axis=1)
    return np.concatenate(([0.0], np.cumsum(gaps + layout.thickness[1:])))


def relief(layout: Layout) -> float:
    """How far the highest base of a row lies above the lowest [m]."""
    if layout.is_flat:
        return 0.0
    return float(np.ptp(np.concatenate(_bases(layout))[:, 1]))


def _bases(layout: Layout) -> tuple[Floats, Floats]:
    """Rear and front bottom edges (N, 2) of a row that stands [m]."""
    corners = outlines(layout, layout.tilt)
    return corners[:, 3], corners[:, 0]


def _between(layout: Layout) -> Floats:
    """The ground from each front bottom edge to the next rear one, (N-1, PIECES + 1, 2) [m]."""
    rear, front = _bases(layout)
    begin, end = front[:-1, None], rear[1:, None]
    way = np.stack([np.cos(layout.tilt), -np.sin(layout.tilt)], axis=-1)
    span = np.linalg.norm(end - begin, axis=-1, keepdims=True)
    leave, arrive = span * way[:-1, None], span * way[1:, None]
    u = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
    v = 1.0 - u
    return np.asarray(
        begin * v * v * (1.0 + 2.0 * u)
        + end * u * u * (1.0 + 2.0 * v)
        + u * v * (leave * v - arrive * u)
    )
