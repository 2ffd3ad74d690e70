"""Mean speed from the first pivot to the last, over a free or a fixed length."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from domino_env.core.types import Floats
from domino_env.physics.gradient import with_length_gradient
from domino_env.physics.physics import Physics
from domino_env.physics.wave import WaveBatch
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.objectives.base import Objective, ScoreGradient


def typical_speed(height: float, physics: Physics) -> float:
    """Return √(g h), in place of the speed of a uniform baseline that stops [m/s]."""
    return float(np.sqrt(physics.gravity * height))


@dataclass(frozen=True)
class MeanSpeed(Objective):
    """Mean speed of the wave [m/s], over a free length unless the scene has one."""

    name: ClassVar[str] = "mean_speed"
    unit: ClassVar[str] = "m/s"
    failure: ClassVar[str] = "no speed"
    is_mean_speed: ClassVar[bool] = True
    rewards_steps: ClassVar[bool] = True
    needs_time_gradient: ClassVar[bool] = True

    def success(self, waves: WaveBatch) -> Floats:
        """Return the mean speeds (B,) [m/s]."""
        return waves.mean_speed

    def derivatives(self, waves: WaveBatch, layouts: LayoutBatch) -> ScoreGradient:
        """Return the derivatives of v = l/t, dv = (dl - v dt)/t, with length l and total time t."""
        time_gradient = waves.gradient
        assert time_gradient is not None
        time = np.where(waves.propagated, waves.total_time, 1.0)[:, None]
        speed = waves.mean_speed[:, None]
        if time_gradient.rise is not None:
            names = "spacing", "thickness", "height", "rise", "tilt"
            by_time = {name: -speed / time * getattr(time_gradient, name) for name in names}
            gradient = with_length_gradient(replace(time_gradient, **by_time), layouts, 1.0 / time)
            return ScoreGradient.from_gradient(layouts.along_ground(gradient))
        return ScoreGradient(
            (1.0 - speed * time_gradient.spacing) / time,
            (1.0 - speed * time_gradient.thickness[:, 1:]) / time,
            -speed * time_gradient.height[:, 1:] / time,
        )

    def typical(self, height: float, physics: Physics) -> float:
        """Return `typical_speed`."""
        return typical_speed(height, physics)

    def format_score(self, score: float, digits: int = 6) -> str:
        """Format the speed."""
        return f"{score:.{digits}f} m/s"
