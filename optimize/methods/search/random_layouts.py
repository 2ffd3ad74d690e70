"""The floor: layouts drawn at random, evenly from the whole box."""

from __future__ import annotations

import numpy as np

from optimize.evaluator import Budget


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Draw and score until the budget is spent."""
    while True:
        budget.scores(rng.random((budget.bulk, budget.problem.dimension)))
