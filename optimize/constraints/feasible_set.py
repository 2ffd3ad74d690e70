"""The nearest values that a scene's rules allow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from domino_env.scenes.scene import Scene
from optimize.constraints.length import nearest_with_sum
from optimize.constraints.lists import Lists
from optimize.constraints.smoothness import nearest_smooth
from optimize.constraints.stock import nearest_from_stock

Floats = NDArray[np.float64]


class Allowed:
    """The rules on the free values of a row: gaps first, then thicknesses (or growths).

    Parameters
    ----------
    scene
        Whose rules.
    low, high
        (n,) bounds [m], or what the scene gives in heights.
    gaps
        How many of the n values are gaps.
    total
        What all values add up to [m]; None for any.

    Attributes
    ----------
    discrete
        Whether some values are from a list or the stock.
    stepped
        (n,) which of them are.
    coupled
        Whether neighbouring gaps may differ by so much only.

    Notes
    -----
    Nearest means least sum of squares [m²]. Where values from a list or the stock and others share
    a length, the former are chosen first, so that the others can still meet it.
    """

    def __init__(
        self, scene: Scene, low: Floats, high: Floats, gaps: int, total: float | None
    ) -> None:
        self.low, self.high, self.gaps, self.total = low, high, gaps, total
        n = len(low)
        self.change = np.full(max(n - 1, 0), np.inf)
        if scene.largest_change is not None:
            self.change[: max(gaps - 1, 0)] = scene.largest_change
        self.coupled = bool(np.isfinite(self.change).any())
        self.stock = None
        lists: list[tuple[float, ...] | None] = [None] * n
        lists[:gaps] = [scene.spacing_values] * gaps
        if n > gaps and scene.stock is not None:
            self.stock = scene.stock.without(scene.first_thickness)
        elif n > gaps:
            lists[gaps:] = [scene.thickness_values] * (n - gaps)
        listed = np.array([one is not None for one in lists], dtype=bool)
        self.listed = listed
        self.stepped = listed.copy()  # listed, or from the stock
        self.stepped[gaps:] |= self.stock is not None
        self.discrete = bool(self.stepped.any())
        self.lists: Lists | None = None
        if listed.any():
            change = self.change[listed[:-1] & listed[1:]]
            chosen = [one for one in lists if one is not None]
            self.lists = Lists(chosen, change, self._room_for_lists())

    def _room_for_lists(self) -> tuple[float, float] | None:
        """Between which sums the listed values must stay for the others to meet the length."""
        if self.total is None:
            return None
        if self.stock is not None:
            left = self.total - float(self.stock.dominoes.sum())
            return left, left
        others = ~self.listed
        return (
            self.total - float(self.high[others].sum()),
            self.total - float(self.low[others].sum()),
        )

    def nearest(self, values: Floats) -> Floats:
        """Find the nearest allowed values to each row of `values` (B, n)."""
        if not self.discrete:
            return self._nearest(values, np.ones(len(self.low), dtype=bool), self.total)
        values = np.clip(values, self.low, self.high)
        found = values.copy()
        if self.lists is not None:
            found[:, self.listed] = self.lists.nearest(values[:, self.listed])
        if self.stock is not None:
            found[:, self.gaps :] = nearest_from_stock(values[:, self.gaps :], self.stock)
        rest = ~self.stepped
        if not rest.any():
            return found
        if self.total is None:
            found[:, rest] = self._nearest(values[:, rest], rest, None)
            return found
        left = self.total - found[:, self.stepped].sum(axis=1)
        for b in range(len(found)):
            found[b, rest] = self._nearest(values[b : b + 1, rest], rest, float(left[b]))[0]
        return found

    def _nearest(self, values: Floats, which: NDArray[np.bool_], total: float | None) -> Floats:
        """Without lists, of the entries that `which` (n,) tells."""
        low, high = self.low[which], self.high[which]
        change = self.change[which[:-1] & which[1:]]
        if np.isfinite(change).any():
            return nearest_smooth(values, low, high, change, total)
        values = np.clip(values, low, high)
        return values if total is None else nearest_with_sum(values, low, high, total)

    def linear(self) -> tuple[Floats, Floats] | None:
        """Give A (m, n) and b (m,) of the rule A v ≤ b on values v; None where there is none."""
        if not self.coupled:
            return None
        ties = np.flatnonzero(np.isfinite(self.change))
        up = np.zeros((len(ties), len(self.low)))
        every = np.arange(len(ties))
        up[every, ties + 1], up[every, ties] = 1.0, -1.0
        return np.concatenate([up, -up]), np.tile(self.change[ties], 2)

    def tangent(
        self, slopes: Floats, wanted: Floats, values: Floats, at_will: bool = False
    ) -> Floats:
        """Turn gradients by the nearest allowed values into gradients by the values wanted.

        Values bound together move together: all where a length is asked, neighbours whose
        difference is at its largest, and those held at a bound not at all. Where what is wanted is
        allowed, only the length counts, so that every way out of a corner is seen. Values from a
        list or the stock keep theirs when what is wanted changes a little: their slope is 0.

        Parameters
        ----------
        slopes
            (B, n) gradients by the allowed values.
        wanted
            (B, n) values before the rules are applied.
        values
            (B, n) allowed values nearest to them.
        at_will
            Leave the gradients as they are where some values are discrete, as if all could move.

        Returns
        -------
        ndarray
            (B, n) gradients by `wanted`.
        """
        if at_will and self.discrete:
            return slopes
        found = np.where(self.stepped, 0.0, slopes)
        if self.total is None and not self.coupled:
            return found
        span = float((self.high - self.low).max())
        every = np.arange(len(self.low))
        for b in range(len(slopes)):
            off = np.where(self.stepped, 0.0, wanted[b] - values[b])
            inside = (values[b] > self.low) & (values[b] < self.high)
            held = (~inside & (off != 0.0)) | self.stepped
            moved = np.abs(off).max() > 1e-13 * span
            if self.coupled and moved:
                ends = self.stepped[:-1] | self.stepped[1:]
                tight = np.abs(np.diff(values[b])) >= self.change * (1.0 - 1e-9)
                group = np.concatenate([every[:1], np.cumsum(~tight | ends)])
                held = (np.bincount(group, weights=held) > 0.0)[group]
                found[b] = (np.bincount(group, weights=found[b]) / np.bincount(group))[group]
            if self.total is not None:
                free = inside & ~held
                found[b] -= found[b][free].mean() if free.any() else 0.0
            found[b, held if moved else self.stepped] = 0.0
        return found
