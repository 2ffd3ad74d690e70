"""Rows of a batch, and those that are uniform, over hills."""

from domino_env.kernels import chain, uniform
from domino_env.kernels.ground.links import rise_of
from domino_env.kernels.jit import always_inline, internal, overload
from domino_env.kernels.quadrature import ORDERS
from domino_env.kernels.slots import HillRow


@overload(chain.row_of)
@always_inline
def row_of(rows, b):
    """Row b of a batch; where all have the same height or density, it stands there once."""
    return HillRow(
        rows.spacing[b],
        rows.thickness[b],
        rows.height[b if len(rows.height) > 1 else 0],
        rows.density[b if len(rows.density) > 1 else 0],
        rows.rise[b],
        rows.tilt[b],
    )


@overload(uniform.finer_rule)
@always_inline
def finer_rule(domino, k, missed):
    """The rule after one that did not resolve the time, for so many falls on end."""
    return min(k + 1, len(ORDERS) - 1) if missed > 1 else k


@overload(uniform.is_uniform)
@internal
def is_uniform(row):
    """Whether one stack serves every fall: an even slope on which all parts are equal."""
    for i in range(1, len(row.thickness)):
        if row.tilt[i] != row.tilt[0] or row.rise[i - 1] != row.rise[0]:
            return False
    if rise_of(row, 0, 1) != 0.0:
        return False
    return uniform.equal_parts(row.spacing, row.thickness, row.height, row.density)
