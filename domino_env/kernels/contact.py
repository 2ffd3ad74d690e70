"""Contact of one link: where the domino behind is, how fast it turns, and what force it passes on.

A link starts at its tip, may turn to the corner, and may be released.  For the symbols see `slots`.

Sources: van Leeuwen 2004 (arXiv physics/0401018); Chapman, "The physics of toppling dominoes",
eqs. 1-3 and 7, restated for unequal dominoes.
"""

import math

from domino_env.kernels.jit import always_inline, internal, overloaded
from domino_env.kernels.slots import TINY, TIP, Shape


@internal
def pose(angle):
    """sin and 1 - cos of one angle."""
    half = 0.5 * angle
    s, c = math.sin(half), math.cos(half)
    return 2.0 * s * c, 2.0 * s * s


@overloaded
@always_inline
def shape_of(link):
    """What the contacts below need of a link; `tip` and `corner` over hills are found by it."""
    return Shape(link.p_l, link.s_l, link.rest, link.d_l)


@overloaded
@internal
def tip(s, v, shape, mu):
    """The top edge of i slides down the back of i+1: sin θ_i, 1 - cos θ_i, Ω, Ψ, B/A."""
    p_l, s_l, rest, d_l = shape
    sd = s_l - p_l * v  # sin Δ, eq. 1
    cd2 = (1.0 + sd) * (rest + p_l * v)
    cd = math.sqrt(cd2 if cd2 > TINY else TINY)
    arm = cd + mu * sd
    vd = sd * sd / (1.0 + cd)  # 1 - cos Δ; the next link waits for it, so it has its own division
    r = 1.0 / (cd * arm)
    inv_cd = r * arm
    omega = 1.0 - p_l * s * inv_cd  # eq. 2
    ratio = (cd - p_l * s - mu * d_l) * (r * cd)  # eq. 7
    s_i = s * cd + (1.0 - v) * sd
    v_i = v + vd - v * vd + s * sd
    psi = -p_l * ((1.0 - v_i) + s * sd * omega) * (inv_cd * inv_cd)  # eq. 3, corrected
    return s_i, v_i, omega, psi, ratio


@overloaded
@internal
def corner(s, v, shape, mu):
    """The front face of i rests on the rear bottom edge of i+1; the same five numbers."""
    p_l, s_l, _, d_l = shape
    r2 = s_l * s_l + 2.0 * p_l * d_l * v  # squared distance from pivot i to that edge
    r1 = math.sqrt(r2)
    up = r1 + d_l * s
    q = 1.0 / (r2 * up)  # the one division
    inv_r2 = q * up
    lift = p_l * v - s_l
    omega = d_l * lift * inv_r2
    ratio = d_l * (lift - mu * p_l * s) * inv_r2
    x = s_l + d_l * v
    s_i = x * r1 * inv_r2
    v_i = x * x * q * r1
    psi = p_l * d_l * s * s_l * (p_l + d_l) * (inv_r2 * inv_r2)
    return s_i, v_i, omega, psi, ratio


@internal
def link_at(link, s, v, mu):
    """One link in its present contact, for a single angle; the same five numbers."""
    if link.contact == TIP:
        return tip(s, v, shape_of(link), mu)
    return corner(s, v, shape_of(link), mu)
