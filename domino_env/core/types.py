"""Types of arrays, read-only arrays, results with such arrays, and unique points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def read_only(array: ArrayLike) -> Floats:
    """Return a contiguous read-only view of floats, for which the kernels are compiled."""
    view = np.ascontiguousarray(array, dtype=np.float64).view()
    view.flags.writeable = False
    return view


class ReadOnlyArrays:
    """Base class of results whose arrays are read-only, also in a pickled or deep copy."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        protect(tuple(state.values()))


def protect(value: object) -> None:
    """Make an array, or those in nested tuples, read-only."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, tuple):
        for part in value:
            protect(part)


def unique_points(table: Floats) -> Floats:
    """Return the unique points of a table (M, n), ordered by their coordinates.

    The result is that of `numpy.unique(table, axis=0)`, which turns a KeyboardInterrupt into a
    TypeError.
    """
    ordered = table[np.lexsort(table.T[::-1])]
    first = np.ones(len(ordered), dtype=np.bool_)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    return ordered[first]
