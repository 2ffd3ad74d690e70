"""A row without end that repeats a pattern: one period of falls, as a map or as a wave."""

import math

import numpy as np

from domino_env.kernels.fall import step
from domino_env.kernels.front import begin, heaviest_force
from domino_env.kernels.jit import entry_point, internal, keep_alive
from domino_env.kernels.links import join, new_ring, stand
from domino_env.kernels.slots import EVENT, LANES, PROPAGATED, STATE


@internal
def repeat_behind(ring, mask, n, pattern, state):
    """Fill the ring with a pattern of P dominoes, repeated for ever behind leader n."""
    period = len(pattern.thickness)
    state.back = 0
    for i in range(n - mask, n + 2):
        j, ahead = i % period, (i + 1) % period
        stand(ring, mask, i, pattern, j)
        join(ring, mask, i, pattern, j, ahead)
        domino = ring[i & mask]
        domino.tail = domino.inertia * (i - n + mask + 2)


@entry_point
def period_falls(pattern, mu, gravity, rtol, ring_rows, u, falls):
    """The P falls of one period of an endless row, each with the stack of all that fell before.

    pattern: a `Row` of P gaps and P dominoes.  ring_rows: dominoes remembered, a power of two.
    u > 0: ride a wave that enters with u; falls (P,) are written.  u = 0: compose their maps.
    Returns (outcome, leader, largest tail left beyond the ring, gain, offset, need).
    """
    period, mask = len(pattern.thickness), ring_rows - 1
    own_state = np.zeros(1, STATE)
    lanes, ring, state = np.zeros(LANES), new_ring(pattern, ring_rows), own_state[0]
    untaped = np.empty(0, EVENT)
    begin(state, 1.0)
    state.u = u
    state.composing = u == 0.0
    for j in range(period):
        torque = heaviest_force(pattern.height[j], pattern.thickness[j])
        state.kappa = max(state.kappa, torque)
    base = period * (1 + 2 * (mask + 1) // period)
    outcome, leader, tail = PROPAGATED, period, 0.0
    for j in range(period):
        n = base + j
        repeat_behind(ring, mask, n, pattern, state)
        state.depth = 0
        released = state.u
        outcome = step(lanes, ring, mask, n, True, mu, gravity, rtol, state, True, untaped)
        if outcome != PROPAGATED:
            leader = j
            break
        tail = max(tail, state.cut)
        if u > 0.0:
            falls[j].time = state.fall_time
            falls[j].release = math.sqrt(released)
            falls[j].impact = math.sqrt(state.u_impact)
    gain, offset, need = state.gain, state.offset, state.need
    keep_alive(own_state)
    keep_alive(ring)
    return outcome, leader, tail, gain, offset, need
