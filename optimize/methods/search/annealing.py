"""Dual annealing (Xiang et al. 1997): random leaps that cool, descents after good ones.

References
----------
Xiang, Y., Sun, D. Y., Fan, W., Gong, X. G. (1997). Generalized simulated annealing algorithm and
its application to the Thomson model. Physics Letters A 233, 216-220.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import dual_annealing

from optimize.evaluator import Budget
from optimize.variables import Floats


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Anneal again and again until the budget is spent, at first from the uniform row."""
    problem = budget.problem
    bounds = [(0.0, 1.0)] * problem.dimension
    start = problem.design(problem.scene.uniform().layout)

    def cost(design: Floats) -> float:
        return -budget.score(design)

    def slope(design: Floats) -> Floats:
        return -budget.score_and_gradient(design)[1]

    while True:
        dual_annealing(
            cost,
            bounds,
            x0=start,
            maxiter=1000,
            maxfun=10**9,
            rng=rng,
            minimizer_kwargs={"method": "L-BFGS-B", "jac": slope, "bounds": bounds},
        )
        start = problem.project(rng.random(problem.dimension)[None])[0]
