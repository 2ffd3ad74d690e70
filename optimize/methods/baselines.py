"""Methods to compare with: layouts drawn at random from the whole box, and the uniform baseline."""

from __future__ import annotations

import numpy as np

from optimize.evaluator import Evaluator
from optimize.methods.starts import uniform_design


def random(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Evaluate layouts drawn at random, uniformly from the whole box."""
    while True:
        evaluator.evaluate(rng.random((evaluator.bulk, evaluator.problem.dimension)))


def uniform(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Evaluate the uniform baseline once, the best layout with equal gaps."""
    evaluator.evaluate(uniform_design(evaluator.problem))
