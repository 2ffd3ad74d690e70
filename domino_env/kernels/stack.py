"""The stack: all dominoes that lean on the leader, and its changes of contact.

All lanes advance along the stack together, one contact at a time. Newton's method locates the
angle of the leader at which faces meet or a contact separates.
"""

import math

from domino_env.kernels import arrays
from domino_env.kernels.arrays import DRV, EXPO, JAC, SIN, SUM_D, SUM_G, SUM_M, VER, WGT
from domino_env.kernels.contact import (
    body_of,
    can_flush,
    catch_up,
    contact_at,
    corner,
    flush,
    past_flush,
    ratio_bound,
    separate,
    shape_of,
    sin_versine,
    span2,
    stack_terms,
    tip,
)
from domino_env.kernels.jit import always_inline, borrow, internal, noinline
from domino_env.kernels.quadrature import ORDERS, POSITIONS

# ends of an interval: each has its own changes of contact for `sweep` to detect, the first none
IGNORE_SWITCHES, END_AT_HIT, END_AT_SWITCH = 0, 1, 2
# Margins relative to the 1 - cos θ at which a contact changes: from the first below it on, the
# contact is examined; from the second above it on, an earlier cut of the stack left the change out.
DUE_MARGIN, MISSED_MARGIN = 1e-6, 1e-9
ANGLE_ERROR = 1e-12  # relative error of 1 - cos θ at an angle found by `switch_angle`
EARLY_SHARE = 1e-3  # of IMPACT_TOLERANCE: a contact farther past its change changed earlier
HIT_LAG = 1e-12  # [rad] of the leader: a change of contact so little after a hit is made before it
NEWTON_TOLERANCE = 1e-10  # of the bracket: the error is the square of the last step
CANCELLATION = 10.0  # of Σ w I J⁻ in a face impact, above which the neglected tail counts
MIN_WEIGHT_RATIO = 1e-4  # old weight over new, below which their ratio is not reliable

# coefficients of the Taylor series of sin and cos, by the power of x
_ODD = [(-1.0) ** n / math.factorial(2 * n + 1) for n in range(10)]
S3, S5, S7, S9, S11, S13, S15, S17 = _ODD[1:9]
_EVEN = [(-1.0) ** n / math.factorial(2 * n) for n in range(10)]
C2, C4, C6, C8, C10, C12, C14, C16, C18 = _EVEN[1:10]


@always_inline
def half_angle(x):
    """Return sin and cos of x in [0, π/4] by series, which vectorise; library functions do not."""
    q = x * x
    s = S3 + q * (S5 + q * (S7 + q * (S9 + q * (S11 + q * (S13 + q * (S15 + q * S17))))))
    c = C4 + q * (C6 + q * (C8 + q * (C10 + q * (C12 + q * (C14 + q * (C16 + q * C18))))))
    return x + x * (q * s), 1.0 + q * (C2 + q * c)


@always_inline
def set_angles(lanes, k, a, h):
    """Write sin θ and 1 - cos θ at the lanes of the interval [a, a + h]; return their number."""
    count = ORDERS[k] + 2
    for j in range(count):
        lanes[EXPO + j] = 0.5 * (a + h * POSITIONS[k, j])
    for j in range(count):  # in a loop without table, so that it vectorises
        s, c = half_angle(lanes[EXPO + j])
        lanes[SIN + j] = 2.0 * s * c
        lanes[VER + j] = 2.0 * s * s
    return count


@always_inline
def add_leader(lanes, count, leader, setting):
    """Start the sums with the leading domino.

    If energy is conserved, SUM_G is the change of potential energy in the interval so far, over g.
    """
    body = body_of(leader)
    for j in range(count):
        lanes[WGT + j] = 1.0
        lanes[JAC + j] = 1.0
        lanes[DRV + j] = 0.0
        terms = stack_terms(body, lanes[SIN + j], lanes[VER + j], 1.0, 1.0, 0.0)
        lanes[SUM_M + j], lanes[SUM_G + j], lanes[SUM_D + j] = terms
        if arrays.conserves_energy(setting):
            lanes[SUM_G + j] = 0.0
    if arrays.conserves_energy(setting):
        add_energy(lanes, count, body)
    leader.end_weight = 1.0


@always_inline
def add_energy(lanes, count, body):
    """Add the energy over g that a domino has released in the interval so far to SUM_G."""
    # terms of a domino are subtracted before those of others are added: small changes stay exact
    half, tan_phi = body.half_weight, body.tan_phi
    at_start = tan_phi * lanes[SIN] - lanes[VER]
    for j in range(count):
        lanes[SUM_G + j] += half * ((tan_phi * lanes[SIN + j] - lanes[VER + j]) - at_start)


@always_inline
def add_behind(lanes, count, contact, setting, kind):
    """Add the domino behind a contact; if energy is conserved to M only, as w = J then.

    kind: `tip` or `corner`, so that each has a loop of its own.
    """
    shape, body, mu = shape_of(contact), body_of(contact), setting.friction
    if arrays.conserves_energy(setting):
        for j in range(count):
            s, v, omega, _, _ = kind(lanes[SIN + j], lanes[VER + j], shape, 0.0)
            jac = omega * lanes[JAC + j]
            lanes[SIN + j], lanes[VER + j], lanes[JAC + j] = s, v, jac
            lanes[SUM_M + j] += body.inertia * jac * jac
        return
    for j in range(count):
        s, v, omega, psi, ratio = kind(lanes[SIN + j], lanes[VER + j], shape, mu)
        jac = lanes[JAC + j]
        drv = omega * lanes[DRV + j] + psi * jac * jac
        jac = omega * jac
        w = lanes[WGT + j] * ratio
        lanes[SIN + j], lanes[VER + j] = s, v
        lanes[WGT + j], lanes[JAC + j], lanes[DRV + j] = w, jac, drv
        m, g, d = stack_terms(body, s, v, w, jac, drv)
        lanes[SUM_M + j] += m
        lanes[SUM_G + j] += g
        lanes[SUM_D + j] += d


@internal
def add_domino(lanes, count, contact, setting):
    """Advance all lanes over a contact and add the domino behind it to the sums."""
    if contact.kind == arrays.TIP:
        add_behind(lanes, count, contact, setting, tip)
    else:
        add_behind(lanes, count, contact, setting, corner)
    if arrays.conserves_energy(setting):
        add_energy(lanes, count, body_of(contact))


@always_inline
def weights(setting):
    """Return the offset of the lanes of w, which is J if energy is conserved."""
    return JAC if arrays.conserves_energy(setting) else WGT


@always_inline
def force_bound(state, h):
    """Return a bound on 2 h G / (I u) of a domino, in an interval of length h."""
    return 2.0 * h * state.gravity * state.kappa / state.u


@always_inline
def tail_bound(lanes, count, setting, force, h, tail):
    """Return a bound on the change of u by the dominoes behind the cut, in all lanes, over u.

    force: from `force_bound`. h: length of the interval [rad].
    tail: bound on Σ I w behind the cut, over w of the last domino included.
    """
    largest = 0.0
    lightest = lanes[SUM_M]
    for j in range(count):
        jac = abs(lanes[JAC + j])
        if arrays.conserves_energy(setting):
            x = jac * (force + jac)
        else:
            x = abs(lanes[WGT + j]) * (force + h * abs(lanes[DRV + j]) + jac)
        if x > largest:
            largest = x
        if lanes[SUM_M + j] < lightest:
            lightest = lanes[SUM_M + j]
    return largest * tail / max(lightest, arrays.TINY)


@noinline
def sweep(lanes, count, ring, n, state, h, detect):
    """Add the dominoes behind leader n to the sums until the rest is negligible.

    h: length of the interval. detect: IGNORE_SWITCHES, END_AT_HIT or END_AT_SWITCH.
    Returns (lowest domino included, bound on the tail, False); at the first contact found that
    changes within the interval, (this contact, 0, True). state.last_due is the lowest contact that
    changes at the very end of the interval, n if none does.
    """
    lanes, ring = borrow((lanes, ring))
    mask, setting, force = state.mask, arrays.setting_of(state), force_bound(state, h)
    tol = arrays.TAIL_SHARE * (arrays.INTERVAL_SHARE * setting.rtol)
    end = count - 1
    add_leader(lanes, count, ring[n & mask], setting)
    back = state.back
    first_check = max(4, state.depth - 2)  # near the cut of the last interval
    oldest = back if mask == arrays.ONE_FOR_ALL else max(back, n - mask)
    state.last_due = n
    i = n
    while i > oldest:
        i -= 1
        contact = ring[i & mask]
        if lanes[VER + end] >= contact.v_switch * (1.0 - DUE_MARGIN) and detect != IGNORE_SWITCHES:
            if lanes[VER] > contact.v_switch * (1.0 + MISSED_MARGIN):
                catch_up(contact, i, lanes[VER], state)
                if contact.kind == arrays.SEPARATED:
                    return i + 1, 0.0, False
            dv = lanes[VER + end] - contact.v_switch
            if detect == END_AT_HIT and dv + HIT_LAG * lanes[SIN + end] * lanes[JAC + end] >= 0.0:
                return i, 0.0, True
            if detect == END_AT_SWITCH:
                if past_flush(contact, dv) >= EARLY_SHARE * arrays.IMPACT_TOLERANCE:
                    return i, 0.0, True
                if past_flush(contact, dv) >= -arrays.IMPACT_TOLERANCE:
                    state.last_due = i  # it changes with the contact that ends the interval
        add_domino(lanes, count, contact, setting)
        contact.end_weight = lanes[weights(setting) + end]
        reached = n - i
        if reached >= first_check and reached % 2 == 0 and i > back:
            tail = tail_bound(lanes, count, setting, force, h, contact.tail - contact.inertia)
            if tail <= tol:
                return i, tail, False
    if i > back:  # the ring is shorter than the chain
        return i, tail_bound(lanes, count, setting, force, h, ring[i & mask].tail), False
    return i, 0.0, False


@internal
def renew_tails(ring, mask, low, n):
    """Update the bounds T_i on Σ_{k ≤ i} I_k w_k / w_i from the lowest domino up to the leader.

    T_i = I_i + |B/A| T_{i-1}. As θ only grows, |B/A| of a contact only falls until its faces meet;
    then Ω ≤ (1 - p² - e² + d²)/2 bounds it. So a bound of an earlier interval remains valid.
    """
    for i in range(low + 1, n + 1):
        previous, domino = ring[(i - 1) & mask], ring[i & mask]
        x2 = span2(previous)
        ratio = 0.5 * (1.0 - x2)
        weight, bound = abs(domino.end_weight), ratio_bound(previous)
        if weight > arrays.TINY:
            ratio = max(ratio, min(abs(previous.end_weight) / weight, bound))
        else:
            ratio = bound
        domino.tail = domino.inertia + ratio * previous.tail


@internal
def switch_guess(lanes, k, a, h, v_switch):
    """Return a guess of the leader's angle at which contact i changes, by a cubic between lanes.

    The lanes hold 1 - cos θ_{i+1}, and v_switch is its value at the change.
    """
    last = ORDERS[k] + 1
    j = 1
    while j < last and lanes[VER + j] < v_switch:
        j += 1
    v0, v1 = lanes[VER + j - 1], lanes[VER + j]
    rate0, rate1 = lanes[SIN + j - 1] * lanes[JAC + j - 1], lanes[SIN + j] * lanes[JAC + j]
    x0, x1 = POSITIONS[k, j - 1], POSITIONS[k, j]
    if not (v0 < v_switch < v1 and rate0 * h > arrays.TINY and rate1 * h > arrays.TINY):
        return a + h * x1
    t = (v_switch - v0) / (v1 - v0)
    m0, m1 = (v1 - v0) / (rate0 * h), (v1 - v0) / (rate1 * h)
    s = 1.0 - t
    x = x0 * s * s * (1.0 + 2.0 * t) + x1 * t * t * (3.0 - 2.0 * t) + t * s * (m0 * s - m1 * t)
    return a + h * min(max(x, x0), x1)


@internal
def switch_angle(ring, state, n, i, a, b, guess):
    """Return the leader's angle in [a, b] at which contact i changes, by Newton's method."""
    mask, mu = state.mask, state.friction
    v_switch = ring[i & mask].v_switch
    lo, hi, x = a, b, guess
    for _ in range(100):  # bisection alone would take 35
        s, v = sin_versine(x)
        jac = 1.0
        for j in range(n - 1, i, -1):
            s, v, omega, _, _ = contact_at(ring[j & mask], s, v, mu)
            jac *= omega
        dv = v - v_switch
        if dv >= 0.0:
            hi = x
        else:
            lo = x
        new = x - dv / max(s * jac, arrays.TINY)
        if abs(new - x) <= NEWTON_TOLERANCE * (b - a):
            return min(max(new, a), b)
        if not (lo < new < hi):
            new = 0.5 * (lo + hi)
            if new <= lo or new >= hi:
                return hi
        x = new
    return x


@internal
def count_toppled(ring, state, n, s, v):
    """Return the number of dominoes 0 … n that have toppled; apply changes that a cut left out.

    s, v: sin θ and 1 - cos θ of domino n.
    Dominoes behind a separated contact, or no longer in the ring, count as toppled.
    """
    mask, mu, toppled, i, back = state.mask, state.friction, 0, n, state.back
    while True:
        if s > ring[i & mask].tan_phi * (1.0 - v):
            toppled += 1
        if i == back:
            return toppled + i
        i -= 1
        if mask != arrays.ONE_FOR_ALL and n - i > mask:
            return toppled + i + 1
        contact = ring[i & mask]
        if mask != arrays.ONE_FOR_ALL and v > contact.v_switch * (1.0 + MISSED_MARGIN):
            catch_up(contact, i, v, state)
            if contact.kind == arrays.SEPARATED:
                return toppled + i + 1
        s, v, _, _, _ = contact_at(contact, s, v, mu)


@internal
def add_tail_error(state, m_before, m_end):
    """Add to the error of u that of a face impact which leaves little of ω, by the neglected tail.

    m_before: Σ w I J⁻ with w of the new contacts. m_end: likewise, if the old w had been scaled.
    """
    error = state.tail_bound * abs(m_end)
    if error > abs(m_before):
        state.worst = math.inf
    elif abs(m_end) > CANCELLATION * abs(m_before):
        state.u_error += 2.0 * error / abs(m_before) * state.u


@noinline
def switch(ring, state, n, due_contact, low, angle):
    """Change every contact that is due at the leader's angle; return ω⁺/ω⁻ of the impact.

    The angle is that of due_contact; the lowest contact that changes with it is state.last_due.
    Faces that meet at the same instant do so in one impact: Σ w I J⁺ω⁺ = Σ w I J⁻ω⁻ with w of the
    new contacts, J⁺ = 0 behind the first of them. state.m_end holds Σ w I J⁻ with the old w down
    to domino `low`; behind the last contact that changes, w changes by a common factor.
    Returns 1 for a separation and without friction. A ratio that is not positive means a jam; it is
    0 if Σ w I J⁺ is 0.
    """
    ring = borrow(ring)
    mask, mu = state.mask, state.friction
    s, v = sin_versine(angle)
    jac, w_old, w_new = 1.0, 1.0, 1.0
    m_old = ring[n & mask].inertia  # Σ w_old I J⁻ so far
    m_before, m_after = m_old, m_old  # Σ w_new I J⁻, Σ w_new I J⁺
    stop = min(state.last_due, due_contact)
    has_flush = False
    i = n
    while i > stop:
        i -= 1
        contact = ring[i & mask]
        dv = v - contact.v_switch
        is_due = past_flush(contact, dv) >= -arrays.IMPACT_TOLERANCE
        if not can_flush(contact) and dv >= -ANGLE_ERROR * contact.v_switch:
            s, v, _, _, _ = contact_at(contact, s, v, mu)
            count_toppled(ring, state, i, s, v)
            separate(contact, i, state)
            break
        s_i, v_i, omega, _, ratio = contact_at(contact, s, v, mu)
        w_old *= ratio
        if is_due and can_flush(contact):
            has_flush = True
            flush(contact, state)
            s_i, v_i, _, _, ratio = contact_at(contact, s, v, mu)
        w_new *= ratio
        jac *= omega
        term = contact.inertia * jac
        m_old += w_old * term
        m_before += w_new * term
        if not has_flush:
            m_after += w_new * term
        s, v = s_i, v_i
        if i == stop and i > low and abs(w_old) < MIN_WEIGHT_RATIO * abs(w_new):
            stop = low  # the common factor is not reliable
    if not has_flush or mu == 0.0:
        return 1.0
    if i > low and ring[i & mask].kind != arrays.SEPARATED:
        m_before += (state.m_end - m_old) * (w_new / w_old)
    if m_after == 0.0:
        return 0.0
    if state.tail_bound > 0.0:
        add_tail_error(state, m_before, state.m_end * w_new / max(abs(w_old), arrays.TINY))
    return m_before / m_after
