"""Waves of free-standing layouts on a floor, as rigid bodies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from domino_env.core.threads import share_pieces
from domino_env.rigid.simulation import RigidWave, simulate_standing
from domino_env.scenes.waves import LayoutBatch, Waves

RTOL = 1e-3  # of all free-standing waves, whatever is asked for: their error is some 2e-4 anyway
COST = 10_000  # analytic waves that take as long as one free-standing layout


def simulate_free_standing(batch: LayoutBatch, floor_friction: float) -> Waves:
    """Simulate free-standing layouts, by all threads.

    A layout completes if all its dominoes topple; else its reach is the part of the dominoes that
    topple from the first on.

    Raises
    ------
    StoppedError
        Where the `stop` of the batch returned True.
    """
    waves: list[Any] = [None] * len(batch)

    def simulate(first: int, last: int) -> None:
        for b in range(first, last):
            layout = batch.layout(b)
            waves[b] = simulate_standing(
                layout, batch.physics, floor_friction, RTOL, stop=batch.stop
            )

    share_pieces(simulate, len(batch), COST * batch.count)
    whole = np.array([wave.propagated for wave in waves], np.bool_)
    return Waves(
        propagated=whole,
        reach=np.where(whole, 1.0, [_reach(wave) for wave in waves]),
        mean_speed=np.array([wave.mean_speed for wave in waves]),
        toppled=np.array([float(wave.toppled) for wave in waves]),
        arrival_times=np.array([wave.arrival_times for wave in waves]),
        lowest_stall_margin=np.zeros(len(waves)),
        largest_flush_loss=np.zeros(len(waves)),
        last_height=np.array([wave.layout.height[-1] for wave in waves]),
        count=batch.count,
        rtol=RTOL,
    )


def _reach(wave: RigidWave) -> float:
    """Return the part of the dominoes that topple from the first on, and of the next lean; < 1."""
    count = wave.layout.count
    if wave.topples.all():  # all lie, but the last was never struck
        return 1.0 - 0.5 / count
    k = int(np.argmin(wave.topples))
    tipping = math.atan2(float(wave.layout.thickness[k]), float(wave.layout.height[k]))
    return (k + 0.99 * max(float(wave.lean[k]), 0.0) / tipping) / count
