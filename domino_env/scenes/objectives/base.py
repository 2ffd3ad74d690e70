"""Interface of all objectives: scores of waves, and the limits that waves must keep.

A success scores more than 0. A wave that stops scores between -1 and 0, higher the further it came.
One that completes but breaks a limit scores between -1/2 and 0, higher the less it breaks it, and
waves that stop then score less than -1/2. So any two layouts can be compared by a search.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from domino_env.core.models import Value, about
from domino_env.core.results import dataclass_repr
from domino_env.core.types import Floats, Ints
from domino_env.physics.gradient import Gradient
from domino_env.physics.ground import Ground
from domino_env.physics.wave import Wave, WaveBatch
from domino_env.scenes.waves import FREE_STANDING_COST, LayoutBatch, Waves, simulate_free_standing


class ScoreGradient(NamedTuple):
    """Partial derivatives of B scores, (B, N-1) each [score/m].

    Attributes
    ----------
    spacing
        With respect to the gaps.
    thickness, height
        With respect to the thicknesses and heights of dominoes 1 … N-1.
    """

    spacing: Floats
    thickness: Floats
    height: Floats

    @classmethod
    def zero(cls, batch: LayoutBatch) -> ScoreGradient:
        """Return zeros for every layout of a batch."""
        return cls(*(np.zeros(batch.spacing.shape) for _ in range(3)))

    @classmethod
    def from_gradient(cls, gradient: Gradient) -> ScoreGradient:
        """Return the derivatives with respect to the design variables, from those of B scores."""
        return cls(gradient.spacing, gradient.thickness[:, 1:], gradient.height[:, 1:])

    def scale(self, factor: NDArray[Any]) -> ScoreGradient:
        """Return the derivatives of each layout times a factor (B,)."""
        return ScoreGradient(*(factor[:, None] * part for part in self))


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Scores of B layouts.

    Attributes
    ----------
    score
        (B,) higher is better.
    reach
        (B,) `reach` of the waves; 1 if they complete. If a score takes many simulations: 1 if
        enough of them complete, else their mean.
    falls
        (B,) number of simulated falls.
    gradient
        Derivatives of the scores, zero for layouts without success; None unless requested.
    """

    score: Floats
    reach: Floats
    falls: Ints
    gradient: ScoreGradient | None = None

    __repr__ = dataclass_repr

    @classmethod
    def concatenate(cls, parts: Sequence[Evaluation]) -> Evaluation:
        """Concatenate evaluations of batches, all with a gradient or all without."""
        score, reach, falls = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("score", "reach", "falls")
        )
        gradients = [part.gradient for part in parts if part.gradient is not None]
        arrays = map(np.concatenate, zip(*gradients, strict=True))
        return cls(score, reach, falls, ScoreGradient(*arrays) if gradients else None)

    def with_gradient(self, gradient: ScoreGradient) -> Evaluation:
        """Add the derivatives, set to zero for layouts without success."""
        return replace(self, gradient=gradient.scale(self.score > 0.0))


# Rounding decides whether a layout at a limit keeps it. Therefore simulations of at most this rtol
# allow some excess. The less exact simulations of a search do not, so its results are accepted.
FINAL_RTOL = 1e-9
ALLOWED_EXCESS = 1e-6  # of a stall margin or a loss


Margin = Annotated[float, Meta(ge=0, lt=1)]
Loss = Annotated[float, Meta(ge=0, le=1)]


class Limits(Value, frozen=True):  # type: ignore[misc]
    """Limits on the wave that a design must keep.

    Parameters
    ----------
    stall_margin
        Least allowed `Wave.stall_margin` of all falls, 0 to below 1; None for any.
    flush_loss
        Largest allowed `Wave.largest_flush_loss`, 0 or more; None for any.

    Raises
    ------
    ValueError
        With the value and the accepted range.
    """

    stall_margin: Annotated[Margin | None, about("of all intervals between hits, at least")] = None
    flush_loss: Annotated[Loss | None, about("loss of speed in a face impact, at most")] = None

    SCHEMA: ClassVar = {"minProperties": 1}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stall_margin is None and self.flush_loss is None:
            raise ValueError("the table is empty: give stall_margin, flush_loss or both")

    def apply(self, scores: Floats, waves: Waves) -> Floats:
        """Return scores that are lower if a wave breaks a limit or stops.

        Parameters
        ----------
        scores
            (B,) scores without limits.
        waves
            Results of B waves.

        Returns
        -------
        NDArray
            (B,) scores.
        """
        excess = np.zeros(len(waves.reach))
        if self.stall_margin is not None:
            excess += np.maximum(self.stall_margin - waves.lowest_stall_margin, 0.0)
        if self.flush_loss is not None:
            excess += np.maximum(waves.largest_flush_loss - self.flush_loss, 0.0)
        allowed = ALLOWED_EXCESS if waves.rtol <= FINAL_RTOL else 0.0
        failures = -0.5 * excess / (1.0 + excess)
        others = np.where(scores < 0.0, 0.5 * scores - 0.5, scores)
        return np.where((scores > 0.0) & (excess > allowed), failures, others)


@dataclass(frozen=True)
class Objective(ABC):
    """Scoring rule of a scene.

    Each rule is a class in a module of this folder.

    Parameters
    ----------
    settings
        Table with the name of the rule in a scene's file; None without one.
    limits
        Limits that the wave must keep; None for none.
    ground
        Ground on which layouts stand; None for flat ground.
    floor_friction
        Coulomb coefficient of the floor of free-standing layouts; None for fixed pivots.
    """

    settings: Any
    limits: Limits | None
    ground: Ground | None = field(default=None, kw_only=True)
    floor_friction: float | None = field(default=None, kw_only=True)

    name: ClassVar[str]
    """Value of the key `objective` in scene files."""
    unit: ClassVar[str] = ""
    """Unit of the score of a success."""
    table: ClassVar[type[Value] | None] = None
    """Type of `settings`; None if the objective has no table."""
    failure: ClassVar[str] = "no success"
    """Text for the score of a wave that stops."""
    rewards_speed: ClassVar[bool] = False
    """True if a wave that is ahead of another on the way is likely to score more."""
    needs_arrivals: ClassVar[bool] = False
    """True if scores depend on the arrival time of each domino."""
    differentiates_waves: ClassVar[bool] = False
    """True if `derivatives` needs waves with the gradient of their time."""
    draws_errors: ClassVar[bool] = False
    """True if a score is that of layouts with sampled placement errors."""

    @property
    def simulates_anew(self) -> bool:
        """True if a score needs other simulations than the analytic wave of the layout."""
        return self.draws_errors or self.floor_friction is not None

    @property
    def is_mean_speed(self) -> bool:
        """True if a success scores the mean speed of its analytic wave."""
        return self.rewards_speed and not self.simulates_anew

    @property
    def simulations_per_score(self) -> int:
        """Number of analytic waves whose run time is that of one score."""
        return 1 if self.floor_friction is None else FREE_STANDING_COST

    @abstractmethod
    def success(self, waves: Waves) -> Floats:
        """Return scores (B,) of waves; those of waves that stop are not used."""

    def score(self, waves: Waves) -> Evaluation:
        """Score waves that have been simulated."""
        score = waves.reach - 1.0
        if waves.propagated.any():
            score = np.where(waves.propagated, self.success(waves), score)
        if self.limits is not None:
            score = self.limits.apply(score, waves)
        return Evaluation(score, waves.reach, waves.falls)

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate layouts and score them.

        Parameters
        ----------
        batch
            The layouts.
        gradient
            Compute the derivatives of the scores too. Those of free-standing layouts are
            approximate: the derivatives of the analytic model times the ratio of the scores.
        """
        if self.floor_friction is not None:
            evaluation = self.score(simulate_free_standing(batch, self.floor_friction))
            if not gradient:
                return evaluation
            analytic = replace(self, floor_friction=None).evaluate(batch, gradient=True)
            assert analytic.gradient is not None
            both = (evaluation.score > 0.0) & (analytic.score > 0.0)
            ratio = np.where(both, evaluation.score / np.where(both, analytic.score, 1.0), 0.0)
            return evaluation.with_gradient(analytic.gradient.scale(ratio))
        record = self.needs_arrivals or self.limits is not None
        waves = batch.simulate(record=record, gradient=gradient and self.differentiates_waves)
        evaluation = self.score(Waves.from_batch(waves, batch))
        if gradient:
            return evaluation.with_gradient(self.derivatives(waves, batch))
        return evaluation

    def derivatives(self, waves: WaveBatch, batch: LayoutBatch) -> ScoreGradient:
        """Return the derivatives of the scores of waves; those of failures are not used."""
        return ScoreGradient.zero(batch)

    @abstractmethod
    def format_score(self, score: float, wave: Wave) -> str:
        """Return the score of a success as text with its unit."""

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Yield the requirements of this objective that the tables of a scene violate."""
        yield from ()
