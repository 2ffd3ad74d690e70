"""Rows as the kernels take them: on flat ground without rise and tilt."""

from __future__ import annotations

from typing import Any

import numpy as np

from domino_env.kernels import Row
from domino_env.physics.layout import Layout


def row_of(layout: Layout) -> Row:
    """Return the arrays of a layout."""
    ground = () if layout.is_flat else (layout.rise, layout.tilt)
    return Row(layout.spacing, layout.thickness, layout.height, layout.density, *ground)


def batch_of(layout: Layout) -> Row:
    """Return the arrays of a layout as a batch of one."""
    ground = () if layout.is_flat else (layout.rise[None], layout.tilt[None])
    row = layout.spacing[None], layout.thickness[None], layout.height[None], layout.density[None]
    return Row(*row, *ground)


def bars_of(row: Row) -> Row:
    """Return room for the derivatives by all that a row, or each of a batch, is made of."""
    arrays: Any = (None if array is None else np.zeros(array.shape) for array in row)
    bars = Row(*arrays)
    return bars._replace(
        height=np.zeros_like(bars.thickness), density=np.zeros_like(bars.thickness)
    )
