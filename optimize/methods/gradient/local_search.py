"""A local search that copes with kinks and can be paused: BFGS within the box.

The onset of a flush is a kink of the score, and good rows sit on several of them at once. There a
line search that asks for a large slope to vanish shrinks its steps to nothing; one that asks only
for a rise and a turned slope (Armijo and weak Wolfe) goes past the kink, and the curvature learns
the ridge from it. Variables at a face of the box that the slope holds there are left out of the
step.

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
from numpy.typing import NDArray

from optimize.methods.gradient.lockstep import Asked, Search, side_by_side

if TYPE_CHECKING:
    from optimize.evaluator import Budget

Floats = NDArray[np.float64]

RISE, TURN = 1e-4, 0.5  # least part of the promised rise, largest of the slope left
DENSE = 200  # variables up to which the whole inverse curvature is kept
MEMORY = 30  # pairs kept for more
TRIES = 14  # of one line search
LARGEST = 0.15  # of a variable's first change, as a part of the box
LOOK = 8  # steps over which the gain is judged
ENOUGH = 1e-7  # a smaller relative gain over them ends it


class Ascent:
    """One climb from one start, on ask and tell, so that many can share a batch.

    Parameters
    ----------
    start
        (n,) design to begin at; what lies outside the box is clipped.
    project
        Maps designs (B, n) to the nearest that keep the rules; None where the box is the only rule.
    curvature
        (n,) positive guess of the inverse curvature of the score by each variable, which the first
        step goes by; None for a short step up the slope.

    Attributes
    ----------
    wanted
        (n,) the design whose score and gradient it asks for next.
    design, score, gradient
        The best so far; -inf and zeros before the first evaluation.
    told
        Evaluations so far.
    done
        Whether nothing more can be gained.
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
        self.told = 0
        self.done = False
        self._history: deque[float] = deque(maxlen=LOOK + 1)
        self._guess = curvature
        self._curvature = _Dense(len(start), curvature) if len(start) <= DENSE else _Limited()
        self._answers = self._climb()
        next(self._answers)

    def tell(self, score: float, gradient: Floats) -> None:
        """Take the score and gradient (n,) of `wanted`."""
        self.told += 1
        try:
            self._answers.send((score, gradient))
        except StopIteration:
            self.done = True

    def _feasible(self, design: Floats) -> Floats:
        design = np.clip(design, 0.0, 1.0)
        return design if self._project is None else self._project(design[None])[0]

    def _climb(self) -> Generator[None, tuple[float, Floats], None]:
        self.score, self.gradient = yield
        self._history.append(self.score)
        while True:
            way = self._way()
            if way is None:
                return
            found = yield from self._search(way)
            if found is None:
                if self._curvature.fresh:
                    return
                self._curvature.forget()
                continue
            design, score, gradient = found
            self._curvature.learn(design - self.design, self.gradient - gradient)
            self.design, self.score, self.gradient = found
            self._history.append(score)
            if len(self._history) > LOOK and score - self._history[0] <= ENOUGH * abs(score):
                return

    def _inward(self, way: Floats) -> Floats:
        """The way without what leads out of the box."""
        out = ((self.design <= 0.0) & (way < 0.0)) | ((self.design >= 1.0) & (way > 0.0))
        return np.where(out, 0.0, way)

    def _way(self) -> Floats | None:
        """Where to go from here; None at the top."""
        slope = self._inward(self.gradient)
        if not np.any(slope):
            return None
        way = self._curvature.times(slope, slope != 0.0)
        if way is not None:
            way = self._inward(way)
            if way @ slope > 1e-10 * np.linalg.norm(way) * np.linalg.norm(slope):
                return way
            self._curvature.forget()
        if self._guess is not None:
            return slope * self._guess
        return slope * (LARGEST / 3.0 / float(np.abs(slope).max()))

    def _search(
        self, way: Floats
    ) -> Generator[None, tuple[float, Floats], tuple[Floats, float, Floats] | None]:
        """A point of the bent path from here that rises enough; None if none is near."""
        largest = float(np.abs(way).max())
        length = min(1.0, LARGEST / largest)
        low, high = 0.0, np.inf
        best = None
        for _ in range(TRIES):
            design = self._feasible(self.design + length * way)
            change = design - self.design
            if not np.any(change):
                break
            self.wanted = design
            score, gradient = yield
            if not score > self.score + RISE * max(float(self.gradient @ change), 0.0):
                high = length
            else:
                best = design, score, gradient
                inside = np.where((design > 0.0) & (design < 1.0), way, 0.0)
                turned = gradient @ inside <= TURN * (self.gradient @ inside)
                if turned or length * largest >= LARGEST:
                    return best
                low = length
            length = 0.5 * (low + high) if high < np.inf else 2.0 * length
            if best is not None and high - low < 0.1 * high:
                return best
        return best


class Refined:
    """An ascent on a coarse schedule, then on finer ones, then on the design itself.

    It is asked and told as an `Ascent` is.

    Parameters
    ----------
    start
        (n,) design to begin at.
    matrices
        (n, m) each: from the numbers of a schedule to a design, the coarsest first.
    project
        As of `Ascent`.
    """

    def __init__(
        self,
        start: Floats,
        matrices: Sequence[Floats],
        project: Callable[[Floats], Floats] | None = None,
    ) -> None:
        self._matrices = list(matrices)
        self._project = project
        self.told = 0
        self.done = False
        self.score, self.design = -np.inf, start
        self._begin(start)

    def _begin(self, design: Floats) -> None:
        self._matrix = self._matrices.pop(0) if self._matrices else None
        if self._matrix is None:
            self._ascent = Ascent(design, self._project)
        else:
            self._ascent = Ascent(np.clip(self._coarse(self._matrix, design), 0.0, 1.0))

    def _coarse(self, matrix: Floats, design: Floats) -> Floats:
        """The numbers of the schedule that comes nearest to a design."""
        return np.asarray(np.linalg.lstsq(matrix, design, rcond=None)[0])

    @property
    def wanted(self) -> Floats:
        """The design (n,) whose score and gradient it asks for next."""
        if self._matrix is None:
            return self._ascent.wanted
        design = np.clip(self._matrix @ self._ascent.wanted, 0.0, 1.0)
        return design if self._project is None else self._project(design[None])[0]

    def tell(self, score: float, gradient: Floats) -> None:
        """Take the score and gradient (n,) of `wanted`."""
        self.told += 1
        if score > self.score:
            self.score, self.design = score, self.wanted
        here = gradient if self._matrix is None else self._matrix.T @ gradient
        self._ascent.tell(score, here)
        if self._ascent.done:
            if self._matrix is None:
                self.done = True
            else:
                self._begin(self.design)


def climbing(arms: Sequence[Ascent | Refined], gradients: int) -> Search:
    """Go on with all in lockstep, so that they share batches.

    Parameters
    ----------
    arms
        The climbs.
    gradients
        Most evaluations with gradient of each.
    """
    until = {id(arm): arm.told + gradients for arm in arms}
    while live := [arm for arm in arms if not arm.done and arm.told < until[id(arm)]]:
        scores, slopes = yield Asked(np.array([arm.wanted for arm in live]), gradients=True)
        for arm, score, slope in zip(live, scores, slopes, strict=True):
            arm.tell(float(score), slope)


def climb(budget: Budget, arms: Sequence[Ascent | Refined], gradients: int) -> None:
    """Let them climb, see `climbing`; raise BudgetSpent where not all can be paid for."""
    side_by_side(budget, [climbing(arms, gradients)])


class _Dense:
    """Inverse curvature as a matrix (BFGS)."""

    def __init__(self, n: int, guess: Floats | None) -> None:
        self._first = np.eye(n) if guess is None else np.diag(guess)
        self._inverse, self._guessed = self._first, guess is not None
        self.fresh = True

    def forget(self) -> None:
        self._inverse = self._first
        self.fresh = True

    def times(self, slope: Floats, free: NDArray[np.bool_]) -> Floats | None:
        if self.fresh:
            return None
        return np.where(free, self._inverse @ slope, 0.0)

    def learn(self, s: Floats, y: Floats) -> None:
        still = s == 0.0
        y = np.where(still, 0.0, y)
        product = float(s @ y)
        if product <= 1e-12 * np.linalg.norm(s) * np.linalg.norm(y):
            return
        if self.fresh:
            self._inverse = self._inverse * (1.0 if self._guessed else product / float(y @ y))
            self.fresh = False
        hy = self._inverse @ y
        self._inverse += (1.0 + y @ hy / product) / product * np.outer(s, s)
        self._inverse -= (np.outer(hy, s) + np.outer(s, hy)) / product


class _Limited:
    """Inverse curvature as the last pairs of step and turn of the slope (L-BFGS)."""

    def __init__(self) -> None:
        self._pairs: deque[tuple[Floats, Floats, float]] = deque(maxlen=MEMORY)

    @property
    def fresh(self) -> bool:
        return not self._pairs

    def forget(self) -> None:
        self._pairs.clear()

    def times(self, slope: Floats, free: NDArray[np.bool_]) -> Floats | None:
        if not self._pairs:
            return None
        q, parts = slope.copy(), []
        for s, y, product in reversed(self._pairs):
            a = float(s @ q) / product
            parts.append(a)
            q -= a * y
        s, y, product = self._pairs[-1]
        q *= product / float(y @ y)
        for (s, y, product), a in zip(self._pairs, reversed(parts), strict=True):
            q += (a - float(y @ q) / product) * s
        return np.where(free, q, 0.0)

    def learn(self, s: Floats, y: Floats) -> None:
        y = np.where(s == 0.0, 0.0, y)
        product = float(s @ y)
        if product > 1e-12 * np.linalg.norm(s) * np.linalg.norm(y):
            self._pairs.append((s, y, product))
