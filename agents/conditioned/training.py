"""Training of a scene-conditioned policy: imitation of searched rows, then exact gradients.

What the folder holds: `agents.base.run_files`, and examples.sqlite, the rows that search found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from msgspec import field
from numpy.typing import NDArray

from agents.base.requirements import require_learning
from agents.base.run_files import (
    CONFIG,
    FILES,
    POLICY,
    Count,
    ProgressDocument,
    Seed,
    require_begun,
    sole_writer,
)
from agents.base.training import Training, TrainingRun
from agents.conditioned.features import features_of
from agents.conditioned.observations import plans_of
from agents.conditioned.policy import ALGORITHM, ConditionedPolicy
from agents.conditioned.preset import ConditionedPreset
from agents.conditioned.scenes import DISTRIBUTIONS, Pools
from agents.dataset.rows import search_rows
from domino_env import Scene
from domino_env.core.brief import brief
from domino_env.core.files import require_none, write_bytes
from domino_env.core.models import Document, model_of
from domino_env.core.reading import naming, read_json

if TYPE_CHECKING:
    from agents.conditioned.learner import Learner

Floats = NDArray[np.float64]
Example = tuple[Floats, Floats, Floats]

SCENES = 64  # that the learning curve is taken on
ORDER, BATCH = 1, 2  # what random numbers are for, beside the seed


class ConditionedConfigDocument(Document):
    """What a training was begun with: config.json."""

    seed: Seed
    preset: ConditionedPreset
    distributions: tuple[str, ...] = field(name="scenes")


class ConditionedProgressDocument(ProgressDocument, kw_only=True):
    """How far a training had come, in its checkpoint."""

    done: Count


@dataclass(frozen=True, eq=False)
class ConditionedRun(TrainingRun):
    """Result of the training of a scene-conditioned policy.

    Attributes
    ----------
    folder
        Where all of it lies.
    steps
        Passes and batches done.
    seconds
        Time that it took.
    curve
        A tuple for each evaluation, as in progress.csv.
    interrupted
        Whether it was ended by hand.
    policy
        What was trained, as of the last evaluation.
    """

    policy: ConditionedPolicy

    __repr__ = brief


def train_conditioned(
    folder: str | Path = "runs/designer",
    seed: int = 0,
    preset: ConditionedPreset | None = None,
    distributions: Sequence[str] = DISTRIBUTIONS,
    *,
    examples: str | Path | None = None,
    start: str | Path | None = None,
    resume: bool = False,
    progress: bool | None = False,
) -> ConditionedRun:
    """Train a policy on random scenes.

    Ctrl-C ends it with the policy of the last evaluation. A run that was stopped goes on from its
    last checkpoint, and comes to what it would have come to undisturbed.

    Parameters
    ----------
    folder
        Where the run is kept.
    seed
        The same seed on the same machine gives the same weights.
    preset
        Hyperparameters; None for those of the policy that ships.
    distributions
        Names or files of what scenes are drawn from; the default is that of the policy that ships.
    examples
        A store of examples, which do not depend on the seed: made before for the same distributions
        and number, or to be made; None for one in the folder.
    start
        Folder of a policy to begin with; None for fresh networks.
    resume
        Go on from the checkpoint in the folder, with its seed, preset and distributions.
    progress
        Whether to show progress bars; None: on a terminal, elsewhere a line now and then.

    Returns
    -------
    ConditionedRun
        What it came to.

    Raises
    ------
    ImportError
        Where the extra "rl" is missing.
    ValueError
        For a folder that holds another run, and for nothing to go on from.
    """
    if seed < 0:
        raise ValueError(f"seed = {seed}: give a whole number, 0 or more")
    require_learning()
    home = Path(folder)
    if resume:
        seed, preset, distributions = _as_begun(home)
    else:
        require_none(home, FILES)
    kept = Path(examples) if examples is not None else home / "examples.sqlite"
    policy = None if start is None else ConditionedPolicy.load(Path(start))
    training = ConditionedTraining(
        preset or ConditionedPreset(), tuple(distributions), seed, home, kept, policy, progress
    )
    with sole_writer(home):
        return training.result(training.run(resume))


class ConditionedTraining(Training[ConditionedProgressDocument]):
    """A training on many scenes while it runs; its steps are passes over the examples, and batches.

    Parameters
    ----------
    preset, distributions, seed, folder, examples, start, progress
        As of `train_conditioned`.
    """

    COLUMNS = ("step", "seconds", "gain", "beaten", "gain_untried", "beaten_untried")
    EVALUATIONS, CHECKPOINTS = 40, 40

    def __init__(
        self,
        preset: ConditionedPreset,
        distributions: tuple[str, ...],
        seed: int,
        folder: Path,
        examples: Path,
        start: ConditionedPolicy | None = None,
        progress: bool | None = False,
    ) -> None:
        from agents.conditioned.learner import Learner

        self.preset, self.distributions, self.examples = preset, distributions, examples
        self.passes = preset.passes if preset.examples else 0
        super().__init__(folder, seed, self.passes + preset.batches, " steps", progress)
        self.learner: Learner = Learner(preset, seed, start)
        self.done = 0
        self.pools = Pools(distributions)
        self.scenes = [self.pools[len(self.pools) - 1 - i] for i in range(SCENES)]

    @property
    def steps(self) -> int:
        """Passes and batches done so far."""
        return self.done

    # learning -------------------------------------------------------------------------------------

    def learn(self) -> None:
        """Imitate the examples, then climb on fresh scenes."""
        pairs = self._examples() if self.done < self.passes else []
        while self.done < self.total:
            self.between_updates()
            if self.done < self.passes:
                self._imitate(pairs)
            else:
                self._climb(self.done - self.passes)
            self.done += 1

    def _examples(self) -> list[Example]:
        """Features, gaps and thicknesses over h, of rows that search found and that run."""
        preset = self.preset
        scenes = [self.pools[i] for i in range(preset.examples)]
        found = search_rows(
            scenes, preset.evaluations, 0, self.examples,
            {"distributions": list(self.distributions)}, progress=not self.bar.disable,
        )  # fmt: skip
        return [
            (features_of(scene), row.spacing / scene.height, row.thickness[1:] / scene.height)
            for scene, row in zip(scenes, found, strict=True)
            if row.score > 0.0
        ]

    def _imitate(self, pairs: list[Example]) -> None:
        """One pass over the examples."""
        size = self.preset.together
        order = np.random.default_rng([self.seed, ORDER, self.done]).permutation(len(pairs))
        for i in range(0, len(order), size):
            part = (self.done + i / len(order)) / self.passes
            self.learner.imitate([pairs[j] for j in order[i : i + size]], part)

    def _climb(self, batch: int) -> None:
        """One batch of scenes, any of the pools but those of the learning curve."""
        rng = np.random.default_rng([self.seed, BATCH, batch])
        chosen = rng.integers(len(self.pools) - SCENES, size=self.preset.scenes)
        scenes = [self.pools[int(i)] for i in chosen]
        self.learner.climb(scenes, rng, batch / self.preset.batches)

    # evaluating -----------------------------------------------------------------------------------

    def evaluate(self) -> None:
        """Take its gains in scenes of its own, with the plans tried and untried."""
        policy = self.learner.policy()
        arrays: dict[str, Any] = dict(policy.arrays())
        write_bytes(
            self.folder / POLICY,
            lambda file: np.savez_compressed(file, allow_pickle=False, **arrays),
        )
        tried, untried = np.array([_gains(policy, scene) for scene in self.scenes]).T
        self.curve.append(
            (
                float(self.done), self.clock.seconds,
                float(np.mean(tried)), float(np.mean(tried > 0.0)),
                float(np.mean(untried)), float(np.mean(untried > 0.0)),
            )
        )  # fmt: skip
        self.bar.set_postfix_str(f"gain {self.curve[-1][2]:.2%}", refresh=False)

    # keeping --------------------------------------------------------------------------------------

    def config(self) -> dict[str, Any]:
        """Give what it is begun with."""
        return {
            "algorithm": ALGORITHM,
            "seed": self.seed,
            "preset": asdict(self.preset),
            "scenes": list(self.distributions),
        }

    def state(self, progress: dict[str, Any]) -> dict[str, Any]:
        """Give the learner's state beside the progress."""
        return {"learner": self.learner.state(), "done": self.done} | progress

    def restore(self, state: dict[str, Any]) -> ConditionedProgressDocument:
        """Go back to what `state` gave."""
        from agents.base.checkpoint import require_finite

        self.learner.restore(state["learner"])
        require_finite(self.learner.row)
        require_finite(self.learner.plan)
        found = model_of(ConditionedProgressDocument, state)
        self.done = found.done
        return found

    def result(self, interrupted: bool) -> ConditionedRun:
        """Write the summary, and give what it came to."""
        policy = ConditionedPolicy.load(self.folder)
        self.write_summary(
            interrupted, dict(zip(self.COLUMNS[2:], self.curve[-1][2:], strict=True))
        )
        return ConditionedRun(
            self.folder, self.done, self.clock.seconds, tuple(self.curve), interrupted, policy
        )


def _gains(policy: ConditionedPolicy, scene: Scene) -> tuple[float, float]:
    """Over the best uniform row: of the best plan, and of the one that is preferred."""
    plans = np.arange(plans_of(scene.count), dtype=np.float64)
    scores = scene.score_batch(*policy.rows(scene, plans))
    baseline = scene.uniform().score
    preferred = scores[policy.ranked(scene)[0]]
    return float(scores.max() / baseline - 1.0), float(preferred / baseline - 1.0)


def _as_begun(folder: Path) -> tuple[int, ConditionedPreset, tuple[str, ...]]:
    """What a training in this folder was begun with."""
    require_begun(folder)
    path = folder / CONFIG
    with naming(path):
        begun = model_of(ConditionedConfigDocument, read_json(path))
    return begun.seed, begun.preset, begun.distributions
