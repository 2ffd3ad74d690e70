"""The speed that most layouts reach whose gaps have placement noise."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Any, ClassVar

import numpy as np
from msgspec import Meta

from domino_env.core.models import Part, Value
from domino_env.core.types import Floats, Ints
from domino_env.physics.wave import Wave
from domino_env.scenes.objectives.base import Evaluation, Objective
from domino_env.scenes.objectives.speed import speed_gradient
from domino_env.scenes.waves import LayoutBatch, Waves

LARGEST_DRAWS = 100_000
MOST_DRAWN = 4_000_000  # dominoes in all draws: some 200 MB when they topple


LEAST_GAP = 0.0002  # [m] no gap is ever placed tighter


def placed(spacing: Floats, errors: Floats) -> Floats:
    """Return the gaps as they come to stand [m], whose last axis is that of the errors."""
    return np.maximum(spacing + errors, LEAST_GAP)


class Placement(Value, frozen=True):  # type: ignore[misc]
    """Every free gap is off by a normal error; what counts is a low quantile of the speed.

    Parameters
    ----------
    deviation
        Standard deviation of the error of each gap [m].
    quantile
        The part of the draws that may be slower, more than 0 and at most 1.
    draws
        How many rows are drawn.
    seed
        Of the draws, the same ones for every layout.

    Raises
    ------
    ValueError
        With the value and what is allowed.
    """

    deviation: Annotated[Part, Meta(description="standard deviation of each gap's error [m]")]
    quantile: Annotated[
        float, Meta(gt=0, le=1, description="the part of the draws that may be slower")
    ] = 0.05
    draws: Annotated[int, Meta(ge=1, le=LARGEST_DRAWS, description="rows that are drawn")] = 256
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1, description="of the draws")] = 0

    def rows(self, spacing: Floats) -> Floats:
        """Return (B · draws, N-1) the gaps as they are placed, all draws of a row together [m]."""
        rows = placed(spacing[:, None, :], errors(self, spacing.shape[1]))
        return rows.reshape(-1, spacing.shape[1])

    @property
    def rank(self) -> int:
        """The place of the draw that counts among all draws, from the slowest, 0."""
        return max(math.ceil(self.quantile * self.draws - 1e-9), 1) - 1

    def decisive(self, speeds: Floats) -> Ints:
        """Return (B,) which draw counts of speeds (B, draws): the one at `rank`."""
        return np.argsort(speeds, axis=1, kind="stable")[:, self.rank]


@lru_cache(8)
def errors(placement: Placement, pairs: int) -> Floats:
    """Return (draws, pairs) what is added to the gaps [m], drawn once for each length."""
    random = np.random.default_rng(placement.seed)
    found = placement.deviation * random.standard_normal((placement.draws, pairs))
    found.flags.writeable = False
    return found


@dataclass(frozen=True)
class Robust(Objective):
    """The mean speed that most of the rows reach whose gaps are off at random [m/s]."""

    settings: Placement

    name: ClassVar[str] = "robust"
    unit: ClassVar[str] = "m/s"
    table: ClassVar[type[Value] | None] = Placement
    failure: ClassVar[str] = "no speed"
    rewards_speed: ClassVar[bool] = True
    simulates_anew: ClassVar[bool] = True

    @property
    def simulations_per_score(self) -> int:
        """How many rows are simulated for one score: with limits, the row as it is drawn too."""
        return self.settings.draws + (self.limits is not None)

    def success(self, waves: Waves) -> Floats:
        """Take the speeds of waves (B,) as they are: these are no draws."""
        return waves.mean_speed

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate all draws of layouts and score them.

        The gradient is that of the draw which decides the score, simulated once more.
        """
        size = max(1, MOST_DRAWN // (self.settings.draws * batch.count))
        pieces = [batch[i : i + size] for i in range(0, max(len(batch), 1), size)]
        return Evaluation.joined([self._evaluate(piece, gradient) for piece in pieces])

    def _evaluate(self, batch: LayoutBatch, gradient: bool) -> Evaluation:
        draws, each = self.settings.draws, np.arange(len(batch))
        placed = self._placed(batch)
        waves = Waves.of_batch(placed.simulate(), placed)
        speeds = np.where(waves.propagated, waves.mean_speed, 0.0).reshape(-1, draws)
        decisive = self.settings.decisive(speeds)
        speed = speeds[each, decisive]
        # where too many draws die for a speed, how far they came on average
        mean = waves.reach.reshape(-1, draws).mean(axis=1)
        score = np.where(speed > 0.0, speed, mean - 1.0)
        reach = np.where(speed > 0.0, 1.0, mean)
        falls = waves.falls.reshape(-1, draws).sum(axis=1)
        if self.limits is not None:  # of the layout without errors
            exact = Waves.of_batch(batch.simulate(record=True), batch)
            score, falls = self.limits.lower(score, exact), falls + exact.falls
        found = Evaluation(score, reach, falls)
        if not gradient:
            return found
        gaps = placed.spacing.reshape(len(batch), draws, -1)[each, decisive]
        meant = batch.spacing + errors(self.settings, batch.count - 1)[decisive]
        moved = np.abs(gaps - meant) < 1e-15  # those not at the least gap
        chosen = replace(batch, spacing=gaps)
        by = speed_gradient(chosen.simulate(gradient=True), chosen)
        return found.with_gradient(replace(by, spacing=moved * by.spacing))

    def _placed(self, rows: LayoutBatch) -> LayoutBatch:
        """The rows as they are placed, all draws of a row together."""
        draws, tall = self.settings.draws, rows.height
        return replace(
            rows,
            spacing=self.settings.rows(rows.spacing),
            thickness=np.repeat(rows.thickness, draws, axis=0),
            height=tall if len(tall) == 1 else np.repeat(tall, draws, axis=0),
        )

    def in_words(self, score: float, wave: Wave) -> str:
        """Say the speed, and how many of the rows reach it."""
        part = 1.0 - self.settings.quantile
        return f"{score:.6f} m/s reached by {100.0 * part:.4g} % of the rows as placed"

    @classmethod
    def violations(cls, tables: Any) -> Iterator[str]:
        """Refuse more draws than memory holds."""
        count, draws = tables.row.count, tables.robust.draws
        if count * draws > MOST_DRAWN:
            yield (
                f"robust.draws = {draws} of {count} dominoes are {count * draws:,}: draw at most "
                f"{MOST_DRAWN // count} rows"
            )
