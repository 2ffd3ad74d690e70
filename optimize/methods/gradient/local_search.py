"""A local search for scores with kinks, which can be paused: BFGS within the box.

The onset of a face contact is a kink of the score, and good layouts lie on several of them at once.
There a line search with the strong Wolfe conditions shrinks its steps to nothing; one with those of
Armijo and weak Wolfe steps across the kink, so that the curvature represents the ridge. Variables
that the gradient holds at a face of the box are left out of the step.

References
----------
Lewis, A. S., Overton, M. L. (2013). Nonsmooth optimization via quasi-Newton methods. Mathematical
Programming 141, 135-163: algorithm 2.1 (the steps), algorithm 4.6 (their lengths).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from domino_env.core.types import Bools, Floats
from optimize.methods.gradient.lockstep import Request, Search, run_in_lockstep

if TYPE_CHECKING:
    from optimize.evaluator import Evaluator

RISE, TURN = 1e-4, 0.5  # conditions of Armijo and weak Wolfe, relative to the first slope
ANGLE = 1e-10  # least cosine between a step and the gradient, below which curvature is given up
CURVED = 1e-12  # least cosine between a step and its change of the gradient that is kept
BRACKET = 0.1  # relative width of the bracket at which a line search takes its best point
DENSE = 200  # variables up to which the whole inverse curvature is kept
MEMORY = 30  # pairs of step and change of the gradient that are kept for more variables
TRIES = 14  # evaluations of one line search
LARGEST = 0.15  # largest change of a variable in the first try of a line search, as part of the box
FIRST = LARGEST / 3.0  # the same along the gradient, where nothing is known of the curvature
WINDOW = 8  # steps over which the gain is measured
ENOUGH = 1e-7  # a smaller relative gain over them ends the search


class LocalSearch:
    """One local search from one start, driven from outside, so that many can share a batch.

    Parameters
    ----------
    start
        (n,) design vector to begin at; clipped to the box.
    project
        Maps design vectors (B, n) to the nearest that keep the rules; None where the box is the
        only rule.
    curvature
        (n,) positive guess of the inverse curvature of the score by each variable, for the first
        step; None for a short step along the gradient.

    Attributes
    ----------
    wanted
        (n,) design vector whose score and gradient are needed next.
    design, score, gradient
        Best so far; -inf and zeros before the first evaluation.
    evaluations
        Number of evaluations so far.
    done
        Nothing more can be gained.
    """

    def __init__(
        self,
        start: Floats,
        project: Callable[[Floats], Floats] | None = None,
        curvature: Floats | None = None,
    ) -> None:
        self._project = project
        self.wanted = self._feasible(start)
        self.design = self.wanted
        self.score, self.gradient = -np.inf, np.zeros(len(start))
        self.evaluations = 0
        self.done = False
        self._history: deque[float] = deque(maxlen=WINDOW + 1)
        self._guess = curvature
        self._curvature = _Dense(len(start), curvature) if len(start) <= DENSE else _Limited()
        self._answers = self._ascend()
        next(self._answers)

    def update(self, score: float, gradient: Floats) -> None:
        """Continue with the score and gradient (n,) of `wanted`."""
        self.evaluations += 1
        try:
            self._answers.send((score, gradient))
        except StopIteration:
            self.done = True

    def _feasible(self, design: Floats) -> Floats:
        """Return the nearest design vector that keeps the rules."""
        design = np.clip(design, 0.0, 1.0)
        return design if self._project is None else self._project(design[None])[0]

    def _ascend(self) -> Generator[None, tuple[float, Floats], None]:
        """Step until nothing more is gained; receives the score and gradient of `wanted`."""
        self.score, self.gradient = yield
        self._history.append(self.score)
        while True:
            direction = self._direction()
            if direction is None:
                return
            point = yield from self._line_search(direction)
            if point is None:
                if self._curvature.fresh:
                    return
                self._curvature.forget()
                continue
            design, score, gradient = point
            self._curvature.add(design - self.design, self.gradient - gradient)
            self.design, self.score, self.gradient = point
            self._history.append(score)
            if len(self._history) > WINDOW and score - self._history[0] <= ENOUGH * abs(score):
                return

    def _inward(self, direction: Floats) -> Floats:
        """Return the direction without components that lead out of the box."""
        low = (self.design <= 0.0) & (direction < 0.0)
        high = (self.design >= 1.0) & (direction > 0.0)
        return np.where(low | high, 0.0, direction)

    def _direction(self) -> Floats | None:
        """Return the direction of the next step; None at a maximum."""
        gradient = self._inward(self.gradient)
        if not np.any(gradient):
            return None
        step = self._curvature.times(gradient, gradient != 0.0)
        if step is not None:
            step = self._inward(step)
            if step @ gradient > ANGLE * np.linalg.norm(step) * np.linalg.norm(gradient):
                return step
            self._curvature.forget()
        if self._guess is not None:
            return gradient * self._guess
        return gradient * (FIRST / float(np.abs(gradient).max()))

    def _line_search(
        self, direction: Floats
    ) -> Generator[None, tuple[float, Floats], tuple[Floats, float, Floats] | None]:
        """Return a point of the projected path that rises enough; None if none is near."""
        largest = float(np.abs(direction).max())
        length = min(1.0, LARGEST / largest)
        low, high = 0.0, np.inf
        best = None
        for _ in range(TRIES):
            design = self._feasible(self.design + length * direction)
            change = design - self.design
            if not np.any(change):
                break
            self.wanted = design
            score, gradient = yield
            if not score > self.score + RISE * max(float(self.gradient @ change), 0.0):
                high = length
            else:
                best = design, score, gradient
                inside = np.where((design > 0.0) & (design < 1.0), direction, 0.0)
                turned = gradient @ inside <= TURN * (self.gradient @ inside)
                if turned or length * largest >= LARGEST:
                    return best
                low = length
            length = 0.5 * (low + high) if high < np.inf else 2.0 * length
            if best is not None and high - low < BRACKET * high:
                return best
        return best


class CoarseToFine:
    """A local search on a coarse schedule, then on finer ones, then on the design vector itself.

    It is used as a `LocalSearch`.

    Parameters
    ----------
    start
        (n,) design vector to begin at.
    matrices
        (n, m) matrices from the values of a schedule to a design vector, the coarsest first.
    project
        See `LocalSearch`.
    """

    def __init__(
        self,
        start: Floats,
        matrices: Sequence[Floats],
        project: Callable[[Floats], Floats] | None = None,
    ) -> None:
        self._matrices = list(matrices)
        self._project = project
        self.evaluations = 0
        self.done = False
        self.score, self.design = -np.inf, start
        self._begin(start)

    def _begin(self, design: Floats) -> None:
        """Begin the search on the next schedule, or on the design vector after the last."""
        self._matrix = self._matrices.pop(0) if self._matrices else None
        if self._matrix is None:
            self._search = LocalSearch(design, self._project)
        else:
            self._search = LocalSearch(np.clip(self._coarse(self._matrix, design), 0.0, 1.0))

    def _coarse(self, matrix: Floats, design: Floats) -> Floats:
        """Return the values of the schedule that is nearest to a design vector."""
        return np.asarray(np.linalg.lstsq(matrix, design, rcond=None)[0])

    @property
    def wanted(self) -> Floats:
        """Design vector (n,) whose score and gradient are needed next."""
        if self._matrix is None:
            return self._search.wanted
        design = np.clip(self._matrix @ self._search.wanted, 0.0, 1.0)
        return design if self._project is None else self._project(design[None])[0]

    def update(self, score: float, gradient: Floats) -> None:
        """Continue with the score and gradient (n,) of `wanted`."""
        self.evaluations += 1
        if score > self.score:
            self.score, self.design = score, self.wanted
        by_values = gradient if self._matrix is None else self._matrix.T @ gradient
        self._search.update(score, by_values)
        if self._search.done:
            if self._matrix is None:
                self.done = True
            else:
                self._begin(self.design)


Searches = Sequence[LocalSearch | CoarseToFine]


def advance(searches: Searches, gradients: int) -> Search:
    """Advance local searches in lockstep, so that they share batches.

    Parameters
    ----------
    searches
        The local searches.
    gradients
        Largest number of evaluations with gradient of each.
    """
    ends = {id(search): search.evaluations + gradients for search in searches}
    while running := [s for s in searches if not s.done and s.evaluations < ends[id(s)]]:
        answer = yield Request(np.array([s.wanted for s in running]), gradient=True)
        for search, score, gradient in zip(running, *answer, strict=True):
            search.update(float(score), gradient)


def run_local_searches(evaluator: Evaluator, searches: Searches, gradients: int) -> None:
    """Advance local searches in lockstep until they end, see `advance`.

    Parameters
    ----------
    evaluator
        Evaluator of the problem.
    searches, gradients
        See `advance`.

    Raises
    ------
    BudgetSpent
        Where fewer evaluations remain.
    """
    run_in_lockstep(evaluator, [advance(searches, gradients)])


class _Dense:
    """Inverse curvature as a matrix (BFGS)."""

    def __init__(self, n: int, guess: Floats | None) -> None:
        self._first = np.eye(n) if guess is None else np.diag(guess)
        self._inverse, self._guessed = self._first, guess is not None
        self.fresh = True

    def forget(self) -> None:
        """Return to the first guess."""
        self._inverse = self._first
        self.fresh = True

    def times(self, gradient: Floats, free: Bools) -> Floats | None:
        """Return the step of the free variables; None while nothing is known."""
        if self.fresh:
            return None
        return np.where(free, self._inverse @ gradient, 0.0)

    def add(self, s: Floats, y: Floats) -> None:
        """Learn from a step s and the change y of minus the gradient."""
        y = np.where(s == 0.0, 0.0, y)
        product = float(s @ y)
        if product <= CURVED * np.linalg.norm(s) * np.linalg.norm(y):
            return
        if self.fresh:
            self._inverse = self._inverse * (1.0 if self._guessed else product / float(y @ y))
            self.fresh = False
        hy = self._inverse @ y
        self._inverse += (1.0 + y @ hy / product) / product * np.outer(s, s)
        self._inverse -= (np.outer(hy, s) + np.outer(s, hy)) / product


class _Limited:
    """Inverse curvature as the last pairs of step and change of the gradient (L-BFGS)."""

    def __init__(self) -> None:
        self._pairs: deque[tuple[Floats, Floats, float]] = deque(maxlen=MEMORY)

    @property
    def fresh(self) -> bool:
        """True while nothing is known."""
        return not self._pairs

    def forget(self) -> None:
        """Return to the beginning."""
        self._pairs.clear()

    def times(self, gradient: Floats, free: Bools) -> Floats | None:
        """Return the step of the free variables; None while nothing is known."""
        if not self._pairs:
            return None
        step, coefficients = gradient.copy(), []
        for s, y, product in reversed(self._pairs):
            coefficients.append(float(s @ step) / product)
            step -= coefficients[-1] * y
        s, y, product = self._pairs[-1]
        step *= product / float(y @ y)
        for (s, y, product), a in zip(self._pairs, reversed(coefficients), strict=True):
            step += (a - float(y @ step) / product) * s
        return np.where(free, step, 0.0)

    def add(self, s: Floats, y: Floats) -> None:
        """Learn from a step s and the change y of minus the gradient."""
        y = np.where(s == 0.0, 0.0, y)
        product = float(s @ y)
        if product > CURVED * np.linalg.norm(s) * np.linalg.norm(y):
            self._pairs.append((s, y, product))
