"""Result of a training for one scene."""

from __future__ import annotations

from dataclasses import dataclass

from agents.base.building import Built
from agents.base.training import TrainingRun


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
    clone_score
        Of the clone that it began with; None for none.
    """

    algorithm: str
    built: Built
    clone_score: float | None = None
