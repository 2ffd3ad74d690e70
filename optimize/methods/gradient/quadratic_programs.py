"""SLSQP (Kraft 1988) on exact gradients: a quadratic program a step, from many starts.

Where the scene asks for a length, it is a constraint of the program. Each step costs the cube of
the number of variables.

References
----------
Kraft, D. (1988). A software package for sequential quadratic programming. DFVLR-FB 88-28, Cologne.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.optimize import LinearConstraint, minimize

from optimize.evaluator import Budget
from optimize.methods.starts import cost, starts


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Descend from one start after the other until the budget is spent."""
    constraints = []
    if budget.problem.equality is not None:
        row, total = budget.problem.equality
        size = np.abs(row).max()
        constraints = [LinearConstraint(row[None] / size, total / size, total / size)]
    if budget.problem.linear is not None:
        rows, most = budget.problem.linear
        size = np.abs(rows).max()
        constraints.append(LinearConstraint(rows / size, -np.inf, most / size))
    for start in starts(budget, rng):
        minimize(
            partial(cost, budget),
            start,
            jac=True,
            method="SLSQP",
            bounds=[(0.0, 1.0)] * len(start),
            constraints=constraints,
            options={"maxiter": 1000, "ftol": 1e-10},
        )
