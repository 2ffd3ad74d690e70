"""Tempo: a schedule that the arrival times of a wave are to follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TOLERANCE = 1e-3  # [s]


@dataclass(frozen=True)
class Tempo:
    """When each domino is to be hit.

    Give either `first` and `last`, between which the frequency rises (or falls) evenly from
    interval to interval, or `times`.

    Parameters
    ----------
    first
        Hits a second between dominoes 0 and 1.
    last
        Hits a second between the last two.
    times
        When dominoes 1 … N-1 are to be hit [s].
    tolerance
        The root-mean-square error that halves the score [s].

    Raises
    ------
    ValueError
        For anything that is no schedule; says what to give.
    """

    first: float | None = None
    last: float | None = None
    times: tuple[float, ...] | None = None
    tolerance: float = TOLERANCE

    def __post_init__(self) -> None:
        rates = self.first, self.last
        if (self.times is None) == (rates == (None, None)):
            raise ValueError("give either from and to [hits/s], or times [s]")
        if self.times is None:
            for name, rate in zip(("from", "to"), rates, strict=True):
                if rate is None or not 0.0 < rate < np.inf:
                    raise ValueError(f"{name} = {rate}: give a frequency of more than 0 [hits/s]")
        else:
            object.__setattr__(self, "times", tuple(float(t) for t in self.times))
            steps = np.diff(self.times, prepend=0.0)
            if not (np.isfinite(steps).all() and (steps > 0.0).all()):
                i = int(np.argmin(np.isfinite(steps) & (steps > 0.0)))
                raise ValueError(
                    f"times[{i}] = {self.times[i]} s: times rise from domino to domino, the first "
                    "is more than 0"
                )
        if not 0.0 < self.tolerance < np.inf:
            raise ValueError(f"tolerance = {self.tolerance}: give a time of more than 0 [s]")

    def schedule(self, count: int) -> Floats:
        """Return (N-1,) when dominoes 1 … N-1 of a row of `count` are to be hit [s].

        Raises
        ------
        ValueError
            Where the times given are of a row of another length.
        """
        if self.times is not None:
            if len(self.times) != count - 1:
                raise ValueError(
                    f"times has {len(self.times)} entries: a row of {count} dominoes needs one "
                    f"for each but the first, {count - 1}"
                )
            return np.array(self.times)
        assert self.first is not None
        assert self.last is not None
        return np.cumsum(1.0 / np.linspace(self.first, self.last, count - 1))

    def error(self, arrivals: Floats) -> Floats:
        """Return (B,) root-mean-square error of arrival times (B, N) at dominoes 1 … N-1 [s]."""
        late = arrivals[:, 1:] - self.schedule(arrivals.shape[1])
        return np.asarray(np.sqrt(np.mean(late**2, axis=1)))

    def score(self, arrivals: Floats) -> Floats:
        """Return (B,) 1 / (1 + RMS error / tolerance): 1 on the dot, a half at the tolerance."""
        return 1.0 / (1.0 + self.error(arrivals) / self.tolerance)

    def slope(self, arrivals: Floats) -> Floats:
        """Return (B, N) derivative of the score by the arrival times [1/s]; 0 at its peak."""
        late = arrivals[:, 1:] - self.schedule(arrivals.shape[1])
        error, score = self.error(arrivals)[:, None], self.score(arrivals)[:, None]
        by_time = -(score**2) / self.tolerance * late / (late.shape[1] * np.maximum(error, 1e-300))
        return np.concatenate([np.zeros((len(late), 1)), by_time], axis=1)
