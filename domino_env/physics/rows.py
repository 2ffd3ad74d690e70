"""Rows as the kernels take them: what flat ground does not need is left out."""

from __future__ import annotations

import numpy as np

from domino_env import kernels
from domino_env.physics.layout import Layout

Row = kernels.Row | kernels.HillRow


def row_of(layout: Layout) -> Row:
    """Return the arrays of a layout."""
    row = layout.spacing, layout.thickness, layout.height, layout.density
    if layout.is_flat:
        return kernels.Row(*row)
    return kernels.HillRow(*row, layout.rise, layout.tilt)


def batch_of(layout: Layout) -> Row:
    """Return the arrays of a layout as a batch of one."""
    row = row_of(layout)
    return type(row)(*(array[None] for array in row))


def bars_of(row: Row) -> Row:
    """Return room for the derivatives by all that a row, or each of a batch, is made of."""
    gaps, sizes = row.spacing.shape, row.thickness.shape
    names = type(row)._fields
    return type(row)(*(np.zeros(gaps if name in ("spacing", "rise") else sizes) for name in names))
