"""Problems of many variables for methods that can only handle few: the knots of a schedule."""

from __future__ import annotations

import numpy as np

from optimize.evaluator import Budget
from optimize.methods.schedules import schedule
from optimize.variables import Floats


class FewVariables:
    """A budget's problem in few variables: the design itself, or the knots of a schedule.

    Parameters
    ----------
    budget
        Whose problem it is, and who pays for scores.
    most
        Most variables.

    Attributes
    ----------
    dimension
        How many there are.
    """

    def __init__(self, budget: Budget, most: int) -> None:
        self._budget = budget
        n, pairs = budget.problem.dimension, budget.problem.scene.count - 1
        self._matrix = None if n <= most else schedule(n // pairs, pairs, most)
        self.dimension = n if self._matrix is None else self._matrix.shape[1]

    def design(self, x: Floats) -> Floats:
        """Give the design (n,) that x stands for."""
        x = np.clip(x, 0.0, 1.0)
        return x if self._matrix is None else np.clip(self._matrix @ x, 0.0, 1.0)

    def nearest(self, design: Floats) -> Floats:
        """Find the x whose design is nearest to this one, within the box."""
        if self._matrix is None:
            return design
        found = np.linalg.lstsq(self._matrix, design, rcond=None)[0]
        return np.asarray(np.clip(found, 0.0, 1.0))

    def cost(self, x: Floats) -> float:
        """Evaluate what a method that minimises makes small: minus the score."""
        return -self._budget.score(self.design(x))
