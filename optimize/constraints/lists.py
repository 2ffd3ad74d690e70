"""The nearest row whose values are all on a list (a grid, so many thicknesses), exactly.

Each place of the row has its own list.  Without a length and without a largest change the nearest
is found place by place.  A length couples all places: on grids of one step, moving single steps
between places until nothing is gained is exact, for the price is convex; on any other list, a
dynamic programme over the length covered so far.  A largest change couples neighbours: a dynamic
programme over the value at the last place.  Both together: over both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from domino_env.core.projection import nearest_with_sum
from domino_env.core.threads import compiled
from domino_env.core.types import Floats, Ints

QUANTUM = 1e-9  # [m] what a length and the values of a list are whole multiples of
LARGEST_TABLE = 40_000_000  # entries of the table of a dynamic programme
SLACK = 1e-12  # [m] of a largest change


class Lists:
    """The lists of the n places of a row.

    Parameters
    ----------
    values
        For each place, what it may be, rising [m].
    change
        (n-1,) largest change from a place to the next [m], inf for any.
    total
        Least and largest sum of all places [m]; None for any.

    Raises
    ------
    ValueError
        For a length that the lists are too fine for.
    """

    def __init__(
        self,
        values: Sequence[tuple[float, ...]],
        change: Floats,
        total: tuple[float, float] | None = None,
    ) -> None:
        n, longest = len(values), max(len(v) for v in values)
        self.number = np.array([len(v) for v in values])
        self.values = np.full((n, longest), np.inf)
        for i, v in enumerate(values):
            self.values[i, : len(v)] = v
        self.change = change
        self.coupled = bool(np.isfinite(change).any())
        self.grid = 0.0
        self.low_sum = self.high_sum = 0
        self.units = np.zeros((n, longest), dtype=np.int64)
        if total is not None:
            self._in_units(total)
        self.total = total

    def _in_units(self, total: tuple[float, float]) -> None:
        """Values and sums as whole multiples of the largest unit they share."""
        n = len(self.values)
        rise = np.where(np.isfinite(self.values), self.values - self.values[:, :1], 0.0)
        whole = np.round(rise / QUANTUM).astype(np.int64)
        unit = int(np.gcd.reduce(whole.ravel())) or 1
        self.units = whole // unit
        step = unit * QUANTUM
        base = float(self.values[:, 0].sum())
        self.low_sum = int(np.ceil((total[0] - base - QUANTUM) / step))
        self.high_sum = int(np.floor((total[1] - base + QUANTUM) / step))
        even = np.arange(self.values.shape[1])
        regular = all(
            np.array_equal(self.units[i, : self.number[i]], even[: self.number[i]])
            for i in range(n)
        )
        self.grid = step if regular and not self.coupled else 0.0
        size = n * (self.high_sum + 1) * (self.values.shape[1] if self.coupled else 1)
        if self.grid == 0.0 and size > LARGEST_TABLE:
            raise ValueError(
                f"a length with values on lists this fine (shared unit {step:g} m) takes a table "
                f"of {size} entries: use a coarser list or step, or leave the length free"
            )

    def nearest(self, wanted: Floats) -> Floats:
        """Find the nearest allowed row to each of `wanted` (B, n) [m].

        Raises
        ------
        ValueError
            Where there is none; `optimize.constraints.feasibility` says why.
        """
        wanted = np.ascontiguousarray(wanted, dtype=np.float64)
        if self.total is None and not self.coupled:
            level = _nearest_levels(wanted, self.values, self.number)
        else:
            starts = wanted
            if self.grid > 0.0:
                starts = _nearest_levels(self._shifted(wanted), self.values, self.number)
            level = np.empty(wanted.shape, dtype=np.int64)
            for b, start in enumerate(starts):
                level[b] = self._levels(wanted[b], start)
        if level.size and level.min() < 0:
            raise ValueError(
                "no layout of the values allowed has the length and the changes allowed"
            )
        return np.take_along_axis(self.values, level.T, axis=1).T

    def _levels(self, wanted: Floats, start: Ints) -> Ints:
        """Indices (n,) of the nearest allowed values, on a grid from a start near by."""
        sums = self.low_sum, self.high_sum
        if self.grid > 0.0:
            offset = (wanted - self.values[:, 0]) / self.grid
            return np.asarray(_exchange(offset, start, self.number - 1, *sums))
        lists = wanted, self.values, self.number, self.units
        if self.coupled:
            return np.asarray(_smooth_lists(*lists, self.change + SLACK, *sums))
        return np.asarray(_free_lists(*lists, *sums))

    def _shifted(self, wanted: Floats) -> Floats:
        """A good start: all values moved alike, to about the right sum."""
        low = self.values[:, 0]
        high = low + (self.number - 1) * self.grid
        base = float(low.sum())
        held = np.clip(wanted, low, high)
        total = np.clip(held.sum(axis=1), base + self.low_sum * self.grid,
                        base + self.high_sum * self.grid)  # fmt: skip
        found = np.empty_like(held)
        for b in range(len(held)):
            found[b] = nearest_with_sum(wanted[b : b + 1], low, high, float(total[b]))[0]
        return found


@compiled
def _nearest_levels(wanted: Floats, values: Floats, number: Ints) -> Ints:
    """Place by place; the lower of two that are equally near."""
    level = np.zeros(wanted.shape, dtype=np.int64)
    for b in range(len(wanted)):
        for i in range(wanted.shape[1]):
            k = np.searchsorted(values[i, : number[i]], wanted[b, i])
            if k == number[i] or (
                k > 0 and wanted[b, i] - values[i, k - 1] <= values[i, k] - wanted[b, i]
            ):
                k -= 1
            level[b, i] = k
    return level


@compiled
def _exchange(offset: Floats, start: Ints, most: Ints, low_sum: int, high_sum: int) -> Ints:
    """Single steps until the sum is right, then exchanged between two places while that gains.

    offset: wanted, in steps above each list's first value.
    """
    n = len(offset)
    level = np.minimum(np.maximum(start, 0), most)
    for _ in range(100 * n + 10_000_000):
        total = level.sum()
        # the price of one step up, and of one down, where it is least
        up = down = -1
        price_up = price_down = np.inf
        for i in range(n):
            if level[i] < most[i]:
                price = 1.0 + 2.0 * (level[i] - offset[i])
                if price < price_up:
                    price_up, up = price, i
            if level[i] > 0:
                price = 1.0 - 2.0 * (level[i] - offset[i])
                if price < price_down:
                    price_down, down = price, i
        if total < low_sum:
            if up < 0:
                return np.full(n, -1)
            level[up] += 1
        elif total > high_sum:
            if down < 0:
                return np.full(n, -1)
            level[down] -= 1
        elif up >= 0 and total < high_sum and price_up < -1e-12:
            level[up] += 1
        elif down >= 0 and total > low_sum and price_down < -1e-12:
            level[down] -= 1
        elif up >= 0 and down >= 0 and up != down and price_up + price_down < -1e-12:
            level[up] += 1
            level[down] -= 1
        else:
            break
    return level


@compiled
def _free_lists(
    wanted: Floats, values: Floats, number: Ints, units: Ints, low_sum: int, high_sum: int
) -> Ints:
    """Over the sum so far."""
    n = len(wanted)
    level = np.full(n, -1)
    if high_sum < 0:
        return level
    cost = np.full(high_sum + 1, np.inf)
    cost[0] = 0.0
    choice = np.full((n, high_sum + 1), -1, dtype=np.int32)
    for i in range(n):
        after = np.full(high_sum + 1, np.inf)
        for k in range(number[i]):
            price, more = (values[i, k] - wanted[i]) ** 2, units[i, k]
            for total in range(more, high_sum + 1):
                c = cost[total - more] + price
                if c < after[total]:
                    after[total], choice[i, total] = c, k
        cost = after
    total = -1
    for s in range(max(low_sum, 0), high_sum + 1):
        if cost[s] < np.inf and (total < 0 or cost[s] < cost[total]):
            total = s
    if total < 0:
        return level
    for i in range(n - 1, -1, -1):
        level[i] = choice[i, total]
        total -= units[i, level[i]]
    return level


@compiled
def _smooth_lists(
    wanted: Floats, values: Floats, number: Ints, units: Ints, change: Floats,
    low_sum: int, high_sum: int,
) -> Ints:  # fmt: skip
    """Over the sum so far and the value at the last place.

    Where any sum will do, all units are 0 and so is high_sum.
    """
    n, width = values.shape
    level = np.full(n, -1)
    if high_sum < 0:
        return level
    cost = np.full((high_sum + 1, width), np.inf)
    choice = np.full((n, high_sum + 1, width), -1, dtype=np.int32)
    for k in range(number[0]):
        if units[0, k] <= high_sum:
            cost[units[0, k], k] = (values[0, k] - wanted[0]) ** 2
    for i in range(1, n):
        after = np.full((high_sum + 1, width), np.inf)
        for k in range(number[i]):
            price, more = (values[i, k] - wanted[i]) ** 2, units[i, k]
            for j in range(number[i - 1]):
                if abs(values[i, k] - values[i - 1, j]) > change[i - 1]:
                    continue
                for total in range(more, high_sum + 1):
                    c = cost[total - more, j] + price
                    if c < after[total, k]:
                        after[total, k], choice[i, total, k] = c, j
        cost = after
    total, last = -1, -1
    for s in range(max(low_sum, 0), high_sum + 1):
        for k in range(width):
            if cost[s, k] < np.inf and (total < 0 or cost[s, k] < cost[total, last]):
                total, last = s, k
    if total < 0:
        return level
    for i in range(n - 1, -1, -1):
        level[i] = last
        before = choice[i, total, last]
        total -= units[i, last]
        last = before
    return level
