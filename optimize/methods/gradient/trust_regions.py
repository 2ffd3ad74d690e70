"""trust-constr (Byrd et al. 1999): an interior point method in trust regions, on exact gradients.

References
----------
Byrd, R. H., Hribar, M. E., Nocedal, J. (1999). An interior point algorithm for large-scale
nonlinear programming. SIAM Journal on Optimization 9, 877-900.
"""

from __future__ import annotations

import warnings
from functools import partial

import numpy as np
from scipy.optimize import BFGS, SR1, Bounds, minimize

from optimize.evaluator import Budget
from optimize.methods.starts import cost, starts

MANY = 200  # variables from which on the curvature is the cheaper SR1


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Descend from one start after the other until the budget is spent."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="scipy")  # of slopes that did not change
        for start in starts(budget, rng):
            minimize(
                partial(cost, budget),
                np.clip(start, 1e-3, 1.0 - 1e-3),  # strictly inside, as the method begins
                jac=True,
                hess=BFGS() if len(start) <= MANY else SR1(),
                method="trust-constr",
                bounds=Bounds(0.0, 1.0, keep_feasible=True),
                options={
                    "maxiter": 1000,
                    "gtol": 1e-6,
                    "xtol": 1e-6,
                    "initial_tr_radius": 0.3,
                    "initial_barrier_parameter": 1e-4,
                    "initial_barrier_tolerance": 1e-4,
                },
            )
