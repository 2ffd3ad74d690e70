"""What every objective says of itself, and how a wave becomes a score.

A success scores more than 0.  A wave that dies scores between -1 and 0, higher the further it came.
One that runs through but breaks a limit scores between -1/2 and 0, higher the less it breaks it,
and deaths then stay below -1/2.  So any two layouts can be compared, and a search can climb.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields
from types import NoneType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from domino_env.core.brief import brief
from domino_env.core.models import Table
from domino_env.physics.gradient import Gradient
from domino_env.physics.ground import Ground
from domino_env.physics.wave import Wave
from domino_env.scenes.limits import Limits
from domino_env.scenes.waves import Floats, Ints, LayoutBatch, Waves


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What B layouts came to.

    Attributes
    ----------
    score
        (B,) higher is better.
    reach
        (B,) how far the wave came, as of `Wave`; 1 where it ran through.  Where a score takes many
        rows: 1 where enough of them ran through, else their mean.
    falls
        (B,) how many single falls were simulated.
    """

    score: Floats
    reach: Floats
    falls: Ints

    __repr__ = brief

    @property
    def without_gradient(self) -> NDArray[np.bool_]:
        """(B,) whose scores have no exact derivatives: of waves that died or broke a limit."""
        return (self.score < 0.0) | (self.reach < 1.0)


EVALUATED = tuple(part.name for part in fields(Evaluation))


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives of B scores, (B, N-1) each, the others fixed [score/m].

    Attributes
    ----------
    spacing
        By the gaps.
    thickness, height
        By those of dominoes 1 … N-1.
    """

    spacing: Floats
    thickness: Floats
    height: Floats

    __repr__ = brief

    @classmethod
    def zero(cls, rows: LayoutBatch) -> Slopes:
        """Make room for those of so many layouts."""
        return cls(*(np.zeros(rows.spacing.shape) for _ in range(3)))

    @classmethod
    def of(cls, found: Gradient) -> Slopes:
        """Take those by which a design is made, of gradients of the scores."""
        return cls(found.spacing, found.thickness[:, 1:], found.height[:, 1:])

    def where(self, chosen: NDArray[np.bool_]) -> Slopes:
        """Keep those of the chosen rows (B,); zero for the others."""
        kept = chosen[:, None]
        return Slopes(kept * self.spacing, kept * self.thickness, kept * self.height)


class Settings(Table):
    """The table of an objective in a scene's file, named as the objective."""

    def settings(self) -> Any:
        """Give the value that a scene holds, its fields named as those of the table."""
        raise NotImplementedError


@dataclass(frozen=True)
class Objective(ABC):
    """What counts in a scene.

    One class each, in a file of its own in this folder, where it is found by itself.

    Parameters
    ----------
    settings
        What its own table says; None where it has none.
    limits
        What the wave must keep; None for none.
    ground
        What rows stand on; None for flat ground.
    """

    settings: Any
    limits: Limits | None
    ground: Ground | None = field(default=None, kw_only=True)

    name: ClassVar[str]
    """How scene files call it."""
    unit: ClassVar[str] = ""
    """Of a success's score."""
    needs_settings: ClassVar[type] = NoneType
    """What `settings` is."""
    table: ClassVar[type[Settings] | None] = None
    """The table of its name in a scene's file; None where it has none."""
    failure: ClassVar[str] = "no success"
    """In words, what a wave that dies has reached."""
    rewards_speed: ClassVar[bool] = False
    """Whether a wave that is ahead of another on the way is likely to score more."""
    is_mean_speed: ClassVar[bool] = False
    """Whether a success scores the mean speed of its wave."""
    is_ratio: ClassVar[bool] = False
    """Whether a success scores a length over a time, and a design may change both."""
    needs_arrivals: ClassVar[bool] = False
    """Whether scores depend on when each domino is hit."""

    @abstractmethod
    def success(self, waves: Waves) -> Floats:
        """Score waves (B,) that run through; what it says of others does not count."""

    def judge(self, waves: Waves) -> Evaluation:
        """Score waves that have been simulated."""
        score = waves.reach - 1.0
        if waves.propagated.any():
            score = np.where(waves.propagated, self.success(waves), score)
        if self.limits is not None:
            score = self.limits.lower(score, waves)
        return Evaluation(score, waves.reach, waves.falls)

    def evaluate(self, rows: LayoutBatch) -> Evaluation:
        """Simulate layouts and score them."""
        record = self.needs_arrivals or self.limits is not None
        return self.judge(Waves.of_batch(rows.simulate(record=record), rows))

    def evaluate_wave(self, wave: Wave) -> Evaluation:
        """Score one wave that has been simulated."""
        return self.judge(Waves.of_one(wave))

    def evaluate_waves(self, waves: Sequence[Wave]) -> Evaluation:
        """Score many waves that have been simulated."""
        found = [self.evaluate_wave(wave) for wave in waves]
        return Evaluation(
            *(np.concatenate([getattr(one, name) for one in found]) for name in EVALUATED)
        )

    def evaluate_with_slopes(self, rows: LayoutBatch) -> tuple[Evaluation, Slopes]:
        """Simulate layouts and score them, with the derivatives of the successes' scores."""
        return self.evaluate(rows), Slopes.zero(rows)

    @property
    def waves_a_score(self) -> int:
        """How many rows are simulated for one score."""
        return 1

    @abstractmethod
    def in_words(self, score: float, wave: Wave) -> str:
        """Say the score of a success in words and units."""

    @classmethod
    def clashes(
        cls, *, count: int, length: float | None, grows: bool, limited: bool, settings: Any
    ) -> Iterator[str]:
        """Say what the rest of a scene's file lacks for it, a sentence each.

        Parameters
        ----------
        count, length
            Of the row; None where the length is free [m].
        grows
            Whether the file has a table [growth].
        limited
            Whether it has a table [limits].
        settings
            What its own table says.
        """
        yield from ()
