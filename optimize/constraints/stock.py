"""Assignment of the dominoes of a stock to the places of a layout.

`assign` solves it for any costs: a linear programme, whose corners are whole numbers, through cvxpy
and HiGHS. `nearest_from_stock` is the special case of squared distances, solved by sorting: the
thinnest wanted gets the thinnest taken.
"""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Floats, Ints
from domino_env.scenes.rules import Stock


def assign(costs: Floats, count: Ints, current: Ints, changes: int) -> Ints:
    """Choose the kind for each place so that the sum of costs is smallest.

    Parameters
    ----------
    costs
        (n, kinds) cost of each kind at each place.
    count
        (kinds,) number of dominoes of each kind, n or more in all.
    current, changes
        (n,) present kind at each place, and largest number of places that change.

    Returns
    -------
    ndarray
        (n,) index of the kind for each place.

    Raises
    ------
    RuntimeError
        Where the solver fails.
    """
    import cvxpy as cp

    places, kinds = costs.shape
    limited = changes < places  # else the corners are whole numbers by themselves
    taken = cp.Variable((places, kinds), boolean=limited)
    rules = [cp.sum(taken, axis=1) == 1.0, cp.sum(taken, axis=0) <= count, taken >= 0.0]
    if limited:
        rules.append(cp.sum(cp.multiply(np.eye(kinds)[current], taken)) >= places - changes)
    scaled = (costs - costs.min()) / (float(np.ptp(costs)) or 1.0)
    programme = cp.Problem(cp.Minimize(cp.sum(cp.multiply(scaled, taken))), rules)
    programme.solve(solver=cp.HIGHS)
    if taken.value is None:
        raise RuntimeError(f"the assignment was not solved: {programme.status}")
    return np.asarray(np.argmax(taken.value, axis=1))


def nearest_from_stock(wanted: Floats, stock: Stock) -> Floats:
    """Choose dominoes of the stock, nearest to the thicknesses wanted in the sum of squares.

    Parameters
    ----------
    wanted
        (B, n) thicknesses [m].
    stock
        Dominoes that are left for these places, n or more.

    Returns
    -------
    ndarray
        (B, n) thicknesses of dominoes of the stock [m].

    Notes
    -----
    The thicknesses taken are in the order of those wanted, so that only the dominoes that remain
    have to be found: a dynamic programme over the sorted stock.
    """
    dominoes = np.sort(stock.dominoes)
    order = np.argsort(wanted, axis=1, kind="stable")
    rising = np.take_along_axis(wanted, order, axis=1)
    exact = len(dominoes) == wanted.shape[1]
    taken = np.broadcast_to(dominoes, wanted.shape) if exact else _best_of_stock(rising, dominoes)
    nearest = np.empty_like(rising)
    np.put_along_axis(nearest, order, taken, axis=1)
    return nearest


def _best_of_stock(rising: Floats, dominoes: Floats) -> Floats:
    """Choose n of the m sorted dominoes, in order, nearest to rising values (B, n)."""
    batch, n = rising.shape
    spare = len(dominoes) - n
    # cost[b, omitted]: of the places so far, without `omitted` of the sorted dominoes
    cost = np.zeros((batch, spare + 1))
    skipped = np.zeros((n, batch, spare + 1), dtype=np.int64)
    for i in range(n):
        # number of dominoes omitted before this place at the least cost, at most so many
        best = np.zeros((batch, spare + 1), dtype=np.int64)
        for omitted in range(1, spare + 1):
            fewer = np.take_along_axis(cost, best[:, omitted - 1 : omitted], 1)[:, 0]
            better = cost[:, omitted] < fewer
            best[:, omitted] = np.where(better, omitted, best[:, omitted - 1])
        skipped[i] = best
        square = (dominoes[i : i + spare + 1] - rising[:, i : i + 1]) ** 2
        cost = np.take_along_axis(cost, best, axis=1) + square
    omitted = np.argmin(cost, axis=1)
    taken = np.empty((batch, n))
    for i in range(n - 1, -1, -1):
        taken[:, i] = dominoes[i + omitted]
        omitted = skipped[i, np.arange(batch), omitted]
    return taken
