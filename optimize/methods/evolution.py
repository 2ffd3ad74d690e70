"""CMA-ES with restarts (Hansen 2016, arXiv 1604.00772; BIPOP: Hansen 2009), on ask and tell.

The first run starts at the best uniform layout with a step as wide as the box, which on the scenes
here finds better basins than a careful start.  Later runs alternate between ever larger populations
from anywhere and small ones from there again or around the best, each kind given about the same
number of evaluations.
"""

from __future__ import annotations

from typing import Any

import cma
import numpy as np
from threadpoolctl import threadpool_limits

from optimize.budget import Budget
from optimize.problem import Floats

WIDE = 0.3  # first step, as a part of the box
MANY = 200  # variables from which on the covariance is kept diagonal


def run(budget: Budget, rng: np.random.Generator) -> None:
    """One CMA-ES after the other until the budget is spent."""
    # The covariance is small: threads of the linear algebra only wait for each other.
    with threadpool_limits(1, user_api="blas"):
        _restart(budget, rng)


def _restart(budget: Budget, rng: np.random.Generator) -> None:
    problem = budget.problem
    n = problem.dimension
    default = 2 * (4 + int(3 * np.log(n)))  # twice the usual: more often a good basin
    start = problem.design(problem.scene.uniform().layout)
    used = {"large": 0, "small": 0}
    used["large"] += _descend(budget, rng, start, WIDE, default)
    doubled = 1
    while True:
        if used["large"] <= used["small"]:
            size = default * 2 ** min(doubled, 6)
            doubled += 1
            used["large"] += _descend(budget, rng, rng.random(n), WIDE, size)
        else:
            # from the uniform row again, or close around the best so far
            wide = rng.random() < 0.7
            step = WIDE if wide else WIDE * 10.0 ** (-1.5 * rng.random())
            near = start if wide else budget.best
            used["small"] += _descend(budget, rng, near, step, default)


def _descend(
    budget: Budget, rng: np.random.Generator, start: Floats, step: float, size: int
) -> int:
    """One run until it has converged; returns its evaluations."""
    before, n = budget.problem.evaluations, len(start)
    centre = np.full(max(n, 2), 0.5)  # pycma wants two variables; the second may be idle
    centre[:n] = np.clip(start, 0.02, 0.98)
    strategy = cma.CMAEvolutionStrategy(centre, step, _options(rng, n, size))
    while not strategy.stop():
        designs = strategy.ask()
        strategy.tell(designs, -budget.scores(np.array(designs)[:, :n]))
    return budget.problem.evaluations - before


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
