"""Line of the ground under a layout, for all drawings."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from domino_env.core.types import Floats
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.motion import outlines

PIECES = 12  # straight pieces of the curve between two dominoes
PIECES_AHEAD = 200  # straight pieces of the ground ahead of a layout


def ground_line(
    layout: Layout, behind: float = 0.0, ahead: float = 0.0, ground: Ground | None = None
) -> Floats:
    """Return the line of the ground, x forward and z up, pivot 0 at (0, 0).

    A layout defines the ground under its dominoes only. The line is straight under each domino, a
    cubic with continuous slope between two dominoes, and straight behind the first and ahead of the
    last.

    Parameters
    ----------
    layout
        The layout.
    behind
        Horizontal length of the line behind the first domino [m].
    ahead
        Horizontal length of the line ahead of the last pivot [m].
    ground
        Ground that the line follows ahead of the layout; None for a straight line.

    Returns
    -------
    ndarray
        Points (M, 2) [m].
    """
    if layout.is_flat and ground is None:
        return np.array([[-layout.thickness[0] - behind, 0.0], [layout.length + ahead, 0.0]])
    rear, front = _bases(layout)
    descent = np.tan(layout.tilt[[0, -1]])  # slopes at both ends
    first = rear[0] - behind * np.array([1.0, -descent[0]])
    last = (front[-1] + ahead * np.array([1.0, -descent[1]]))[None]
    if ground is not None:
        x = front[-1, 0] + ahead * np.linspace(0.0, 1.0, PIECES_AHEAD + 1)[1:]
        last = np.stack([x, ground.height(x) - ground.height(0.0)], axis=-1)
    inner = np.concatenate([rear[:-1, None], _ground_curves(layout)[:, :-1]], axis=1)
    return np.concatenate([first[None], inner.reshape(-1, 2), rear[-1:], front[-1:], last])


def positions_along(layout: Layout) -> Floats:
    """Return the positions of the pivots along the ground (N,), the first at 0 [m]."""
    if layout.is_flat:
        return layout.positions
    pieces = np.diff(_ground_curves(layout), axis=1)
    between = np.hypot(pieces[..., 0], pieces[..., 1]).sum(axis=1)  # lengths along the ground
    return np.concatenate(([0.0], np.cumsum(between + layout.thickness[1:])))


def relief(layout: Layout) -> float:
    """Return the height of the highest base of a layout above the lowest [m]."""
    return 0.0 if layout.is_flat else float(np.ptp(np.concatenate(_bases(layout))[:, 1]))


def _bases(layout: Layout) -> tuple[Floats, Floats]:
    """Return rear and front bottom edges (N, 2) of the standing dominoes [m]."""
    corners = outlines(layout, layout.tilt)
    return corners[:, 3], corners[:, 0]


def _ground_curves(layout: Layout) -> Floats:
    """Return the ground from each front edge to the next rear one, (N-1, PIECES + 1, 2) [m]."""
    rear, front = _bases(layout)
    ends = np.stack([front[:-1], rear[1:]])
    direction = np.stack([np.cos(layout.tilt), -np.sin(layout.tilt)], axis=-1)
    span = np.linalg.norm(ends[1] - ends[0], axis=-1, keepdims=True)
    tangents = span * np.stack([direction[:-1], direction[1:]])
    curves = CubicHermiteSpline([0.0, 1.0], ends, tangents)(np.linspace(0.0, 1.0, PIECES + 1))
    return np.asarray(np.moveaxis(curves, 0, 1))
