"""How many dominoes topple."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from domino_env.core.types import Floats
from domino_env.physics.wave import Wave
from domino_env.scenes.objectives.base import Evaluation, Objective
from domino_env.scenes.waves import Waves


@dataclass(frozen=True)
class Toppled(Objective):
    """How many dominoes topple, and a fraction that tells how far the wave came."""

    name: ClassVar[str] = "toppled"
    unit: ClassVar[str] = "dominoes"

    def success(self, waves: Waves) -> Floats:
        """Count the dominoes of waves (B,)."""
        return waves.toppled

    def score(self, waves: Waves) -> Evaluation:
        """Score simulated waves; one that stops has toppled dominoes too."""
        score = np.where(waves.propagated, waves.toppled, waves.toppled + waves.reach)
        return Evaluation(score, waves.reach, waves.falls)

    def in_words(self, score: float, wave: Wave) -> str:
        """Say how many toppled, of how many."""
        return f"{wave.toppled} of {wave.layout.count} toppled"

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Refuse limits."""
        if tables.limits is not None:
            yield "[limits] judge waves that run through: not with objective = 'toppled'"
