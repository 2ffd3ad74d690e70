"""Training: an algorithm of stable-baselines3, for one scene or for a scene distribution.

The files in the folder of a training are listed in `agents.policy`.
"""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from msgspec import Meta

from agents.algorithms import ALGORITHMS, Hyperparameters, hyperparameters, require_learning
from agents.policy import (
    CHECKPOINT,
    CONFIG,
    FILES,
    POLICY,
    PROGRESS,
    SCENE,
    SUMMARY,
    ScenePolicy,
)
from agents.rollout import Rollout
from agents.scores import PoolScore, SceneScore
from domino_env import Scene, SceneDistribution
from domino_env.core.checks import require, require_choice
from domino_env.core.files import naming, read_json, require_unused, write_text
from domino_env.core.models import Document, model_of
from domino_env.core.progress import progress_bar
from domino_env.core.results import draw, versions
from domino_env.core.tables import write_csv
from domino_env.scenes.distribution import load_any
from domino_env.scenes.io.ranges import COUNT

if TYPE_CHECKING:
    from agents.sb3 import Learner
    from optimize.result import SearchResult

COLUMNS = (
    "steps", "seconds", "score", "best_score", "sampled_best", "deviation", "reference",
    "processor_seconds",
)  # fmt: skip
EVALUATIONS, CHECKPOINTS = 200, 40  # in a whole training
EPISODE = 32  # steps of an episode that hyperparameters are chosen for where lengths vary
COMPARED = 0.1  # of the training's time is what CMA-ES gets, for the line in the picture
LONGEST_COMPARED = 20.0  # [s]


class ConfigDocument(Document):
    """What a training was begun with: config.json."""

    algorithm: Literal["apg", "ppo", "ars"]
    seed: Annotated[int, Meta(ge=0, le=2**32 - 1)]
    steps: Annotated[int, Meta(ge=1)]
    preset: Hyperparameters


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
        Dominoes placed.
    seconds
        Time that it took.
    curve
        A tuple for each evaluation, as in progress.csv. Where scenes are sampled, scores are median
        gains over the uniform baselines.
    interrupted
        Whether it was ended by hand.
    rollout
        The layout of the best policy; None where scenes are sampled.
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
        result = f"median gain {self.curve[-1][3]:+.2%}"
        if self.rollout is not None:
            result = self.rollout.scene.against_uniform(self.rollout.score, self.rollout.wave)
        how = f"{self.steps:,} dominoes placed in {self.seconds:.0f} s; {self.folder}"
        return f"Run({self.algorithm} on {self.scene}: {result}; {how})"

    def _repr_html_(self) -> str | None:
        return None if self.rollout is None else self.rollout._repr_html_()

    def plot(self) -> Any:
        """Draw both layouts and the training; returns a Matplotlib figure.

        Raises
        ------
        ValueError
            Where scenes are sampled: there is no single layout.
        """
        return draw("training", self)


def train(
    scene: str | Path | Scene | SceneDistribution,
    algorithm: str = "ppo",
    steps: int | None = None,
    seed: int = 0,
    folder: str | Path | None = None,
    *,
    resume: bool = False,
    progress: bool | None = False,
    plan: Hyperparameters | None = None,
) -> Run:
    """Train an agent to build layouts for a scene, or for all scenes of a distribution.

    Ctrl-C ends it with the best policy so far. A training that was stopped continues from its last
    checkpoint.

    Parameters
    ----------
    scene
        A scene or a scene distribution, the name of one, or the path of its file.
    algorithm
        "apg", "ppo" or "ars".
    steps
        Dominoes to place in all; None for the default of the hyperparameters.
    seed
        The same seed on the same machine gives the same weights.
    folder
        Folder of the training; None for runs/SCENE-ALGORITHM.
    resume
        Continue from the checkpoint in the folder, with its scene, seed and steps.
    progress
        Whether to show a progress bar; None: on a terminal, elsewhere a line now and then.
    plan
        Hyperparameters; None for those of the algorithm.

    Returns
    -------
    Run
        Folder, learning curve and best layout.

    Raises
    ------
    ImportError
        Where the extra "rl" is missing.
    ValueError
        For an unknown algorithm or scene, for a folder that holds another training, and for nothing
        to continue from.
    """
    require_choice("algorithm", algorithm, ALGORITHMS)
    if steps is not None:
        require("steps", steps, 1, whole=True)
    require("seed", seed, 0, 2**32 - 1, whole=True)
    require_learning()
    target = load_any(scene) if isinstance(scene, str | Path) else scene
    home = Path(folder or f"runs/{target.name}-{algorithm}")
    if resume:
        begun = _config_of(home)
        target = load_any(home / SCENE)
        algorithm, seed, steps, plan = begun.algorithm, begun.seed, begun.steps, begun.preset
    else:
        require_unused(home, FILES)
    drawn = isinstance(target, SceneDistribution)
    plan = plan or hyperparameters(algorithm, episode_of(target), drawn=drawn)
    from agents.sb3 import random_state_restored

    with random_state_restored():
        training = Training(target, algorithm, plan, steps or plan.steps, seed, home, progress)
        return training.run(resume)


def episode_of(target: Scene | SceneDistribution) -> int:
    """Return the steps of a typical episode, for hyperparameters."""
    if isinstance(target, Scene):
        return target.count - 1
    return EPISODE if COUNT in target.ranges else target.first.count - 1


def _config_of(folder: Path) -> ConfigDocument:
    path = folder / CONFIG
    if not path.exists():
        raise ValueError(
            f"{folder} holds no training that had begun, so there is nothing to go on from: train "
            "without --resume, into another folder if this one holds files of a run"
        )
    with naming(path):
        return model_of(ConfigDocument, read_json(path))


class Training:
    """A training while it runs; its steps are dominoes.

    Parameters
    ----------
    target, algorithm, plan, total, seed, folder, progress
        As of `train`, where `total` is `steps`.
    """

    def __init__(
        self,
        target: Scene | SceneDistribution,
        algorithm: str,
        plan: Hyperparameters,
        total: int,
        seed: int,
        folder: Path,
        progress: bool | None = False,
    ) -> None:
        self.target, self.algorithm, self.plan = target, algorithm, plan
        self.total, self.seed, self.folder = total, seed, folder
        self.score: SceneScore | PoolScore
        self.score = SceneScore(target, folder) if isinstance(target, Scene) else PoolScore(target)
        self.curve: list[tuple[float, ...]] = []
        self.best = self.sampled = -np.inf
        self.next_evaluation = self.next_checkpoint = 0
        self.began = time.perf_counter(), time.process_time()
        self.bar = progress_bar(progress, total=total, unit=" dominoes", unit_scale=True)

    @property
    def seconds(self) -> tuple[float, float]:
        """Wall-clock and processor time so far [s], those before a resumption included."""
        return time.perf_counter() - self.began[0], time.process_time() - self.began[1]

    def run(self, resume: bool) -> Run:
        """Train from the beginning, or from the checkpoint in the folder.

        Ctrl-C ends it: half an update is nothing to continue from, so the last checkpoint stays.
        """
        from agents.sb3 import Learner

        if resume and (self.folder / CHECKPOINT).exists():
            self.learner = self._resumed()
        else:
            self.learner = Learner(self.target, self.algorithm, self.plan, self.seed)
            self._begin()
        interrupted = False
        if self.learner.steps < self.total:
            self._log()
            try:
                left = self.total - self.learner.steps
                self.learner.learn(left, self.between_updates, self.after_step)
            except KeyboardInterrupt:
                interrupted = True
        evaluated = bool(self.curve) and self.curve[-1][0] == self.learner.steps
        if not self.curve or not (interrupted or evaluated):
            self.evaluate()
        if interrupted:
            self._write_curve()
        else:
            self.checkpoint()
        self.bar.close()
        return self._finish(interrupted)

    def _begin(self) -> None:
        write_text(self.folder / SCENE, self.target.to_toml())
        document = {
            "algorithm": self.algorithm,
            "seed": self.seed,
            "steps": self.total,
            "preset": asdict(self.plan),
            "versions": versions(),
        }
        write_text(self.folder / CONFIG, json.dumps(document, indent=1) + "\n")

    def _resumed(self) -> Learner:
        """Return a learner as the checkpoint in the folder has it.

        Its random numbers are others than those of an undisturbed training.
        """
        from agents.sb3 import Learner, read_checkpoint

        path = self.folder / CHECKPOINT
        state = read_checkpoint(path)
        try:
            seed = (self.seed + int(state["steps"])) % 2**32  # no noise is drawn twice
            learner = Learner(self.target, self.algorithm, self.plan, seed)
            learner.restore(state)
            progress = state["progress"]
            self.curve = [tuple(row) for row in progress["curve"]]
            self.best, self.sampled = progress["best"], progress["sampled"]
            learner.reference_speed = progress["reference"]
            now = time.perf_counter(), time.process_time()
            self.began = now[0] - progress["seconds"], now[1] - progress["processor_seconds"]
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise ValueError(f"{path}: it does not fit this training: {error}") from None
        self.next_evaluation = learner.steps + self.total // EVALUATIONS
        self.next_checkpoint = learner.steps + self.total // CHECKPOINTS
        self.bar.update(learner.steps)
        return learner

    def _log(self) -> None:
        """Write scalars for TensorBoard if it is installed."""
        if find_spec("tensorboard") is not None:
            from stable_baselines3.common.logger import configure

            home = str(self.folder / "tensorboard")
            self.learner.model.set_logger(configure(home, ["tensorboard"]))

    def between_updates(self) -> None:
        """Evaluate and write a checkpoint where it is time, and set what changes along the way."""
        steps = self.learner.steps
        if steps >= self.next_evaluation:
            self.evaluate()
            self.next_evaluation = steps + self.total // EVALUATIONS
        if steps >= self.next_checkpoint:
            self.checkpoint()
            self.next_checkpoint = steps + self.total // CHECKPOINTS
        self.bar.update(steps - self.bar.n)
        self.learner.adapt(min(steps / self.total, 1.0), float(max(self.best, self.sampled)))

    def after_step(self, infos: Any) -> None:
        """Note the best score of the layouts that were built with noise."""
        for info in infos:
            if "score" in info:
                self.sampled = max(self.sampled, float(info["score"]))

    def evaluate(self) -> None:
        """Evaluate the policy without noise; keep it if it is the best so far."""
        learner, (seconds, processor_seconds) = self.learner, self.seconds
        score = self.score(learner.policy(), learner.reference_speed)
        if score > self.best:
            self.best = score
            learner.save(self.folder / POLICY)
            self.score.keep(learner.steps, seconds)
        deviation = self.plan.deviation(min(learner.steps / self.total, 1.0))
        self.curve.append((
            float(learner.steps), seconds, score, self.best, self.sampled, deviation,
            learner.reference_speed, processor_seconds,
        ))  # fmt: skip
        learner.model.logger.record("design/score", score)
        learner.model.logger.record("design/best_score", self.best)
        self.bar.set_postfix_str(f"best score {self.best:.4f}", refresh=False)

    def checkpoint(self) -> None:
        """Write the checkpoint and the learning curve."""
        seconds, processor_seconds = self.seconds
        progress = {
            "curve": [list(row) for row in self.curve],
            "seconds": seconds,
            "processor_seconds": processor_seconds,
            "best": float(self.best),
            "sampled": float(self.sampled),
            "reference": self.learner.reference_speed,
        }
        self.learner.write_checkpoint(self.folder / CHECKPOINT, progress)
        self._write_curve()

    def _write_curve(self) -> None:
        rows = ([f"{x:.10g}" for x in row] for row in self.curve)
        write_csv(self.folder / PROGRESS, COLUMNS, rows)

    def _finish(self, interrupted: bool) -> Run:
        """Write the summary, and the picture where there is one layout."""
        from domino_env.core.plot_style import write_png

        seconds, processor_seconds = self.seconds
        rollout = ScenePolicy.load(self.folder).build() if isinstance(self.target, Scene) else None
        run = Run(
            self.folder, self.target.name, self.algorithm, self.learner.steps, seconds,
            tuple(self.curve), interrupted, rollout,
        )  # fmt: skip
        document: dict[str, Any] = {
            "finished": not interrupted,
            "scene": self.target.name,
            "algorithm": self.algorithm,
            "seed": self.seed,
        }
        if rollout is None:
            document["median_gain"] = self.best
        else:
            document |= {
                "score": rollout.score,
                "uniform_score": rollout.uniform.score,
                "gain": rollout.gain,
                "last_score": self.curve[-1][2],
            }
            baseline = None if interrupted else _baseline(rollout.scene, COMPARED * seconds)
            if baseline is not None:
                document |= {"cma_score": baseline.score, "cma_seconds": baseline.seconds}
            write_png(draw("training", run, baseline), self.folder / "result.png")
        document |= {
            "steps": run.steps, "seconds": seconds, "processor_seconds": processor_seconds,
        }  # fmt: skip
        write_text(self.folder / SUMMARY, json.dumps(document, indent=1) + "\n")
        return run


def _baseline(scene: Scene, seconds: float) -> SearchResult | None:
    """Search with CMA-ES, to compare; None where the training was too short for that."""
    from optimize import search

    if seconds < 1.0:
        return None
    return search(scene, "cma", seconds=min(seconds, LONGEST_COMPARED), progress=False)
