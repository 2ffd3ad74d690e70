"""Contact of one link, backwards."""

import math

from domino_env.kernels.adjoint.slots import PART_GAP, PART_PITCH, PART_THICK, ShapeBar
from domino_env.kernels.contact import shape_of
from domino_env.kernels.jit import always_inline, internal, overloaded
from domino_env.kernels.slots import TINY, TIP


@overloaded
@internal
def tip_back(s, v, shape, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """`tip` in reverse: bars of s, v, the link, μ; and Ω, Ψ, B/A again."""
    p_l, s_l, rest, d_l = shape
    sd = s_l - p_l * v
    cd2 = (1.0 + sd) * (rest + p_l * v)
    cd = math.sqrt(cd2 if cd2 > TINY else TINY)
    arm = cd + mu * sd
    r = 1.0 / (cd * arm)
    inv_cd, inv_arm = r * arm, r * cd
    c = 1.0 - v
    c_i = c * cd - s * sd
    pull = p_l * inv_cd
    omega = 1.0 - pull * s
    ratio = (cd - p_l * s - mu * d_l) * inv_arm
    bracket = c_i + s * sd * omega
    psi = -pull * inv_cd * bracket
    # psi
    q = -pull * inv_cd * psi_bar
    cd_bar = -2.0 * psi * inv_cd * psi_bar
    p_bar = -inv_cd * inv_cd * bracket * psi_bar
    ci_bar = q - v_bar
    omega_bar += q * s * sd
    back_s, sd_bar = q * sd * omega, q * s * omega
    # ratio
    top_bar = ratio_bar * inv_arm
    arm_bar = -ratio * top_bar
    cd_bar += top_bar + arm_bar
    sd_bar += mu * arm_bar
    mu_bar = sd * arm_bar - d_l * top_bar
    d_bar = -mu * top_bar
    # omega
    q = omega_bar * inv_cd
    p_bar -= s * (top_bar + q)
    back_s -= p_l * (top_bar + q)
    cd_bar += pull * s * q
    # lean of the domino behind
    back_s += cd * s_bar - sd * ci_bar
    c_bar = sd * s_bar + cd * ci_bar
    cd_bar += s * s_bar + c * ci_bar
    sd_bar += c * s_bar - s * ci_bar
    # contact
    sd_bar -= sd * inv_cd * cd_bar
    p_bar -= v * sd_bar
    back_v = -c_bar - p_l * sd_bar
    return back_s, back_v, ShapeBar(p_bar, sd_bar, d_bar), mu_bar, omega, psi, ratio


@overloaded
@internal
def corner_back(s, v, shape, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """`corner` in reverse; the same seven."""
    p_l, s_l, _, d_l = shape
    r2 = s_l * s_l + 2.0 * p_l * d_l * v
    inv_r2 = 1.0 / r2
    inv_r1 = math.sqrt(inv_r2)
    lift = p_l * v - s_l
    slide = lift - mu * p_l * s
    omega, ratio = d_l * lift * inv_r2, d_l * slide * inv_r2
    x = s_l + d_l * v
    fourth = inv_r2 * inv_r2
    psi = p_l * d_l * s * s_l * (p_l + d_l) * fourth
    # psi
    q = psi_bar * fourth
    r2_bar = -(2.0 * psi * psi_bar + omega * omega_bar + ratio * ratio_bar) * inv_r2
    back_s = p_l * d_l * s_l * (p_l + d_l) * q
    p_bar = d_l * s * s_l * (2.0 * p_l + d_l) * q
    d_bar = p_l * s * s_l * (p_l + 2.0 * d_l) * q
    gap_bar = p_l * d_l * s * (p_l + d_l) * q
    # omega and ratio
    o, f = omega_bar * inv_r2, ratio_bar * inv_r2
    d_bar += lift * o + slide * f
    p_bar += d_l * (v * (o + f) - mu * s * f)
    back_v = d_l * p_l * (o + f)
    gap_bar -= d_l * (o + f)
    back_s -= d_l * mu * p_l * f
    mu_bar = -d_l * p_l * s * f
    # lean of the domino behind: sin = x / r1, cos = d s / r1
    x_bar, c_bar = s_bar * inv_r1, -v_bar * inv_r1
    gap_bar += x_bar
    d_bar += v * x_bar + s * c_bar
    back_v += d_l * x_bar
    back_s += d_l * c_bar
    r2_bar -= 0.5 * (x * x_bar + d_l * s * c_bar) * inv_r2
    # contact
    gap_bar += 2.0 * s_l * r2_bar
    p_bar += 2.0 * d_l * v * r2_bar
    d_bar += 2.0 * p_l * v * r2_bar
    back_v += 2.0 * p_l * d_l * r2_bar
    return back_s, back_v, ShapeBar(p_bar, gap_bar, d_bar), mu_bar, omega, psi, ratio


@internal
def link_back_at(link, s, v, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """`link_at` in reverse, for a single angle; the same seven."""
    if link.contact == TIP:
        return tip_back(s, v, shape_of(link), mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar)
    return corner_back(s, v, shape_of(link), mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar)


@overloaded
@always_inline
def add_shape(parts, shape_bar):
    """Add the bars of a link to those of its parts."""
    parts[PART_PITCH] += shape_bar.pitch
    parts[PART_GAP] += shape_bar.gap
    parts[PART_THICK] += shape_bar.thick


@overloaded
@always_inline
def due_back(link, flushed, due_bar, parts):
    """What a link waits for, in reverse."""
    if flushed:  # s / p
        parts[PART_GAP] += due_bar / link.p_l
        parts[PART_PITCH] -= due_bar * link.s_l / (link.p_l * link.p_l)
    else:  # (1 - s²) / 2pd
        parts[PART_GAP] -= due_bar * link.s_l / (link.p_l * link.d_l)
        parts[PART_PITCH] -= due_bar * link.v_release / link.p_l
        parts[PART_THICK] -= due_bar * link.v_release / link.d_l


@overloaded
@always_inline
def hit_angle_back(link, cosine, x_bar, parts):
    """The angle of a hit in reverse: sin θ = s."""
    parts[PART_GAP] += x_bar / cosine
