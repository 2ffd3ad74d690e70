"""Interface of all objectives: how waves become scores, and the limits that waves must keep.

A success scores more than 0.  A wave that dies scores between -1 and 0, higher the further it came.
One that runs through but breaks a limit scores between -1/2 and 0, higher the less it breaks it,
and deaths then stay below -1/2.  So any two layouts can be compared, and a search can climb.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from domino_env.core.models import Value
from domino_env.core.results import brief
from domino_env.core.types import Floats, Ints
from domino_env.physics.gradient import Gradient
from domino_env.physics.ground import Ground
from domino_env.physics.wave import Wave, WaveBatch
from domino_env.scenes.waves import LayoutBatch, Waves


@dataclass(frozen=True, eq=False)
class ScoreGradient:
    """Derivatives of B scores, (B, N-1) each, by one quantity with the others fixed [score/m].

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
    def zero(cls, batch: LayoutBatch) -> ScoreGradient:
        """Return zeros for every layout of a batch."""
        return cls(*(np.zeros(batch.spacing.shape) for _ in range(3)))

    @classmethod
    def of(cls, gradient: Gradient) -> ScoreGradient:
        """Select the derivatives by the design variables."""
        return cls(gradient.spacing, gradient.thickness[:, 1:], gradient.height[:, 1:])

    def scaled(self, factor: NDArray[Any]) -> ScoreGradient:
        """Multiply the derivatives of each layout by a factor (B,)."""
        by = factor[:, None]
        return ScoreGradient(by * self.spacing, by * self.thickness, by * self.height)


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Scores of B layouts.

    Attributes
    ----------
    score
        (B,) higher is better.
    reach
        (B,) how far the wave came, as of `Wave`; 1 where it completes.  Where a score takes many
        simulations: 1 where enough of them complete, else their mean.
    falls
        (B,) number of simulated falls.
    gradient
        Derivatives of the scores, zero for layouts without success; None where not asked for.
    """

    score: Floats
    reach: Floats
    falls: Ints
    gradient: ScoreGradient | None = None

    __repr__ = brief

    @classmethod
    def joined(cls, parts: Sequence[Evaluation]) -> Evaluation:
        """Concatenate evaluations of batches, all with a gradient or all without."""
        by = [part.gradient for part in parts if part.gradient is not None]
        slopes = zip(*((one.spacing, one.thickness, one.height) for one in by), strict=True)
        found = zip(*((part.score, part.reach, part.falls) for part in parts), strict=True)
        gradient = ScoreGradient(*map(np.concatenate, slopes)) if by else None
        score, reach, falls = map(np.concatenate, found)
        return cls(score, reach, falls, gradient)

    def with_gradient(self, gradient: ScoreGradient) -> Evaluation:
        """Add the derivatives, set to zero where a layout is no success."""
        return replace(self, gradient=gradient.scaled(self.score > 0.0))

    @property
    def without_gradient(self) -> NDArray[np.bool_]:
        """(B,) whether a score has no exact derivatives: the wave stopped or broke a limit."""
        return (self.score < 0.0) | (self.reach < 1.0)


# Of a row at its limit it depends on rounding whether it keeps it.  A close look lets that pass; a
# search, which looks less closely, does not, and so proposes rows that the close look passes.
CLOSE_LOOK = 1e-9
HAIR = 1e-6


class Limits(Value, frozen=True):  # type: ignore[misc]
    """What a design must not lean on.

    Parameters
    ----------
    stall_margin
        Least allowed `Wave.stall_margin` of all falls, 0 to below 1; None for any.
    flush_loss
        Largest allowed `Wave.largest_flush_loss`, 0 or more; None for any.

    Raises
    ------
    ValueError
        With the value and what is allowed.
    """

    stall_margin: Annotated[
        Annotated[float, Meta(ge=0, lt=1)] | None, Meta(description="of all falls, at least")
    ] = None
    flush_loss: Annotated[
        Annotated[float, Meta(ge=0, le=1)] | None, Meta(description="of all flushes, at most")
    ] = None

    SCHEMA: ClassVar = {"minProperties": 1}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stall_margin is None and self.flush_loss is None:
            raise ValueError("the table is empty; it holds stall_margin, flush_loss")

    def excess(self, waves: Waves) -> Floats:
        """Return (B,) by how much the limits are broken, both parts added; 0 where kept."""
        over = np.zeros(len(waves.reach))
        if self.stall_margin is not None:
            over += np.maximum(self.stall_margin - waves.lowest_stall_margin, 0.0)
        if self.flush_loss is not None:
            over += np.maximum(waves.largest_flush_loss - self.flush_loss, 0.0)
        hair = HAIR if waves.rtol <= CLOSE_LOOK else 0.0
        return np.where(over <= hair, 0.0, over)

    def lower(self, scores: Floats, waves: Waves) -> Floats:
        """Return scores (B,), lowered where a wave breaks a limit; deaths make room for those."""
        excess = self.excess(waves)
        broken = -0.5 * excess / (1.0 + excess)
        lowered = np.where(scores < 0.0, 0.5 * scores - 0.5, scores)
        return np.where((scores > 0.0) & (excess > 0.0), broken, lowered)


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
    table: ClassVar[type[Value] | None] = None
    """Type of `settings`, the table of its name in a scene's file; None where it has none."""
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
    differentiates_waves: ClassVar[bool] = False
    """Whether `derivatives` takes waves with the gradient of their time."""
    simulates_anew: ClassVar[bool] = False
    """Whether a score takes other simulations than the wave of the layout itself."""

    @abstractmethod
    def success(self, waves: Waves) -> Floats:
        """Score waves (B,) that run through; what it says of others does not count."""

    def score(self, waves: Waves) -> Evaluation:
        """Score waves that have been simulated."""
        score = waves.reach - 1.0
        if waves.propagated.any():
            score = np.where(waves.propagated, self.success(waves), score)
        if self.limits is not None:
            score = self.limits.lower(score, waves)
        return Evaluation(score, waves.reach, waves.falls)

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate layouts and score them.

        Parameters
        ----------
        batch
            The layouts.
        gradient
            Whether to compute the derivatives of the successes' scores too.
        """
        record = self.needs_arrivals or self.limits is not None
        waves = batch.simulate(record=record, gradient=gradient and self.differentiates_waves)
        found = self.score(Waves.of_batch(waves, batch))
        return found.with_gradient(self.derivatives(waves, batch)) if gradient else found

    def derivatives(self, waves: WaveBatch, batch: LayoutBatch) -> ScoreGradient:
        """Differentiate the scores of simulated layouts; numbers of failures do not count."""
        return ScoreGradient.zero(batch)

    @property
    def simulations_per_score(self) -> int:
        """How many rows are simulated for one score."""
        return 1

    @abstractmethod
    def in_words(self, score: float, wave: Wave) -> str:
        """Say the score of a success in words and units."""

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Yield what the tables of a scene, which has this objective, lack for it."""
        yield from ()
