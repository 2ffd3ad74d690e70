"""How tall a domino the first can topple."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from domino_env.core.types import Floats
from domino_env.physics.wave import Wave, WaveBatch
from domino_env.scenes.objectives.base import Objective, ScoreGradient
from domino_env.scenes.waves import LayoutBatch, Waves


@dataclass(frozen=True)
class Magnify(Objective):
    """The height of the last domino, if the wave topples it [m]."""

    name: ClassVar[str] = "magnify"
    unit: ClassVar[str] = "m"
    failure: ClassVar[str] = "no height"

    def success(self, waves: Waves) -> Floats:
        """Take the heights (B,) of the last dominoes."""
        return waves.last_height

    def derivatives(self, waves: WaveBatch, batch: LayoutBatch) -> ScoreGradient:
        """Return 1 by the last height, 0 by everything else."""
        gradient = ScoreGradient.zero(batch)
        gradient.height[:, -1] = 1.0
        return gradient

    def in_words(self, score: float, wave: Wave) -> str:
        """Say how high the last domino is."""
        return f"last domino {score:.6f} m high"

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Ask for free heights."""
        if tables.growth is None:
            yield "the table [growth] is missing: objective = 'magnify' needs free heights"
