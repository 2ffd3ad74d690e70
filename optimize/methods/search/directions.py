"""Powell's conjugate directions (1964): one line search after the other, without slopes.

References
----------
Powell, M. J. D. (1964). An efficient method for finding the minimum of a function of several
variables without calculating derivatives. The Computer Journal 7, 155-162.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from optimize.evaluator import Budget
from optimize.methods.search.few_variables import FewVariables
from optimize.methods.starts import starts

MOST = 200  # variables; the set of directions is a matrix


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Try one set of directions after the other until the budget is spent."""
    few = FewVariables(budget, MOST)
    for start in starts(budget, rng):
        minimize(
            few.cost,
            few.nearest(start),
            method="Powell",
            bounds=[(0.0, 1.0)] * few.dimension,
            options={"maxiter": 10**9, "maxfev": 10**9, "xtol": 1e-4, "ftol": 1e-7},
        )
