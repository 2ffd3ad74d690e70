"""The baseline: the best uniform pitch of the scene, and nothing else."""

from __future__ import annotations

import numpy as np

from optimize.evaluator import Budget


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Score the best uniform layout once."""
    problem = budget.problem
    budget.score(problem.design(problem.scene.uniform().layout))
