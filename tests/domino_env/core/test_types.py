"""Unique points of a table, as of NumPy."""

import numpy as np

from domino_env.core.types import unique_points


def test_unique_points_are_those_of_numpy():
    table = np.random.default_rng(0).integers(-2, 3, (60, 3)).astype(np.float64)
    assert np.array_equal(unique_points(table), np.unique(table, axis=0))
