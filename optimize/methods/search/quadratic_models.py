"""COBYQA (Ragonneau 2022): quadratic models through known scores, in a trust region, no slopes.

A step costs the cube of the number of variables: longer rows are searched as schedules.

References
----------
Ragonneau, T. M. (2022). Model-based derivative-free optimization methods and software. PhD thesis,
The Hong Kong Polytechnic University.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from optimize.evaluator import Budget
from optimize.methods.search.few_variables import FewVariables
from optimize.methods.starts import starts

MOST = 45


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Search one trust region after the other until the budget is spent."""
    few = FewVariables(budget, MOST)
    for start in starts(budget, rng):
        minimize(
            few.cost,
            few.nearest(start),
            method="COBYQA",
            bounds=[(0.0, 1.0)] * few.dimension,
            options={
                "initial_tr_radius": 0.1,
                "final_tr_radius": 1e-5,
                "maxfev": 500 * (few.dimension + 1),
                "maxiter": 10**6,
            },
        )
