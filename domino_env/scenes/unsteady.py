"""Rows that an unsteady hand places: every gap comes out wrong by a normal error."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

LEAST_GAP = 0.0002  # [m] no gap is ever placed tighter


def errors(deviation: float, pairs: int, generator: np.random.Generator) -> Floats:
    """Draw what is added to the gaps of a row (pairs,) [m]."""
    return deviation * generator.standard_normal(pairs)


def placed(spacing: Floats, errors: Floats) -> Floats:
    """Return the gaps as they come to stand [m], whose last axis is that of the errors."""
    return np.maximum(spacing + errors, LEAST_GAP)
