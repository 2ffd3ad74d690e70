"""The mean speed from the first pivot to the last, over a length that is free or a fixed course."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from domino_env.core.types import Floats
from domino_env.physics.gradient import with_length_gradient
from domino_env.physics.wave import Outcome, Wave, WaveBatch
from domino_env.scenes.objectives.base import Objective, ScoreGradient
from domino_env.scenes.waves import LayoutBatch, Waves


@dataclass(frozen=True)
class Speed(Objective):
    """A success scores the mean speed of its wave [m/s]."""

    unit: ClassVar[str] = "m/s"
    failure: ClassVar[str] = "no speed"
    rewards_speed: ClassVar[bool] = True
    is_mean_speed: ClassVar[bool] = True
    differentiates_waves: ClassVar[bool] = True

    def success(self, waves: Waves) -> Floats:
        """Score waves (B,) by their mean speeds."""
        return waves.mean_speed

    def derivatives(self, waves: WaveBatch, batch: LayoutBatch) -> ScoreGradient:
        """Differentiate the mean speeds."""
        return speed_gradient(waves, batch)

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
    def violations(cls, tables: Any) -> Iterator[str]:
        """Ask for a course."""
        if tables.row.length is None:
            yield "row.length is missing: objective = 'time' needs a course"


def speed_gradient(waves: WaveBatch, batch: LayoutBatch) -> ScoreGradient:
    """Differentiate mean speeds: v = length / t, and the length grows with gaps and thicknesses.

    Parameters
    ----------
    waves
        Waves with the gradient of their time; numbers of those that stop are meaningless.
    batch
        The layouts simulated.
    """
    by = waves.gradient
    assert by is not None
    time = np.where(waves.outcome == Outcome.PROPAGATED, waves.total_time, 1.0)[:, None]
    speed = waves.mean_speed[:, None]
    if by.rise is not None:
        names = "spacing", "thickness", "height", "rise", "tilt"
        fallen = {name: -speed / time * getattr(by, name) for name in names}
        found = with_length_gradient(replace(by, **fallen), batch, 1.0 / time)
        return ScoreGradient.of(batch.along_ground(found))
    return ScoreGradient(
        (1.0 - speed * by.spacing) / time,
        (1.0 - speed * by.thickness[:, 1:]) / time,
        -speed * by.height[:, 1:] / time,
    )
