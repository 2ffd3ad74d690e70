"""Schedules of few numbers: a row as straight lines between knots.

Good rows change quickly at both ends and hardly in the middle, so knots stand at every place of the
ends and ever further apart towards the middle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def knots(pairs: int, most: int) -> NDArray[np.int64]:
    """Place at most `most` knots among 0 … pairs-1, both ends among them, as dense as can be."""
    if pairs <= most:
        return np.arange(pairs)
    growth = 1.02  # of the distance from the end, from knot to knot
    while True:
        offsets = [0.0]
        while offsets[-1] < 0.5 * pairs:
            offsets.append(max(offsets[-1] + 1.0, offsets[-1] * growth))
        from_end = np.array(offsets[:-1]).astype(np.int64)
        places = np.unique(np.concatenate([from_end, pairs - 1 - from_end]))
        if len(places) <= most or growth > pairs:
            return places if len(places) <= most else np.array([0, pairs - 1])
        growth = 1.0 + 1.1 * (growth - 1.0)


def schedule(parts: int, pairs: int, most: int) -> Floats:
    """Build the (parts pairs, m) matrix from the values at the knots of each part to a design."""
    places = knots(pairs, max(2, most // parts))
    one = np.stack([np.interp(np.arange(pairs), places, e) for e in np.eye(len(places))], axis=1)
    return np.asarray(np.kron(np.eye(parts), one))
