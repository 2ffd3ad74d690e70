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
from domino_env.kernels.arrays import ARRIVAL, SUMMARY, Arrays, Summary
from domino_env.physics.wave import Outcome, WaveBatch, columns_of
from domino_env.rigid.simulation import RigidWave, simulate_standing
from domino_env.scenes.layout_batch import LayoutBatch

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
    ) -> WaveBatch:
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
        WaveBatch
            The B waves.
        """
        return layouts.simulate(record=record, gradient=gradient)


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
    ) -> WaveBatch:
        """Simulate layouts.

        A layout completes if all its dominoes are hit and topple. Otherwise its reach is the
        fraction of the dominoes before the first that does not topple, plus a part for the lean of
        that one. Results that are those of fixed pivots, such as stall margins, are 0.

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
        WaveBatch
            The B waves, without angular velocities.

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
        arrivals = np.zeros((len(waves), layouts.count), ARRIVAL)
        for b, wave in enumerate(waves):
            arrivals["time"][b] = wave.arrival_times
        density = np.broadcast_to(layouts.density, layouts.thickness.shape)
        sizes = layouts.spacing, layouts.thickness, layouts.height, density
        return WaveBatch(
            arrays=Arrays(*sizes, layouts.rise, layouts.tilt),
            physics=layouts.physics,
            rtol=self.rtol,
            summary=columns_of(np.array([_summary(wave) for wave in waves], SUMMARY)),
            arrivals=arrivals,
            mean_speed=np.array([wave.mean_speed for wave in waves]),
            run_time=sum(wave.run_time for wave in waves),
        )


Simulator: TypeAlias = FixedPivots | FreeStanding


def _summary(wave: RigidWave) -> Summary:
    """Return the results of a free-standing wave, with 0 for those of fixed pivots."""
    completes = wave.propagated
    return Summary(
        outcome=Outcome.PROPAGATED if completes else Outcome.STALLED,
        hit=wave.hit, toppled=wave.toppled, reach=1.0 if completes else _reach(wave),
        total_time=wave.arrival_times[-1] if completes else math.inf,
        estimate=wave.error_estimate, flushes=0, releases=0, flush_loss=0.0, lowest_margin=0.0,
        event_count=0,
    )  # fmt: skip


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
