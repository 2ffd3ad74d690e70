"""A chain looked at many times in each fall, for those who watch."""

import math

import numpy as np

from domino_env.kernels.chain import ring_size
from domino_env.kernels.fall import close_fall, fall, fall_angle
from domino_env.kernels.front import begin_fall, lengthen_tail, open_chain, place
from domino_env.kernels.jit import entry_point, keep_alive
from domino_env.kernels.links import new_ring
from domino_env.kernels.slots import EVENT, LANES, PROPAGATED, STATE, TINY

FLOOR = 1.55  # [rad] where the last leader is left, all but flat


@entry_point
def watch_chain(row, mu, gravity, push, rtol, snapshots):
    """A chain looked at in equal steps of angle in every fall; returns how many falls there were.

    snapshots: (N, looks + 1) leader's angle, time since it was hit, and its angular velocity.  A
    leader that strikes nothing falls on to FLOOR; one that stalls is left where it stops.
    """
    count, pieces = len(row.thickness), snapshots.shape[1] - 1
    own_state, ring = np.zeros(1, STATE), new_ring(row, ring_size(count))
    lanes, state, mask = np.zeros(LANES), own_state[0], len(ring) - 1
    untaped = np.empty(0, EVENT)
    open_chain(row, push, ring, state)
    falls = 0
    for n in range(count):
        falls = n + 1
        strikes = n + 1 < count and row.spacing[n] < row.height[n]
        place(row, ring, mask, n, state)
        lengthen_tail(ring, mask, n)
        released = begin_fall(ring[n & mask], mu, gravity, state)
        b = fall_angle(ring[n & mask], True) if strikes else FLOOR
        snapshots[n, 0].speed = math.sqrt(state.u)
        outcome = PROPAGATED
        for j in range(1, pieces + 1):
            a = b * (j - 1) / pieces
            before, here = snapshots[n, j - 1], snapshots[n, j]
            outcome = fall(
                lanes, ring, mask, n, a, b * j / pieces, mu, gravity, rtol, state, True, untaped
            )
            if outcome != PROPAGATED:  # it comes to rest as a stone does at the top of its flight
                rest = 2.0 * max(state.angle - a, 0.0) / max(before.speed, TINY)
                for i in range(j, pieces + 1):
                    snapshots[n, i].angle = max(state.angle, a)
                    snapshots[n, i].time = before.time + rest
                break
            here.angle, here.time, here.speed = b * j / pieces, state.fall_time, math.sqrt(state.u)
        if outcome != PROPAGATED or not strikes:
            break
        if close_fall(ring, mask, n, b, released, True, mu, state, outcome) != PROPAGATED:
            break
    keep_alive(own_state)
    keep_alive(ring)
    return falls
