"""Differential evolution (Storn, Price 1997): a population that moves along its own differences.

References
----------
Storn, R., Price, K. (1997). Differential evolution: a simple and efficient heuristic for global
optimization over continuous spaces. Journal of Global Optimization 11, 341-359.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import differential_evolution

from optimize.evaluator import Budget
from optimize.variables import Floats

MEMBERS_A_VARIABLE, MOST_MEMBERS = 3, 256


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Evolve one population after the other until the budget is spent.

    Each has the uniform row in it.
    """
    problem = budget.problem
    n = problem.dimension
    mark = problem.design(problem.scene.uniform().layout)
    members = min(max(16, MEMBERS_A_VARIABLE * n), MOST_MEMBERS)

    def costs(columns: Floats) -> Floats:
        return -budget.scores(columns.T)

    while True:
        # around the mark near and far: from all over the box most rows would be poor
        spread = 10.0 ** rng.uniform(-2.0, 0.0, (members, 1))
        first = problem.project(np.clip(mark + spread * rng.uniform(-1, 1, (members, n)), 0, 1))
        first[0] = mark
        differential_evolution(
            costs,
            [(0.0, 1.0)] * n,
            init=first,
            strategy="currenttobest1bin",
            mutation=(0.4, 0.9),
            recombination=0.9,
            maxiter=10**9,
            tol=1e-6,
            polish=False,
            updating="deferred",
            vectorized=True,
            rng=rng,
        )
