"""Feasible set: the values that the rules of a scene allow, and the projection onto them."""

from __future__ import annotations

import numpy as np

from domino_env.core.projection import nearest_with_sum
from domino_env.core.types import Floats
from domino_env.scenes.scene import Scene
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
    stock
        Stock without the first domino; None if thicknesses are not from a stock.
    is_discrete
        (n,) True for values from the stock.

    Raises
    ------
    ValueError
        If the scene has no free values.

    Notes
    -----
    Nearest means least sum of squares [m²].
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
                "a min and a larger max"
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
        self.is_discrete = (np.arange(n) >= gap_count) & (self.stock is not None)

    def project(self, values: Floats) -> Floats:
        """Find the nearest allowed values (B, n) to each of `values` (B, n)."""
        nearest = np.clip(values, self.low, self.high)
        low, high, total, end = self.low, self.high, self.total, len(self.low)
        if self.stock is not None:
            end = self.gap_count
            low, high = low[:end], high[:end]
            nearest[:, end:] = nearest_from_stock(nearest[:, end:], self.stock)
            if total is not None:  # a layout with a length takes the whole stock
                total -= float(self.stock.dominoes.sum())
        if total is not None and end:
            nearest[:, :end] = nearest_with_sum(nearest[:, :end], low, high, total)
        return nearest

    def tangent(
        self, gradients: Floats, targets: Floats, values: Floats, relaxed: bool = False
    ) -> Floats:
        """Convert gradients with respect to allowed values to those with respect to the targets.

        A given length ties all values; values at a bound do not move. If the targets are allowed
        themselves, only the length ties them, so that the gradient can point from a corner in every
        direction. Values from the stock do not change with a small change of the targets: their
        gradient is 0.

        Parameters
        ----------
        gradients
            (B, n) gradients with respect to `values`.
        targets
            (B, n) values before the rules are applied.
        values
            (B, n) allowed values nearest to them.
        relaxed
            True to return the gradients unchanged with a stock, as if all values were continuous
            and free.

        Returns
        -------
        ndarray
            (B, n) gradients with respect to `targets`.
        """
        if relaxed and self.stock is not None:
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
