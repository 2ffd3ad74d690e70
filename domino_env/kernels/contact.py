"""Contact of one link: where the domino behind is, how fast it turns, and what force it passes on.

A link starts at its tip, may turn to the corner, and may be released.  For the symbols see `slots`.
With a rise e and a turn β of zero these are the formulas of flat ground, to the last bit.

Sources: van Leeuwen 2004 (arXiv physics/0401018); Chapman, "The physics of toppling dominoes",
eqs. 1-3 and 7, restated for unequal dominoes.
"""

import math

from domino_env.kernels.jit import always_inline, internal, leaf
from domino_env.kernels.slots import TINY, TIP, Shape, is_uneven, rise_of, turn_s_of, turn_v_of


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
