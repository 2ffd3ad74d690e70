"""Placement noise: random errors of all designed gaps, and statistics of scores over draws."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Annotated

import numpy as np
from msgspec import Meta

from domino_env.core.models import Size, Value, about
from domino_env.core.types import Floats, read_only
from domino_env.physics.ground import Ground
from domino_env.physics.wave import Wave
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.objectives.base import ScoreGradient, Scores

LARGEST_DRAWS = 100_000  # largest number of draws of one layout
MOST_DRAWN_DOMINOES = 4_000_000  # [dominoes] in all draws, whose simulation takes some 200 MB
DRAWS = 256  # draws of `placement_noise`
LEAST_GAP = 0.0002  # [m] smallest gap with a placement error

Evaluate = Callable[[LayoutBatch, bool], Scores]
"""Function that scores layouts as placed, with or without derivatives."""
Draws = Annotated[int, Meta(ge=0, le=LARGEST_DRAWS)]
Quantile = Annotated[float, Meta(gt=0, le=1)]


def add_errors(spacing: Floats, errors: Floats) -> Floats:
    """Return gaps with placement errors (…, N-1) [m], at least `LEAST_GAP`."""
    return np.maximum(spacing + errors, LEAST_GAP)


class Placement(Value, frozen=True):  # type: ignore[misc]
    """Normal errors of all designed gaps, in every episode of an environment and in scores.

    Parameters
    ----------
    deviation
        Standard deviation of the error of each gap [m].
    draws
        Number of draws of errors over which the score of a layout is a statistic, so that a search
        finds the best layout that is planned before any error is observed; 0 to score layouts
        without errors.
    quantile
        Share of the draws that may score less: the score is a quantile over the draws. None for
        the mean.
    seed
        The draws are those of environments reset with the seeds from this one on.

    Raises
    ------
    ValueError
        For a value out of its range, and for a quantile without draws.
    """

    deviation: Annotated[Size, about("standard deviation of each gap's error [m]")]
    draws: Annotated[Draws, about("number of draws that are scored; 0: no errors")] = 0
    quantile: Annotated[
        Quantile | None, about("share of the draws that may score less; default: their mean")
    ] = None
    seed: Annotated[int, Meta(ge=0, le=2**63 - 1, description="seed of the first draw")] = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.quantile is not None and not self.draws:
            raise ValueError(f"quantile = {self.quantile:g} without draws: give draws = 256")

    def errors(self, pairs: int) -> Floats:
        """Return the errors of the gaps (draws, pairs) [m]; equal arguments share one array."""
        return _draw_errors(self, pairs)

    def evaluate(self, layouts: LayoutBatch, evaluate: Evaluate, gradient: bool) -> Scores:
        """Score all draws of layouts, and return the statistic for each layout.

        The derivatives of a quantile are those of the draw at the quantile.

        Parameters
        ----------
        layouts
            B layouts without errors.
        evaluate
            Function that scores layouts as placed.
        gradient
            Compute the derivatives of the statistic too.

        Returns
        -------
        Scores
            Statistics of the B layouts. If a quantile is not a success, the score is the mean reach
            of the draws minus 1. `falls` are those of all draws.
        """
        errors, shape = self.errors(layouts.count - 1), (len(layouts), self.draws)
        drawn = evaluate(draw_layouts(layouts, errors), gradient and self.quantile is None)
        score, reach = drawn.score.reshape(shape), drawn.reach.reshape(shape).mean(axis=1)
        falls = drawn.falls.reshape(shape).sum(axis=1)
        if self.quantile is None:
            value = failure = score.mean(axis=1)
        else:
            rank = max(math.ceil(self.quantile * self.draws - 1e-9), 1) - 1  # 1e-9: rounding
            # index of the draw at the quantile; waves that stop are the slowest
            decisive = np.argsort(np.maximum(score, 0.0), axis=1, kind="stable")[:, rank]
            value, failure = score[np.arange(len(layouts)), decisive], reach - 1.0
            errors = errors[decisive]
        succeeds = value > 0.0
        scores = Scores(np.where(succeeds, value, failure), np.where(succeeds, 1.0, reach), falls)
        if not gradient:
            return scores
        if self.quantile is not None:
            spacing = add_errors(layouts.spacing, errors)
            drawn, errors = evaluate(replace(layouts, spacing=spacing), True), errors[:, None]
        is_free = layouts.spacing[:, None] + errors > LEAST_GAP  # False for gaps raised to it
        drawn_shape = len(layouts), errors.shape[-2], layouts.count - 1
        spacing, *others = (part.reshape(drawn_shape) for part in drawn.gradient)
        parts = is_free * spacing, *others
        return scores.with_gradient(ScoreGradient(*(part.mean(axis=1) for part in parts)))

    def describe(self, text: str, unit: str) -> str:
        """Add the statistic to a formatted score with a unit."""
        if self.quantile is None:
            return f"{'mean ' * bool(unit)}{text} over {self.draws} draws of placement noise"
        share = 100.0 * (1.0 - self.quantile)
        return f"{text} reached by {share:.4g} % of the layouts as placed"


@lru_cache(8)
def _draw_errors(placement: Placement, pairs: int) -> Floats:
    """Return the errors of the gaps (draws, pairs) [m]."""
    seeds = range(placement.seed, placement.seed + placement.draws)
    normals = [np.random.default_rng(seed).standard_normal(pairs) for seed in seeds]
    return read_only(placement.deviation * np.array(normals).reshape(placement.draws, pairs))


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


def placement_noise(
    wave: Wave, ground: Ground | None, deviation: float, run_out: int = 0
) -> dict[str, float]:
    """Return the fraction of draws that complete and statistics of their total times [s].

    Parameters
    ----------
    wave
        Wave of the layout without errors.
    ground
        Ground on which the layout stands; None for flat ground.
    deviation
        Standard deviation of the placement error of each gap [m].
    run_out
        Number of dominoes of the run-out, whose gaps have no errors as in scores.

    Returns
    -------
    dict
        `deviation`, `draws` (256, or fewer if these have more than 4 million dominoes),
        `completes`, and if a draw completes `mean`, `spread` (standard deviation),
        `fastest_5_percent` and `slowest_5_percent` of their times.

    Raises
    ------
    ValueError
        For a layout on uneven ground if `ground` is None.
    """
    layout = wave.layout
    if ground is None and not layout.is_flat:
        raise ValueError("the layout is on uneven ground: give the `ground` of its scene")
    draws = min(DRAWS, max(MOST_DRAWN_DOMINOES // layout.count, 1))
    errors = Placement(deviation, draws).errors(layout.count - 1 - run_out)
    errors = np.pad(errors, ((0, 0), (0, run_out)))
    batch = LayoutBatch.of_one(layout, wave.physics, 1e-6, ground)
    waves = draw_layouts(batch, errors).simulate()
    times = waves.total_time[waves.mean_speed > 0.0]
    noise = {"deviation": deviation, "draws": len(waves), "completes": len(times) / len(waves)}
    if len(times):
        fast, slow = np.quantile(times, (0.05, 0.95)).tolist()
        noise |= {"mean": float(times.mean()), "spread": float(times.std())}
        noise |= {"fastest_5_percent": fast, "slowest_5_percent": slow}
    return noise
