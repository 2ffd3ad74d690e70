"""Training of policies with Stable-Baselines3, for one scene or for a scene distribution.

`agents.policy` lists the files in the folder of a training.
"""

from __future__ import annotations

import json
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agents import policy
from agents.algorithms import ALGORITHMS, Hyperparameters, default_hyperparameters, require_learning
from agents.evaluation import choose_scenes, evaluate_gains
from agents.policy import BEST, CHECKPOINT, CONFIG, POLICY, PROGRESS, SCENE, SUMMARY, ScenePolicy
from agents.rollout import SELECTION_SEEDS, Rollout, build, evaluation_seeds
from domino_env import Scene, SceneDistribution
from domino_env.core.checks import as_path, require, require_choice, require_type
from domino_env.core.files import require_unused, require_writable, write_text
from domino_env.core.models import plain
from domino_env.core.progress import leave_out, notice, progress_bar
from domino_env.core.results import versions
from domino_env.core.tables import write_csv
from domino_env.core.types import Floats
from domino_env.scenes.distribution import load_any
from domino_env.scenes.pool import POOL_SIZE, ScenePool
from optimize.experiments.best_known import best_known
from optimize.result import draw_scores

if TYPE_CHECKING:
    from agents.sb3 import Learner

COLUMNS = (
    "steps", "seconds", "score", "best_score", "processor_seconds", "test_score", "simulations",
)  # fmt: skip
EVALUATIONS = 200  # number of evaluations in a training, each with a checkpoint
POOL_SCENES = 50  # number of training scenes in which evaluations score a policy


@dataclass(frozen=True, eq=False)
class Run:
    """Result of a training.

    Attributes
    ----------
    folder
        Folder of the training.
    scene
        Name of the scene or of the scene distribution.
    algorithm
        Name of the algorithm.
    steps
        Number of dominoes placed.
    seconds
        Wall-clock time [s].
    curve
        A tuple for each evaluation, with the columns of progress.csv. If scenes are sampled, scores
        are median gains over the uniform baselines of some training scenes, and `test_score` is
        that of the best policy so far in the test set, which does not affect the training;
        otherwise, or without a test set, it is `best_score`.
    interrupted
        True if the training was interrupted (Ctrl-C).
    rollout
        Layout of the best policy; None if scenes are sampled.
    """

    folder: Path
    scene: str
    algorithm: str
    steps: int
    seconds: float
    curve: tuple[tuple[float, ...], ...]
    interrupted: bool
    rollout: Rollout | None

    def __repr__(self) -> str:
        result = f"median gain {self.curve[-1][3]:+z.2%}"  # best_score
        if self.rollout is not None:
            result = self.rollout.scene.format_with_gain(self.rollout.score, self.rollout.wave)
        work = f"{self.steps:,} dominoes placed in {self.seconds:.0f} s; {self.folder}"
        return f"Run({self.algorithm} on {self.scene}: {result}; {work})"

    def _repr_png_(self) -> bytes | None:
        return None if self.rollout is None else self.rollout._repr_png_()

    def plot(self) -> Any:
        """Draw the layout, the uniform baseline and the learning curve.

        Returns
        -------
        matplotlib.figure.Figure
            The figure.

        Raises
        ------
        ValueError
            If scenes are sampled, as there is no single layout.
        """
        from domino_env.view.figures import draw_with_uniform

        rollout = self.rollout
        if rollout is None:
            raise ValueError(
                f"the training in {self.folder} has no single layout, as scenes were sampled from "
                f"{self.scene}: see progress.csv, or evaluate the policy in one scene"
            )
        return draw_with_uniform(rollout, f"built by {self.algorithm}", self._draw_curve)

    def _draw_curve(self, axes: Any) -> None:
        """Draw the learning curve, with the uniform baseline and the best known score."""
        assert self.rollout is not None
        scene, uniform = self.rollout.scene, self.rollout.uniform.score
        lines = {"uniform baseline": uniform}
        if record := best_known().get(scene.name):
            lines["best known"] = record.score
        table = np.array(self.curve)  # columns as in `COLUMNS`
        curves = {"best so far": table[:, 3], "policy, without noise": table[:, 2]}
        clock = f"dominoes placed in the training ({self.algorithm})"
        draw_scores(axes, table[:, 0], curves, lines, scene.criterion, clock)


def train(
    scene: str | Path | Scene | SceneDistribution,
    algorithm: str | None = None,
    steps: int | None = None,
    seed: int | None = None,
    folder: str | Path | None = None,
    *,
    resume: bool = False,
    progress: bool | None = False,
    hyperparameters: Hyperparameters | None = None,
    num_scenes: int | None = None,
) -> Run:
    """Train a policy that builds layouts for a scene, or for all scenes of a distribution.

    Ctrl-C ends the training with the best policy so far.

    Parameters
    ----------
    scene
        A scene or a scene distribution, the name of one, or the path of its file.
    algorithm
        "apg", "ppo", "ars", "sac", "td3" or "tqc"; None for "ppo".
    steps
        Least number of dominoes to place; None for that of the hyperparameters.
    seed
        Seed of all randomness; None for 0. Weights are bitwise reproducible on the same machine,
        except after a resumed training.
    folder
        Folder of the training; None for runs/SCENE-ALGORITHM.
    resume
        If True, the training continues from the checkpoint in the folder. The scene must be that of
        the training, and so must all arguments that are not None.
    progress
        If True, a progress bar is shown; None for a bar on a terminal and lines elsewhere.
    hyperparameters
        Hyperparameters; None for the defaults of the algorithm.
    num_scenes
        Number of scenes of a distribution to train on, from the first; None for all 4096.

    Returns
    -------
    Run
        Folder, learning curve and best layout.

    Raises
    ------
    ImportError
        If the extra "rl" is missing.
    ValueError
        If the algorithm or the scene is unknown, if a number is out of range, if `num_scenes` is
        given with a single scene, or if the folder holds another training or, with `resume`, none
        or one with other arguments.
    TypeError
        If the folder or the hyperparameters have another type.
    OSError
        If the folder cannot be written.

    Examples
    --------
    >>> from agents import train
    >>> run = train("sprint", algorithm="apg", folder="runs/apg")  # doctest: +SKIP
    >>> run.rollout.score  # doctest: +SKIP
    """
    names = ("algorithm", "steps", "seed", "num_scenes", "hyperparameters")
    given = dict(zip(names, (algorithm, steps, seed, num_scenes, hyperparameters), strict=True))
    algorithm, seed = algorithm or "ppo", 0 if seed is None else seed
    require_choice("algorithm", algorithm, ALGORITHMS)
    require("steps", steps, 1, whole=True, optional=True)
    require("seed", seed, 0, 2**32 - 1, whole=True)
    require("num_scenes", num_scenes, 1, POOL_SIZE, whole=True, optional=True)
    require_learning()
    require_type("hyperparameters", hyperparameters, Hyperparameters | None, "Hyperparameters")
    target = scene if isinstance(scene, Scene | SceneDistribution) else load_any(scene)
    path = as_path("folder", folder or f"runs/{target.name}-{algorithm}")
    if resume:
        config, given["scene"] = policy.read_config(path), target.to_toml()
        stored = {name: getattr(config, name, None) for name in given}
        stored["scene"] = load_any(path / SCENE).to_toml()
        if other := [name for name, x in given.items() if x is not None and x != stored[name]]:
            own = [f"another {x}" if x == "scene" else f"{x} = {stored[x]}" for x in other]
            raise ValueError(
                f"the training in {path} has {', '.join(own)}: give its own scene ({SCENE}) and "
                f"leave out the rest ({CONFIG}), or name another folder"
            )
        algorithm, seed, steps = config.algorithm, config.seed, config.steps
        hyperparameters, num_scenes = config.hyperparameters, config.num_scenes
    else:
        require_writable(path)
        require_unused(path, policy.FILES)
    hyperparameters = hyperparameters or default_hyperparameters(algorithm, target)
    steps = steps or hyperparameters.steps
    training = Training(target, algorithm, hyperparameters, steps, seed, path, progress, num_scenes)
    return training.run(resume)


def clocks() -> Floats:
    """Return the wall-clock time and the processor time (2,) [s]."""
    return np.array([time.perf_counter(), time.process_time()])


@dataclass(eq=False)
class Training:
    """Training in progress; a step places one domino.

    Parameters
    ----------
    target, algorithm, hyperparameters, total, seed, folder, progress, num_scenes
        See `train`; `target` is its scene or scene distribution and `total` its `steps`.
    """

    target: Scene | SceneDistribution
    algorithm: str
    hyperparameters: Hyperparameters
    total: int
    seed: int
    folder: Path
    progress: bool | None
    num_scenes: int | None

    def __post_init__(self) -> None:
        # scenes of evaluations and of the test set; none if the target is a single scene
        self.scenes: list[Scene] = []
        self.tests: list[Scene] = []
        self.simulations = 0
        if isinstance(self.target, SceneDistribution):
            pool = ScenePool(self.target, self.num_scenes or POOL_SIZE)
            numbers = range(len(pool))[: -POOL_SCENES - 1 : -1]  # the last ones, in reverse order
            self.scenes = [pool.scene(number) for number in numbers]
            with suppress(ValueError):  # raised if the distribution has no test set
                self.tests = choose_scenes(self.target)
        self.curve: list[tuple[float, ...]] = []
        self.best = self.test_score = -np.inf
        self.next_evaluation = 0  # steps
        self.start = clocks()  # earlier if a training is resumed
        self.bar = progress_bar(self.progress, total=self.total, unit=" dominoes", unit_scale=True)

    def run(self, resume: bool) -> Run:
        """Train from the beginning, or from the checkpoint in the folder.

        Ctrl-C does not write a checkpoint, as an unfinished update cannot be resumed.
        """
        if resume and (self.folder / CHECKPOINT).exists():
            self.learner = self._resume_learner()
        else:
            if resume:
                notice(f"{self.folder} has no {CHECKPOINT}: the training begins again")
            self.learner = self._make_learner(self.seed)
            if not resume and (self.folder / CONFIG).exists():
                raise ValueError(f"another training began in {self.folder}: name another folder")
            write_text(self.folder / SCENE, self.target.to_toml())
            self._write_json(
                CONFIG, algorithm=self.algorithm, seed=self.seed, steps=self.total,
                hyperparameters=plain(self.hyperparameters), num_scenes=self.num_scenes,
                versions=versions(),
            )  # fmt: skip
        interrupted = False
        try:
            remaining = self.total - self.learner.steps
            self.learner.learn(remaining, self.between_updates, self.after_step)
        except KeyboardInterrupt:
            interrupted = True
        is_evaluated = bool(self.curve) and self.curve[-1][0] == self.learner.steps
        if not self.curve or not (interrupted or is_evaluated):
            self.evaluate()
        if interrupted:
            self._write_curve()
        else:
            self.write_checkpoint()
        self.bar.close()
        return self._finish(interrupted)

    def _make_learner(self, seed: int) -> Learner:
        """Return a new learner."""
        from agents.sb3 import Learner

        return Learner(self.target, self.algorithm, self.hyperparameters, seed, self.num_scenes)

    def _write_json(self, name: str, **document: Any) -> None:
        """Write a JSON file into the folder."""
        write_text(self.folder / name, json.dumps(document, indent=1) + "\n")

    def _resume_learner(self) -> Learner:
        """Return a learner in the state of the checkpoint, with other random numbers."""
        from agents.sb3 import read_checkpoint

        path = self.folder / CHECKPOINT
        state = read_checkpoint(path)
        try:
            # a seed of its own, so that the random numbers before the checkpoint are not repeated
            learner = self._make_learner((self.seed + int(state["steps"])) % 2**32)
            learner.restore(state)
            self.curve = [tuple(map(float, line)) for line in state["curve"]]
            last = dict(zip(COLUMNS, self.curve[-1], strict=True))
            self.best, self.test_score = last["best_score"], last["test_score"]
            self.simulations = int(last["simulations"])
            self.start = clocks() - np.array([last["seconds"], last["processor_seconds"]])
        except (IndexError, KeyError, TypeError, ValueError, RuntimeError) as error:
            raise ValueError(f"{path}: not a checkpoint of this training: {error}") from None
        self.next_evaluation = learner.steps + max(self.total // EVALUATIONS, 1)
        self.bar.update(learner.steps)
        return learner

    def between_updates(self) -> None:
        """Evaluate and write a checkpoint if due, and update the standard deviation."""
        steps = self.learner.steps
        if steps >= self.next_evaluation:
            self.evaluate()
            self.write_checkpoint()
            self.next_evaluation = steps + max(self.total // EVALUATIONS, 1)
        if not self.bar.n:
            leave_out(self.bar, steps)
        self.bar.update(steps - self.bar.n)
        self.learner.update_deviation(min(steps / self.total, 1.0))

    def after_step(self, infos: Any) -> None:
        """Count the layouts that were built with exploration noise."""
        self.simulations += sum("score" in info for info in infos)

    def evaluate(self) -> None:
        """Evaluate the policy without noise, and write it if it is the best so far."""
        learner, (seconds, processor_seconds) = self.learner, clocks() - self.start
        act, rollout = learner.policy(), None
        if isinstance(self.target, Scene):
            seeds = SELECTION_SEEDS if len(evaluation_seeds(self.target)) > 1 else None
            rollout = build(act, self.target, seeds=seeds)
            score = rollout.score
        else:
            score = float(np.median(evaluate_gains(act, self.target, self.scenes)))
        self.simulations += len(self.scenes) or 1
        if score > self.best:
            self.best = self.test_score = score
            learner.save(self.folder / POLICY)
            if isinstance(self.target, SceneDistribution) and self.tests:
                pause = clocks()
                self.test_score = float(np.median(evaluate_gains(act, self.target, self.tests)))
                self.start += clocks() - pause  # the test set is not part of the training
            if rollout is not None:
                self._write_json(
                    BEST, score=score, gain=rollout.gain, steps=learner.steps, seconds=seconds
                )
                rollout.layout.to_csv(self.folder / "layout.csv")
                rollout.layout.to_json(self.folder / "layout.json")
        self.curve.append((
            float(learner.steps), seconds, score, self.best, processor_seconds, self.test_score,
            float(self.simulations),
        ))  # fmt: skip
        best = f"median gain {self.best:+z.2%}"
        if isinstance(self.target, Scene):
            best = self.target.criterion.label(self.best, 4)
        self.bar.set_postfix_str(f"best {best}", refresh=False)

    def write_checkpoint(self) -> None:
        """Write the checkpoint, which includes the learning curve, and progress.csv."""
        self.learner.write_checkpoint(self.folder / CHECKPOINT, self.curve)
        self._write_curve()

    def _write_curve(self) -> None:
        """Write the learning curve as progress.csv."""
        lines = ([f"{x:.10g}" for x in line] for line in self.curve)
        write_csv(self.folder / PROGRESS, COLUMNS, lines)

    def _finish(self, interrupted: bool) -> Run:
        """Write the summary, and a picture if there is a single layout; return the result."""
        from domino_env.core.plot_style import write_png

        seconds, processor_seconds = clocks() - self.start
        evaluations = len(self.curve) * (len(self.scenes) or 1)
        noisy_layouts = self.simulations - evaluations  # APG computes the gradient of each
        rollout = ScenePolicy.load(self.folder).build() if isinstance(self.target, Scene) else None
        run = Run(
            self.folder, self.target.name, self.algorithm, self.learner.steps, seconds,
            tuple(self.curve), interrupted, rollout,
        )  # fmt: skip
        result: dict[str, Any] = {"median_gain": self.best, "test_median_gain": self.test_score}
        if rollout is not None:
            result = {
                "score": rollout.score,
                "uniform_score": rollout.uniform.score,
                "gain": rollout.gain,
                "last_score": self.curve[-1][2],  # of the last evaluation
            }
            write_png(run.plot(), self.folder / "result.png")
        self._write_json(
            SUMMARY, finished=not interrupted, scene=run.scene, algorithm=run.algorithm,
            seed=self.seed, **result, steps=run.steps, seconds=seconds,
            processor_seconds=processor_seconds, simulations=self.simulations,
            gradients=noisy_layouts * (self.algorithm == "apg"), updates=self.learner.updates,
        )  # fmt: skip
        return run
