"""Contacts, hits and bodies over hills, backwards."""

import math

from domino_env.kernels.adjoint import chain, contact, stack, switch
from domino_env.kernels.adjoint.slots import (
    B_GAP,
    B_PITCH,
    B_RISE,
    B_THICK,
    B_TURN,
    PART_GAP,
    PART_HALF,
    PART_INERTIA,
    PART_PITCH,
    PART_RISE,
    PART_SLENDER,
    PART_THICK,
    PART_TURN,
    HillShapeBar,
)
from domino_env.kernels.jit import always_inline, internal, overload
from domino_env.kernels.slots import TINY


@overload(contact.tip_back)
@internal
def tip_back(s, v, shape, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """`tip` in reverse: bars of s, v, the link, μ; and Ω, Ψ, B/A again."""
    p, s_l, rest, d_l, e, turn_s, turn_v = shape
    c, lost = 1.0 - v, p * v + e * s
    sd = s_l - lost
    cd2 = (1.0 + sd) * (rest + lost)
    cd = math.sqrt(cd2 if cd2 > TINY else TINY)
    arm = cd + mu * sd
    r = 1.0 / (cd * arm)
    inv_cd, inv_arm = r * arm, r * cd
    q, f = p * s + e * c, p * c - e * s
    pull = q * inv_cd
    omega = 1.0 - pull
    ratio = (cd - q - mu * d_l) * inv_arm
    psi = (sd * pull * pull - f) * inv_cd
    s_0, c_0 = s * cd + c * sd, c * cd - s * sd
    s_i = s_0 - (s_0 * turn_v + c_0 * turn_s)
    c_i = c_0 - c_0 * turn_v + s_0 * turn_s
    # the turn
    turn_bar = -c_i * s_bar - s_i * v_bar
    s0_bar = s_bar - s_bar * turn_v - v_bar * turn_s
    c0_bar = -v_bar + v_bar * turn_v - s_bar * turn_s
    # psi
    f_bar = -inv_cd * psi_bar
    cd_bar = psi * f_bar
    sd_bar = -pull * pull * f_bar
    pull_bar = -2.0 * sd * pull * f_bar - omega_bar
    # ratio
    top_bar = ratio_bar * inv_arm
    arm_bar = -ratio * top_bar
    cd_bar += top_bar + arm_bar
    sd_bar += mu * arm_bar
    mu_bar = sd * arm_bar - d_l * top_bar
    # omega
    q_bar = pull_bar * inv_cd - top_bar
    cd_bar -= pull * inv_cd * pull_bar
    # lean of the domino behind
    back_s = cd * s0_bar - sd * c0_bar
    c_bar = sd * s0_bar + cd * c0_bar
    cd_bar += s * s0_bar + c * c0_bar
    sd_bar += c * s0_bar - s * c0_bar
    # contact
    sd_bar -= sd * inv_cd * cd_bar
    back_s += p * q_bar - e * (sd_bar + f_bar)
    c_bar += e * q_bar + p * f_bar
    p_bar = s * q_bar + c * f_bar - v * sd_bar
    e_bar = c * q_bar - s * (f_bar + sd_bar)
    shape_bar = HillShapeBar(p_bar, sd_bar, -mu * top_bar, e_bar, turn_bar)
    return back_s, -c_bar - p * sd_bar, shape_bar, mu_bar, omega, psi, ratio


@overload(contact.corner_back)
@internal
def corner_back(s, v, shape, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """`corner` in reverse; the same seven."""
    p, s_l, _, d_l, e, turn_s, turn_v = shape
    c, lost = 1.0 - v, p * v + e * s
    r2 = s_l * s_l + e * e + 2.0 * d_l * lost
    inv_r2 = 1.0 / r2
    inv_r1 = math.sqrt(inv_r2)
    lift, q = lost - s_l, p * s + e * c
    slide, far = lift - mu * q, s_l * (p + d_l) + e * e
    omega, ratio = d_l * lift * inv_r2, d_l * slide * inv_r2
    psi = d_l * q * far * (inv_r2 * inv_r2)
    s_0, c_0 = (s_l + d_l * v) * inv_r1, (e + d_l * s) * inv_r1
    s_i = s_0 - (s_0 * turn_v + c_0 * turn_s)
    c_i = c_0 - c_0 * turn_v + s_0 * turn_s
    # the turn
    turn_bar = -c_i * s_bar - s_i * v_bar
    s0_bar = s_bar - s_bar * turn_v - v_bar * turn_s
    c0_bar = -v_bar + v_bar * turn_v - s_bar * turn_s
    # lean of the domino behind: x / r1, y / r1
    x_bar, y_bar = s0_bar * inv_r1, c0_bar * inv_r1
    r2_bar = -0.5 * (s_0 * s0_bar + c_0 * c0_bar) * inv_r2
    # psi
    z = psi_bar * inv_r2 * inv_r2
    d_bar, q_bar, far_bar = q * far * z, d_l * far * z, d_l * q * z
    # omega and ratio
    r2_bar -= (2.0 * psi * psi_bar + omega * omega_bar + ratio * ratio_bar) * inv_r2
    o, f = omega_bar * inv_r2, ratio_bar * inv_r2
    d_bar += lift * o + slide * f
    lift_bar = d_l * (o + f)
    q_bar -= mu * d_l * f
    mu_bar = -q * d_l * f
    # contact
    lost_bar = lift_bar + 2.0 * d_l * r2_bar
    d_bar += 2.0 * lost * r2_bar + s_l * far_bar + v * x_bar + s * y_bar
    gap_bar = 2.0 * s_l * r2_bar + (p + d_l) * far_bar + x_bar - lift_bar
    p_bar = s_l * far_bar + v * lost_bar + s * q_bar
    e_bar = 2.0 * e * (r2_bar + far_bar) + y_bar + s * lost_bar + c * q_bar
    back_s = d_l * y_bar + e * lost_bar + p * q_bar
    back_v = d_l * x_bar + p * lost_bar - e * q_bar
    shape_bar = HillShapeBar(p_bar, gap_bar, d_bar, e_bar, turn_bar)
    return back_s, back_v, shape_bar, mu_bar, omega, psi, ratio


@overload(contact.add_shape)
@always_inline
def add_shape(parts, shape_bar):
    """Add the bars of a link to those of its parts."""
    parts[PART_PITCH] += shape_bar.pitch
    parts[PART_GAP] += shape_bar.gap
    parts[PART_THICK] += shape_bar.thick
    parts[PART_RISE] += shape_bar.rise
    parts[PART_TURN] += shape_bar.turn


@overload(contact.due_back)
@always_inline
def due_back(link, flushed, due_bar, parts):
    """What a link waits for, in reverse: s = p v + e sin θ, or √R = L."""
    v, p, e, d = link.v_flush if flushed else link.v_release, link.p_l, link.rise_l, link.d_l
    s = math.sqrt(v * (2.0 - v))
    q = p * s + e * (1.0 - v)
    if flushed:
        x = due_bar * s / q
        parts[PART_GAP] += x
        parts[PART_PITCH] -= v * x
        parts[PART_RISE] -= s * x
    else:
        x = due_bar * s / (d * q)
        parts[PART_GAP] -= link.s_l * x
        parts[PART_PITCH] -= d * v * x
        parts[PART_THICK] -= (p * v + e * s) * x
        parts[PART_RISE] -= (e + d * s) * x


@overload(contact.hit_angle_back)
@always_inline
def hit_angle_back(link, cosine, x_bar, parts):
    """The angle of a hit in reverse: sin(θ + β) = s."""
    parts[PART_GAP] += x_bar / math.sqrt(link.rest * (1.0 + link.s_l))
    parts[PART_TURN] -= x_bar


@overload(stack.keep_shape)
@always_inline
def keep_shape(bars, j, shape_bar):
    """Write the bars of a link into its lane."""
    bars[B_PITCH + j], bars[B_GAP + j], bars[B_THICK + j] = shape_bar.pitch, shape_bar.gap, shape_bar.thick  # noqa: E501  # fmt: skip
    bars[B_RISE + j], bars[B_TURN + j] = shape_bar.rise, shape_bar.turn


@overload(stack.no_shape)
@always_inline
def no_shape(bars, j, domino):
    """The leader has no link."""
    bars[B_PITCH + j], bars[B_GAP + j], bars[B_THICK + j] = 0.0, 0.0, 0.0
    bars[B_RISE + j], bars[B_TURN + j] = 0.0, 0.0


@overload(stack.parts_of)
@always_inline
def parts_of(link):
    """How many parts there are bars of."""
    return 8


@overload(stack.gather_shape)
@always_inline
def gather_shape(bars, count, domino, parts):
    """`gather`, of its link."""
    p, s, d, e, turn = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        p += bars[B_PITCH + j]
        s += bars[B_GAP + j]
        d += bars[B_THICK + j]
        e += bars[B_RISE + j]
        turn += bars[B_TURN + j]
    parts[PART_PITCH] += p
    parts[PART_GAP] += s
    parts[PART_THICK] += d
    parts[PART_RISE] += e
    parts[PART_TURN] += turn


@overload(switch.hit_back)
@internal
def hit_back(ring, hit, u_bar, mu, parts, whole):
    """`hit` in reverse: bars of u before it and of M."""
    n, u, m_end = hit.leader, hit.u, hit.m
    leader, other = ring[n], ring[n + 1].inertia
    s_l, d_l, e = leader.s_l, leader.d_l, leader.rise_l
    cd = math.sqrt(leader.rest * (1.0 + s_l))
    up, down = cd - e - mu * d_l, cd + mu * s_l
    f = up / down
    m = m_end * f
    total = m * (1.0 - e / cd) + other
    keep = m / total
    keep_bar = 2.0 * keep * u * u_bar
    x = keep_bar / (total * total)
    m_bar = x * other
    parts[n + 1, PART_INERTIA] -= x * m
    omega_bar = -x * m * m
    up_bar, down_bar = m_end * m_bar / down, -m_end * m_bar * f / down
    cd_bar = up_bar + down_bar + omega_bar * e / (cd * cd)
    parts[n, PART_THICK] -= mu * up_bar
    parts[n, PART_RISE] -= up_bar + omega_bar / cd
    parts[n, PART_GAP] += mu * down_bar - s_l / cd * cd_bar
    whole.friction += s_l * down_bar - d_l * up_bar
    return keep * keep * u_bar, f * m_bar


@overload(chain.bodies_back)
@internal
def bodies_back(row, ring, parts, bar):
    """From the bars of links and bodies to those of all that the row is made of."""
    count = len(row.thickness)
    bar.tilt[:] = 0.0
    for i in range(count):
        slender, tilt, domino = row.thickness[i] / row.height[i], row.tilt[i], ring[i]
        s, c = math.sin(tilt), math.cos(tilt)
        half_bar, slender_bar = parts[i, PART_HALF], parts[i, PART_SLENDER]
        half = 0.5 * row.density[i] * row.height[i] * row.height[i] * row.thickness[i]
        turned = 1.0 + domino.slender * domino.slender  # of tan(φ - α)
        bar.tilt[i] += half * (slender * c - s) * half_bar - turned * slender_bar
        parts[i, PART_HALF] = (c + slender * s) * half_bar
        parts[i, PART_SLENDER] = turned / (1.0 + slender * slender) * slender_bar
        parts[i, PART_SLENDER] += half * s * half_bar
        if i + 1 < count:
            bar.tilt[i] += parts[i, PART_TURN]
    for i in range(count - 1):
        e_bar, tilt = parts[i, PART_RISE] / row.height[i], row.tilt[i + 1]
        tan, sec = math.tan(tilt), 1.0 / math.cos(tilt)
        pitch, rise = row.spacing[i] + row.thickness[i + 1], row.rise[i]
        bar.rise[i] = sec * e_bar
        bar.tilt[i + 1] += (pitch * sec + rise * tan) * sec * e_bar - parts[i, PART_TURN]
        parts[i, PART_PITCH] += tan * parts[i, PART_RISE]
    chain.bodies_flat(row, ring, parts, bar)
    for i in range(count - 1):
        upright = row.rise[i] / math.cos(row.tilt[i + 1])
        bar.height[i] -= upright * parts[i, PART_RISE] / (row.height[i] * row.height[i])
