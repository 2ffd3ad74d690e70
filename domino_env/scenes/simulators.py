"""Simulators of layouts: dominoes on fixed pivots, or free-standing on a floor.

Both have the same interface; a scene has one of them, and only they know whether there is a floor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias

import numpy as np

from domino_env.core.threads import share_pieces
from domino_env.rigid.simulation import RigidWave, simulate_standing
from domino_env.scenes.waves import LayoutBatch, Waves

Stop: TypeAlias = Callable[[], bool] | None
"""Function that returns True to end a slow simulation with `StoppedError`; None for none."""


@dataclass(frozen=True)
class FixedPivots:
    """Analytic simulation of dominoes on fixed pivots, with exact derivatives."""

    cost: ClassVar[int] = 1
    """Run time of a simulation over that with fixed pivots."""
    is_slow: ClassVar[bool] = False
    """True if a simulation may take seconds, has no exact derivatives and ignores `rtol`."""
    digits: ClassVar[int] = 6
    """Number of decimals of a speed [m/s]."""
    place: ClassVar[str] = ""
    """Text after a speed."""

    def simulate(
        self, layouts: LayoutBatch, *, record: bool, gradient: bool, stop: Stop = None
    ) -> Waves:
        """Simulate layouts.

        Parameters
        ----------
        layouts
            B layouts.
        record, gradient
            Compute arrival times, and derivatives of the total times, see
            `domino_env.simulate_batch`.
        stop
            Ignored.

        Returns
        -------
        Waves
            Results of the B waves.
        """
        return Waves.from_batch(layouts.simulate(record=record, gradient=gradient), layouts)


@dataclass(frozen=True)
class FreeStanding:
    """Simulation of free-standing rigid bodies on a floor, with all threads.

    Parameters
    ----------
    friction
        Coulomb coefficient of the floor.
    """

    friction: float

    cost: ClassVar[int] = 10_000
    is_slow: ClassVar[bool] = True
    digits: ClassVar[int] = 4
    rtol: ClassVar[float] = 1e-3
    """Relative tolerance for any `rtol` of a batch; errors are about 3e-4."""

    @property
    def place(self) -> str:
        """Text after a speed."""
        return f" on a floor of friction {self.friction:g}"

    def simulate(
        self, layouts: LayoutBatch, *, record: bool, gradient: bool, stop: Stop = None
    ) -> Waves:
        """Simulate layouts.

        A layout completes if all its dominoes are hit and topple. Otherwise its reach is the
        fraction of the dominoes before the first that does not topple, plus a part for the lean of
        that one. Stall margins and losses in face impacts, which are those of fixed pivots, are set
        to 0.

        Parameters
        ----------
        layouts
            B layouts.
        record, gradient
            Ignored.
        stop
            Function that returns True to end the simulation; None for none.

        Returns
        -------
        Waves
            Results of the B waves.

        Raises
        ------
        StoppedError
            If `stop` returned True.
        """
        waves: list[Any] = [None] * len(layouts)

        def simulate(first: int, last: int) -> None:
            for b in range(first, last):
                waves[b] = simulate_standing(
                    layouts.layout(b), layouts.physics, self.friction, self.rtol, stop=stop
                )

        share_pieces(simulate, len(layouts), self.cost * layouts.count)
        propagated = np.array([wave.propagated for wave in waves], np.bool_)
        return Waves(
            propagated=propagated,
            reach=np.where(propagated, 1.0, [_reach(wave) for wave in waves]),
            mean_speed=np.array([wave.mean_speed for wave in waves]),
            toppled=np.array([float(wave.toppled) for wave in waves]),
            arrival_times=np.array([wave.arrival_times for wave in waves]),
            lowest_stall_margin=np.zeros(len(waves)),
            largest_flush_loss=np.zeros(len(waves)),
            last_height=np.array([wave.layout.height[-1] for wave in waves]),
            count=layouts.count,
            rtol=self.rtol,
        )


Simulator: TypeAlias = FixedPivots | FreeStanding


def _reach(wave: RigidWave) -> float:
    """Return the reach of a free-standing wave that does not complete, less than 1.

    The first domino that does not topple counts by its lean over its tipping angle.
    """
    count = wave.layout.count
    if wave.topples.all():  # but the last is not hit: half a domino less than all
        return 1.0 - 0.5 / count
    k = int(np.argmin(wave.topples))
    tipping = math.atan2(float(wave.layout.thickness[k]), float(wave.layout.height[k]))
    # 0.99: less than a domino that topples
    return (k + 0.99 * max(float(wave.lean[k]), 0.0) / tipping) / count
