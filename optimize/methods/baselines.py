"""Methods for comparison: random layouts, the uniform baseline, `ngopt` and `tpe`."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from optimize.evaluator import Evaluator
from optimize.methods.starts import uniform_design

BUDGET = 20_000  # evaluations that NGOpt assumes if there is no limit of evaluations
FIRST_DEVIATION = 0.2  # standard deviation of the first steps of NGOpt, relative to the box


def random(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Evaluate layouts drawn at random, uniformly from the whole box."""
    while True:
        evaluator.evaluate(rng.random((evaluator.batch_size, evaluator.problem.dimension)))


def uniform(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Evaluate the uniform baseline once, the best layout with equal gaps."""
    evaluator.evaluate(uniform_design(evaluator.problem))


def ngopt(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Run NGOpt (Meunier et al. 2021), by which Nevergrad selects one of its methods.

    References
    ----------
    Meunier, L., et al. (2021). Black-box optimization revisited: improving algorithm selection
    wizards through massive benchmarking. arXiv:2010.04542.
    """
    seed = int(rng.integers(2**31))
    with warnings.catch_warnings(), _seeded_globally(seed):
        warnings.simplefilter("ignore")
        import nevergrad  # which draws numbers itself

        array = nevergrad.p.Array(init=uniform_design(evaluator.problem))
        array = array.set_mutation(sigma=FIRST_DEVIATION).set_bounds(0.0, 1.0)
        array.random_state = np.random.RandomState(seed)
        optimizer = nevergrad.optimizers.NGOpt(array, budget=evaluator.max_evaluations or BUDGET)
        while True:
            candidate = optimizer.ask()
            optimizer.tell(candidate, -evaluator.evaluate(candidate.value).score)


@contextmanager
def _seeded_globally(seed: int) -> Iterator[None]:
    """Seed NumPy's global generator, which parts of Nevergrad use; restore its state at the end."""
    state = np.random.get_state()  # noqa: NPY002
    np.random.seed(seed)  # noqa: NPY002
    try:
        yield
    finally:
        np.random.set_state(state)  # noqa: NPY002


def tpe(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Run tree-structured Parzen estimators (Bergstra et al. 2011), the default of Optuna.

    References
    ----------
    Bergstra, J., Bardenet, R., Bengio, Y., Kégl, B. (2011). Algorithms for hyper-parameter
    optimization. Advances in Neural Information Processing Systems 24.
    """
    import optuna

    problem = evaluator.problem
    names = [f"x{i:04d}" for i in range(problem.dimension)]
    space: dict[str, Any] = dict.fromkeys(names, optuna.distributions.FloatDistribution(0.0, 1.0))
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler = optuna.samplers.TPESampler(seed=int(rng.integers(2**31)))
    study = optuna.create_study(direction="maximize", sampler=sampler)
    study.enqueue_trial(dict(zip(names, uniform_design(problem).tolist(), strict=True)))
    while True:
        trial = study.ask(space)
        design = np.array([trial.params[name] for name in names])
        study.tell(trial, evaluator.evaluate(design).score)
