"""Scores of rows that stand free on a floor: their mean speed as rigid bodies, if all topple."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from domino_env.core.threads import share_pieces
from domino_env.physics.wave import Wave
from domino_env.rigid.simulation import RigidWave, simulate_standing
from domino_env.scenes.objectives.base import Evaluation
from domino_env.scenes.objectives.speed import Speed
from domino_env.scenes.waves import LayoutBatch, Waves

RTOL = 1e-3  # of all standing scores, whatever is asked for: what they are off is some 2e-4 alike
WAVES = 10_000  # analytic ones that take as long as one standing row


@dataclass(frozen=True)
class StandingSpeed(Speed):
    """A success scores the mean speed of the row as it stands free on a floor [m/s].

    Parameters
    ----------
    floor_friction
        Coulomb coefficient between dominoes and floor.

    Notes
    -----
    A failure scores between -1 and 0: the part of the dominoes that topple from the first on,
    less 1. Slopes are those of the analytic model, as much larger as the standing speed is: near
    enough to climb by, but not exact.
    """

    floor_friction: float

    is_mean_speed: ClassVar[bool] = False
    """Nor is it that of the analytic wave."""
    simulates_anew: ClassVar[bool] = True

    @property
    def simulations_per_score(self) -> int:
        """How many analytic waves take as long as one score."""
        return WAVES

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Topple layouts on the floor, by all threads, and score them.

        The gradient is that of the analytic model, scaled by the ratio of the speeds.
        """
        waves: list[RigidWave | None] = [None] * len(batch)

        def topple(first: int, last: int) -> None:
            for b in range(first, last):
                layout = batch.layout(b)
                waves[b] = simulate_standing(layout, batch.physics, self.floor_friction, RTOL)

        if waves:
            share_pieces(topple, len(waves), WAVES * batch.count)
        found = self.score(_as_waves([wave for wave in waves if wave is not None]))
        if not gradient:
            return found
        analytic = super().evaluate(batch, gradient=True)
        assert analytic.gradient is not None
        both = (found.score > 0.0) & (analytic.score > 0.0)
        ratio = np.where(both, found.score / np.where(both, analytic.score, 1.0), 0.0)
        return found.with_gradient(analytic.gradient.scaled(ratio))

    def in_words(self, score: float, wave: Wave) -> str:
        """Say the speed of a success, and on what."""
        return f"{score:.4f} m/s on a floor of friction {self.floor_friction:g}"


def _as_waves(found: list[RigidWave]) -> Waves:
    """What scores depend on, of rows that have toppled on the floor."""
    whole = np.array([wave.propagated and wave.topples.all() for wave in found], np.bool_)
    return Waves(
        propagated=whole,
        reach=np.where(whole, 1.0, [_reach(wave) for wave in found]),
        mean_speed=np.array([wave.mean_speed for wave in found]),
        toppled=np.array([float(wave.toppled) for wave in found]),
        arrival_times=np.array([wave.arrival_times for wave in found]),
        lowest_stall_margin=np.zeros(len(found)),
        largest_flush_loss=np.zeros(len(found)),
        last_height=np.array([wave.layout.height[-1] for wave in found]),
        count=found[0].layout.count if found else 0,
        rtol=RTOL,
    )


def _reach(wave: RigidWave) -> float:
    """Dominoes that topple from the first on, and how far the next one came, over N; below 1."""
    up: NDArray[np.intp] = np.flatnonzero(~wave.topples)
    count = wave.layout.count
    if not len(up):  # all lie, but the last was never struck
        return 1.0 - 0.5 / count
    k = int(up[0])
    tipping = math.atan2(float(wave.layout.thickness[k]), float(wave.layout.height[k]))
    return (k + 0.99 * max(float(wave.lean[k]), 0.0) / tipping) / count
