"""Training for one scene: an algorithm of stable-baselines3, and the best policy that it came to.

What the folder holds: `agents.base.run_files` and `agents.single.documents`.
"""

from __future__ import annotations

import json
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from agents.base.building import build
from agents.base.requirements import require_learning
from agents.base.run_files import POLICY, require_begun, sole_writer
from agents.base.training import Training
from agents.sb3.presets import ALGORITHMS, Preset, preset
from agents.single.documents import BUILT, FILES, SCENE, SceneProgressDocument, read_config
from agents.single.policy import ScenePolicy
from agents.single.result import Run
from domino_env import Scene, load_scene
from domino_env.core.files import require_none, write_text
from domino_env.core.models import model_of

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm
    from stable_baselines3.common.callbacks import BaseCallback

    from optimize.result import SearchResult

COMPARED = 0.1  # of the training's time is what CMA-ES gets, for the line in the picture
LONGEST_COMPARED = 20.0  # [s]


def train(
    scene: str | Scene,
    algorithm: str = "ppo",
    steps: int | None = None,
    seed: int = 0,
    folder: str | Path | None = None,
    *,
    resume: bool = False,
    progress: bool | None = False,
    plan: Preset | None = None,
) -> Run:
    """Train an agent to build rows for a scene.

    Ctrl-C ends it with the best policy so far. A run that was stopped goes on from its last
    checkpoint, and comes to what it would have come to undisturbed.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    algorithm
        "apg", "ppo" or "ars".
    steps
        Dominoes to place in all; None for the preset's.
    seed
        The same seed on the same machine gives the same weights.
    folder
        Where the run is kept; None for runs/SCENE-ALGORITHM.
    resume
        Go on from the checkpoint in the folder, with its scene, seed and steps.
    progress
        Whether to show a progress bar; None: on a terminal, elsewhere a line now and then.
    plan
        Another preset.

    Returns
    -------
    Run
        What it came to.

    Raises
    ------
    ImportError
        Where the extra "rl" is missing.
    ValueError
        For an unknown algorithm or scene, for a folder that holds another run or in which one
        still runs, and for nothing to go on from.
    """
    if algorithm not in ALGORITHMS:
        raise ValueError(f"there is no algorithm '{algorithm}': choose {', '.join(ALGORITHMS)}")
    if steps is not None and steps < 1:
        raise ValueError(f"steps = {steps}: give 1 or more")
    require_learning()
    target = scene if isinstance(scene, Scene) else load_scene(scene)
    home = Path(folder or f"runs/{target.name}-{algorithm}")
    if resume:
        target, algorithm, seed, plan, steps = _as_begun(home)
    else:
        require_none(home, FILES)
    plan = plan or preset(algorithm, target.count - 1)
    state = np.random.get_state()  # noqa: NPY002 - the learner draws from the global stream
    try:
        with sole_writer(home):
            training = SceneTraining(
                target, algorithm, plan, steps or plan.steps, seed, home, progress
            )
            return training.result(training.run(resume))
    finally:
        np.random.set_state(state)  # noqa: NPY002


class SceneTraining(Training[SceneProgressDocument]):
    """A training for one scene while it runs; its steps are dominoes.

    Parameters
    ----------
    scene, algorithm, plan, total, seed, folder, progress
        As of `train`.
    """

    COLUMNS = (
        "steps", "seconds", "score", "best_score", "sampled_best", "deviation", "reference",
        "processor_seconds",
    )  # fmt: skip
    EVALUATIONS, CHECKPOINTS = 200, 40

    def __init__(
        self,
        scene: Scene,
        algorithm: str,
        plan: Preset,
        total: int,
        seed: int,
        folder: Path,
        progress: bool | None = False,
    ) -> None:
        from stable_baselines3.common.logger import Logger

        from agents.sb3.learner import learner
        from agents.sb3.vec_env import DominoVecEnv

        super().__init__(folder, seed, total, " dominoes", progress)
        self.scene, self.algorithm, self.plan = scene, algorithm, plan
        self.env = DominoVecEnv(scene, plan.rows)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about batches that do not divide evenly
            self.model: BaseAlgorithm = learner(algorithm, plan, self.env, seed)
        self.model.set_logger(Logger(folder=None, output_formats=[]))
        self.best = -np.inf
        self.sampled = -np.inf

    @property
    def steps(self) -> int:
        """Dominoes placed so far."""
        return int(self.model.num_timesteps)

    # learning -------------------------------------------------------------------------------------

    def prepare(self) -> None:
        """Write the scene."""
        write_text(self.folder / SCENE, self.scene.to_toml())

    def learn(self) -> None:
        """Let the algorithm learn; between its updates are its rollouts."""
        self._log()
        left = self.total - self.steps
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            self.model.learn(left, callback=self._callback(), reset_num_timesteps=False)

    def _callback(self) -> BaseCallback:
        from stable_baselines3.common.callbacks import BaseCallback

        training = self

        class Callback(BaseCallback):
            def _on_rollout_start(self) -> None:
                training.between_updates()

            def _on_step(self) -> bool:
                for info in self.locals.get("infos", ()):
                    if "score" in info:
                        training.sampled = max(training.sampled, float(info["score"]))
                return True

        return Callback()

    def _log(self) -> None:
        """Scalars for TensorBoard if it is installed; the learning curve is kept either way."""
        from stable_baselines3.common.logger import configure

        if find_spec("tensorboard") is not None:
            self.model.set_logger(configure(str(self.folder / "tensorboard"), ["tensorboard"]))

    def between_updates(self) -> None:
        """Evaluate, write a checkpoint, and set what changes along the way."""
        from agents.sb3.learner import set_deviation

        super().between_updates()
        set_deviation(self.model, self.deviation())
        if self.plan.follow:
            self.env.follow(float(max(self.best, self.sampled)))

    def after_checkpoint(self) -> None:
        """Begin with new rows, as a run does that goes on from there."""
        model: Any = self.model
        model._last_obs = self.env.reset()
        model._last_episode_starts = np.ones(self.env.num_envs, dtype=bool)

    def deviation(self) -> float:
        """Give the standard deviation of the actions as of now."""
        return self.plan.deviation(min(self.steps / self.total, 1.0))

    # evaluating -----------------------------------------------------------------------------------

    def evaluate(self) -> None:
        """Let the policy build a row without noise; keep the policy if it is the best so far."""
        from agents.sb3.learner import policy_of, save_weights

        speed = float(self.env.rows.reference_speed)
        uniform_speed = self.scene.uniform().wave.mean_speed
        built = build(policy_of(self.model), self.scene, speed)
        if built.score > self.best:
            self.best = built.score
            save_weights(self.model.policy, self.folder / POLICY)
            document = {
                "score": built.score,
                "gain": built.gain,
                "steps": self.steps,
                "seconds": self.clock.seconds,
                "reference_over_uniform": speed / uniform_speed if uniform_speed > 0.0 else 1.0,
            }
            write_text(self.folder / BUILT, json.dumps(document, indent=1) + "\n")
            built.layout.to_csv(self.folder / "layout.csv")
            built.layout.to_json(self.folder / "layout.json")
        self.curve.append(
            (
                float(self.steps), self.clock.seconds, built.score, self.best, self.sampled,
                self.deviation(), speed, self.clock.processor_seconds,
            )
        )  # fmt: skip
        self.model.logger.record("design/score", built.score)
        self.model.logger.record("design/best_score", self.best)
        self.bar.set_postfix_str(
            f"best {self.best:.4f}, uniform {built.uniform.score:.4f}", refresh=False
        )

    # keeping --------------------------------------------------------------------------------------

    def config(self) -> dict[str, Any]:
        """Give what it is begun with."""
        return {
            "algorithm": self.algorithm,
            "seed": self.seed,
            "steps": self.total,
            "preset": self.plan.to_dict(),
        }

    def progress(self) -> dict[str, Any]:
        """Give how far it has come."""
        return super().progress() | {
            "best": float(self.best),
            "sampled": float(self.sampled),
            "reference": float(self.env.rows.reference_speed),
        }

    def state(self, progress: dict[str, Any]) -> dict[str, Any]:
        """Give the learner's state, and the progress as "more"."""
        from agents.sb3.state import state_of

        return state_of(self.model) | {"more": progress}

    def restore(self, state: dict[str, Any]) -> SceneProgressDocument:
        """Go back to what `state` gave."""
        from agents.sb3.state import restore

        restore(self.model, state)
        found = model_of(SceneProgressDocument, state["more"])
        self.best, self.sampled = found.best, found.sampled
        self.env.rows.reference_speed = found.reference
        return found

    def result(self, interrupted: bool) -> Run:
        """Write the summary and the picture, and give both as a result."""
        from agents.single.picture import draw

        built = ScenePolicy.load(self.folder).build()
        run = Run(
            self.folder, self.steps, self.clock.seconds, tuple(self.curve), interrupted,
            self.algorithm, built,
        )  # fmt: skip
        document = {
            "scene": self.scene.name,
            "algorithm": self.algorithm,
            "seed": self.seed,
            "score": built.score,
            "uniform_score": built.uniform.score,
            "gain": built.gain,
            "last_score": self.curve[-1][2],
        }
        rival = None if interrupted else _rival(self.scene, COMPARED * run.seconds)
        if rival is not None:
            document |= {"cma_score": rival.score, "cma_seconds": rival.seconds}
        self.write_summary(interrupted, document)
        draw(run, rival, self.folder / "result.png")
        return run


def _rival(scene: Scene, seconds: float) -> SearchResult | None:
    """What CMA-ES finds meanwhile; None where the training was too short to compare."""
    from optimize import search

    if seconds < 1.0:
        return None
    given = min(seconds, LONGEST_COMPARED)
    return search(scene, "cma", seconds=given, progress=False)


def _as_begun(folder: Path) -> tuple[Scene, str, int, Preset, int]:
    """What a run in this folder was begun with."""
    require_begun(folder)
    begun = read_config(folder)
    if begun.algorithm == "ars":
        raise ValueError("ars keeps no checkpoint that it can go on from: begin anew")
    return load_scene(folder / SCENE), begun.algorithm, begun.seed, begun.preset, begun.steps
