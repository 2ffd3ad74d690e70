"""Whole chains: unequal dominoes, batches, equal dominoes, and endless repeated patterns."""

import math

import numpy as np

from domino_env.kernels.arrays import (
    ARRIVAL,
    EVENT,
    INTERVAL_SHARE,
    JAMMED,
    LANES,
    MAP_U,
    ONE_FOR_ALL,
    OUT_OF_REACH,
    PROPAGATED,
    RING_SIZE,
    STALLED,
    STATE,
    TAIL_SHARE,
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
    configure,
    fall,
    fall_and_hit,
    fall_angle,
    initialise,
    start_chain,
    strikes_next,
    torque_bound,
)
from domino_env.kernels.interval import (
    ACCEPTED,
    NEAR_STALL,
    UNRESOLVED,
    MapError,
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
    has_tape,
    record_fall,
    record_hit,
    record_interval,
    summarise,
)
from domino_env.kernels.stack import (
    add_domino,
    add_leader,
    count_toppled,
    renew_tails,
    set_angles,
    tail_size,
    weights,
)

MOST_TRIES = 4  # of a chain whose estimate exceeds its tolerance
LEAST_RTOL = 1e-15
MAP_SHARE = 0.1  # of an interval's tolerance, for the map that all falls of a uniform layout share


@internal
def is_uniform(layout):
    """Return whether one stack serves all falls: equal dominoes that never change contact.

    The ground is flat or an even slope.
    """
    s, d, length = layout.spacing[0], layout.thickness[0], layout.height[0]
    if s * (s + 2.0 * d) > length * length or s >= length or contact_rise(layout, 0, 1) != 0.0:
        return False
    for i in range(1, len(layout.thickness)):
        if layout.thickness[i] != d or layout.height[i] != length:
            return False
        if layout.density[i] != layout.density[0]:
            return False
        if i < len(layout.spacing) and layout.spacing[i] != s:
            return False
        if at_or_zero(layout.tilt, i) != at_or_zero(layout.tilt, 0):
            return False
        if at_or_zero(layout.rise, i - 1) != at_or_zero(layout.rise, 0):
            return False
    return True


@internal
def uniform_rule(lanes, domino, state, count, b):
    """Return the rule that resolves P and Q of a uniform stack; -1 where none does."""
    mu, tol = state.mu, MAP_SHARE * (INTERVAL_SHARE * state.rtol)
    for k in range(1, len(ORDERS)):
        used = set_angles(lanes, k, 0.0, b)
        add_leader(lanes, used, domino, mu)
        for _ in range(min(count - 2, 12)):
            add_domino(lanes, used, domino, mu)
        ok, error = affine_map(lanes, k, b, mu, state.gravity)
        if ok and error.log_e <= tol and error.u <= tol * lanes[MAP_U + ORDERS[k] + 1]:
            return k
    return -1


@noinline
def uniform_chain(lanes, ring, state, count, arrivals, tape):
    """Simulate falls 0 … N-2 of a uniform layout, each with one contact more in the same lanes.

    Returns (outcome, falls done).
    """
    lanes, ring, arrivals, tape = borrow((lanes, ring, arrivals, tape))
    domino, mu, gravity = ring[0], state.mu, state.gravity
    b = fall_angle(domino, True)
    k = uniform_rule(lanes, domino, state, count, b)
    if k < 0:
        return PROPAGATED, 0
    tail_tol = TAIL_SHARE * (INTERVAL_SHARE * state.rtol)
    used = set_angles(lanes, k, 0.0, b)
    add_leader(lanes, used, domino, mu)
    inertia = domino.inertia
    error, tail, behind = MapError(0.0, 0.0, 0.0, 0.0), 0.0, 0.0
    depth, closed, missed = 0, False, 0
    for n in range(count - 1):
        u_start = begin_fall(ring, state, n)
        force = 2.0 * b * gravity * state.kappa / state.u
        if closed:  # the neglected tail weighs more as u falls
            tail = tail_size(lanes, used, mu, force, b, behind)
            closed = tail <= tail_tol
        if not closed:
            while depth < n:
                before = lanes[weights(mu)]
                add_domino(lanes, used, domino, mu)
                ratio = abs(lanes[weights(mu)] / before)
                depth += 1
                tail = 0.0
                if depth > 4 and ratio < 1.0:
                    behind = inertia * ratio / (1.0 - ratio)
                    domino.tail = inertia + behind
                    tail = tail_size(lanes, used, mu, force, b, behind)
                    if tail <= tail_tol:
                        closed = True
                        break
            if depth == n:  # the stack is complete
                tail = 0.0
            ok, error = affine_map(lanes, k, b, mu, gravity)
            if not ok:
                return PROPAGATED, n
        status = propagate(lanes, k, 0.0, b, error, tail, state, NEAR_STALL)
        if status == ACCEPTED:
            state.depth = depth
            if has_tape(tape):
                record_interval(tape, state, n, 0.0, b, k, n - depth, u_start)
        missed = missed + 1 if status == UNRESOLVED else 0
        outcome = STALLED if status == STALLED else PROPAGATED
        if status == UNRESOLVED:
            if is_uneven(domino) and missed > 1:
                k = min(k + 1, len(ORDERS) - 1)
            outcome = fall(lanes, ring, n, state, 0.0, b, tape)
            depth, closed = 0, False  # the lanes were overwritten
            used = set_angles(lanes, k, 0.0, b)
            add_leader(lanes, used, domino, mu)
        outcome = close_fall(ring, state, n, b, u_start, True, outcome)
        if has_tape(tape) and outcome == PROPAGATED:
            record_hit(tape, state, n)
        record_fall(arrivals, n, outcome, state)
        if outcome != PROPAGATED:
            return outcome, n
    return PROPAGATED, count - 1


@internal
def ring_length(count):
    """Return the length of the ring of a chain: a power of two, up to RING_SIZE."""
    size = 2
    while size < count + 1 and size < RING_SIZE:
        size *= 2
    return size


@internal
def new_arrays(layout, size):
    """Return the state, the lanes and a ring for a simulation; keep them alive to its end."""
    return np.zeros(1, STATE), np.zeros(LANES), new_ring(layout, size)


@always_inline
def no_tape():
    """Return the tape of a simulation without gradient."""
    return np.empty(0, EVENT)


@always_inline
def next_fall(layout, lanes, ring, n, state, tape):
    """Advance a chain by the fall of leader n: place the domino ahead, fall, and hit it."""
    if state.mask != ONE_FOR_ALL:
        add_next_domino(layout, ring, state, n)
        if n % 4 == 0 and n > 0:
            renew_tails(ring, state.mask, max(n - 1 - state.depth, 0, n - state.mask), n)
    strikes, is_last = strikes_next(layout, n), n + 1 == len(layout.thickness)
    return fall_and_hit(lanes, ring, n, state, strikes, is_last, tape)


@noinline
def remaining_falls(layout, lanes, ring, state, first, arrivals, tape):
    """Simulate the falls from leader `first` on.

    Returns (outcome, leader at the end, dominoes struck, dominoes past tipping).
    """
    layout, lanes, ring, arrivals, tape = borrow((layout, lanes, ring, arrivals, tape))
    n, outcome = first, PROPAGATED
    for n in range(first, len(layout.thickness)):
        outcome = next_fall(layout, lanes, ring, n, state, tape)
        record_fall(arrivals, n, outcome, state)
        if outcome != PROPAGATED:
            break
    return end_of_chain(ring, state, n, outcome)


@always_inline
def end_of_chain(ring, state, n, outcome):
    """Return (outcome, leader, dominoes struck, dominoes past tipping) of a wave that ends at n."""
    s, v = sin_versine(state.angle)
    toppled = count_toppled(ring, state, n, s, v)
    if outcome in (OUT_OF_REACH, PROPAGATED):  # the leader is at its tipping angle
        toppled = n + 1
    struck = n + 2 if outcome == JAMMED and state.fraction == 1.0 else n + 1
    return outcome, n, struck, toppled


@internal
def chain(layout, lanes, ring, state, push, arrivals, tape):
    """Simulate a chain; return the same four as `remaining_falls`.

    arrivals: of each domino, or empty where only the state is wanted.
    """
    count, first = len(layout.thickness), 0
    start_chain(layout, push, ring, state)
    clear_arrivals(arrivals, push)
    state.mask = len(ring) - 1
    if count > 3 and is_uniform(layout):
        state.mask = ONE_FOR_ALL
        place_contact(ring, ONE_FOR_ALL, 0, layout, 0, 0)
        ring[0].tail = count * ring[0].inertia
        outcome, first = uniform_chain(lanes, ring, state, count, arrivals, tape)
        if outcome != PROPAGATED:
            return end_of_chain(ring, state, first, outcome)
    return remaining_falls(layout, lanes, ring, state, first, arrivals, tape)


@internal
def solve(layout, lanes, ring, state, push, arrivals, tape):
    """Simulate a chain, with a smaller tolerance while its estimate exceeds that of the state.

    Where rounding alone exceeds it no rule helps, and the estimate includes it.
    """
    rtol = state.rtol
    result = PROPAGATED, 0, 0, 0
    for _ in range(MOST_TRIES):
        result = chain(layout, lanes, ring, state, push, arrivals, tape)
        if state.worst <= rtol or state.worst_round > 0.5 * rtol or state.rtol < LEAST_RTOL:
            break
        state.rtol *= max(0.3 * rtol / state.worst, 1e-3)
    state.rtol = rtol
    return result


@always_inline
def layout_of(layouts, b):
    """Return layout b of a batch, which may share one height or density per domino."""
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
    """Simulate chains first … last - 1 of a batch.

    layouts: `Arrays` of (B, N-1), (B, N) and twice (B, N) or (1, N).  summaries: (B,).
    arrivals: (B, N), or (0, 0).  tape: for a single chain, or empty.
    """
    count = layouts.thickness.shape[1]
    arrays, unrecorded = new_arrays(layouts, ring_length(count)), np.empty(0, ARRIVAL)
    states, lanes, ring = borrow(arrays)
    state = states[0]
    configure(state, ring, mu, gravity, rtol, exact_minimum)
    for b in range(first, last):
        arrivals_b = arrivals[b] if len(arrivals) > 0 else unrecorded
        outcome, leader, struck, toppled = solve(
            layout_of(layouts, b), lanes, ring, state, push, arrivals_b, tape
        )
        summarise(summaries[b], count, outcome, leader, struck, toppled, state)
    keep_alive(arrays)


@entry_point
def compose_falls(layout, mu, gravity, rtol):
    """Compose the maps of all falls; return (outcome, least u_0 for which the wave completes)."""
    arrays = new_arrays(layout, ring_length(len(layout.thickness)))
    states, lanes, ring = borrow(arrays)
    state = states[0]
    configure(state, ring, mu, gravity, rtol, True)
    start_chain(layout, 0.0, ring, state)
    state.composing = True
    unrecorded = np.empty(0, ARRIVAL)
    outcome, _, _, _ = remaining_falls(layout, lanes, ring, state, 0, unrecorded, no_tape())
    least_start = state.least_start
    keep_alive(arrays)
    return outcome, least_start


@internal
def repeat_behind(ring, state, n, pattern):
    """Fill the ring with a pattern of P dominoes, repeated without end behind leader n."""
    period, mask = len(pattern.thickness), state.mask
    state.back = 0
    for i in range(n - mask, n + 2):
        j, ahead = i % period, (i + 1) % period
        place_domino(ring, mask, i, pattern, j)
        place_contact(ring, mask, i, pattern, j, ahead)
        domino = ring[i & mask]
        domino.tail = domino.inertia * (i - n + mask + 2)


@entry_point
def period_falls(pattern, mu, gravity, rtol, ring_size, u, composing, falls):
    """Simulate the P falls of one period of an endless chain, each with the whole stack behind it.

    pattern: `Arrays` of P gaps and P dominoes.  ring_size: dominoes remembered, a power of two.
    composing: compose the maps of all falls; otherwise propagate a wave that enters with u, and
    write falls (P,).
    Returns (outcome, leader, largest tail beyond the ring, gain, offset, least u).
    """
    period = len(pattern.thickness)
    arrays = new_arrays(pattern, ring_size)
    states, lanes, ring = borrow(arrays)
    state, tape = states[0], no_tape()
    configure(state, ring, mu, gravity, rtol, True)
    initialise(state, 1.0)
    state.u, state.composing = u, composing
    for j in range(period):
        torque = torque_bound(pattern.height[j], pattern.thickness[j])
        state.kappa = max(state.kappa, torque)
    base = period * (1 + 2 * ring_size // period)
    outcome, leader, tail = PROPAGATED, period, 0.0
    for j in range(period):
        repeat_behind(ring, state, base + j, pattern)
        state.depth = 0
        u_start = state.u
        outcome = fall_and_hit(lanes, ring, base + j, state, True, False, tape)
        if outcome != PROPAGATED:
            leader = j
            break
        tail = max(tail, state.cut)
        if not composing:
            falls[j].time = state.fall_time
            falls[j].release = math.sqrt(u_start)
            falls[j].impact = math.sqrt(state.u_impact)
    gain, offset, least_start = state.gain, state.offset, state.least_start
    keep_alive(arrays)
    return outcome, leader, tail, gain, offset, least_start
