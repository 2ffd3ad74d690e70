"""L-BFGS-B (Byrd et al. 1995) on exact gradients, from one start after the other.

References
----------
Byrd, R. H., Lu, P., Nocedal, J., Zhu, C. (1995). A limited memory algorithm for bound constrained
optimization. SIAM Journal on Scientific Computing 16, 1190-1208.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.optimize import minimize

from optimize.evaluator import Budget
from optimize.methods.starts import cost, starts
from optimize.variables import Floats


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Descend from one start after the other until the budget is spent."""
    for start in starts(budget, rng):
        descend(budget, start)


def descend(budget: Budget, start: Floats) -> None:
    """Follow the gradient from one design (n,) to where it ends."""
    minimize(
        partial(cost, budget),
        start,
        jac=True,
        method="L-BFGS-B",
        bounds=[(0.0, 1.0)] * len(start),
        options={"maxiter": 1000, "ftol": 1e-10, "gtol": 1e-7},
    )
