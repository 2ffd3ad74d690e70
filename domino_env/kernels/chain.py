"""Whole chains, batches of them, and patterns of dominoes that repeat without end."""

import math

import numpy as np

from domino_env.kernels import arrays, contact, fall, interval, jit, records, stack
from domino_env.kernels.quadrature import ORDERS

MOST_TRIES = 4  # of a chain whose estimate exceeds its tolerance
LEAST_RTOL = 1e-15  # a smaller tolerance is below rounding
MAP_SHARE = 0.1  # of an interval's tolerance, for the map that all falls of a uniform layout share


@jit.internal
def is_uniform(layout):
    """Return True if one stack serves all falls.

    That is so for equal dominoes with equal gaps, on flat ground or an even slope, whose contacts
    never change.
    """
    s, d, length = layout.spacing[0], layout.thickness[0], layout.height[0]
    rise = contact.contact_rise(layout, 0, 1)
    if s * (s + 2.0 * d) > length * length or s >= length or rise != 0.0:
        return False
    for i in range(1, len(layout.thickness)):
        if layout.thickness[i] != d or layout.height[i] != length:
            return False
        if layout.density[i] != layout.density[0]:
            return False
        if i < len(layout.spacing) and layout.spacing[i] != s:
            return False
        if contact.at_or_zero(layout.tilt, i) != contact.at_or_zero(layout.tilt, 0):
            return False
        if contact.at_or_zero(layout.rise, i - 1) != contact.at_or_zero(layout.rise, 0):
            return False
    return True


@jit.internal
def uniform_rule(lanes, domino, state, count, b):
    """Return the rule that resolves P and Q of a uniform stack; -1 if none does."""
    setting, tol = arrays.setting_of(state), MAP_SHARE * (arrays.INTERVAL_SHARE * state.rtol)
    for k in range(1, len(ORDERS)):
        num_lanes = stack.set_angles(lanes, k, 0.0, b)
        stack.add_leader(lanes, num_lanes, domino, setting)
        for _ in range(min(count - 2, 12)):  # w and J decay along the stack
            stack.add_domino(lanes, num_lanes, domino, setting)
        ok, error = interval.affine_map(lanes, k, b, setting)
        if ok and error.log_e <= tol and error.u <= tol * lanes[arrays.MAP_U + ORDERS[k] + 1]:
            return k
    return -1


@jit.noinline
def uniform_chain(lanes, ring, state, count, arrivals, tape):
    """Simulate falls 0 … N-2 of a uniform layout, each with one contact more in the same lanes.

    Returns (outcome, leader at the end); if PROPAGATED, `remaining_falls` continues from there.
    """
    lanes, ring, arrivals, tape = jit.borrow((lanes, ring, arrivals, tape))
    domino, setting = ring[0], arrays.setting_of(state)
    b = fall.fall_angle(domino, True)
    k = uniform_rule(lanes, domino, state, count, b)
    if k < 0:
        return arrays.PROPAGATED, 0
    tail_tol = arrays.TAIL_SHARE * (arrays.INTERVAL_SHARE * state.rtol)
    num_lanes = stack.set_angles(lanes, k, 0.0, b)
    stack.add_leader(lanes, num_lanes, domino, setting)
    inertia = domino.inertia
    error, tail, behind = interval.MapError(0.0, 0.0, 0.0, 0.0), 0.0, 0.0
    depth, is_cut, failures = 0, False, 0
    for n in range(count - 1):
        u_start = fall.begin_fall(ring, state, n)
        force = stack.force_bound(state, b)
        if is_cut:  # the effect of the tail grows as u falls
            tail = stack.tail_bound(lanes, num_lanes, setting, force, b, behind)
            is_cut = tail <= tail_tol
        if not is_cut:
            while depth < n:
                before = lanes[stack.weights(setting)]
                stack.add_domino(lanes, num_lanes, domino, setting)
                ratio = abs(lanes[stack.weights(setting)] / before)
                depth += 1
                tail = 0.0
                if depth > 4 and ratio < 1.0:  # leans grow and |B/A| falls along the stack
                    behind = inertia * ratio / (1.0 - ratio)
                    domino.tail = inertia + behind
                    tail = stack.tail_bound(lanes, num_lanes, setting, force, b, behind)
                    if tail <= tail_tol:
                        is_cut = True
                        break
            if depth == n:  # the stack is complete
                tail = 0.0
            ok, error = interval.affine_map(lanes, k, b, setting)
            if not ok:
                return arrays.PROPAGATED, n
        status = interval.propagate(lanes, k, 0.0, b, error, tail, state, interval.NEAR_STALL)
        if status == interval.ACCEPTED:
            state.depth = depth
            if records.has_tape(tape):
                records.record_interval(tape, state, n, 0.0, b, k, n - depth, u_start)
        failures = failures + 1 if status == interval.UNRESOLVED else 0
        outcome = arrays.STALLED if status == arrays.STALLED else arrays.PROPAGATED
        if status == interval.UNRESOLVED:
            if arrays.is_uneven(domino) and failures > 1:
                k = min(k + 1, len(ORDERS) - 1)
            outcome = fall.fall(lanes, ring, n, state, 0.0, b, tape)
            depth, is_cut = 0, False  # the lanes were overwritten
            num_lanes = stack.set_angles(lanes, k, 0.0, b)
            stack.add_leader(lanes, num_lanes, domino, setting)
        outcome = fall.close_fall(ring, state, n, b, u_start, True, outcome)
        if records.has_tape(tape) and outcome == arrays.PROPAGATED:
            records.record_hit(tape, state, n)
        records.record_fall(arrivals, n, outcome, state)
        if outcome != arrays.PROPAGATED:
            return outcome, n
    return arrays.PROPAGATED, count - 1


@jit.internal
def ring_length(count):
    """Return the length of the ring of a chain of `count` dominoes: a power of two."""
    size = 2
    while size < count + 1 and size < arrays.RING_SIZE:
        size *= 2
    return size


@jit.internal
def new_arrays(layout, size, setting, exact_minimum):
    """Return the state, the lanes and a ring for a simulation, whose owner is the caller."""
    states, ring = np.zeros(1, arrays.STATE), contact.new_ring(layout, size)
    arrays.configure(states[0], ring, setting, exact_minimum)
    return states, np.zeros(arrays.LANES), ring


@jit.always_inline
def no_tape():
    """Return the tape of a simulation without gradient."""
    return np.empty(0, arrays.EVENT)


@jit.always_inline
def next_fall(layout, lanes, ring, n, state, tape):
    """Place the domino ahead of leader n and simulate the fall onto it; return the outcome."""
    if state.mask != arrays.ONE_FOR_ALL:
        fall.add_next_domino(layout, ring, state, n)
        if n % 4 == 0 and n > 0:  # bounds remain valid, so a few falls share them
            stack.renew_tails(ring, state.mask, max(n - 1 - state.depth, 0, n - state.mask), n)
    strikes, is_last = fall.strikes_next(layout, n), n + 1 == len(layout.thickness)
    return fall.fall_and_hit(lanes, ring, n, state, strikes, is_last, tape)


@jit.noinline
def remaining_falls(layout, lanes, ring, state, first, arrivals, tape):
    """Simulate the falls from leader `first` on.

    Returns (outcome, leader at the end, dominoes hit, dominoes past tipping).
    """
    layout, lanes, ring, arrivals, tape = jit.borrow((layout, lanes, ring, arrivals, tape))
    n, outcome = first, arrays.PROPAGATED
    for n in range(first, len(layout.thickness)):
        outcome = next_fall(layout, lanes, ring, n, state, tape)
        records.record_fall(arrivals, n, outcome, state)
        if outcome != arrays.PROPAGATED:
            break
    return end_of_chain(ring, state, n, outcome)


@jit.always_inline
def end_of_chain(ring, state, n, outcome):
    """Return (outcome, leader n, dominoes hit, dominoes past tipping) of a wave that ends."""
    s, v = contact.sin_versine(state.angle)
    toppled = stack.count_toppled(ring, state, n, s, v)
    if outcome in (arrays.OUT_OF_REACH, arrays.PROPAGATED):
        toppled = n + 1  # the leader is at its tipping angle, which counts as toppled
    # if the hit itself jams, the next domino was hit
    hit_count = n + 2 if outcome == arrays.JAMMED and state.fraction == 1.0 else n + 1
    return outcome, n, hit_count, toppled


@jit.internal
def chain(layout, lanes, ring, state, arrivals, tape):
    """Simulate a chain; return what `remaining_falls` returns.

    arrivals: (N,) to write, or empty.
    """
    count, first = len(layout.thickness), 0
    fall.start_chain(layout, ring, state)
    records.clear_arrivals(arrivals, state)
    state.mask = len(ring) - 1
    if count > 3 and is_uniform(layout):
        state.mask = arrays.ONE_FOR_ALL
        contact.place_contact(ring, arrays.ONE_FOR_ALL, 0, layout, 0, 0)
        ring[0].tail = count * ring[0].inertia
        outcome, first = uniform_chain(lanes, ring, state, count, arrivals, tape)
        if outcome != arrays.PROPAGATED:
            return end_of_chain(ring, state, first, outcome)
    return remaining_falls(layout, lanes, ring, state, first, arrivals, tape)


@jit.noinline
def solve(layout, lanes, ring, state, arrivals, tape):
    """Simulate a chain, again with a smaller tolerance while its error exceeds state.rtol.

    Where rounding makes half of that error, a smaller tolerance does not help.
    """
    layout, lanes, ring, arrivals, tape = jit.borrow((layout, lanes, ring, arrivals, tape))
    rtol = state.rtol
    result = arrays.PROPAGATED, 0, 0, 0
    for _ in range(MOST_TRIES):
        result = chain(layout, lanes, ring, state, arrivals, tape)
        if state.worst <= rtol or state.worst_round > 0.5 * rtol or state.rtol < LEAST_RTOL:
            break
        state.rtol *= max(0.3 * rtol / state.worst, 1e-3)  # a margin; a bound on each step
    state.rtol = rtol
    return result


@jit.always_inline
def layout_of(layouts, b):
    """Return layout b of a batch, whose layouts may share their heights or densities."""
    return arrays.Arrays(
        layouts.spacing[b],
        layouts.thickness[b],
        layouts.height[b if len(layouts.height) > 1 else 0],
        layouts.density[b if len(layouts.density) > 1 else 0],
        jit.select(layouts.rise, b),
        jit.select(layouts.tilt, b),
    )


@jit.entry_point
def solve_batch(first, last, layouts, setting, exact_minimum, summaries, arrivals, tape):
    """Simulate chains first … last - 1 of a batch.

    layouts: `Arrays` of (B, N-1), (B, N) and twice (B, N) or (1, N). summaries: (B,).
    arrivals: (B, N), or (B, 0). tape: for a single chain, or empty.
    """
    count = layouts.thickness.shape[1]
    own = new_arrays(layouts, ring_length(count), setting, exact_minimum)
    layouts, states, lanes, ring = jit.borrow((layouts, *own))
    state = states[0]
    for b in range(first, last):
        result = solve(layout_of(layouts, b), lanes, ring, state, arrivals[b], tape)
        records.summarise(summaries[b], count, result, state)
    jit.keep_alive(own)


@jit.entry_point
def compose_falls(layout, setting):
    """Compose the maps of all falls; return (outcome, u_0 above which the wave completes)."""
    own = new_arrays(layout, ring_length(len(layout.thickness)), setting, True)
    layout, states, lanes, ring = jit.borrow((layout, *own))
    state = states[0]
    fall.start_chain(layout, ring, state)
    state.composing = True
    unrecorded = np.empty(0, arrays.ARRIVAL)
    outcome, _, _, _ = remaining_falls(layout, lanes, ring, state, 0, unrecorded, no_tape())
    least_start = state.least_start
    jit.keep_alive(own)
    return outcome, least_start


@jit.internal
def repeat_behind(ring, state, n, pattern):
    """Fill the ring, from n+1 backwards, with a pattern of P dominoes that repeats without end."""
    period, mask = len(pattern.thickness), state.mask
    state.back = 0
    for i in range(n - mask, n + 2):
        j, ahead = i % period, (i + 1) % period
        contact.place_domino(ring, mask, i, pattern, j)
        contact.place_contact(ring, mask, i, pattern, j, ahead)
        domino = ring[i & mask]
        domino.tail = domino.inertia * (i - n + mask + 2)


@jit.entry_point
def period_falls(pattern, setting, ring_size, u, composing, falls):
    """Simulate the P falls of one period of an endless chain, each with the whole stack behind it.

    pattern: `Arrays` of P gaps and P dominoes. ring_size: dominoes remembered, a power of two.
    composing: compose the maps of all falls; otherwise propagate a wave that starts with u, and
    write falls (P,).
    Returns (outcome, leader or P, largest bound on the tail, gain, offset, least u).
    """
    period = len(pattern.thickness)
    own = new_arrays(pattern, ring_size, setting, True)
    pattern, states, lanes, ring = jit.borrow((pattern, *own))
    state, tape = states[0], no_tape()
    fall.initialise(state)
    state.u, state.composing = u, composing
    for j in range(period):
        state.kappa = max(state.kappa, fall.torque_bound(pattern.height[j], pattern.thickness[j]))
    base = period * (1 + 2 * ring_size // period)  # the ring holds no negative index
    outcome, leader, tail = arrays.PROPAGATED, period, 0.0
    for j in range(period):
        repeat_behind(ring, state, base + j, pattern)
        state.depth = 0
        u_start = state.u
        outcome = fall.fall_and_hit(lanes, ring, base + j, state, True, False, tape)
        if outcome != arrays.PROPAGATED:
            leader = j
            break
        tail = max(tail, state.tail_bound)
        if not composing:
            falls[j].time = state.fall_time
            falls[j].release = math.sqrt(u_start)
            falls[j].impact = math.sqrt(state.u_impact)
    gain, offset, least_start = state.gain, state.offset, state.least_start
    jit.keep_alive(own)
    return outcome, leader, tail, gain, offset, least_start
