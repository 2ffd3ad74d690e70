"""Training: one learner on one scene, in a folder from which it can go on.

scene.toml      the scene                    config.json   algorithm, seed, preset, versions
progress.csv    the learning curve           policy.npz    weights of the best policy so far
policy.json     what it built, and when      checkpoint.pt all that going on needs (no pickled code)
layout.csv/json the row it builds            summary.json, result.png
tensorboard/    the losses too, where TensorBoard is installed
"""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agents.base.clock import Clock
from agents.base.requirements import require_extra
from agents.base.run_files import ProgressDocument, read_config, require_columns
from agents.sb3.presets import ALGORITHMS, Preset, preset
from agents.single.evaluation import Built, build
from domino_env.scenes.files.reading import load_scene
from domino_env.scenes.scene import Scene
from domino_env.support.files import write_text
from domino_env.support.models import model_of
from domino_env.support.reading import naming
from domino_env.support.tables import write_csv

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.callbacks import BaseCallback

    from agents.single.cloning import Cloned
    from domino_env.chain.layout import Layout
    from optimize.evaluation.result import SearchResult

SLACK = 1e-4  # of score that a policy may lose against its clone before it is put back
LOOKS = 200  # evaluations of the policy in a run
KEEPS = 40  # checkpoints of a run
COLUMNS = (
    "steps", "seconds", "score", "best_score", "sampled_best", "deviation", "reference",
    "processor_seconds",
)  # fmt: skip
COMPARED = 0.1  # of the training's time is what CMA-ES gets, for the line in the picture
LONGEST_COMPARED = 20.0  # [s]


@dataclass(frozen=True, eq=False)
class Run:
    """Result of a training.

    Attributes
    ----------
    folder
        Where all of it lies.
    algorithm
        What was trained.
    built
        The row of the best policy.
    steps
        Dominoes placed.
    seconds
        Time that it took.
    curve
        A tuple of `COLUMNS` for each evaluation.
    interrupted
        Whether it was ended by hand.
    clone_score
        Of the clone that it began with; None for none.
    """

    folder: Path
    algorithm: str
    built: Built
    steps: int
    seconds: float
    curve: tuple[tuple[float, ...], ...]
    interrupted: bool
    clone_score: float | None = None


def train(
    scene: str | Scene,
    algorithm: str = "ppo",
    steps: int | None = None,
    seed: int = 0,
    folder: str | Path | None = None,
    *,
    resume: bool = False,
    progress: bool = False,
    plan: Preset | None = None,
    warm_start: str | Path | Layout | None = None,
) -> Run:
    """Train an agent to build rows for a scene.

    Ctrl-C ends it with the best policy so far. A run that was stopped goes on from its last
    checkpoint, and comes to what it would have come to undisturbed.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    algorithm
        "ppo", "sac", "td3", "tqc" or "ars".
    steps
        Dominoes to place in all; None for the preset's.
    seed
        The same seed on the same machine gives the same weights.
    folder
        Where the run is kept; None for runs/SCENE-ALGORITHM.
    resume
        Go on from the checkpoint in the folder, with its scene, seed and steps.
    progress
        Whether to show a progress bar.
    plan
        Another preset.
    warm_start
        A row that PPO learns to build before it goes on by itself, see
        `agents.single.cloning.row_to_clone`: a layout or its file, the folder of a run, "auto",
        "best-known". Whatever it tries, it does not end below its clone.

    Raises
    ------
    ImportError
        Where the extra "rl" is missing.
    ValueError
        For an unknown algorithm or scene, for a folder that holds another run, and for nothing to
        go on from.
    """
    if algorithm not in ALGORITHMS:
        raise ValueError(f"there is no algorithm '{algorithm}': choose {', '.join(ALGORITHMS)}")
    if steps is not None and steps < 1:
        raise ValueError(f"steps = {steps}: give 1 or more")
    require_extra()
    judged = scene if isinstance(scene, Scene) else load_scene(scene)
    home = Path(folder or f"runs/{judged.name}-{algorithm}")
    if resume:
        judged, algorithm, seed, plan, steps = _as_begun(home)
    elif (home / "config.json").exists() or (home.is_dir() and any(home.iterdir())):
        raise ValueError(f"{home} is not empty: name another folder, or go on with --resume")
    if warm_start is not None and algorithm != "ppo":
        raise ValueError(f"a warm start is PPO's, not {algorithm}'s: leave one of the two out")
    plan = plan or preset(algorithm, judged.count - 1, warm=warm_start is not None)
    total = steps or plan.steps
    state = np.random.get_state()  # noqa: NPY002 - the learner draws from the global stream
    try:
        training = _Training(judged, algorithm, plan, total, seed, home, progress)
        return training.run(resume, warm_start)
    finally:
        np.random.set_state(state)  # noqa: NPY002


class _Training:
    """One training while it runs."""

    def __init__(
        self,
        scene: Scene,
        algorithm: str,
        plan: Preset,
        total: int,
        seed: int,
        home: Path,
        progress: bool,
    ) -> None:
        from agents.sb3.learner import learner
        from agents.sb3.vec_env import DominoVecEnv

        self.scene, self.algorithm, self.plan = scene, algorithm, plan
        self.total, self.home = total, home
        self.uniform_speed = scene.uniform().wave.mean_speed
        self.env = DominoVecEnv(scene, plan.rows)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about batches that do not divide evenly
            self.model: BaseAlgorithm = learner(algorithm, plan, self.env, seed)
        self.seed = seed
        self.clone_score: float | None = None
        self.best = -np.inf
        self.sampled = -np.inf
        self.curve: list[tuple[float, ...]] = []
        self.clock = Clock()
        self.next_look = self.next_keep = 0
        self.bar: Any = None
        if progress:
            from tqdm import tqdm

            self.bar = tqdm(total=total, unit=" dominoes", unit_scale=True)

    def run(self, resume: bool, warm_start: str | Path | Layout | None = None) -> Run:
        from agents.sb3.learner import load_state

        if resume and (self.home / "checkpoint.pt").exists():
            self._restore(load_state(self.model, self.home / "checkpoint.pt"))
        else:
            cloned = None
            if warm_start is not None:
                from agents.single.cloning import clone

                first = self.plan.first_deviation
                cloned = clone(self.model, self.env, warm_start, first, self.seed)
                self.clone_score = cloned.score
            self._begin(cloned)
        self._log()
        interrupted = False
        left = self.total - self.model.num_timesteps
        if left > 0:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)
                    self.model.learn(left, callback=self._watch(), reset_num_timesteps=False)
            except KeyboardInterrupt:
                interrupted = True
        # a last policy that is put back is looked at once more
        looked = bool(self.curve) and self.curve[-1][0] == self.model.num_timesteps  # had finished
        if (not self.curve or not (interrupted or looked)) and not self.look():
            self.look()
        if interrupted:
            self.write_curve()  # half an update is nothing to go on from: the last checkpoint stays
        else:
            self.keep()
        return self._finish(interrupted)

    @property
    def done(self) -> float:
        """The part of the steps that has been taken."""
        return min(self.model.num_timesteps / self.total, 1.0)

    def deviation(self) -> float:
        """Of PPO's actions."""
        return self.plan.deviation(self.done)

    def tune(self) -> None:
        """What changes along the way: deviation and reference speed."""
        from agents.sb3.learner import NOISY, set_deviation

        if self.algorithm in NOISY:
            set_deviation(self.model, self.deviation())
        if self.plan.follow and self.scene.criterion.is_ratio:
            found = max(self.best, self.sampled)
            self.env.rows.reference_speed = float(max(found, self.uniform_speed))

    def look(self) -> bool:
        """Let the policy build a row without noise; keep the policy if it is the best so far.

        False where it lost against the clone that it was, and the best is put in its place.
        """
        from agents.sb3.learner import builder, load_weights, save_weights

        speed = float(self.env.rows.reference_speed)
        built = build(builder(self.model, self.algorithm), self.scene, speed)
        if built.score > self.best:
            self.best = built.score
            save_weights(self.model.policy, self.home / "policy.npz")
            document = {
                "score": built.score,
                "gain": built.gain,
                "steps": self.model.num_timesteps,
                "seconds": self.clock.seconds,
                "reference_over_uniform": speed / self.uniform_speed
                if self.uniform_speed > 0.0
                else 1.0,
            }
            write_text(self.home / "policy.json", json.dumps(document, indent=1) + "\n")
            built.layout.to_csv(self.home / "layout.csv")
            built.layout.to_json(self.home / "layout.json")
        lost = self.clone_score is not None and built.score < self.clone_score - SLACK
        if lost:
            load_weights(self.model.policy, self.home / "policy.npz")  # what was tried is undone
        self.curve.append(
            (
                float(self.model.num_timesteps), self.clock.seconds, built.score, self.best,
                self.sampled, self.deviation(), speed, self.clock.processor_seconds,
            )
        )  # fmt: skip
        self.model.logger.record("design/score", built.score)
        self.model.logger.record("design/best_score", self.best)
        if self.bar is not None:
            mark = self.scene.uniform().score
            self.bar.set_postfix_str(f"best {self.best:.4f}, uniform {mark:.4f}")
        return not lost

    def keep(self) -> None:
        """Write the checkpoint and the learning curve."""
        from agents.sb3.learner import save_state

        more = {
            "best": float(self.best),
            "sampled": float(self.sampled),
            "curve": [list(row) for row in self.curve],
            "seconds": self.clock.seconds,
            "processor_seconds": self.clock.processor_seconds,
            "reference": float(self.env.rows.reference_speed),
            "next_look": self.next_look,
            "next_keep": self.next_keep,
            "clone_score": self.clone_score,
        }
        save_state(self.model, more, self.home / "checkpoint.pt")
        self.write_curve()

    def write_curve(self) -> None:
        """Write the learning curve."""
        rows = ([f"{x:.10g}" for x in row] for row in self.curve)
        write_csv(self.home / "progress.csv", COLUMNS, rows)

    def at_rollout(self) -> None:
        """Between two updates: look, keep, tune."""
        steps = self.model.num_timesteps
        if steps >= self.next_look:
            self.look()
            self.next_look = steps + self.total // LOOKS
        if steps >= self.next_keep:
            self.next_keep = steps + self.total // KEEPS
            self.keep()
            # A run that goes on from here begins with new rows; so does this one.
            self.model._last_obs = self.env.reset()
            self.model._last_episode_starts = np.ones(self.env.num_envs, dtype=bool)
        self.tune()
        if self.bar is not None:
            self.bar.update(steps - self.bar.n)

    def _watch(self) -> BaseCallback:
        from stable_baselines3.common.callbacks import BaseCallback

        training = self

        class Watch(BaseCallback):
            def _on_rollout_start(self) -> None:
                training.at_rollout()

            def _on_step(self) -> bool:
                for info in self.locals.get("infos", ()):
                    if "score" in info:
                        training.sampled = max(training.sampled, float(info["score"]))
                return True

        return Watch()

    def _log(self) -> None:
        """Scalars for TensorBoard if it is installed; the learning curve is kept either way."""
        from stable_baselines3.common.logger import Logger, configure

        if find_spec("tensorboard") is None:
            self.model.set_logger(Logger(folder=None, output_formats=[]))
        else:
            self.model.set_logger(configure(str(self.home / "tensorboard"), ["tensorboard"]))

    def _begin(self, cloned: Cloned | None) -> None:
        self.home.mkdir(parents=True, exist_ok=True)
        from domino_env.support.provenance import versions

        document = {
            "algorithm": self.algorithm,
            "seed": self.seed,
            "steps": self.total,
            "preset": self.plan.to_dict(),
            "warm_start": None if cloned is None else cloned.to_dict(),
            "versions": versions(),
        }
        write_text(self.home / "scene.toml", self.scene.to_toml())
        self.keep()  # before what says that there is something to go on from: a clone too is kept
        write_text(self.home / "config.json", json.dumps(document, indent=1) + "\n")

    def _restore(self, more: dict[str, Any]) -> None:
        with naming(self.home / "checkpoint.pt"):
            found = model_of(ProgressDocument, more)
            require_columns(found.curve, COLUMNS)
        self.best, self.sampled, self.curve = found.best, found.sampled, found.curve
        self.clock.go_on(found.seconds, found.processor_seconds)
        self.env.rows.reference_speed = found.reference
        self.next_look, self.next_keep = found.next_look, found.next_keep
        self.clone_score = found.clone_score

    def _finish(self, interrupted: bool) -> Run:
        from agents.single.evaluation import evaluate
        from agents.single.picture import draw

        if self.bar is not None:
            self.bar.close()
        built = evaluate(self.home)
        run = Run(
            self.home, self.algorithm, built, self.model.num_timesteps, self.clock.seconds,
            tuple(self.curve), interrupted, self.clone_score,
        )  # fmt: skip
        document = {
            "finished": not interrupted,
            "scene": self.scene.name,
            "algorithm": self.algorithm,
            "seed": self.seed,
            "score": built.score,
            "uniform_score": built.uniform.score,
            "gain": built.gain,
            "clone_score": self.clone_score,
            "last_score": self.curve[-1][2],
            "steps": run.steps,
            "seconds": run.seconds,
            "processor_seconds": self.clock.processor_seconds,
        }
        rival = None if interrupted else _rival(self.scene, COMPARED * run.seconds)
        if rival is not None:
            document["cma_score"], document["cma_seconds"] = rival.score, rival.seconds
        write_text(self.home / "summary.json", json.dumps(document, indent=1) + "\n")
        draw(run, rival, self.home / "result.png")
        return run


def _rival(scene: Scene, seconds: float) -> SearchResult | None:
    """What CMA-ES finds meanwhile; None where the training was too short to compare."""
    from optimize.searching.runner import search

    if seconds < 1.0:
        return None
    given = min(seconds, LONGEST_COMPARED)
    return search(scene, "cma", seconds=given, progress=False)


def _as_begun(home: Path) -> tuple[Scene, str, int, Preset, int]:
    """What a run in this folder was begun with."""
    if not (home / "config.json").exists():
        raise ValueError(
            f"{home} holds no training that had begun, so there is nothing to go on from: train "
            "without --resume, into another folder if this one is not empty"
        )
    begun = read_config(home)
    if begun.algorithm == "ars":
        raise ValueError("ars keeps no checkpoint that it can go on from: begin anew")
    return load_scene(home / "scene.toml"), begun.algorithm, begun.seed, begun.preset, begun.steps
