"""CMA-ES with restarts (BIPOP), by the package cma.

A run starts at the uniform baseline with a wide step: on the shipped scenes this ends in a good
basin more often than a small step, a start in the middle of the box, or a random one. Restarts
alternate between populations that double and small ones, some of which start elsewhere; both kinds
get about the same number of evaluations.

References
----------
Hansen, N. (2016). The CMA evolution strategy: a tutorial. arXiv:1604.00772.

Hansen, N. (2009). Benchmarking a BI-population CMA-ES on the BBOB-2009 function testbed. GECCO
Companion, 2389-2396.
"""

from __future__ import annotations

import warnings
from typing import Any

import cma
import numpy as np

from domino_env.core.types import Floats
from optimize.evaluator import Evaluator
from optimize.methods.starts import uniform_design

# Lengths are relative to the box.
FIRST_STEP = 0.3  # standard deviation of the first steps
MAX_FULL = 200  # variables above which the covariance matrix is diagonal
FIRST_STEP_OF_MANY = 0.003  # the same above MAX_FULL, where wide steps would not converge
POPULATION_FACTOR = 2  # first population, over the usual one: more runs end in a good basin
MAX_GROWTH = 64  # largest population, over the first
MAX_NARROWING = 1.5  # decimal orders by which the first step of a small run may be narrower
MARGIN = 0.02  # least distance of a start to the faces of the box
# With a given length many design vectors stand for the same layout. Without a penalty on the
# distance to the one that is projected on itself, the search drifts among them.
PENALTY_FACTOR = 100.0  # penalty over the mean square distance and the score of the baseline


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Run one CMA-ES after the other until a limit is reached."""
    problem = evaluator.problem
    n = problem.dimension
    start = uniform_design(problem)
    first_step = FIRST_STEP_OF_MANY if n > MAX_FULL else FIRST_STEP
    size = default = POPULATION_FACTOR * (4 + int(3 * np.log(n)))
    counts = {"doubling": 0, "small": 0}  # evaluations
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="cma")  # about steps that pycma then limits
        while True:
            if counts["doubling"] <= counts["small"]:
                counts["doubling"] += _run_once(evaluator, rng, start, first_step, size)
                size = min(2 * size, MAX_GROWTH * default)
            elif rng.random() < 0.5:
                counts["small"] += _run_once(evaluator, rng, start, first_step, default)
            else:
                centre = evaluator.best if rng.random() < 0.5 else rng.random(n)
                step = first_step * 10.0 ** (-MAX_NARROWING * rng.random())
                counts["small"] += _run_once(evaluator, rng, centre, step, default)


def _run_once(
    evaluator: Evaluator, rng: np.random.Generator, start: Floats, step: float, size: int
) -> int:
    """Run one CMA-ES until convergence; return the number of its evaluations."""
    problem, n = evaluator.problem, len(start)
    start_evaluations = evaluator.evaluations
    centre = np.full(max(n, 2), 0.5)  # pycma needs two variables; with n = 1 one has no effect
    centre[:n] = np.clip(start, MARGIN, 1.0 - MARGIN)
    strategy = cma.CMAEvolutionStrategy(centre, step, cma_options(rng, n, size))
    penalty = PENALTY_FACTOR * abs(problem.scene.uniform().score)
    while not strategy.stop():
        points = strategy.ask()
        designs = np.array(points)[:, :n]
        costs = -evaluator.evaluate(designs).score
        if problem.equality is not None:
            costs += penalty * np.mean((designs - problem.project(designs)) ** 2, axis=1)
        strategy.tell(points, costs)
    return evaluator.evaluations - start_evaluations


def cma_options(rng: np.random.Generator, n: int, size: int) -> dict[str, Any]:
    """Return options of pycma for variables between 0 and 1.

    Parameters
    ----------
    rng
        Source of all randomness.
    n
        Number of variables.
    size
        Number of points of a generation.

    Returns
    -------
    dict
        Options of `cma.CMAEvolutionStrategy`.
    """
    return {
        "bounds": [0.0, 1.0],
        "popsize": size,
        "CMA_diagonal": n > MAX_FULL,
        # with nan, pycma does not seed NumPy's global generator; all its draws come from `rng`
        "seed": np.nan,
        "randn": lambda *shape: rng.standard_normal(shape),
        # tolerances of score and variables: a restart can gain far more than what remains
        "tolfun": 1e-6,
        "tolfunhist": 1e-6,
        "tolx": 1e-5,
        "maxiter": np.inf,
        "verbose": -10,  # no output; at -9 it would still read a file in the working directory
        "verb_log": 0,
    }
