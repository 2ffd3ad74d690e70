"""Batches of layouts, which are simulated and scored together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from domino_env.core.results import dataclass_repr
from domino_env.core.types import Floats
from domino_env.physics import footing
from domino_env.physics.gradient import Gradient
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import WaveBatch, simulate_batch


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

    @classmethod
    def of_one(
        cls, layout: Layout, physics: Physics, rtol: float, ground: Ground | None
    ) -> LayoutBatch:
        """Return the batch of one layout."""
        sizes = layout.spacing[None], layout.thickness[None], layout.height[None]
        return cls(*sizes, layout.width, layout.density, physics, rtol, ground)

    def __len__(self) -> int:
        return len(self.spacing)

    @property
    def count(self) -> int:
        """Number of dominoes N."""
        return int(self.thickness.shape[1])

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

        With both, fields per domino are kept, and layouts are simulated twice.
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
        waves = simulate_batch(
            gaps, self.thickness, self.physics, height=self.height, density=self.density,
            rtol=self.rtol, record=record, gradient=gradient and not record, **ground,
        )  # fmt: skip
        if not (record and gradient):
            return waves
        last = np.broadcast_to(np.eye(1, self.count, self.count - 1), self.thickness.shape)
        return replace(waves, gradient=waves.pullback(last))

    def along_ground(self, gradient: Gradient) -> Gradient:
        """Convert a gradient as `Ground.along_ground` does; on flat ground it is unchanged."""
        return gradient if self.ground is None else self.ground.along_ground(gradient, self)
