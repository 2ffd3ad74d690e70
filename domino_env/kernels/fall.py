"""One fall: from the moment the leader is hit until it hits the next, interval by interval."""

import math

from domino_env.kernels.front import add_time, begin_fall, slow_down
from domino_env.kernels.interval import (
    CREEP,
    DEAD,
    LAST_RESORT,
    ROUGH,
    RUN,
    affine_map,
    compose,
    ride,
)
from domino_env.kernels.jit import always_inline, internal, leaf, noinline
from domino_env.kernels.links import can_flush
from domino_env.kernels.quadrature import ORDERS
from domino_env.kernels.slots import (
    EPS,
    JAMMED,
    NO_RIGID_ANSWER,
    PROPAGATED,
    STALLED,
    SUM_M,
    rise_of,
    turn_of,
)
from domino_env.kernels.stack import TO_HIT, TO_SWITCH, UNWATCHED, spread, sweep
from domino_env.kernels.switch import switch, switch_angle, switch_guess
from domino_env.kernels.tape import note_flips, note_hit, note_ride, note_switch


@always_inline
def order_for(state, h, tol):
    """The rule expected to meet `tol` on an interval of length h, from the last one's decay."""
    if state.log_rho <= 0.0:
        return 3
    rho = max(state.log_rho + math.log(state.last_h / h), 0.35)
    need = 0.5 * math.log(1.0 / tol) / rho
    # A short interval tells little of what a much longer one holds: look with more than six nodes.
    for k in range(2 if h > 4.0 * state.last_h else 1, len(ORDERS)):
        if ORDERS[k] >= need:
            return k
    return len(ORDERS) - 1


@internal
def stack_at(lanes, ring, mask, n, angle, mu, tol, watch, state):
    """M of the stack at one angle of the leader; returns the lowest domino included."""
    count = spread(lanes, 0, angle, 0.0)
    low, _, _ = sweep(lanes, count, ring, mask, n, state, mu, 0.0, 0.0, 0.3 * tol, watch)
    state.m_end = lanes[SUM_M]
    state.depth = n - low
    return low


@noinline
def fall(lanes, ring, mask, n, a, b, mu, gravity, rtol, state, deep, tape):
    """Let leader n fall from angle a to b: u, time and their errors move on in `state`."""
    step, end, located, floor_order = b, b, False, 0
    due_link = n
    tol = 0.3 * rtol
    for _ in range(4000):
        if a >= b:
            break
        if not located:
            end = min(b, a + step)
            if b - end < 1e-3 * (end - a):
                end = b
        h = end - a
        k = max(order_for(state, h, tol), floor_order, 3 if n < 3 else 0)
        count = spread(lanes, k, a, h)
        force = 2.0 * h * gravity * state.kappa / state.u
        watch = UNWATCHED if mask == 0 else (TO_SWITCH if located else TO_HIT)
        low, tail, flagged = sweep(
            lanes, count, ring, mask, n, state, mu, force, h, 0.3 * tol, watch
        )
        if flagged:
            guess = switch_guess(lanes, k, a, h, ring[low & mask].due)
            end = switch_angle(ring, mask, n, low, a, end, guess, mu)
            located, due_link = True, low
            if end - a > 4.0 * EPS * b:
                continue
            low = stack_at(lanes, ring, mask, n, a, mu, tol, TO_SWITCH, state)
        else:
            done, came = ROUGH, state.u
            ok, e_error, u_error, q_off, r_off = affine_map(lanes, k, h, mu, gravity)
            if ok and state.composing:
                done = compose(lanes, k, h, e_error, u_error, q_off, r_off, tail, tol, state)
            elif ok:
                creep = CREEP if k == len(ORDERS) - 1 or n > 6 else RUN
                if h <= 1e-9 * b:
                    creep = LAST_RESORT
                errors = (e_error, u_error, q_off, r_off)
                done = ride(lanes, k, a, h, errors, tail, tol, state, deep, creep)
            if done == DEAD:
                return STALLED
            if done == ROUGH:
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
                note_flips(tape, ring, mask, n, low, state)
                note_ride(tape, state, n, a, h, k, low, came)
            floor_order = 0
            state.depth = n - low
            a = end
            step = max(step, 3.0 * h)
        if located:
            located, step = False, b
            flushes = can_flush(ring[due_link & mask])
            keep = switch(ring, mask, n, due_link, low, end, mu, state)
            if len(tape) > 0:
                note_switch(tape, ring, mask, n, due_link, low, end, flushes, state)
            if not keep > 0.0:
                state.angle = end
                return JAMMED
            state.flush_loss = max(state.flush_loss, 1.0 - keep)
            state.switched, state.w_before = end, math.sqrt(state.u)
            slow_down(state, keep)
            state.w_after = math.sqrt(state.u)
            if a >= b:  # the hit follows at once: its M is that of the new states
                stack_at(lanes, ring, mask, n, b, mu, tol, UNWATCHED, state)
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
        state.part = state.angle / b
        return outcome
    state.angle = b
    state.part = 1.0
    if strikes:
        if not state.composing:
            add_time(state)
        state.u_impact = state.u
        return hit(ring[n & mask], ring[(n + 1) & mask], mu, state)
    return PROPAGATED


@always_inline
def step(lanes, ring, mask, n, strikes, mu, gravity, rtol, state, deep, tape):
    """One fall of a chain and the hit that ends it; dominoes up to n+1 stand in the ring."""
    if state.composing:
        state.u = gravity * state.kappa  # something of its size: it weighs what may be cut
    released = begin_fall(ring[n & mask], mu, gravity, state)
    b = fall_angle(ring[n & mask], strikes)
    outcome = fall(lanes, ring, mask, n, 0.0, b, mu, gravity, rtol, state, deep, tape)
    outcome = close_fall(ring, mask, n, b, released, strikes, mu, state, outcome)
    if len(tape) > 0 and strikes and outcome == PROPAGATED:
        note_hit(tape, state, n)
    return outcome
