"""Projection of thicknesses onto the dominoes of a stock."""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Floats
from domino_env.scenes.rules import Stock


def nearest_from_stock(targets: Floats, stock: Stock) -> Floats:
    """Choose the dominoes of the stock that are nearest to target thicknesses by least squares.

    Parameters
    ----------
    targets
        (B, n) thicknesses [m].
    stock
        Stock of n or more dominoes.

    Returns
    -------
    ndarray
        (B, n) thicknesses of dominoes of the stock [m].

    Notes
    -----
    The chosen thicknesses have the order of the targets. So an assignment is needed only to select
    the dominoes that are left over.
    """
    from scipy.optimize import linear_sum_assignment

    dominoes = np.sort(stock.dominoes)
    order = np.argsort(targets, axis=1, kind="stable")
    nearest = np.empty_like(targets)
    for b, point in enumerate(targets):
        chosen = dominoes
        if len(dominoes) > len(point):
            _, indices = linear_sum_assignment((point[:, None] - dominoes) ** 2)
            chosen = np.sort(dominoes[indices])
        nearest[b, order[b]] = chosen
    return nearest
