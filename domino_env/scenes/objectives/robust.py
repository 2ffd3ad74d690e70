"""Scores of layouts with placement noise: a quantile of the speeds, or a mean score."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta

from domino_env.core.models import Part, Value, about
from domino_env.core.types import Floats
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Wave, WaveBatch
from domino_env.scenes.objectives.base import Evaluation, Objective, ScoreGradient
from domino_env.scenes.objectives.speed import MeanSpeed, Speed
from domino_env.scenes.waves import LayoutBatch, Waves

LARGEST_DRAWS = 100_000
MOST_DRAWN = 4_000_000  # dominoes in all draws: some 200 MB when they are simulated
DESCRIPTION = {"unit", "failure", "rewards_speed", "needs_arrivals"}
"""Attributes that a mean over draws shares with the objective whose scores it averages."""
LEAST_GAP = 0.0002  # [m] no gap is ever placed tighter


def placed(spacing: Floats, errors: Floats) -> Floats:
    """Return gaps with placement errors (…, N-1) [m], not less than `LEAST_GAP`."""
    return np.maximum(spacing + errors, LEAST_GAP)


Share = Annotated[float, Meta(gt=0, le=1)]


class Placement(Value, frozen=True):  # type: ignore[misc]
    """Normal errors of all free gaps, and the quantile of the speed that is the score.

    Parameters
    ----------
    deviation
        Standard deviation of the error of each gap [m].
    quantile
        Share of the draws that may be slower, more than 0 and at most 1.
    draws
        Number of draws.
    seed
        Seed of the draws, which are the same for every layout.

    Raises
    ------
    ValueError
        With the value and the accepted range.
    """

    deviation: Annotated[Part, about("standard deviation of each gap's error [m]")]
    quantile: Annotated[Share, about("share of the draws that may be slower")] = 0.05
    draws: Annotated[int, Meta(ge=1, le=LARGEST_DRAWS, description="number of draws")] = 256
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1, description="of the draws")] = 0


def placed_batch(batch: LayoutBatch, errors: Floats) -> LayoutBatch:
    """Return all draws of the layouts of a batch.

    Parameters
    ----------
    batch
        B layouts without errors.
    errors
        (D, N-1) errors of the gaps [m], the same for every layout.

    Returns
    -------
    LayoutBatch
        B · D layouts, those of one layout one after another.
    """
    draws, height = len(errors), batch.height
    return replace(
        batch,
        spacing=placed(batch.spacing[:, None, :], errors).reshape(-1, batch.count - 1),
        thickness=np.repeat(batch.thickness, draws, axis=0),
        height=height if len(height) == 1 else np.repeat(height, draws, axis=0),
    )


def pieces_of(batch: LayoutBatch, draws: int) -> list[LayoutBatch]:
    """Split a batch so that the draws of each piece fit into memory."""
    size = max(1, MOST_DRAWN // (draws * batch.count))
    return [batch[i : i + size] for i in range(0, max(len(batch), 1), size)]


@lru_cache(8)
def errors(placement: Placement, pairs: int) -> Floats:
    """Return the errors of the gaps (draws, pairs) [m], drawn once for each number of pairs."""
    random = np.random.default_rng(placement.seed)
    drawn = placement.deviation * random.standard_normal((placement.draws, pairs))
    drawn.flags.writeable = False
    return drawn


def simulate_placed(
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
        Deviation, number and seed of the draws; more than 4 million dominoes are not drawn.
    ground
        Ground on which it stands; None for flat ground.

    Raises
    ------
    ValueError
        For a layout on uneven ground without its ground.
    """
    if ground is None and not layout.is_flat:
        raise ValueError("placement noise on uneven ground needs the ground: name its scene")
    draws = min(placement.draws, max(MOST_DRAWN // layout.count, 1))
    sizes = layout.spacing[None], layout.thickness[None], layout.height[None]
    batch = LayoutBatch(*sizes, layout.width, layout.density, physics, 1e-6, ground)
    return placed_batch(batch, errors(placement.replace(draws=draws), layout.count - 1)).simulate()


@dataclass(frozen=True)
class Robust(Speed):
    """Mean speed that most layouts reach whose gaps have random errors [m/s]."""

    settings: Placement

    name: ClassVar[str] = "robust"
    table: ClassVar[type[Value] | None] = Placement

    @property
    def is_mean_speed(self) -> bool:
        """False: a score is a quantile."""
        return False

    @property
    def simulates_anew(self) -> bool:
        """True: the layouts are drawn."""
        return True

    @property
    def simulations_per_score(self) -> int:
        """Number of draws and, with limits, the layout without errors."""
        return self.settings.draws * super().simulations_per_score + (self.limits is not None)

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate all draws of layouts and score them.

        The gradient is that of the draw which decides the score, simulated once more.
        """
        pieces = pieces_of(batch, self.settings.draws)
        return Evaluation.joined([self._evaluate(piece, gradient) for piece in pieces])

    def _evaluate(self, batch: LayoutBatch, gradient: bool) -> Evaluation:
        draws, each = self.settings.draws, np.arange(len(batch))
        drawn_errors = errors(self.settings, batch.count - 1)
        placed = placed_batch(batch, drawn_errors)
        speed_of = MeanSpeed(
            None, None, ground=self.ground, floor_friction=self.floor_friction
        ).evaluate
        drawn = speed_of(placed)
        scores = drawn.score.reshape(-1, draws)
        rank = max(math.ceil(self.settings.quantile * draws - 1e-9), 1) - 1
        decisive = np.argsort(np.maximum(scores, 0.0), axis=1, kind="stable")[:, rank]
        speed = scores[each, decisive]
        # where too many draws stop for a speed, their mean reach
        mean = drawn.reach.reshape(-1, draws).mean(axis=1)
        score = np.where(speed > 0.0, speed, mean - 1.0)
        reach = np.where(speed > 0.0, 1.0, mean)
        falls = drawn.falls.reshape(-1, draws).sum(axis=1)
        if self.limits is not None:  # of the layout without errors
            exact = Waves.of_batch(batch.simulate(record=True), batch)
            score, falls = self.limits.lower(score, exact), falls + exact.falls
        evaluation = Evaluation(score, reach, falls)
        if not gradient:
            return evaluation
        gaps = placed.spacing.reshape(len(batch), draws, -1)[each, decisive]
        intended = batch.spacing + drawn_errors[decisive]
        moved = np.abs(gaps - intended) < 1e-15  # those not at the least gap
        by = speed_of(replace(batch, spacing=gaps), gradient=True).gradient
        assert by is not None
        return evaluation.with_gradient(replace(by, spacing=moved * by.spacing))

    def in_words(self, score: float, wave: Wave) -> str:
        """Return the speed, and the share of the draws that reach it."""
        share = 100.0 * (1.0 - self.settings.quantile)
        return f"{super().in_words(score, wave)} reached by {share:.4g} % of the layouts as placed"

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Yield that the draws do not fit into memory."""
        count, draws = tables.row.count, tables.robust.draws
        if count * draws > MOST_DRAWN:
            yield (
                f"robust.draws = {draws} of {count} dominoes are {count * draws:,}: draw at most "
                f"{MOST_DRAWN // count} layouts"
            )


@lru_cache(8)
def frozen_errors(deviation: float, draws: int, pairs: int) -> Floats:
    """Return errors (draws, pairs) [m], those of environments reset with seeds 0 … draws - 1."""
    seeds = range(draws)
    normals = [np.random.default_rng(seed).standard_normal(pairs) for seed in seeds]
    return deviation * np.array(normals)


@dataclass(frozen=True)
class MeanOverDraws(Objective):
    """Mean score of another objective, `settings`, over frozen draws of placement noise.

    A search with it finds the best plan that does not react to the errors. The draws are those of
    environments that are reset with the seeds 0, 1, …

    Parameters
    ----------
    deviation
        Standard deviation of the error of each gap [m].
    draws
        Number of draws.
    """

    deviation: float = field(kw_only=True)
    draws: int = field(kw_only=True)

    def __post_init__(self) -> None:
        vars(self).update({name: getattr(self.settings, name) for name in DESCRIPTION})

    @property
    def simulates_anew(self) -> bool:
        """True: the layouts are drawn."""
        return True

    @property
    def simulations_per_score(self) -> int:
        """Number of draws times that of the other objective."""
        return self.draws * int(self.settings.simulations_per_score)

    def success(self, waves: Waves) -> Floats:
        """Return the scores (B,) of the waves themselves, without noise."""
        return np.asarray(self.settings.success(waves))

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate all draws of layouts, and average scores and derivatives."""
        pieces = pieces_of(batch, self.draws)
        return Evaluation.joined([self._evaluate(piece, gradient) for piece in pieces])

    def _evaluate(self, batch: LayoutBatch, gradient: bool) -> Evaluation:
        drawn = frozen_errors(self.deviation, self.draws, batch.count - 1)
        evaluation = self.settings.evaluate(placed_batch(batch, drawn), gradient)
        by_draw = len(batch), self.draws, -1
        score = evaluation.score.reshape(by_draw[:2]).mean(axis=1)
        reach = evaluation.reach.reshape(by_draw[:2]).mean(axis=1)
        falls = evaluation.falls.reshape(by_draw[:2]).sum(axis=1)
        mean = Evaluation(score, np.where(score > 0.0, 1.0, reach), falls)
        if not gradient:
            return mean
        moved = batch.spacing[:, None, :] + drawn > LEAST_GAP  # not those at the least gap
        by = evaluation.gradient
        return mean.with_gradient(
            ScoreGradient(
                (moved * by.spacing.reshape(by_draw)).mean(axis=1),
                by.thickness.reshape(by_draw).mean(axis=1),
                by.height.reshape(by_draw).mean(axis=1),
            )
        )

    def in_words(self, score: float, wave: Wave) -> str:
        """Return the mean score and the deviation of the gaps."""
        unit = f" {self.unit}" if self.unit else ""
        return f"mean score {score:.6f}{unit} over {self.draws} draws of placement noise"
