"""Search methods that train a policy from scratch, with the budget and clock of a search.

They are registered in the entry-point group `domino.methods`. Each layout that is built in training
is an evaluation, and so is each that is built without noise at regular intervals. The import of
this module imports torch, before the clock of a search starts, and raises ImportError with the
command that installs it if the extra "rl" is missing.

References
----------
Freeman, C. D., et al. (2021). Brax: a differentiable physics engine for large scale rigid body
simulation. NeurIPS Datasets and Benchmarks. arXiv:2106.13281 (`apg`).
Schulman, J., et al. (2017). Proximal policy optimization algorithms. arXiv:1707.06347 (`ppo`).
Mania, H., Guy, A., Recht, B. (2018). Simple random search provides a competitive approach to
reinforcement learning. arXiv:1803.07055 (`ars`).
"""

from __future__ import annotations

from contextlib import suppress
from functools import partial
from typing import Any

import numpy as np

from agents.algorithms import Hyperparameters, default_hyperparameters, require_learning

require_learning()

from agents.rollout import build, complete_layout  # noqa: E402
from agents.sb3 import Learner  # noqa: E402
from domino_env.core.types import Floats, Ints  # noqa: E402
from domino_env.physics.wave import Outcome  # noqa: E402
from domino_env.scenes.objectives import Scores  # noqa: E402
from optimize.evaluator import BudgetSpent, Evaluator  # noqa: E402

NOISELESS_LAYOUTS = 50  # largest number of layouts built without noise while a policy is trained
LEAST_LAYOUTS = 8  # least number of layouts per environment within a budget of evaluations


def learn(algorithm: str, evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Train until the budget is spent.

    The result is bitwise reproducible under a budget of evaluations. As layouts are built together,
    training ends when fewer evaluations remain than there are environments.

    Parameters
    ----------
    algorithm
        One of `agents.algorithms.ALGORITHMS`.
    evaluator
        Evaluator of the search.
    rng
        Source of all randomness.
    """
    scene = evaluator.problem.scene
    hyperparameters = _fit_to_budget(default_hyperparameters(algorithm, scene), evaluator)
    seed = int(rng.integers(2**31))
    _LearningSearch(Learner(scene, algorithm, hyperparameters, seed), evaluator).run()


def _fit_to_budget(defaults: Hyperparameters, evaluator: Evaluator) -> Hyperparameters:
    """Return hyperparameters with fewer environments if the budget of evaluations is small."""
    if evaluator.max_evaluations is None:
        return defaults
    num_envs = int(min(defaults.num_envs, max(evaluator.max_evaluations // LEAST_LAYOUTS, 1)))
    options = dict(defaults.options)
    if "n_steps" in options:  # same number of minibatches; PPO needs 2 transitions in each
        options["batch_size"] = max(options["batch_size"] * num_envs // defaults.num_envs, 2)
    if "n_delta" in options:  # ARS evaluates each direction in two environments
        options["n_delta"] = max(min(options["n_delta"], num_envs // 2), 1)
        options["n_top"] = min(options["n_top"], options["n_delta"])
    return defaults.replace(num_envs=num_envs, options=options)


apg = partial(learn, "apg")
ppo = partial(learn, "ppo")
ars = partial(learn, "ars")


class _LearningSearch:
    """Training of a learner within the budget of a search."""

    def __init__(self, learner: Learner, evaluator: Evaluator) -> None:
        self.learner, self.num_envs = learner, learner.hyperparameters.num_envs
        self.evaluator, self.problem = evaluator, evaluator.problem
        self.next_evaluation = 0.0  # fraction of the budget

    def run(self) -> None:
        """Train until the budget is spent, then evaluate the policy if an evaluation remains."""
        model = self.learner.model
        # schedules follow the fraction of the budget that is spent, not the number of steps
        model._update_current_progress_remaining = self._update_progress
        if optimizer := getattr(model.policy, "optimizer", None):  # ARS has none
            optimizer.register_step_pre_hook(lambda *_: self.evaluator.require_more())
        with suppress(BudgetSpent):
            # a number of steps that no search reaches: the budget ends the training
            self.learner.learn(10**12, self.between_updates, self.after_step)
        self._evaluate()

    def _update_progress(self, steps: int, total: int) -> None:
        """Replace the method of Stable-Baselines3, whose arguments are not used."""
        self.learner.model._current_progress_remaining = 1.0 - self.evaluator.progress

    def between_updates(self) -> None:
        """Evaluate the policy if due, and update the standard deviation of the actions."""
        due = self.evaluator.progress >= self.next_evaluation
        if due and self.evaluator.remaining > self.num_envs:
            self._evaluate()
            self.next_evaluation += 1.0 / NOISELESS_LAYOUTS
        self.learner.update_deviation(self.evaluator.progress)

    def after_step(self, infos: Any) -> None:
        """Record the layouts that are complete; raise BudgetSpent if too few evaluations remain."""
        if complete := [info for info in infos if "score" in info]:
            scores = np.array([info["score"] for info in complete])
            reach = np.array([_reach(info) for info in complete])
            self._record([info["layout"] for info in complete], scores, reach)
            if self.evaluator.remaining < self.num_envs:
                raise BudgetSpent
        self.evaluator.require_more()

    def _evaluate(self) -> None:
        """Evaluate a layout that is built without noise, if an evaluation remains."""
        if self.evaluator.remaining >= 1:
            rollout = build(self.learner.policy(), self.problem.scene)
            score, reach = np.array([rollout.score]), np.array([rollout.wave.reach])
            self._record([rollout.layout], score, reach)

    def _record(self, layouts: Any, scores: Floats, reach: Floats) -> None:
        """Record layouts with scores (B,) and fractions of the chain that waves reach (B,)."""
        dominoes = self.problem.dominoes  # simulated for one score if the wave completes
        falls: Ints = np.ceil(reach * dominoes).astype(np.int64)

        def design(i: int) -> Floats:
            return self.problem.design(complete_layout(layouts[i], self.problem.scene))

        self.evaluator.record(Scores(scores, reach, falls), design)


def _reach(info: dict[str, Any]) -> float:
    """Return the fraction of the chain that the wave reaches, 0 to 1."""
    if "reach" in info:
        return float(info["reach"])
    return 1.0 if info["outcome"] == Outcome.PROPAGATED else float(info["wave"].reach)
