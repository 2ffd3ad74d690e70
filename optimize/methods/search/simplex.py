"""Nelder–Mead (1965) with the step sizes of Gao and Han (2012) for several variables.

A simplex of more than some forty corners gets nowhere: long rows are searched as schedules.

References
----------
Nelder, J. A., Mead, R. (1965). A simplex method for function minimization. The Computer Journal 7,
308-313.

Gao, F., Han, L. (2012). Implementing the Nelder-Mead simplex algorithm with adaptive parameters.
Computational Optimization and Applications 51, 259-277.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from optimize.evaluator import Budget
from optimize.methods.search.few_variables import FewVariables
from optimize.methods.starts import starts

MOST = 40
SIZE = 0.1  # of the first simplex, as a part of the box


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Move one simplex after the other until the budget is spent."""
    few = FewVariables(budget, MOST)
    for start in starts(budget, rng):
        x = few.nearest(start)
        inwards = np.where(x < 0.5, SIZE, -SIZE)
        corners = np.concatenate([x[None], x + np.diag(inwards)])
        minimize(
            few.cost,
            x,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * few.dimension,
            options={
                "initial_simplex": corners,
                "adaptive": few.dimension > 1,
                "maxiter": 10**9,
                "maxfev": 10**9,
                "xatol": 1e-6,
                "fatol": 1e-8,
            },
        )
