"""Interface of all objectives: scores of waves and their derivatives.

A success scores more than 0. A wave that stops scores between -1 and 0, higher the further it came,
so that a search can compare any two layouts.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env.core.models import Value
from domino_env.core.results import dataclass_repr
from domino_env.core.types import Floats
from domino_env.physics.gradient import Gradient
from domino_env.physics.physics import Physics
from domino_env.physics.wave import WaveBatch
from domino_env.scenes.layout_batch import LayoutBatch


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
    def from_gradient(cls, gradient: Gradient) -> ScoreGradient:
        """Return the part of a gradient of B scores for gaps and for dominoes 1 … N-1."""
        return cls(gradient.spacing, gradient.thickness[:, 1:], gradient.height[:, 1:])

    def first(self, pairs: int) -> ScoreGradient:
        """Return the derivatives with respect to the first gaps, and dominoes 1 … `pairs`."""
        return ScoreGradient(*(part[:, :pairs] for part in self))

    def scale(self, factor: NDArray[Any]) -> ScoreGradient:
        """Return the derivatives, those of each layout multiplied by its factor (B,)."""
        return ScoreGradient(*(factor[:, None] * part for part in self))


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of B layouts; for a single design vector, all fields lack the first axis.

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
        Derivatives of the scores with respect to sizes (a `ScoreGradient`, 0 for scores of 0 or
        less) or to design vectors (B, n); None unless requested.
    """

    score: Any
    reach: Any
    falls: Any
    gradient: Any = None

    __repr__ = dataclass_repr

    def with_gradient(self, gradient: ScoreGradient) -> Scores:
        """Return the scores with derivatives, which are set to 0 for scores of 0 or less."""
        succeeds = (self.score > 0.0)[:, None]
        return replace(
            self, gradient=ScoreGradient(*(np.where(succeeds, part, 0.0) for part in gradient))
        )

    def squeeze(self) -> Scores:
        """Drop the first axis of a batch of one."""
        gradient = None if self.gradient is None else self.gradient[0]
        return Scores(float(self.score[0]), float(self.reach[0]), int(self.falls[0]), gradient)


@dataclass(frozen=True)
class Objective(ABC):
    """Scoring rule for waves.

    Every objective is a subclass in a module of this folder.

    Parameters
    ----------
    settings
        Table with the name of the objective in a scene file; None for none.
    """

    settings: Any

    name: ClassVar[str]
    """Value of the key `objective` in scene files."""
    unit: ClassVar[str] = ""
    """Unit of the score of a success; empty for none."""
    table: ClassVar[type[Value] | None] = None
    """Type of `settings`; None if the objective has no table."""
    failure: ClassVar[str] = "no success"
    """Text in place of the score of a wave that stops."""
    is_mean_speed: ClassVar[bool] = False
    """True if the score of a wave that completes is its mean speed [m/s]."""
    rewards_steps: ClassVar[bool] = False
    """True if a faster wave scores more, so that environments reward steps by the expected gain."""
    needs_arrivals: ClassVar[bool] = False
    """True if scores depend on more than summaries of waves, such as the time of each hit."""
    needs_time_gradient: ClassVar[bool] = False
    """True if `derivatives` uses the gradients of the total times, `WaveBatch.gradient`."""
    shows_errors: ClassVar[bool] = False
    """True if `displayed` numbers are errors, of which the lowest is the best."""

    @abstractmethod
    def success(self, waves: WaveBatch) -> Floats:
        """Return the scores (B,) of waves that complete; entries of others are not used."""

    def score(self, waves: WaveBatch) -> Scores:
        """Score waves."""
        score = waves.reach - 1.0
        if waves.propagated.any():
            with np.errstate(all="ignore"):  # of waves that stop, whose numbers are not used
                score = np.where(waves.propagated, self.success(waves), score)
        return Scores(score, waves.reach, waves.falls)

    @abstractmethod
    def derivatives(self, waves: WaveBatch, layouts: LayoutBatch) -> ScoreGradient:
        """Return the derivatives of the scores of waves; those of scores up to 0 are not used."""

    def typical(self, height: float, physics: Physics) -> float:
        """Return the divisor of scores in gains of a scene whose uniform baseline is no success."""
        return 1.0

    def gain(self, score: Floats, reference: Floats) -> Floats:
        """Return the gains of scores of 0 or more over references of more than 0."""
        return score / reference - 1.0

    def displayed(self, score: ArrayLike) -> Any:
        """Return the numbers (…) that tables and pictures show of scores (…)."""
        return np.asarray(score)[()]

    def quantity(self) -> str:
        """Return the name of the `displayed` numbers, with their unit."""
        return f"score [{self.unit}]" if self.unit else "score"

    def label(self, score: float, digits: int = 6) -> str:
        """Format a score as "score 0.828550 m/s"; one of 0 or less, a failure, has no unit."""
        return f"score {score:.{digits}f} {self.unit if score > 0.0 else ''}".rstrip()

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

    def format_score(self, score: float, digits: int = 6) -> str:
        """Format the score of a success with its unit; a speed has `digits` decimals."""
        return self.label(score)

    @classmethod
    def violations(cls, scene: Any) -> Iterator[str]:
        """Yield a sentence for each requirement of the objective that a scene violates."""
        yield from ()
