"""Exact projection onto values from lists, such as a grid or a few thicknesses.

A place is the index of a value in the layout, and each place has its own list. Without a length,
the nearest values are found place by place. A length couples all places: on grids of one step, the
least expensive single steps up are chosen, which is exact because the cost is convex; on other
lists, a dynamic programme over the sum so far finds the values.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from domino_env.core.types import Floats, Ints
from domino_env.kernels.jit import compile_alone

QUANTUM = 1e-9  # [m] a length and the values of a list are whole multiples of it
LARGEST_TABLE = 40_000_000  # entries of the table of a dynamic programme, some 300 MB


class Lists:
    """Lists of allowed values for the n places of a layout.

    Parameters
    ----------
    values
        Allowed values of each place, rising [m].
    total
        Least and largest sum of all values [m]; None for any.

    Raises
    ------
    ValueError
        If the table for a length with lists this fine is too large.
    """

    def __init__(
        self, values: Sequence[tuple[float, ...]], total: tuple[float, float] | None = None
    ) -> None:
        n, longest = len(values), max(len(v) for v in values)
        self.sizes = np.array([len(v) for v in values])
        self.values = np.full((n, longest), np.inf)  # inf beyond the end of a list
        for i, v in enumerate(values):
            self.values[i, : len(v)] = v
        # [m] step if all lists are grids of one step; otherwise 0
        self.grid_step = 0.0
        # sums and values as multiples of a unit; all 0 if any sum is allowed
        self.low_sum = self.high_sum = 0
        self.multiples = np.zeros((n, longest), dtype=np.int64)
        self.total = total
        if total is not None:
            self._set_multiples(total)

    def _set_multiples(self, total: tuple[float, float]) -> None:
        """Express values above the least and sums as multiples of the largest unit they share."""
        n, longest = self.values.shape
        is_listed = np.isfinite(self.values)
        above_least = np.where(is_listed, self.values - self.values[:, :1], 0.0)
        multiples = np.round(above_least / QUANTUM).astype(np.int64)
        unit = int(np.gcd.reduce(multiples.ravel())) or 1
        self.multiples = multiples // unit
        step = unit * QUANTUM
        base = float(self.values[:, 0].sum())
        self.low_sum = int(np.ceil((total[0] - base - QUANTUM) / step))
        self.high_sum = int(np.floor((total[1] - base + QUANTUM) / step))
        is_grid = bool(np.all((self.multiples == np.arange(longest)) | ~is_listed))
        self.grid_step = step if is_grid else 0.0
        size = n * (self.high_sum + 1)
        if self.grid_step == 0.0 and size > LARGEST_TABLE:
            raise ValueError(
                f"a length with values on lists this fine (shared unit {step:g} m) takes a table "
                f"of {size} entries (at most {LARGEST_TABLE}): use a coarser list or step"
            )

    def nearest(self, targets: Floats) -> Floats:
        """Find the nearest allowed values (B, n) to each of `targets` (B, n) [m].

        Raises
        ------
        ValueError
            If no allowed values have the sum.
        """
        if self.total is None:
            levels = self._place_by_place(targets)
        elif self.grid_step > 0.0:
            levels = self._by_single_steps(targets)
        else:
            lists = self.values, self.sizes, self.multiples
            sums = self.low_sum, self.high_sum
            levels = np.array([_by_dynamic_programme(values, *lists, *sums) for values in targets])
        if levels.size and levels.min() < 0:  # -1: there are none
            raise ValueError("no layout of the allowed values has this length")
        return np.take_along_axis(self.values, levels.T, axis=1).T

    def _place_by_place(self, targets: Floats) -> Ints:
        """Find the indices (B, n) of the nearest values; of two equally near, the lower one."""
        lists = zip(self.values, self.sizes, targets.T, strict=True)
        places = [np.searchsorted(0.5 * (v[1:m] + v[: m - 1]), x) for v, m, x in lists]
        return np.stack(places, axis=1)

    def _by_single_steps(self, targets: Floats) -> Ints:
        """Find the indices (B, n) of the nearest values on grids with a sum; -1 if there are none.

        The k-th step up from the least value of a place adds (2k - 1 - 2·offset)·step² to the
        squared distance. This increases with k, so the least expensive steps of all places, as many
        as the sum needs, lead to the nearest values.
        """
        n, width = self.values.shape
        offset = (targets - self.values[:, 0]) / self.grid_step
        steps = np.arange(1, width)
        cost = 2.0 * steps - 1.0 - 2.0 * offset[..., None]
        cost[:, steps >= self.sizes[:, None]] = np.inf
        most_steps = int((self.sizes - 1).sum())
        low, high = max(self.low_sum, 0), min(self.high_sum, most_steps)
        if low > high:
            return np.full(targets.shape, -1)
        levels = np.empty(targets.shape, dtype=np.int64)
        for level, costs in zip(levels, cost.reshape(len(targets), -1), strict=True):
            count = min(max(int((costs < 0.0).sum()), low), high)
            step_indices = np.argpartition(costs, min(count, costs.size - 1))[:count]
            level[:] = np.bincount(step_indices // (width - 1), minlength=n)
        return levels


@compile_alone
def _by_dynamic_programme(
    targets: Floats, values: Floats, sizes: Ints, multiples: Ints, low_sum: int, high_sum: int
) -> Ints:
    """Find the indices (n,) of the nearest values by sum; all are -1 if no values are possible."""
    n = len(values)
    level = np.full(n, -1)
    if high_sum < 0:
        return level
    cost = np.full(high_sum + 1, np.inf)
    cost[0] = 0.0
    # best value; -1 if the sum is out of reach
    choice = np.full((n, high_sum + 1), -1, dtype=np.int64)
    for i in range(n):
        next_cost = np.full(high_sum + 1, np.inf)
        for k in range(sizes[i]):
            multiple, square = multiples[i, k], (values[i, k] - targets[i]) ** 2
            for total in range(multiple, high_sum + 1):
                c = cost[total - multiple] + square
                if c < next_cost[total]:
                    next_cost[total], choice[i, total] = c, k
        cost = next_cost
    total = -1
    for s in range(max(low_sum, 0), high_sum + 1):
        if cost[s] < np.inf and (total < 0 or cost[s] < cost[total]):
            total = s
    if total < 0:
        return level
    for i in range(n - 1, -1, -1):
        level[i] = choice[i, total]
        total -= multiples[i, level[i]]
    return level
