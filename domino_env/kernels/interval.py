"""Interval of a fall without a change of contact: its affine map u → E (u + U), and its time.

Within it u obeys the linear equation u′ = 2P(θ_n) + 2Q(θ_n) u. Its solution is an affine map,
computed by Gauss-Legendre quadrature of P and Q, and the time is the integral of 1/√u. No ODE
solver is involved.
"""

import math
from typing import NamedTuple

from domino_env.kernels import arrays, quadrature
from domino_env.kernels.arrays import COEF, EXPO, MAP_E, MAP_U, RATE, SLOWNESS, SPEED2
from domino_env.kernels.jit import always_inline, borrow, internal, noinline
from domino_env.kernels.quadrature import HIGH, ORDERS, RUNNING, TO_END, TO_START, TOP, WEIGHTS

ACCEPTED, UNRESOLVED = 0, 2  # results of `propagate` and `compose`, besides STALLED
UNDECIDED = 3  # result of `is_sure`, besides these two
NORMAL, NEAR_STALL, LAST_RESORT = 0, 1, 2  # effort of `propagate`

DEEP_MINIMUM = 0.3  # of the largest term of u: below it the minimum of u is located and examined
UNSURE = 10.0  # times the error of u at the start: likewise
# The sum of the last coefficients of a polynomial, this often, bounds its error between lanes: a
# narrow peak near an end leaves the very last ones small.
LAST_TERMS, TERMS_MARGIN = 4, 2.0
STALL_SHAPE = 1e-3  # of the largest term of u: largest error of u with which a stall is located
# A mismatch is the difference of a function at the ends of an interval from the polynomial through
# the nodes: it has the size of the first neglected Legendre coefficients.
SHARP = 1e-3  # mismatch above which 1/√u may have a narrow peak between the nodes of rule 3
SLOW = 4.0  # mismatch over the last two coefficients above which these decay slowly
LEAST_MISMATCH, MOST_MISMATCH = 1e-15, 0.5  # between rounding and no decay at all
# Bounds on rounding errors: of u at the end of an interval, and of the polynomial through up to 32
# lanes, in EPS times the largest term of u; of that polynomial in multiples of state.noise; of a
# time by panels, relative.
U_ROUNDING, LANE_ROUNDING, LANE_NOISE, PANEL_ROUNDING = 16.0, 64.0, 8.0, 1e-14


class MapError(NamedTuple):
    """Errors of the affine map of an interval."""

    log_e: float  # error of log E at the end
    u: float  # error of U at the end
    q: float  # mismatch of 2 Q h
    r: float  # mismatch of 2 P h / E


@always_inline
def integrate(lanes, values, k):
    """Integrate the polynomial through the nodes at `values` up to every node, into COEF.

    Returns its integral to the end, its values at both ends, and the largest size at a node.
    """
    m = ORDERS[k]
    total, low, high, size = 0.0, 0.0, 0.0, 0.0
    for j in range(m):
        lanes[COEF + j] = 0.0
    for i in range(m):
        y = lanes[values + 1 + i]
        total += WEIGHTS[k, i] * y
        low += TO_START[k, i] * y
        high += TO_END[k, i] * y
        size = max(size, abs(y))
        for j in range(m):
            lanes[COEF + j] += RUNNING[k, i, j] * y
    return total, low, high, size


@internal
def affine_map(lanes, k, h, setting):
    """Compute E and U of an interval at all lanes; return True if M is positive, and the errors."""
    m = ORDERS[k]
    end = m + 1
    for j in range(m + 2):
        if not lanes[arrays.SUM_M + j] > 0.0:
            return False, MapError(0.0, 0.0, 0.0, 0.0)
    lanes[MAP_E] = 1.0
    lanes[MAP_U] = 0.0
    if arrays.conserves_energy(setting):  # no quadrature is needed
        m0 = lanes[arrays.SUM_M]
        scale = 2.0 * setting.gravity / m0
        for j in range(1, m + 2):
            lanes[MAP_E + j] = m0 / lanes[arrays.SUM_M + j]
            lanes[MAP_U + j] = -scale * lanes[arrays.SUM_G + j]
        return True, MapError(0.0, 0.0, 0.0, 0.0)
    g2 = 2.0 * setting.gravity * h
    for j in range(m + 2):
        inv = 1.0 / lanes[arrays.SUM_M + j]
        lanes[EXPO + j] = -2.0 * h * lanes[arrays.SUM_D + j] * inv  # 2 Q h
        lanes[RATE + j] = g2 * lanes[arrays.SUM_G + j] * inv  # 2 P h, then 2 P h / E
    q_end, q_lo, q_hi, q_size = integrate(lanes, EXPO, k)
    for j in range(m):
        e = math.exp(lanes[COEF + j])
        lanes[MAP_E + 1 + j] = e
        lanes[RATE + 1 + j] /= e
    e_end = math.exp(q_end)
    lanes[MAP_E + end] = e_end
    lanes[RATE + end] /= e_end
    r_end, r_lo, r_hi, r_size = integrate(lanes, RATE, k)
    for j in range(m):
        lanes[MAP_U + 1 + j] = lanes[COEF + j]
    lanes[MAP_U + end] = r_end
    # the error of a Gauss rule is the square of the mismatch
    q = max(abs(q_lo - lanes[EXPO]), abs(q_hi - lanes[EXPO + end]))
    r = max(abs(r_lo - lanes[RATE]), abs(r_hi - lanes[RATE + end]))
    error_q, error_r = q * q / max(q_size, arrays.TINY), r * r / max(r_size, arrays.TINY)
    return True, MapError(error_q, error_r + r * q, q, r)


@always_inline
def end_interval(lanes, k, h, mismatch, tail, state):
    """Store the results of an accepted interval on which the next interval or the hit depends."""
    decay = min(max(mismatch, LEAST_MISMATCH), MOST_MISMATCH)
    state.log_rho = math.log(1.0 / decay) / ORDERS[k]
    state.last_h = h
    state.tail_bound = tail
    state.m_end = lanes[arrays.SUM_M + ORDERS[k] + 1]


@internal
def series_error(lanes, k):
    """Return a bound on the error between lanes of the polynomial through all lanes, in COEF."""
    size = 0.0
    for j in range(min(LAST_TERMS, ORDERS[k])):
        size += abs(lanes[COEF + ORDERS[k] + 1 - j])
    return TERMS_MARGIN * size


@noinline
def is_sure(lanes, k, size, u_low, map_error, tail, state):
    """Examine the sign of the lowest u of an interval, whose polynomial u is in the lanes.

    Returns ACCEPTED if it is certain, UNDECIDED if earlier errors or rounding decide it, UNRESOLVED
    if a finer interval may, and, for a stall, if it cannot be located; and True if rounding decides
    it.
    """
    lanes = borrow(lanes)
    last = ORDERS[k] + 1
    lowest, growth = lanes[SPEED2], 1.0
    for j in range(1, last + 1):
        lowest = min(lowest, lanes[SPEED2 + j])
        growth = max(growth, lanes[MAP_E + j])
    between = map_error + series_error(lanes, k)
    rounding = (U_ROUNDING + LANE_ROUNDING) * arrays.EPS * size + LANE_NOISE * state.noise
    earlier = rounding + growth * (state.u_error + tail * state.u)
    is_rounding = abs(u_low) <= rounding + growth * state.u_round
    # u at a lane has no error of interpolation
    if abs(u_low) > between + earlier or -lowest > map_error + earlier:
        is_vague = u_low <= 0.0 and between > STALL_SHAPE * size
        return UNRESOLVED if is_vague else ACCEPTED, is_rounding
    return UNRESOLVED if between > earlier else UNDECIDED, is_rounding


@always_inline
def doubt_outcome(state, sure, rounding_decides):
    """Make the error estimate infinite unless it is certain whether the wave stalls."""
    if sure != ACCEPTED:
        state.worst = math.inf
        if rounding_decides:
            state.worst_round = math.inf


@noinline
def propagate(lanes, k, a, h, error, tail, state, effort):
    """Advance u and the time over the interval [a, a + h], whose map is in the lanes.

    tail: bound on the change of u by neglected dominoes, over u.
    effort: NEAR_STALL to integrate 1/√u of the polynomial u in small panels where only 1/√u is
        unresolved; LAST_RESORT to accept the error, however large.
    Returns ACCEPTED: the state has advanced, with its errors. UNRESOLVED: the rule is too coarse,
    and the state is unchanged. STALLED: u reaches zero, at state.angle.
    """
    lanes = borrow(lanes)
    tol = arrays.INTERVAL_SHARE * state.rtol
    last_resort = effort == LAST_RESORT
    last = ORDERS[k] + 1
    u0 = state.u
    size, u_low = u0, u0
    lanes[SPEED2] = u0
    for j in range(1, last + 1):
        size = max(size, abs(lanes[MAP_U + j]))
        u = lanes[MAP_E + j] * (u0 + lanes[MAP_U + j])
        u_low = min(u_low, u)
        lanes[SPEED2 + j] = u
    e_end, u_end = lanes[MAP_E + last], lanes[SPEED2 + last]
    local = (u0 + abs(lanes[MAP_U + last])) * error.log_e + error.u
    map_error = error.r + error.q * size
    deep = max(DEEP_MINIMUM * size, UNSURE * state.u_error)
    is_located = state.exact_minimum or u_low < deep
    x_low, sure, rounding_decides = 0.0, ACCEPTED, False
    if is_located:
        quadrature.series(lanes, SPEED2, k)
        x_low, u_low = quadrature.lowest_point(lanes, SPEED2, k)
    if u_low < deep:
        sure, rounding_decides = is_sure(lanes, k, size, u_low, map_error, tail, state)
        if sure == UNRESOLVED and not last_resort:
            return UNRESOLVED
    if u_low <= 0.0:
        doubt_outcome(state, sure, rounding_decides)
        state.angle = a + h * quadrature.first_zero(lanes, SPEED2, k, x_low)
        return arrays.STALLED
    for j in range(last + 1):
        lanes[SLOWNESS + j] = 1.0 / math.sqrt(lanes[SPEED2 + j])
    # by the nodes: time over h and minus its derivative by u at the start; 1/√u at both ends, and
    # its last two coefficients
    t, sens, f_lo, f_hi, f_high, f_top = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(1, last):
        f = lanes[SLOWNESS + j]
        w = WEIGHTS[k, j - 1] * f
        t += w
        sens += 0.5 * w * f * f * lanes[MAP_E + j]
        f_lo += TO_START[k, j - 1] * f
        f_hi += TO_END[k, j - 1] * f
        f_high += HIGH[k, j - 1] * f
        f_top += TOP[k, j - 1] * f
    mismatch = max(abs(f_lo - lanes[SLOWNESS]), abs(f_hi - lanes[SLOWNESS + last])) / t
    high, top = 0.0, 0.0
    if k > 0:
        # The mismatch may be zero by chance. If all coefficients decay like a power series, the
        # last two bound the first neglected ones.
        high, top = abs(f_high) / t, abs(f_top) / t
        root = math.sqrt(high) if k == 1 else math.sqrt(math.sqrt(high))
        mismatch = max(mismatch, high * root, top * math.sqrt(math.sqrt(top)))
    # of 1/√u at the nodes, with a margin of mismatch^(-1/8)
    node_error = mismatch * t / math.sqrt(math.sqrt(math.sqrt(max(mismatch, arrays.TINY))))
    if k == 3 and mismatch > SHARP:
        # the coefficients of a small narrow peak decay slowly from a low level: use their decay
        decay = min(mismatch / max(high, top, arrays.TINY), 1.0)
        node_error = max(node_error, t * quadrature.power(decay, ORDERS[k] // 2))
    t_error = 2.0 * mismatch * (node_error + map_error * sens)
    if not ((local * sens <= tol * t and local * e_end <= tol * u_end) or last_resort):
        return UNRESOLVED
    state.slowest_at = -1.0
    if t_error > tol * t:
        if effort == NORMAL:
            return UNRESOLVED
        if not is_located:
            quadrature.series(lanes, SPEED2, k)
            x_low, u_low = quadrature.lowest_point(lanes, SPEED2, k)
        u_error = series_error(lanes, k) + map_error / ORDERS[k]
        t_slow, sens_slow = quadrature.slow_time(lanes, last + 1, x_low, lanes[:0])
        is_rounding = u_error <= LANE_ROUNDING * arrays.EPS * size + LANE_NOISE * state.noise
        if not (u_error * sens_slow <= tol * t_slow or is_rounding or last_resort):
            return UNRESOLVED
        t, sens, t_error = t_slow, sens_slow, u_error * sens_slow + PANEL_ROUNDING * t_slow
        state.slowest_at = x_low
        if is_rounding:
            state.time_round += h * t_error
    elif mismatch > SLOW * max(high, top):
        # with a slow decay the first coefficients that the Gauss rule integrates wrongly are hardly
        # smaller than the last two
        decay = mismatch / (mismatch + max(high, top))
        t_error = max(t_error, t * min(max(high, top) * quadrature.power(decay, ORDERS[k]), tol))
    doubt_outcome(state, sure, rounding_decides)
    noise = U_ROUNDING * arrays.EPS * size + state.noise
    neglected = tail * u0
    state.time_error += h * (sens * (state.u_error + local + neglected + noise) + t_error)
    state.time_round += h * (sens * (state.u_round + noise) + arrays.EPS * t)
    state.u_error = e_end * (state.u_error + local + neglected) + noise * max(e_end, 1.0)
    state.u_round = e_end * state.u_round + noise * max(e_end, 1.0)
    state.u = u_end
    state.fall_time += h * t
    state.margin = min(state.margin, u_low)
    end_interval(lanes, k, h, max(mismatch, map_error / size), tail, state)
    return ACCEPTED


@internal
def compose(lanes, k, h, error, tail, state):
    """Compose the map of an interval with that of all falls so far, for any u_0 at the push.

    Returns ACCEPTED, or UNRESOLVED with the state unchanged.
    """
    tol = arrays.INTERVAL_SHARE * state.rtol
    last = ORDERS[k] + 1
    size = arrays.TINY
    for j in range(1, last + 1):
        size = max(size, abs(lanes[MAP_U + j]))
    quadrature.series(lanes, MAP_U, k)
    mismatch = abs(lanes[COEF + last]) + abs(lanes[COEF + last - 1])
    mismatch += (error.r + error.q * size) / ORDERS[k]
    mismatch -= LANE_NOISE * state.noise  # rounding does not count
    if not (error.log_e <= tol and error.u <= tol * size and mismatch <= tol * size):
        return UNRESOLVED
    _, u_low = quadrature.lowest_point(lanes, MAP_U, k)
    gain = max(state.gain, arrays.TINY)
    state.least_start = max(state.least_start, -(state.offset + u_low) / gain)
    state.offset = lanes[MAP_E + last] * (state.offset + lanes[MAP_U + last])
    state.gain *= lanes[MAP_E + last]
    end_interval(lanes, k, h, mismatch / size, tail, state)
    return ACCEPTED
