"""Sequential convex programming: a concave model of the score in a trust region, by cvxpy.

The model is the minimum of several planes, which are tangent to the score at the current point and
at points nearby, so that it represents both sides of a kink. A given length is a constraint of the
step. The programme is built once with parameters, so that only numbers change from step to step.
"""

from __future__ import annotations

import warnings
from collections import deque
from typing import Any

import cvxpy as cp
import numpy as np

from domino_env.core.types import Floats
from optimize.evaluator import Evaluator
from optimize.methods.starts import starts
from optimize.problem import Problem

PLANES = 10  # gradients that the model keeps
# radius of the trust region, relative to the box
FIRST_RADIUS, MAX_RADIUS, MIN_RADIUS = 0.1, 0.4, 1e-6
# ratios of the gain to the predicted gain below and above which the radius changes
POOR_RATIO, GOOD_RATIO = 0.1, 0.7
GROW, SHRINK, SHRINK_FAST = 2.0, 0.4, 0.25  # factors of the radius; the last if no step gains
NEARBY = 4.0  # largest distance from the current point to those of the planes, over the radius
LEAST_GAIN = 1e-10  # a smaller predicted relative gain counts as zero


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Search from one start after the other until a limit is reached."""
    step = TrustRegionStep(evaluator.problem)
    for start in starts(evaluator, rng):
        _ascend(evaluator, step, start)


class TrustRegionStep:
    """Convex programme for the best step of a model of planes within a trust region.

    Parameters
    ----------
    problem
        Problem with the length that the step keeps, if it is given.
    """

    def __init__(self, problem: Problem) -> None:
        n = problem.dimension
        self._step, rise = cp.Variable(n), cp.Variable()
        self._gradients = cp.Parameter((PLANES, n))
        self._heights = cp.Parameter(PLANES)
        self._low, self._high = cp.Parameter(n), cp.Parameter(n)
        rules: list[Any] = [
            rise <= self._heights + self._gradients @ self._step,
            self._step >= self._low,
            self._step <= self._high,
        ]
        self._equality = problem.equality
        if self._equality is not None:
            coefficients, _ = self._equality
            self._residual, self._size = cp.Parameter(), float(np.abs(coefficients).max())
            rules.append(coefficients / self._size @ self._step == self._residual)
        self._program = cp.Problem(cp.Maximize(rise), rules)

    def best(
        self, design: Floats, gradients: Floats, heights: Floats, radius: float
    ) -> tuple[Floats, float] | None:
        """Find the step with the largest predicted gain.

        Parameters
        ----------
        design
            (n,) design vector at which the step begins.
        gradients
            (PLANES, n) gradients of the planes.
        heights
            (PLANES,) heights of the planes at `design` above its score.
        radius
            Largest change of a variable.

        Returns
        -------
        tuple of (ndarray, float), or None
            The step (n,) and its predicted gain; None if the solver fails.
        """
        self._gradients.value, self._heights.value = gradients, heights
        self._low.value = -np.minimum(design, radius)
        self._high.value = np.minimum(1.0 - design, radius)
        if self._equality is not None:
            coefficients, total = self._equality
            self._residual.value = (total - float(coefficients @ design)) / self._size
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # about an answer that is not exact
                self._program.solve(solver=cp.CLARABEL)
        except cp.SolverError:
            return None
        predicted = self._program.value
        if self._step.value is None or predicted is None or not np.isfinite(predicted):
            return None
        return np.asarray(self._step.value), float(predicted)


def _ascend(evaluator: Evaluator, step: TrustRegionStep, start: Floats) -> None:
    """Search from one start until the radius of the trust region is at most MIN_RADIUS."""
    problem = evaluator.problem
    design = problem.project(np.clip(start, 0.0, 1.0)[None])[0]
    result = evaluator.evaluate(design, gradient=True)
    score, gradient = result.score, result.gradient
    points = deque([(design, score, gradient)], maxlen=PLANES)
    radius = FIRST_RADIUS
    while radius > MIN_RADIUS:
        planes = [plane for plane in points if np.abs(plane[0] - design).max() <= NEARBY * radius]
        planes += [(design, score, gradient)] * (PLANES - len(planes))
        # where the score is not concave a plane may lie below the current score: it is raised
        heights = [max(s + g @ (design - x) - score, 0.0) for x, s, g in planes]
        gradients = [g for _, _, g in planes]
        size = max(float(np.abs(gradient).max()), 1e-300)  # scale of the programme, not 0
        best = step.best(design, np.array(gradients) / size, np.array(heights) / size, radius)
        if best is None or best[1] * size <= LEAST_GAIN * abs(score):
            radius *= SHRINK_FAST
            continue
        candidate = problem.project(np.clip(design + best[0], 0.0, 1.0)[None])[0]
        result = evaluator.evaluate(candidate, gradient=True)
        points.append((candidate, result.score, result.gradient))
        ratio = (result.score - score) / (best[1] * size)
        if ratio > GOOD_RATIO:
            radius = min(GROW * radius, MAX_RADIUS)
        elif ratio < POOR_RATIO:
            radius *= SHRINK
        if result.score > score:
            design, score, gradient = candidate, result.score, result.gradient
        else:
            points.append((design, score, gradient))  # the current plane must stay in the model
