"""DIRECT (Jones et al. 1993; biased to the local, Gablonsky 2001): the box in ever finer thirds.

Rows of many places are searched as schedules; when a box is divided finely enough, a smaller one
around the best so far is next.

References
----------
Jones, D. R., Perttunen, C. D., Stuckman, B. E. (1993). Lipschitzian optimization without the
Lipschitz constant. Journal of Optimization Theory and Applications 79, 157-181.

Gablonsky, J. M., Kelley, C. T. (2001). A locally-biased form of the DIRECT algorithm. Journal of
Global Optimization 21, 27-37.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import Bounds, direct

from optimize.evaluator import Budget
from optimize.methods.search.few_variables import FewVariables

MOST = 24
LOOKS = 100  # a variable and box


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Divide one box after the other until the budget is spent."""
    few = FewVariables(budget, MOST)
    problem = budget.problem
    budget.score(problem.design(problem.scene.uniform().layout))
    radius = 1.0
    while True:
        centre = few.nearest(budget.best)
        if radius < 1e-6:
            radius = 1.0
        # the middle of each box is looked at first: shifted at random, no two are the same
        centre = np.clip(centre + 0.1 * radius * rng.uniform(-1, 1, len(centre)), 0.0, 1.0)
        low, high = np.maximum(centre - radius, 0.0), np.minimum(centre + radius, 1.0)
        direct(
            few.cost,
            Bounds(low, high),
            maxfun=LOOKS * few.dimension,
            maxiter=10**6,
            locally_biased=True,
            vol_tol=0.0,
            len_tol=1e-6,
        )
        radius *= 0.5
