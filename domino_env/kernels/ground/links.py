"""Dominoes and links in the ring, over hills."""

import math

import numpy as np

from domino_env.kernels import links as flat
from domino_env.kernels.jit import always_inline, internal, overload
from domino_env.kernels.slots import EPS, HILL_LINK, TIP

NEVER = 3.0  # 1 - cos θ is at most 2


@overload(flat.new_ring)
@internal
def new_ring(row, size):
    """An empty ring for the dominoes of a row."""
    return np.zeros(size, HILL_LINK)


@overload(flat.stand)
@always_inline
def stand(ring, mask, i, row, j):
    """Write domino j of a row into the ring as domino i.

    Counted from its stand, its weight turns it like that of a domino of another weight and
    slenderness on flat ground: ½ m g (L sin(θ + α) - d cos(θ + α)).
    """
    domino = ring[i & mask]
    height, thickness, density = row.height[j], row.thickness[j], row.density[j]
    mass = density * height * thickness
    domino.inertia = mass * (height * height + thickness * thickness) / 3.0
    slender, s, c = thickness / height, math.sin(row.tilt[j]), math.cos(row.tilt[j])
    share = c + slender * s
    domino.half_weight = 0.5 * mass * height * share
    domino.slender = (slender * c - s) / share
    domino.contact = TIP
    domino.noted = 0
    domino.tail = domino.inertia
    domino.end_weight = 0.0


@internal
def rise_of(row, j, ahead):
    """e of the link between dominoes j and `ahead` [m]; 0 where it is all rounding."""
    pitch, tilt = row.spacing[j] + row.thickness[ahead], row.tilt[ahead]
    along, up = pitch * math.tan(tilt), row.rise[j] / math.cos(tilt)
    rise = along + up
    return 0.0 if abs(rise) <= 8.0 * EPS * (abs(along) + abs(up)) else rise


@internal
def first_lean(p, e, d, drop):
    """1 - cos θ at which p cos θ - e sin θ has fallen from p by `drop`."""
    if e == 0.0:
        return drop / p
    r = p - drop
    w2 = drop * (p + r) + e * e
    if w2 < 0.0:
        return NEVER
    w, square = math.sqrt(w2), p * p + e * e
    if e > 0.0:  # no difference of nearly equal numbers
        return drop * (p * w - e * r) / ((e + w) * square)
    return (p * drop + e * (e - w)) / square


@overload(flat.join)
@always_inline
def join(ring, mask, i, row, j, ahead):
    """Write the link from i to i+1, which are dominoes j and `ahead` of the row."""
    link, height, gap, d = ring[i & mask], row.height[j], row.spacing[j], row.thickness[ahead]
    link.p_l = (gap + d) / height
    link.s_l = gap / height
    link.rest = (height - gap) / height
    link.d_l = d / height
    link.rise_l = rise_of(row, j, ahead) / height
    link.turn = row.tilt[j] - row.tilt[ahead]
    link.turn_s = math.sin(link.turn)
    link.turn_v = 2.0 * math.sin(0.5 * link.turn) ** 2
    p, e, d_l = link.p_l, link.rise_l, link.d_l
    link.v_flush = first_lean(p, e, d_l, link.s_l)
    v = link.v_flush
    link.pace = p + e * (1.0 - v) / math.sqrt(v * (2.0 - v)) if 0.0 < v < 2.0 else p
    # p cos θ - e sin θ = (p² + e² + d² - L²) / 2d, for the tip and for the corner
    short = link.rest * (1.0 + link.s_l) - e * e
    link.v_release = first_lean(p, e, d_l, short / (2.0 * d_l))
    link.due = min(link.v_flush, link.v_release)


@overload(flat.past_flush)
@always_inline
def past_flush(link, over):
    """By what Δ [rad] the faces are past flush where 1 - cos θ_{i+1} is past its due by `over`."""
    return over * link.pace


@overload(flat.far)
@always_inline
def far(link):
    """p² + e² - d², between the pivots."""
    return link.s_l * (link.p_l + link.d_l) + link.rise_l * link.rise_l


@overload(flat.most_passed_on)
@always_inline
def most_passed_on(link):
    """Bound on Ω and |B/A| of a link at its tip: both only fall from what they are at the hit."""
    return max(1.0, 1.0 - link.rise_l / math.sqrt(link.rest * (1.0 + link.s_l)))
