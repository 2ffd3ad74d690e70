"""Whole chains: unequal ones, batches of them, equal dominoes, and endless repeated patterns."""

import math

import numpy as np

from domino_env.kernels.arrays import (
    ARRIVAL,
    EVENT,
    JAC,
    JAMMED,
    LANES,
    MAP_U,
    OUT_OF_REACH,
    PROPAGATED,
    RING_SIZE,
    STALLED,
    STATE,
    WGT,
    Arrays,
    is_uneven,
)
from domino_env.kernels.contact import (
    at_or_zero,
    contact_rise,
    new_ring,
    place_contact,
    place_domino,
    sin_versine,
)
from domino_env.kernels.fall import (
    add_next_domino,
    begin_fall,
    close_fall,
    extend_tail,
    fall,
    fall_and_hit,
    fall_angle,
    initialise,
    start_chain,
    torque_bound,
)
from domino_env.kernels.interval import (
    ACCEPTED,
    NEAR_STALL,
    UNRESOLVED,
    affine_map,
    propagate,
)
from domino_env.kernels.jit import (
    always_inline,
    borrow,
    entry_point,
    internal,
    keep_alive,
    noinline,
    select,
)
from domino_env.kernels.quadrature import ORDERS
from domino_env.kernels.records import (
    clear_arrivals,
    record_fall,
    record_hit,
    record_interval,
    summarise,
)
from domino_env.kernels.stack import (
    add_domino,
    add_domino_frictionless,
    add_leader,
    count_toppled,
    renew_tails,
    set_angles,
    tail_size,
)


@internal
def is_uniform(layout):
    """Whether one stack serves every fall: all parts equal, and no link ever switches.

    The ground is flat or an even slope.
    """
    spacing, thickness, height, density = (
        layout.spacing,
        layout.thickness,
        layout.height,
        layout.density,
    )
    s, d, length = spacing[0], thickness[0], height[0]
    if s * (s + 2.0 * d) > length * length or s >= length or contact_rise(layout, 0, 1) != 0.0:
        return False
    for i in range(1, len(thickness)):
        if thickness[i] != d or height[i] != length or density[i] != density[0]:
            return False
        if i < len(spacing) and spacing[i] != s:
            return False
        if at_or_zero(layout.tilt, i) != at_or_zero(layout.tilt, 0):
            return False
        if at_or_zero(layout.rise, i - 1) != at_or_zero(layout.rise, 0):
            return False
    return True


@internal
def uniform_order(lanes, domino, count, b, mu, gravity, tol):
    """Rule that resolves P and Q of a uniform stack; -1 where none does."""
    for k in range(1, len(ORDERS)):
        lanes_used = set_angles(lanes, k, 0.0, b)
        add_leader(lanes, lanes_used, domino, mu)
        for _ in range(min(count - 2, 12)):
            if mu > 0.0:
                add_domino(lanes, lanes_used, domino, mu)
            else:
                add_domino_frictionless(lanes, lanes_used, domino)
        ok, e_error, u_error, _, _ = affine_map(lanes, k, b, mu, gravity)
        if ok and e_error <= 0.1 * tol and u_error <= 0.1 * tol * lanes[MAP_U + ORDERS[k] + 1]:
            return k
    return -1


@always_inline
def finer_rule(domino, k, missed):
    """The rule after one that did not resolve the time, for so many falls on end."""
    return min(k + 1, len(ORDERS) - 1) if is_uneven(domino) and missed > 1 else k


@noinline
def uniform_chain(lanes, ring, count, mu, gravity, rtol, state, exact_minimum, arrivals, tape):
    """Falls 0 … N-2 of a uniform row: each adds one link to the same lanes until the tail is dead.

    Returns (outcome, falls done).
    """
    domino = ring[0]
    b = fall_angle(domino, True)
    tol = 0.3 * rtol
    k = uniform_order(lanes, domino, count, b, mu, gravity, tol)
    if k < 0:
        return PROPAGATED, 0
    lanes_used = set_angles(lanes, k, 0.0, b)
    add_leader(lanes, lanes_used, domino, mu)
    inertia = domino.inertia
    e_error, u_error, q_mismatch, r_mismatch, tail, behind = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    depth, closed, missed = 0, False, 0
    for n in range(count - 1):
        released = begin_fall(domino, mu, gravity, state)
        force = 2.0 * b * gravity * state.kappa / state.u
        if closed:  # as u falls, what was cut off weighs more
            tail = tail_size(lanes, lanes_used, mu, force, b, behind)
            closed = tail <= 0.3 * tol
        if not closed:
            while depth < n:
                if mu > 0.0:
                    before = lanes[WGT]
                    add_domino(lanes, lanes_used, domino, mu)
                    ratio = abs(lanes[WGT] / before)
                else:
                    before = lanes[JAC]
                    add_domino_frictionless(lanes, lanes_used, domino)
                    ratio = lanes[JAC] / before
                depth += 1
                tail = 0.0
                if depth > 4 and ratio < 1.0:
                    behind = inertia * ratio / (1.0 - ratio)
                    domino.tail = inertia + behind
                    tail = tail_size(lanes, lanes_used, mu, force, b, behind)
                    if tail <= 0.3 * tol:
                        closed = True
                        break
            if depth == n:  # nothing is left out
                tail = 0.0
            ok, e_error, u_error, q_mismatch, r_mismatch = affine_map(lanes, k, b, mu, gravity)
            if not ok:
                return PROPAGATED, n
        errors = (e_error, u_error, q_mismatch, r_mismatch)
        status = propagate(lanes, k, 0.0, b, errors, tail, tol, state, exact_minimum, NEAR_STALL)
        if status == ACCEPTED:
            state.depth = depth
            if len(tape) > 0:
                record_interval(tape, state, n, 0.0, b, k, n - depth, released)
        missed = missed + 1 if status == UNRESOLVED else 0
        if status == UNRESOLVED:
            k = finer_rule(domino, k, missed)
            outcome = fall(lanes, ring, 0, n, 0.0, b, mu, gravity, rtol, state, exact_minimum, tape)
            depth, closed = 0, False  # the lanes were used: begin again
            lanes_used = set_angles(lanes, k, 0.0, b)
            add_leader(lanes, lanes_used, domino, mu)
        else:
            outcome = STALLED if status == STALLED else PROPAGATED
        outcome = close_fall(ring, 0, n, b, released, True, mu, state, outcome)
        if len(tape) > 0 and outcome == PROPAGATED:
            record_hit(tape, state, n)
        record_fall(arrivals, n, outcome, state)
        if outcome != PROPAGATED:
            return outcome, n
    return PROPAGATED, count - 1


@internal
def ring_length(count):
    """Rows of the ring of a chain: a power of two with room for all, up to RING_ROWS."""
    size = 2
    while size < count + 1 and size < RING_SIZE:
        size *= 2
    return size


@always_inline
def prepare_fall(layout, ring, mask, n, state):
    """Make ready for the fall of leader n: the domino that it is to hit, and the bound on what
    lies behind."""
    add_next_domino(layout, ring, mask, n, state)
    if n % 4 == 0 and n > 0:
        renew_tails(ring, mask, max(n - 1 - state.depth, 0, n - mask), n)
    else:
        extend_tail(ring, mask, n)


@always_inline
def end_of_chain(ring, mask, n, mu, state, outcome):
    """(outcome, leader, dominoes struck, dominoes past tipping) of a wave that ends under n."""
    s, v = sin_versine(state.angle)
    toppled = count_toppled(ring, mask, n, state.back, s, v, mu, state)
    if outcome in (OUT_OF_REACH, PROPAGATED):  # the leader is just at tipping
        toppled = n + 1
    struck = n + 2 if outcome == JAMMED and state.fraction == 1.0 else n + 1
    return outcome, n, struck, toppled


@noinline
def chain(layout, mu, gravity, push, rtol, lanes, ring, state, exact_minimum, arrivals, tape):
    """A whole chain.  Returns (outcome, leader at the end, dominoes struck, dominoes past tipping).

    push = 0 rides no wave but composes the maps of all falls: gain, offset and need in `state`.
    deep: find the true minimum of u in every interval, not only where a stall is near.
    arrivals: of each domino, or empty where only what is in `state` is wanted.
    tape: rows for what `pull` needs, of which state.taped would be used; none where it is empty.
    """
    count = len(layout.thickness)
    start_chain(layout, push, ring, state)
    clear_arrivals(arrivals, push)
    first, mask = 0, len(ring) - 1
    n, outcome = 0, PROPAGATED
    if push == 0.0:
        state.composing = True
    elif count > 3 and is_uniform(layout):
        place_contact(ring, 0, 0, layout, 0, 0)
        ring[0].tail = count * ring[0].inertia
        outcome, first = uniform_chain(
            lanes, ring, count, mu, gravity, rtol, state, exact_minimum, arrivals, tape
        )
        n, mask = first, 0
    if outcome == PROPAGATED:
        for n in range(first, count):
            strikes = n + 1 < count and layout.spacing[n] < layout.height[n]
            if mask > 0:
                prepare_fall(layout, ring, mask, n, state)
            outcome = fall_and_hit(
                lanes, ring, mask, n, strikes, mu, gravity, rtol, state, exact_minimum, tape
            )
            if outcome == PROPAGATED and not strikes and n + 1 < count:
                outcome = OUT_OF_REACH
            record_fall(arrivals, n, outcome, state)
            if outcome != PROPAGATED:
                break
    return end_of_chain(ring, mask, n, mu, state, outcome)


@internal
def solve(layout, mu, gravity, push, rtol, lanes, ring, state, exact_minimum, arrivals, tape):
    """`chain`, again with a smaller tolerance while its own estimate exceeds the one asked for.

    Where rounding alone exceeds it, no rule helps, and the estimate says so.
    """
    inner = rtol
    result = PROPAGATED, 0, 0, 0
    for _ in range(4):
        result = chain(
            layout, mu, gravity, push, inner, lanes, ring, state, exact_minimum, arrivals, tape
        )
        if state.worst <= rtol or state.worst_round > 0.5 * rtol or inner < 1e-15:
            break
        inner *= max(0.3 * rtol / state.worst, 1e-3)
    return result


@always_inline
def layout_of(layouts, b):
    """Row b of a batch; where all have the same height or density, it stands there once."""
    return Arrays(
        layouts.spacing[b],
        layouts.thickness[b],
        layouts.height[b if len(layouts.height) > 1 else 0],
        layouts.density[b if len(layouts.density) > 1 else 0],
        select(layouts.rise, b),
        select(layouts.tilt, b),
    )


@entry_point
def solve_batch(
    first, last, layouts, mu, gravity, push, rtol, exact_minimum, summaries, arrivals, tape
):
    """Chains first … last - 1 of a batch.

    rows: a `Row` of (B, N-1), (B, N) and twice (B, N) or (1, N).  summaries: (B,).
    arrivals: (B, N), or (0, 0).  tape: for one chain, or empty.
    """
    count = layouts.thickness.shape[1]
    own_ring, own_lanes = new_ring(layouts, ring_length(count)), np.zeros(LANES)
    own_state = np.zeros(1, STATE)
    ring, lanes, state = borrow(own_ring), borrow(own_lanes), own_state[0]
    unrecorded = np.empty(0, ARRIVAL)
    for b in range(first, last):
        outcome, leader, struck, toppled = solve(
            layout_of(layouts, b), mu, gravity, push, rtol, lanes, ring, state, exact_minimum,
            arrivals[b] if len(arrivals) > 0 else unrecorded, tape,
        )  # fmt: skip
        summarise(summaries[b], count, outcome, leader, struck, toppled, state)
    keep_alive(own_ring)
    keep_alive(own_lanes)
    keep_alive(own_state)


@entry_point
def compose_falls(layout, mu, gravity, rtol):
    """The maps of all falls of a chain, composed: (outcome, least u_0 that runs through)."""
    own_state, ring = np.zeros(1, STATE), new_ring(layout, ring_length(len(layout.thickness)))
    lanes, state = np.zeros(LANES), own_state[0]
    unrecorded, no_tape = np.empty(0, ARRIVAL), np.empty(0, EVENT)
    outcome, _, _, _ = chain(
        layout, mu, gravity, 0.0, rtol, lanes, ring, state, True, unrecorded, no_tape
    )
    least_start = state.least_start
    keep_alive(own_state)
    keep_alive(ring)
    return outcome, least_start


@internal
def repeat_behind(ring, mask, n, pattern, state):
    """Fill the ring with a pattern of P dominoes, repeated for ever behind leader n."""
    period = len(pattern.thickness)
    state.back = 0
    for i in range(n - mask, n + 2):
        j, ahead = i % period, (i + 1) % period
        place_domino(ring, mask, i, pattern, j)
        place_contact(ring, mask, i, pattern, j, ahead)
        domino = ring[i & mask]
        domino.tail = domino.inertia * (i - n + mask + 2)


@entry_point
def period_falls(pattern, mu, gravity, rtol, ring_size, u, falls):
    """The P falls of one period of an endless row, each with the stack of all that fell before.

    pattern: a `Row` of P gaps and P dominoes.  ring_rows: dominoes remembered, a power of two.
    u > 0: ride a wave that enters with u; falls (P,) are written.  u = 0: compose their maps.
    Returns (outcome, leader, largest tail left beyond the ring, gain, offset, need).
    """
    period, mask = len(pattern.thickness), ring_size - 1
    own_state = np.zeros(1, STATE)
    lanes, ring, state = np.zeros(LANES), new_ring(pattern, ring_size), own_state[0]
    no_tape = np.empty(0, EVENT)
    initialise(state, 1.0)
    state.u = u
    state.composing = u == 0.0
    for j in range(period):
        torque = torque_bound(pattern.height[j], pattern.thickness[j])
        state.kappa = max(state.kappa, torque)
    base = period * (1 + 2 * (mask + 1) // period)
    outcome, leader, tail = PROPAGATED, period, 0.0
    for j in range(period):
        n = base + j
        repeat_behind(ring, mask, n, pattern, state)
        state.depth = 0
        released = state.u
        outcome = fall_and_hit(lanes, ring, mask, n, True, mu, gravity, rtol, state, True, no_tape)
        if outcome != PROPAGATED:
            leader = j
            break
        tail = max(tail, state.cut)
        if u > 0.0:
            falls[j].time = state.fall_time
            falls[j].release = math.sqrt(released)
            falls[j].impact = math.sqrt(state.u_impact)
    gain, offset, least_start = state.gain, state.offset, state.least_start
    keep_alive(own_state)
    keep_alive(ring)
    return outcome, leader, tail, gain, offset, least_start
