"""Which domino of the box goes where.

`assign` solves the assignment with any prices: a linear programme, whose corners are whole numbers,
through cvxpy and HiGHS.  `nearest_from_stock` is its special case with squared distances, solved by
sorting: the thinnest wanted gets the thinnest taken.
"""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Floats, Ints
from domino_env.scenes.rules import Stock


def assign(
    prices: Floats, count: Ints, current: Ints | None = None, changes: int | None = None
) -> Ints:
    """Choose the kind for each place that makes the sum of prices least.

    Parameters
    ----------
    prices
        (n, kinds) of each kind at each place.
    count
        (kinds,) how many there are of each, n or more in all.
    current, changes
        (n,) what stands there, and at how many places another may; None for any.

    Returns
    -------
    ndarray
        (n,) index of the kind for each place.

    Raises
    ------
    ValueError
        Where there are less than n.
    RuntimeError
        Where the solver finds no answer.
    """
    import cvxpy as cp

    places, kinds = prices.shape
    if int(np.sum(count)) < places:
        raise ValueError(f"{int(np.sum(count))} dominoes are in the box: {places} places need one")
    few = current is not None and changes is not None and changes < places
    # without a bound on the changes the corners are whole numbers by themselves
    taken = cp.Variable((places, kinds), boolean=True) if few else cp.Variable((places, kinds))
    rules = [cp.sum(taken, axis=1) == 1.0, cp.sum(taken, axis=0) <= count, taken >= 0.0]
    if few:
        assert current is not None
        assert changes is not None
        rules.append(cp.sum(cp.multiply(np.eye(kinds)[current], taken)) >= places - changes)
    scale = float(np.ptp(prices)) or 1.0
    worth = (prices - prices.min()) / scale
    programme = cp.Problem(cp.Minimize(cp.sum(cp.multiply(worth, taken))), rules)
    programme.solve(solver=cp.HIGHS)
    if taken.value is None:
        raise RuntimeError(f"the assignment was not solved: {programme.status}")
    return np.asarray(np.argmax(taken.value, axis=1))


def nearest_from_stock(wanted: Floats, stock: Stock) -> Floats:
    """Choose dominoes of the box, nearest to the thicknesses wanted in the sum of squares.

    Parameters
    ----------
    wanted
        (B, n) thicknesses [m].
    stock
        What is left for these places, n or more.

    Returns
    -------
    ndarray
        (B, n) thicknesses of dominoes of the box [m].

    Notes
    -----
    The order of what is taken follows that of what is wanted, so only which are left in the box is
    to be found: a dynamic programme over the sorted box.
    """
    box = np.sort(stock.dominoes)
    rows, n = wanted.shape
    order = np.argsort(wanted, axis=1, kind="stable")
    rising = np.take_along_axis(wanted, order, axis=1)
    exact = len(box) == n
    taken = np.broadcast_to(box, (rows, n)) if exact else _best_of_box(rising, box)
    found = np.empty_like(rising)
    np.put_along_axis(found, order, taken, axis=1)
    return found


def _best_of_box(rising: Floats, box: Floats) -> Floats:
    """The n of the m sorted dominoes, in order, nearest to rising values (B, n)."""
    rows, n = rising.shape
    spare = len(box) - n
    # cost[b, left]: of the places so far, with `left` dominoes left in the box
    cost = np.zeros((rows, spare + 1))
    skipped = np.zeros((n, rows, spare + 1), dtype=np.int64)
    for i in range(n):
        # least cost with at most that many left before this place
        at = np.zeros((rows, spare + 1), dtype=np.int64)
        for left in range(1, spare + 1):
            better = cost[:, left] < np.take_along_axis(cost, at[:, left - 1 : left], 1)[:, 0]
            at[:, left] = np.where(better, left, at[:, left - 1])
        skipped[i] = at
        price = (box[i : i + spare + 1] - rising[:, i : i + 1]) ** 2
        cost = np.take_along_axis(cost, at, axis=1) + price
    left = np.argmin(cost, axis=1)
    taken = np.empty((rows, n))
    every = np.arange(rows)
    for i in range(n - 1, -1, -1):
        taken[:, i] = box[i + left]
        left = skipped[i, every, left]
    return taken
