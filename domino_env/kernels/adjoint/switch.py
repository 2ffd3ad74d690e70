"""Hits and switches, backwards."""

import math

from domino_env.kernels.adjoint.contact import add_shape, due_back, link_back_at, tip_back
from domino_env.kernels.adjoint.slots import (
    FLUSHING,
    PART_GAP,
    PART_INERTIA,
    PART_RISE,
    PART_THICK,
    PARTS,
)
from domino_env.kernels.contact import link_at, pose, shape_of, tip
from domino_env.kernels.jit import internal, leaf
from domino_env.kernels.slots import JAC, SIN, TINY, VER, WGT, is_uneven, rise_of


@leaf
def hit_back(ring, hit, u_bar, mu, parts, whole):
    """`hit` in reverse: bars of u before it and of M."""
    n, u, m_end = hit.leader, hit.u, hit.m
    leader, other = ring[n], ring[n + 1].inertia
    s_l, d_l, e = leader.s_l, leader.d_l, rise_of(leader)
    cd = math.sqrt(leader.rest * (1.0 + s_l))
    up, down = cd - e - mu * d_l, cd + mu * s_l
    f = up / down
    m = m_end * f
    total = m * (1.0 - e / cd) + other
    keep = m / total
    keep_bar = 2.0 * keep * u * u_bar
    m_bar = keep_bar * other / (total * total)
    parts[n + 1, PART_INERTIA] -= keep_bar * m / (total * total)
    omega_bar = -keep_bar * m * m / (total * total)
    up_bar, down_bar = m_end * m_bar / down, -m_end * m_bar * f / down
    cd_bar = up_bar + down_bar + omega_bar * e / (cd * cd)
    parts[n, PART_THICK] -= mu * up_bar
    if is_uneven(leader):
        parts[n, PART_RISE] -= up_bar + omega_bar / cd
    parts[n, PART_GAP] += mu * down_bar - s_l / cd * cd_bar
    whole.friction += s_l * down_bar - d_l * up_bar
    return keep * keep * u_bar, f * m_bar


@internal
def flush_back(trail, ring, switch, u_bar, mu, parts, whole):
    """The impact of a flush in reverse, links that flush being FLUSHING.

    Returns bars of u before it and of the angle.
    """
    n, low, u = switch.leader, switch.low, switch.u
    s, v = pose(switch.angle)
    w, jac = 1.0, 1.0
    trail[0, SIN], trail[0, VER], trail[0, WGT], trail[0, JAC] = s, v, w, jac
    before, after, first = ring[n].inertia, ring[n].inertia, low
    for i in range(n - 1, low - 1, -1):
        link, here = ring[i], trail[n - i]
        s_i, v_i, omega, _, ratio = link_at(link, s, v, mu)
        if link.contact == FLUSHING:
            _, _, omega, _, _ = tip(s, v, shape_of(link), mu)
            first = max(first, i + 1)
        s, v, w, jac = s_i, v_i, w * ratio, jac * omega
        here[SIN], here[VER], here[WGT], here[JAC] = s, v, w, jac
        before += w * link.inertia * jac
        if i >= first:
            after += w * link.inertia * jac
    keep = before / after
    keep_bar = 2.0 * keep * u * u_bar
    before_bar, after_bar = keep_bar / after, -keep_bar * keep / after
    s_bar, v_bar, w_bar, jac_bar = 0.0, 0.0, 0.0, 0.0
    sums = trail[n - low + 1, :PARTS]  # of one link; the trail is one longer than the stack
    for i in range(low, n):
        link, here, above = ring[i], trail[n - i], trail[n - i - 1]
        seed = before_bar + (after_bar if i >= first else 0.0)
        w, jac = here[WGT], here[JAC]
        parts[i, PART_INERTIA] += seed * w * jac
        w_bar += seed * link.inertia * jac
        jac_bar += seed * link.inertia * w
        s, v, w, jac = above[SIN], above[VER], above[WGT], above[JAC]
        o_bar, r_bar = jac_bar * jac, w_bar * w
        o_new = 0.0 if link.contact == FLUSHING else o_bar
        sums[:] = 0.0
        s_bar, v_bar, shape_bar, mu_bar, omega, _, ratio = link_back_at(
            link, s, v, mu, s_bar, v_bar, o_new, 0.0, r_bar
        )
        add_shape(sums, shape_bar)
        if link.contact == FLUSHING:
            s_2, v_2, shape_bar, _, omega, _, _ = tip_back(
                s, v, shape_of(link), mu, 0.0, 0.0, o_bar, 0.0, 0.0
            )
            s_bar, v_bar = s_bar + s_2, v_bar + v_2
            add_shape(sums, shape_bar)
        w_bar, jac_bar = w_bar * ratio, jac_bar * omega
        for c in range(PARTS):
            parts[i, c] += sums[c]
        whole.friction += mu_bar
    parts[n, PART_INERTIA] += before_bar + after_bar
    return keep * keep * u_bar, (1.0 - trail[0, VER]) * s_bar + trail[0, SIN] * v_bar


@internal
def switch_back(trail, ring, switch, x_bar, mu, parts):
    """The angle of a switch in reverse, by the implicit function theorem: at that angle 1 - cos
    θ_{i+1} is what the link waits for."""
    n, due_link = switch.leader, switch.link
    s, v = pose(switch.angle)
    jac = 1.0
    trail[0, SIN], trail[0, VER] = s, v
    for i in range(n - 1, due_link, -1):
        s, v, omega, _, _ = link_at(ring[i], s, v, mu)
        trail[n - i, SIN], trail[n - i, VER] = s, v
        jac *= omega
    rate = s * jac
    if abs(rate) < TINY:
        return  # the link stands still: no angle is the answer, and this one is kept
    due_bar = x_bar / rate
    due_back(ring[due_link], switch.flushed, due_bar, parts[due_link])
    s_bar, v_bar = 0.0, -due_bar
    for i in range(due_link + 1, n):
        above = trail[n - i - 1]
        s_bar, v_bar, shape_bar, _, _, _, _ = link_back_at(
            ring[i], above[SIN], above[VER], mu, s_bar, v_bar, 0.0, 0.0, 0.0
        )
        add_shape(parts[i], shape_bar)
