"""Feasible set: the values that the rules of a scene allow, and the projection onto them."""

from __future__ import annotations

import numpy as np

from domino_env.core.projection import nearest_with_sum
from domino_env.core.types import Bools, Floats
from domino_env.scenes.scene import Scene
from optimize.constraints.lists import Lists
from optimize.constraints.stock import nearest_from_stock

ROUNDING = 1e-13  # shift by the projection, relative to the largest range, that counts as zero


class FeasibleSet:
    """Free values that the rules of a scene allow: gaps first, then thicknesses, then growths.

    Parameters
    ----------
    scene
        Scene that has the rules.

    Attributes
    ----------
    low, high
        (n,) bounds [m], in domino heights if the scene gives them so; growths are ratios.
    total
        Sum of all values [m]; None for any.
    gap_count
        Number of free gaps, 0 if the scene fixes them.
    is_listed
        (n,) True for values from a list.
    lists
        Lists of these values; None without a list.
    stock
        Stock without the first domino; None if thicknesses are not from a stock.
    is_discrete
        (n,) True for values from a list or the stock.
    discrete
        True if some values are discrete.

    Raises
    ------
    ValueError
        If the scene has no free values, or if its lists are too fine for its length.

    Notes
    -----
    Nearest means least sum of squares [m²]. If discrete and other values add up to a length, the
    discrete ones are chosen first, so that the others can still meet the length.
    """

    def __init__(self, scene: Scene) -> None:
        pairs = scene.count - 1
        bounds = [scene.spacing] * pairs * scene.free_spacing
        bounds += [scene.thickness] * pairs * scene.free_thickness
        if scene.growth is not None:
            bounds += [scene.growth] * pairs * scene.free_height
        if not bounds:
            raise ValueError(
                f"scene '{scene.name}' leaves nothing free to search: give spacing or thickness "
                "a min and a larger max, and a step between them, if any, that fits"
            )
        self.low, self.high = np.array([b[0] for b in bounds]), np.array([b[1] for b in bounds])
        self.low.flags.writeable = self.high.flags.writeable = False
        self.total: float | None = None
        if scene.length is not None:
            fixed = scene.spacing[0] * (not scene.free_spacing)
            fixed += scene.thickness[0] * (not scene.free_thickness)
            self.total = scene.length - pairs * fixed
        n = len(bounds)
        self.gap_count = gap_count = pairs * scene.free_spacing
        stock = scene.stock if n > gap_count else None
        self.stock = None if stock is None else stock.without(scene.first_thickness)
        thicknesses = scene.thickness_values if stock is None else None
        lists = [scene.spacing_values] * gap_count + [thicknesses] * (n - gap_count)
        self.is_listed = is_listed = np.array([values is not None for values in lists], dtype=bool)
        self.is_discrete = is_listed.copy()
        self.is_discrete[gap_count:] |= self.stock is not None
        self.discrete = bool(self.is_discrete.any())
        self.lists: Lists | None = None
        if is_listed.any():
            values = [values for values in lists if values is not None]
            self.lists = Lists(values, self._total_of_lists())

    def _total_of_lists(self) -> tuple[float, float] | None:
        """Return the range of the sum of the listed values in which the others can meet `total`."""
        if self.total is None:
            return None
        if self.stock is not None:  # a scene with a length uses the whole stock
            gap_sum = self.total - float(self.stock.dominoes.sum())
            return gap_sum, gap_sum
        is_unlisted = ~self.is_listed
        largest, smallest = float(self.high[is_unlisted].sum()), float(self.low[is_unlisted].sum())
        return self.total - largest, self.total - smallest

    def project(self, values: Floats) -> Floats:
        """Find the nearest allowed values (B, n) to each of `values` (B, n).

        Raises
        ------
        ValueError
            If the lists allow no such values.
        """
        if not self.discrete:
            return self._project(values, np.ones(len(self.low), dtype=bool), self.total)
        values = np.clip(values, self.low, self.high)
        nearest, free = values.copy(), ~self.is_discrete
        start = self.gap_count
        if self.lists is not None:
            nearest[:, self.is_listed] = self.lists.nearest(values[:, self.is_listed])
        if self.stock is not None:
            nearest[:, start:] = nearest_from_stock(values[:, start:], self.stock)
        if free.any() and self.total is None:
            nearest[:, free] = self._project(values[:, free], free, None)
        elif free.any():
            sums = self.total - nearest[:, self.is_discrete].sum(axis=1)
            for b in range(len(nearest)):
                nearest[b, free] = self._project(values[b : b + 1, free], free, float(sums[b]))[0]
        return nearest

    def _project(self, values: Floats, mask: Bools, total: float | None) -> Floats:
        """Project the entries (B, k) that `mask` (n,) selects, none of them discrete."""
        low, high = self.low[mask], self.high[mask]
        values = np.clip(values, low, high)
        return values if total is None else nearest_with_sum(values, low, high, total)

    def tangent(
        self, gradients: Floats, targets: Floats, values: Floats, relaxed: bool = False
    ) -> Floats:
        """Convert gradients with respect to allowed values to those with respect to the targets.

        A given length ties all values; values at a bound do not move. If the targets are allowed
        themselves, only the length ties them, so that the gradient can point from a corner in every
        direction. Values from a list or the stock do not change with a small change of the targets:
        their gradient is 0.

        Parameters
        ----------
        gradients
            (B, n) gradients with respect to `values`.
        targets
            (B, n) values before the rules are applied.
        values
            (B, n) allowed values nearest to them.
        relaxed
            True to return the gradients unchanged if some values are discrete, as if all were
            continuous and free.

        Returns
        -------
        ndarray
            (B, n) gradients with respect to `targets`.
        """
        if relaxed and self.discrete:
            return gradients
        by_target = np.where(self.is_discrete, 0.0, gradients)
        if self.total is None:
            return by_target
        rounding = ROUNDING * float((self.high - self.low).max())
        for b in range(len(gradients)):
            shift = np.where(self.is_discrete, 0.0, targets[b] - values[b])
            is_inside = (values[b] > self.low) & (values[b] < self.high)
            is_fixed = (~is_inside & (shift != 0.0)) | self.is_discrete
            is_projected = np.abs(shift).max() > rounding
            free = is_inside & ~is_fixed
            by_target[b] -= by_target[b][free].mean() if free.any() else 0.0
            by_target[b, is_fixed if is_projected else self.is_discrete] = 0.0
        return by_target
