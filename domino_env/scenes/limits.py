"""Objective: what a wave is worth.

A success scores more than 0.  A wave that dies scores between -1 and 0, higher the further it came.
One that runs through but breaks a limit scores between -1/2 and 0, higher the less it breaks it,
and deaths then stay below -1/2.  So any two layouts can be compared, and a search can climb.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from domino_env.chain.wave import Outcome, Wave, WaveBatch
from domino_env.scenes.objectives.tempo import Tempo

Floats = NDArray[np.float64]

OBJECTIVES = ("mean_speed", "time", "tempo", "robust", "toppled", "magnify")
"""What may count.

- mean_speed: from the first pivot to the last [m/s].
- time: the same over a course of fixed length, so that the shortest time scores most [m/s].
- tempo: how closely the arrival times follow a schedule, see `Tempo` [1].
- robust: the mean speed that most of the rows reach whose gaps are off at random [m/s].
- toppled: how many dominoes topple, and a fraction that tells how far the wave came [1].
- magnify: the height of the last domino, if the wave topples it [m].
"""

UNITS = {
    "mean_speed": "m/s", "time": "m/s", "tempo": "", "robust": "m/s", "toppled": "dominoes",
    "magnify": "m",
}  # fmt: skip
"""Of a success's score."""

# Of a row at its limit it depends on rounding whether it keeps it.  A close look lets that pass; a
# search, which looks less closely, does not, and so proposes rows that the close look passes.
CLOSE_LOOK = 1e-9
HAIR = 1e-6


@dataclass(frozen=True)
class Limits:
    """What a design must not lean on.

    Parameters
    ----------
    stall_margin
        Least allowed `Wave.stall_margin` of all falls, 0 to below 1; None for any.
    flush_loss
        Largest allowed `Wave.largest_flush_loss`, 0 or more; None for any.

    Raises
    ------
    ValueError
        With the value and what is allowed.
    """

    stall_margin: float | None = None
    flush_loss: float | None = None

    def __post_init__(self) -> None:
        if self.stall_margin is not None and not 0.0 <= self.stall_margin < 1.0:
            raise ValueError(f"stall_margin = {self.stall_margin}: give a part, 0 to below 1")
        if self.flush_loss is not None and not 0.0 <= self.flush_loss <= 1.0:
            raise ValueError(f"flush_loss = {self.flush_loss}: give a part, 0 to 1")

    def excess(self, waves: Waves) -> Floats:
        """Return (B,) by how much the limits are broken, both parts added; 0 where kept."""
        over = np.zeros(len(waves.reach))
        if self.stall_margin is not None:
            over += np.maximum(self.stall_margin - waves.lowest_stall_margin, 0.0)
        if self.flush_loss is not None:
            over += np.maximum(waves.largest_flush_loss - self.flush_loss, 0.0)
        hair = HAIR if waves.rtol <= CLOSE_LOOK else 0.0
        return np.where(over <= hair, 0.0, over)


@dataclass(frozen=True, eq=False)
class Waves:
    """What scores depend on, of B waves; fields as of `WaveBatch`."""

    propagated: NDArray[np.bool_]
    reach: Floats
    mean_speed: Floats
    toppled: Floats
    arrival_times: Floats
    lowest_stall_margin: Floats
    largest_flush_loss: Floats
    rtol: float

    @classmethod
    def of_batch(cls, batch: WaveBatch, rtol: float) -> Waves:
        """Take what scores need from a batch."""
        return cls(
            batch.outcome == Outcome.PROPAGATED, batch.reach, batch.mean_speed,
            batch.toppled.astype(np.float64), batch.arrival_times, batch.lowest_stall_margin,
            batch.largest_flush_loss, rtol,
        )  # fmt: skip

    @classmethod
    def of_one(cls, wave: Wave) -> Waves:
        """Take what scores need from a single wave, as from a batch of one."""
        margins = wave.stall_margin[np.isfinite(wave.stall_margin)]
        return cls(
            np.array([wave.outcome == Outcome.PROPAGATED]), np.array([wave.reach]),
            np.array([wave.mean_speed]), np.array([float(wave.toppled)]),
            wave.arrival_times[None], np.array([margins.min() if len(margins) else 0.0]),
            np.array([wave.largest_flush_loss]), wave.rtol,
        )  # fmt: skip


def scores(
    objective: str,
    waves: Waves,
    tempo: Tempo | None,
    last_height: Floats | float,
    limits: Limits | None,
) -> Floats:
    """Return (B,) scores of waves.

    `robust` needs more than one wave a row and is not among them.

    Parameters
    ----------
    objective
        One of `OBJECTIVES`.
    waves
        B of them.
    tempo
        The schedule of the objective "tempo".
    last_height
        (B,) or a number: height of the last domino, for "magnify" [m].
    limits
        What waves must keep; None for none.
    """
    good = _successes(objective, waves, tempo, last_height)
    if objective == "toppled":
        return np.where(waves.propagated, good, good + waves.reach)
    dead = waves.reach - 1.0
    found = np.where(waves.propagated, good, dead)
    return found if limits is None else limited(found, waves, limits)


def limited(found: Floats, waves: Waves, limits: Limits) -> Floats:
    """Lower scores where the wave breaks a limit; deaths make room for those."""
    excess = limits.excess(waves)
    broken = -0.5 * excess / (1.0 + excess)
    lowered = np.where(found < 0.0, 0.5 * found - 0.5, found)
    return np.where((found > 0.0) & (excess > 0.0), broken, lowered)


def falls(found: Floats, count: int, objective: str, limits: Limits | None) -> int:
    """Count the falls simulated for scores: N of a wave that ran through, else what they tell."""
    if objective == "toppled":
        reach = np.where(found < count, found % 1.0, 1.0)
    elif limits is None:
        reach = np.where(found < 0.0, found + 1.0, 1.0)
    else:
        reach = np.where(found < -0.5, 2.0 * (found + 1.0), 1.0)
    return int(np.ceil(reach * count).sum())


def _successes(
    objective: str, waves: Waves, tempo: Tempo | None, last_height: Floats | float
) -> Floats:
    if objective == "tempo":
        assert tempo is not None
        # a wave that died has no score of this kind, and inf no place in a mean
        times = np.where(waves.propagated[:, None], waves.arrival_times, 0.0)
        return tempo.score(times)
    if objective == "toppled":
        return waves.toppled
    if objective == "magnify":
        return np.broadcast_to(np.asarray(last_height, dtype=np.float64), waves.reach.shape)
    return waves.mean_speed
