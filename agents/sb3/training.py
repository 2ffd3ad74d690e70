"""Trainings in progress."""

from __future__ import annotations

import io
import json
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents import policy as files
from agents.evaluation import choose_scenes, evaluate_gains
from agents.network import build_actor
from agents.rollout import SELECTION_SEEDS, Rollout, build, is_random
from agents.sb3.checkpoints import model_state, read_checkpoint, restore
from agents.sb3.factory import make_model, weights
from agents.sb3.scheduled import ScheduledPolicy
from domino_env import Scene, SceneDistribution
from domino_env.core.files import write_bytes, write_text
from domino_env.core.models import plain
from domino_env.core.progress import leave_out, notice, progress_bar
from domino_env.core.results import revision, versions
from domino_env.core.tables import write_csv
from domino_env.core.types import Floats
from domino_env.scenes.pool import ScenePool

COLUMNS = (
    "steps", "seconds", "score", "best_score", "processor_seconds", "test_score", "simulations",
)  # fmt: skip
EVALUATIONS = 200  # number of evaluations in a training, each with a checkpoint
POOL_SCENES = 50  # number of training scenes in which evaluations score a policy


def clocks() -> Floats:
    """Return the wall-clock time and the processor time (2,) [s]."""
    return np.array([time.perf_counter(), time.process_time()])


@dataclass(eq=False)
class Training(BaseCallback):
    """Training in progress; a step places one domino.

    Parameters
    ----------
    target
        Scene or scene distribution.
    config
        Arguments of the training.
    folder, progress
        See `train`.
    """

    target: Scene | SceneDistribution
    config: files.ConfigDocument
    folder: Path
    progress: bool | None

    def __post_init__(self) -> None:
        super().__init__()
        # scenes of evaluations and of the test set; none if the target is a single scene
        self.scenes: list[Scene] = []
        self.tests: list[Scene] = []
        self.simulations = 0
        if isinstance(self.target, SceneDistribution):
            pool = ScenePool(self.target, self.config.num_scenes)
            numbers = range(len(pool))[: -POOL_SCENES - 1 : -1]  # the last ones, in reverse order
            self.scenes = [pool.scene(number) for number in numbers]
            with suppress(ValueError):  # raised if the distribution has no test set
                self.tests = choose_scenes(self.target)
        self.curve: list[tuple[float, ...]] = []
        self.best = self.test_score = -np.inf
        self.next_evaluation = 0  # steps
        self.start = clocks()  # earlier if a training is resumed
        self.total = self.config.steps
        self.bar = progress_bar(self.progress, total=self.total, unit=" dominoes", unit_scale=True)

    def run(self, resume: bool) -> bool:
        """Train from the beginning, or from the checkpoint in the folder.

        Return True if the training was interrupted. Ctrl-C does not write a checkpoint, as an
        unfinished update cannot be resumed.

        Raises
        ------
        ValueError
            If the weights are not finite any more.
        """
        if resume and (self.folder / files.CHECKPOINT).exists():
            self._resume()
        else:
            if resume:
                notice(f"{self.folder} has no {files.CHECKPOINT}: the training begins again")
            self._make_model(self.config.seed)
            # first what makes the folder that of a training, which can be resumed
            self.write_json(files.CONFIG, **plain(self.config), versions=versions())
            write_text(self.folder / files.SCENE, self.target.to_toml())
        interrupted = False
        try:
            remaining = self.total - self.model.num_timesteps
            self.model.learn(remaining, callback=self, reset_num_timesteps=False)
        except KeyboardInterrupt:
            interrupted = True
        except (ValueError, RuntimeError):  # of torch or of an environment, for nan
            self._require_finite()
            raise
        is_evaluated = bool(self.curve) and self.curve[-1][0] == self.model.num_timesteps
        if not self.curve or not (interrupted or is_evaluated):
            self.evaluate()
        if interrupted:
            self._write_curve()
        else:
            self.write_checkpoint()
        self.bar.close()
        self.elapsed = clocks() - self.start
        return interrupted

    def _require_finite(self) -> None:
        """Write the learning curve and raise ValueError if weights are not finite."""
        if not all(np.isfinite(array).all() for array in weights(self.model.policy).values()):
            self.bar.close()
            self._write_curve()
            raise ValueError(
                f"{self.config.algorithm}, seed {self.config.seed}: the weights are not finite "
                f"after {self.model.num_timesteps} steps: train with a smaller learning_rate or "
                f"another seed; {self.folder} has the best policy until then"
            )

    def _make_model(self, seed: int) -> None:
        config = self.config
        self.model = make_model(
            self.target, config.algorithm, config.hyperparameters, seed, config.num_scenes
        )

    def write_json(self, name: str, **document: Any) -> None:
        """Write a JSON file into the folder."""
        write_text(self.folder / name, json.dumps(document, indent=1) + "\n")

    def _resume(self) -> None:
        """Continue in the state of the checkpoint, with other random numbers."""
        path = self.folder / files.CHECKPOINT
        state = read_checkpoint(path)
        try:
            # a seed of its own, so that the random numbers before the checkpoint are not repeated
            self._make_model((self.config.seed + int(state["steps"])) % 2**32)
            restore(self.model, state)
            self.curve = [tuple(map(float, line)) for line in state["curve"]]
            last = dict(zip(COLUMNS, self.curve[-1], strict=True))
            self.best, self.test_score = last["best_score"], last["test_score"]
            self.simulations = int(last["simulations"])
            self.start = clocks() - np.array([last["seconds"], last["processor_seconds"]])
        except (IndexError, KeyError, TypeError, ValueError, RuntimeError) as error:
            raise ValueError(f"{path}: not a checkpoint of this training: {error}") from None
        self.next_evaluation = self.model.num_timesteps + max(self.total // EVALUATIONS, 1)
        self.bar.update(self.model.num_timesteps)

    def _on_rollout_start(self) -> None:
        """Evaluate and write a checkpoint if due, and update the standard deviation."""
        steps, policy = self.model.num_timesteps, self.model.policy
        if steps >= self.next_evaluation:
            self.evaluate()
            self.write_checkpoint()
            self.next_evaluation = steps + max(self.total // EVALUATIONS, 1)
        if not self.bar.n:
            leave_out(self.bar, steps)
        self.bar.update(steps - self.bar.n)
        if isinstance(policy, ScheduledPolicy):
            progress = min(steps / self.total, 1.0)
            policy.deviation = self.config.hyperparameters.deviation(progress)

    def _on_step(self) -> bool:
        """Count the layouts that were built with exploration noise."""
        self.simulations += sum("score" in info for info in self.locals.get("infos", ()))
        return True

    def evaluate(self) -> None:
        """Evaluate the policy without noise, and write it if it is the best so far."""
        (seconds, processor_seconds), rollout = clocks() - self.start, None
        steps, arrays = self.model.num_timesteps, weights(self.model.policy)
        act = build_actor(arrays).act
        if isinstance(self.target, Scene):
            seeds = SELECTION_SEEDS if is_random(self.target) else None
            rollout = build(act, self.target, seeds=seeds)
            score = rollout.score
        else:
            score = float(np.median(evaluate_gains(act, self.target, self.scenes)))
        self.simulations += len(self.scenes) or 1  # random episodes in a scene count as one
        if score > self.best:
            path, test_score = self.folder / files.POLICY, score
            write_bytes(path, lambda file: np.savez_compressed(file, **arrays))
            if isinstance(self.target, SceneDistribution) and self.tests:
                pause = clocks()
                test_score = float(np.median(evaluate_gains(act, self.target, self.tests)))
                self.start += clocks() - pause  # the test set is not part of the training
            if rollout is not None:
                result = {"score": score, "gain": rollout.gain, "steps": steps, "seconds": seconds}
                self.write_json(files.BEST, **result)
                rollout.layout.to_csv(self.folder / "layout.csv")
                rollout.layout.to_json(self.folder / "layout.json")
            self.best, self.test_score = score, test_score  # all files are written
        latest = self.best, processor_seconds, self.test_score
        line = steps, seconds, score, *latest, self.simulations  # as in `COLUMNS`
        self.curve.append(tuple(map(float, line)))
        best = f"median gain {self.best:+z.2%}"
        if isinstance(self.target, Scene):
            best = self.target.criterion.label(self.best, 4)
        self.bar.set_postfix_str(f"best {best}", refresh=False)

    def write_checkpoint(self) -> None:
        """Write the checkpoint, which includes the learning curve, and progress.csv."""
        content = io.BytesIO()  # torch hides the error of a full disk
        torch.save(model_state(self.model) | {"curve": self.curve}, content)
        write_bytes(self.folder / files.CHECKPOINT, lambda file: file.write(content.getbuffer()))
        self._write_curve()

    def _write_curve(self) -> None:
        """Write the learning curve as progress.csv."""
        lines = ([f"{x:.10g}" for x in line] for line in self.curve)
        write_csv(self.folder / files.PROGRESS, COLUMNS, lines)

    def write_summary(self, interrupted: bool, rollout: Rollout | None) -> tuple[int, float]:
        """Write the summary; return the numbers of steps and of seconds.

        Parameters
        ----------
        interrupted
            True if the training was interrupted.
        rollout
            Layout of the best policy; None if scenes are sampled.
        """
        seconds, processor_seconds = self.elapsed
        result: dict[str, Any]
        result = {"median_gain": self.best, "test_median_gain": self.test_score}
        if rollout is not None:
            result = {
                "score": rollout.score,
                "uniform_score": rollout.uniform.score,
                "gain": rollout.gain,
                "last_score": self.curve[-1][2],  # of the last evaluation
            }
        evaluations = len(self.curve) * (len(self.scenes) or 1)
        noisy_layouts = self.simulations - evaluations  # APG computes the gradient of each
        updates, model = int(getattr(self.model, "_n_updates", 0)), self.model
        if isinstance(model, PPO):  # it counts passes over a rollout, each of many minibatches
            updates *= -(-model.n_steps * model.n_envs // model.batch_size)
        self.write_json(
            files.SUMMARY, finished=not interrupted, scene=self.target.name,
            algorithm=self.config.algorithm, seed=self.config.seed, revision=revision(), **result,
            steps=model.num_timesteps, seconds=seconds, processor_seconds=processor_seconds,
            simulations=self.simulations,
            gradients=noisy_layouts * (self.config.algorithm == "apg"), updates=updates,
        )  # fmt: skip
        return model.num_timesteps, seconds
