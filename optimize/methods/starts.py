"""Starts of searches, and coarse layouts, which few numbers describe.

A coarse layout is linear between knots. Good layouts change quickly at both ends and hardly in the
middle, so there is a knot at every place near the ends, and their distances grow towards the
middle.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from domino_env.core.types import Floats, Ints
from optimize.evaluator import Evaluator
from optimize.problem import Problem

SPREAD = 0.1  # largest standard deviation of a change of a design vector; the least is a tenth
# The distance of the knots from the end grows by a ratio from knot to knot. The first ratio tried,
# and the factor by which its excess over 1 grows until the knots are few enough:
FIRST_RATIO, RATIO_GROWTH = 1.02, 1.1


def uniform_design(problem: Problem) -> Floats:
    """Return the design vector (n,) of the uniform baseline."""
    return problem.design(problem.scene.uniform().layout)


def starts(evaluator: Evaluator, rng: np.random.Generator) -> Iterator[Floats]:
    """Yield the uniform baseline, then without end random points or points near the best so far.

    At the onset of a face contact the score has a kink, at which the steps of a method for smooth
    functions shrink to zero. Therefore one local search is not enough.
    """
    problem = evaluator.problem
    yield uniform_design(problem)
    while True:
        if rng.random() < 0.5:
            yield problem.project(rng.random(problem.dimension)[None])[0]
        else:
            change = SPREAD * 10.0 ** (-rng.random()) * rng.standard_normal(problem.dimension)
            yield problem.project(np.clip(evaluator.best + change, 0.0, 1.0)[None])[0]


def knots(pairs: int, limit: int) -> Ints:
    """Return at most `limit` places among 0 … pairs-1, both ends included, as dense as possible."""
    if pairs <= limit:
        return np.arange(pairs)
    ratio = FIRST_RATIO
    while ratio <= pairs:
        offsets = [0.0]
        while offsets[-1] < 0.5 * pairs:
            offsets.append(max(offsets[-1] + 1.0, offsets[-1] * ratio))
        from_end = np.array(offsets[:-1]).astype(np.int64)
        places = np.unique(np.concatenate([from_end, pairs - 1 - from_end]))
        if len(places) <= limit:
            return places
        ratio = 1.0 + RATIO_GROWTH * (ratio - 1.0)
    return np.array([0, pairs - 1])


def coarse_matrix(parts: int, pairs: int, limit: int) -> Floats:
    """Return the matrix from values at the knots of a coarse layout to a design vector.

    Parameters
    ----------
    parts
        Number of free quantities among gaps, thicknesses and growths.
    pairs
        Number of places of each.
    limit
        Largest number of values m; at least two for each quantity are used.

    Returns
    -------
    ndarray
        (parts·pairs, m) matrix.
    """
    return interpolation(knots(pairs, max(2, limit // parts)), pairs, parts)


def interpolation(places: Ints, pairs: int, parts: int) -> Floats:
    """Return the matrix from values at some places to a design vector, linear between them.

    Parameters
    ----------
    places
        (m,) places in increasing order.
    pairs, parts
        See `coarse_matrix`.

    Returns
    -------
    ndarray
        (parts·pairs, parts·m) matrix.
    """
    columns = [np.interp(np.arange(pairs), places, unit) for unit in np.eye(len(places))]
    return np.asarray(np.kron(np.eye(parts), np.stack(columns, axis=1)))


class ReducedProblem:
    """Problem in few variables: the design vector itself, or values at knots.

    Parameters
    ----------
    evaluator
        Evaluator of the problem.
    limit
        Largest number of variables; at least two for each free quantity are used.

    Attributes
    ----------
    dimension
        Number of variables.
    """

    def __init__(self, evaluator: Evaluator, limit: int) -> None:
        self._evaluator = evaluator
        n, pairs = evaluator.problem.dimension, evaluator.problem.scene.count - 1
        self._matrix = None if n <= limit else coarse_matrix(n // pairs, pairs, limit)
        self.dimension = n if self._matrix is None else self._matrix.shape[1]

    def nearest(self, design: Floats) -> Floats:
        """Fit variables (m,) in the box to a design vector (n,), by least squares and clipping."""
        if self._matrix is None:
            return design
        return np.asarray(np.clip(np.linalg.lstsq(self._matrix, design, rcond=None)[0], 0.0, 1.0))

    def cost(self, x: Floats) -> float:
        """Compute the negative of the score of variables (m,), which are clipped to the box."""
        design = np.clip(x, 0.0, 1.0)
        if self._matrix is not None:
            design = np.clip(self._matrix @ design, 0.0, 1.0)
        return -float(self._evaluator.evaluate(design).score)
