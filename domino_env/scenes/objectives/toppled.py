"""Number of dominoes that topple."""

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
    """Number of dominoes that topple, plus the reach of a wave that stops."""

    name: ClassVar[str] = "toppled"
    unit: ClassVar[str] = "dominoes"

    def success(self, waves: Waves) -> Floats:
        """Return the numbers (B,) of dominoes that topple."""
        return waves.toppled

    def score(self, waves: Waves) -> Evaluation:
        """Score waves; one that stops has toppled dominoes too."""
        score = np.where(waves.propagated, waves.toppled, waves.toppled + waves.reach)
        return Evaluation(score, waves.reach, waves.falls)

    def in_words(self, score: float, wave: Wave) -> str:
        """Return the number of dominoes that topple, and of all."""
        return f"{wave.toppled} of {wave.layout.count} toppled"

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Yield that limits do not apply."""
        if tables.limits is not None:
            yield "[limits] apply to waves that complete: leave them out with objective = 'toppled'"
