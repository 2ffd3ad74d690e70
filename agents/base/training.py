"""Training: the loop that every training shares, in a folder from which it can go on.

What differs is a subclass: what is learned between two evaluations, what an evaluation is, and what
else is kept.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from agents.base.clock import Clock
from agents.base.run_files import (
    CHECKPOINT,
    CONFIG,
    PROGRESS,
    SUMMARY,
    ProgressDocument,
    require_columns,
)
from domino_env.core.files import write_text
from domino_env.core.progress import progress_bar
from domino_env.core.results import versions
from domino_env.core.tables import write_csv


@dataclass(frozen=True, eq=False)
class TrainingRun:
    """Result of a training.

    Attributes
    ----------
    folder
        Where all of it lies.
    steps
        Steps taken.
    seconds
        Time that it took.
    curve
        The learning curve: a tuple for each evaluation.
    interrupted
        Whether it was ended by hand.
    """

    folder: Path
    steps: int
    seconds: float
    curve: tuple[tuple[float, ...], ...]
    interrupted: bool


Progress = TypeVar("Progress", bound=ProgressDocument)


class Training(ABC, Generic[Progress]):
    """A training while it runs.

    Parameters
    ----------
    folder
        Where it is kept.
    seed
        Of all its randomness.
    total
        Steps to take in all.
    unit
        What a step is, for the progress bar.
    progress
        Whether to show one; None: a bar on a terminal, elsewhere a line now and then.
    """

    COLUMNS: ClassVar[tuple[str, ...]]
    EVALUATIONS: ClassVar[int]
    CHECKPOINTS: ClassVar[int]

    def __init__(
        self, folder: Path, seed: int, total: int, unit: str, progress: bool | None
    ) -> None:
        self.folder, self.seed, self.total = folder, seed, total
        self.curve: list[tuple[float, ...]] = []
        self.clock = Clock()
        self.next_evaluation = self.next_checkpoint = 0
        self.bar = progress_bar(progress, total=total, unit=unit, unit_scale=True)

    # what differs ---------------------------------------------------------------------------------

    @property
    @abstractmethod
    def steps(self) -> int:
        """Steps taken so far."""

    @abstractmethod
    def learn(self) -> None:
        """Take the steps that are left, and call `between_updates` between any two updates."""

    @abstractmethod
    def evaluate(self) -> None:
        """Evaluate the policy: a row of the curve, and the weights where they are to be kept."""

    @abstractmethod
    def config(self) -> dict[str, Any]:
        """Give what it is begun with, for config.json."""

    @abstractmethod
    def state(self, progress: dict[str, Any]) -> dict[str, Any]:
        """Give all that going on needs, and the progress with it."""

    @abstractmethod
    def restore(self, state: dict[str, Any]) -> Progress:
        """Go back to what `state` gave, and return the progress that was in it."""

    def prepare(self) -> None:
        """Do what comes before the first step of a new training."""

    def after_checkpoint(self) -> None:
        """Do what a training does that goes on from the checkpoint just written."""

    # what is shared -------------------------------------------------------------------------------

    def run(self, resume: bool) -> bool:
        """Train from the beginning, or from the checkpoint in the folder.

        Ctrl-C ends it: half an update is nothing to go on from, so the last checkpoint stays.

        Returns
        -------
        bool
            Whether it was ended by hand.
        """
        from agents.base.checkpoint import read_checkpoint

        if resume and (self.folder / CHECKPOINT).exists():
            with read_checkpoint(self.folder / CHECKPOINT) as state:
                found = self.restore(state)
                require_columns(found.curve, self.COLUMNS)
            self.curve = found.curve
            self.clock.go_on(found.seconds, found.processor_seconds)
            self.next_evaluation = found.next_evaluation
            self.next_checkpoint = found.next_checkpoint
            self.bar.update(self.steps)
        else:
            self._begin()
        interrupted = False
        if self.steps < self.total:
            try:
                self.learn()
            except KeyboardInterrupt:
                interrupted = True
        evaluated = bool(self.curve) and self.curve[-1][0] == self.steps
        if not self.curve or not (interrupted or evaluated):
            self.evaluate()
        if interrupted:
            self._write_curve()
        else:
            self.checkpoint()
        self.bar.close()
        return interrupted

    def _begin(self) -> None:
        self.prepare()
        self.checkpoint()  # before what says that there is something to go on from
        document = self.config() | {"versions": versions()}
        write_text(self.folder / CONFIG, json.dumps(document, indent=1) + "\n")

    def between_updates(self) -> None:
        """Evaluate and write a checkpoint where it is time."""
        steps = self.steps
        if steps >= self.next_evaluation:
            self.evaluate()
            self.next_evaluation = steps + self.total // self.EVALUATIONS
        if steps >= self.next_checkpoint:
            self.next_checkpoint = steps + self.total // self.CHECKPOINTS
            self.checkpoint()
            self.after_checkpoint()
        self.bar.update(steps - self.bar.n)

    def progress(self) -> dict[str, Any]:
        """Give how far it has come, for the checkpoint."""
        return {
            "curve": [list(row) for row in self.curve],
            "seconds": self.clock.seconds,
            "processor_seconds": self.clock.processor_seconds,
            "next_look": self.next_evaluation,
            "next_keep": self.next_checkpoint,
        }

    def checkpoint(self) -> None:
        """Write the checkpoint and the learning curve."""
        from agents.base.checkpoint import write_checkpoint

        write_checkpoint(self.folder / CHECKPOINT, self.state(self.progress()))
        self._write_curve()

    def _write_curve(self) -> None:
        rows = ([f"{x:.10g}" for x in row] for row in self.curve)
        write_csv(self.folder / PROGRESS, self.COLUMNS, rows)

    def write_summary(self, interrupted: bool, document: dict[str, Any]) -> None:
        """Write what it came to."""
        document = {
            "finished": not interrupted,
            **document,
            "steps": self.steps,
            "seconds": self.clock.seconds,
            "processor_seconds": self.clock.processor_seconds,
        }
        write_text(self.folder / SUMMARY, json.dumps(document, indent=1) + "\n")
