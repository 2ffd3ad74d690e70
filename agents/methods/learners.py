"""Learners as methods of `optimize`: what they build counts, on the same clock.

Named in the entry-point group `domino.methods`. A learner begins anew in each search; every row it
builds while it learns is an evaluation, and so is the one it builds without noise now and then.
Loading this takes the seconds that torch takes to load, before the clock of a search begins, and
raises ImportError, with what to install, where the extra "rl" is missing.
"""

from __future__ import annotations

import warnings
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.base.requirements import require_learning

require_learning()

from stable_baselines3.common.callbacks import BaseCallback  # noqa: E402
from stable_baselines3.common.logger import Logger  # noqa: E402

from agents.base.building import build, completed  # noqa: E402
from agents.base.random_state import random_state_restored  # noqa: E402
from agents.sb3.learner import learner, policy_of, set_deviation  # noqa: E402
from agents.sb3.presets import Preset, preset  # noqa: E402
from agents.sb3.vec_env import DominoVecEnv  # noqa: E402
from domino_env.physics.wave import Outcome  # noqa: E402
from domino_env.scenes.objectives import Evaluation  # noqa: E402
from optimize.evaluator import Budget, BudgetSpent  # noqa: E402

EVALUATIONS = 50  # rows built without noise in a whole search
GENERATIONS = 8  # generations of rows that a budget of evaluations is to last for


def apg(budget: Budget, rng: np.random.Generator) -> None:
    """Search with analytic policy gradients.

    References
    ----------
    Freeman, C. D., et al. (2021). Brax: a differentiable physics engine for large scale rigid body
    simulation. NeurIPS Datasets and Benchmarks. arXiv:2106.13281.
    """
    learn("apg", budget, rng)


def ppo(budget: Budget, rng: np.random.Generator) -> None:
    """Search with proximal policy optimisation.

    References
    ----------
    Schulman, J., et al. (2017). Proximal policy optimization algorithms. arXiv:1707.06347.
    """
    learn("ppo", budget, rng)


def ars(budget: Budget, rng: np.random.Generator) -> None:
    """Search with augmented random search over linear policies.

    References
    ----------
    Mania, H., Guy, A., Recht, B. (2018). Simple random search provides a competitive approach to
    reinforcement learning. arXiv:1803.07055.
    """
    learn("ars", budget, rng)


def learn(
    algorithm: str, budget: Budget, rng: np.random.Generator, plan: Preset | None = None
) -> None:
    """Train until the budget is spent.

    Repeatable to the bit under a budget of evaluations. Rows are built side by side, and all that
    are under way could still be paid for; a rest smaller than that is left.

    Parameters
    ----------
    algorithm
        One of `agents.sb3.presets.ALGORITHMS`.
    budget
        Of the search.
    rng
        Of all randomness.
    plan
        Hyperparameters; None for the algorithm's preset.
    """
    plan = plan or preset(algorithm, budget.problem.scene.count - 1)
    with random_state_restored(), warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about batches that do not divide evenly
        warnings.simplefilter("ignore", DeprecationWarning)
        _Learning(algorithm, _within(plan, budget), budget, int(rng.integers(2**31))).run()


def _within(plan: Preset, budget: Budget) -> Preset:
    """Fewer rows side by side where a budget of evaluations would not last."""
    if budget.evaluations is None:
        return plan
    rows = int(min(plan.rows, max(budget.evaluations // GENERATIONS, 1)))
    options = dict(plan.options)
    if "n_steps" in options:  # batches of the same part of a rollout
        options["batch_size"] = max(options["batch_size"] * rows // plan.rows, 2)
    if "n_delta" in options:  # of ARS: two rows each
        options["n_delta"] = max(min(options["n_delta"], rows // 2), 1)
        options["n_top"] = min(options["n_top"], options["n_delta"])
    return replace(plan, rows=rows, options=options)


class _Learning:
    """One learner while it learns."""

    def __init__(self, algorithm: str, plan: Preset, budget: Budget, seed: int) -> None:
        self.algorithm, self.plan, self.budget = algorithm, plan, budget
        self.scene = budget.problem.scene
        self.env = DominoVecEnv(self.scene, plan.rows)
        self.model: Any = learner(algorithm, plan, self.env, seed)
        self.next_evaluation = 0.0

    def run(self) -> None:
        """Learn; what the policy builds in the end is evaluated if that can be paid for."""
        self.model.set_logger(Logger(folder=None, output_formats=[]))
        model = self.model
        # all schedules follow what is spent of the budget, not the steps taken
        model._update_current_progress_remaining = self._progress
        optimizer = getattr(model.policy, "optimizer", None)  # ARS has none
        if optimizer is not None:
            optimizer.register_step_pre_hook(lambda *_: self._check_the_clock())
        with suppress(BudgetSpent):
            model.learn(10**12, callback=self._callback(), reset_num_timesteps=False)
        self._evaluate()

    def _progress(self, steps: int, total: int) -> None:
        self.model._current_progress_remaining = 1.0 - self.budget.part

    def _check_the_clock(self) -> None:
        self.budget.require_more()

    def _adapt(self) -> None:
        set_deviation(self.model, self.plan.deviation(self.budget.part))
        if self.plan.follow:
            self.env.follow(self.budget.best_score)

    def _evaluate(self) -> None:
        """A row without noise."""
        if self.budget.left < 1:
            return
        built = build(policy_of(self.model), self.scene, float(self.env.rows.reference_speed))
        self._note([built.layout], np.array([built.score]), np.array([built.wave.reach]))

    def _note(self, layouts: Any, scores: NDArray[np.float64], reach: NDArray[np.float64]) -> None:
        dominoes = self.budget.problem.dominoes  # of all the rows that a score takes, at most
        falls = np.ceil(reach * dominoes).astype(np.int64)

        def design(i: int) -> NDArray[np.float64]:
            return self.budget.problem.design(completed(layouts[i], self.scene))

        self.budget.note(Evaluation(scores, reach, falls), design)

    def _callback(self) -> Any:
        learning = self

        class Callback(BaseCallback):
            def _on_rollout_start(self) -> None:
                learning.between_updates()

            def _on_step(self) -> bool:
                learning.after_step(self.locals["infos"])
                return True

        return Callback()

    def between_updates(self) -> None:
        """Between two updates: evaluate now and then, and adapt."""
        if self.budget.part >= self.next_evaluation and self.budget.left > self.plan.rows:
            self._evaluate()
            self.next_evaluation += 1.0 / EVALUATIONS
        self._adapt()

    def after_step(self, infos: Any) -> None:
        """Count the rows that are complete; stop where those to come could not be paid for."""
        ended = [info for info in infos if "score" in info]
        if ended:
            scores = np.array([info["score"] for info in ended])
            reach = np.array([_reach(info) for info in ended])
            self._note([info["layout"] for info in ended], scores, reach)
            if self.budget.left < self.plan.rows:
                raise BudgetSpent
        self._check_the_clock()


def _reach(info: dict[str, Any]) -> float:
    """How far the wave of a row came: told, or looked up where it died."""
    if "reach" in info:
        return float(info["reach"])
    return 1.0 if info["outcome"] == Outcome.PROPAGATED else float(info["wave"].reach)
