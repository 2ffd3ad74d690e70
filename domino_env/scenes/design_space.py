"""Design space: the free sizes of layouts within the rules of a scene.

The *sizes* of a layout are gaps, thicknesses and heights [m]. Three *parts* describe them: gaps,
thicknesses of dominoes 1 … N-1, and their growths (height over that of the domino before). Gaps and
thicknesses are in metres, or in heights of a domino if the scene gives them so. A part is free if
its bounds differ, and the *values* of B layouts are those of the P free parts, (B, P, N-1). Layouts
that keep the rules have values within the bounds, of the length, and of pieces of the stock.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.projection import nearest_choice, nearest_with_sum
from domino_env.core.types import Bools, Floats, read_only
from domino_env.physics.layout import Layout
from domino_env.scenes.objectives import ScoreGradient
from domino_env.scenes.rules import Stock, first_violation

LENGTH_TOLERANCE = 1e-9  # [m] largest difference from the length of the scene
ROUNDING = 1e-13  # shift by the projection, relative to the largest range, that counts as zero


class Part(NamedTuple):
    """Quantity of all gaps or dominoes of a layout, with its bounds.

    Attributes
    ----------
    name
        Name in scenes and layouts.
    low, high
        Least and largest value; equal if the quantity is fixed.
    unit
        Unit of the values: "m", "heights" of a domino, or empty.
    first
        Index of the first value in the array of a layout.
    """

    name: str
    low: float
    high: float
    unit: str = "m"
    first: int = 0

    @property
    def is_free(self) -> bool:
        """True if the bounds differ."""
        return self.low < self.high

    def violations(self, values: Floats, slack: float = 1e-12) -> list[str]:
        """Return a sentence if values exceed their bounds by over `slack` times the upper one."""
        low, high, tolerance = self.low, self.high, slack * self.high
        allowed = f"{low} to {high} {self.unit}" if self.is_free else f"{low} {self.unit}"
        is_allowed = (values >= low - tolerance) & (values <= high + tolerance)
        return first_violation(self.name, values, is_allowed, allowed, self.first, self.unit)


@dataclass(frozen=True)
class DesignSpace:
    """Free sizes of layouts within the rules of a scene.

    Attributes
    ----------
    pairs
        Number of gaps N-1.
    height, first_thickness
        Sizes of domino 0 [m].
    spacing, thickness, growth
        The three parts.
    length
        Distance from the first to the last pivot [m]; None if it is free.
    stock
        Stock of all dominoes, the first one included; None without one.
    """

    pairs: int
    height: float
    first_thickness: float
    spacing: Part
    thickness: Part
    growth: Part
    length: float | None
    stock: Stock | None

    @property
    def parts(self) -> tuple[Part, Part, Part]:
        """Gaps, thicknesses and growths."""
        return self.spacing, self.thickness, self.growth

    @cached_property
    def free(self) -> tuple[Part, ...]:
        """Parts that are free, in the order of values."""
        return tuple(part for part in self.parts if part.is_free)

    @property
    def grows(self) -> bool:
        """True if heights are not all equal."""
        return self.growth.high > 1.0

    @property
    def in_heights(self) -> bool:
        """True if gaps and thicknesses are in heights of a domino, of the shorter one at a gap."""
        return self.spacing.unit == "heights"

    @cached_property
    def low(self) -> Floats:
        """(P, N-1) least values."""
        return read_only(self.select(*([part.low] * self.pairs for part in self.parts)))

    @cached_property
    def high(self) -> Floats:
        """(P, N-1) largest values."""
        return read_only(self.select(*([part.high] * self.pairs for part in self.parts)))

    @cached_property
    def pieces(self) -> Stock | None:
        """Stock without domino 0; None without one."""
        return None if self.stock is None else self.stock.without(self.first_thickness)

    @cached_property
    def kinds(self) -> Floats:
        """Kinds of pieces to choose from, (2, K): thicknesses, thin to thick [m], and numbers."""
        if self.pieces is None or not self.thickness.is_free:
            return np.empty((2, 0))
        kinds = np.array([self.pieces.thickness, self.pieces.count], np.float64)
        return np.ascontiguousarray(kinds[:, np.argsort(kinds[0])])

    @cached_property
    def is_discrete(self) -> Bools:
        """(P, 1) True for thicknesses that are those of pieces of the stock."""
        return np.array([[part is self.thickness and self.kinds.size > 0] for part in self.free])

    @cached_property
    def total(self) -> float | None:
        """Sum of all values that the length requires [m]; None for any."""
        fixed = sum(part.low for part in self.parts[:2] if not part.is_free)
        return None if self.length is None else self.length - self.pairs * fixed

    # values and sizes -----------------------------------------------------------------------------

    def sizes(self, values: Floats) -> tuple[Floats, Floats, Floats | None]:
        """Convert values to sizes in metres.

        Parameters
        ----------
        values
            (B, P, N-1) values, or fewer columns for the first dominoes of layouts.

        Returns
        -------
        tuple
            Gaps, thicknesses and heights of dominoes 1 … N-1, (B, N-1) each; None in place of equal
            heights.
        """
        gaps, thickness, growth = self._all_values(values)
        if not self.in_heights:
            return gaps, thickness, None
        height = self._heights(growth)
        gaps, thickness = gaps * self._heights_before(height), thickness * height
        return gaps, thickness, height if self.grows else None

    def values(self, spacing: Floats, thickness: Floats, height: Floats | None = None) -> Floats:
        """Return the values (…, P, N-1) of sizes (…, N-1), inverse of `sizes`."""
        return self.select(*self.measure(spacing, thickness, height))

    def select(self, *parts: ArrayLike) -> Floats:
        """Return those of three arrays (…, N-1), one for each part, that are free, (…, P, N-1)."""
        shape = np.broadcast_shapes(*map(np.shape, parts))
        values = np.empty((*shape[:-1], len(self.free), shape[-1]))
        free = (array for part, array in zip(self.parts, parts, strict=True) if part.is_free)
        for k, array in enumerate(free):
            values[..., k, :] = array
        return values

    def measure(
        self, spacing: Floats, thickness: Floats, height: Floats | None = None
    ) -> tuple[Floats, Floats, Floats]:
        """Return the values of all parts, also of those that are fixed, for sizes in metres.

        Parameters
        ----------
        spacing, thickness, height
            (…, N-1) gaps, and thicknesses and heights of dominoes 1 … N-1; None for equal heights.

        Returns
        -------
        tuple
            Gaps, thicknesses and growths, (…, N-1) each.
        """
        height = np.full(spacing.shape, self.height) if height is None else height
        before = self._heights_before(height)
        if self.in_heights:
            spacing, thickness = spacing / np.minimum(before, height), thickness / height
        return spacing, thickness, height / before

    def sizes_vjp(self, values: Floats, by_sizes: ScoreGradient) -> Floats:
        """Convert derivatives with respect to the sizes of `values` to those by the values.

        Parameters
        ----------
        values
            (B, P, N-1) values.
        by_sizes
            Derivatives [1/m].

        Returns
        -------
        ndarray
            (B, P, N-1) derivatives.
        """
        by_gap, by_thickness, by_growth = by_sizes
        if self.in_heights:
            gaps, thickness, growth = self._all_values(values)
            height = self._heights(growth)
            before = self._heights_before(height)
            # a height scales the thickness of its domino and the gap to the next one
            by_scale = by_sizes.height * height + by_thickness * (thickness * height)
            by_scale[:, :-1] += by_gap[:, 1:] * (gaps * before)[:, 1:]
            # a growth scales all later heights
            by_growth = np.cumsum(by_scale[:, ::-1], axis=1)[:, ::-1] / growth
            by_gap, by_thickness = by_gap * before, by_thickness * height
        return self.select(by_gap, by_thickness, by_growth)

    def _all_values(self, values: Floats) -> list[Floats]:
        """Return gaps, thicknesses and growths (B, N-1), those that are fixed too."""
        free, shape = iter(np.moveaxis(values, 1, 0)), (len(values), values.shape[2])
        return [next(free) if part.is_free else np.full(shape, part.low) for part in self.parts]

    def _heights(self, growth: Floats) -> Floats:
        """Return the heights (B, N-1) of dominoes 1 … N-1 [m]."""
        return np.asarray(self.height * np.cumprod(growth, axis=1))

    def _heights_before(self, height: Floats) -> Floats:
        """Return the heights (…, N-1) of dominoes 0 … N-2 [m] from those of dominoes 1 … N-1."""
        return np.insert(height[..., :-1], 0, self.height, axis=-1)

    # rules ----------------------------------------------------------------------------------------

    def project(self, values: Floats) -> Floats:
        """Find the nearest values that keep the rules: bounds, stock and length.

        Parameters
        ----------
        values
            (B, P, N-1) values.

        Returns
        -------
        ndarray
            (B, P, N-1) allowed values with the least sum of squared differences.
        """
        nearest = np.clip(values, self.low, self.high)
        total, ruled = self.total, len(self.free)
        if self.pieces is not None and self.thickness.is_free:
            dominoes, ruled = self.pieces.dominoes, ruled - 1
            nearest[:, -1] = nearest_choice(nearest[:, -1], dominoes)
            if total is not None:  # a layout with a length takes the whole stock
                total -= float(dominoes.sum())
        if total is not None and ruled:
            others = nearest[:, :ruled]
            low, high = self.low[:ruled].ravel(), self.high[:ruled].ravel()
            summed = nearest_with_sum(others.reshape(len(values), -1), low, high, total)
            others[:] = summed.reshape(others.shape)
        return nearest

    def project_vjp(self, derivatives: Floats, targets: Floats, values: Floats) -> Floats:
        """Convert derivatives with respect to projected values to those by the targets.

        A given length ties all values; values at a bound do not move. If the targets are allowed
        themselves, only the length ties them, so that the gradient can point from a corner in every
        direction. Values from the stock do not change with a small change of the targets: their
        derivatives are 0.

        Parameters
        ----------
        derivatives
            (B, P, N-1) derivatives with respect to `values`.
        targets
            (B, P, N-1) values before the projection.
        values
            (B, P, N-1) their projection.

        Returns
        -------
        ndarray
            (B, P, N-1) derivatives with respect to `targets`.
        """
        is_discrete = self.is_discrete
        by_target = np.where(is_discrete, 0.0, derivatives)
        if self.total is None:
            return by_target
        rounding = ROUNDING * float((self.high - self.low).max())
        for by, target, value in zip(by_target, targets, values, strict=True):
            shift = np.where(is_discrete, 0.0, target - value)
            is_inside = (value > self.low) & (value < self.high)
            tied = is_inside & ~is_discrete
            by -= by[tied].mean() if tied.any() else 0.0
            is_fixed = ~is_inside & (shift != 0.0) & (np.abs(shift).max() > rounding)
            by[is_fixed | is_discrete] = 0.0
        return by_target

    def violations(self, layout: Layout, complete: bool = True) -> list[str]:
        """Return one sentence for each rule that a layout violates; see `Scene.violations`."""
        sizes = layout.spacing, layout.thickness[1:], layout.height[1:]
        gaps, thicknesses, growths = self.measure(*sizes)
        violations = self.growth.violations(growths) if self.grows else []
        violations += self.spacing.violations(gaps)
        if self.stock is not None:
            violations += self.stock.violations(layout.thickness)
        else:
            violations += self.thickness.violations(thicknesses)
        error = 0.0 if self.length is None else layout.length - self.length
        if complete and abs(error) > LENGTH_TOLERANCE:
            violations.append(
                f"the layout is {layout.length:.9f} m long: the scene has {self.length} m "
                f"({error:+.3g} m)"
            )
        return violations
