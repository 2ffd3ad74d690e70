"""Result of a training for one scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from agents.base.building import Built
from agents.base.training import TrainingRun
from domino_env.core.results import draw


@dataclass(frozen=True, eq=False)
class Run(TrainingRun):
    """Result of a training for one scene.

    Attributes
    ----------
    folder
        Where all of it lies.
    steps
        Dominoes placed.
    seconds
        Time that it took.
    curve
        A tuple for each evaluation, as in progress.csv.
    interrupted
        Whether it was ended by hand.
    algorithm
        What was trained.
    built
        The row of the best policy.
    """

    algorithm: str
    built: Built

    def __repr__(self) -> str:
        scene, built = self.built.scene, self.built
        found = scene.against_uniform(built.score, built.wave)
        how = f"{self.steps:,} dominoes placed in {self.seconds:.0f} s; {self.folder}"
        return f"Run({self.algorithm} on {scene.name}: {found}; {how})"

    def _repr_html_(self) -> str:
        return self.built._repr_html_()

    def plot(self) -> Any:
        """Draw both rows, what differs along them, the training; returns a Matplotlib figure."""
        return draw("training", self)
