"""Scores of layouts with placement noise: a quantile of the speeds, or a mean score."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta

from domino_env.core.models import Amount, Value, about
from domino_env.core.types import Floats, read_only
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Wave, WaveBatch
from domino_env.scenes.objectives.base import Evaluation, Objective, ScoreGradient
from domino_env.scenes.objectives.speed import MeanSpeed, Speed
from domino_env.scenes.waves import LayoutBatch, Waves

LARGEST_DRAWS = 100_000  # largest number of draws of one layout
MOST_DRAWN_DOMINOES = 4_000_000  # [dominoes] in all draws, whose simulation takes some 200 MB
SHARED_ATTRIBUTES = {
    "unit", "failure", "rewards_speed", "needs_arrivals",
    "gain", "displayed", "quantity", "label", "compare",
}  # fmt: skip
"""Attributes and methods that a mean over draws shares with the objective that it averages."""
LEAST_GAP = 0.0002  # [m] smallest gap with a placement error


def add_errors(spacing: Floats, errors: Floats) -> Floats:
    """Return gaps with placement errors (…, N-1) [m], at least `LEAST_GAP`."""
    return np.maximum(spacing + errors, LEAST_GAP)


Quantile = Annotated[float, Meta(gt=0, le=1)]


class Placement(Value, frozen=True):  # type: ignore[misc]
    """Normal errors of all free gaps, and the quantile of the speed that is the score.

    Parameters
    ----------
    deviation
        Standard deviation of the error of each gap [m].
    quantile
        Share of the draws that may be slower, more than 0 and at most 1.
    draws
        Number of draws, each with one error for every gap.
    seed
        Seed of the draws, which are the same for every layout.

    Raises
    ------
    ValueError
        For a value out of its range; the message has the value and the range.
    """

    deviation: Annotated[Amount, about("standard deviation of each gap's error [m]")]
    quantile: Annotated[Quantile, about("share of the draws that may be slower")] = 0.05
    draws: Annotated[int, Meta(ge=1, le=LARGEST_DRAWS, description="number of draws")] = 256
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1, description="seed of the draws")] = 0


def draw_layouts(batch: LayoutBatch, errors: Floats) -> LayoutBatch:
    """Return each layout of a batch with each draw of errors of its gaps.

    Parameters
    ----------
    batch
        B layouts without errors.
    errors
        (D, N-1) errors of the gaps [m] in D draws, the same for every layout.

    Returns
    -------
    LayoutBatch
        B · D layouts: all draws of the first layout, then all of the second, and so on.
    """
    draws, height = len(errors), batch.height
    return replace(
        batch,
        spacing=add_errors(batch.spacing[:, None, :], errors).reshape(-1, batch.count - 1),
        thickness=np.repeat(batch.thickness, draws, axis=0),
        height=height if len(height) == 1 else np.repeat(height, draws, axis=0),
    )


def split_batch(batch: LayoutBatch, draws: int) -> list[LayoutBatch]:
    """Split a batch of layouts so that all draws of each part fit into memory."""
    size = max(1, MOST_DRAWN_DOMINOES // (draws * batch.count))
    return [batch[i : i + size] for i in range(0, max(len(batch), 1), size)]


@lru_cache(8)
def draw_errors(placement: Placement, pairs: int) -> Floats:
    """Draw the errors of the gaps (draws, pairs) [m]; equal arguments share one array."""
    generator = np.random.default_rng(placement.seed)
    return read_only(placement.deviation * generator.standard_normal((placement.draws, pairs)))


def simulate_draws(
    layout: Layout, physics: Physics, placement: Placement, ground: Ground | None = None
) -> WaveBatch:
    """Simulate the draws of a layout with placement noise.

    Parameters
    ----------
    layout
        The layout without errors.
    physics
        Friction, gravity and push.
    placement
        Deviation, number and seed of the draws. The number is reduced if the draws have more than
        4 million dominoes.
    ground
        Ground on which the layout stands; None for flat ground.

    Returns
    -------
    WaveBatch
        Waves of all draws.

    Raises
    ------
    ValueError
        For a layout on uneven ground if `ground` is None.
    """
    if ground is None and not layout.is_flat:
        raise ValueError("the layout is on uneven ground: give the `ground` of its scene")
    draws = min(placement.draws, max(MOST_DRAWN_DOMINOES // layout.count, 1))
    sizes = layout.spacing[None], layout.thickness[None], layout.height[None]
    batch = LayoutBatch(*sizes, layout.width, layout.density, physics, rtol=1e-6, ground=ground)
    errors = draw_errors(placement.replace(draws=draws), layout.count - 1)
    return draw_layouts(batch, errors).simulate()


@dataclass(frozen=True)
class Robust(Speed):
    """Quantile of the mean speeds of layouts with random errors of their gaps [m/s]."""

    settings: Placement

    name: ClassVar[str] = "robust"
    table: ClassVar[type[Value] | None] = Placement
    draws_errors: ClassVar[bool] = True

    @property
    def simulations_per_score(self) -> int:
        """Number of draws, and with limits one more for the layout without errors."""
        return self.settings.draws * super().simulations_per_score + (self.limits is not None)

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate all draws of layouts and score them.

        The gradient is that of the draw at the quantile, which is simulated once more.
        """
        parts = split_batch(batch, self.settings.draws)
        return Evaluation.concatenate([self._evaluate(part, gradient) for part in parts])

    def _evaluate(self, batch: LayoutBatch, gradient: bool) -> Evaluation:
        """Evaluate layouts whose draws fit into memory."""
        draws, indices = self.settings.draws, np.arange(len(batch))
        errors = draw_errors(self.settings, batch.count - 1)
        layouts = draw_layouts(batch, errors)
        speed = MeanSpeed(None, None, ground=self.ground, floor_friction=self.floor_friction)
        evaluations = speed.evaluate(layouts)
        scores = evaluations.score.reshape(-1, draws)
        rank = max(math.ceil(self.settings.quantile * draws - 1e-9), 1) - 1  # 1e-9: rounding
        # index of the draw at the quantile; waves that stop are the slowest
        decisive = np.argsort(np.maximum(scores, 0.0), axis=1, kind="stable")[:, rank]
        quantile = scores[indices, decisive]
        # if the wave at the quantile stops, the mean reach of all draws gives the score
        mean = evaluations.reach.reshape(-1, draws).mean(axis=1)
        score = np.where(quantile > 0.0, quantile, mean - 1.0)
        reach = np.where(quantile > 0.0, 1.0, mean)
        falls = evaluations.falls.reshape(-1, draws).sum(axis=1)
        if self.limits is not None:  # they apply to the layout without errors
            waves = Waves.from_batch(batch.simulate(record=True), batch)
            score, falls = self.limits.apply(score, waves), falls + waves.falls
        evaluation = Evaluation(score, reach, falls)
        if not gradient:
            return evaluation
        gaps = layouts.spacing.reshape(len(batch), draws, -1)[indices, decisive]
        unclipped = batch.spacing + errors[decisive]
        is_free = np.abs(gaps - unclipped) < 1e-15  # [m] False for gaps raised to `LEAST_GAP`
        derivatives = speed.evaluate(replace(batch, spacing=gaps), gradient=True).gradient
        assert derivatives is not None
        return evaluation.with_gradient(derivatives._replace(spacing=is_free * derivatives.spacing))

    def format_score(self, score: float, wave: Wave) -> str:
        """Format the speed and the share of the draws that reach it."""
        share = 100.0 * (1.0 - self.settings.quantile)
        text = super().format_score(score, wave)
        return f"{text} reached by {share:.4g} % of the layouts as placed"

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Yield a sentence if the draws do not fit into memory."""
        count, draws = tables.row.count, tables.robust.draws
        if count * draws > MOST_DRAWN_DOMINOES:
            yield (
                f"robust.draws = {draws} of {count} dominoes take too much memory: give at most "
                f"{MOST_DRAWN_DOMINOES // count}"
            )


@lru_cache(8)
def draw_errors_by_seed(deviation: float, draws: int, pairs: int) -> Floats:
    """Return the errors (draws, pairs) of environments reset with seeds 0 … draws - 1 [m]."""
    normals = [np.random.default_rng(seed).standard_normal(pairs) for seed in range(draws)]
    return deviation * np.array(normals)


@dataclass(frozen=True)
class MeanOverDraws(Objective):
    """Mean score of another objective over fixed draws of placement noise.

    A search with this objective finds the best layout that is planned before any error is observed.
    The draws are those of environments that are reset with the seeds 0, 1, …

    Parameters
    ----------
    settings
        The other objective.
    limits
        None, as the other objective has the limits.
    deviation
        Standard deviation of the error of each gap [m].
    draws
        Number of draws.
    """

    deviation: float = field(kw_only=True)
    draws: int = field(kw_only=True)

    draws_errors: ClassVar[bool] = True

    def __post_init__(self) -> None:
        vars(self).update({name: getattr(self.settings, name) for name in SHARED_ATTRIBUTES})

    @property
    def simulations_per_score(self) -> int:
        """Number of draws times `simulations_per_score` of the other objective."""
        return self.draws * int(self.settings.simulations_per_score)

    def success(self, waves: Waves) -> Floats:
        """Return the scores (B,) of the waves by the other objective, without noise."""
        return np.asarray(self.settings.success(waves))

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate all draws of layouts, and average scores and derivatives."""
        parts = split_batch(batch, self.draws)
        return Evaluation.concatenate([self._evaluate(part, gradient) for part in parts])

    def _evaluate(self, batch: LayoutBatch, gradient: bool) -> Evaluation:
        """Evaluate layouts whose draws fit into memory."""
        errors = draw_errors_by_seed(self.deviation, self.draws, batch.count - 1)
        evaluation = self.settings.evaluate(draw_layouts(batch, errors), gradient)
        shape = len(batch), self.draws, -1
        score = evaluation.score.reshape(shape[:2]).mean(axis=1)
        reach = evaluation.reach.reshape(shape[:2]).mean(axis=1)
        falls = evaluation.falls.reshape(shape[:2]).sum(axis=1)
        mean = Evaluation(score, np.where(score > 0.0, 1.0, reach), falls)
        if not gradient:
            return mean
        spacing, *others = (part.reshape(shape) for part in evaluation.gradient)
        # False for gaps raised to `LEAST_GAP`
        is_free = batch.spacing[:, None, :] + errors > LEAST_GAP
        parts = is_free * spacing, *others
        return mean.with_gradient(ScoreGradient(*(part.mean(axis=1) for part in parts)))

    def format_score(self, score: float, wave: Wave) -> str:
        """Format the mean score, or the RMS error whose score it is, and the number of draws."""
        text = f"{'mean ' * bool(self.unit)}{self.label(score)}"
        return f"{text} over {self.draws} draws of placement noise"
