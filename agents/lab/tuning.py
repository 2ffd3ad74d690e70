"""Presets found, not guessed: a search over the hyperparameters of an algorithm, with Optuna.

    python -m agents.lab.tuning sprint --algorithm ars --trials 50 --seconds 30

trains for some seconds with each choice (processor time, so that what else the machine does falls
out), gives up early on what lags behind the median, and prints the best as a `Preset`.  All trials
are kept in a file, from which the same command goes on.  Needs the extra "rl".
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from agents.sb3.presets import ALGORITHMS, Preset, preset
from domino_env import Scene, load_scene
from optimize.evaluation.budget import Budget
from optimize.evaluation.recorder import Recorder
from optimize.problem import Problem

REPORTS = 10  # reports of a trial to the pruner
PATIENCE = 4  # trials before any is given up


def choose(trial: Any, algorithm: str, episode: int) -> Preset:
    """Suggest a preset for a trial.

    Parameters
    ----------
    trial
        Of Optuna, or anything that suggests likewise.
    algorithm
        One of `ALGORITHMS`.
    episode
        Steps of an episode.
    """
    plan = preset(algorithm, episode)
    if algorithm == "ars":
        deltas = trial.suggest_int("n_delta", 2, 64, log=True)
        top = trial.suggest_float("top_part", 0.2, 1.0)
        options = plan.options | {
            "n_delta": deltas,
            "n_top": max(round(top * deltas), 1),
            "delta_std": trial.suggest_float("delta_std", 0.005, 0.3, log=True),
        }
        return replace(
            plan,
            rows=2 * deltas,
            rate=trial.suggest_float("rate", 0.003, 0.3, log=True),
            last_rate=trial.suggest_float("last_rate", 0.01, 1.0, log=True),
            options=options,
        )
    rate = trial.suggest_float("rate", 2e-4, 5e-2, log=True)
    width = trial.suggest_categorical("width", [32, 64, 128])
    last = trial.suggest_float("last_deviation", 0.001, 0.05, log=True)
    plan = replace(plan, rate=rate, width=width, last_deviation=last)
    if algorithm == "apg":
        first = trial.suggest_float("first_deviation", 0.05, 1.0, log=True)
        middle = trial.suggest_float("middle_deviation", 0.01, 0.2, log=True)
        rows = trial.suggest_categorical("rows", [8, 16, 32])
        return replace(plan, rows=rows, first_deviation=first, middle_deviation=middle)
    options = plan.options | {
        "n_epochs": trial.suggest_int("n_epochs", 3, 12),
        "gae_lambda": trial.suggest_float("gae_lambda", 0.9, 1.0),
        "clip_range": trial.suggest_float("clip_range", 0.1, 0.3),
    }
    return replace(plan, options=options)


def train_for(
    scene: Scene,
    algorithm: str,
    plan: Preset,
    seconds: float,
    seed: int,
    callback: Callable[[Budget], None] | None = None,
) -> float:
    """Train for so many seconds of processor time, and give the best score.

    Parameters
    ----------
    scene
        What is built.
    algorithm, plan
        What is trained, and its preset.
    seconds
        Processor time [s].
    seed
        Of all randomness.
    callback
        Called with the budget along the way.
    """
    from agents.methods.learners import learn

    problem = Problem(scene)
    scene.uniform()
    recorder = Recorder(problem, clock=time.process_time)
    budget = Budget(recorder, None, seconds, callback)
    learn(algorithm, budget, np.random.default_rng(seed), plan)
    return budget.best_score


def tune(
    scene: Scene, algorithm: str, trials: int, seconds: float, storage: Path, seed: int = 0
) -> tuple[Preset, float, int]:
    """Search the preset of an algorithm.

    Parameters
    ----------
    scene
        What is built.
    algorithm
        One of `ALGORITHMS`.
    trials
        How many more to make.
    seconds
        Processor time of each [s].
    storage
        SQLite file with all trials; it goes on with those of one that is there.
    seed
        Of the trials.

    Returns
    -------
    best : Preset
        The best found.
    score : float
        Its score.
    number : int
        Trials there have been.

    Raises
    ------
    ValueError
        For an unknown algorithm, and for no trials or time.
    """
    if algorithm not in ALGORITHMS:
        raise ValueError(f"there is no algorithm '{algorithm}': choose {', '.join(ALGORITHMS)}")
    if trials < 1 or not seconds > 0.0:
        raise ValueError(f"trials = {trials}, seconds = {seconds}: give more than 0 of both")
    from agents.base.requirements import require_learning

    require_learning("optuna")
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    storage.parent.mkdir(parents=True, exist_ok=True)
    name = f"{scene.name}, {algorithm}, {seconds:g} s"
    where = f"sqlite:///{storage}"
    study = optuna.create_study(
        storage=where, study_name=name, direction="maximize", load_if_exists=True
    )
    before = len(study.trials)
    study.sampler = optuna.samplers.TPESampler(seed=seed + before, multivariate=False)
    study.pruner = optuna.pruners.MedianPruner(PATIENCE, n_warmup_steps=2)

    def objective(trial: Any) -> float:
        plan = choose(trial, algorithm, scene.count - 1)
        reported = 0

        def report(budget: Budget) -> None:
            nonlocal reported
            at = int(budget.part * REPORTS)
            if at > reported:
                reported = at
                trial.report(budget.best_score, at)
                if trial.should_prune():
                    raise optuna.TrialPruned

        score = train_for(scene, algorithm, plan, seconds, seed + trial.number, report)
        print(f"trial {trial.number}: {score:.6f} {trial.params}", flush=True)
        return score

    study.optimize(objective, n_trials=trials)
    best = study.best_trial
    plan = choose(optuna.trial.FixedTrial(best.params), algorithm, scene.count - 1)
    return plan, float(best.value or 0.0), len(study.trials)


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__,
        prog="python -m agents.lab.tuning",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("scene", metavar="SCENE", nargs="?", default="sprint")
    parser.add_argument("--algorithm", default="ppo", help=", ".join(ALGORITHMS))
    parser.add_argument("--trials", type=int, default=50, help="more trials (%(default)s)")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each (%(default)s)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--storage", type=Path, default=Path("runs/tuning.db"), help="%(default)s")
    given = parser.parse_args()
    scene = load_scene(given.scene)
    plan, score, trials = tune(
        scene, given.algorithm, given.trials, given.seconds, given.storage, given.seed
    )
    print(f"\n{score:.6f} after {given.seconds:g} s of processor time, {trials} trials:\n{plan}")


if __name__ == "__main__":
    main()
