"""CMA-ES with restarts (BIPOP), on ask and tell.

A run starts at the best uniform layout with a step as wide as the box: on the scenes here that ends
in a good basin more often than a careful start, one in the middle of the box, or one from anywhere.
Restarts alternate between populations that double and small ones, some of which start elsewhere,
each kind given about the same number of evaluations.

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

from optimize.evaluator import Budget
from optimize.variables import Floats

WIDE = 0.3  # first step, as a part of the box
MANY = 200  # variables from which on the covariance is kept diagonal
CAREFUL = 0.003  # first step for so many: a wide one would never end
# Many designs stand for the same layout where a length is asked.  Without a price on the distance
# to that layout the search loses itself among them.
ASTRAY = 100.0  # price of the mean square distance, over the score


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Run one CMA-ES after the other until the budget is spent."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="cma")  # of steps that it then limits itself
        _restart(budget, rng)


def _restart(budget: Budget, rng: np.random.Generator) -> None:
    problem = budget.problem
    n = problem.dimension
    default = 2 * (4 + int(3 * np.log(n)))  # twice the usual: more often a good basin
    start = problem.design(problem.scene.uniform().layout)
    wide = CAREFUL if n > MANY else WIDE
    used = {"doubling": 0, "small": 0}
    size = default
    while True:
        if used["doubling"] <= used["small"]:
            used["doubling"] += _descend(budget, rng, start, wide, size)
            size = min(2 * size, 64 * default)
        elif rng.random() < 0.5:
            used["small"] += _descend(budget, rng, start, wide, default)
        else:
            near = budget.best if rng.random() < 0.5 else rng.random(n)
            step = wide * 10.0 ** (-1.5 * rng.random())
            used["small"] += _descend(budget, rng, near, step, default)


def _descend(
    budget: Budget, rng: np.random.Generator, start: Floats, step: float, size: int
) -> int:
    """One run until it has converged; returns its evaluations."""
    problem, n = budget.problem, len(start)
    before = budget.spent
    centre = np.full(max(n, 2), 0.5)  # pycma wants two variables; the second may be idle
    centre[:n] = np.clip(start, 0.02, 0.98)
    strategy = cma.CMAEvolutionStrategy(centre, step, _options(rng, n, size))
    price = ASTRAY * abs(problem.scene.uniform().score)
    while not strategy.stop():
        proposed = strategy.ask()
        designs = np.array(proposed)[:, :n]
        costs = -budget.scores(designs)
        if problem.equality is not None or problem.linear is not None:
            costs += price * np.mean((designs - problem.project(designs)) ** 2, axis=1)
        strategy.tell(proposed, costs)
    return budget.spent - before


def _options(rng: np.random.Generator, n: int, size: int) -> dict[str, Any]:
    return {
        "bounds": [0.0, 1.0],
        "popsize": size,
        "CMA_diagonal": n > MANY,
        # nan keeps pycma from seeding numpy's global stream; all its draws come from ours
        "seed": np.nan,
        "randn": lambda *shape: rng.standard_normal(shape),
        "tolfun": 1e-6,
        "tolfunhist": 1e-6,  # what a restart can gain is far more
        "tolx": 1e-5,
        "maxiter": np.inf,
        "verbose": -10,  # at -9 it would still obey a file in the working directory
        "verb_log": 0,
    }
