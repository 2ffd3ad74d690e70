"""NGOpt (Meunier et al. 2021), Nevergrad's own choice among its many methods: an optional peer.

References
----------
Meunier, L., et al. (2021). Black-box optimization revisited: improving algorithm selection wizards
through massive benchmarking. arXiv:2010.04542.
"""

from __future__ import annotations

import warnings

import nevergrad
import numpy as np

from optimize.evaluator import Budget

PLANNED = 20_000  # evaluations that it plans for where the budget does not say


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Ask and tell, batch by batch, until the budget is spent."""
    problem = budget.problem
    start = problem.design(problem.scene.uniform().layout)
    # a wide first step, which is one of the things that NGOpt does not choose itself
    array = nevergrad.p.Array(init=start).set_mutation(sigma=0.2).set_bounds(0.0, 1.0)
    array.random_state = np.random.RandomState(int(rng.integers(2**31)))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        peer = nevergrad.optimizers.NGOpt(array, budget=budget.evaluations or PLANNED)
        while True:
            candidate = peer.ask()
            peer.tell(candidate, -budget.score(candidate.value))
