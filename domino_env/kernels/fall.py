"""One fall: from the hit on the leading domino until it hits the next, in intervals."""

import math

from domino_env.kernels import arrays, interval, records, stack
from domino_env.kernels.contact import (
    can_flush,
    lean_scale,
    place_contact,
    place_domino,
    ratio_bound,
)
from domino_env.kernels.jit import always_inline, borrow, internal, leaf, noinline
from domino_env.kernels.quadrature import ORDERS

TORQUE_ROUNDING = 8.0  # [EPS] relative error of a torque, per contact
HIT_ROUNDING = 4.0  # [EPS] relative error of u in a hit
FIRST_RULE = 3  # 14 nodes, where no decay is known or the stack is short
SHALLOW = 3  # number of first leaders, whose stacks are short and whose P and Q vary most
DEEP = 6  # last leader that may use panels with the finest rule only; later ones with any rule
LEAST_DECAY = 0.35  # of the logarithm of Legendre coefficients per order: the least that is assumed
LONGER = 4.0  # times the last interval: the decay there predicts little of one that is longer
MOST_INTERVALS = 4000  # of a fall; a few are used, some hundred near M = 0
REMAINDER = 1e-3  # of an interval: a shorter rest of the fall is added to it
GROWTH = 3.0  # factor from an interval to the largest length of the next, after one was halved
FAR = 10.0  # longest interval, in distances of its start from where P and Q are singular
# Lengths of an interval over the angle of the fall: below the first, errors are accepted; below the
# second, an interval that is still not resolved has no rigid answer.
SHORT, SHORTEST = 1e-9, 1e-14


@always_inline
def torque_bound(height, thickness):
    """Return the largest gravity torque of a domino over its inertia and g [1/m]."""
    return 1.5 / math.sqrt(height * height + thickness * thickness)


@internal
def initialise(state):
    """Set the state of a chain whose first domino has just been pushed."""
    state.u = state.push * state.push
    state.u_error = state.u_round = state.u_impact = 0.0
    state.time = state.time_low = state.time_error = state.time_round = 0.0
    state.worst = state.worst_round = 0.0
    state.angle = state.fraction = state.fall_time = state.margin = 0.0
    state.lowest_margin = 1.0
    state.switch_angle = state.speed_before = state.speed_after = 0.0
    state.flush_loss = state.slowest_at = 0.0
    state.m_end = state.tail_bound = state.kappa = state.noise = state.log_rho = state.last_h = 0.0
    state.gain, state.offset, state.least_start, state.composing = 1.0, 0.0, 0.0, False
    state.back = state.depth = state.last_due = 0
    state.flushes = state.releases = state.event_count = 0


@internal
def start_chain(layout, ring, state):
    """Place the first domino and push it."""
    initialise(state)
    place_domino(ring, arrays.ALL_KEPT, 0, layout, 0)
    state.kappa = torque_bound(layout.height[0], layout.thickness[0])


@always_inline
def add_next_domino(layout, ring, state, n):
    """Place domino n+1, if there is one, in front of leader n, and bound the tail behind n."""
    mask = state.mask
    if n + 1 < len(layout.thickness):
        place_domino(ring, mask, n + 1, layout, n + 1)
        place_contact(ring, mask, n, layout, n, n + 1)
        state.kappa = max(state.kappa, torque_bound(layout.height[n + 1], layout.thickness[n + 1]))
    if n > 0:
        behind = ring[(n - 1) & mask]
        ring[n & mask].tail = ring[n & mask].inertia + ratio_bound(behind) * behind.tail


@always_inline
def begin_fall(ring, state, n):
    """Reset the quantities of a single fall; return u at its start."""
    units = TORQUE_ROUNDING
    if arrays.is_uneven(ring[n & state.mask]) and arrays.conserves_energy(state):
        # u is a difference of energies there. Leans are not small where gaps are, and the rounding
        # of each contact adds to that of all behind it.
        units = TORQUE_ROUNDING + TORQUE_ROUNDING * state.depth
    state.noise = units * arrays.EPS * state.gravity * state.kappa
    state.fall_time = 0.0
    state.margin = state.u
    return state.u


@always_inline
def slow_down(state, keep):
    """Multiply the leader's angular velocity by `keep`, and u by its square."""
    square = keep * keep
    state.u *= square
    state.u_error *= square
    state.u_round *= square
    state.gain *= square
    state.offset *= square


@internal
def add_time(state):
    """Add the time of the last fall, by Kahan's summation: rounding errors do not accumulate."""
    y = state.fall_time - state.time_low
    total = state.time + y
    state.time_low = (total - state.time) - y
    state.time = total
    state.worst = max(state.worst, state.time_error / total)
    state.worst_round = max(state.worst_round, state.time_round / total)


@always_inline
def choose_rule(state, h, tol):
    """Return the rule expected to meet `tol` on an interval of length h, from the last decay."""
    if state.log_rho <= 0.0:
        return FIRST_RULE
    rho = max(state.log_rho + math.log(state.last_h / h), LEAST_DECAY)
    # the error of a Gauss rule is the square of the first neglected coefficient
    nodes = 0.5 * math.log(1.0 / tol) / rho
    for k in range(2 if h > LONGER * state.last_h else 1, len(ORDERS)):
        if ORDERS[k] >= nodes:
            return k
    return len(ORDERS) - 1


@internal
def stack_at(lanes, ring, n, state, angle, detect):
    """Compute M of the stack at one angle of the leader; return what `sweep` returns first."""
    count = stack.set_angles(lanes, 0, angle, 0.0)
    low, _, _ = stack.sweep(lanes, count, ring, n, state, 0.0, detect)
    state.m_end = lanes[arrays.SUM_M]
    state.depth = n - low
    return low


@noinline
def fall(lanes, ring, n, state, a, b, tape):
    """Advance leader n from angle a to b: update u, time and their errors; return the outcome.

    Every interval ends at b, after a step, or at a change of contact. If no rule resolves it, it
    is halved.
    """
    lanes, ring, tape = borrow((lanes, ring, tape))
    mask, finest = state.mask, len(ORDERS) - 1
    step, end, at_switch, least_rule, singular = b, b, False, 0, -math.inf
    due_contact = n
    for _ in range(MOST_INTERVALS):
        if a >= b:
            break
        if not at_switch:
            end = min(b, a + min(step, FAR * (a - singular)))
            if b - end < REMAINDER * (end - a):
                end = b
        h = end - a
        k = choose_rule(state, h, arrays.INTERVAL_SHARE * state.rtol)
        k = max(k, least_rule, FIRST_RULE if n < SHALLOW else 0)
        count = stack.set_angles(lanes, k, a, h)
        detect = stack.IGNORE_SWITCHES
        if mask != arrays.ONE_FOR_ALL:
            detect = stack.END_AT_SWITCH if at_switch else stack.END_AT_HIT
        low, tail, has_switch = stack.sweep(lanes, count, ring, n, state, h, detect)
        if has_switch:
            guess = stack.switch_guess(lanes, k, a, h, ring[low & mask].v_switch)
            end = stack.switch_angle(ring, state, n, low, a, end, guess)
            at_switch, due_contact = True, low
            if end - a > 4.0 * arrays.EPS * b:
                continue
            low = stack_at(lanes, ring, n, state, a, stack.END_AT_SWITCH)
        else:
            status, u_start = interval.UNRESOLVED, state.u
            ok, error = interval.affine_map(lanes, k, h, arrays.setting_of(state))
            if ok and state.composing:
                status = interval.compose(lanes, k, h, error, tail, state)
            elif ok:
                effort = interval.NEAR_STALL if k == finest or n > DEEP else interval.NORMAL
                if h <= SHORT * b:
                    effort = interval.LAST_RESORT
                status = interval.propagate(lanes, k, a, h, error, tail, state, effort)
            if status == arrays.STALLED:
                return arrays.STALLED
            if status == interval.UNRESOLVED:
                if ok and k < finest:
                    least_rule = k + 1
                    continue
                least_rule = 0
                if h <= SHORTEST * b:
                    state.angle = a
                    return arrays.NO_RIGID_ANSWER
                step = 0.5 * h
                at_switch = False
                continue
            if records.has_tape(tape):
                records.record_flips(tape, ring, state, n, low)
                records.record_interval(tape, state, n, a, h, k, low, u_start)
            least_rule = 0
            state.depth = n - low
            a = end
            step = max(step, GROWTH * h)
        if at_switch:
            at_switch, step = False, b
            is_flush = can_flush(ring[due_contact & mask])
            if is_flush:
                singular = max(singular, end - lean_scale(ring[due_contact & mask]))
            keep = stack.switch(ring, state, n, due_contact, low, end)
            if records.has_tape(tape):
                records.record_switch(tape, ring, state, n, due_contact, low, end, is_flush)
            if not keep > 0.0:
                state.angle = end
                return arrays.JAMMED
            state.flush_loss = max(state.flush_loss, 1.0 - keep)
            state.switch_angle, state.speed_before = end, math.sqrt(state.u)
            slow_down(state, keep)
            state.speed_after = math.sqrt(state.u)
            if a >= b:  # the hit follows at the same angle, with M of the new contacts
                stack_at(lanes, ring, n, state, b, stack.IGNORE_SWITCHES)
    if a < b:
        state.angle = a
        return arrays.NO_RIGID_ANSWER
    return arrays.PROPAGATED


@leaf
def omega_at_hit(leader):
    """Return Ω of the leader when it hits the next domino: every J is multiplied by it."""
    return 1.0 - arrays.rise_of(leader) / math.sqrt(leader.rest * (1.0 + leader.s_l))


@always_inline
def hit(leader, next_domino, state):
    """Apply the impact of the leader on the next domino: Chapman, eqs. 8-9, with friction.

    Returns PROPAGATED or JAMMED.
    """
    s_l, d_l, mu = leader.s_l, leader.d_l, state.friction
    cd = math.sqrt(leader.rest * (1.0 + s_l))
    # M of the old stack with the weights of the new one
    m = state.m_end * (cd - arrays.rise_of(leader) - mu * d_l) / (cd + mu * s_l)
    if not m > 0.0:
        return arrays.JAMMED
    slow_down(state, m / (m * omega_at_hit(leader) + next_domino.inertia))
    state.u_error += (HIT_ROUNDING * arrays.EPS + 2.0 * state.tail_bound) * state.u
    state.u_round += HIT_ROUNDING * arrays.EPS * state.u
    return arrays.PROPAGATED


@always_inline
def fall_angle(leader, strikes):
    """Return the angle at which the leader hits the next domino, or its tipping angle [rad]."""
    if strikes:
        s_l = leader.s_l
        return math.atan2(s_l, math.sqrt(leader.rest * (1.0 + s_l))) - arrays.turn_of(leader)
    return math.atan(leader.tan_phi)


@always_inline
def strikes_next(layout, n):
    """Return True if domino n has a next one within reach."""
    return n + 1 < len(layout.thickness) and layout.spacing[n] < layout.height[n]


@always_inline
def close_fall(ring, state, n, b, u_start, strikes, outcome):
    """Complete the results of a fall to angle b, with the hit at its end; return the outcome."""
    state.margin = 0.0 if outcome == arrays.STALLED else state.margin / u_start
    state.lowest_margin = min(state.lowest_margin, state.margin)
    if outcome != arrays.PROPAGATED:
        state.fraction = state.angle / b
        return outcome
    state.angle = b
    state.fraction = 1.0
    if strikes:
        if not state.composing:
            add_time(state)
        state.u_impact = state.u
        return hit(ring[n & state.mask], ring[(n + 1) & state.mask], state)
    return arrays.PROPAGATED


@always_inline
def fall_and_hit(lanes, ring, n, state, strikes, is_last, tape):
    """Advance a chain by one fall and the hit that ends it; return the outcome.

    strikes: True if the leader reaches a next domino. is_last: True if there is none.
    """
    if state.composing:
        state.u = state.gravity * state.kappa  # order of magnitude of u, for the bound on the tail
    u_start = begin_fall(ring, state, n)
    b = fall_angle(ring[n & state.mask], strikes)
    outcome = fall(lanes, ring, n, state, 0.0, b, tape)
    outcome = close_fall(ring, state, n, b, u_start, strikes, outcome)
    if outcome == arrays.PROPAGATED and not strikes and not is_last:
        return arrays.OUT_OF_REACH
    if records.has_tape(tape) and strikes and outcome == arrays.PROPAGATED:
        records.record_hit(tape, state, n)
    return outcome
