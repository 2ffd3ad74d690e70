"""Forces between the dominoes and what the ground bears, over hills."""

import math

from domino_env.kernels import forces as flat
from domino_env.kernels.jit import always_inline, overload
from domino_env.kernels.slots import TINY, TIP


@overload(flat.upright)
@always_inline
def upright(row, i, s, c):
    """sin and cos of the lean of domino i from the vertical."""
    sine, cosine = math.sin(row.tilt[i]), math.cos(row.tilt[i])
    return s * cosine + c * sine, c * cosine - s * sine


@overload(flat.to_ground)
@always_inline
def to_ground(row, i, x, z):
    """A force along the ground under domino i, and upright to it."""
    sine, cosine = math.sin(row.tilt[i]), math.cos(row.tilt[i])
    return x * cosine - z * sine, x * sine + z * cosine


@overload(flat.mass_of)
@always_inline
def mass_of(row, domino, i):
    """Mass of domino i, per unit of width."""
    return row.density[i] * row.height[i] * row.thickness[i]


@overload(flat.tip_ratio)
@always_inline
def tip_ratio(link, s, v):
    """Ω of a tip whose faces are flush."""
    return 1.0 - link.p_l * s - link.rise_l * (1.0 - v)


@overload(flat.arm_behind)
@always_inline
def arm_behind(link, s, v, mu):
    """A over the height of the domino behind."""
    lost = link.p_l * v + link.rise_l * s
    if link.contact == TIP:
        sd = link.s_l - lost
        return math.sqrt(max((1.0 + sd) * (link.rest + lost), TINY)) + mu * sd
    return math.sqrt(link.s_l**2 + link.rise_l**2 + 2.0 * link.d_l * lost)
