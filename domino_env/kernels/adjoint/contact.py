"""Reverse mode of contacts, hits and changes of contact, and its working arrays."""

import math
from typing import Any, NamedTuple

from domino_env.kernels import arrays
from domino_env.kernels.arrays import JAC, SIN, STRIDE, VER, WGT, is_uneven, rise_of
from domino_env.kernels.contact import contact_at, shape_of, sin_versine, tip
from domino_env.kernels.jit import always_inline, internal, leaf

# Lanes of bars: those of the five numbers that are propagated down the stack; seeds, which are the
# bars of the three sums; that of friction; those of the parameters of one domino and its contact,
# in the order of PARAM_PITCH and so on.
B_SIN, B_VER, B_WGT, B_JAC, B_DRV = 0 * STRIDE, 1 * STRIDE, 2 * STRIDE, 3 * STRIDE, 4 * STRIDE
SEED_M, SEED_G, SEED_D, B_MU = 5 * STRIDE, 6 * STRIDE, 7 * STRIDE, 8 * STRIDE
B_PITCH, B_GAP, B_THICKNESS = 9 * STRIDE, 10 * STRIDE, 11 * STRIDE  # of p, s, d
B_INERTIA, B_HALF, B_TAN_PHI = 12 * STRIDE, 13 * STRIDE, 14 * STRIDE
B_RISE, B_TURN = 15 * STRIDE, 16 * STRIDE  # of e and β, on uneven ground
BARS = 17 * STRIDE

# Parameters of each domino: p, s, d of its contact (in units of L_i), its inertia, half weight and
# tan_phi; on uneven ground e and β too. Their bars are a plain array, so that sums vectorise.
PARAM_PITCH, PARAM_GAP, PARAM_THICKNESS, PARAM_INERTIA, PARAM_HALF, PARAM_TAN_PHI = range(6)
PARAM_RISE, PARAM_TURN = 6, 7
PARAMS = 8  # on flat ground two are unused


class ShapeBar(NamedTuple):
    """Bars of the geometry of a contact."""

    pitch: float
    gap: float
    thickness: float
    rise: float
    turn: float


# of all members but the last, rtol
PHYSICS_BAR = arrays.record_type(None, **dict.fromkeys(arrays.Setting._fields[:-1], float))

FLUSHING = 3  # a contact in its face impact: tip contact before, corner contact after


class Reverse(NamedTuple):
    """Arrays and setting of reverse mode, which its functions pass on together."""

    ring: Any  # all dominoes of the chain
    setting: arrays.Setting
    lanes: Any
    bars: Any  # lanes of bars
    saved: Any  # lanes at every domino of a stack
    param_bars: Any  # (N, PARAMS)
    physics_bar: Any  # a PHYSICS_BAR


@leaf
def tip_back(s, v, shape, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """Return bars of s, v, shape and μ from those of the results of `tip`; and Ω, Ψ, B/A again."""
    p_l, s_l, rest, d_l, e, turn_s, turn_v, _ = shape
    lost = p_l * v + e * s
    sd = s_l - lost
    cd2 = (1.0 + sd) * (rest + lost)
    cd = math.sqrt(cd2 if cd2 > arrays.TINY else arrays.TINY)
    arm = cd + mu * sd
    r = 1.0 / (cd * arm)
    inv_cd, inv_arm = r * arm, r * cd
    c = 1.0 - v
    c_0, s_0 = c * cd - s * sd, s * cd + c * sd
    p_cd, rise = p_l * inv_cd, e * inv_cd
    omega = 1.0 - (p_cd * s + rise * c)
    ratio = (cd - p_l * s - e * c - mu * d_l) * inv_arm
    bracket, by_rise = c_0 + s * sd * omega, s_0 - c * sd * omega
    psi = -p_cd * inv_cd * bracket + rise * inv_cd * by_rise
    # rotation by the turn
    s_i = s_0 - (s_0 * turn_v + c_0 * turn_s)
    c_i = c_0 - c_0 * turn_v + s_0 * turn_s
    turn_bar = -c_i * s_bar - s_i * v_bar
    s0_bar = s_bar - s_bar * turn_v - v_bar * turn_s
    c0_bar = v_bar * turn_v - v_bar - s_bar * turn_s
    # psi
    q, f = -p_cd * inv_cd * psi_bar, rise * inv_cd * psi_bar
    cd_bar = -2.0 * psi * inv_cd * psi_bar
    p_bar = -inv_cd * inv_cd * bracket * psi_bar
    e_bar = inv_cd * inv_cd * by_rise * psi_bar
    c0_bar += q
    s0_bar += f
    omega_bar += q * s * sd - f * c * sd
    back_s, sd_bar = q * sd * omega, q * s * omega - f * c * omega
    c_bar = -f * sd * omega
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
    e_bar -= c * (top_bar + q)
    back_s -= p_l * (top_bar + q)
    c_bar -= e * (top_bar + q)
    cd_bar += p_cd * s * q + rise * c * q
    # lean of the domino behind
    back_s += cd * s0_bar - sd * c0_bar
    c_bar += sd * s0_bar + cd * c0_bar
    cd_bar += s * s0_bar + c * c0_bar
    sd_bar += c * s0_bar - s * c0_bar
    # contact
    sd_bar -= sd * inv_cd * cd_bar
    p_bar -= v * sd_bar
    e_bar -= s * sd_bar
    back_s -= e * sd_bar
    shape_bar = ShapeBar(p_bar, sd_bar, d_bar, e_bar, turn_bar)
    return back_s, -c_bar - p_l * sd_bar, shape_bar, mu_bar, omega, psi, ratio


@leaf
def corner_back(s, v, shape, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """Return the seven values of `tip_back` for `corner`."""
    p_l, s_l, _, d_l, e, turn_s, turn_v, _ = shape
    r2 = s_l * s_l + 2.0 * p_l * d_l * v + e * (e + 2.0 * d_l * s)
    inv_r2 = 1.0 / r2
    inv_r1 = math.sqrt(inv_r2)
    lift, c = p_l * v + e * s - s_l, 1.0 - v
    slide = lift - mu * p_l * s - mu * e * c
    omega, ratio = d_l * lift * inv_r2, d_l * slide * inv_r2
    x, y = s_l + d_l * v, d_l * s + e
    fourth = inv_r2 * inv_r2
    far = s_l * (p_l + d_l) + e * e
    bend = p_l * d_l * s * s_l * (p_l + d_l) + e * d_l * (p_l * s * e + c * far)
    psi = bend * fourth
    # rotation by the turn
    s_0, c_0 = x * inv_r1, y * inv_r1
    s_i = s_0 - (s_0 * turn_v + c_0 * turn_s)
    c_i = c_0 - c_0 * turn_v + s_0 * turn_s
    turn_bar = -c_i * s_bar - s_i * v_bar
    s0_bar = s_bar - s_bar * turn_v - v_bar * turn_s
    c0_bar = v_bar * turn_v - v_bar - s_bar * turn_s
    # psi
    q = psi_bar * fourth
    r2_bar = -(2.0 * psi * psi_bar + omega * omega_bar + ratio * ratio_bar) * inv_r2
    back_s = p_l * d_l * s_l * (p_l + d_l) * q + e * d_l * p_l * e * q
    p_bar = d_l * s * s_l * (2.0 * p_l + d_l) * q + e * d_l * (s * e + c * s_l) * q
    d_bar = p_l * s * s_l * (p_l + 2.0 * d_l) * q + e * (p_l * s * e + c * (far + d_l * s_l)) * q
    gap_bar = p_l * d_l * s * (p_l + d_l) * q + e * d_l * c * (p_l + d_l) * q
    e_bar = d_l * (2.0 * p_l * s * e + c * (far + 2.0 * e * e)) * q
    c_bar = e * d_l * far * q
    # omega and ratio
    o, f = omega_bar * inv_r2, ratio_bar * inv_r2
    d_bar += lift * o + slide * f
    p_bar += d_l * (v * (o + f) - mu * s * f)
    e_bar += d_l * (s * (o + f) - mu * c * f)
    back_v = d_l * p_l * (o + f)
    gap_bar -= d_l * (o + f)
    back_s -= d_l * mu * p_l * f - e * d_l * (o + f)
    c_bar -= e * d_l * mu * f
    mu_bar = -d_l * p_l * s * f - e * d_l * c * f
    # lean of the domino behind: sin = x / r1, cos = y / r1
    x_bar, y_bar = s0_bar * inv_r1, c0_bar * inv_r1
    gap_bar += x_bar
    d_bar += v * x_bar + s * y_bar
    e_bar += y_bar
    back_v += d_l * x_bar
    back_s += d_l * y_bar
    r2_bar -= 0.5 * (x * x_bar + d_l * s * y_bar + e * y_bar) * inv_r2
    # contact
    gap_bar += 2.0 * s_l * r2_bar
    p_bar += 2.0 * d_l * v * r2_bar
    d_bar += 2.0 * p_l * v * r2_bar + 2.0 * e * s * r2_bar
    e_bar += 2.0 * y * r2_bar
    back_v += 2.0 * p_l * d_l * r2_bar
    back_s += 2.0 * e * d_l * r2_bar
    shape_bar = ShapeBar(p_bar, gap_bar, d_bar, e_bar, turn_bar)
    return back_s, back_v - c_bar, shape_bar, mu_bar, omega, psi, ratio


@internal
def contact_back_at(contact, s, v, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """Return the seven values of `tip_back` for a contact of either kind, at a single angle."""
    if contact.kind == arrays.TIP:
        return tip_back(s, v, shape_of(contact), mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar)
    return corner_back(s, v, shape_of(contact), mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar)


@always_inline
def add_shape(param_bars, shape_bar):
    """Add the bars of a shape to those of the parameters."""
    param_bars[PARAM_PITCH] += shape_bar.pitch
    param_bars[PARAM_GAP] += shape_bar.gap
    param_bars[PARAM_THICKNESS] += shape_bar.thickness
    param_bars[PARAM_RISE] += shape_bar.rise
    param_bars[PARAM_TURN] += shape_bar.turn


@always_inline
def due_back(contact, flushed, due_bar, param_bars):
    """Propagate the bar of the angle at which a contact changes: s = p v + e sin θ, or √R = L."""
    v = contact.v_flush if flushed else contact.v_separation
    p, e, d = contact.p_l, rise_of(contact), contact.d_l
    if e == 0.0:
        if flushed:  # v = s / p
            param_bars[PARAM_GAP] += due_bar / p
            param_bars[PARAM_PITCH] -= due_bar * contact.s_l / (p * p)
        else:  # v = (1 - s²) / 2pd
            param_bars[PARAM_GAP] -= due_bar * contact.s_l / (p * d)
            param_bars[PARAM_PITCH] -= due_bar * v / p
            param_bars[PARAM_THICKNESS] -= due_bar * v / d
    if not is_uneven(contact):
        return
    s = math.sqrt(v * (2.0 - v))
    q = p * s + e * (1.0 - v)
    if flushed:
        x = due_bar * s / q
        if e != 0.0:
            param_bars[PARAM_GAP] += x
            param_bars[PARAM_PITCH] -= v * x
        param_bars[PARAM_RISE] -= s * x
    else:
        x = due_bar * s / (d * q)
        if e != 0.0:
            param_bars[PARAM_GAP] -= contact.s_l * x
            param_bars[PARAM_PITCH] -= d * v * x
            param_bars[PARAM_THICKNESS] -= (p * v + e * s) * x
        param_bars[PARAM_RISE] -= (e + d * s) * x


@always_inline
def hit_angle_back(cosine, x_bar, param_bars):
    """Propagate the bar of the angle of a hit, sin(θ + β) = s; cosine: cos(θ + β)."""
    param_bars[PARAM_GAP] += x_bar / cosine
    param_bars[PARAM_TURN] -= x_bar


@leaf
def hit_back(reverse, event, u_bar):
    """Propagate the bar of u over a hit; return bars of u and M before it."""
    ring, mu, param_bars = reverse.ring, reverse.setting.friction, reverse.param_bars
    n, u, m_end = event.leader, event.u, event.m
    leader, next_inertia = ring[n], ring[n + 1].inertia
    s_l, d_l, e = leader.s_l, leader.d_l, rise_of(leader)
    cd = math.sqrt(leader.rest * (1.0 + s_l))
    up, down = cd - e - mu * d_l, cd + mu * s_l
    f = up / down
    m = m_end * f
    total = m * (1.0 - e / cd) + next_inertia
    keep = m / total
    keep_bar = 2.0 * keep * u * u_bar
    m_bar = keep_bar * next_inertia / (total * total)
    param_bars[n + 1, PARAM_INERTIA] -= keep_bar * m / (total * total)
    omega_bar = -keep_bar * m * m / (total * total)
    up_bar, down_bar = m_end * m_bar / down, -m_end * m_bar * f / down
    cd_bar = up_bar + down_bar + omega_bar * e / (cd * cd)
    param_bars[n, PARAM_THICKNESS] -= mu * up_bar
    if is_uneven(leader):
        param_bars[n, PARAM_RISE] -= up_bar + omega_bar / cd
    param_bars[n, PARAM_GAP] += mu * down_bar - s_l / cd * cd_bar
    reverse.physics_bar.friction += s_l * down_bar - d_l * up_bar
    return keep * keep * u_bar, f * m_bar


@internal
def flush_back(reverse, event, u_bar):
    """Propagate the bar of u over a face impact; return bars of u before it and of its angle.

    The contacts whose faces meet are FLUSHING.
    """
    ring, saved, param_bars = reverse.ring, reverse.saved, reverse.param_bars
    mu, n, low, u = reverse.setting.friction, event.leader, event.low, event.u
    s, v = sin_versine(event.angle)
    w, jac = 1.0, 1.0
    saved[0, SIN], saved[0, VER], saved[0, WGT], saved[0, JAC] = s, v, w, jac
    m_before, m_after, first = ring[n].inertia, ring[n].inertia, low
    for i in range(n - 1, low - 1, -1):
        contact, here = ring[i], saved[n - i]
        s_i, v_i, omega, _, ratio = contact_at(contact, s, v, mu)
        if contact.kind == FLUSHING:
            _, _, omega, _, _ = tip(s, v, shape_of(contact), mu)
            first = max(first, i + 1)
        s, v, w, jac = s_i, v_i, w * ratio, jac * omega
        here[SIN], here[VER], here[WGT], here[JAC] = s, v, w, jac
        m_before += w * contact.inertia * jac
        if i >= first:
            m_after += w * contact.inertia * jac
    keep = m_before / m_after
    keep_bar = 2.0 * keep * u * u_bar
    m_before_bar, m_after_bar = keep_bar / m_after, -keep_bar * keep / m_after
    s_bar, v_bar, w_bar, jac_bar = 0.0, 0.0, 0.0, 0.0
    sums = saved[n - low + 1, :PARAMS]  # of one contact; `saved` has one line more than the stack
    for i in range(low, n):
        contact, here, above = ring[i], saved[n - i], saved[n - i - 1]
        seed = m_before_bar + (m_after_bar if i >= first else 0.0)
        w, jac = here[WGT], here[JAC]
        param_bars[i, PARAM_INERTIA] += seed * w * jac
        w_bar += seed * contact.inertia * jac
        jac_bar += seed * contact.inertia * w
        s, v, w, jac = above[SIN], above[VER], above[WGT], above[JAC]
        o_bar, r_bar = jac_bar * jac, w_bar * w
        o_new = 0.0 if contact.kind == FLUSHING else o_bar
        arrays.set_zero(sums)
        s_bar, v_bar, shape_bar, mu_bar, omega, _, ratio = contact_back_at(
            contact, s, v, mu, s_bar, v_bar, o_new, 0.0, r_bar
        )
        add_shape(sums, shape_bar)
        if contact.kind == FLUSHING:
            s_2, v_2, shape_bar, _, omega, _, _ = tip_back(
                s, v, shape_of(contact), mu, 0.0, 0.0, o_bar, 0.0, 0.0
            )
            s_bar, v_bar = s_bar + s_2, v_bar + v_2
            add_shape(sums, shape_bar)
        w_bar, jac_bar = w_bar * ratio, jac_bar * omega
        for c in range(PARAMS):
            param_bars[i, c] += sums[c]
        reverse.physics_bar.friction += mu_bar
    param_bars[n, PARAM_INERTIA] += m_before_bar + m_after_bar
    return keep * keep * u_bar, (1.0 - saved[0, VER]) * s_bar + saved[0, SIN] * v_bar


@internal
def switch_back(reverse, event, x_bar):
    """Propagate the bar of the angle of a change of contact, by the implicit function theorem."""
    ring, saved, param_bars = reverse.ring, reverse.saved, reverse.param_bars
    mu, n, due_contact = reverse.setting.friction, event.leader, event.contact
    s, v = sin_versine(event.angle)
    jac = 1.0
    saved[0, SIN], saved[0, VER] = s, v
    for i in range(n - 1, due_contact, -1):
        s, v, omega, _, _ = contact_at(ring[i], s, v, mu)
        saved[n - i, SIN], saved[n - i, VER] = s, v
        jac *= omega
    rate = s * jac
    if abs(rate) < arrays.TINY:
        return  # the contact does not move, so the angle of its change is not determined
    due_bar = x_bar / rate
    due_back(ring[due_contact], event.is_flush, due_bar, param_bars[due_contact])
    s_bar, v_bar = 0.0, -due_bar
    for i in range(due_contact + 1, n):
        above = saved[n - i - 1]
        s_bar, v_bar, shape_bar, _, _, _, _ = contact_back_at(
            ring[i], above[SIN], above[VER], mu, s_bar, v_bar, 0.0, 0.0, 0.0
        )
        add_shape(param_bars[i], shape_bar)
