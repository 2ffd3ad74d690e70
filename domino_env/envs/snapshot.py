"""Snapshot: a row while it falls, at the instant of the latest hit; what a frame is drawn from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from domino_env.core.brief import brief

if TYPE_CHECKING:
    from domino_env.physics.wave import Wave

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The row placed so far and where its wave is.

    Attributes
    ----------
    spacing
        (M,) gaps placed so far [m].
    thickness
        (M+1,) of the dominoes standing [m].
    height
        (M+1,) of the dominoes standing [m].
    hit
        Dominoes struck so far, the pushed one included; the last of them leads.
    time
        Of the latest hit [s]; 0 before any.
    speed
        Angular velocity of the leader just after it was hit [rad/s]; 0 where the wave died.
    uniform_speed
        Mean speed of the scene's best uniform row [m/s].
    wave
        What is known of the wave through these dominoes; None while it runs on.
    """

    spacing: Floats
    thickness: Floats
    height: Floats
    hit: int
    time: float
    speed: float
    uniform_speed: float
    wave: Wave | None = None

    __repr__ = brief
