"""Budget: what a search may spend, what it has spent, and the best it has found."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from optimize.problem import Floats, Problem


class BudgetSpent(Exception):  # noqa: N818  no error: the ordinary end of a search
    """Raised into a method when its budget is used up."""


class Budget:
    """A problem with a meter: methods ask it for scores until it raises `BudgetSpent`.

    evaluations, seconds: what may be spent; None for no limit.
    best, best_score: the best design so far, None and -inf before the first.
    trace: (evaluations, falls, seconds, best score) at every improvement.
    """

    def __init__(
        self,
        problem: Problem,
        evaluations: int | None,
        seconds: float | None,
        watch: Callable[[Budget], None] | None = None,
    ) -> None:
        self.problem = problem
        self.evaluations = evaluations
        self.seconds = seconds
        self.best: Floats | None = None
        self.best_score = -np.inf
        self.trace: list[tuple[int, int, float, float]] = []
        self._watch = watch
        self._began = time.perf_counter()
        self._piece = max(8, 40_000 // problem.scene.count)

    @property
    def elapsed(self) -> float:
        """Seconds since the search began."""
        return time.perf_counter() - self._began

    @property
    def spent(self) -> bool:
        """Whether nothing is left."""
        done = self.problem.evaluations
        if self.evaluations is not None and done >= self.evaluations:
            return True
        return self.seconds is not None and self.elapsed >= self.seconds

    def score(self, designs: Floats) -> Floats:
        """Scores of designs (B, n).  Raises BudgetSpent where not all of them can be paid for.

        What can be paid for is simulated first, so that nothing of the budget is lost.
        """
        scores = np.empty(len(designs))
        at = 0
        while at < len(designs):
            if self.spent:
                raise BudgetSpent
            piece = min(self._piece, len(designs) - at)
            if self.evaluations is not None:
                piece = min(piece, self.evaluations - self.problem.evaluations)
            part = np.asarray(designs[at : at + piece], dtype=np.float64)
            scores[at : at + piece] = self.problem.score(part)
            self._note(part, scores[at : at + piece])
            at += piece
        return scores

    def score_and_gradient(self, design: Floats, step: float = 1e-5) -> tuple[float, Floats]:
        """Score and its gradient at one design, by differences in one batch.

        Central where both sides lie in the box, one-sided at its faces.
        """
        ahead = np.minimum(design + step, 1.0)
        behind = np.maximum(design - step, 0.0)
        n = len(design)
        points = np.repeat(design[None], 2 * n + 1, axis=0)
        points[np.arange(n), np.arange(n)] = ahead
        points[n + np.arange(n), np.arange(n)] = behind
        scores = self.score(points)
        gradient = (scores[:n] - scores[n : 2 * n]) / (ahead - behind)
        return float(scores[-1]), gradient

    def _note(self, designs: Floats, scores: Floats) -> None:
        i = int(np.argmax(scores))
        if scores[i] > self.best_score:
            self.best, self.best_score = designs[i].copy(), float(scores[i])
            spent = (self.problem.evaluations, self.problem.falls, self.elapsed, self.best_score)
            self.trace.append(spent)
        if self._watch is not None:
            self._watch(self)
