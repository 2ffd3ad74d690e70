"""L-BFGS-B (Byrd, Lu, Nocedal, Zhu 1995) from the uniform row, then from perturbed best rows.

The onset of a flush is a kink at which quasi-Newton steps shrink to nothing, so one descent is not
enough: the next starts a random step away from the best so far, or anywhere.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from optimize.budget import Budget
from optimize.problem import Floats

KICK = 0.1  # standard deviation of a perturbation, as a part of the box


def run(budget: Budget, rng: np.random.Generator) -> None:
    """One descent after the other until the budget is spent."""
    problem = budget.problem
    start = problem.design(problem.scene.uniform().layout)
    while True:
        _descend(budget, start)
        if rng.random() < 0.5:
            start = rng.random(problem.dimension)
        else:
            kick = KICK * 10.0 ** (-rng.random()) * rng.standard_normal(problem.dimension)
            start = np.clip(budget.best + kick, 0.0, 1.0)


def _descend(budget: Budget, start: Floats) -> None:
    def cost(design: Floats) -> tuple[float, Floats]:
        score, gradient = budget.score_and_gradient(design)
        return -score, -gradient

    minimize(
        cost,
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, 1.0)] * len(start),
        options={"maxiter": 1000, "ftol": 1e-10, "gtol": 1e-7},
    )
