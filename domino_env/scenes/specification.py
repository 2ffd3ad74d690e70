"""A scene as a value: what stands, what may be chosen, what counts."""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.scenes.grounds import clash_with_ground
from domino_env.scenes.limits import Limits
from domino_env.scenes.objectives import OBJECTIVES, Objective
from domino_env.scenes.objectives.robust import Placement
from domino_env.scenes.objectives.standing import StandingSpeed, checked_floor, refusal
from domino_env.scenes.objectives.tempo import Tempo
from domino_env.scenes.rules import off_list, on_other_ground, outside, too_steep
from domino_env.scenes.stock import Stock
from domino_env.scenes.unsteady import unsteady_refusal
from domino_env.scenes.waves import LayoutBatch

Floats = NDArray[np.float64]
Bounds = tuple[float, float]

LENGTH_TOLERANCE = 1e-9  # [m]


@dataclass(frozen=True)
class Specification:
    """What stands, what may be chosen, what counts; its fields are those of `Scene`."""

    name: str
    title: str
    objective: str
    physics: Physics
    count: int
    height: float
    width: float
    density: float
    first_thickness: float
    spacing: Bounds
    thickness: Bounds
    length: float | None = None
    spacing_values: tuple[float, ...] | None = None
    thickness_values: tuple[float, ...] | None = None
    largest_change: float | None = None
    stock: Stock | None = None
    growth: Bounds | None = None
    in_heights: bool = False
    limits: Limits | None = None
    settings: Any = None
    floor_friction: float | None = None
    ground: Ground | None = None
    placement_deviation: float = 0.0

    def __post_init__(self) -> None:
        for name in ("spacing", "thickness", "spacing_values", "thickness_values", "growth"):
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, tuple(map(float, values)))
        if self.objective not in OBJECTIVES:
            raise ValueError(
                f"scene '{self.name}': objective = {self.objective!r}: choose "
                f"{', '.join(OBJECTIVES)}"
            )
        needed = OBJECTIVES[self.objective].table or NoneType
        if not isinstance(self.settings, needed):
            raise ValueError(
                f"scene '{self.name}': settings = {self.settings!r}: objective = "
                f"{self.objective!r} needs {'none' if needed is NoneType else needed.__name__}"
            )
        if self.floor_friction is not None:
            self._require_floor()
        if self.placement_deviation != 0.0:
            self._require_unsteady()
        if self.ground is not None:
            self._require_ground()

    def _require_floor(self) -> None:
        assert self.floor_friction is not None
        object.__setattr__(self, "floor_friction", checked_floor(self.floor_friction))
        refused = refusal(
            self.objective,
            is_speed=OBJECTIVES[self.objective].is_mean_speed,
            limited=self.limits is not None,
        )
        if refused is not None:
            raise ValueError(f"scene '{self.name}': {refused}")

    def _require_unsteady(self) -> None:
        refused = unsteady_refusal(
            self.placement_deviation, robust=self.placement is not None, length=self.length
        )
        if refused is not None:
            raise ValueError(f"scene '{self.name}': {refused}")

    def _require_ground(self) -> None:
        assert self.ground is not None
        heights = self.height if self.in_heights else 1.0
        refused = clash_with_ground(
            self.ground,
            height=self.height,
            thickness=(
                min(self.first_thickness, heights * self.thickness[0]),
                max(self.first_thickness, heights * self.thickness[1]),
            ),
            spacing=(heights * self.spacing[0], heights * self.spacing[1]),
            length=self.length,
            grows=self.growth is not None,
            unsteady=self.placement_deviation > 0.0,
        )
        if refused is not None:
            raise ValueError(f"scene '{self.name}': {refused}")

    @property
    def criterion(self) -> Objective:
        """What counts, as an object: how waves are scored."""
        if self.floor_friction is not None:
            floor = self.floor_friction
            return StandingSpeed(self.settings, self.limits, floor, ground=self.ground)
        return OBJECTIVES[self.objective](self.settings, self.limits, ground=self.ground)

    @property
    def tempo(self) -> Tempo | None:
        """The schedule of the objective "tempo"."""
        return self.settings if isinstance(self.settings, Tempo) else None

    @property
    def placement(self) -> Placement | None:
        """The errors of the objective "robust"."""
        return self.settings if isinstance(self.settings, Placement) else None

    @property
    def free_spacing(self) -> bool:
        """Whether the designer chooses the gaps."""
        return bool(self.spacing[0] < self.spacing[1])

    @property
    def free_thickness(self) -> bool:
        """Whether the designer chooses the thickness of all dominoes but the first."""
        return bool(self.thickness[0] < self.thickness[1])

    @property
    def free_height(self) -> bool:
        """Whether the designer chooses the height of all dominoes but the first."""
        return self.growth is not None and bool(self.growth[0] < self.growth[1])

    @property
    def plain(self) -> bool:
        """Whether bounds and a length are all the rules, so that gaps may be chosen one by one."""
        asked = (self.spacing_values, self.thickness_values, self.largest_change, self.stock)
        return all(rule is None for rule in (*asked, self.growth, self.limits))

    def layout(
        self,
        spacing: ArrayLike,
        thickness: ArrayLike | None = None,
        height: ArrayLike | None = None,
    ) -> Layout:
        """Lay the row with these free gaps, thicknesses and heights.

        The scene's rules are not applied: see `violations`.

        Parameters
        ----------
        spacing
            (N-1,) free gaps [m]; a single number serves all.
        thickness
            (N-1,) of dominoes 1 … N-1 [m], or a single number; None where the scene fixes it.
        height
            (N-1,) of dominoes 1 … N-1 [m], or a single number; None where all are equally high.
        """
        pairs = (self.count - 1,)
        gaps = np.broadcast_to(np.asarray(spacing, dtype=np.float64), pairs)
        if height is None and self.growth is not None:
            raise ValueError(f"scene '{self.name}' lets the row grow: give the heights too")
        rest = self.height if height is None else np.asarray(height, dtype=np.float64)
        tall = np.concatenate(([self.height], np.broadcast_to(rest, pairs)))
        if thickness is None:
            if self.free_thickness:
                raise ValueError(f"scene '{self.name}' leaves the thickness free: give it too")
            thickness = self.thickness[0] * (tall[1:] if self.in_heights else 1.0)
        thick = np.broadcast_to(np.asarray(thickness, dtype=np.float64), pairs)
        full = np.concatenate(([self.first_thickness], thick))
        row = gaps, full, tall, self.width, self.density
        return Layout(*row) if self.ground is None else self.ground.layout(*row)

    def batch(
        self,
        spacing: Floats,
        thickness: Floats | None = None,
        height: Floats | None = None,
        rtol: float = 1e-6,
    ) -> LayoutBatch:
        """Lay B rows at once, without applying the scene's rules.

        Parameters
        ----------
        spacing
            (B, N-1) free gaps [m].
        thickness
            (B, N-1) of dominoes 1 … N-1 [m]; None where it is fixed.
        height
            (B, N-1) of dominoes 1 … N-1 [m]; None where all are equally high.
        rtol
            Relative error that will be allowed in the arrival times.
        """
        tall = self._heights(len(spacing), height)
        thick = self._thicknesses(len(spacing), thickness, tall)
        row = spacing, thick, tall, self.width, self.density
        return LayoutBatch(*row, self.physics, rtol, self.ground)

    def violations(self, layout: Layout) -> list[str]:
        """List what the layout breaks of the scene's rules, a sentence each; empty if nothing.

        Limits on the wave are not among them: they enter the score.
        """
        if layout.count != self.count:
            return [f"{layout.count} dominoes stand where the scene asks for {self.count}"]
        found = []
        found += on_other_ground(layout, self.ground)
        if not np.isclose(layout.thickness[0], self.first_thickness, rtol=1e-9, atol=0.0):
            found.append(
                f"thickness[0] = {layout.thickness[0]} m: the first domino is the scene's, "
                f"{self.first_thickness} m thick"
            )
        told = layout.height if self.growth is None else layout.height[:1]
        for name, values, wanted in (
            ("height", told, self.height),
            ("density", layout.density, self.density),
        ):
            if not np.allclose(values, wanted, rtol=1e-9, atol=0.0):
                i = int(np.argmax(np.abs(values - wanted)))
                found.append(f"{name}[{i}] = {values[i]}: the scene's dominoes have {wanted}")
        if self.growth is not None:
            found += outside("growth", layout.height[1:] / layout.height[:-1], self.growth, 1, "")
        gaps, thick, unit = layout.spacing, layout.thickness[1:], "m"
        if self.in_heights:
            gaps = gaps / np.minimum(layout.height[:-1], layout.height[1:])
            thick, unit = thick / layout.height[1:], "heights"
        found += outside("spacing", gaps, self.spacing, 0, unit)
        if self.spacing_values is not None:
            found += off_list("spacing", gaps, self.spacing_values, 0)
        if self.largest_change is not None:
            found += too_steep(gaps, self.largest_change)
        if self.stock is not None:
            found += self.stock.broken_by(layout.thickness)
        else:
            found += outside("thickness", thick, self.thickness, 1, unit)
            if self.thickness_values is not None:
                found += off_list("thickness", thick, self.thickness_values, 1)
        if self.length is not None and abs(layout.length - self.length) > LENGTH_TOLERANCE:
            found.append(
                f"the row is {layout.length:.9f} m long, not {self.length} m: "
                f"{layout.length - self.length:+.3g} m"
            )
        return found

    def _heights(self, rows: int, height: Floats | None) -> Floats:
        """Heights of all dominoes, (B, N), or (1, N) where all rows have the same [m]."""
        if height is None:
            if self.growth is not None:
                raise ValueError(f"scene '{self.name}' lets the row grow: give the heights too")
            return np.full((1, self.count), self.height)
        tall = np.empty((rows, self.count))
        tall[:, 0], tall[:, 1:] = self.height, height
        return tall

    def _thicknesses(self, rows: int, thickness: Floats | None, tall: Floats) -> Floats:
        """Thicknesses of all dominoes, (B, N) [m]."""
        full = np.empty((rows, self.count))
        full[:, 0] = self.first_thickness
        if thickness is None:
            thickness = self.thickness[0] * (tall[:, 1:] if self.in_heights else np.ones(1))
        full[:, 1:] = thickness
        return full
