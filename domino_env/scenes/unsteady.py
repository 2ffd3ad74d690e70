"""Rows that an unsteady hand places: every gap comes out wrong by a normal error."""

from __future__ import annotations

import math

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


def unsteady_refusal(deviation: float, *, robust: bool, length: float | None) -> str | None:
    """Say why a hand cannot be as unsteady in a scene, in a sentence; None where it can."""
    if not 0.0 <= deviation < math.inf:
        return (
            f"placement.deviation = {deviation}: give the standard deviation of each gap's error, "
            "0 or more [m]"
        )
    if robust:
        return (
            "[placement] stands beside [robust], which draws errors of its own: leave one of them "
            "out"
        )
    if length is not None:
        return (
            "[placement] stands beside row.length, which a row whose gaps come out wrong does not "
            "meet: leave one of them out"
        )
    return None
