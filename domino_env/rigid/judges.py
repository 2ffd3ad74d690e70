"""Judges: who is asked when each domino of a row is hit, on hinges or on a floor, and how sure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fall:
    """What a judge saw of a row.

    Attributes
    ----------
    floor
        Friction of the floor that it stood on; None where each domino turned about its front
        bottom edge.
    arrivals
        (N,) when each domino is hit [s]; inf where the wave did not come.
    toppled
        How many passed their tipping angles.
    doubt
        How far the judge itself may be off: largest relative error of an arrival time, by its own
        estimate.
    converged
        Whether the doubt is as small as was asked for.
    how
        In words, how closely the judge looked.
    """

    floor: float | None
    arrivals: Floats
    toppled: int
    doubt: float
    converged: bool
    how: str

    @property
    def hit(self) -> int:
        """How many dominoes were hit, the first among them."""
        return int(np.isfinite(self.arrivals).sum())

    @property
    def staying_up(self) -> int:
        """How many did not topple."""
        return len(self.arrivals) - self.toppled


class Judge(Protocol):
    """Somebody who topples rows by other means than the model."""

    @property
    def name(self) -> str:
        """Name and version."""

    def fall(self, layout: Layout, physics: Physics, floor: float | None) -> Fall:
        """Topple a row on a floor of this friction, or hinged (None)."""


def in_words(floor: float | None) -> str:
    """Name a floor."""
    return "hinged" if floor is None else f"floor {floor:g}"


def largest_move(times: Floats, others: Floats) -> float:
    """Largest relative difference of the arrival times (N,) that both have.

    inf where one wave came further than the other.
    """
    came = np.isfinite(times[1:])
    if not np.array_equal(came, np.isfinite(others[1:])):
        return float("inf")
    return float(np.max(np.abs(times[1:][came] / others[1:][came] - 1.0), initial=0.0))
