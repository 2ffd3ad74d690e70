"""Distinct rows of a table, as NumPy finds them."""

from __future__ import annotations

import numpy as np
import pytest

from domino_env.core.types import distinct_rows


@pytest.mark.parametrize("seed", range(20))
def test_they_are_those_that_numpy_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    table = rng.integers(-2, 3, (rng.integers(1, 60), rng.integers(1, 5))).astype(np.float64)
    assert np.array_equal(distinct_rows(table), np.unique(table, axis=0))
