"""Placement errors: what a row is worth when it is not built exactly as drawn."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_GAP = 0.0002  # [m] no gap is ever placed tighter
LARGEST_DRAWS = 100_000


@dataclass(frozen=True)
class Placement:
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

    deviation: float
    quantile: float = 0.05
    draws: int = 256
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 <= self.deviation < np.inf:
            raise ValueError(f"deviation = {self.deviation}: give 0 or more [m]")
        if not 0.0 < self.quantile <= 1.0:
            raise ValueError(f"quantile = {self.quantile}: give a part, more than 0 and at most 1")
        if not 1 <= self.draws <= LARGEST_DRAWS:
            raise ValueError(f"draws = {self.draws}: give a number from 1 to {LARGEST_DRAWS}")
        if self.seed < 0:
            raise ValueError(f"seed = {self.seed}: give a whole number, 0 or more")

    @cached_property
    def _errors(self) -> dict[int, Floats]:
        return {}

    def errors(self, pairs: int) -> Floats:
        """Draw (draws, pairs) what is added to the gaps [m]; once for each length of a row."""
        if pairs not in self._errors:
            random = np.random.default_rng(self.seed)
            self._errors[pairs] = self.deviation * random.standard_normal((self.draws, pairs))
        return self._errors[pairs]

    def rows(self, spacing: Floats) -> Floats:
        """Return (B · draws, N-1) the gaps as they are placed, all draws of a row together [m]."""
        placed = np.maximum(spacing[:, None, :] + self.errors(spacing.shape[1]), LEAST_GAP)
        return placed.reshape(-1, spacing.shape[1])

    @property
    def rank(self) -> int:
        """The place of the draw that counts among all draws, from the slowest, 0."""
        return max(math.ceil(self.quantile * self.draws - 1e-9), 1) - 1

    def decisive(self, speeds: Floats) -> Ints:
        """Return (B,) which draw counts of speeds (B, draws): the one at `rank`."""
        return np.argsort(speeds, axis=1, kind="stable")[:, self.rank]
