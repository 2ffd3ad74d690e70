"""One fall: from the moment the leader is hit until it hits the next, interval by interval."""

import math

from domino_env.kernels.arrays import (
    EPS,
    JAMMED,
    NO_RIGID_ANSWER,
    PROPAGATED,
    STALLED,
    SUM_M,
    is_uneven,
    rise_of,
    turn_of,
)
from domino_env.kernels.contact import can_flush, place_contact, place_domino, ratio_bound
from domino_env.kernels.interval import (
    LAST_RESORT,
    NEAR_STALL,
    NORMAL,
    UNRESOLVED,
    affine_map,
    compose,
    propagate,
)
from domino_env.kernels.jit import always_inline, internal, leaf, noinline
from domino_env.kernels.quadrature import ORDERS
from domino_env.kernels.records import record_flips, record_hit, record_interval, record_switch
from domino_env.kernels.stack import (
    END_AT_HIT,
    END_AT_SWITCH,
    IGNORE_SWITCHES,
    set_angles,
    sweep,
    switch,
    switch_angle,
    switch_guess,
)


@always_inline
def torque_bound(height, thickness):
    """Largest gravity torque of a domino over its inertia and g (for the bound on the tail)."""
    return 1.5 / math.sqrt(height * height + thickness * thickness)


@internal
def initialise(state, push):
    """The state of a chain whose first domino has just been pushed."""
    state.u = push * push
    state.u_error = state.u_round = state.u_impact = 0.0
    state.time = state.time_low = state.time_error = state.time_round = 0.0
    state.worst = state.worst_round = 0.0
    state.angle = state.fraction = state.fall_time = state.margin = 0.0
    state.lowest_margin = 1.0
    state.switched = state.w_before = state.w_after = state.flush_loss = state.slowest_at = 0.0
    state.m_end = state.cut = state.kappa = state.noise = state.log_rho = state.last_h = 0.0
    state.gain, state.offset, state.least_start, state.composing = 1.0, 0.0, 0.0, False
    state.back = state.depth = state.last_due = 0
    state.flushes = state.releases = state.taped = 0


@internal
def start_chain(layout, push, ring, state):
    """The first domino stands and has been pushed."""
    initialise(state, push)
    place_domino(ring, 0, 0, layout, 0)
    state.kappa = torque_bound(layout.height[0], layout.thickness[0])


@always_inline
def add_next_domino(layout, ring, mask, n, state):
    """Stand domino n+1, if there is one, in front of leader n."""
    if n + 1 < len(layout.thickness):
        place_domino(ring, mask, n + 1, layout, n + 1)
        place_contact(ring, mask, n, layout, n, n + 1)
        torque = torque_bound(layout.height[n + 1], layout.thickness[n + 1])
        state.kappa = max(state.kappa, torque)


@always_inline
def extend_tail(ring, mask, n):
    """A bound on what lies behind leader n, from that of the one before."""
    if n > 0:
        behind = ring[(n - 1) & mask]
        ring[n & mask].tail = ring[n & mask].inertia + ratio_bound(behind) * behind.tail


@always_inline
def rounding_units(leader, mu, depth):
    """By how many roundings of a leader's torque an interval may be off.

    Without friction u is a difference of energies.  On uneven ground a lean is not small where a
    gap is, and each link passes its rounding to all behind it.
    """
    return 8.0 + 8.0 * depth if is_uneven(leader) and mu == 0.0 else 8.0


@always_inline
def begin_fall(leader, mu, gravity, state):
    """Nothing of the fall is done; returns u at release."""
    state.noise = rounding_units(leader, mu, state.depth) * EPS * gravity * state.kappa
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


@always_inline
def choose_rule(state, h, tol):
    """The rule expected to meet `tol` on an interval of length h, from the last one's decay."""
    if state.log_rho <= 0.0:
        return 3
    rho = max(state.log_rho + math.log(state.last_h / h), 0.35)
    least_start = 0.5 * math.log(1.0 / tol) / rho
    # A short interval tells little of what a much longer one holds: look with more than six nodes.
    for k in range(2 if h > 4.0 * state.last_h else 1, len(ORDERS)):
        if ORDERS[k] >= least_start:
            return k
    return len(ORDERS) - 1


@internal
def stack_at(lanes, ring, mask, n, angle, mu, tol, detect, state):
    """M of the stack at one angle of the leader; returns the lowest domino included."""
    count = set_angles(lanes, 0, angle, 0.0)
    low, _, _ = sweep(lanes, count, ring, mask, n, state, mu, 0.0, 0.0, 0.3 * tol, detect)
    state.m_end = lanes[SUM_M]
    state.depth = n - low
    return low


@noinline
def fall(lanes, ring, mask, n, a, b, mu, gravity, rtol, state, exact_minimum, tape):
    """Let leader n fall from angle a to b: u, time and their errors move on in `state`."""
    step, end, located, floor_order = b, b, False, 0
    due_contact = n
    tol = 0.3 * rtol
    for _ in range(4000):
        if a >= b:
            break
        if not located:
            end = min(b, a + step)
            if b - end < 1e-3 * (end - a):
                end = b
        h = end - a
        k = max(choose_rule(state, h, tol), floor_order, 3 if n < 3 else 0)
        count = set_angles(lanes, k, a, h)
        force = 2.0 * h * gravity * state.kappa / state.u
        detect = IGNORE_SWITCHES if mask == 0 else (END_AT_SWITCH if located else END_AT_HIT)
        low, tail, flagged = sweep(
            lanes, count, ring, mask, n, state, mu, force, h, 0.3 * tol, detect
        )
        if flagged:
            guess = switch_guess(lanes, k, a, h, ring[low & mask].v_switch)
            end = switch_angle(ring, mask, n, low, a, end, guess, mu)
            located, due_contact = True, low
            if end - a > 4.0 * EPS * b:
                continue
            low = stack_at(lanes, ring, mask, n, a, mu, tol, END_AT_SWITCH, state)
        else:
            status, u_start = UNRESOLVED, state.u
            ok, e_error, u_error, q_mismatch, r_mismatch = affine_map(lanes, k, h, mu, gravity)
            if ok and state.composing:
                status = compose(
                    lanes, k, h, e_error, u_error, q_mismatch, r_mismatch, tail, tol, state
                )
            elif ok:
                effort = NEAR_STALL if k == len(ORDERS) - 1 or n > 6 else NORMAL
                if h <= 1e-9 * b:
                    effort = LAST_RESORT
                errors = (e_error, u_error, q_mismatch, r_mismatch)
                status = propagate(lanes, k, a, h, errors, tail, tol, state, exact_minimum, effort)
            if status == STALLED:
                return STALLED
            if status == UNRESOLVED:
                if ok and k < len(ORDERS) - 1:
                    floor_order = k + 1
                    continue
                floor_order = 0
                if h <= 1e-14 * b:
                    state.angle = a
                    return NO_RIGID_ANSWER
                step = 0.5 * h
                located = False
                continue
            if len(tape) > 0:
                record_flips(tape, ring, mask, n, low, state)
                record_interval(tape, state, n, a, h, k, low, u_start)
            floor_order = 0
            state.depth = n - low
            a = end
            step = max(step, 3.0 * h)
        if located:
            located, step = False, b
            flushes = can_flush(ring[due_contact & mask])
            keep = switch(ring, mask, n, due_contact, low, end, mu, state)
            if len(tape) > 0:
                record_switch(tape, ring, mask, n, due_contact, low, end, flushes, state)
            if not keep > 0.0:
                state.angle = end
                return JAMMED
            state.flush_loss = max(state.flush_loss, 1.0 - keep)
            state.switched, state.w_before = end, math.sqrt(state.u)
            slow_down(state, keep)
            state.w_after = math.sqrt(state.u)
            if a >= b:  # the hit follows at once: its M is that of the new states
                stack_at(lanes, ring, mask, n, b, mu, tol, IGNORE_SWITCHES, state)
    if a < b:
        state.angle = a
        return NO_RIGID_ANSWER
    return PROPAGATED


@leaf
def hit_ratio(leader):
    """Ω of the leader at the instant at which it hits the next: how its J continues."""
    return 1.0 - rise_of(leader) / math.sqrt(leader.rest * (1.0 + leader.s_l))


@always_inline
def hit(leader, struck, mu, state):
    """The leader, at its hitting angle, strikes the next: Chapman, eqs. 8-9, with friction.

    It turns on Ω_n times as fast as the next.
    """
    s_l, d_l = leader.s_l, leader.d_l
    cd = math.sqrt(leader.rest * (1.0 + s_l))
    m = state.m_end * (cd - rise_of(leader) - mu * d_l) / (cd + mu * s_l)
    if not m > 0.0:
        return JAMMED
    slow_down(state, m / (m * hit_ratio(leader) + struck.inertia))
    state.u_error += (4.0 * EPS + 2.0 * state.cut) * state.u
    state.u_round += 4.0 * EPS * state.u
    return PROPAGATED


@always_inline
def fall_angle(leader, strikes):
    """Angle at which the leader hits the next, or, where there is none in reach, tips over."""
    if strikes:
        s_l = leader.s_l
        return math.atan2(s_l, math.sqrt(leader.rest * (1.0 + s_l))) - turn_of(leader)
    return math.atan(leader.slender)


@always_inline
def close_fall(ring, mask, n, b, released, strikes, mu, state, outcome):
    """Account for a fall that has come to its end, then hit the next domino."""
    state.margin = 0.0 if outcome == STALLED else state.margin / released
    state.lowest_margin = min(state.lowest_margin, state.margin)
    if outcome != PROPAGATED:
        state.fraction = state.angle / b
        return outcome
    state.angle = b
    state.fraction = 1.0
    if strikes:
        if not state.composing:
            add_time(state)
        state.u_impact = state.u
        return hit(ring[n & mask], ring[(n + 1) & mask], mu, state)
    return PROPAGATED


@always_inline
def fall_and_hit(lanes, ring, mask, n, strikes, mu, gravity, rtol, state, exact_minimum, tape):
    """One fall of a chain and the hit that ends it; dominoes up to n+1 stand in the ring."""
    if state.composing:
        state.u = gravity * state.kappa  # something of its size: it weighs what may be cut
    released = begin_fall(ring[n & mask], mu, gravity, state)
    b = fall_angle(ring[n & mask], strikes)
    outcome = fall(lanes, ring, mask, n, 0.0, b, mu, gravity, rtol, state, exact_minimum, tape)
    outcome = close_fall(ring, mask, n, b, released, strikes, mu, state, outcome)
    if len(tape) > 0 and strikes and outcome == PROPAGATED:
        record_hit(tape, state, n)
    return outcome
