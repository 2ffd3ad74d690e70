"""A row of equal dominoes, whose falls share one stack that grows by a link a fall."""

from domino_env.kernels.fall import close_fall, fall, fall_angle
from domino_env.kernels.front import begin_fall
from domino_env.kernels.interval import CREEP, DEAD, FINE, ROUGH, affine_map, ride
from domino_env.kernels.jit import always_inline, internal, noinline
from domino_env.kernels.links import at_or_zero, step_of
from domino_env.kernels.quadrature import ORDERS
from domino_env.kernels.records import record
from domino_env.kernels.slots import JAC, MAP_U, PROPAGATED, STALLED, WGT, is_uneven
from domino_env.kernels.stack import lead, lean, lean_free, spread, tail_size
from domino_env.kernels.tape import note_hit, note_ride


@internal
def is_uniform(row):
    """Whether one stack serves every fall: all parts equal, and no link ever switches.

    The ground is flat or an even slope.
    """
    spacing, thickness, height, density = row.spacing, row.thickness, row.height, row.density
    s, d, length = spacing[0], thickness[0], height[0]
    if s * (s + 2.0 * d) > length * length or s >= length or step_of(row, 0, 1) != 0.0:
        return False
    for i in range(1, len(thickness)):
        if thickness[i] != d or height[i] != length or density[i] != density[0]:
            return False
        if i < len(spacing) and spacing[i] != s:
            return False
        if at_or_zero(row.tilt, i) != at_or_zero(row.tilt, 0):
            return False
        if at_or_zero(row.rise, i - 1) != at_or_zero(row.rise, 0):
            return False
    return True


@internal
def uniform_order(lanes, domino, count, b, mu, gravity, tol):
    """Rule that resolves P and Q of a uniform stack; -1 where none does."""
    for k in range(1, len(ORDERS)):
        lanes_used = spread(lanes, k, 0.0, b)
        lead(lanes, lanes_used, domino, mu)
        for _ in range(min(count - 2, 12)):
            if mu > 0.0:
                lean(lanes, lanes_used, domino, mu)
            else:
                lean_free(lanes, lanes_used, domino)
        ok, e_error, u_error, _, _ = affine_map(lanes, k, b, mu, gravity)
        if ok and e_error <= 0.1 * tol and u_error <= 0.1 * tol * lanes[MAP_U + ORDERS[k] + 1]:
            return k
    return -1


@always_inline
def finer_rule(domino, k, missed):
    """The rule after one that did not resolve the time, for so many falls on end."""
    return min(k + 1, len(ORDERS) - 1) if is_uneven(domino) and missed > 1 else k


@noinline
def uniform_chain(lanes, ring, count, mu, gravity, rtol, state, deep, arrivals, tape):
    """Falls 0 … N-2 of a uniform row: each adds one link to the same lanes until the tail is dead.

    Returns (outcome, falls done).
    """
    domino = ring[0]
    b = fall_angle(domino, True)
    tol = 0.3 * rtol
    k = uniform_order(lanes, domino, count, b, mu, gravity, tol)
    if k < 0:
        return PROPAGATED, 0
    lanes_used = spread(lanes, k, 0.0, b)
    lead(lanes, lanes_used, domino, mu)
    inertia = domino.inertia
    e_error, u_error, q_off, r_off, tail, behind = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
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
                    lean(lanes, lanes_used, domino, mu)
                    ratio = abs(lanes[WGT] / before)
                else:
                    before = lanes[JAC]
                    lean_free(lanes, lanes_used, domino)
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
            ok, e_error, u_error, q_off, r_off = affine_map(lanes, k, b, mu, gravity)
            if not ok:
                return PROPAGATED, n
        errors = (e_error, u_error, q_off, r_off)
        done = ride(lanes, k, 0.0, b, errors, tail, tol, state, deep, CREEP)
        if done == FINE:
            state.depth = depth
            if len(tape) > 0:
                note_ride(tape, state, n, 0.0, b, k, n - depth, released)
        missed = missed + 1 if done == ROUGH else 0
        if done == ROUGH:
            k = finer_rule(domino, k, missed)
            outcome = fall(lanes, ring, 0, n, 0.0, b, mu, gravity, rtol, state, deep, tape)
            depth, closed = 0, False  # the lanes were used: begin again
            lanes_used = spread(lanes, k, 0.0, b)
            lead(lanes, lanes_used, domino, mu)
        else:
            outcome = STALLED if done == DEAD else PROPAGATED
        outcome = close_fall(ring, 0, n, b, released, True, mu, state, outcome)
        if len(tape) > 0 and outcome == PROPAGATED:
            note_hit(tape, state, n)
        record(arrivals, n, outcome, state)
        if outcome != PROPAGATED:
            return outcome, n
    return PROPAGATED, count - 1
