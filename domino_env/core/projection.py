"""Projections of points: onto bounds and a given sum, and onto choices of given numbers."""

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
        Required sum, from Σ low to Σ high; below this range `low` is returned, above it `high`.

    Returns
    -------
    ndarray
        (B, n) nearest points.

    Notes
    -----
    The projection adds the same shift to all entries and clips them. The sum is a piecewise linear
    function of the shift, with a breakpoint where an entry reaches or leaves a bound. The sorted
    breakpoints give the shift exactly.
    """
    number, n = values.shape
    breakpoints = np.concatenate([low - values, high - values], axis=1)
    order = np.argsort(breakpoints, axis=1, kind="stable")
    breakpoints = np.take_along_axis(breakpoints, order, axis=1)
    free = np.cumsum(np.where(order < n, 1.0, -1.0), axis=1)  # entries between their bounds
    increments = free[:, :-1] * np.diff(breakpoints, axis=1)
    zeros = np.zeros((number, 1))
    sums = low.sum() + np.concatenate([zeros, np.cumsum(increments, axis=1)], axis=1)
    k = np.clip((sums <= total).sum(axis=1) - 1, 0, 2 * n - 2)
    points = np.arange(number)
    step = (total - sums[points, k]) / np.maximum(free[points, k], 1.0)
    shift = np.clip(breakpoints[points, k] + step, breakpoints[:, 0], breakpoints[:, -1])
    return correct_sum(np.clip(values + shift[:, None], low, high), low, high, total)


def correct_sum(values: Floats, low: Floats, high: Floats, total: float) -> Floats:
    """Shift the entries of values (B, n) that lie between their bounds so that sums are `total`.

    The shifts are as small as rounding errors.
    """
    free = (values > low) & (values < high)
    correction = (total - values.sum(axis=1)) / np.maximum(free.sum(axis=1), 1)
    return np.asarray(np.clip(values + free * correction[:, None], low, high))


def nearest_choice(targets: Floats, numbers: Floats) -> Floats:
    """Choose those of some numbers that are nearest to target values by least squares.

    Parameters
    ----------
    targets
        (B, n) values.
    numbers
        (m,) numbers, n or more, each of which may be chosen once.

    Returns
    -------
    ndarray
        (B, n) chosen numbers.

    Notes
    -----
    The chosen numbers have the order of the targets. So an assignment is needed only to select the
    numbers that are left over.
    """
    from scipy.optimize import linear_sum_assignment

    numbers = np.sort(numbers)
    order = np.argsort(targets, axis=1, kind="stable")
    nearest = np.empty_like(targets)
    for b, point in enumerate(targets):
        chosen = numbers
        if len(numbers) > len(point):
            _, indices = linear_sum_assignment((point[:, None] - numbers) ** 2)
            chosen = np.sort(numbers[indices])
        nearest[b, order[b]] = chosen
    return nearest
