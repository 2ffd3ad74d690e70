"""Projection onto bounds and a given sum."""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Floats


def nearest_with_sum(values: Floats, low: Floats, high: Floats, total: float) -> Floats:
    """Find the point of {low ≤ x ≤ high, Σ x = total} nearest to each of `values`.

    Parameters
    ----------
    values
        (B, n) points.
    low, high
        (n,) bounds, low < high.
    total
        Between Σ low and Σ high; beyond them the corner low or high is returned.

    Returns
    -------
    ndarray
        (B, n) nearest points.

    Notes
    -----
    The projection shifts all entries alike and clips them. The sum is piecewise linear in the
    shift, with a corner wherever an entry meets or leaves a bound, so sorting the corners gives the
    shift exactly.
    """
    number, n = values.shape
    corners = np.concatenate([low - values, high - values], axis=1)
    order = np.argsort(corners, axis=1, kind="stable")
    corners = np.take_along_axis(corners, order, axis=1)
    movable = np.cumsum(np.where(order < n, 1.0, -1.0), axis=1)  # entries between their bounds
    rise = movable[:, :-1] * np.diff(corners, axis=1)
    sums = low.sum() + np.concatenate([np.zeros((number, 1)), np.cumsum(rise, axis=1)], axis=1)
    k = np.clip((sums <= total).sum(axis=1) - 1, 0, 2 * n - 2)
    every = np.arange(number)
    step = (total - sums[every, k]) / np.maximum(movable[every, k], 1.0)
    shift = np.clip(corners[every, k] + step, corners[:, 0], corners[:, -1])
    moved = np.clip(values + shift[:, None], low, high)
    return even_out(moved, low, high, total)


def even_out(near: Floats, low: Floats, high: Floats, total: float) -> Floats:
    """Distribute the rounding error of the sum over the entries (B, n) between their bounds."""
    free = (near > low) & (near < high)
    share = (total - near.sum(axis=1)) / np.maximum(free.sum(axis=1), 1)
    return np.asarray(np.clip(near + free * share[:, None], low, high))
