"""Height of the last domino."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from domino_env.core.types import Floats
from domino_env.physics.physics import Physics
from domino_env.physics.wave import WaveBatch
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.objectives.base import Objective, ScoreGradient


@dataclass(frozen=True)
class Magnify(Objective):
    """Height of the last domino, if the wave topples it [m]."""

    name: ClassVar[str] = "magnify"
    unit: ClassVar[str] = "m"
    failure: ClassVar[str] = "no height"

    def success(self, waves: WaveBatch) -> Floats:
        """Return the heights (B,) of the last dominoes [m]."""
        return np.asarray(waves.arrays.height[:, -1])

    def derivatives(self, waves: WaveBatch, layouts: LayoutBatch) -> ScoreGradient:
        """Return 1 for the last height and 0 for all other sizes."""
        zeros = np.zeros(layouts.spacing.shape)
        by_height = zeros.copy()
        by_height[:, -1] = 1.0
        return ScoreGradient(zeros, zeros, by_height)

    def typical(self, height: float, physics: Physics) -> float:
        """Return the height of the first domino."""
        return height

    def format_score(self, score: float, digits: int = 6) -> str:
        """Format the height of the last domino."""
        return f"last domino {score:.6f} m high"

    @classmethod
    def violations(cls, scene: Any) -> Iterator[str]:
        """Yield a sentence if the heights are not free."""
        if scene.growth is None:
            yield "the table [growth] is missing: objective = 'magnify' needs free heights"
