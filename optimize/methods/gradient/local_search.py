"""Local search for scores with kinks, which its caller advances: BFGS within the box.

The onset of a face contact is a kink of the score, and good layouts lie on several kinks at once.
There a line search with the strong Wolfe conditions shrinks its steps to zero. One with the Armijo
and weak Wolfe conditions steps across the kink, so that the curvature represents it. Variables that
the gradient holds at a face of the box are left out of the step.

References
----------
Lewis, A. S., Overton, M. L. (2013). Nonsmooth optimization via quasi-Newton methods. Mathematical
Programming 141, 135-163: algorithm 2.1 (the steps), algorithm 4.6 (their lengths).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Generator, Sequence

import numpy as np

from domino_env.core.types import Floats
from optimize.evaluator import Evaluator
from optimize.methods.gradient.lockstep import Request, Search, run_in_lockstep

ARMIJO, WEAK_WOLFE = 1e-4, 0.5  # factors of the first slope in the Armijo and weak Wolfe conditions
# least cosine between a step and the gradient, below which the curvature is reset
LEAST_COSINE = 1e-10
# least cosine between a step and the change of minus the gradient, for an update of the curvature
LEAST_CURVATURE = 1e-12
BRACKET_WIDTH = 0.1  # relative width of the bracket at which a line search takes its best point
MAX_DENSE = 200  # variables up to which the whole inverse curvature is stored
MAX_TANGENTS = 4  # corrections of a step by which other variables come to a face of the box
MEMORY = 30  # pairs of step and change of the gradient that are stored for more variables
MAX_TRIES = 14  # largest number of evaluations of one line search
# largest change of a variable in the first try of a line search, relative to the box; at this
# change the Armijo condition alone is enough
MAX_CHANGE = 0.15
# the same for a step along the gradient before the curvature is known
FIRST_CHANGE = MAX_CHANGE / 3.0
WINDOW = 8  # steps over which the gain is measured
LEAST_GAIN = 1e-7  # largest relative gain over these steps that ends the search


class LocalSearch:
    """Local search from one start; its caller evaluates the candidates, so that many share a batch.

    Parameters
    ----------
    start
        (n,) design vector to begin at; clipped to the box.
    project
        Function from design vectors (B, n) to the nearest that keep the rules; None if the box is
        the only rule.
    curvature
        (n,) positive guess of the inverse curvature of the score along each variable, for the first
        step; None for a short step along the gradient.
    normal
        (n,) coefficients of the sum that a given length fixes, to which steps are tangential; None
        for none.

    Attributes
    ----------
    candidate
        (n,) design vector whose score and gradient are needed next.
    design, score, gradient
        Best design vector (n,), its score and gradient (n,); score -inf and gradient 0 before the
        first evaluation.
    evaluations
        Number of evaluations so far.
    done
        True if nothing more can be gained.
    """

    def __init__(
        self,
        start: Floats,
        project: Callable[[Floats], Floats] | None = None,
        curvature: Floats | None = None,
        normal: Floats | None = None,
    ) -> None:
        self._project, self._normal = project, normal
        self.candidate = _nearest_feasible(start, project)
        self.design = self.candidate
        self.score, self.gradient = -np.inf, np.zeros(len(start))
        self.evaluations = 0
        self.done = False
        self._history: deque[float] = deque(maxlen=WINDOW + 1)
        self._guess = curvature
        self._curvature = _BFGS(len(start), curvature) if len(start) <= MAX_DENSE else _LBFGS()
        self._steps = self._ascend()
        next(self._steps)

    def update(self, score: float, gradient: Floats) -> None:
        """Continue with the score and gradient (n,) of `candidate`."""
        self.evaluations += 1
        try:
            self._steps.send((score, gradient))
        except StopIteration:
            self.done = True

    def _ascend(self) -> Generator[None, tuple[float, Floats], None]:
        """Step until the gain is too small; `yield` receives score and gradient of `candidate`."""
        self.score, self.gradient = yield
        self._history.append(self.score)
        while (direction := self._direction()) is not None:
            point = yield from self._line_search(direction)
            if point is None:
                if self._curvature.is_initial:
                    return
                self._curvature.reset()
                continue
            design, score, gradient = point
            step = design - self.design
            change = np.where(step == 0.0, 0.0, self.gradient - gradient)  # of minus the gradient
            product = float(step @ change)
            if product > LEAST_CURVATURE * np.linalg.norm(step) * np.linalg.norm(change):
                self._curvature.update(step, change, product)
            self.design, self.score, self.gradient = point
            self._history.append(score)
            if len(self._history) > WINDOW and score - self._history[0] <= LEAST_GAIN * abs(score):
                return

    def _inward_part(self, direction: Floats) -> Floats:
        """Return the direction without components that lead out of the box."""
        low = (self.design <= 0.0) & (direction < 0.0)
        high = (self.design >= 1.0) & (direction > 0.0)
        return np.where(low | high, 0.0, direction)

    def _tangent(self, step: Floats, multiply: Callable[[Floats], Floats]) -> Floats:
        """Return a step with the least change, in the metric of the curvature, that keeps the sum.

        A projection of the step would change all its components, and with them the curvature that
        is estimated from it. `multiply` multiplies by the inverse curvature.
        """
        if self._normal is None:
            return step
        # a projected gradient may be 0 in a variable inside the box that has to make room
        inside = (self.design > 0.0) & (self.design < 1.0)
        free = (step != 0.0) | inside
        for _ in range(MAX_TANGENTS):
            normal = np.where(free, self._normal, 0.0)
            change = np.where(free, multiply(normal), 0.0)
            if not float(normal @ change) > 0.0:
                return step
            tangent = step - change * (float(normal @ step) / float(normal @ change))
            step = self._inward_part(tangent)
            if np.array_equal(step, tangent):
                break
            free &= (step != 0.0) | inside
        return step

    def _direction(self) -> Floats | None:
        """Return the direction of the next step; None at a maximum."""
        gradient = self._inward_part(self.gradient)
        if not np.any(gradient):
            return None
        if not self._curvature.is_initial:
            step = np.where(gradient != 0.0, self._curvature.multiply(gradient), 0.0)
            step = self._tangent(self._inward_part(step), self._curvature.multiply)
            if step @ gradient > LEAST_COSINE * np.linalg.norm(step) * np.linalg.norm(gradient):
                return step
            self._curvature.reset()
        if self._guess is not None:
            return gradient * self._guess
        gradient = self._tangent(gradient, lambda normal: normal)
        largest = float(np.abs(gradient).max())
        return gradient * (FIRST_CHANGE / largest) if largest > 0.0 else None

    def _line_search(
        self, direction: Floats
    ) -> Generator[None, tuple[float, Floats], tuple[Floats, float, Floats] | None]:
        """Search the projected path for a point of sufficient gain; return None if it has none."""
        largest = float(np.abs(direction).max())
        length = min(1.0, MAX_CHANGE / largest)
        low, high = 0.0, np.inf
        best = None
        for _ in range(MAX_TRIES):
            design = _nearest_feasible(self.design + length * direction, self._project)
            change = design - self.design
            if not np.any(change):
                break
            self.candidate = design
            score, gradient = yield
            if not score > self.score + ARMIJO * max(float(self.gradient @ change), 0.0):
                high = length
            else:
                best = design, score, gradient
                inside = np.where((design > 0.0) & (design < 1.0), direction, 0.0)
                is_flat = gradient @ inside <= WEAK_WOLFE * (self.gradient @ inside)
                if is_flat or length * largest >= MAX_CHANGE:
                    return best
                low = length
            length = 0.5 * (low + high) if high < np.inf else 2.0 * length
            if best is not None and high - low < BRACKET_WIDTH * high:
                return best
        return best


def _nearest_feasible(design: Floats, project: Callable[[Floats], Floats] | None) -> Floats:
    """Return the nearest design vector (n,) that keeps the rules, see `LocalSearch`."""
    design = np.clip(design, 0.0, 1.0)
    return design if project is None else project(design[None])[0]


class CoarseToFine:
    """Local search on coarse layouts, then on ever finer ones, then on the design vector itself.

    It has the attributes and methods of `LocalSearch`, except `gradient`.

    Parameters
    ----------
    start
        (n,) design vector to begin at.
    matrices
        (n, m) matrices from m values to a design vector, the coarsest first; see `coarse_matrix`.
    project, normal
        See `LocalSearch`.
    """

    def __init__(
        self,
        start: Floats,
        matrices: Sequence[Floats],
        project: Callable[[Floats], Floats] | None = None,
        normal: Floats | None = None,
    ) -> None:
        self._matrices = list(matrices)
        self._project, self._normal = project, normal
        self.evaluations = 0
        self.done = False
        self.score, self.design = -np.inf, start
        self._begin(start)

    def _begin(self, design: Floats) -> None:
        """Begin the search on the next coarse layout, or on the design vector after the last."""
        self._matrix = self._matrices.pop(0) if self._matrices else None
        if self._matrix is None:
            self._search = LocalSearch(design, self._project, normal=self._normal)
        else:
            normal = None if self._normal is None else self._matrix.T @ self._normal
            self._search = LocalSearch(self._coarsen(self._matrix, design), normal=normal)

    def _coarsen(self, matrix: Floats, design: Floats) -> Floats:
        """Return the values (m,) of the coarse layout nearest to a design vector (n,)."""
        return np.asarray(np.linalg.lstsq(matrix, design, rcond=None)[0])

    @property
    def candidate(self) -> Floats:
        """Design vector (n,) whose score and gradient are needed next."""
        if self._matrix is None:
            return self._search.candidate
        return _nearest_feasible(self._matrix @ self._search.candidate, self._project)

    def update(self, score: float, gradient: Floats) -> None:
        """Continue with the score and gradient (n,) of `candidate`."""
        self.evaluations += 1
        if score > self.score:
            self.score, self.design = score, self.candidate
        by_values = gradient if self._matrix is None else self._matrix.T @ gradient
        self._search.update(score, by_values)
        self.done = self._search.done and self._matrix is None
        if self._search.done and not self.done:
            self._begin(self.design)


Searches = Sequence[LocalSearch | CoarseToFine]


def advance(searches: Searches, gradients: int) -> Search:
    """Advance local searches in lockstep, so that they share batches.

    Parameters
    ----------
    searches
        The local searches.
    gradients
        Largest number of gradients for each.

    Yields
    ------
    Request
        Scores and gradients of the candidates of all local searches that still run.
    """
    ends = {id(search): search.evaluations + gradients for search in searches}
    while running := [s for s in searches if not s.done and s.evaluations < ends[id(s)]]:
        answer = yield Request(np.array([s.candidate for s in running]), gradient=True)
        for search, score, gradient in zip(running, *answer, strict=True):
            search.update(float(score), gradient)


def run_local_searches(evaluator: Evaluator, searches: Searches, gradients: int) -> None:
    """Advance local searches in lockstep until all have ended or used their gradients.

    Parameters
    ----------
    evaluator
        Evaluator of the problem.
    searches, gradients
        See `advance`.

    Raises
    ------
    BudgetSpent
        If a limit is reached.
    """
    run_in_lockstep(evaluator, [advance(searches, gradients)])


class _BFGS:
    """Inverse curvature of the score as a matrix (BFGS)."""

    def __init__(self, n: int, guess: Floats | None) -> None:
        self._first = np.eye(n) if guess is None else np.diag(guess)
        self._inverse, self._has_guess = self._first, guess is not None
        self.is_initial = True

    def reset(self) -> None:
        """Restore the first guess."""
        self._inverse = self._first
        self.is_initial = True

    def multiply(self, gradient: Floats) -> Floats:
        """Return the inverse curvature times the gradient (n,)."""
        return self._inverse @ gradient

    def update(self, s: Floats, y: Floats, product: float) -> None:
        """Update with a step s (n,), the change y (n,) of minus the gradient, and s @ y."""
        if self.is_initial:
            self._inverse = self._inverse * (1.0 if self._has_guess else product / float(y @ y))
            self.is_initial = False
        hy = self._inverse @ y
        self._inverse += (1.0 + y @ hy / product) / product * np.outer(s, s)
        self._inverse -= (np.outer(hy, s) + np.outer(s, hy)) / product


class _LBFGS:
    """Inverse curvature of the score by the last steps and changes of the gradient (L-BFGS)."""

    def __init__(self) -> None:
        self._pairs: deque[tuple[Floats, Floats, float]] = deque(maxlen=MEMORY)

    @property
    def is_initial(self) -> bool:
        """True before the first update."""
        return not self._pairs

    def reset(self) -> None:
        """Remove all pairs."""
        self._pairs.clear()

    def multiply(self, gradient: Floats) -> Floats:
        """Return the inverse curvature times the gradient (n,), after the first update."""
        step, coefficients = gradient.copy(), []
        for s, y, product in reversed(self._pairs):
            coefficients.append(float(s @ step) / product)
            step -= coefficients[-1] * y
        s, y, product = self._pairs[-1]
        step *= product / float(y @ y)
        for (s, y, product), first in zip(self._pairs, reversed(coefficients), strict=True):
            step += (first - float(y @ step) / product) * s
        return step

    def update(self, s: Floats, y: Floats, product: float) -> None:
        """Update with a step s (n,), the change y (n,) of minus the gradient, and s @ y."""
        self._pairs.append((s, y, product))
