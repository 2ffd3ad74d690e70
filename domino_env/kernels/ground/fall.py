"""The angle of a hit, and what it does, over hills."""

import math

from domino_env.kernels import fall as flat
from domino_env.kernels import front
from domino_env.kernels.front import slow_down
from domino_env.kernels.jit import always_inline, overload
from domino_env.kernels.slots import EPS, JAMMED, PROPAGATED


@overload(flat.hit_ratio)
@always_inline
def hit_ratio(leader):
    """Ω of the leader at the instant at which it hits the next: how its J continues."""
    return 1.0 - leader.rise_l / math.sqrt(leader.rest * (1.0 + leader.s_l))


@overload(flat.hit)
@always_inline
def hit(leader, struck, mu, state):
    """The leader, at its hitting angle, strikes the next, and turns on Ω_n times as fast."""
    s_l, e = leader.s_l, leader.rise_l
    cd = math.sqrt(leader.rest * (1.0 + s_l))
    m = state.m_end * (cd - e - mu * leader.d_l) / (cd + mu * s_l)
    if not m > 0.0:
        return JAMMED
    slow_down(state, m / (m * hit_ratio(leader) + struck.inertia))
    state.u_error += (4.0 * EPS + 2.0 * state.cut) * state.u
    state.u_round += 4.0 * EPS * state.u
    return PROPAGATED


@overload(front.grain)
@always_inline
def grain(leader, mu, depth):
    """By how many roundings of a leader's torque an interval may be off.

    Without friction u is a difference of energies.  Over hills a lean is not small where a gap is,
    and each link hands its rounding to all behind it.
    """
    return 8.0 + 8.0 * depth if mu == 0.0 else 8.0


@overload(flat.fall_angle)
@always_inline
def fall_angle(leader, strikes):
    """Angle at which the leader hits the next, or, where there is none in reach, tips over."""
    if strikes:
        s_l = leader.s_l
        return math.atan2(s_l, math.sqrt(leader.rest * (1.0 + s_l))) - leader.turn
    return math.atan(leader.slender)
