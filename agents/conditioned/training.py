"""Teach a designer for a family of scenes, in a folder from which it can go on.

config.json   family, teaching, seed, versions     progress.csv   the learning curve
examples.npz  rows that search found               policy.npz     weights, plain arrays
checkpoint.pt all that going on needs (no pickled code)           summary.json
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from agents.base.clock import Clock
from agents.base.requirements import require_extra
from agents.base.run_files import Count, Score, Seconds, Seed, require_columns
from agents.conditioned.distribution import SceneFamily
from agents.conditioned.examples import Examples, make_examples
from agents.conditioned.policy import Designer, arrays_of, load_designer, plans_of
from agents.conditioned.preset import EXAMPLES_SEED, Teaching
from domino_env.scenes.scene import Scene
from domino_env.support.files import write_bytes, write_text
from domino_env.support.models import Document, model_of
from domino_env.support.reading import naming, read_json
from domino_env.support.tables import write_csv

if TYPE_CHECKING:
    from agents.conditioned.learner import Learner

Floats = NDArray[np.float64]

CHECKED = 64  # scenes that the learning curve is taken on
LOOKS = 40  # points of the curve, and checkpoints
COLUMNS = ("step", "seconds", "gain", "beaten", "gain_untried", "beaten_untried")
FILES = ("config.json", "checkpoint.pt", "policy.npz")
ORDER, BATCH, CHECK = 1, 2, 3  # what random numbers are for, beside the seed


class BegunDocument(Document):
    """What a training was begun with: config.json."""

    seed: Seed
    teaching: Teaching
    family: SceneFamily


class TeachingProgress(Document):
    """How far a training had come, in its checkpoint."""

    done: Count
    seconds: Seconds
    processor_seconds: Seconds
    curve: list[tuple[Score, ...]]


@dataclass(frozen=True, eq=False)
class Taught:
    """Result of the training of a designer.

    Attributes
    ----------
    folder
        Where all of it lies.
    designer
        The policy.
    steps
        Passes and batches done.
    seconds
        Time that it took.
    curve
        A tuple of `COLUMNS` for each evaluation along the way.
    interrupted
        Whether it was ended by hand.
    """

    folder: Path
    designer: Designer
    steps: int
    seconds: float
    curve: tuple[tuple[float, ...], ...]
    interrupted: bool


def teach(
    folder: str | Path = "runs/family",
    seed: int = 0,
    teaching: Teaching | None = None,
    family: SceneFamily | None = None,
    *,
    examples: str | Path | None = None,
    resume: bool = False,
    progress: bool = False,
) -> Taught:
    """Train a designer on random scenes of a family.

    Ctrl-C ends it with what was learned so far; a kill loses what came after the last checkpoint.

    Parameters
    ----------
    folder
        Where the run is kept.
    seed
        The same seed on the same machine gives the same weights.
    teaching
        Hyperparameters; None for those of the policy that ships.
    family
        What scenes are drawn from; None for that of the policy that ships.
    examples
        A file of examples, which do not depend on the seed: made before for the same family and
        number, or to be made; None for one in the folder.
    resume
        Go on from the checkpoint in the folder, with its seed, teaching and family.
    progress
        Whether to show progress bars.

    Raises
    ------
    ImportError
        Where the extra "rl" is missing.
    ValueError
        For a folder that holds another run, and for nothing to go on from.
    """
    if seed < 0:
        raise ValueError(f"seed = {seed}: give a whole number, 0 or more")
    require_extra()
    home = Path(folder)
    if resume:
        seed, teaching, family = _as_begun(home)
    elif (home / "config.json").exists() or (home.is_dir() and any(home.iterdir())):
        raise ValueError(f"{home} is not empty: name another folder, or go on with --resume")
    kept = Path(examples) if examples is not None else home / "examples.npz"
    run = _Teaching(home, seed, teaching or Teaching(), family or SceneFamily(), kept, progress)
    return run.run(resume)


class _Teaching:
    """One teaching while it runs."""

    def __init__(
        self,
        home: Path,
        seed: int,
        teaching: Teaching,
        family: SceneFamily,
        examples: Path,
        progress: bool,
    ) -> None:
        from agents.conditioned.learner import Learner

        self.home, self.seed, self.teaching, self.family = home, seed, teaching, family
        self.examples, self.progress = examples, progress
        self.learner: Learner = Learner(teaching, seed)
        self.passes = teaching.passes if teaching.examples else 0
        self.total = self.passes + teaching.batches
        self.done = 0
        self.curve: list[tuple[float, ...]] = []
        self.clock = Clock()
        rng = np.random.default_rng([seed, CHECK])
        self.checked = [family.draw(rng) for _ in range(CHECKED)]

    def run(self, resume: bool) -> Taught:
        if resume:
            self._restore()
        else:
            self._begin()
        interrupted = False
        try:
            self._learn()
        except KeyboardInterrupt:
            interrupted = True
        self._look()
        self._keep()
        designer = load_designer(self.home / "policy.npz")  # rounded as it is kept
        taught = Taught(
            self.home, designer, self.done, self.clock.seconds, tuple(self.curve), interrupted
        )
        document = {
            "finished": not interrupted,
            "steps": self.done,
            "seconds": self.clock.seconds,
            "processor_seconds": self.clock.processor_seconds,
        }
        document |= dict(zip(COLUMNS[2:], self.curve[-1][2:], strict=True))
        write_text(self.home / "summary.json", json.dumps(document, indent=1) + "\n")
        return taught

    def _learn(self) -> None:
        from tqdm import tqdm

        pairs: list[tuple[Floats, Floats]] = []
        if self.done < self.passes:
            plan = self.teaching
            found = make_examples(
                self.family, plan.examples, EXAMPLES_SEED, plan.evaluations, self.examples,
                self.progress,
            )  # fmt: skip
            pairs = _pairs(found)
        next_look = self.done + max(self.total // LOOKS, 1)
        with tqdm(total=self.total, initial=self.done, disable=not self.progress) as bar:
            while self.done < self.total:
                if self.done < self.passes:
                    self._imitate(pairs)
                else:
                    self._climb(self.done - self.passes)
                self.done += 1
                bar.update()
                if self.done >= next_look and self.done < self.total:
                    self._look()
                    self._keep()
                    bar.set_postfix_str(f"gain {self.curve[-1][2]:.2%}")
                    next_look = self.done + max(self.total // LOOKS, 1)

    def _imitate(self, pairs: list[tuple[Floats, Floats]]) -> None:
        """One pass over the examples."""
        size = self.teaching.together
        order = np.random.default_rng([self.seed, ORDER, self.done]).permutation(len(pairs))
        for i in range(0, len(order), size):
            part = (self.done + i / len(order)) / self.passes
            self.learner.imitate([pairs[j] for j in order[i : i + size]], part)

    def _climb(self, batch: int) -> None:
        """One batch of fresh scenes."""
        rng = np.random.default_rng([self.seed, BATCH, batch])
        scenes = [self.family.draw(rng) for _ in range(self.teaching.scenes)]
        self.learner.climb(scenes, rng, batch / self.teaching.batches)

    def _look(self) -> None:
        """What the policy gains in scenes of its own, with its plans tried and untried."""
        gains = np.array([_gains(self.learner.designer(), scene) for scene in self.checked])
        tried, untried = gains.T
        self.curve.append(
            (
                float(self.done), self.clock.seconds,
                float(np.mean(tried)), float(np.mean(tried > 0.0)),
                float(np.mean(untried)), float(np.mean(untried > 0.0)),
            )
        )  # fmt: skip

    def _keep(self) -> None:
        """Write checkpoint, weights and learning curve."""
        import torch

        arrays: dict[str, Any] = dict(arrays_of(self.learner.designer()))
        write_bytes(
            self.home / "policy.npz",
            lambda file: np.savez_compressed(file, allow_pickle=False, **arrays),
        )
        state = {
            "learner": self.learner.state(),
            "done": self.done,
            "curve": [list(row) for row in self.curve],
            "seconds": self.clock.seconds,
            "processor_seconds": self.clock.processor_seconds,
        }
        write_bytes(self.home / "checkpoint.pt", lambda file: torch.save(state, file))
        rows = ([f"{x:.10g}" for x in row] for row in self.curve)
        write_csv(self.home / "progress.csv", COLUMNS, rows)

    def _begin(self) -> None:
        from domino_env.support.provenance import versions

        self.home.mkdir(parents=True, exist_ok=True)
        document = {
            "algorithm": "family",
            "seed": self.seed,
            "teaching": asdict(self.teaching),
            "family": asdict(self.family),
            "versions": versions(),
        }
        write_text(self.home / "config.json", json.dumps(document, indent=1) + "\n")

    def _restore(self) -> None:
        from agents.base.checkpoint import require_finite, taken_up

        with taken_up(self.home / "checkpoint.pt") as state:
            self.learner.restore(state["learner"])
            require_finite(self.learner.row)
            found = model_of(TeachingProgress, state)
            require_columns(found.curve, COLUMNS)
        self.done, self.curve = found.done, found.curve
        self.clock.go_on(found.seconds, found.processor_seconds)


def _gains(designer: Designer, scene: Scene) -> tuple[float, float]:
    """Over the best uniform row: of the best plan, and of the one that is preferred."""
    plans = np.arange(plans_of(scene.count), dtype=np.float64)
    scores = scene.score_batch(designer.gaps(scene, plans), None)
    mark = scene.uniform().score
    return float(scores.max() / mark - 1.0), float(scores[designer.ranked(scene)[0]] / mark - 1.0)


def _pairs(examples: Examples) -> list[tuple[Floats, Floats]]:
    """Features and gaps over h, of the rows that beat the uniform one or equal it."""
    good = np.flatnonzero(examples.score > 0.0)
    return [(examples.scenes[i], examples.gaps[i, : int(examples.scenes[i, 2]) - 1]) for i in good]


def _as_begun(home: Path) -> tuple[int, Teaching, SceneFamily]:
    """What a teaching in this folder was begun with."""
    if not all((home / name).exists() for name in FILES):
        raise ValueError(f"{home} holds no checkpoint: there is nothing to go on from")
    path = home / "config.json"
    with naming(path):
        begun = model_of(BegunDocument, read_json(path))
    return begun.seed, begun.teaching, begun.family
