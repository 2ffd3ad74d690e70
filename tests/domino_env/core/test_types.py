"""Distinct rows of a table, as NumPy finds them."""

from __future__ import annotations

import numpy as np

from domino_env.core.types import unique_points


def test_they_are_those_that_numpy_finds() -> None:
    table = np.random.default_rng(0).integers(-2, 3, (60, 3)).astype(np.float64)
    assert np.array_equal(unique_points(table), np.unique(table, axis=0))
