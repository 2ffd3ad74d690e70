"""Switches of contact: at which angle of the leader a link goes flush or is lost, and what then."""

from domino_env.kernels.contact import link_at, pose
from domino_env.kernels.jit import internal, noinline
from domino_env.kernels.links import can_flush, catch_up, flush, past_flush, release
from domino_env.kernels.quadrature import ORDERS, PLACES
from domino_env.kernels.slots import JAC, RELEASED, SIN, TINY, TOGETHER, VER


@internal
def switch_guess(lanes, k, a, h, due):
    """Leader's angle at which 1 - cos θ_{i+1} comes to `due`, as the lanes at link i tell.

    A cubic between the two lanes around it.
    """
    last = ORDERS[k] + 1
    j = 1
    while j < last and lanes[VER + j] < due:
        j += 1
    v0, v1 = lanes[VER + j - 1], lanes[VER + j]
    rate0, rate1 = lanes[SIN + j - 1] * lanes[JAC + j - 1], lanes[SIN + j] * lanes[JAC + j]
    x0, x1 = PLACES[k, j - 1], PLACES[k, j]
    if not (v0 < due < v1 and rate0 * h > TINY and rate1 * h > TINY):
        return a + h * x1
    t = (due - v0) / (v1 - v0)
    m0, m1 = (v1 - v0) / (rate0 * h), (v1 - v0) / (rate1 * h)
    s = 1.0 - t
    x = x0 * s * s * (1.0 + 2.0 * t) + x1 * t * t * (3.0 - 2.0 * t) + t * s * (m0 * s - m1 * t)
    return a + h * min(max(x, x0), x1)


@internal
def switch_angle(ring, mask, n, i, a, b, guess, mu):
    """Leader's angle in [a, b] at which link i switches: Newton from a guess, kept in a bracket."""
    due = ring[i & mask].due
    lo, hi, x = a, b, guess
    for _ in range(100):
        s, v = pose(x)
        jac = 1.0
        for j in range(n - 1, i, -1):
            s, v, omega, _, _ = link_at(ring[j & mask], s, v, mu)
            jac *= omega
        over = v - due
        if over >= 0.0:
            hi = x
        else:
            lo = x
        new = x - over / max(s * jac, TINY)
        if abs(new - x) <= 1e-10 * (b - a):  # the next step would be its square
            return min(max(new, a), b)
        if not (lo < new < hi):
            new = 0.5 * (lo + hi)
            if new <= lo or new >= hi:
                return hi
        x = new
    return x


@internal
def census(ring, mask, n, back, s, v, mu, state):
    """Catch up with all switches behind domino n, leaning by (s, v); count who is past tipping.

    Dominoes behind a release, or gone from the ring, count as past it.
    """
    fallen = 0
    i = n
    while True:
        if s > ring[i & mask].slender * (1.0 - v):
            fallen += 1
        if i == back:
            return fallen + i
        i -= 1
        if mask > 0 and n - i > mask:
            return fallen + i + 1
        link = ring[i & mask]
        if mask > 0 and v > link.due * (1.0 + 1e-9):
            catch_up(link, i, v, state)
            if link.contact == RELEASED:
                return fallen + i + 1
        s, v, _, _, _ = link_at(link, s, v, mu)


@noinline
def switch(ring, mask, n, due_link, low, angle, mu, state):
    """Switch every link that is due at the leader's `angle`; returns ω⁺/ω⁻ of the impact.

    due_link is the one that the angle was found for; those due with it reach down to
    state.last_due.
    Links flush at the same instant switch together: Σ w I J⁺ω⁺ = Σ w I J⁻ω⁻ with w of the new
    states, J⁺ = 0 behind the first of them.  state.m_end holds Σ w I J⁻ with the old w down to
    domino `low`; behind the last link that switches, w changes by a common factor.
    """
    s, v = pose(angle)
    jac, w_old, w_new = 1.0, 1.0, 1.0
    part = ring[n & mask].inertia  # Σ w_old I J⁻ so far
    before, after = part, part  # Σ w_new I J⁻, Σ w_new I J⁺
    stop = min(state.last_due, due_link)
    flushed = False
    i = n
    while i > stop:
        i -= 1
        link = ring[i & mask]
        over = v - link.due
        due = past_flush(link, over) >= -TOGETHER
        if not can_flush(link) and over >= -1e-12 * link.due:
            s, v, _, _, _ = link_at(link, s, v, mu)
            census(ring, mask, i, state.back, s, v, mu, state)
            release(link, i, state)
            break
        s_i, v_i, omega, _, ratio = link_at(link, s, v, mu)
        w_old *= ratio
        if due and can_flush(link):
            flushed = True
            flush(link, state)
            s_i, v_i, _, _, ratio = link_at(link, s, v, mu)
        w_new *= ratio
        jac *= omega
        term = link.inertia * jac
        part += w_old * term
        before += w_new * term
        if not flushed:
            after += w_new * term
        s, v = s_i, v_i
        if i == stop and i > low and abs(w_old) < 1e-4 * abs(w_new):
            stop = low  # no common factor to go by
    if not flushed or mu == 0.0:
        return 1.0
    if i > low and ring[i & mask].contact != RELEASED:
        before += (state.m_end - part) * (w_new / w_old)
    if after == 0.0:
        return 0.0
    return before / after
