"""What long uniform rows score, from their heads: once a wave is steady, every fall takes as long.

Nothing that stands further on changes what happened before, so the first dominoes of a long row
fall as those of a short one do. Where the fall times of the short row have stopped changing, the
rest of the long one is known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from domino_env.scenes.specification import Specification
from domino_env.scenes.waves import LayoutBatch, Waves

Floats = NDArray[np.float64]

SHORTEST = 64  # dominoes of the first heads; those that are not steady are doubled
WINDOW = 4  # the last 1/4 of a head has to be steady


def scores_by_heads(
    scene: Specification, spacing: Floats, thickness: Floats, rtol: float, steady: float, piece: int
) -> Floats:
    """Score uniform rows of equal dominoes by heads as short as their waves allow.

    Parameters
    ----------
    scene
        Whose objective and count of dominoes it is; one wave a score.
    spacing, thickness
        (B,) gap and thickness of dominoes 1 … N-1 of each row [m].
    rtol
        Relative error allowed in the arrival times.
    steady
        Largest relative change of the velocity at release that still counts as none.
    piece
        Dominoes at once.

    Returns
    -------
    NDArray
        (B,) scores, those of the whole rows to about `steady` of themselves.
    """
    scores = np.empty(len(spacing))
    left, n = np.arange(len(spacing)), SHORTEST
    while len(left):
        n = min(n, scene.count)
        held = scene.count if scene.criterion.needs_arrivals else n
        size, unsettled = max(1, piece // held), []
        for i in range(0, len(left), size):
            some = left[i : i + size, None] * np.ones(n - 1, np.int64)
            waves, settled = extended(
                scene.batch(spacing[some], thickness[some], rtol=rtol),
                scene.count,
                steady,
                arrivals=scene.criterion.needs_arrivals,
            )
            scores[some[:, 0]] = scene.criterion.score(waves).score
            unsettled.append(some[~settled, 0])
        left, n = np.concatenate(unsettled), 2 * n
    return scores


def extended(
    head: LayoutBatch, count: int, steady: float, *, arrivals: bool
) -> tuple[Waves, NDArray[np.bool_]]:
    """Simulate the heads of B uniform rows, and say what the waves of the whole rows come to.

    Parameters
    ----------
    head
        The first dominoes of the rows.
    count
        Number N of dominoes of the whole rows.
    steady
        As of `scores_by_heads`.
    arrivals
        Whether all their arrival times are wanted.

    Returns
    -------
    waves : Waves
        Of the whole rows.
    settled : NDArray
        (B,) whether the heads were long enough to tell: the wave was steady, or died.
    """
    n, more = head.count, count - head.count
    batch = head.simulate(record=True)
    waves = Waves.of_batch(batch, head)
    if more == 0:
        return waves, np.ones(len(head), np.bool_)
    window = n // WINDOW
    last = batch.release_velocity[:, -window:]
    same = np.ptp(last, axis=1) <= steady * last[:, -1]
    # in the last fall of a head nothing is struck: in the whole row the wave might die there
    settled = np.where(waves.propagated, same, waves.reach * n < n - 1)
    times = np.where(waves.propagated[:, None], batch.arrival_times, 0.0)
    step = (times[:, -1] - times[:, -1 - window]) / window
    pitch = head.spacing + head.thickness[:, 1:]
    way = pitch.sum(axis=1) + more * pitch[:, -1]
    time = times[:, -1] + more * step
    if arrivals:
        times = np.concatenate(
            [times, times[:, -1:] + np.arange(1, more + 1) * step[:, None]], axis=1
        )
    return replace(
        waves,
        reach=np.where(waves.propagated, 1.0, waves.reach * n / count),
        mean_speed=np.divide(way, time, out=np.zeros_like(way), where=waves.propagated),
        toppled=np.where(waves.propagated, count, waves.toppled),
        arrival_times=times if arrivals else np.empty((len(head), 0)),
        count=count,
    ), settled
