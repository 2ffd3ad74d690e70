"""Assignment of the dominoes of a stock to the places of a layout.

`assign` solves it for any costs as a linear programme, whose vertices are whole numbers, or, if the
number of changes is limited, as an integer programme, by HiGHS in SciPy. `nearest_from_stock`
solves the special case of squared distances by an assignment and by sorting: the thinnest target
gets the thinnest chosen domino.
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
    from scipy import optimize
    from scipy.sparse import eye_array, kron

    places, kinds = costs.shape
    at_each_place = kron(eye_array(places), np.ones((1, kinds)))
    of_each_kind = kron(np.ones((1, places)), eye_array(kinds))
    rules = [
        optimize.LinearConstraint(at_each_place, 1.0, 1.0),
        optimize.LinearConstraint(of_each_kind, -np.inf, count),
    ]
    is_limited = changes < places  # otherwise the vertices are whole numbers by themselves
    if is_limited:
        unchanged = np.eye(kinds)[current].reshape(1, -1)
        rules.append(optimize.LinearConstraint(unchanged, places - changes, np.inf))
    scaled_costs = (costs - costs.min()) / (float(np.ptp(costs)) or 1.0)
    result = optimize.milp(
        scaled_costs.ravel(), constraints=rules, bounds=optimize.Bounds(0.0, 1.0),
        integrality=int(is_limited),
    )  # fmt: skip
    if result.x is None:
        raise RuntimeError(f"no assignment was found ({result.message}): try another method")
    return np.asarray(np.argmax(result.x.reshape(places, kinds), axis=1))


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
