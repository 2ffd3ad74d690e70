"""Interface of all objectives: scores of waves, and limits on waves.

A success scores more than 0. A wave that stops scores between -1 and 0, higher the further it came;
with the objective "toppled" it is a success too. With limits, a wave that completes but violates
one scores between -1/2 and 0, higher the smaller the violation, and waves that stop score between
-1 and -1/2. So a search can compare any two layouts.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

from domino_env.core.models import Value, about
from domino_env.core.results import dataclass_repr
from domino_env.core.types import Floats, Ints
from domino_env.physics.gradient import Gradient
from domino_env.physics.ground import Ground
from domino_env.physics.wave import Wave, WaveBatch
from domino_env.scenes.waves import FREE_STANDING_COST, LayoutBatch, Waves, simulate_free_standing


class ScoreGradient(NamedTuple):
    """Partial derivatives of B scores [unit of the score per m].

    Attributes
    ----------
    spacing
        (B, N-1) derivatives with respect to the gaps.
    thickness, height
        (B, N-1) derivatives with respect to the thicknesses and heights of dominoes 1 … N-1.
    """

    spacing: Floats
    thickness: Floats
    height: Floats

    @classmethod
    def zero(cls, batch: LayoutBatch) -> ScoreGradient:
        """Return derivatives of 0 for every layout of a batch."""
        return cls(*(np.zeros(batch.spacing.shape) for _ in range(3)))

    @classmethod
    def from_gradient(cls, gradient: Gradient) -> ScoreGradient:
        """Return the part of a gradient of B scores for gaps and for dominoes 1 … N-1."""
        return cls(gradient.spacing, gradient.thickness[:, 1:], gradient.height[:, 1:])

    def scale(self, factor: NDArray[Any]) -> ScoreGradient:
        """Return the derivatives, those of each layout multiplied by its factor (B,)."""
        return ScoreGradient(*(factor[:, None] * part for part in self))


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Scores of B layouts.

    Attributes
    ----------
    score
        (B,) scores; higher is better.
    reach
        (B,) reaches of the waves, 1 if they complete. For a score of several simulations, 1 if the
        score without limits is more than 0, else the mean of their reaches.
    falls
        (B,) numbers of simulated intervals between hits.
    gradient
        Derivatives of the scores, 0 for scores of 0 or less; None unless requested.
    """

    score: Floats
    reach: Floats
    falls: Ints
    gradient: ScoreGradient | None = None

    __repr__ = dataclass_repr

    @classmethod
    def concatenate(cls, parts: Sequence[Evaluation]) -> Evaluation:
        """Concatenate evaluations of batches, all with a gradient or all without."""
        columns = zip(*((part.score, part.reach, part.falls) for part in parts), strict=True)
        score, reach, falls = map(np.concatenate, columns)
        gradients = [part.gradient for part in parts if part.gradient is not None]
        arrays = map(np.concatenate, zip(*gradients, strict=True))
        return cls(score, reach, falls, ScoreGradient(*arrays) if gradients else None)

    def with_gradient(self, gradient: ScoreGradient) -> Evaluation:
        """Return the evaluation with derivatives, which are set to 0 for scores of 0 or less."""
        return replace(self, gradient=gradient.scale(self.score > 0.0))


# Rounding decides whether a layout at a limit satisfies it. Therefore scores with at most this rtol
# allow some excess. Searches have a larger rtol and allow none, so their results are accepted.
FINAL_RTOL = 1e-9
ALLOWED_EXCESS = 1e-6  # by which stall margin and loss together may violate their limits


Margin = Annotated[float, Meta(ge=0, lt=1)]
Loss = Annotated[float, Meta(ge=0, le=1)]


class Limits(Value, frozen=True):  # type: ignore[misc]
    """Limits on the wave of a layout.

    Parameters
    ----------
    stall_margin
        Smallest allowed `Wave.stall_margin`, 0 or more and less than 1; None for any.
    flush_loss
        Largest allowed `Wave.largest_flush_loss`, 0 to 1; None for any.

    Raises
    ------
    ValueError
        For a value out of its range, and if both are None.
    """

    stall_margin: Annotated[Margin | None, about("smallest allowed stall margin")] = None
    flush_loss: Annotated[Loss | None, about("largest loss of speed in a face impact")] = None

    SCHEMA: ClassVar = {"minProperties": 1}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stall_margin is None and self.flush_loss is None:
            raise ValueError("the table is empty: give stall_margin, flush_loss or both")

    def apply(self, scores: Floats, waves: Waves) -> Floats:
        """Return scores that are lower if a wave violates a limit or stops.

        Parameters
        ----------
        scores
            (B,) scores without limits.
        waves
            Results of the B waves.

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

    Every objective is a subclass in a module of this folder.

    Parameters
    ----------
    settings
        Table with the name of the objective in a scene file; None for none.
    limits
        Limits on the wave; None for none.
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
    """Unit of the score of a success; without a unit, gains are not shown in per cent."""
    table: ClassVar[type[Value] | None] = None
    """Type of `settings`; None if the objective has no table."""
    failure: ClassVar[str] = "no success"
    """Text in place of the score of a wave that stops."""
    rewards_speed: ClassVar[bool] = False
    """True if a faster wave scores more."""
    needs_arrivals: ClassVar[bool] = False
    """True if scores depend on the arrival time of each domino."""
    differentiates_waves: ClassVar[bool] = False
    """True if `derivatives` needs waves with the gradient of their total time."""
    draws_errors: ClassVar[bool] = False
    """True if layouts are scored with random errors of their gaps."""

    @property
    def simulates_anew(self) -> bool:
        """True if a score needs other simulations than that of the layout with fixed pivots."""
        return self.draws_errors or self.floor_friction is not None

    @property
    def is_mean_speed(self) -> bool:
        """True if a success scores the mean speed of its wave with fixed pivots."""
        return self.rewards_speed and not self.simulates_anew

    @property
    def simulations_per_score(self) -> int:
        """Run time of one score over that of a simulation with fixed pivots."""
        return 1 if self.floor_friction is None else FREE_STANDING_COST

    @abstractmethod
    def success(self, waves: Waves) -> Floats:
        """Return the scores (B,) of waves that complete; entries of others are not used."""

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
            approximate: the derivatives with fixed pivots, times the ratio of the scores on the
            floor and with fixed pivots.

        Returns
        -------
        Evaluation
            Scores, reaches, numbers of falls, and derivatives if requested.
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
        """Return the derivatives of the scores of waves; those of scores up to 0 are not used."""
        return ScoreGradient.zero(batch)

    def gain(self, score: Floats, reference: Floats) -> Floats:
        """Return the gains of scores of 0 or more over references of more than 0."""
        return score / reference - 1.0

    def displayed(self, score: ArrayLike) -> Any:
        """Return the numbers (…) that tables and pictures show of scores (…)."""
        return np.asarray(score)[()]

    def quantity(self) -> str:
        """Return the name of the `displayed` numbers, with their unit."""
        return f"score [{self.unit}]"

    def label(self, score: float, digits: int = 6) -> str:
        """Format a score as "score 0.828550 m/s"; one of 0 or less, a failure, has no unit."""
        return f"score {score:.{digits}f}" + f" {self.unit}" * (score > 0.0)

    def compare(
        self, score: float, reference: float, name: str, digits: int = 2, detailed: bool = False
    ) -> str:
        """Compare a score with a reference in words.

        Parameters
        ----------
        score, reference
            Two scores.
        name
            Name of the reference.
        digits
            Number of decimals of a gain in per cent.
        detailed
            True to add the score of the reference to a gain.

        Returns
        -------
        str
            Text such as "3.18% over uniform"; empty if one of the scores is 0 or less.
        """
        if min(score, reference) <= 0.0:
            return ""
        gain = score / reference - 1.0
        text = f"{abs(gain):.{digits}%} {'over' if gain >= 0.0 else 'below'} {name}"
        if abs(gain) < 0.5 * 0.1 ** (digits + 2):  # it would be rounded to 0%
            text = f"level with {name}"
        return text + f" ({reference:.6f})" * detailed

    def format_score(self, score: float, wave: Wave) -> str:
        """Format the score of a success with its unit."""
        return self.label(score)

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Yield a sentence for each requirement of the objective that a `SceneFile` violates."""
        yield from ()
