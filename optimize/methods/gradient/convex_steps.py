"""Sequential convex programming: a concave model of the score in a trust region, by cvxpy.

The model is the lowest of several planes: the gradients here and at points nearby, so that both
sides of a kink are known. Every linear rule of the scene is a constraint of the step. The program
is built once with parameters (DPP), so that only numbers change from step to step.
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

PLANES = 10
FIRST, LARGEST, SMALLEST = 0.1, 0.4, 1e-6  # radius of the trust region, as a part of the box
POOR, GOOD = 0.1, 0.7  # part of the promised rise that shrinks the region, and that widens it
AROUND = 4.0  # radii within which planes are kept


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Search from one start after the other until a limit is reached."""
    step = Step(evaluator.problem)
    for start in starts(evaluator, rng):
        _ascend(evaluator, step, start)


class Step:
    """The best step of a model of planes within a trust region and all linear rules.

    Parameters
    ----------
    problem
        Whose linear rules the steps keep.
    """

    def __init__(self, problem: Problem) -> None:
        n = problem.dimension
        self._d, rise = cp.Variable(n), cp.Variable()
        self._slopes = cp.Parameter((PLANES, n))
        self._heights = cp.Parameter(PLANES)
        self._low, self._high = cp.Parameter(n), cp.Parameter(n)
        rules: list[Any] = [
            rise <= self._heights + self._slopes @ self._d,
            self._d >= self._low,
            self._d <= self._high,
        ]
        self._equality = problem.equality
        if self._equality is not None:
            row, _ = self._equality
            self._short, self._size = cp.Parameter(), float(np.abs(row).max())
            rules.append(row / self._size @ self._d == self._short)
        self._linear = problem.linear
        if self._linear is not None:
            self._room = cp.Parameter(len(self._linear[1]))
            rules.append(self._linear[0] @ self._d <= self._room)
        self._program = cp.Problem(cp.Maximize(rise), rules)

    def best(
        self, design: Floats, slopes: Floats, heights: Floats, radius: float
    ) -> tuple[Floats, float] | None:
        """Find the step that promises most.

        Parameters
        ----------
        design
            (n,) where the step begins.
        slopes, heights
            (PLANES, n) gradients of the planes, and (PLANES,) how far each lies above the score at
            `design`.
        radius
            Largest change of a variable.

        Returns
        -------
        tuple of (ndarray, float), or None
            The step (n,) and the rise that the model promises; None where the solver finds none.
        """
        self._slopes.value, self._heights.value = slopes, heights
        self._low.value = -np.minimum(design, radius)
        self._high.value = np.minimum(1.0 - design, radius)
        if self._equality is not None:
            row, total = self._equality
            self._short.value = (total - float(row @ design)) / self._size
        if self._linear is not None:
            self._room.value = np.maximum(self._linear[1] - self._linear[0] @ design, 0.0)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of an answer that is not exact
                self._program.solve(solver=cp.CLARABEL)
        except cp.SolverError:
            return None
        promised = self._program.value
        if self._d.value is None or promised is None or not np.isfinite(promised):
            return None
        return np.asarray(self._d.value), float(promised)


def _ascend(evaluator: Evaluator, step: Step, start: Floats) -> None:
    problem = evaluator.problem
    here = problem.project(np.clip(start, 0.0, 1.0)[None])[0]
    found = evaluator.evaluate(here, gradient=True)
    score, slope = found.score, found.gradient
    known = deque([(here, score, slope)], maxlen=PLANES)
    radius = FIRST
    while radius > SMALLEST:
        planes = [p for p in known if np.abs(p[0] - here).max() <= AROUND * radius]
        # below the point itself no plane may lie: the score is not concave everywhere
        heights = [max(s + g @ (here - x) - score, 0.0) for x, s, g in planes]
        slopes = [g for _, _, g in planes]
        missing = PLANES - len(planes)
        slopes += [slope] * missing
        heights += [0.0] * missing
        size = max(float(np.abs(slope).max()), 1e-300)  # for a program of even size
        plan = step.best(here, np.array(slopes) / size, np.array(heights) / size, radius)
        if plan is None or plan[1] * size <= 1e-10 * abs(score):
            radius *= 0.25
            continue
        there = problem.project(np.clip(here + plan[0], 0.0, 1.0)[None])[0]
        found = evaluator.evaluate(there, gradient=True)
        fresh, fresh_slope = found.score, found.gradient
        known.append((there, fresh, fresh_slope))
        part = (fresh - score) / (plan[1] * size)
        if part > GOOD:
            radius = min(2.0 * radius, LARGEST)
        elif part < POOR:
            radius *= 0.4
        if fresh > score:
            here, score, slope = there, fresh, fresh_slope
        else:
            known.append((here, score, slope))  # the plane here must not be forgotten
