"""The mean speed from the first pivot to the last, over a length that is free or a fixed course."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from domino_env.physics.gradient import HillGradient, longer_over_hills
from domino_env.physics.wave import Outcome, Wave, WaveBatch
from domino_env.scenes.objectives.base import Evaluation, Objective, Slopes
from domino_env.scenes.waves import Floats, LayoutBatch, Waves


@dataclass(frozen=True)
class Speed(Objective):
    """A success scores the mean speed of its wave [m/s]."""

    unit: ClassVar[str] = "m/s"
    failure: ClassVar[str] = "no speed"
    rewards_speed: ClassVar[bool] = True
    is_mean_speed: ClassVar[bool] = True

    def success(self, waves: Waves) -> Floats:
        """Score waves (B,) by their mean speeds."""
        return waves.mean_speed

    def evaluate_with_slopes(self, rows: LayoutBatch) -> tuple[Evaluation, Slopes]:
        """Simulate layouts and score them, with the derivatives of the mean speeds."""
        batch = rows.simulate(gradient=True)
        return self.judge(Waves.of_batch(batch, rows)), speed_slopes(batch, rows)

    def in_words(self, score: float, wave: Wave) -> str:
        """Say the speed of a success."""
        return f"{score:.6f} m/s"


class MeanSpeed(Speed):
    """The mean speed of a row whose length is free, unless the scene fixes it too."""

    name: ClassVar[str] = "mean_speed"
    is_ratio: ClassVar[bool] = True


class Time(Speed):
    """The same over a course of fixed length, so that the shortest time scores most."""

    name: ClassVar[str] = "time"

    @classmethod
    def clashes(
        cls, *, count: int, length: float | None, grows: bool, limited: bool, settings: Any
    ) -> Iterator[str]:
        """Ask for a course."""
        if length is None:
            yield "row.length is missing: objective = 'time' needs a course"


def speed_slopes(batch: WaveBatch, rows: LayoutBatch) -> Slopes:
    """Differentiate mean speeds: v = length / t, and the length grows with gaps and thicknesses.

    Parameters
    ----------
    batch
        Waves with the gradient of their time; those that died get numbers that mean nothing.
    rows
        What fell.
    """
    assert batch.gradient is not None
    time = np.where(batch.outcome == Outcome.PROPAGATED, batch.total_time, 1.0)[:, None]
    speed = batch.mean_speed[:, None]
    if isinstance(batch.gradient, HillGradient):
        names = "spacing", "thickness", "height", "rise", "tilt"
        fallen = {name: -speed / time * getattr(batch.gradient, name) for name in names}
        longer = longer_over_hills(replace(batch.gradient, **fallen), rows, 1.0 / time)
        return Slopes.of(rows.followed(longer))
    return Slopes(
        (1.0 - speed * batch.gradient.spacing) / time,
        (1.0 - speed * batch.gradient.thickness[:, 1:]) / time,
        -speed * batch.gradient.height[:, 1:] / time,
    )
