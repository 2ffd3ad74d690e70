"""Tree-structured Parzen estimators (Bergstra et al. 2011), Optuna's default: an optional peer.

References
----------
Bergstra, J., Bardenet, R., Bengio, Y., Kégl, B. (2011). Algorithms for hyper-parameter
optimization. Advances in Neural Information Processing Systems 24.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import optuna

from optimize.evaluator import Budget


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Ask and tell until the budget is spent."""
    problem = budget.problem
    names = [f"x{i:04d}" for i in range(problem.dimension)]
    space: dict[str, Any] = {
        name: optuna.distributions.FloatDistribution(0.0, 1.0) for name in names
    }
    before = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    try:
        sampler = optuna.samplers.TPESampler(seed=int(rng.integers(2**31)))
        study = optuna.create_study(direction="maximize", sampler=sampler)
        mark = problem.design(problem.scene.uniform().layout)
        study.enqueue_trial(dict(zip(names, mark.tolist(), strict=True)))
        while True:
            trial = study.ask(space)
            design = np.array([trial.params[name] for name in names])
            study.tell(trial, budget.score(design))
    finally:
        optuna.logging.set_verbosity(before)
