"""The nearest layout whose values are all on lists (a grid, a few thicknesses), exactly.

Each place of the layout has its own list. Without a length and without a largest change the nearest
values are found place by place. A length couples all places: on grids of one step, the least
expensive single steps up are taken, which is exact as the cost is convex; on any other list, a
dynamic programme over the sum so far. A largest change couples neighbours: the programme then keeps
the last value too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from domino_env.core.types import Floats, Ints
from domino_env.kernels.jit import compile_alone

QUANTUM = 1e-9  # [m] a length and the values of a list are whole multiples of it
LARGEST_TABLE = 40_000_000  # entries of the table of a dynamic programme
SLACK = 1e-12  # [m] rounding error by which a largest change may be exceeded


class Lists:
    """Lists of allowed values for the n places of a layout.

    Parameters
    ----------
    values
        The allowed values of each place, rising [m].
    change
        (n-1,) largest change from a place to the next [m], inf for any.
    total
        Least and largest sum of all places [m]; None for any.

    Raises
    ------
    ValueError
        If a length with lists this fine takes too large a table.
    """

    def __init__(
        self,
        values: Sequence[tuple[float, ...]],
        change: Floats,
        total: tuple[float, float] | None = None,
    ) -> None:
        n, longest = len(values), max(len(v) for v in values)
        self.sizes = np.array([len(v) for v in values])
        self.values = np.full((n, longest), np.inf)
        for i, v in enumerate(values):
            self.values[i, : len(v)] = v
        self.change = change
        self.coupled = bool(np.isfinite(change).any())
        self.grid = 0.0
        self.low_sum = self.high_sum = 0
        self.units = np.zeros((n, longest), dtype=np.int64)
        self.total = total
        if total is not None:
            self._set_units(total)

    def _set_units(self, total: tuple[float, float]) -> None:
        """Express values and sums as whole multiples of the largest unit they share."""
        n, longest = self.values.shape
        is_listed = np.isfinite(self.values)
        rise = np.where(is_listed, self.values - self.values[:, :1], 0.0)
        multiples = np.round(rise / QUANTUM).astype(np.int64)
        unit = int(np.gcd.reduce(multiples.ravel())) or 1
        self.units = multiples // unit
        step = unit * QUANTUM
        base = float(self.values[:, 0].sum())
        self.low_sum = int(np.ceil((total[0] - base - QUANTUM) / step))
        self.high_sum = int(np.floor((total[1] - base + QUANTUM) / step))
        regular = bool(np.all((self.units == np.arange(longest)) | ~is_listed))
        self.grid = step if regular and not self.coupled else 0.0
        size = n * (self.high_sum + 1) * (longest if self.coupled else 1)
        if self.grid == 0.0 and size > LARGEST_TABLE:
            raise ValueError(
                f"a length with values on lists this fine (shared unit {step:g} m) takes a table "
                f"of {size} entries: use a coarser list or step, or leave the length free"
            )

    def nearest(self, targets: Floats) -> Floats:
        """Find the nearest allowed layout to each of `targets` (B, n) [m].

        Raises
        ------
        ValueError
            If there is none.
        """
        if self.total is None and not self.coupled:
            levels = self._place_by_place(targets)
        elif self.grid > 0.0:
            levels = self._by_single_steps(targets)
        else:
            lists = self.values, self.sizes, self.units, self.change + SLACK
            sums = self.low_sum, self.high_sum
            levels = np.array([_by_dynamic_programme(values, *lists, *sums) for values in targets])
        if levels.size and levels.min() < 0:
            raise ValueError("no layout of the allowed values has this length and these changes")
        return np.take_along_axis(self.values, levels.T, axis=1).T

    def _place_by_place(self, targets: Floats) -> Ints:
        """Find the indices (B, n) of the nearest values; the lower of two that are equally near."""
        lists = zip(self.values, self.sizes, targets.T, strict=True)
        places = [np.searchsorted(0.5 * (v[1:m] + v[: m - 1]), x) for v, m, x in lists]
        return np.stack(places, axis=1)

    def _by_single_steps(self, targets: Floats) -> Ints:
        """Find the indices (B, n) of the nearest values on grids with a sum.

        The k-th step up at a place costs 2k - 1 - 2 offset, in squared steps, more than the one
        before it: so the least expensive steps of all places are a layout, and the nearest one.
        """
        n, width = self.values.shape
        offset = (targets - self.values[:, 0]) / self.grid
        steps = np.arange(1, width)
        cost = 2.0 * steps - 1.0 - 2.0 * offset[..., None]
        cost[:, steps >= self.sizes[:, None]] = np.inf
        most_steps = int((self.sizes - 1).sum())
        low, high = max(self.low_sum, 0), min(self.high_sum, most_steps)
        if low > high:
            return np.full(targets.shape, -1)
        levels = np.empty(targets.shape, dtype=np.int64)
        for level, costs in zip(levels, cost.reshape(len(targets), -1), strict=True):
            number = min(max(int((costs < 0.0).sum()), low), high)
            step_indices = np.argpartition(costs, min(number, costs.size - 1))[:number]
            level[:] = np.bincount(step_indices // (width - 1), minlength=n)
        return levels


@compile_alone
def _by_dynamic_programme(
    targets: Floats, values: Floats, number: Ints, units: Ints, change: Floats,
    low_sum: int, high_sum: int,
) -> Ints:  # fmt: skip
    """Find the nearest indices (n,) over the sum so far and, with a largest change, the last value.

    All units and `high_sum` are 0 if any sum is allowed. All indices are -1 if there is no layout.
    """
    n, width = values.shape
    level = np.full(n, -1)
    if high_sum < 0:
        return level
    states = width if np.isfinite(change).any() else 1
    cost = np.full((high_sum + 1, states), np.inf)
    cost[0, 0] = 0.0
    # index of the value and the state before it, as one number
    choice = np.full((n, high_sum + 1, states), -1, dtype=np.int64)
    for i in range(n):
        next_cost = np.full((high_sum + 1, states), np.inf)
        for k in range(number[i]):
            rise, square = units[i, k], (values[i, k] - targets[i]) ** 2
            state = k if states > 1 else 0
            for previous in range(states):
                is_limited = states > 1 and i > 0
                if is_limited and abs(values[i, k] - values[i - 1, previous]) > change[i - 1]:
                    continue
                for total in range(rise, high_sum + 1):
                    c = cost[total - rise, previous] + square
                    if c < next_cost[total, state]:
                        next_cost[total, state], choice[i, total, state] = c, k * states + previous
        cost = next_cost
    total, state = -1, -1
    for s in range(max(low_sum, 0), high_sum + 1):
        for last in range(states):
            if cost[s, last] < np.inf and (total < 0 or cost[s, last] < cost[total, state]):
                total, state = s, last
    if total < 0:
        return level
    for i in range(n - 1, -1, -1):
        level[i], state = divmod(choice[i, total, state], states)
        total -= units[i, level[i]]
    return level
