"""The front of a wave: how a chain begins, and what hits and falls do to u and the time."""

import math

from domino_env.kernels.jit import always_inline, internal
from domino_env.kernels.links import join, most_passed_on, stand
from domino_env.kernels.slots import EPS, is_uneven


@always_inline
def heaviest_force(height, thickness):
    """Largest gravity torque of a domino over its inertia and g (for the bound on the tail)."""
    return 1.5 / math.sqrt(height * height + thickness * thickness)


@internal
def begin(state, push):
    """The state of a chain whose first domino has just been pushed."""
    state.u = push * push
    state.u_error = state.u_round = state.u_impact = 0.0
    state.time = state.time_low = state.time_error = state.time_round = 0.0
    state.worst = state.worst_round = 0.0
    state.angle = state.part = state.fall_time = state.margin = 0.0
    state.lowest_margin = 1.0
    state.switched = state.w_before = state.w_after = state.flush_loss = state.crept = 0.0
    state.m_end = state.cut = state.kappa = state.noise = state.log_rho = state.last_h = 0.0
    state.gain, state.offset, state.need, state.composing = 1.0, 0.0, 0.0, False
    state.back = state.depth = state.last_due = 0
    state.flushes = state.releases = state.taped = 0


@internal
def open_chain(row, push, ring, state):
    """The first domino stands and has been pushed."""
    begin(state, push)
    stand(ring, 0, 0, row, 0)
    state.kappa = heaviest_force(row.height[0], row.thickness[0])


@always_inline
def place(row, ring, mask, n, state):
    """Stand domino n+1, if there is one, in front of leader n."""
    if n + 1 < len(row.thickness):
        stand(ring, mask, n + 1, row, n + 1)
        join(ring, mask, n, row, n, n + 1)
        torque = heaviest_force(row.height[n + 1], row.thickness[n + 1])
        state.kappa = max(state.kappa, torque)


@always_inline
def lengthen_tail(ring, mask, n):
    """A bound on what lies behind leader n, from that of the one before."""
    if n > 0:
        behind = ring[(n - 1) & mask]
        ring[n & mask].tail = ring[n & mask].inertia + most_passed_on(behind) * behind.tail


@always_inline
def grain(leader, mu, depth):
    """By how many roundings of a leader's torque an interval may be off.

    Without friction u is a difference of energies.  On uneven ground a lean is not small where a
    gap is, and each link passes its rounding to all behind it.
    """
    return 8.0 + 8.0 * depth if is_uneven(leader) and mu == 0.0 else 8.0


@always_inline
def begin_fall(leader, mu, gravity, state):
    """Nothing of the fall is done; returns u at release."""
    state.noise = grain(leader, mu, state.depth) * EPS * gravity * state.kappa
    state.fall_time = 0.0
    state.margin = state.u
    return state.u


@always_inline
def slow_down(state, keep):
    """An impact leaves the leader the part `keep` of its angular velocity."""
    k2 = keep * keep
    state.u *= k2
    state.u_error *= k2
    state.u_round *= k2
    state.gain *= k2
    state.offset *= k2


@internal
def add_time(state):
    """Add the time of the last fall; compensated, so that a million falls add up exactly."""
    y = state.fall_time - state.time_low
    total = state.time + y
    state.time_low = (total - state.time) - y
    state.time = total
    state.worst = max(state.worst, state.time_error / total)
    state.worst_round = max(state.worst_round, state.time_round / total)
