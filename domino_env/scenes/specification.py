"""Specification: the fields and rules of a scene as a value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.checks import numbers, require_type
from domino_env.core.types import Floats
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout, full_array
from domino_env.physics.physics import Physics, require_layout
from domino_env.physics.standard import DENSITY, HEIGHT, WIDTH
from domino_env.scenes import rules
from domino_env.scenes.consistency import check_document
from domino_env.scenes.limits import Limits
from domino_env.scenes.objectives import OBJECTIVES, Objective
from domino_env.scenes.objectives.tempo import Tempo
from domino_env.scenes.placement import Placement
from domino_env.scenes.rules import Bounds, Stock
from domino_env.scenes.run_out import RunOut
from domino_env.scenes.scoring import Scoring
from domino_env.scenes.simulators import FixedPivots, FreeStanding, Simulator
from domino_env.scenes.tables import make_document
from domino_env.scenes.waves import LayoutBatch

LENGTH_TOLERANCE = 1e-9  # [m] largest difference from the length of the scene
DERIVED: Any = None  # default of fields whose values then follow from other fields


@dataclass(frozen=True, kw_only=True)
class Specification:
    """Fields and rules of a design problem; see `Scene`."""

    name: str = "own"
    title: str = DERIVED
    objective: str = "mean_speed"
    physics: Physics = Physics()  # noqa: RUF009 - frozen
    count: int
    height: float = HEIGHT
    width: float = WIDTH
    density: float = DENSITY
    first_thickness: float = DERIVED
    spacing: Bounds
    thickness: Bounds = DERIVED
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
    placement: Placement | None = None
    run_out: RunOut | None = None

    def __post_init__(self) -> None:
        try:
            vars(self).update(check_document(self.document()).fields())
        except ValueError as error:
            raise ValueError(f"scene '{self.name}': {error}") from None

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Self:
        """Return the scene of a file's document, which has a name.

        Parameters
        ----------
        document
            Tables of the file, as `tomllib` reads them.

        Returns
        -------
        Scene
            The scene.

        Raises
        ------
        ValueError
            For an invalid document; the message has key, value and accepted range.
        """
        scene = object.__new__(cls)
        vars(scene).update(check_document(document).fields())
        return scene

    def document(self) -> dict[str, Any]:
        """Return the tables of the file that is read as the same scene.

        Returns
        -------
        dict
            Values by table and key, in the units of scene files.
        """
        return make_document(self)

    def replace(self, **changes: Any) -> Self:
        """Return another scene, with some fields changed.

        Parameters
        ----------
        **changes
            New values, by the names of fields.

        Returns
        -------
        Scene
            The other scene.

        Raises
        ------
        TypeError
            For a name that is no field, and as for `Scene`.
        ValueError
            For a value out of its range, and for fields that contradict each other; the message has
            key, value and accepted range.
        """
        return replace(self, **changes)

    @cached_property
    def criterion(self) -> Objective:
        """Objective of the scene, with its settings."""
        return OBJECTIVES[self.objective](self.settings)

    @property
    def simulator(self) -> Simulator:
        """Simulator of the layouts."""
        floor = self.floor_friction
        return FixedPivots() if floor is None else FreeStanding(floor)

    @cached_property
    def scoring(self) -> Scoring:
        """Line of the values from layouts to scores."""
        noise = self.placement if self.placement and self.placement.draws else None
        return Scoring(self.criterion, self.simulator, self.limits, noise, self.run_out)

    @cached_property
    def as_placed(self) -> Self:
        """Scene that scores a layout as it is placed, without draws of placement noise."""
        if self.scoring.placement is None:
            return self
        return self.replace(placement=self.scoring.placement.replace(draws=0, quantile=None))

    @property
    def on_pivots(self) -> Self:
        """Scene with fixed pivots, that of the analytic simulator."""
        return self.replace(floor_friction=None) if self.simulator.is_slow else self

    @property
    def tempo(self) -> Tempo | None:
        """Schedule of the hits; None for other objectives."""
        return self.settings if isinstance(self.settings, Tempo) else None

    @property
    def hand(self) -> int:
        """Number of pieces held while building, drawn in random order; 0 for no random order."""
        return 0 if self.stock is None else self.stock.hand or 0

    def orders(self, generators: Sequence[np.random.Generator]) -> Floats:
        """Draw random orders of the pieces of the stock without the first domino.

        Parameters
        ----------
        generators
            M sources of randomness, one for each order.

        Returns
        -------
        NDArray
            (M, N-1) thicknesses in the order in which the pieces are drawn [m].

        Raises
        ------
        TypeError
            For anything but generators.
        ValueError
            For a scene without a stock.
        """
        if self.stock is None:
            raise ValueError(f"scene '{self.name}' has no stock: give a scene with [stock]")
        for generator in np.array([generators], object).flat:  # also a value that is no list
            require_type("generators", generator, np.random.Generator, "a list of Generators")
        pieces = self.stock.without(self.first_thickness).dominoes
        drawn = [generator.permutation(pieces) for generator in generators]
        return np.array(drawn).reshape(-1, len(pieces))[:, : self.count - 1]

    @property
    def row_count(self) -> int:
        """Number of dominoes of the whole row, with those of the run-out."""
        return self.count + (0 if self.run_out is None else self.run_out.count)

    def row(self, layout: Layout) -> Layout:
        """Return the whole row of a layout: with the dominoes of the run-out, if it is complete."""
        if self.run_out is None or layout.count != self.count:
            return layout
        sizes = layout.spacing[None], layout.thickness[None], layout.height[None]
        parts = *sizes, layout.width, layout.density, self.physics, 0.0, self.ground
        return self.run_out.append_to(LayoutBatch(*parts)).layout(0)

    @property
    def free_spacing(self) -> bool:
        """True if the gaps are design variables."""
        return bool(self.spacing[0] < self.spacing[1])

    @property
    def free_thickness(self) -> bool:
        """True if the thicknesses of all dominoes but the first are design variables."""
        return bool(self.thickness[0] < self.thickness[1])

    @property
    def free_height(self) -> bool:
        """True if the heights of all dominoes but the first are design variables."""
        return self.growth is not None and bool(self.growth[0] < self.growth[1])

    @property
    def is_homogeneous(self) -> bool:
        """True if the rules are the same for all dominoes but the first."""
        is_even = self.ground is None or self.ground.is_even
        return is_even and (self.stock, self.growth, self.run_out) == (None, None, None)

    def layout(
        self,
        spacing: ArrayLike,
        thickness: ArrayLike | None = None,
        height: ArrayLike | None = None,
    ) -> Layout:
        """Return the layout with these free gaps, thicknesses and heights.

        The scene's rules are not checked, see `violations`.

        Parameters
        ----------
        spacing
            (N-1,) free gaps [m], or a single number for all.
        thickness
            (N-1,) thicknesses of dominoes 1 … N-1 [m], or a single number; None if the scene
            fixes it.
        height
            (N-1,) heights of dominoes 1 … N-1 [m], or a single number; None if all are equal.

        Returns
        -------
        Layout
            The layout, on the scene's ground.

        Raises
        ------
        ValueError
            If thicknesses or heights are missing, and for arrays of another shape and sizes that
            are not positive.
        """
        if thickness is None and self.free_thickness:
            raise ValueError(f"thickness is missing: give it, scene '{self.name}' leaves it free")
        pairs = self.count - 1
        gaps = full_array("spacing", spacing, pairs)[None]
        thicknesses, heights = (
            None if part is None else full_array(name, part, pairs)[None]
            for name, part in (("thickness", thickness), ("height", height))
        )
        return self.batch(gaps, thicknesses, heights).layout(0)

    def batch(
        self,
        spacing: Floats,
        thickness: Floats | None = None,
        height: Floats | None = None,
        rtol: float = 1e-6,
    ) -> LayoutBatch:
        """Return a batch of B layouts, without checking the scene's rules.

        Parameters
        ----------
        spacing
            (B, N-1) free gaps [m]. With fewer columns, the layouts are the first dominoes of
            complete ones.
        thickness
            (B, N-1) thicknesses of dominoes 1 … N-1 [m]; None for the smallest that the scene
            allows, the only one if it is fixed.
        height
            (B, N-1) heights of dominoes 1 … N-1 [m]; None if all are equal.
        rtol
            Relative tolerance of the arrival times.

        Returns
        -------
        LayoutBatch
            The layouts, to be simulated.

        Raises
        ------
        ValueError
            If the heights are missing, and for arrays of another shape.
        """
        if height is None and self.growth is not None:
            raise ValueError(f"height is missing: give it, as heights grow in scene '{self.name}'")
        spacing = numbers("spacing", spacing, None, ("B", "N-1"))
        shape = (len(spacing), spacing.shape[1] + 1)
        heights = np.full((1, shape[1]) if height is None else shape, self.height)
        if height is not None:
            heights[:, 1:] = numbers("height", height, None, spacing.shape)
        fixed = self.thickness[0] * (heights[:, 1:] if self.in_heights else np.ones(1))
        thicknesses = np.full(shape, self.first_thickness)
        given = fixed if thickness is None else numbers("thickness", thickness, None, spacing.shape)
        thicknesses[:, 1:] = given
        sizes = spacing, thicknesses, heights, self.width, self.density
        return LayoutBatch(*sizes, self.physics, rtol, self.ground)

    def violations(self, layout: Layout, *, complete: bool = True) -> list[str]:
        """Return one sentence for each rule of the scene that a layout violates.

        Limits on the wave are not among these rules: they enter the score.

        Parameters
        ----------
        layout
            The layout.
        complete
            True for a layout of all dominoes; False for the first dominoes of a layout, whose
            number and total length are not checked.

        Returns
        -------
        list of str
            One sentence for each rule, with the place, the value and the accepted range; empty if
            there is no violation.

        Raises
        ------
        TypeError
            For anything but a layout.
        """
        require_layout(layout)
        if complete and layout.count != self.count:
            return [f"the layout has {layout.count} dominoes, and the scene {self.count}"]
        violations = rules.ground_violations(layout, self.ground)
        heights = layout.height if self.growth is None else layout.height[:1]
        for name, values, size, unit in (
            ("thickness", layout.thickness[:1], self.first_thickness, "m"),
            ("height", heights, self.height, "m"),
            ("density", layout.density, self.density, "kg/m³"),
        ):
            # relative slack for sizes that other programs have rounded
            violations += rules.bounds_violations(name, values, (size, size), 0, unit, slack=1e-9)
        if self.growth is not None:
            ratios = layout.height[1:] / layout.height[:-1]
            violations += rules.bounds_violations("growth", ratios, self.growth, 1, "")
        gaps, thicknesses, unit = layout.spacing, layout.thickness[1:], "m"
        if self.in_heights:
            gaps = gaps / np.minimum(layout.height[:-1], layout.height[1:])
            thicknesses, unit = thicknesses / layout.height[1:], "heights"
        violations += rules.bounds_violations("spacing", gaps, self.spacing, 0, unit)
        violations += rules.list_violations("spacing", gaps, self.spacing_values, 0)
        violations += rules.change_violations(gaps, self.largest_change)
        if self.stock is not None:
            violations += self.stock.violations(layout.thickness)
        else:
            violations += rules.bounds_violations("thickness", thicknesses, self.thickness, 1, unit)
            violations += rules.list_violations("thickness", thicknesses, self.thickness_values, 1)
        if complete and self.length is not None:
            error = layout.length - self.length
            if abs(error) > LENGTH_TOLERANCE:
                violations.append(
                    f"the layout is {layout.length:.9f} m long: the scene has {self.length} m "
                    f"({error:+.3g} m)"
                )
        return violations
