"""Dominoes and links in the ring; where the domino behind is, how it turns, what it passes on.

A link starts at its tip, may turn to the corner, and may be released.  For the symbols see `slots`.
With a rise e and a turn β of zero these are the formulas of flat ground, to the last bit.

Sources: van Leeuwen 2004 (arXiv physics/0401018); Chapman, "The physics of toppling dominoes",
eqs. 1-3 and 7, restated for unequal dominoes.
"""

import math

import numba
import numpy as np
from numba.core import types

from domino_env.kernels.jit import always_inline, internal, leaf
from domino_env.kernels.slots import (
    CORNER,
    EPS,
    LINK,
    RELEASED,
    TINY,
    TIP,
    UNEVEN_LINK,
    Shape,
    is_uneven,
    pace_of,
    rise_of,
    turn_s_of,
    turn_v_of,
)

NEVER = 3.0  # 1 - cos θ is at most 2
_TYPES = {flat: numba.from_dtype(LINK if flat else UNEVEN_LINK) for flat in (True, False)}


@numba.extending.intrinsic
def _link_type(_, tilt):
    """Return the record type of the links of a row, by the type of its tilt."""
    kind = types.DType(_TYPES[isinstance(tilt, types.NoneType)])
    return kind(tilt), lambda context, *_: context.get_dummy_value()


@internal
def new_ring(row, size):
    """Return an empty ring for the dominoes of a row."""
    return np.zeros(size, _link_type(row.tilt))


@always_inline
def at_or_zero(values, i):
    """Return values[i]; 0.0 where there are no values, as on flat ground."""
    if values is None:
        return 0.0
    return values[i]


@always_inline
def stand(ring, mask, i, row, j):
    """Write domino j of a row into the ring as domino i.

    Per unit of width; its link forward comes with the next.  Counted from its stand, its weight
    turns it like that of a domino of another weight and slenderness on flat ground:
    ½ m g (L sin(θ + α) - d cos(θ + α)).
    """
    domino, height, thickness = ring[i & mask], row.height[j], row.thickness[j]
    mass = row.density[j] * height * thickness
    domino.inertia = mass * (height * height + thickness * thickness) / 3.0
    tilt, slender = at_or_zero(row.tilt, j), thickness / height
    s, c = math.sin(tilt), math.cos(tilt)
    share = c + slender * s
    domino.half_weight = 0.5 * mass * height * share  # times gravity where it is used
    domino.slender = (slender * c - s) / share
    domino.contact = TIP
    domino.noted = 0
    domino.tail = domino.inertia
    domino.end_weight = 0.0


@always_inline
def join(ring, mask, i, row, j, ahead):
    """Write the link from i to i+1, which are dominoes j and `ahead` of the row."""
    link, height, gap, thickness_next = (
        ring[i & mask],
        row.height[j],
        row.spacing[j],
        row.thickness[ahead],
    )
    pitch = gap + thickness_next
    link.p_l = pitch / height
    link.s_l = gap / height
    link.rest = (height - gap) / height
    link.d_l = thickness_next / height
    link.v_flush = gap / pitch  # cos θ = d/p
    # cos θ = (p² + d² - L²) / 2pd, for the tip and for the corner
    link.v_release = (height - gap) * (height + gap) / (2.0 * pitch * thickness_next)
    _join_ground(link, row, row.tilt, j, ahead)
    link.due = min(link.v_flush, link.v_release)


@internal
def _join_ground(link, row, tilt, j, ahead):
    """Write what uneven ground adds to a link."""
    if tilt is None:
        return
    e, p, d = step_of(row, j, ahead) / row.height[j], link.p_l, link.d_l
    link.rise_l = e
    link.turn = tilt[j] - tilt[ahead]
    link.turn_s = math.sin(link.turn)
    link.turn_v = 2.0 * math.sin(0.5 * link.turn) ** 2
    link.pace = 0.0
    if e != 0.0:
        link.v_flush = first_lean(p, e, d, link.s_l)
        v = link.v_flush
        if 0.0 < v < 2.0:
            link.pace = e * (1.0 - v) / math.sqrt(v * (2.0 - v))
        # p cos θ - e sin θ = (p² + e² + d² - L²) / 2d, for the tip and for the corner
        short = link.rest * (1.0 + link.s_l) - e * e
        link.v_release = first_lean(p, e, d, short / (2.0 * d))


@internal
def step_of(row, j, ahead):
    """Return e of the link between dominoes j and `ahead` [m]; 0 where it is all rounding."""
    tilt = at_or_zero(row.tilt, ahead)
    along = (row.spacing[j] + row.thickness[ahead]) * math.tan(tilt)
    up = at_or_zero(row.rise, j) / math.cos(tilt)
    step = along + up
    return 0.0 if abs(step) <= 8.0 * EPS * (abs(along) + abs(up)) else step


@internal
def first_lean(p, e, d, drop):
    """Return 1 - cos θ at which p cos θ - e sin θ has fallen from p by `drop`; e is not 0."""
    r = p - drop
    w2 = drop * (p + r) + e * e
    if w2 < 0.0:
        return NEVER
    w, square = math.sqrt(w2), p * p + e * e
    if e > 0.0:  # no difference of nearly equal numbers
        return drop * (p * w - e * r) / ((e + w) * square)
    return (p * drop + e * (e - w)) / square


@always_inline
def far(link):
    """p² + e² - d², between the pivots."""
    return link.s_l * (link.p_l + link.d_l) + rise_of(link) * rise_of(link)


@always_inline
def most_passed_on(link):
    """Bound on Ω and |B/A| of a link at its tip: both only fall from what they are at the hit."""
    if not is_uneven(link):
        return 1.0
    return max(1.0, 1.0 - rise_of(link) / math.sqrt(link.rest * (1.0 + link.s_l)))


@always_inline
def past_flush(link, over):
    """By what Δ [rad] the faces are past flush where 1 - cos θ_{i+1} is past its due by `over`."""
    return over * (link.p_l + pace_of(link))


@always_inline
def can_flush(link):
    """Whether the link is to go from tip to corner, rather than be released."""
    return link.contact == TIP and link.v_flush < link.v_release


@always_inline
def flush(link, state):
    """From tip to corner."""
    link.contact = CORNER
    link.due = link.v_release
    state.flushes += 1


@internal
def release(link, i, state):
    """Domino i loses i+1: it and all behind it leave the stack."""
    link.contact = RELEASED
    state.back = i + 1
    state.releases += 1


@always_inline
def catch_up(link, i, v, state):
    """Make up for switches beyond an earlier cut: they had no weight then, and need no impact."""
    if can_flush(link):
        flush(link, state)
    if v > link.v_release * (1.0 + 1e-9):
        release(link, i, state)


@internal
def pose(angle):
    """sin and 1 - cos of one angle."""
    half = 0.5 * angle
    s, c = math.sin(half), math.cos(half)
    return 2.0 * s * c, 2.0 * s * s


@always_inline
def shape_of(link):
    """Return what the contacts below need of a link."""
    e, turn_s, turn_v = rise_of(link), turn_s_of(link), turn_v_of(link)
    return Shape(link.p_l, link.s_l, link.rest, link.d_l, e, turn_s, turn_v, is_uneven(link))


@leaf
def tip(s, v, shape, mu):
    """The top edge of i slides down the back of i+1: sin θ_i, 1 - cos θ_i, Ω, Ψ, B/A."""
    p_l, s_l, rest, d_l, e, turn_s, turn_v, uneven = shape
    lost = p_l * v + e * s
    sd = s_l - lost  # sin Δ, eq. 1; on uneven ground Δ is the lean seen from the stand of i+1
    cd2 = (1.0 + sd) * (rest + lost)
    cd = math.sqrt(cd2 if cd2 > TINY else TINY)
    arm = cd + mu * sd
    vd = sd * sd / (1.0 + cd)  # 1 - cos Δ; the next link waits for it, so it has its own division
    r = 1.0 / (cd * arm)
    inv_cd = r * arm
    c = 1.0 - v
    pull = p_l * s + e * c
    omega = 1.0 - pull * inv_cd  # eq. 2
    ratio = (cd - pull - mu * d_l) * (r * cd)  # eq. 7
    s_0 = s * cd + c * sd
    v_0 = v + vd - v * vd + s * sd
    if uneven:  # eq. 3, corrected: one formula for both takes 3 % longer on uneven ground
        psi = (sd * (1.0 - omega) * (1.0 - omega) - (p_l * c - e * s)) * inv_cd
    else:
        psi = -p_l * ((1.0 - v_0) + s * sd * omega) * (inv_cd * inv_cd)
    s_i = s_0 - (s_0 * turn_v + (1.0 - v_0) * turn_s)
    v_i = v_0 + turn_v - v_0 * turn_v - s_0 * turn_s
    return s_i, v_i, omega, psi, ratio


@leaf
def corner(s, v, shape, mu):
    """The front face of i rests on the rear bottom edge of i+1; the same five numbers."""
    p_l, s_l, _, d_l, e, turn_s, turn_v, uneven = shape
    # squared distance from pivot i to that edge
    r2 = s_l * s_l + 2.0 * p_l * d_l * v + e * (e + 2.0 * d_l * s)
    r1 = math.sqrt(r2)
    up = r1 + d_l * s + e
    q = 1.0 / (r2 * up)  # the one division
    inv_r2 = q * up
    lift, c = p_l * v + e * s - s_l, 1.0 - v
    omega = d_l * lift * inv_r2
    ratio = d_l * (lift - mu * p_l * s - mu * e * c) * inv_r2
    x = s_l + d_l * v
    s_0 = x * r1 * inv_r2
    v_0 = x * x * q * r1
    if uneven:
        bend = d_l * (p_l * s + e * c) * (s_l * (p_l + d_l) + e * e)
    else:
        bend = p_l * d_l * s * s_l * (p_l + d_l)
    psi = bend * (inv_r2 * inv_r2)
    s_i = s_0 - (s_0 * turn_v + (1.0 - v_0) * turn_s)
    v_i = v_0 + turn_v - v_0 * turn_v - s_0 * turn_s
    return s_i, v_i, omega, psi, ratio


@internal
def link_at(link, s, v, mu):
    """One link in its present contact, for a single angle; the same five numbers."""
    if link.contact == TIP:
        return tip(s, v, shape_of(link), mu)
    return corner(s, v, shape_of(link), mu)
