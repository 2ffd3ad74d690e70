"""The design vector of a scene: what is free, between 0 and 1, and how it becomes a layout."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene
from optimize.constraints.feasibility import require_feasible
from optimize.constraints.feasible_set import Allowed

Floats = NDArray[np.float64]

ROUNDING = 1e-9  # so far outside the box is still within it


class Variables:
    """The design vector of a scene, and how it becomes a layout.

    A design x has one entry in [0, 1] for each free gap, then one for each free thickness, then one
    for each free height (over that of the domino before), running from its least to its largest
    value. Any design stands for the nearest one (in metres) that keeps the scene's rules: length,
    largest change, lists of allowed values, stock.

    Parameters
    ----------
    scene
        What is searched.

    Attributes
    ----------
    dimension
        n, length of a design.
    low, high
        (n,) what 0 and 1 stand for [m], or what the scene gives in heights.
    discrete
        Whether some values come from a list or the stock, so that scores have steps.

    Raises
    ------
    ValueError
        For a scene that leaves nothing free, and for one whose rules clash, with their names.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        pairs = scene.count - 1
        bounds = [scene.spacing] * pairs * scene.free_spacing
        bounds += [scene.thickness] * pairs * scene.free_thickness
        if scene.growth is not None:
            bounds += [scene.growth] * pairs * scene.free_height
        if not bounds:
            raise ValueError(
                f"scene '{scene.name}' leaves nothing free: there is nothing to search"
            )
        require_feasible(scene)
        self.low = np.array([b[0] for b in bounds])
        self.high = np.array([b[1] for b in bounds])
        self.dimension = len(bounds)
        gaps = pairs * scene.free_spacing
        total = None if scene.length is None else self._total
        self._allowed = Allowed(scene, self.low, self.high, gaps, total)
        self.discrete = self._allowed.discrete

    @property
    def equality(self) -> tuple[Floats, float] | None:
        """Coefficients a (n,) and right side b of a·x = b [m]; None where no length is asked."""
        if self.scene.length is None:
            return None
        return self.high - self.low, self._total - float(self.low.sum())

    @property
    def linear(self) -> tuple[Floats, Floats] | None:
        """A (m, n) and b (m,) of A x ≤ b [m]: the largest change of the gaps; None where any is."""
        rules = self._allowed.linear()
        if rules is None:
            return None
        return rules[0] * (self.high - self.low), rules[1] - rules[0] @ self.low

    @property
    def coupled(self) -> bool:
        """Whether some designs of the box stand for others: see `project`."""
        return self.scene.length is not None or self.discrete or self._allowed.coupled

    @property
    def _total(self) -> float:
        """What the free gaps and thicknesses add up to where a length is asked [m]."""
        scene = self.scene
        assert scene.length is not None
        fixed = scene.spacing[0] * (not scene.free_spacing)
        fixed += scene.thickness[0] * (not scene.free_thickness)
        return scene.length - (scene.count - 1) * fixed

    def values(self, designs: Floats) -> Floats:
        """Find the free gaps, thicknesses and growths (B, n) [m] that designs (B, n) stand for."""
        return self._allowed.nearest(self._wanted(designs))

    def project(self, designs: Floats) -> Floats:
        """Find the nearest designs (in metres) that keep the scene's rules.

        Parameters
        ----------
        designs
            (B, n) any finite numbers, outside of [0, 1] too.

        Returns
        -------
        ndarray
            (B, n) designs; they stand for the same rows.

        Raises
        ------
        ValueError
            For designs of another shape, or with entries that are not finite.
        """
        return self._scaled(self.values(self.checked(designs, anywhere=True)))

    def layout(self, design: Floats) -> Layout:
        """Give the row that one design (n,) stands for.

        Raises
        ------
        ValueError
            For a design of another shape, or with entries that are no numbers in [0, 1].
        """
        values = self.values(self.checked(self.one(design)))
        spacing, thickness, height = self.split(values)
        return self.scene.layout(
            spacing[0],
            None if thickness is None else thickness[0],
            None if height is None else height[0],
        )

    def design(self, layout: Layout) -> Floats:
        """Give the design (n,) of a layout that keeps the scene's rules."""
        scene = self.scene
        gaps, thick, tall = layout.spacing, layout.thickness[1:], layout.height
        if scene.in_heights:
            gaps, thick = gaps / np.minimum(tall[:-1], tall[1:]), thick / tall[1:]
        values = [gaps] * scene.free_spacing
        values += [thick] * scene.free_thickness
        values += [tall[1:] / tall[:-1]] * scene.free_height
        return self._scaled(np.concatenate(values))

    def split(self, values: Floats) -> tuple[Floats, Floats | None, Floats | None]:
        """Tell gaps and, where free, thicknesses and heights in free values (B, n) apart.

        Returns
        -------
        tuple of ndarray or None
            (B, N-1) each, of dominoes 1 … N-1 [m].
        """
        scene, pairs = self.scene, self.scene.count - 1
        at = 0
        gaps: Floats = np.full((len(values), pairs), scene.spacing[0])
        thick: Floats | None = None
        tall: Floats | None = None
        if scene.free_spacing:
            gaps, at = values[:, :pairs], pairs
        if scene.free_thickness:
            thick, at = values[:, at : at + pairs], at + pairs
        if scene.growth is not None:
            growth = values[:, at:] if scene.free_height else np.full_like(gaps, scene.growth[0])
            tall = np.asarray(scene.height * np.cumprod(growth, axis=1))
        if scene.in_heights:
            own = np.full_like(gaps, scene.height) if tall is None else tall
            before = np.concatenate([np.full((len(own), 1), scene.height), own[:, :-1]], axis=1)
            gaps = gaps * before
            thick = None if thick is None else thick * own
        return gaps, thick, tall

    def by_design(
        self,
        designs: Floats,
        values: Floats,
        by_gap: Floats,
        by_thickness: Floats,
        by_height: Floats,
        *,
        at_will: bool = False,
    ) -> Floats:
        """Turn slopes by what stands there into slopes by the design.

        Parameters
        ----------
        designs
            (B, n) designs.
        values
            (B, n) what they stand for, see `values`.
        by_gap, by_thickness, by_height
            (B, N-1) slopes by the gaps, thicknesses and heights of dominoes 1 … N-1 [1/m].
        at_will
            Give values from a list or the stock the slope that they would have if they could move;
            otherwise it is 0, since they stay where they are when a design changes a little.

        Returns
        -------
        ndarray
            (B, n) slopes; at an edge of the rules those of the nearest layout within them.
        """
        slopes = self._by_value(values, by_gap, by_thickness, by_height)
        slopes = self._allowed.tangent(slopes, self._wanted(designs), values, at_will)
        return np.asarray(slopes * (self.high - self.low))

    @property
    def steady(self) -> NDArray[np.bool_]:
        """(n,) which entries may change by a little; the others choose from a list or the stock."""
        return ~self._allowed.stepped

    def one(self, design: Floats) -> Floats:
        """Give one design (n,) as a batch (1, n).

        Raises
        ------
        ValueError
            For a design of another shape.
        """
        design = np.asarray(design, dtype=np.float64)
        if design.shape != (self.dimension,):
            raise ValueError(f"the design has shape {design.shape}: expected ({self.dimension},)")
        return design[None]

    def checked(self, designs: Floats, *, anywhere: bool = False) -> Floats:
        """Give designs as an array (B, n) of numbers in [0, 1], where rounding has left the box.

        Parameters
        ----------
        designs
            (B, n) designs.
        anywhere
            Let designs outside the box be as they are.

        Raises
        ------
        ValueError
            For designs of another shape, or with entries that are no numbers in [0, 1].
        """
        designs = np.asarray(designs, dtype=np.float64)
        if designs.ndim != 2 or designs.shape[1] != self.dimension:
            raise ValueError(
                f"designs have shape {designs.shape}: expected (any number, {self.dimension})"
            )
        if anywhere:
            good, hint = np.isfinite(designs), ""
        else:
            good = (designs >= -ROUNDING) & (designs <= 1.0 + ROUNDING)  # and so no NaN
            hint = "; `project` gives the nearest design that is"
        if not good.all():
            b, i = np.argwhere(~good)[0]
            entry = designs[b, i]
            raise ValueError(
                f"design {b} has {entry} at place {i}: every entry is in [0, 1]"
                + hint * bool(np.isfinite(entry))
            )
        return designs if anywhere else np.clip(designs, 0.0, 1.0)

    def _by_value(
        self, values: Floats, by_gap: Floats, by_thickness: Floats, by_height: Floats
    ) -> Floats:
        """Slopes by the free values, from those by gaps, thicknesses and heights [m]."""
        scene = self.scene
        free = [scene.free_spacing, scene.free_thickness, scene.free_height]
        if scene.in_heights:
            by_gap, by_thickness, by_height = self._in_heights(
                values, by_gap, by_thickness, by_height
            )
        slopes = (by_gap, by_thickness, by_height)
        return np.concatenate([s for s, f in zip(slopes, free, strict=True) if f], axis=1)

    def _in_heights(
        self, values: Floats, by_gap: Floats, by_thickness: Floats, by_height: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Slopes by gaps over heights, thicknesses over heights, and growths."""
        gaps, thick, tall = self.split(values)
        scene, pairs = self.scene, self.scene.count - 1
        if tall is None:
            return scene.height * by_gap, scene.height * by_thickness, by_height
        before = np.concatenate([np.full((len(tall), 1), scene.height), tall[:, :-1]], axis=1)
        thick = scene.thickness[0] * tall if thick is None else thick
        # a height carries its domino's thickness along, and the gap behind it
        whole = by_height * tall + by_thickness * thick
        whole[:, :-1] += by_gap[:, 1:] * gaps[:, 1:]
        growth = values[:, -pairs:] if scene.free_height else np.ones_like(tall)
        # and a growth all heights from there on
        later = np.cumsum(whole[:, ::-1], axis=1)[:, ::-1] / growth
        return by_gap * before, by_thickness * tall, later

    def _wanted(self, designs: Floats) -> Floats:
        """Values (B, n) before the rules are applied."""
        return np.asarray(np.clip(self.low + designs * (self.high - self.low), self.low, self.high))

    def _scaled(self, values: Floats) -> Floats:
        return np.asarray(np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0))
