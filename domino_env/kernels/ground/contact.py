"""Contact of one link, over hills."""

import math

from domino_env.kernels import contact as flat
from domino_env.kernels.jit import always_inline, internal, overload
from domino_env.kernels.slots import TINY, HillShape


@overload(flat.shape_of)
@always_inline
def shape_of(link):
    """What the contacts below need of a link."""
    return HillShape(link.p_l, link.s_l, link.rest, link.d_l, link.rise_l, link.turn_s, link.turn_v)


@overload(flat.tip)
@internal
def tip(s, v, shape, mu):
    """The top edge of i slides down the back of i+1: sin θ_i, 1 - cos θ_i, Ω, Ψ, B/A."""
    p, s_l, rest, d_l, e, turn_s, turn_v = shape
    c = 1.0 - v
    lost = p * v + e * s
    sd = s_l - lost  # sin Δ, the lean of i seen from the stand of i+1
    cd2 = (1.0 + sd) * (rest + lost)
    cd = math.sqrt(cd2 if cd2 > TINY else TINY)
    arm = cd + mu * sd
    vd = sd * sd / (1.0 + cd)
    r = 1.0 / (cd * arm)
    inv_cd = r * arm
    q = p * s + e * c
    pull = q * inv_cd
    ratio = (cd - q - mu * d_l) * (r * cd)
    psi = (sd * pull * pull - (p * c - e * s)) * inv_cd
    s_0 = s * cd + c * sd
    v_0 = v + vd - v * vd + s * sd
    s_i = s_0 - (s_0 * turn_v + (1.0 - v_0) * turn_s)
    v_i = v_0 + turn_v - v_0 * turn_v - s_0 * turn_s
    return s_i, v_i, 1.0 - pull, psi, ratio


@overload(flat.corner)
@internal
def corner(s, v, shape, mu):
    """The front face of i rests on the rear bottom edge of i+1; the same five numbers."""
    p, s_l, _, d_l, e, turn_s, turn_v = shape
    lost = p * v + e * s
    r2 = s_l * s_l + e * e + 2.0 * d_l * lost  # squared distance from pivot i to that edge
    inv_r2 = 1.0 / r2
    inv_r1 = math.sqrt(inv_r2)
    lift, q = lost - s_l, p * s + e * (1.0 - v)
    omega = d_l * lift * inv_r2
    ratio = d_l * (lift - mu * q) * inv_r2
    psi = d_l * q * (s_l * (p + d_l) + e * e) * (inv_r2 * inv_r2)
    s_0, c_0 = (s_l + d_l * v) * inv_r1, (e + d_l * s) * inv_r1
    s_i = s_0 - (s_0 * turn_v + c_0 * turn_s)
    v_i = 1.0 - (c_0 - c_0 * turn_v + s_0 * turn_s)
    return s_i, v_i, omega, psi, ratio
