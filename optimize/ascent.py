"""A local search that climbs over kinks and can be paused: BFGS within the box.

The onset of a flush is a kink of the score, and good rows sit on several of them at once.  There a
line search that asks for a large slope to vanish shrinks its steps to nothing; one that asks only
for a rise and a turned slope (Armijo and weak Wolfe) goes past the kink, and the curvature learns
the ridge from it (Lewis, Overton 2013, "Nonsmooth optimization via quasi-Newton methods").
Variables at a face of the box that the slope holds there are left out of the step.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RISE, TURN = 1e-4, 0.5  # weak Wolfe: least part of the promised rise, largest part of the slope left
DENSE = 200  # variables up to which the whole inverse curvature is kept
MEMORY = 30  # pairs kept for more
TRIES = 14  # of one line search
LARGEST = 0.15  # of a variable's first change, as a part of the box
LOOK = 8  # steps over which the gain is judged
ENOUGH = 1e-7  # a smaller relative gain over them ends it


class Ascent:
    """One climb from one start; `climb` goes on where the last one was paused.

    design, score, gradient: where it stands.  done: whether nothing more can be gained.
    gradients: how many it has asked for.
    """

    def __init__(
        self,
        score_and_gradient: Callable[[Floats], tuple[float, Floats]],
        start: Floats,
        reach: float = LARGEST,
    ) -> None:
        self._ask = score_and_gradient
        self.gradients = 1
        self.design = np.clip(start, 0.0, 1.0)
        self.score, self.gradient = score_and_gradient(self.design)
        self.done = not np.any(self._free(self.gradient) * self.gradient)
        self._reach = reach
        self._history = deque([self.score], maxlen=LOOK + 1)
        self._curvature = _Dense(len(start)) if len(start) <= DENSE else _Limited()

    def climb(self, gradients: int) -> float:
        """Ask for about so many gradients more, fewer where it is done; returns the score."""
        until = self.gradients + gradients
        while not self.done and self.gradients < until:
            self._step()
        return self.score

    def _free(self, gradient: Floats) -> NDArray[np.bool_]:
        """What the slope does not press against its face of the box."""
        held = ((self.design <= 0.0) & (gradient <= 0.0)) | (
            (self.design >= 1.0) & (gradient >= 0.0)
        )
        return ~held

    def _step(self) -> None:
        free = self._free(self.gradient)
        slope = np.where(free, self.gradient, 0.0)
        way = self._curvature.times(slope, free)
        if way is None or way @ slope <= 1e-10 * np.linalg.norm(way) * np.linalg.norm(slope):
            self._curvature.forget()
            way = slope / max(float(np.abs(slope).max()), 1e-300) * self._reach / 3.0
        # on a face, only what leads inside
        way = np.where(
            ((self.design <= 0.0) & (way < 0.0)) | ((self.design >= 1.0) & (way > 0.0)), 0.0, way
        )
        largest = float(np.abs(way).max())
        if largest == 0.0:
            self.done = True
            return
        length = min(1.0, self._reach / largest)
        found = self._search(way, length)
        if found is None:
            if self._curvature.fresh:
                self.done = True
            self._curvature.forget()
            return
        design, score, gradient = found
        self._curvature.learn(design - self.design, self.gradient - gradient)
        self.design, self.score, self.gradient = design, score, gradient
        self._history.append(score)
        if len(self._history) > LOOK and score - self._history[0] <= ENOUGH * abs(score):
            self.done = True

    def _search(self, way: Floats, length: float) -> tuple[Floats, float, Floats] | None:
        """A point of the bent path clip(design + t way) that rises enough; None if none is near."""
        low, high = 0.0, np.inf
        best = None
        for _ in range(TRIES):
            design = np.clip(self.design + length * way, 0.0, 1.0)
            change = design - self.design
            if not np.any(change):
                break
            self.gradients += 1
            score, gradient = self._ask(design)
            if score < self.score + RISE * max(float(self.gradient @ change), 0.0):
                high = length
            else:
                best = design, score, gradient
                inside = np.where((design > 0.0) & (design < 1.0), way, 0.0)
                if gradient @ inside <= TURN * (self.gradient @ inside):
                    return best
                if length * np.abs(way).max() >= self._reach:
                    return best
                low = length
            length = 0.5 * (low + high) if high < np.inf else 2.0 * length
            if best is not None and high - low < 0.1 * high:
                return best
        return best


class _Dense:
    """Inverse curvature as a matrix (BFGS)."""

    def __init__(self, n: int) -> None:
        self._inverse = np.eye(n)
        self.fresh = True

    def forget(self) -> None:
        self._inverse = np.eye(len(self._inverse))
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
            self._inverse *= product / float(y @ y)
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
