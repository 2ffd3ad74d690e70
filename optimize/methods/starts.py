"""Where one descent after the other begins."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from optimize.evaluator import Budget
from optimize.variables import Floats

KICK = 0.1  # standard deviation of a perturbation, as a part of the box


def starts(budget: Budget, rng: np.random.Generator) -> Iterator[Floats]:
    """Yield the uniform row, then for ever: the best so far a random step away, or anywhere.

    The onset of a flush is a kink at which the steps of a smooth method shrink to nothing, so one
    descent is not enough.
    """
    problem = budget.problem
    yield problem.design(problem.scene.uniform().layout)
    while True:
        if rng.random() < 0.5:
            yield problem.project(rng.random(problem.dimension)[None])[0]
        else:
            kick = KICK * 10.0 ** (-rng.random()) * rng.standard_normal(problem.dimension)
            yield problem.project(np.clip(budget.best + kick, 0.0, 1.0)[None])[0]


def cost(budget: Budget, design: Floats) -> tuple[float, Floats]:
    """Evaluate what SciPy's methods make small: minus the score, with its gradient (n,)."""
    score, gradient = budget.score_and_gradient(design)
    return -score, -gradient
