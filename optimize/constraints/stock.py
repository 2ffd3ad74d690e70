"""Assignment of the dominoes of a stock to the places of a layout.

`assign` solves it for any costs as a linear programme, whose vertices are whole numbers, or, if the
number of changes is limited, as an integer programme, through cvxpy and HiGHS. `nearest_from_stock`
solves the special case of squared distances by an assignment of SciPy and by sorting: the thinnest
target gets the thinnest chosen domino.
"""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Floats, Ints
from domino_env.scenes.rules import Stock


def assign(costs: Floats, count: Ints, current: Ints, changes: int) -> Ints:
    """Choose a kind of domino for each place so that the sum of costs is smallest.

    Parameters
    ----------
    costs
        (n, kinds) cost of each kind at each place.
    count
        (kinds,) number of dominoes of each kind, n or more in all.
    current
        (n,) index of the present kind at each place.
    changes
        Largest number of places that change.

    Returns
    -------
    ndarray
        (n,) index of the kind for each place.

    Raises
    ------
    RuntimeError
        If the solver fails.
    """
    import cvxpy as cp

    places, kinds = costs.shape
    is_limited = changes < places  # otherwise the vertices are whole numbers by themselves
    choice = cp.Variable((places, kinds), boolean=is_limited)
    rules = [cp.sum(choice, axis=1) == 1.0, cp.sum(choice, axis=0) <= count, choice >= 0.0]
    if is_limited:
        rules.append(cp.sum(cp.multiply(np.eye(kinds)[current], choice)) >= places - changes)
    scaled_costs = (costs - costs.min()) / (float(np.ptp(costs)) or 1.0)
    programme = cp.Problem(cp.Minimize(cp.sum(cp.multiply(scaled_costs, choice))), rules)
    programme.solve(solver=cp.HIGHS)
    if choice.value is None:
        raise RuntimeError(f"no assignment was found ({programme.status}): try another method")
    return np.asarray(np.argmax(choice.value, axis=1))


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
