"""Types of arrays, and their distinct rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def unique_points(table: Floats) -> Floats:
    """Return the rows of a table (M, n), each once, ordered by their first entries, then the next.

    As `numpy.unique(table, axis=0)`; but that compares rows as records, and where Ctrl-C comes
    meanwhile, NumPy calls them incomparable (a TypeError) and the interruption is lost.
    """
    ordered = table[np.lexsort(table.T[::-1])]
    first = np.ones(len(ordered), dtype=np.bool_)
    first[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    return ordered[first]
