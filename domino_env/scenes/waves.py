"""Batches of layouts, and the results of waves from which scores are computed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from domino_env.core.results import dataclass_repr
from domino_env.core.types import Floats, Ints
from domino_env.physics import footing
from domino_env.physics.gradient import Gradient
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome, Wave, WaveBatch, require_wave, simulate_batch


@dataclass(frozen=True, eq=False)
class LayoutBatch:
    """B layouts of N dominoes each, to be simulated.

    Attributes
    ----------
    spacing
        (B, N-1) free gaps [m].
    thickness
        (B, N) thicknesses [m].
    height
        (B, N) heights, or (1, N) if they are the same in all layouts [m].
    width
        Width of every domino [m].
    density
        Density, a number or (N,) [kg/m³].
    physics
        Friction, gravity and push.
    rtol
        Relative tolerance of the arrival times.
    ground
        Ground on which the layouts stand; None for flat ground.
    """

    spacing: Floats
    thickness: Floats
    height: Floats
    width: float
    density: float | Floats
    physics: Physics
    rtol: float
    ground: Ground | None = None

    __repr__ = dataclass_repr

    def __len__(self) -> int:
        return len(self.spacing)

    @property
    def count(self) -> int:
        """Number of dominoes N."""
        return int(self.thickness.shape[1])

    def __getitem__(self, part: slice) -> LayoutBatch:
        heights = self.height if len(self.height) == 1 else self.height[part]
        spacing, thickness = self.spacing[part], self.thickness[part]
        return replace(self, spacing=spacing, thickness=thickness, height=heights)

    def layout(self, b: int) -> Layout:
        """Return the layout with index b."""
        heights = self.height[b % len(self.height)]
        sizes = self.spacing[b], self.thickness[b], heights, self.width, self.density
        return Layout(*sizes) if self.ground is None else Layout(*sizes, self.rise[b], self.tilt[b])

    @property
    def rise(self) -> Floats:
        """(B, N-1) rises from pivot to pivot, as in `Layout` [m]."""
        return self._rise_and_tilt[0]

    @property
    def tilt(self) -> Floats:
        """(B, N) tilts of the dominoes, as in `Layout` [rad]."""
        return self._rise_and_tilt[1]

    @cached_property
    def _rise_and_tilt(self) -> tuple[Floats, Floats]:
        if self.ground is None:
            return np.zeros(self.spacing.shape), np.zeros(self.thickness.shape)
        return self.ground.rise_and_tilt(self.spacing, self.thickness)

    def simulate(self, *, record: bool = False, gradient: bool = False) -> WaveBatch:
        """Simulate all layouts; the arguments are those of `domino_env.simulate_batch`.

        On uneven ground, placement noise may make a gap so narrow that dominoes lean against each
        other. Such a gap is replaced by one that is out of reach, so that the wave stops there.
        """
        gaps, ground = self.spacing, {}
        if self.ground is not None:
            ground = {"rise": self.rise, "tilt": self.tilt}
            if not self.ground.is_even:
                arrays = gaps, self.thickness, self.height, self.rise, self.tilt
                # a gap of two heights is out of reach
                gaps = np.where(footing.impassable(*arrays), 2.0 * self.height[:, :-1], gaps)
        return simulate_batch(
            gaps, self.thickness, self.physics, height=self.height, density=self.density,
            rtol=self.rtol, record=record, gradient=gradient, **ground,
        )  # fmt: skip

    def along_ground(self, gradient: Gradient) -> Gradient:
        """Convert a gradient as `Ground.along_ground` does; on flat ground it is unchanged."""
        return gradient if self.ground is None else self.ground.along_ground(gradient, self)


@dataclass(frozen=True, eq=False)
class Waves:
    """Results of the waves of B layouts of N dominoes each, from which scores are computed.

    Attributes
    ----------
    propagated
        (B,) True if the wave completes.
    reach, mean_speed, toppled, lowest_stall_margin, largest_flush_loss
        (B,) as in `WaveBatch`; the speed in m/s.
    arrival_times
        (B, N) arrival times [s]; (B, 0) if they are not recorded.
    last_height
        (B,) height of the last domino [m].
    count
        Number N of dominoes.
    rtol
        Relative tolerance of the arrival times.
    analytic
        The waves as they were simulated with fixed pivots; None for others.
    """

    propagated: NDArray[np.bool_]
    reach: Floats
    mean_speed: Floats
    toppled: Floats
    arrival_times: Floats
    lowest_stall_margin: Floats
    largest_flush_loss: Floats
    last_height: Floats
    count: int
    rtol: float
    analytic: WaveBatch | None = None

    @classmethod
    def from_batch(cls, batch: WaveBatch, layouts: LayoutBatch) -> Self:
        """Return the results of the waves of a batch of layouts."""
        return cls(
            batch.outcome == Outcome.PROPAGATED, batch.reach, batch.mean_speed,
            batch.toppled.astype(np.float64), batch.arrival_times, batch.lowest_stall_margin,
            batch.largest_flush_loss, np.broadcast_to(layouts.height[:, -1], len(layouts)),
            layouts.count, layouts.rtol, batch,
        )  # fmt: skip

    @classmethod
    def from_waves(cls, waves: Sequence[Wave], count: int) -> Self:
        """Return the results of single waves.

        Parameters
        ----------
        waves
            Waves of layouts of at most `count` dominoes; every `reach` refers to `count` dominoes.
        count
            Number N of dominoes of complete layouts.

        Returns
        -------
        Waves
            The results, with infinite arrival times of the missing dominoes.

        Raises
        ------
        TypeError
            For anything but waves.
        ValueError
            For a wave of more dominoes than `count`, or of fewer if it propagated.
        """
        times = np.full((len(waves), count), np.inf)
        results = np.empty((len(waves), 7))
        for b, wave in enumerate(waves):
            require_wave(f"waves[{b}]", wave)
            n, propagated = wave.layout.count, wave.outcome == Outcome.PROPAGATED
            if n > count or (n < count and propagated):
                raise ValueError(f"waves[{b}] has {n} dominoes: give {count}, or fewer if it stops")
            times[b, :n] = wave.arrival_times
            margins = wave.stall_margin
            margins = margins[np.isfinite(margins)]
            results[b] = (
                propagated, wave.reach, wave.mean_speed, wave.toppled,
                np.minimum.reduce(margins) if len(margins) else 0.0, wave.largest_flush_loss,
                wave.layout.height[-1],
            )  # fmt: skip
        passed, reach, speed, toppled, margin, loss, height = results.T
        rtol = max([wave.rtol for wave in waves], default=0.0)
        return cls(passed > 0.0, reach, speed, toppled, times, margin, loss, height, count, rtol)

    @property
    def falls(self) -> Ints:
        """(B,) numbers of simulated intervals between hits.

        N for a wave that completes, as the last domino falls too.
        """
        return np.ceil(self.reach * self.count).astype(np.int64)
