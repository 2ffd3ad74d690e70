"""Training in scenes that are drawn for every episode: one policy for all of them.

The folder holds what every training keeps (`agents.base.run_files`), and the distribution as
scene.toml.  Its scores are the median gain over the best uniform rows, in scenes of the pool.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from agents.base.building import Policy
from agents.base.requirements import require_learning
from agents.base.run_files import FILES, POLICY, require_begun, sole_writer
from agents.base.training import Training, TrainingRun
from agents.sb3.presets import ALGORITHMS, Preset, preset
from agents.single.documents import SCENE, SceneProgressDocument, read_config
from agents.single.policy import ScenePolicy
from agents.single.training import SceneTraining
from domino_env import DominoChainVector, Scene, SceneDistribution
from domino_env.core.files import require_none
from domino_env.core.models import model_of
from domino_env.scenes.distribution import load_distribution
from domino_env.scenes.io.ranges import COUNT
from domino_env.scenes.pool import ScenePool

Floats = NDArray[np.float64]

LOOKED = 50  # scenes in which a policy is looked at along the way
DIED = -1.0  # gain of a row whose wave dies
EPISODE = 32  # steps of an episode that presets are made for where lengths vary


def train_drawn(
    distribution: str | Path | SceneDistribution,
    algorithm: str = "ppo",
    steps: int | None = None,
    seed: int = 0,
    folder: str | Path | None = None,
    *,
    resume: bool = False,
    progress: bool | None = False,
    plan: Preset | None = None,
) -> TrainingRun:
    """Train a policy in scenes that are new in every episode.

    Parameters
    ----------
    distribution
        What scenes are drawn from: a name, the path of a file, or a `SceneDistribution`.
    algorithm, steps, seed, folder, resume, progress, plan
        As of `agents.single.training.train`.

    Raises
    ------
    ImportError, ValueError
        As of `agents.single.training.train`.
    """
    if algorithm not in ALGORITHMS:
        raise ValueError(f"there is no algorithm '{algorithm}': choose {', '.join(ALGORITHMS)}")
    if steps is not None and steps < 1:
        raise ValueError(f"steps = {steps}: give 1 or more")
    require_learning()
    drawn = distribution
    if not isinstance(drawn, SceneDistribution):
        drawn = load_distribution(drawn)
    home = Path(folder or f"runs/{drawn.name}-{algorithm}")
    plan = plan or preset(algorithm, episode_of(drawn), drawn=True)
    if resume:
        require_begun(home)
        begun = read_config(home)
        drawn = load_distribution(home / SCENE)
        algorithm, seed, plan, steps = begun.algorithm, begun.seed, begun.preset, begun.steps
    else:
        require_none(home, (*FILES, SCENE))
    state = np.random.get_state()  # noqa: NPY002 - the learner draws from the global stream
    try:
        with sole_writer(home):
            training = DrawnTraining(
                drawn, algorithm, plan, steps or plan.steps, seed, home, progress
            )
            return training.finished(training.run(resume))
    finally:
        np.random.set_state(state)  # noqa: NPY002


def episode_of(distribution: SceneDistribution) -> int:
    """Give the steps of a typical episode, for presets."""
    return EPISODE if COUNT in distribution.ranges else distribution.first.count - 1


class DrawnTraining(SceneTraining):
    """A training in drawn scenes while it runs.

    At every checkpoint the generators of scenes begin anew, with a seed made of the run's and of
    the steps taken, so that a run that goes on from there draws the same ones.

    Parameters
    ----------
    distribution, algorithm, plan, total, seed, folder, progress
        As of `train_drawn`.
    """

    def __init__(
        self,
        distribution: SceneDistribution,
        algorithm: str,
        plan: Preset,
        total: int,
        seed: int,
        folder: Path,
        progress: bool | None = False,
    ) -> None:
        # the environment and the learner take either
        super().__init__(cast(Scene, distribution), algorithm, plan, total, seed, folder, progress)
        self.distribution = distribution
        self._seed_scenes()
        pool = ScenePool(distribution)
        self.looked = [pool.scene(len(pool) - 1 - i) for i in range(LOOKED)]

    def after_checkpoint(self) -> None:
        """Begin with new rows, whose scenes follow from the seed and the steps taken."""
        self._seed_scenes()
        super().after_checkpoint()

    def _seed_scenes(self) -> None:
        """Seed what draws scenes, with the next reset."""
        sequence = np.random.SeedSequence((self.seed, self.steps))
        self.env.seed(int(sequence.generate_state(1)[0]))

    def evaluate(self) -> None:
        """Let the policy build in some scenes without noise; keep it if it is the best so far."""
        from agents.sb3.learner import policy_of, save_weights

        gain = float(np.median(gains_of(policy_of(self.model), self.distribution, self.looked)))
        if gain > self.best:
            self.best = gain
            save_weights(self.model.policy, self.folder / POLICY)
        self.curve.append(
            (
                float(self.steps), self.clock.seconds, gain, self.best, self.sampled,
                self.deviation(), 0.0, self.clock.processor_seconds,
            )
        )  # fmt: skip
        self.bar.set_postfix_str(f"median gain {self.best:+.2%}", refresh=False)

    def progress(self) -> dict[str, Any]:
        """Give how far it has come."""
        return Training.progress(self) | {
            "best": float(self.best),
            "sampled": float(self.sampled),
            "reference": 0.0,
        }

    def restore(self, state: dict[str, Any]) -> SceneProgressDocument:
        """Go back to what `state` gave."""
        from agents.sb3.state import restore

        restore(self.model, state)
        found = model_of(SceneProgressDocument, state["more"])
        self.best, self.sampled = found.best, found.sampled
        self._seed_scenes()
        return found

    def finished(self, interrupted: bool) -> TrainingRun:
        """Write the summary."""
        document = {
            "scene": self.distribution.name,
            "algorithm": self.algorithm,
            "seed": self.seed,
            "median_gain": self.best,
        }
        self.write_summary(interrupted, document)
        return TrainingRun(
            self.folder, self.steps, self.clock.seconds, tuple(self.curve), interrupted
        )


def gains_of_run(folder: Path, scenes: Sequence[Scene]) -> Floats:
    """Build with the best policy of a training in drawn scenes, see `gains_of`."""
    return gains_of(ScenePolicy.load(folder).policy, load_distribution(folder / SCENE), scenes)


def gains_of(policy: Policy, distribution: SceneDistribution, scenes: Sequence[Scene]) -> Floats:
    """Build a row in each scene, all side by side.

    Parameters
    ----------
    policy
        Maps observations to actions.
    distribution
        What it was trained on.
    scenes
        Of that kind.

    Returns
    -------
    ndarray
        (S,) gains over the best uniform rows; -1 where the wave dies.
    """
    rows = DominoChainVector(len(scenes), distribution, autoreset_mode="SameStep")
    seen, _ = rows.reset(options={"scene": list(scenes)})
    found = np.full(len(scenes), np.nan)
    while np.isnan(found).any():
        seen, _, ended, _, info = rows.step(policy(seen))
        for i in np.flatnonzero(ended & np.isnan(found)):
            gain = info["final_info"]["gain"][i]
            found[i] = DIED if gain is None else gain
    return found
