"""All dynamics of a toppling chain: arithmetic only, numbers and arrays in and out.

While domino n leads, its lean θ_n is the only free coordinate and u = ω_n² obeys the linear
equation u′ = 2P(θ_n) + 2Q(θ_n) u.  One interval of a fall (between two switches of contact state)
is therefore an affine map u → E (u + U), with E and U found by Gauss-Legendre quadrature of P and
Q, and its time is the integral of 1/√u.  Nothing is stepped in time.

Symbols (i is the domino behind, i+1 the one it leans on; p, s, d are taken in units of L_i):

    L_i, d_i   height, thickness            s_i      free gap in front of i; p_i = s_i + d_{i+1}
    θ, v       lean, 1 - cos θ              Δ_i      θ_i - θ_{i+1}
    Ω, Ψ       dθ_i/dθ_{i+1}, d²θ_i/dθ_{i+1}²        J, D     the same to the leader: ω_i, α_i
    A, B       arms of the contact force on i, on i+1 (friction included)
    w          weights that eliminate every contact force: w_i = w_{i+1} B_i/A_i
    M          Σ w I J                      P, Q     Σ w G / M, -Σ w I D / M

1 - cos θ stands in for cos θ throughout: with it no difference of nearly equal numbers is left
when gaps are tiny or nearly out of reach.

Source: van Leeuwen 2004 (arXiv physics/0401018); Chapman, "The physics of toppling dominoes",
eqs. 1-3, 7-9, restated for unequal dominoes.
"""

import math

import numba
import numpy as np

from domino_env.quadrature import (
    CLOSED,
    HIGH,
    NODES,
    ORDERS,
    PLACES,
    RECUR_0,
    RECUR_Z,
    RUNNING,
    TO_END,
    TO_START,
    TOP,
    WEIGHTS,
)

_JIT = {"cache": True, "nogil": True, "error_model": "numpy"}
# Handing a dozen arrays from function to function costs more than small functions do themselves.
_INLINE = {**_JIT, "forceinline": True}

# --- Places in the working arrays -----------------------------------------------------------------
# A lane is one angle of a quadrature rule: the start of the interval, its nodes, its end. All lanes
# move down the stack together. One array with a constant pitch lets the compiler see that the rows
# never overlap, and vectorise.
PITCH = 32
SIN, VER, WGT, JAC, DRV = 0 * PITCH, 1 * PITCH, 2 * PITCH, 3 * PITCH, 4 * PITCH
SUM_M, SUM_G, SUM_D = 5 * PITCH, 6 * PITCH, 7 * PITCH
MAP_E, MAP_U, SPEED2, SLOWNESS, COEF = 8 * PITCH, 9 * PITCH, 10 * PITCH, 11 * PITCH, 12 * PITCH
EXPO, RATE = 13 * PITCH, 14 * PITCH
LANE_ROWS = 15

# A row of the ring describes one domino and its link to the next. The ring keeps the last ones
# only: what lies further back is covered by the bound on the tail.
P_L, S_L, REST, D_L, V_FLUSH, V_RELEASE = 0, 1, 2, 3, 4, 5  # p, s, 1 - s, d; where states switch
INERTIA, HALF_WEIGHT, SLENDER, STATE, TAIL, END_WEIGHT = 6, 7, 8, 9, 10, 11
DUE = 12  # 1 - cos θ_{i+1} at which the link next switches
NOTED = 13  # 1 if the tape knows that it turned corner
RING_COLUMNS = 14
TIP, CORNER, RELEASED = 0.0, 1.0, 2.0

# The state of a chain between two falls.
U, TIME, TIME_LOW, U_ERROR, TIME_ERROR, U_ROUND, TIME_ROUND = 0, 1, 2, 3, 4, 5, 6
BACK, KAPPA, DEPTH, LOG_RHO, LAST_H, WORST = 7, 8, 9, 10, 11, 12
FLUSHES, RELEASES, FLUSH_LOSS, MARGIN, LOWEST_MARGIN, ANGLE, PART = 13, 14, 15, 16, 17, 18, 19
U_IMPACT, FALL_TIME, M_END, CUT, WORST_ROUND, LAST_DUE = 20, 21, 22, 23, 24, 25
COMPOSING, GAIN, OFFSET, NEED, NOISE = 26, 27, 28, 29, 30
SWITCHED, W_BEFORE, W_AFTER = 31, 32, 33  # angle of the last switch, speeds around it
# u = GAIN u_0 + OFFSET, u_0 > NEED
CREPT, TAPED = 34, 35  # where u was lowest if its time was taken in panels, else -1; rows of tape
STATE_SIZE = 36

# A tape remembers what a chain did, for those who ask for gradients. One row an event:
# RIDE    leader, first angle, length, rule, lowest domino, u at the start, CREPT
# SWITCH  leader, angle, link, 1 if it flushed, lowest domino, u before, number of flips that follow
# FLIP    link that went from tip to corner since the last ride
# HIT     leader, lowest domino, u before, M
RIDE, SWITCH, FLIP, HIT_NEXT = 0.0, 1.0, 2.0, 3.0
TAPE_COLUMNS = 8

# What a record holds of each domino.
OUT_ARRIVAL, OUT_RELEASE, OUT_IMPACT, OUT_MARGIN = 0, 1, 2, 3

PROPAGATED, STALLED, OUT_OF_REACH, JAMMED, NO_RIGID_ANSWER = 0, 1, 2, 3, 4

RING_ROWS = 65536  # dominoes remembered behind the leader, at most
EPS = 2.220446049250313e-16
TINY = 1e-290
UNWATCHED, TO_HIT, TO_SWITCH = 0, 1, 2  # how an interval ends, for the watch on switches
TOGETHER = 1e-9  # links flush within this Δ [rad] switch in one impact


# --- Arrays without reference counts --------------------------------------------------------------
@numba.extending.intrinsic
def borrowed(_, array):
    """The same array without its reference count, whose owner must outlive it.

    Counting is atomic, and was an eighth of a step's time.
    """

    def without_owner(context, builder, _, args):  # pragma: no cover - runs in the compiler
        view = context.make_array(array)(context, builder, args[0])
        view.meminfo = view.meminfo.type(None)
        return view._getvalue()

    return array(array), without_owner


if numba.config.DISABLE_JIT:

    def borrowed(array):
        """The array itself."""
        return array


# --- One link -------------------------------------------------------------------------------------
@numba.njit(**_JIT)
def tip(s, v, p_l, s_l, rest, d_l, mu):
    """The top edge of i slides down the back of i+1: sin θ_i, 1 - cos θ_i, Ω, Ψ, B/A."""
    sd = s_l - p_l * v  # sin Δ, eq. 1
    cd2 = (1.0 + sd) * (rest + p_l * v)
    cd = math.sqrt(cd2 if cd2 > TINY else TINY)
    arm = cd + mu * sd
    vd = sd * sd / (1.0 + cd)  # 1 - cos Δ; the next link waits for it, so it has its own division
    r = 1.0 / (cd * arm)
    inv_cd = r * arm
    omega = 1.0 - p_l * s * inv_cd  # eq. 2
    ratio = (cd - p_l * s - mu * d_l) * (r * cd)  # eq. 7
    s_i = s * cd + (1.0 - v) * sd
    v_i = v + vd - v * vd + s * sd
    psi = -p_l * ((1.0 - v_i) + s * sd * omega) * (inv_cd * inv_cd)  # eq. 3, corrected
    return s_i, v_i, omega, psi, ratio


@numba.njit(**_JIT)
def corner(s, v, p_l, s_l, rest, d_l, mu):
    """The front face of i rests on the rear bottom edge of i+1; the same five numbers."""
    r2 = s_l * s_l + 2.0 * p_l * d_l * v  # squared distance from pivot i to that edge
    r1 = math.sqrt(r2)
    up = r1 + d_l * s
    q = 1.0 / (r2 * up)  # the one division
    inv_r2 = q * up
    lift = p_l * v - s_l
    omega = d_l * lift * inv_r2
    ratio = d_l * (lift - mu * p_l * s) * inv_r2
    x = s_l + d_l * v
    s_i = x * r1 * inv_r2
    v_i = x * x * q * r1
    psi = p_l * d_l * s * s_l * (p_l + d_l) * (inv_r2 * inv_r2)
    return s_i, v_i, omega, psi, ratio


@numba.njit(**_JIT)
def link(ring, row, s, v, mu):
    """One link in its present state, for a single angle."""
    p_l, s_l, rest, d_l = ring[row, P_L], ring[row, S_L], ring[row, REST], ring[row, D_L]
    if ring[row, STATE] == TIP:
        return tip(s, v, p_l, s_l, rest, d_l, mu)
    return corner(s, v, p_l, s_l, rest, d_l, mu)


@numba.njit(**_JIT)
def lean(lanes, count, ring, row, mu):
    """Lead all lanes over one link and add the domino behind it to the sums."""
    p_l, s_l, rest, d_l = ring[row, P_L], ring[row, S_L], ring[row, REST], ring[row, D_L]
    inertia, half, slender = ring[row, INERTIA], ring[row, HALF_WEIGHT], ring[row, SLENDER]
    if ring[row, STATE] == TIP:
        for j in range(count):
            s, v, omega, psi, ratio = tip(lanes[SIN + j], lanes[VER + j], p_l, s_l, rest, d_l, mu)
            jac = lanes[JAC + j]
            drv = omega * lanes[DRV + j] + psi * jac * jac
            jac = omega * jac
            w = lanes[WGT + j] * ratio
            lanes[SIN + j] = s
            lanes[VER + j] = v
            lanes[DRV + j] = drv
            lanes[JAC + j] = jac
            lanes[WGT + j] = w
            lanes[SUM_M + j] += w * inertia * jac
            lanes[SUM_G + j] += w * half * (s - slender * (1.0 - v))
            lanes[SUM_D + j] += w * inertia * drv
    else:
        for j in range(count):
            s, v, omega, psi, ratio = corner(
                lanes[SIN + j], lanes[VER + j], p_l, s_l, rest, d_l, mu
            )
            jac = lanes[JAC + j]
            drv = omega * lanes[DRV + j] + psi * jac * jac
            jac = omega * jac
            w = lanes[WGT + j] * ratio
            lanes[SIN + j] = s
            lanes[VER + j] = v
            lanes[DRV + j] = drv
            lanes[JAC + j] = jac
            lanes[WGT + j] = w
            lanes[SUM_M + j] += w * inertia * jac
            lanes[SUM_G + j] += w * half * (s - slender * (1.0 - v))
            lanes[SUM_D + j] += w * inertia * drv


@numba.njit(**_JIT)
def lean_free(lanes, count, ring, row):
    """`lean` without friction: w = J, and the potential energy instead of forces."""
    p_l, s_l, rest, d_l = ring[row, P_L], ring[row, S_L], ring[row, REST], ring[row, D_L]
    inertia, half, slender = ring[row, INERTIA], ring[row, HALF_WEIGHT], ring[row, SLENDER]
    if ring[row, STATE] == TIP:
        for j in range(count):
            s, v, omega, _, _ = tip(lanes[SIN + j], lanes[VER + j], p_l, s_l, rest, d_l, 0.0)
            jac = omega * lanes[JAC + j]
            lanes[SIN + j] = s
            lanes[VER + j] = v
            lanes[JAC + j] = jac
            lanes[SUM_M + j] += inertia * jac * jac
    else:
        for j in range(count):
            s, v, omega, _, _ = corner(lanes[SIN + j], lanes[VER + j], p_l, s_l, rest, d_l, 0.0)
            jac = omega * lanes[JAC + j]
            lanes[SIN + j] = s
            lanes[VER + j] = v
            lanes[JAC + j] = jac
            lanes[SUM_M + j] += inertia * jac * jac
    # only what changed since the start of the interval: its small differences stay exact
    at_start = slender * lanes[SIN] - lanes[VER]
    for j in range(count):
        lanes[SUM_G + j] += half * ((slender * lanes[SIN + j] - lanes[VER + j]) - at_start)


# --- The stack ------------------------------------------------------------------------------------
@numba.njit(**_INLINE)
def stand(ring, mask, i, height, thickness, density):
    """Write domino i into the ring (per unit of width; its link forward comes with the next)."""
    row = i & mask
    mass = density * height * thickness
    ring[row, INERTIA] = mass * (height * height + thickness * thickness) / 3.0
    ring[row, HALF_WEIGHT] = 0.5 * mass * height  # times gravity where it is used
    ring[row, SLENDER] = thickness / height
    ring[row, STATE] = TIP
    ring[row, NOTED] = 0.0
    ring[row, TAIL] = ring[row, INERTIA]
    ring[row, END_WEIGHT] = 0.0


@numba.njit(**_INLINE)
def join(ring, mask, i, height, gap, thickness_next):
    """Write the link from i to i+1."""
    row = i & mask
    pitch = gap + thickness_next
    ring[row, P_L] = pitch / height
    ring[row, S_L] = gap / height
    ring[row, REST] = (height - gap) / height
    ring[row, D_L] = thickness_next / height
    ring[row, V_FLUSH] = gap / pitch  # cos θ = d/p
    # cos θ = (p² + d² - L²) / 2pd, for the tip and for the corner
    ring[row, V_RELEASE] = (height - gap) * (height + gap) / (2.0 * pitch * thickness_next)
    ring[row, DUE] = min(ring[row, V_FLUSH], ring[row, V_RELEASE])


@numba.njit(**_INLINE)
def can_flush(ring, row):
    """Whether the link is to go from tip to corner, rather than be released."""
    return ring[row, STATE] == TIP and ring[row, V_FLUSH] < ring[row, V_RELEASE]


@numba.njit(**_INLINE)
def flush(ring, row, state):
    """From tip to corner."""
    ring[row, STATE] = CORNER
    ring[row, DUE] = ring[row, V_RELEASE]
    state[FLUSHES] += 1.0


@numba.njit(**_JIT)
def release(ring, row, i, state):
    """Domino i loses i+1: it and all behind it leave the stack."""
    ring[row, STATE] = RELEASED
    state[BACK] = i + 1
    state[RELEASES] += 1.0


_ODD = [(-1.0) ** n / math.factorial(2 * n + 1) for n in range(10)]
S3, S5, S7, S9, S11, S13, S15, S17 = _ODD[1:9]
_EVEN = [(-1.0) ** n / math.factorial(2 * n) for n in range(10)]
C2, C4, C6, C8, C10, C12, C14, C16, C18 = _EVEN[1:10]


@numba.njit(**_INLINE)
def half_angle(x):
    """sin and cos of x in [0, π/4] by their series, to rounding; unlike the library's, in lanes."""
    q = x * x
    s = S3 + q * (S5 + q * (S7 + q * (S9 + q * (S11 + q * (S13 + q * (S15 + q * S17))))))
    c = C4 + q * (C6 + q * (C8 + q * (C10 + q * (C12 + q * (C14 + q * (C16 + q * C18))))))
    return x + x * (q * s), 1.0 + q * (C2 + q * c)


@numba.njit(**_INLINE)
def spread(lanes, k, a, h):
    """Lay the lanes over the interval [a, a + h] of the leader's angle; returns their number."""
    count = ORDERS[k] + 2
    for j in range(count):
        lanes[EXPO + j] = 0.5 * (a + h * PLACES[k, j])
    for j in range(count):  # apart from the table, so that it vectorises
        s, c = half_angle(lanes[EXPO + j])
        lanes[SIN + j] = 2.0 * s * c
        lanes[VER + j] = 2.0 * s * s
    return count


@numba.njit(**_INLINE)
def lead(lanes, count, ring, row, mu):
    """Begin the sums with the leading domino."""
    inertia, half, slender = ring[row, INERTIA], ring[row, HALF_WEIGHT], ring[row, SLENDER]
    for j in range(count):
        s, v = lanes[SIN + j], lanes[VER + j]
        lanes[WGT + j] = 1.0
        lanes[JAC + j] = 1.0
        lanes[DRV + j] = 0.0
        lanes[SUM_M + j] = inertia
        lanes[SUM_D + j] = 0.0
        if mu > 0.0:
            lanes[SUM_G + j] = half * (s - slender * (1.0 - v))
        else:
            lanes[SUM_G + j] = half * ((slender * s - v) - (slender * lanes[SIN] - lanes[VER]))
    ring[row, END_WEIGHT] = 1.0


@numba.njit(**_INLINE)
def tail_size(lanes, count, mu, force, h, behind):
    """What dominoes behind the cut can still do, relative to u: bound over all lanes."""
    worst = 0.0
    lightest = lanes[SUM_M]
    for j in range(count):
        jac = abs(lanes[JAC + j])
        if mu > 0.0:
            x = abs(lanes[WGT + j]) * (force + h * abs(lanes[DRV + j]) + jac)
        else:
            x = jac * (force + jac)
        if x > worst:
            worst = x
        if lanes[SUM_M + j] < lightest:
            lightest = lanes[SUM_M + j]
    return worst * behind / max(lightest, TINY)


@numba.njit(**_INLINE)
def catch_up(ring, row, i, v, state):
    """Make up for switches beyond an earlier cut: they had no weight then, and need no impact."""
    if can_flush(ring, row):
        flush(ring, row, state)
    if v > ring[row, V_RELEASE] * (1.0 + 1e-9):
        release(ring, row, i, state)


@numba.njit(**_JIT)
def sweep(lanes, count, ring, mask, n, state, mu, force, h, tol, watch):
    """Walk all lanes down the stack of leader n until the rest cannot matter.

    Returns (lowest domino included, bound on the tail, whether some link switches on the way).
    state[LAST_DUE] is the lowest link that is due at the very end of the interval, n if none.
    """
    end = count - 1
    lead(lanes, count, ring, n & mask, mu)
    back = int(state[BACK])
    first_check = max(4, int(state[DEPTH]) - 2)
    oldest = max(back, n - mask) if mask > 0 else back
    state[LAST_DUE] = n
    i = n
    while i > oldest:
        i -= 1
        row = i & mask
        if lanes[VER + end] >= ring[row, DUE] * (1.0 - 1e-6) and watch != UNWATCHED:
            if lanes[VER] > ring[row, DUE] * (1.0 + 1e-9):
                catch_up(ring, row, i, lanes[VER], state)
                if ring[row, STATE] == RELEASED:
                    return i + 1, 0.0, False
            # A flush within 1e-12 rad behind a hit still comes before it; where the interval ends
            # at a switch, one that is due at the same instant is no news.
            over = lanes[VER + end] - ring[row, DUE]
            if watch == TO_HIT and over + 1e-12 * lanes[SIN + end] * lanes[JAC + end] >= 0.0:
                return i, 0.0, True
            if watch == TO_SWITCH:
                if over * ring[row, P_L] >= 1e-3 * TOGETHER:
                    return i, 0.0, True
                if over * ring[row, P_L] >= -TOGETHER:
                    state[LAST_DUE] = i
        if mu > 0.0:
            lean(lanes, count, ring, row, mu)
            ring[row, END_WEIGHT] = lanes[WGT + end]
        else:
            lean_free(lanes, count, ring, row)
            ring[row, END_WEIGHT] = lanes[JAC + end]
        reached = n - i
        if reached >= first_check and reached % 2 == 0 and i > back:
            tail = tail_size(lanes, count, mu, force, h, ring[row, TAIL] - ring[row, INERTIA])
            if tail <= tol:
                return i, tail, False
    if i > back:  # the ring ends before the row does
        return i, tail_size(lanes, count, mu, force, h, ring[i & mask, TAIL]), False
    return i, 0.0, False


@numba.njit(**_JIT)
def renew_tails(ring, mask, low, n):
    """Renew the bound T_i on Σ_{k ≤ i} I_k w_k / w_i from the cut up to the leader.

    T_i = I_i + |B/A| T_{i-1}.  As θ only grows, |B/A| of a link only falls until it turns corner,
    where Ω ≤ (1 - p² + d²)/2 takes over; an old bound stays a bound.
    """
    for i in range(low + 1, n + 1):
        below, row = (i - 1) & mask, i & mask
        x2 = ring[below, S_L] * (ring[below, P_L] + ring[below, D_L])
        ratio = 0.5 * (1.0 - x2)
        above = abs(ring[row, END_WEIGHT])
        if above > TINY:
            ratio = max(ratio, min(abs(ring[below, END_WEIGHT]) / above, 1.0))
        else:
            ratio = 1.0
        ring[row, TAIL] = ring[row, INERTIA] + ratio * ring[below, TAIL]


# --- Switches -------------------------------------------------------------------------------------
@numba.njit(**_JIT)
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


@numba.njit(**_JIT)
def switch_angle(ring, mask, n, i, a, b, guess, mu):
    """Leader's angle in [a, b] at which link i switches: Newton from a guess, kept in a bracket."""
    due = ring[i & mask, DUE]
    lo, hi, x = a, b, guess
    for _ in range(100):
        half = 0.5 * x
        s, c = math.sin(half), math.cos(half)
        v = 2.0 * s * s
        s = 2.0 * s * c
        jac = 1.0
        for j in range(n - 1, i, -1):
            s, v, omega, _, _ = link(ring, j & mask, s, v, mu)
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


@numba.njit(**_JIT)
def census(ring, mask, n, back, s, v, mu, state):
    """Catch up with all switches behind domino n, leaning by (s, v); count who is past tipping.

    Dominoes behind a release, or gone from the ring, count as past it.
    """
    fallen = 0
    i = n
    while True:
        row = i & mask
        if s > ring[row, SLENDER] * (1.0 - v):
            fallen += 1
        if i == back:
            return fallen + i
        i -= 1
        if mask > 0 and n - i > mask:
            return fallen + i + 1
        row = i & mask
        if mask > 0 and v > ring[row, DUE] * (1.0 + 1e-9):
            catch_up(ring, row, i, v, state)
            if ring[row, STATE] == RELEASED:
                return fallen + i + 1
        s, v, _, _, _ = link(ring, row, s, v, mu)


@numba.njit(**_JIT)
def switch(ring, mask, n, due_link, low, angle, mu, state):
    """Switch every link that is due at the leader's `angle`; returns ω⁺/ω⁻ of the impact.

    due_link is the one that the angle was found for; those due with it reach down to
    state[LAST_DUE].
    Links flush at the same instant switch together: Σ w I J⁺ω⁺ = Σ w I J⁻ω⁻ with w of the new
    states, J⁺ = 0 behind the first of them.  state[M_END] holds Σ w I J⁻ with the old w down to
    domino `low`; behind the last link that switches, w changes by a common factor.
    """
    half = 0.5 * angle
    s, c = math.sin(half), math.cos(half)
    v = 2.0 * s * s
    s = 2.0 * s * c
    row = n & mask
    jac, w_old, w_new = 1.0, 1.0, 1.0
    part = ring[row, INERTIA]  # Σ w_old I J⁻ so far
    before, after = part, part  # Σ w_new I J⁻, Σ w_new I J⁺
    stop = min(int(state[LAST_DUE]), due_link)
    flushed = False
    i = n
    while i > stop:
        i -= 1
        row = i & mask
        over = v - ring[row, DUE]
        due = over * ring[row, P_L] >= -TOGETHER
        if not can_flush(ring, row) and over >= -1e-12 * ring[row, DUE]:
            s, v, _, _, _ = link(ring, row, s, v, mu)
            census(ring, mask, i, int(state[BACK]), s, v, mu, state)
            release(ring, row, i, state)
            break
        s_i, v_i, omega, _, ratio = link(ring, row, s, v, mu)
        w_old *= ratio
        if due and can_flush(ring, row):
            flushed = True
            flush(ring, row, state)
            s_i, v_i, _, _, ratio = link(ring, row, s, v, mu)
        w_new *= ratio
        jac *= omega
        term = ring[row, INERTIA] * jac
        part += w_old * term
        before += w_new * term
        if not flushed:
            after += w_new * term
        s, v = s_i, v_i
        if i == stop and i > low and abs(w_old) < 1e-4 * abs(w_new):
            stop = low  # no common factor to go by
    if not flushed or mu == 0.0:
        return 1.0
    if i > low and ring[i & mask, STATE] != RELEASED:
        before += (state[M_END] - part) * (w_new / w_old)
    if after == 0.0:
        return 0.0
    return before / after


# --- One interval: the affine map -----------------------------------------------------------------
@numba.njit(**_JIT)
def affine_map(lanes, k, h, mu, gravity):
    """E and U of the interval at all lanes, and how far they are resolved.

    Returns (M positive on all lanes, error of log E and of U at the end, and at the nodes).
    """
    m = ORDERS[k]
    end = m + 1
    for j in range(m + 2):
        if not lanes[SUM_M + j] > 0.0:
            return False, 0.0, 0.0, 0.0, 0.0
    lanes[MAP_E] = 1.0
    lanes[MAP_U] = 0.0
    if mu == 0.0:
        m0 = lanes[SUM_M]
        scale = 2.0 * gravity / m0
        for j in range(1, m + 2):
            lanes[MAP_E + j] = m0 / lanes[SUM_M + j]
            lanes[MAP_U + j] = -scale * lanes[SUM_G + j]
        return True, 0.0, 0.0, 0.0, 0.0
    g2 = 2.0 * gravity * h
    for j in range(m + 2):
        inv = 1.0 / lanes[SUM_M + j]
        lanes[EXPO + j] = -2.0 * h * lanes[SUM_D + j] * inv  # 2 Q h
        lanes[RATE + j] = g2 * lanes[SUM_G + j] * inv  # 2 P h, then 2 P h / E
        lanes[COEF + j] = 0.0
    q_end, q_lo, q_hi, q_size = 0.0, 0.0, 0.0, 0.0
    for i in range(m):
        q = lanes[EXPO + 1 + i]
        q_end += WEIGHTS[k, i] * q
        q_lo += TO_START[k, i] * q
        q_hi += TO_END[k, i] * q
        q_size = max(q_size, abs(q))
        for j in range(m):
            lanes[COEF + j] += RUNNING[k, i, j] * q
    for j in range(m):
        e = math.exp(lanes[COEF + j])
        lanes[MAP_E + 1 + j] = e
        lanes[RATE + 1 + j] /= e
        lanes[COEF + j] = 0.0
    e_end = math.exp(q_end)
    lanes[MAP_E + end] = e_end
    lanes[RATE + end] /= e_end
    r_end, r_lo, r_hi, r_size = 0.0, 0.0, 0.0, 0.0
    for i in range(m):
        r = lanes[RATE + 1 + i]
        r_end += WEIGHTS[k, i] * r
        r_lo += TO_START[k, i] * r
        r_hi += TO_END[k, i] * r
        r_size = max(r_size, abs(r))
        for j in range(m):
            lanes[COEF + j] += RUNNING[k, i, j] * r
    for j in range(m):
        lanes[MAP_U + 1 + j] = lanes[COEF + j]
    lanes[MAP_U + end] = r_end
    # What the nodes predict at the two ends against what is there: the size of the first neglected
    # Legendre coefficients.  Gauss rules err by its square.
    q_off = max(abs(q_lo - lanes[EXPO]), abs(q_hi - lanes[EXPO + end]))
    r_off = max(abs(r_lo - lanes[RATE]), abs(r_hi - lanes[RATE + end]))
    e_error = q_off * q_off / max(q_size, TINY)
    u_error = r_off * r_off / max(r_size, TINY) + r_off * q_off
    return True, e_error, u_error, q_off, r_off


# --- One interval: the time -----------------------------------------------------------------------
@numba.njit(**_JIT)
def series(lanes, values, k):
    """Legendre coefficients of the polynomial through a row of lanes (start, nodes, end)."""
    count = ORDERS[k] + 2
    for j in range(count):
        lanes[COEF + j] = 0.0
    for i in range(count):
        y = lanes[values + i]
        for j in range(count):
            lanes[COEF + j] += CLOSED[k, i, j] * y


@numba.njit(**_JIT)
def series_at(lanes, count, x):
    """Value and first two derivatives of that polynomial at x in [0, 1]."""
    z = 2.0 * x - 1.0
    p0, p1, d0, d1, c0, c1 = 1.0, z, 0.0, 1.0, 0.0, 0.0
    y = lanes[COEF] + lanes[COEF + 1] * z
    dy, ddy = lanes[COEF + 1], 0.0
    for n in range(1, count - 1):
        f = 2 * n + 1.0
        p2 = RECUR_Z[n] * (z * p1) - RECUR_0[n] * p0
        d2 = d0 + f * p1
        c2 = c0 + f * d1
        a = lanes[COEF + n + 1]
        y += a * p2
        dy += a * d2
        ddy += a * c2
        p0, p1, d0, d1, c0, c1 = p1, p2, d1, d2, c1, c2
    return y, 2.0 * dy, 4.0 * ddy


@numba.njit(**_JIT)
def lowest_lane(lanes, values, count):
    best = 0
    for j in range(1, count):
        if lanes[values + j] < lanes[values + best]:
            best = j
    return best


@numba.njit(**_INLINE)
def place(k, j):
    """Position of lane j in [0, 1]."""
    if j == 0:
        return 0.0
    if j == ORDERS[k] + 1:
        return 1.0
    return NODES[k, j - 1]


@numba.njit(**_JIT)
def lowest_point(lanes, values, k):
    """Place and value of the minimum over [0, 1] of the polynomial through a row (COEF is set)."""
    count = ORDERS[k] + 2
    j = lowest_lane(lanes, values, count)
    lo, hi = place(k, max(j - 1, 0)), place(k, min(j + 1, count - 1))
    x = place(k, j)
    _, dy, _ = series_at(lanes, count, lo)
    if dy >= 0.0 and j == 0:
        return 0.0, lanes[values]
    _, dy, _ = series_at(lanes, count, hi)
    if dy <= 0.0 and j == count - 1:
        return 1.0, lanes[values + j]
    for _ in range(60):
        y, dy, ddy = series_at(lanes, count, x)
        if dy > 0.0:
            hi = x
        else:
            lo = x
        new = x - dy / ddy if ddy > 0.0 else 0.5 * (lo + hi)
        if not (lo <= new <= hi):
            new = 0.5 * (lo + hi)
        done = abs(new - x) <= 1e-9  # u is flat there: its error is the square of that
        x = new
        if done:
            break
    y, _, _ = series_at(lanes, count, x)
    return x, min(y, lanes[values + j])


@numba.njit(**_JIT)
def first_zero(lanes, values, k, x_low):
    """Where the falling polynomial (COEF) first reaches zero before its minimum at x_low."""
    count = ORDERS[k] + 2
    lo, hi = 0.0, x_low
    for j in range(count):  # the first lane that is not positive bounds the first zero
        if lanes[values + j] <= 0.0 and place(k, j) < hi:
            hi = place(k, j)
            break
    for _ in range(80):
        x = 0.5 * (lo + hi)
        y, _, _ = series_at(lanes, count, x)
        if y > 0.0:
            lo = x
        else:
            hi = x
        if hi - lo <= 1e-15:
            break
    return lo


@numba.njit(**_JIT)
def slow_panel(lanes, count, x0, x1, moments):
    """∫ dx/√u and ½∫ dx/u^(3/2) over [x0, x1] of the polynomial u (COEF), ten nodes.

    moments, unless empty: gains ½∫ P_n(2x - 1) dx/u^(3/2).
    """
    time, sens = 0.0, 0.0
    for j in range(10):
        x = x0 + (x1 - x0) * NODES[2, j]
        y, _, _ = series_at(lanes, count, x)
        y = max(y, TINY)
        f = 1.0 / math.sqrt(y)
        part = WEIGHTS[2, j] * 0.5 * f / y
        time += WEIGHTS[2, j] * f
        sens += part
        if len(moments) > 0:
            z, p0, p1 = 2.0 * x - 1.0, 1.0, 2.0 * x - 1.0
            moments[0] += part * (x1 - x0)
            for n in range(1, count):
                moments[n] += part * (x1 - x0) * p1
                p0, p1 = p1, RECUR_Z[n] * (z * p1) - RECUR_0[n] * p0
    return time * (x1 - x0), sens * (x1 - x0)


@numba.njit(**_JIT)
def slow_time(lanes, count, x_low, moments):
    """The two integrals over [0, 1] when u nearly vanishes: panels that grow away from x_low.

    A panel spans the distance over which u changes by its own size, so each is easy and their
    number grows like the logarithm of the depth of the dip.
    """
    time, sens = 0.0, 0.0
    for side in range(2):
        x = x_low
        target = 1.0 if side == 1 else 0.0
        for _ in range(2000):
            if x == target:
                break
            y, dy, ddy = series_at(lanes, count, x)
            y = max(y, TINY)
            step = 1.0
            if abs(dy) > 0.0:
                step = min(step, y / abs(dy))
            if abs(ddy) > 0.0:
                step = min(step, math.sqrt(2.0 * y / abs(ddy)))
            step = max(0.75 * step, 1e-12)
            if side == 1:
                new = min(x + step, 1.0)
                t, q = slow_panel(lanes, count, x, new, moments)
            else:
                new = max(x - step, 0.0)
                t, q = slow_panel(lanes, count, new, x, moments)
            time += t
            sens += q
            x = new
    return time, sens


# --- The tape -------------------------------------------------------------------------------------
@numba.njit(**_JIT)
def note(tape, state, kind, c1, c2, c3, c4, c5, c6, c7):
    """One more row of tape; where it is full, only counted."""
    at = int(state[TAPED])
    state[TAPED] += 1.0
    if at < len(tape):
        row = tape[at]
        row[0], row[1], row[2], row[3], row[4] = kind, c1, c2, c3, c4
        row[5], row[6], row[7] = c5, c6, c7


@numba.njit(**_JIT)
def note_flips(tape, ring, mask, n, low, state):
    """Note the links that have turned corner unseen; returns how many."""
    flips = 0
    for i in range(low, n):
        row = i & mask
        if ring[row, STATE] == CORNER and ring[row, NOTED] == 0.0:
            ring[row, NOTED] = 1.0
            note(tape, state, FLIP, i, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
            flips += 1
    return flips


@numba.njit(**_JIT)
def note_switch(tape, ring, mask, n, due_link, low, angle, flushes, state):
    """Note a switch, and the links that it has turned."""
    at = int(state[TAPED])
    flushed = 1.0 if flushes else 0.0
    note(tape, state, SWITCH, n, angle, due_link, flushed, low, state[U], 0.0)
    flips = note_flips(tape, ring, mask, n, low, state)
    if at < len(tape):
        tape[at, 7] = flips


# --- One fall -------------------------------------------------------------------------------------
FINE, ROUGH, DEAD = 0, 1, 2
RUN, CREEP, LAST_RESORT = 0, 1, 2


@numba.njit(**_INLINE)
def order_for(state, h, tol):
    """The rule expected to meet `tol` on an interval of length h, from the last one's decay."""
    if state[LOG_RHO] <= 0.0:
        return 3
    rho = max(state[LOG_RHO] + math.log(state[LAST_H] / h), 0.35)
    need = 0.5 * math.log(1.0 / tol) / rho
    # A short interval tells little of what a much longer one holds: look with more than six nodes.
    for k in range(2 if h > 4.0 * state[LAST_H] else 1, len(ORDERS)):
        if ORDERS[k] >= need:
            return k
    return len(ORDERS) - 1


@numba.njit(**_JIT)
def ride(lanes, k, a, h, errors, tail, tol, state, deep, creep):
    """Carry u and the time over the interval [a, a + h], whose map is in the lanes.

    FINE: done, errors booked.  ROUGH: the rule does not resolve it, nothing is changed.  DEAD: u
    reaches zero, at state[ANGLE].
    deep: find the true minimum of u always, not only where a stall is near.
    creep: CREEP where only the root of u is unresolved: integrate the polynomial of u in small
        panels; LAST_RESORT: book the error, however large.
    """
    e_error, u_error, q_off, r_off = errors
    last_resort = creep == LAST_RESORT
    last = ORDERS[k] + 1
    u0 = state[U]
    size, u_low = u0, u0
    lanes[SPEED2] = u0
    for j in range(1, last + 1):
        size = max(size, abs(lanes[MAP_U + j]))
        u = lanes[MAP_E + j] * (u0 + lanes[MAP_U + j])
        u_low = min(u_low, u)
        lanes[SPEED2 + j] = u
    e_end, u_end = lanes[MAP_E + last], lanes[SPEED2 + last]
    local = (u0 + abs(lanes[MAP_U + last])) * e_error + u_error
    rough = r_off + q_off * size
    known = deep or u_low < 0.3 * size
    x_low = 0.0
    if known:
        series(lanes, SPEED2, k)
        x_low, u_low = lowest_point(lanes, SPEED2, k)
    if u_low <= 0.0:
        if local > max(tol * size, 1e-6 * abs(u_low)) and not last_resort:
            return ROUGH
        state[ANGLE] = a + h * first_zero(lanes, SPEED2, k, x_low)
        return DEAD
    for j in range(last + 1):
        lanes[SLOWNESS + j] = 1.0 / math.sqrt(lanes[SPEED2 + j])
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
    off = max(abs(f_lo - lanes[SLOWNESS]), abs(f_hi - lanes[SLOWNESS + last])) / t
    high, top = 0.0, 0.0
    if k > 0:
        # What is seen at the ends may be zero by chance; then the last two coefficients tell how
        # large the first neglected ones are, if all decay like a power series.
        high, top = abs(f_high) / t, abs(f_top) / t
        root = math.sqrt(high) if k == 1 else math.sqrt(math.sqrt(high))
        off = max(off, high * root, top * math.sqrt(math.sqrt(top)))
    fine = off * t / math.sqrt(math.sqrt(math.sqrt(max(off, TINY))))
    if k == 3 and off > 1e-3:
        # A small sharp feature beside a smooth rest decays slowly from a low level: go by its pace.
        fine = max(fine, t * min(off / max(high, top, TINY), 1.0) ** (ORDERS[k] // 2))
    t_error = 2.0 * off * (fine + rough * sens)
    if not ((local * sens <= tol * t and local * e_end <= tol * u_end) or last_resort):
        return ROUGH
    state[CREPT] = -1.0
    if t_error > tol * t:
        if creep == RUN:
            return ROUGH
        if not known:
            series(lanes, SPEED2, k)
            x_low, u_low = lowest_point(lanes, SPEED2, k)
        left = abs(lanes[COEF + last]) + 0.25 * abs(lanes[COEF + last - 1]) + rough / ORDERS[k]
        t_slow, sens_slow = slow_time(lanes, last + 1, x_low, lanes[:0])
        limit = left <= 64.0 * EPS * size + 8.0 * state[NOISE]  # no rule sees u more sharply
        if not (left * sens_slow <= tol * t_slow or limit or last_resort):
            return ROUGH
        t, sens, t_error = t_slow, sens_slow, left * sens_slow + 1e-14 * t_slow
        state[CREPT] = x_low
        if limit:
            state[TIME_ROUND] += h * t_error
    off = max(off, rough / size, 1e-15)
    state[LOG_RHO] = math.log(1.0 / min(off, 0.5)) / ORDERS[k]
    state[LAST_H] = h
    noise = 16.0 * EPS * size + state[NOISE]
    cut = tail * u0
    state[TIME_ERROR] += h * (sens * (state[U_ERROR] + local + cut + noise) + t_error)
    state[TIME_ROUND] += h * (sens * (state[U_ROUND] + noise) + EPS * t)
    state[U_ERROR] = e_end * (state[U_ERROR] + local + cut) + noise * max(e_end, 1.0)
    state[U_ROUND] = e_end * state[U_ROUND] + noise * max(e_end, 1.0)
    state[U] = u_end
    state[CUT] = tail
    state[M_END] = lanes[SUM_M + last]
    state[FALL_TIME] += h * t
    state[MARGIN] = min(state[MARGIN], u_low)
    return FINE


@numba.njit(**_JIT)
def compose(lanes, k, h, e_error, u_error, q_off, r_off, tail, tol, state):
    """Take the map of an interval into that of all falls so far, instead of riding a wave on it.

    u = GAIN u_0 + OFFSET; the wave does not stall as long as u_0 > NEED.
    """
    last = ORDERS[k] + 1
    size = TINY
    for j in range(1, last + 1):
        size = max(size, abs(lanes[MAP_U + j]))
    series(lanes, MAP_U, k)
    off = abs(lanes[COEF + last]) + abs(lanes[COEF + last - 1]) + (r_off + q_off * size) / ORDERS[k]
    off -= 8.0 * state[NOISE]  # no rule sees U more sharply
    if not (e_error <= tol and u_error <= tol * size and off <= tol * size):
        return ROUGH
    _, u_low = lowest_point(lanes, MAP_U, k)
    gain = max(state[GAIN], TINY)
    state[NEED] = max(state[NEED], -(state[OFFSET] + u_low) / gain)
    state[OFFSET] = lanes[MAP_E + last] * (state[OFFSET] + lanes[MAP_U + last])
    state[GAIN] *= lanes[MAP_E + last]
    state[LOG_RHO] = math.log(1.0 / min(max(off / size, 1e-15), 0.5)) / ORDERS[k]
    state[LAST_H] = h
    state[CUT] = tail
    state[M_END] = lanes[SUM_M + last]
    return FINE


@numba.njit(**_INLINE)
def slow_down(state, keep):
    """An impact leaves the leader the part `keep` of its angular velocity."""
    k2 = keep * keep
    for place in (U, U_ERROR, U_ROUND, GAIN, OFFSET):
        state[place] *= k2


@numba.njit(**_JIT)
def stack_at(lanes, ring, mask, n, angle, mu, tol, watch, state):
    """M of the stack at one angle of the leader; returns the lowest domino included."""
    count = spread(lanes, 0, angle, 0.0)
    low, _, _ = sweep(lanes, count, ring, mask, n, state, mu, 0.0, 0.0, 0.3 * tol, watch)
    state[M_END] = lanes[SUM_M]
    state[DEPTH] = n - low
    return low


@numba.njit(**_JIT)
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
        force = 2.0 * h * gravity * state[KAPPA] / state[U]
        watch = UNWATCHED if mask == 0 else (TO_SWITCH if located else TO_HIT)
        low, tail, flagged = sweep(
            lanes, count, ring, mask, n, state, mu, force, h, 0.3 * tol, watch
        )
        if flagged:
            guess = switch_guess(lanes, k, a, h, ring[low & mask, DUE])
            end = switch_angle(ring, mask, n, low, a, end, guess, mu)
            located, due_link = True, low
            if end - a > 4.0 * EPS * b:
                continue
            low = stack_at(lanes, ring, mask, n, a, mu, tol, TO_SWITCH, state)
        else:
            done, came = ROUGH, state[U]
            ok, e_error, u_error, q_off, r_off = affine_map(lanes, k, h, mu, gravity)
            if ok and state[COMPOSING] > 0.0:
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
                    state[ANGLE] = a
                    return NO_RIGID_ANSWER
                step = 0.5 * h
                located = False
                continue
            if len(tape) > 0:
                note_flips(tape, ring, mask, n, low, state)
                note(tape, state, RIDE, n, a, h, k, low, came, state[CREPT])
            floor_order = 0
            state[DEPTH] = n - low
            a = end
            step = max(step, 3.0 * h)
        if located:
            located, step = False, b
            flushes = can_flush(ring, due_link & mask)
            keep = switch(ring, mask, n, due_link, low, end, mu, state)
            if len(tape) > 0:
                note_switch(tape, ring, mask, n, due_link, low, end, flushes, state)
            if not keep > 0.0:
                state[ANGLE] = end
                return JAMMED
            state[FLUSH_LOSS] = max(state[FLUSH_LOSS], 1.0 - keep)
            state[SWITCHED], state[W_BEFORE] = end, math.sqrt(state[U])
            slow_down(state, keep)
            state[W_AFTER] = math.sqrt(state[U])
            if a >= b:  # the hit follows at once: its M is that of the new states
                stack_at(lanes, ring, mask, n, b, mu, tol, UNWATCHED, state)
    if a < b:
        state[ANGLE] = a
        return NO_RIGID_ANSWER
    return PROPAGATED


@numba.njit(**_INLINE)
def hit(ring, mask, n, mu, state):
    """Leader n, at its hitting angle, strikes n+1: eqs. 8-9 with friction."""
    row = n & mask
    s_l, d_l = ring[row, S_L], ring[row, D_L]
    cd = math.sqrt(ring[row, REST] * (1.0 + s_l))
    m = state[M_END] * (cd - mu * d_l) / (cd + mu * s_l)
    if not m > 0.0:
        return JAMMED
    keep = m / (m + ring[(n + 1) & mask, INERTIA])
    slow_down(state, keep)
    state[U_ERROR] += (4.0 * EPS + 2.0 * state[CUT]) * state[U]
    state[U_ROUND] += 4.0 * EPS * state[U]
    return PROPAGATED


# --- A chain --------------------------------------------------------------------------------------
@numba.njit(**_JIT)
def begin(state, push):
    """The state of a chain whose first domino has just been pushed."""
    for j in range(STATE_SIZE):
        state[j] = 0.0
    state[U] = push * push
    state[LOWEST_MARGIN] = 1.0
    state[GAIN] = 1.0


@numba.njit(**_JIT)
def add_time(state):
    """Book the time of the last fall; compensated, so that a million falls add up exactly."""
    y = state[FALL_TIME] - state[TIME_LOW]
    total = state[TIME] + y
    state[TIME_LOW] = (total - state[TIME]) - y
    state[TIME] = total
    state[WORST] = max(state[WORST], state[TIME_ERROR] / total)
    state[WORST_ROUND] = max(state[WORST_ROUND], state[TIME_ROUND] / total)


@numba.njit(**_INLINE)
def fall_angle(ring, mask, n, strikes):
    """Angle at which leader n hits the next, or, where there is none in reach, tips over."""
    row = n & mask
    if strikes:
        s_l = ring[row, S_L]
        return math.atan2(s_l, math.sqrt(ring[row, REST] * (1.0 + s_l)))
    return math.atan(ring[row, SLENDER])


@numba.njit(**_INLINE)
def heaviest_force(height, thickness):
    """Largest gravity torque of a domino over its inertia and g (for the bound on the tail)."""
    return 1.5 / math.sqrt(height * height + thickness * thickness)


@numba.njit(**_INLINE)
def step(lanes, ring, mask, n, strikes, mu, gravity, rtol, state, deep, tape):
    """One fall of a chain and the hit that ends it; dominoes up to n+1 stand in the ring."""
    state[NOISE] = 8.0 * EPS * gravity * state[KAPPA]
    if state[COMPOSING] > 0.0:
        state[U] = gravity * state[KAPPA]  # something of its size: it weighs what may be cut
    state[FALL_TIME] = 0.0
    state[MARGIN] = state[U]
    released = state[U]
    b = fall_angle(ring, mask, n, strikes)
    outcome = fall(lanes, ring, mask, n, 0.0, b, mu, gravity, rtol, state, deep, tape)
    outcome = close_fall(ring, mask, n, b, released, strikes, mu, state, outcome)
    if len(tape) > 0 and strikes and outcome == PROPAGATED:
        low = n - state[DEPTH]
        note(tape, state, HIT_NEXT, n, low, state[U_IMPACT], state[M_END], 0.0, 0.0, 0.0)
    return outcome


@numba.njit(**_INLINE)
def close_fall(ring, mask, n, b, released, strikes, mu, state, outcome):
    """Book a fall that has come to its end, then hit the next domino."""
    state[MARGIN] = 0.0 if outcome == STALLED else state[MARGIN] / released
    state[LOWEST_MARGIN] = min(state[LOWEST_MARGIN], state[MARGIN])
    if outcome != PROPAGATED:
        state[PART] = state[ANGLE] / b
        return outcome
    state[ANGLE] = b
    state[PART] = 1.0
    if strikes:
        if state[COMPOSING] == 0.0:
            add_time(state)
        state[U_IMPACT] = state[U]
        return hit(ring, mask, n, mu, state)
    return PROPAGATED


@numba.njit(**_JIT)
def is_uniform(spacing, thickness, height, density):
    """Whether one stack serves every fall: all parts equal, and no link ever switches."""
    s, d, length = spacing[0], thickness[0], height[0]
    if s * (s + 2.0 * d) > length * length or s >= length:
        return False
    for i in range(1, len(thickness)):
        if thickness[i] != d or height[i] != length or density[i] != density[0]:
            return False
        if i < len(spacing) and spacing[i] != s:
            return False
    return True


@numba.njit(**_JIT)
def uniform_order(lanes, ring, count, b, mu, gravity, tol):
    """Rule that resolves P and Q of a uniform stack; -1 where none does."""
    for k in range(1, len(ORDERS)):
        lanes_used = spread(lanes, k, 0.0, b)
        lead(lanes, lanes_used, ring, 0, mu)
        for _ in range(min(count - 2, 12)):
            if mu > 0.0:
                lean(lanes, lanes_used, ring, 0, mu)
            else:
                lean_free(lanes, lanes_used, ring, 0)
        ok, e_error, u_error, _, _ = affine_map(lanes, k, b, mu, gravity)
        if ok and e_error <= 0.1 * tol and u_error <= 0.1 * tol * lanes[MAP_U + ORDERS[k] + 1]:
            return k
    return -1


@numba.njit(**_JIT)
def uniform_chain(lanes, ring, count, mu, gravity, rtol, state, deep, out, tape):
    """Falls 0 … N-2 of a uniform row: each adds one link to the same lanes until the tail is dead.

    Returns (outcome, falls done).
    """
    b = fall_angle(ring, 0, 0, True)
    tol = 0.3 * rtol
    k = uniform_order(lanes, ring, count, b, mu, gravity, tol)
    if k < 0:
        return PROPAGATED, 0
    lanes_used = spread(lanes, k, 0.0, b)
    lead(lanes, lanes_used, ring, 0, mu)
    inertia = ring[0, INERTIA]
    e_error, u_error, q_off, r_off, tail, behind = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    depth, closed = 0, False
    state[NOISE] = 8.0 * EPS * gravity * state[KAPPA]
    for n in range(count - 1):
        state[FALL_TIME] = 0.0
        state[MARGIN] = state[U]
        released = state[U]
        force = 2.0 * b * gravity * state[KAPPA] / state[U]
        if closed:  # as u falls, what was cut off weighs more
            tail = tail_size(lanes, lanes_used, mu, force, b, behind)
            closed = tail <= 0.3 * tol
        if not closed:
            while depth < n:
                if mu > 0.0:
                    before = lanes[WGT]
                    lean(lanes, lanes_used, ring, 0, mu)
                    ratio = abs(lanes[WGT] / before)
                else:
                    before = lanes[JAC]
                    lean_free(lanes, lanes_used, ring, 0)
                    ratio = lanes[JAC] / before
                depth += 1
                tail = 0.0
                if depth > 4 and ratio < 1.0:
                    behind = inertia * ratio / (1.0 - ratio)
                    ring[0, TAIL] = inertia + behind
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
            state[DEPTH] = depth
            if len(tape) > 0:
                note(tape, state, RIDE, n, 0.0, b, k, n - depth, released, state[CREPT])
        if done == ROUGH:
            outcome = fall(lanes, ring, 0, n, 0.0, b, mu, gravity, rtol, state, deep, tape)
            depth, closed = 0, False  # the lanes were used: begin again
            lanes_used = spread(lanes, k, 0.0, b)
            lead(lanes, lanes_used, ring, 0, mu)
        else:
            outcome = STALLED if done == DEAD else PROPAGATED
        outcome = close_fall(ring, 0, n, b, released, True, mu, state, outcome)
        if len(tape) > 0 and outcome == PROPAGATED:
            low = n - state[DEPTH]
            note(tape, state, HIT_NEXT, n, low, state[U_IMPACT], state[M_END], 0.0, 0.0, 0.0)
        record(out, n, outcome, state)
        if outcome != PROPAGATED:
            return outcome, n
    return PROPAGATED, count - 1


@numba.njit(**_JIT)
def record(out, n, outcome, state):
    """Write what fall n has shown: margin, and where it struck, both speeds and the arrival."""
    if len(out) == 0:
        return
    out[n, OUT_MARGIN] = state[MARGIN]
    if n + 1 < len(out) and state[PART] == 1.0 and outcome in (PROPAGATED, JAMMED):
        out[n, OUT_IMPACT] = math.sqrt(state[U_IMPACT])
        out[n + 1, OUT_ARRIVAL] = state[TIME]
        if outcome == PROPAGATED:
            out[n + 1, OUT_RELEASE] = math.sqrt(state[U])


@numba.njit(**_INLINE)
def lay(ring, mask, n, spacing, thickness, height, density, state):
    """Make ready for the fall of leader n: the domino that it is to hit, and the bound on what
    lies behind."""
    if n + 1 < len(thickness):
        d = thickness[n + 1]
        stand(ring, mask, n + 1, height[n + 1], d, density[n + 1])
        join(ring, mask, n, height[n], spacing[n], d)
        state[KAPPA] = max(state[KAPPA], heaviest_force(height[n + 1], d))
    if n % 4 == 0 and n > 0:
        renew_tails(ring, mask, max(n - 1 - int(state[DEPTH]), 0, n - mask), n)
    elif n > 0:
        ring[n & mask, TAIL] = ring[n & mask, INERTIA] + ring[(n - 1) & mask, TAIL]


@numba.njit(**_JIT)
def chain(
    spacing, thickness, height, density, mu, gravity, push, rtol, lanes, ring, state, deep, out,
    tape,
):  # fmt: skip
    """A whole chain.  Returns (outcome, leader at the end, dominoes struck, dominoes past tipping).

    push = 0 rides no wave but composes the maps of all falls: GAIN, OFFSET and NEED in `state`.
    out: (N, 4) arrival time, velocity just after being hit, velocity just before hitting the next,
    stall margin; or (0, 4) where only the summary in `state` is wanted.
    tape: rows for what `pull` needs, of which state[TAPED] would be used; none where it is empty.
    """
    count = len(thickness)
    begin(state, push)
    if len(out) > 0:
        out[:, OUT_ARRIVAL] = np.inf
        out[:, OUT_RELEASE:] = np.nan
        out[0, OUT_ARRIVAL] = 0.0
        out[0, OUT_RELEASE] = push
    stand(ring, 0, 0, height[0], thickness[0], density[0])
    state[KAPPA] = heaviest_force(height[0], thickness[0])
    first, mask = 0, len(ring) - 1
    outcome = PROPAGATED
    if push == 0.0:
        state[COMPOSING] = 1.0
    elif count > 3 and is_uniform(spacing, thickness, height, density):
        join(ring, 0, 0, height[0], spacing[0], thickness[0])
        ring[0, TAIL] = count * ring[0, INERTIA]
        outcome, first = uniform_chain(
            lanes, ring, count, mu, gravity, rtol, state, deep, out, tape
        )
        mask = 0
        if outcome != PROPAGATED:
            return ending(ring, mask, first, mu, state, outcome)
    for n in range(first, count):
        strikes = n + 1 < count and spacing[n] < height[n]
        if mask > 0:
            lay(ring, mask, n, spacing, thickness, height, density, state)
        outcome = step(lanes, ring, mask, n, strikes, mu, gravity, rtol, state, deep, tape)
        if outcome == PROPAGATED and not strikes and n + 1 < count:
            outcome = OUT_OF_REACH
        record(out, n, outcome, state)
        if outcome != PROPAGATED:
            return ending(ring, mask, n, mu, state, outcome)
    return ending(ring, mask, count - 1, mu, state, PROPAGATED)


@numba.njit(**_JIT)
def ending(ring, mask, n, mu, state, outcome):
    """(outcome, leader, dominoes struck, dominoes past tipping) of a wave that ends under n."""
    half = 0.5 * state[ANGLE]
    s, c = math.sin(half), math.cos(half)
    toppled = census(ring, mask, n, int(state[BACK]), 2.0 * s * c, 2.0 * s * s, mu, state)
    if outcome in (OUT_OF_REACH, PROPAGATED):  # the leader is just at tipping
        toppled = n + 1
    struck = n + 2 if outcome == JAMMED and state[PART] == 1.0 else n + 1
    return outcome, n, struck, toppled


@numba.njit(**_JIT)
def solve(
    spacing, thickness, height, density, mu, gravity, push, rtol, lanes, ring, state, deep, out,
    tape,
):  # fmt: skip
    """`chain`, again with a smaller tolerance while its own estimate exceeds the one asked for.

    Where rounding alone exceeds it, no rule helps, and the estimate says so.
    """
    inner = rtol
    result = chain(
        spacing, thickness, height, density, mu, gravity, push, inner, lanes, ring, state, deep,
        out, tape,
    )  # fmt: skip
    for _ in range(3):
        if state[WORST] <= rtol or state[WORST_ROUND] > 0.5 * rtol or inner < 1e-15:
            break
        inner *= max(0.3 * rtol / state[WORST], 1e-3)
        result = chain(
            spacing, thickness, height, density, mu, gravity, push, inner, lanes, ring, state, deep,
            out, tape,
        )  # fmt: skip
    return result


# What a summary holds of each chain.
END, HIT, TOPPLED, REACH, TOTAL_TIME, ESTIMATE, N_FLUSHES, N_RELEASES, LOSS, LOWEST, TAPE_ROWS = (
    range(11)
)
SUMMARY_SIZE = 11


@numba.njit(**_JIT)
def ring_size(count):
    """Rows of the ring of a chain: a power of two with room for all, up to RING_ROWS."""
    size = 2
    while size < count + 1 and size < RING_ROWS:
        size *= 2
    return size


@numba.njit(**_JIT)
def solve_rows(
    first, last, spacing, thickness, height, density, mu, gravity, push, rtol, deep, summary, out,
    tape,
):  # fmt: skip
    """Chains first … last - 1 of a batch.  height, density (B, N) or (1, N); out (B, N, 4) or
    (0, 0, 4); tape for one chain, or empty."""
    count = thickness.shape[1]
    own_ring, own_lanes = np.zeros((ring_size(count), RING_COLUMNS)), np.zeros(LANE_ROWS * PITCH)
    own_state = np.zeros(STATE_SIZE)
    ring, lanes, state = borrowed(own_ring), borrowed(own_lanes), borrowed(own_state)
    unrecorded = np.empty((0, 4))
    for b in range(first, last):
        rows = out[b] if len(out) > 0 else unrecorded
        outcome, leader, struck, toppled = solve(
            spacing[b], thickness[b], height[b if len(height) > 1 else 0],
            density[b if len(density) > 1 else 0], mu, gravity, push, rtol, lanes, ring, state,
            deep, rows, tape,
        )  # fmt: skip
        summarise(summary[b], count, outcome, leader, struck, toppled, state)
    own_ring[0, 0] = own_lanes[0] = own_state[0] = 0.0  # keeps them alive to here


@numba.njit(**_JIT)
def summarise(row, count, outcome, leader, struck, toppled, state):
    row[END], row[HIT], row[TOPPLED] = outcome, struck, toppled
    row[REACH] = 1.0 if outcome == PROPAGATED else (leader + state[PART]) / count
    row[TOTAL_TIME] = state[TIME] if outcome == PROPAGATED else np.inf
    row[ESTIMATE] = state[WORST]
    row[N_FLUSHES], row[N_RELEASES] = state[FLUSHES], state[RELEASES]
    row[LOSS], row[LOWEST] = state[FLUSH_LOSS], state[LOWEST_MARGIN]
    row[TAPE_ROWS] = state[TAPED]


# --- Gradients, for those who ask -----------------------------------------------------------------
# Reverse mode, by hand: the tape is walked from its end, and every interval, hit and switch hands
# the derivative of one number (the pulled one) with respect to what came out of it on to what went
# in. `x_bar` is the derivative with respect to x. What an interval did is computed again rather
# than kept, so memory is linear in N.
B_SIN, B_VER, B_WGT, B_JAC, B_DRV = 0 * PITCH, 1 * PITCH, 2 * PITCH, 3 * PITCH, 4 * PITCH
SEED_M, SEED_G, SEED_D, B_MU = 5 * PITCH, 6 * PITCH, 7 * PITCH, 8 * PITCH
B_PITCH, B_GAP, B_THICK = 9 * PITCH, 10 * PITCH, 11 * PITCH  # of p, s, d of the link
B_INERTIA, B_HALF, B_SLENDER = 12 * PITCH, 13 * PITCH, 14 * PITCH
BAR_ROWS = 15

# What is gathered of each domino: derivatives with respect to p, s, d of its link (units of L_i),
# to its inertia, half weight and slenderness; and of the chain. In the order of B_PITCH and so on.
PART_PITCH, PART_GAP, PART_THICK, PART_INERTIA, PART_HALF, PART_SLENDER = range(6)
PARTS = 8  # two unused, for the vectors' sake
WHOLE_FRICTION, WHOLE_GRAVITY, WHOLE_PUSH = range(3)

FLUSHING = 3.0  # a link at the instant of its flush: tip contact before, corner contact after


@numba.njit(**_JIT)
def tip_back(s, v, p_l, s_l, rest, d_l, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """`tip` in reverse: bars of s, v, p, s_l, d, μ; and Ω, Ψ, B/A again."""
    sd = s_l - p_l * v
    cd2 = (1.0 + sd) * (rest + p_l * v)
    cd = math.sqrt(cd2 if cd2 > TINY else TINY)
    arm = cd + mu * sd
    r = 1.0 / (cd * arm)
    inv_cd, inv_arm = r * arm, r * cd
    c = 1.0 - v
    c_i = c * cd - s * sd
    pull = p_l * inv_cd
    omega = 1.0 - pull * s
    ratio = (cd - p_l * s - mu * d_l) * inv_arm
    bracket = c_i + s * sd * omega
    psi = -pull * inv_cd * bracket
    # psi
    q = -pull * inv_cd * psi_bar
    cd_bar = -2.0 * psi * inv_cd * psi_bar
    p_bar = -inv_cd * inv_cd * bracket * psi_bar
    ci_bar = q - v_bar
    omega_bar += q * s * sd
    back_s, sd_bar = q * sd * omega, q * s * omega
    # ratio
    top_bar = ratio_bar * inv_arm
    arm_bar = -ratio * top_bar
    cd_bar += top_bar + arm_bar
    sd_bar += mu * arm_bar
    mu_bar = sd * arm_bar - d_l * top_bar
    d_bar = -mu * top_bar
    # omega
    q = omega_bar * inv_cd
    p_bar -= s * (top_bar + q)
    back_s -= p_l * (top_bar + q)
    cd_bar += pull * s * q
    # lean of the domino behind
    back_s += cd * s_bar - sd * ci_bar
    c_bar = sd * s_bar + cd * ci_bar
    cd_bar += s * s_bar + c * ci_bar
    sd_bar += c * s_bar - s * ci_bar
    # contact
    sd_bar -= sd * inv_cd * cd_bar
    p_bar -= v * sd_bar
    return back_s, -c_bar - p_l * sd_bar, p_bar, sd_bar, d_bar, mu_bar, omega, psi, ratio


@numba.njit(**_JIT)
def corner_back(s, v, p_l, s_l, d_l, mu, s_bar, v_bar, omega_bar, psi_bar, ratio_bar):
    """`corner` in reverse; the same nine numbers."""
    r2 = s_l * s_l + 2.0 * p_l * d_l * v
    inv_r2 = 1.0 / r2
    inv_r1 = math.sqrt(inv_r2)
    lift = p_l * v - s_l
    slide = lift - mu * p_l * s
    omega, ratio = d_l * lift * inv_r2, d_l * slide * inv_r2
    x = s_l + d_l * v
    fourth = inv_r2 * inv_r2
    psi = p_l * d_l * s * s_l * (p_l + d_l) * fourth
    # psi
    q = psi_bar * fourth
    r2_bar = -(2.0 * psi * psi_bar + omega * omega_bar + ratio * ratio_bar) * inv_r2
    back_s = p_l * d_l * s_l * (p_l + d_l) * q
    p_bar = d_l * s * s_l * (2.0 * p_l + d_l) * q
    d_bar = p_l * s * s_l * (p_l + 2.0 * d_l) * q
    gap_bar = p_l * d_l * s * (p_l + d_l) * q
    # omega and ratio
    o, f = omega_bar * inv_r2, ratio_bar * inv_r2
    d_bar += lift * o + slide * f
    p_bar += d_l * (v * (o + f) - mu * s * f)
    back_v = d_l * p_l * (o + f)
    gap_bar -= d_l * (o + f)
    back_s -= d_l * mu * p_l * f
    mu_bar = -d_l * p_l * s * f
    # lean of the domino behind: sin = x / r1, cos = d s / r1
    x_bar, c_bar = s_bar * inv_r1, -v_bar * inv_r1
    gap_bar += x_bar
    d_bar += v * x_bar + s * c_bar
    back_v += d_l * x_bar
    back_s += d_l * c_bar
    r2_bar -= 0.5 * (x * x_bar + d_l * s * c_bar) * inv_r2
    # contact
    gap_bar += 2.0 * s_l * r2_bar
    p_bar += 2.0 * d_l * v * r2_bar
    d_bar += 2.0 * p_l * v * r2_bar
    back_v += 2.0 * p_l * d_l * r2_bar
    return back_s, back_v, p_bar, gap_bar, d_bar, mu_bar, omega, psi, ratio


@numba.njit(**_JIT)
def lean_back(bars, above, here, count, ring, row, mu, at_tip):
    """`lean` in reverse; `above` and `here` are the lanes before and after it."""
    p_l, s_l, rest, d_l = ring[row, P_L], ring[row, S_L], ring[row, REST], ring[row, D_L]
    inertia, half, slender = ring[row, INERTIA], ring[row, HALF_WEIGHT], ring[row, SLENDER]
    for j in range(count):
        s, v, w, jac, drv = above[SIN + j], above[VER + j], above[WGT + j], above[JAC + j], above[DRV + j]  # noqa: E501  # fmt: skip
        s_i, c_i, w_i, jac_i, drv_i = here[SIN + j], 1.0 - here[VER + j], here[WGT + j], here[JAC + j], here[DRV + j]  # noqa: E501  # fmt: skip
        m, g, d = bars[SEED_M + j], bars[SEED_G + j], bars[SEED_D + j]
        arm, turn = s_i - slender * c_i, m * jac_i + d * drv_i
        w_bar = bars[B_WGT + j] + inertia * turn + g * half * arm
        jac_bar = bars[B_JAC + j] + m * w_i * inertia
        drv_bar = bars[B_DRV + j] + d * w_i * inertia
        s_bar = bars[B_SIN + j] + g * w_i * half
        v_bar = bars[B_VER + j] + g * w_i * half * slender
        bars[B_INERTIA + j] = w_i * turn
        bars[B_HALF + j] = g * w_i * arm
        bars[B_SLENDER + j] = -g * w_i * half * c_i
        o_bar, psi_bar, ratio_bar = drv_bar * drv + jac_bar * jac, drv_bar * jac * jac, w_bar * w
        if at_tip:
            s_bar, v_bar, p_bar, gap_bar, d_bar, mu_bar, omega, psi, ratio = tip_back(
                s, v, p_l, s_l, rest, d_l, mu, s_bar, v_bar, o_bar, psi_bar, ratio_bar
            )
        else:
            s_bar, v_bar, p_bar, gap_bar, d_bar, mu_bar, omega, psi, ratio = corner_back(
                s, v, p_l, s_l, d_l, mu, s_bar, v_bar, o_bar, psi_bar, ratio_bar
            )
        bars[B_SIN + j], bars[B_VER + j] = s_bar, v_bar
        bars[B_WGT + j] = w_bar * ratio
        bars[B_JAC + j] = jac_bar * omega + 2.0 * drv_bar * psi * jac
        bars[B_DRV + j] = drv_bar * omega
        bars[B_MU + j] += mu_bar
        bars[B_PITCH + j], bars[B_GAP + j], bars[B_THICK + j] = p_bar, gap_bar, d_bar


@numba.njit(**_JIT)
def lean_free_back(bars, above, here, count, ring, row, at_tip):
    """`lean_free` in reverse."""
    p_l, s_l, rest, d_l = ring[row, P_L], ring[row, S_L], ring[row, REST], ring[row, D_L]
    inertia, half, slender = ring[row, INERTIA], ring[row, HALF_WEIGHT], ring[row, SLENDER]
    for j in range(count):
        s, v, jac = above[SIN + j], above[VER + j], above[JAC + j]
        s_i, v_i, jac_i = here[SIN + j], here[VER + j], here[JAC + j]
        m, g = bars[SEED_M + j], bars[SEED_G + j]
        jac_bar = bars[B_JAC + j] + 2.0 * m * inertia * jac_i
        s_bar = bars[B_SIN + j] + g * half * slender
        v_bar = bars[B_VER + j] - g * half
        bars[B_INERTIA + j] = m * jac_i * jac_i
        bars[B_HALF + j] = g * (slender * s_i - v_i)
        bars[B_SLENDER + j] = g * half * s_i
        if at_tip:
            s_bar, v_bar, p_bar, gap_bar, d_bar, _, omega, _, _ = tip_back(
                s, v, p_l, s_l, rest, d_l, 0.0, s_bar, v_bar, jac_bar * jac, 0.0, 0.0
            )
        else:
            s_bar, v_bar, p_bar, gap_bar, d_bar, _, omega, _, _ = corner_back(
                s, v, p_l, s_l, d_l, 0.0, s_bar, v_bar, jac_bar * jac, 0.0, 0.0
            )
        bars[B_SIN + j], bars[B_VER + j] = s_bar, v_bar
        bars[B_JAC + j] = jac_bar * omega
        bars[B_PITCH + j], bars[B_GAP + j], bars[B_THICK + j] = p_bar, gap_bar, d_bar


@numba.njit(**_JIT)
def gather(bars, count, parts):
    """Add what all lanes say of one domino."""
    p, s, d, inertia, half, slender = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(count):
        p += bars[B_PITCH + j]
        s += bars[B_GAP + j]
        d += bars[B_THICK + j]
        inertia += bars[B_INERTIA + j]
        half += bars[B_HALF + j]
        slender += bars[B_SLENDER + j]
    parts[PART_PITCH] += p
    parts[PART_GAP] += s
    parts[PART_THICK] += d
    parts[PART_INERTIA] += inertia
    parts[PART_HALF] += half
    parts[PART_SLENDER] += slender


@numba.njit(**_JIT)
def retrace(lanes, count, ring, n, low, mu, trail):
    """Lead the lanes down the stack once more, keeping what they were at every domino."""
    lead(lanes, count, ring, n, mu)
    keep = trail[0]
    for j in range(count):
        keep[SIN + j], keep[VER + j] = lanes[SIN + j], lanes[VER + j]
        keep[WGT + j], keep[JAC + j], keep[DRV + j] = 1.0, 1.0, 0.0
    for i in range(n - 1, low - 1, -1):
        keep = trail[n - i]
        if mu > 0.0:
            lean(lanes, count, ring, i, mu)
            for j in range(count):
                keep[WGT + j], keep[DRV + j] = lanes[WGT + j], lanes[DRV + j]
        else:
            lean_free(lanes, count, ring, i)
        for j in range(count):
            keep[SIN + j], keep[VER + j], keep[JAC + j] = lanes[SIN + j], lanes[VER + j], lanes[JAC + j]  # noqa: E501  # fmt: skip


@numba.njit(**_JIT)
def link_back(bars, above, here, count, ring, i, mu):
    """Lead all bars up over one link, whatever its contact."""
    if mu > 0.0:  # a constant in the call lets the compiler make a loop for each contact
        if ring[i, STATE] == TIP:
            lean_back(bars, above, here, count, ring, i, mu, True)
        else:
            lean_back(bars, above, here, count, ring, i, mu, False)
    elif ring[i, STATE] == TIP:
        lean_free_back(bars, above, here, count, ring, i, True)
    else:
        lean_free_back(bars, above, here, count, ring, i, False)


@numba.njit(**_JIT)
def lead_back(bars, first, count, ring, n, mu):
    """`lead` in reverse; `first` are the lanes at the leader."""
    half, slender = ring[n, HALF_WEIGHT], ring[n, SLENDER]
    for j in range(count):
        s, v, g = first[SIN + j], first[VER + j], bars[SEED_G + j]
        bars[B_PITCH + j], bars[B_GAP + j], bars[B_THICK + j] = 0.0, 0.0, 0.0
        bars[B_INERTIA + j] = bars[SEED_M + j]
        if mu > 0.0:
            bars[B_SIN + j] += g * half
            bars[B_VER + j] += g * half * slender
            bars[B_HALF + j] = g * (s - slender * (1.0 - v))
            bars[B_SLENDER + j] = -g * half * (1.0 - v)
        else:
            bars[B_SIN + j] += g * half * slender
            bars[B_VER + j] -= g * half
            bars[B_HALF + j] = g * (slender * s - v)
            bars[B_SLENDER + j] = g * half * s


@numba.njit(**_JIT)
def no_bars(bars, count):
    for j in range(count):
        bars[B_SIN + j], bars[B_VER + j] = 0.0, 0.0
        bars[B_WGT + j], bars[B_JAC + j], bars[B_DRV + j] = 0.0, 0.0, 0.0
        bars[B_MU + j] = 0.0


@numba.njit(**_JIT)
def angle_bar(bars, first, j):
    """Bar of the angle of a lane."""
    return (1.0 - first[VER + j]) * bars[B_SIN + j] + first[SIN + j] * bars[B_VER + j]


@numba.njit(**_JIT)
def stack_back(bars, count, ring, n, low, mu, trail, parts):
    """Pull the seeds of the three sums back through the stack."""
    no_bars(bars, count)
    for i in range(low, n):
        link_back(bars, trail[n - i - 1], trail[n - i], count, ring, i, mu)
        gather(bars, count, parts[i])
    lead_back(bars, trail[0], count, ring, n, mu)
    gather(bars, count, parts[n])


@numba.njit(**_JIT)
def tabulate(bars, k, ring, n, low, mu, trail, table):
    """What one unit of each seed adds to each part: for stacks that many falls share.

    table[sum and lane, depth and part]; one depth more holds what it adds to the bars of the last
    angle and of the friction.
    """
    count, depth = ORDERS[k] + 2, n - low
    table[:] = 0.0
    for q in range(3):
        for j in range(count):
            bars[SEED_M + j], bars[SEED_G + j], bars[SEED_D + j] = 0.0, 0.0, 0.0
            bars[SEED_M + q * PITCH + j] = 1.0
        no_bars(bars, count)
        for i in range(low, n + 1):
            if i < n:
                link_back(bars, trail[n - i - 1], trail[n - i], count, ring, i, mu)
            else:
                lead_back(bars, trail[0], count, ring, n, mu)
            for j in range(count):
                for c in range(6):
                    table[q * PITCH + j, (n - i) * PARTS + c] = bars[B_PITCH + c * PITCH + j]
        for j in range(count):
            x, at = angle_bar(bars, trail[0], j), (depth + 1) * PARTS
            table[q * PITCH + j, at] = PLACES[k, j] * x
            table[q * PITCH + j, at + 1] = bars[B_MU + j] if mu > 0.0 else 0.0


@numba.njit(**_JIT)
def stack_back_again(bars, count, n, low, table, sums, parts, whole):
    """`stack_back` by the table; returns the bar of the last angle."""
    depth = n - low
    size = (depth + 2) * PARTS
    for x in range(size):
        sums[x] = 0.0
    for q in range(3):
        for j in range(count):
            seed, row = bars[SEED_M + q * PITCH + j], table[q * PITCH + j]
            if seed != 0.0:
                for x in range(size):
                    sums[x] += seed * row[x]
    for level in range(depth + 1):
        for c in range(PARTS):
            parts[n - level, c] += sums[level * PARTS + c]
    at = (depth + 1) * PARTS
    whole[WHOLE_FRICTION] += sums[at + 1]
    return sums[at]


@numba.njit(**_JIT)
def ride_seeds(lanes, bars, tape, u_bar, t_bar, m_bar, mu, gravity, whole):
    """The time and the map of one interval in reverse: seeds of M, G and D, from lanes that hold
    its map.  Returns bars of u at its start and of its length.
    """
    h, k, u0, x_low = tape[3], int(tape[4]), tape[6], tape[7]
    end = ORDERS[k] + 1
    count = end + 1
    lanes[SPEED2] = u0
    for j in range(1, end + 1):
        lanes[SPEED2 + j] = lanes[MAP_E + j] * (u0 + lanes[MAP_U + j])
    # the time: bars of u at the lanes, in SLOWNESS
    time = 0.0
    if x_low >= 0.0:
        series(lanes, SPEED2, k)
        moments = bars[B_MU : B_MU + PITCH]
        moments[:] = 0.0
        time, _ = slow_time(lanes, count, x_low, moments)
        for j in range(count):
            f = 0.0
            for i in range(count):
                f += CLOSED[k, j, i] * moments[i]
            lanes[SLOWNESS + j] = -h * t_bar * f
    else:
        lanes[SLOWNESS], lanes[SLOWNESS + end] = 0.0, 0.0
        for j in range(1, end):
            f = 1.0 / math.sqrt(lanes[SPEED2 + j])
            time += WEIGHTS[k, j - 1] * f
            lanes[SLOWNESS + j] = -0.5 * h * t_bar * WEIGHTS[k, j - 1] * f * f * f
    h_bar = t_bar * time
    lanes[SLOWNESS + end] += u_bar
    # the map: bars of E in SPEED2, of U in SLOWNESS
    u0_bar = lanes[SLOWNESS]
    for j in range(1, end + 1):
        x = lanes[SLOWNESS + j]
        lanes[SPEED2 + j] = (u0 + lanes[MAP_U + j]) * x
        lanes[SLOWNESS + j] = lanes[MAP_E + j] * x
        u0_bar += lanes[SLOWNESS + j]
    for j in range(count):
        bars[SEED_M + j], bars[SEED_G + j], bars[SEED_D + j] = 0.0, 0.0, 0.0
    if mu > 0.0:
        for i in range(1, end):
            r_bar = WEIGHTS[k, i - 1] * lanes[SLOWNESS + end]
            for j in range(1, end):
                r_bar += RUNNING[k, i - 1, j - 1] * lanes[SLOWNESS + j]
            inv, rate = 1.0 / lanes[SUM_M + i], lanes[RATE + i]
            bars[SEED_G + i] = r_bar * 2.0 * gravity * h * inv / lanes[MAP_E + i]
            whole[WHOLE_GRAVITY] += r_bar * rate / gravity
            h_bar += r_bar * rate / h
            bars[SEED_M + i] = -r_bar * rate * inv
            lanes[COEF + i] = lanes[MAP_E + i] * lanes[SPEED2 + i] - r_bar * rate
        for i in range(1, end):
            q_bar = WEIGHTS[k, i - 1] * lanes[MAP_E + end] * lanes[SPEED2 + end]
            for j in range(1, end):
                q_bar += RUNNING[k, i - 1, j - 1] * lanes[COEF + j]
            inv, q = 1.0 / lanes[SUM_M + i], lanes[EXPO + i]
            bars[SEED_D + i] = -2.0 * h * inv * q_bar
            h_bar += q * q_bar / h
            bars[SEED_M + i] -= q * q_bar * inv
    else:
        m0 = lanes[SUM_M]
        for j in range(1, end + 1):
            e_bar, x = lanes[SPEED2 + j], lanes[SLOWNESS + j]
            bars[SEED_M + j] = -lanes[MAP_E + j] / lanes[SUM_M + j] * e_bar
            bars[SEED_G + j] = -2.0 * gravity / m0 * x
            bars[SEED_M] += (e_bar / lanes[SUM_M + j]) - lanes[MAP_U + j] / m0 * x
            bars[SEED_G] -= bars[SEED_G + j]
            whole[WHOLE_GRAVITY] += lanes[MAP_U + j] / gravity * x
    bars[SEED_M + end] += m_bar
    return u0_bar, h_bar


@numba.njit(**_JIT)
def trace(lanes, trail, ring, tape, mu, gravity):
    """Sweep and map of an interval once more."""
    n, k, h, low = int(tape[1]), int(tape[4]), tape[3], int(tape[5])
    count = spread(lanes, k, tape[2], h)
    retrace(lanes, count, ring, n, low, mu, trail)
    affine_map(lanes, k, h, mu, gravity)


@numba.njit(**_JIT)
def ride_back(lanes, bars, trail, ring, tape, u_bar, t_bar, m_bar, mu, gravity, parts, whole):
    """One interval in reverse.

    u_bar, t_bar, m_bar: of u and M at its end, and of its time.
    Returns bars of u at its start, of its first and of its last angle.
    """
    n, k, low = int(tape[1]), int(tape[4]), int(tape[5])
    count = ORDERS[k] + 2
    trace(lanes, trail, ring, tape, mu, gravity)
    u0_bar, end_bar = ride_seeds(lanes, bars, tape, u_bar, t_bar, m_bar, mu, gravity, whole)
    stack_back(bars, count, ring, n, low, mu, trail, parts)
    first_bar = 0.0
    for j in range(count):  # the angles a + h x_j of the lanes
        x = angle_bar(bars, trail[0], j)
        first_bar += x
        end_bar += PLACES[k, j] * x
        if mu > 0.0:
            whole[WHOLE_FRICTION] += bars[B_MU + j]
    return u0_bar, first_bar - end_bar, end_bar


@numba.njit(**_JIT)
def pose(angle):
    """sin and 1 - cos of one angle."""
    half = 0.5 * angle
    s, c = math.sin(half), math.cos(half)
    return 2.0 * s * c, 2.0 * s * s


@numba.njit(**_JIT)
def mass_back(lanes, bars, trail, ring, n, low, angle, m_bar, mu, parts, whole):
    """M of the stack at one angle in reverse; returns the bar of the angle."""
    lanes[SIN], lanes[VER] = pose(angle)
    retrace(lanes, 1, ring, n, low, mu, trail)
    bars[SEED_M], bars[SEED_G], bars[SEED_D] = m_bar, 0.0, 0.0
    stack_back(bars, 1, ring, n, low, mu, trail, parts)
    whole[WHOLE_FRICTION] += bars[B_MU]
    return angle_bar(bars, trail[0], 0)


@numba.njit(**_JIT)
def hit_back(ring, tape, u_bar, mu, parts, whole):
    """`hit` in reverse: bars of u before it and of M."""
    n, u, m_end = int(tape[1]), tape[3], tape[4]
    s_l, d_l, other = ring[n, S_L], ring[n, D_L], ring[n + 1, INERTIA]
    cd = math.sqrt(ring[n, REST] * (1.0 + s_l))
    up, down = cd - mu * d_l, cd + mu * s_l
    f = up / down
    m = m_end * f
    keep = m / (m + other)
    keep_bar = 2.0 * keep * u * u_bar
    m_bar = keep_bar * other / ((m + other) * (m + other))
    parts[n + 1, PART_INERTIA] -= keep_bar * m / ((m + other) * (m + other))
    up_bar, down_bar = m_end * m_bar / down, -m_end * m_bar * f / down
    parts[n, PART_THICK] -= mu * up_bar
    parts[n, PART_GAP] += mu * down_bar - s_l / cd * (up_bar + down_bar)
    whole[WHOLE_FRICTION] += s_l * down_bar - d_l * up_bar
    return keep * keep * u_bar, f * m_bar


@numba.njit(**_JIT)
def flush_back(trail, ring, n, low, angle, u_bar, u, mu, parts, whole):
    """The impact of a flush in reverse, links that flush being FLUSHING.

    Returns bars of u before it and of the angle.
    """
    s, v = pose(angle)
    w, jac = 1.0, 1.0
    trail[0, SIN], trail[0, VER], trail[0, WGT], trail[0, JAC] = s, v, w, jac
    before, after, first = ring[n, INERTIA], ring[n, INERTIA], low
    for i in range(n - 1, low - 1, -1):
        p_l, s_l, rest, d_l = ring[i, P_L], ring[i, S_L], ring[i, REST], ring[i, D_L]
        if ring[i, STATE] == CORNER:
            s_i, v_i, omega, _, ratio = corner(s, v, p_l, s_l, rest, d_l, mu)
        else:
            s_i, v_i, omega, _, ratio = tip(s, v, p_l, s_l, rest, d_l, mu)
            if ring[i, STATE] == FLUSHING:
                s_i, v_i, _, _, ratio = corner(s, v, p_l, s_l, rest, d_l, mu)
                first = max(first, i + 1)
        s, v, w, jac = s_i, v_i, w * ratio, jac * omega
        keep = trail[n - i]
        keep[SIN], keep[VER], keep[WGT], keep[JAC] = s, v, w, jac
        before += w * ring[i, INERTIA] * jac
        if i >= first:
            after += w * ring[i, INERTIA] * jac
    keep = before / after
    keep_bar = 2.0 * keep * u * u_bar
    before_bar, after_bar = keep_bar / after, -keep_bar * keep / after
    s_bar, v_bar, w_bar, jac_bar = 0.0, 0.0, 0.0, 0.0
    for i in range(low, n):
        p_l, s_l, rest, d_l = ring[i, P_L], ring[i, S_L], ring[i, REST], ring[i, D_L]
        seed = before_bar + (after_bar if i >= first else 0.0)
        w, jac = trail[n - i, WGT], trail[n - i, JAC]
        parts[i, PART_INERTIA] += seed * w * jac
        w_bar += seed * ring[i, INERTIA] * jac
        jac_bar += seed * ring[i, INERTIA] * w
        s, v, w, jac = trail[n - i - 1, SIN], trail[n - i - 1, VER], trail[n - i - 1, WGT], trail[n - i - 1, JAC]  # noqa: E501  # fmt: skip
        o_bar, r_bar = jac_bar * jac, w_bar * w
        if ring[i, STATE] == TIP:
            s_bar, v_bar, p_bar, gap_bar, d_bar, mu_bar, omega, _, ratio = tip_back(
                s, v, p_l, s_l, rest, d_l, mu, s_bar, v_bar, o_bar, 0.0, r_bar
            )
        else:
            o_corner = o_bar if ring[i, STATE] == CORNER else 0.0
            s_bar, v_bar, p_bar, gap_bar, d_bar, mu_bar, omega, _, ratio = corner_back(
                s, v, p_l, s_l, d_l, mu, s_bar, v_bar, o_corner, 0.0, r_bar
            )
            if ring[i, STATE] == FLUSHING:
                s_2, v_2, p_2, gap_2, d_2, _, omega, _, _ = tip_back(
                    s, v, p_l, s_l, rest, d_l, mu, 0.0, 0.0, o_bar, 0.0, 0.0
                )
                s_bar, v_bar, p_bar, gap_bar, d_bar = s_bar + s_2, v_bar + v_2, p_bar + p_2, gap_bar + gap_2, d_bar + d_2  # noqa: E501  # fmt: skip
        w_bar, jac_bar = w_bar * ratio, jac_bar * omega
        parts[i, PART_PITCH] += p_bar
        parts[i, PART_GAP] += gap_bar
        parts[i, PART_THICK] += d_bar
        whole[WHOLE_FRICTION] += mu_bar
    parts[n, PART_INERTIA] += before_bar + after_bar
    return keep * keep * u_bar, (1.0 - trail[0, VER]) * s_bar + trail[0, SIN] * v_bar


@numba.njit(**_JIT)
def switch_back(trail, ring, tape, x_bar, mu, parts):
    """The angle of a switch in reverse, by the implicit function theorem: at that angle 1 - cos
    θ_{i+1} is what the link waits for."""
    n, due_link, flushes = int(tape[1]), int(tape[3]), tape[4] == 1.0
    s, v = pose(tape[2])
    jac = 1.0
    trail[0, SIN], trail[0, VER] = s, v
    for i in range(n - 1, due_link, -1):
        s, v, omega, _, _ = link(ring, i, s, v, mu)
        trail[n - i, SIN], trail[n - i, VER] = s, v
        jac *= omega
    rate = s * jac
    if abs(rate) < TINY:
        return  # the link stands still: no angle is the answer, and this one is kept
    due_bar = x_bar / rate
    p_l, s_l, d_l = ring[due_link, P_L], ring[due_link, S_L], ring[due_link, D_L]
    if flushes:  # s / p
        parts[due_link, PART_GAP] += due_bar / p_l
        parts[due_link, PART_PITCH] -= due_bar * s_l / (p_l * p_l)
    else:  # (1 - s²) / 2pd
        parts[due_link, PART_GAP] -= due_bar * s_l / (p_l * d_l)
        parts[due_link, PART_PITCH] -= due_bar * ring[due_link, V_RELEASE] / p_l
        parts[due_link, PART_THICK] -= due_bar * ring[due_link, V_RELEASE] / d_l
    s_bar, v_bar = 0.0, -due_bar
    for i in range(due_link + 1, n):
        p_l, s_l, rest, d_l = ring[i, P_L], ring[i, S_L], ring[i, REST], ring[i, D_L]
        s, v = trail[n - i - 1, SIN], trail[n - i - 1, VER]
        if ring[i, STATE] == TIP:
            s_bar, v_bar, p_bar, gap_bar, d_bar, _, _, _, _ = tip_back(
                s, v, p_l, s_l, rest, d_l, mu, s_bar, v_bar, 0.0, 0.0, 0.0
            )
        else:
            s_bar, v_bar, p_bar, gap_bar, d_bar, _, _, _, _ = corner_back(
                s, v, p_l, s_l, d_l, mu, s_bar, v_bar, 0.0, 0.0, 0.0
            )
        parts[i, PART_PITCH] += p_bar
        parts[i, PART_GAP] += gap_bar
        parts[i, PART_THICK] += d_bar


AT_SPLIT, AT_HIT, AT_SWITCH = 0, 1, 2  # what an interval ends at


@numba.njit(**_JIT)
def rewind(tape, used, ring, mu, gravity, arrival_bar, lanes, bars, trail, table, parts, whole):
    """Walk the tape back, gathering bars in `parts` and `whole`; returns the bar of the first u.

    ring: all dominoes and links, in the states of the end.
    table: room for what the falls of a uniform row share; empty for others.
    """
    u_bar, m_bar, t_bar = 0.0, 0.0, 0.0
    held_rule, held_depth, sums = -1, -1, np.empty(table.shape[1])
    edge, edge_bar, edge_row = AT_SPLIT, 0.0, 0
    counted = len(arrival_bar)
    last_hit = used - 1
    while last_hit >= 0 and tape[last_hit, 0] != HIT_NEXT:
        last_hit -= 1
    for at in range(used - 1, -1, -1):
        row = tape[at]
        kind, n = row[0], int(row[1])
        if edge == AT_HIT and at < last_hit and kind != RIDE:
            # a switch at the very instant of the hit: M there is that of the new states
            struck, low = int(tape[edge_row, 1]), int(tape[edge_row, 2])
            b = fall_angle(ring, -1, struck, True)
            x_bar = mass_back(lanes, bars, trail, ring, struck, low, b, m_bar, mu, parts, whole)
            parts[struck, PART_GAP] += x_bar / math.cos(b)
            m_bar, edge, edge_bar = 0.0, AT_SPLIT, 0.0
        if kind == FLIP:
            ring[n, STATE] = TIP
        elif at > last_hit:
            continue  # what no arrival has seen
        elif kind == HIT_NEXT:
            while counted > n + 1:  # the time of a fall is part of all later arrivals
                counted -= 1
                t_bar += arrival_bar[counted]
            u_bar, m_bar = hit_back(ring, row, u_bar, mu, parts, whole)
            edge, edge_bar, edge_row = AT_HIT, 0.0, at
        elif kind == SWITCH:
            flushes, angle, low = row[4] == 1.0, row[2], int(row[5])
            if flushes and mu > 0.0:
                flips = int(row[7])
                for i in range(at + 1, at + 1 + flips):
                    ring[int(tape[i, 1]), STATE] = FLUSHING
                u_bar, x_bar = flush_back(
                    trail, ring, n, low, angle, u_bar, row[6], mu, parts, whole
                )
                edge_bar += x_bar
                for i in range(at + 1, at + 1 + flips):
                    ring[int(tape[i, 1]), STATE] = TIP
            edge, edge_row = AT_SWITCH, at
            if at == 0 or tape[at - 1, 0] != RIDE or int(tape[at - 1, 1]) != n:
                switch_back(trail, ring, row, edge_bar, mu, parts)
                edge, edge_bar = AT_SPLIT, 0.0
        else:
            k, depth = int(row[4]), n - int(row[5])
            if len(table) > 0 and depth < n and edge == AT_HIT and row[2] == 0.0:
                if k != held_rule or depth != held_depth:
                    trace(lanes, trail, ring, row, mu, gravity)
                    tabulate(bars, k, ring, n, n - depth, mu, trail, table)
                    held_rule, held_depth = k, depth
                u_bar, end_bar = ride_seeds(
                    lanes, bars, row, u_bar, t_bar, m_bar, mu, gravity, whole
                )
                end_bar += stack_back_again(
                    bars, ORDERS[k] + 2, n, n - depth, table, sums, parts, whole
                )
                start_bar = 0.0  # a fall starts upright, always
            else:
                held_rule = -1
                u_bar, start_bar, end_bar = ride_back(
                    lanes, bars, trail, ring, row, u_bar, t_bar, m_bar, mu, gravity, parts, whole
                )
            edge_bar += end_bar
            if edge == AT_HIT:  # sin θ = s
                parts[n, PART_GAP] += edge_bar / math.sqrt(ring[n, REST] * (1.0 + ring[n, S_L]))
            elif edge == AT_SWITCH:
                switch_back(trail, ring, tape[edge_row], edge_bar, mu, parts)
            edge, edge_bar, m_bar = AT_SPLIT, start_bar, 0.0
    return u_bar


@numba.njit(**_JIT)
def pull(
    spacing, thickness, height, density, mu, gravity, push, tape, used, arrival_bar, gap_bar,
    bodies_bar, whole,
):  # fmt: skip
    """Pull bars of the arrival times back to all that a chain is made of.

    gap_bar (N-1,); bodies_bar (3, N): thickness, height, density; whole (3,): friction, gravity,
    push.
    """
    count = len(thickness)
    ring = np.empty((count, RING_COLUMNS))
    for i in range(count):
        stand(ring, -1, i, height[i], thickness[i], density[i])
        if i + 1 < count:
            join(ring, -1, i, height[i], spacing[i], thickness[i + 1])
    depth = 0
    for at in range(used):
        n = int(tape[at, 1])
        if tape[at, 0] == FLIP:
            ring[n, STATE] = CORNER
        else:
            low = tape[at, 2] if tape[at, 0] == HIT_NEXT else tape[at, 5]
            depth = max(depth, n - int(low))
    lanes, bars = np.zeros(LANE_ROWS * PITCH), np.zeros(BAR_ROWS * PITCH)
    trail, parts = np.empty((depth + 2, 5 * PITCH)), np.zeros((count, PARTS))
    whole[:] = 0.0
    table = np.empty((0, 0))
    if count > 3 and is_uniform(spacing, thickness, height, density):
        table = np.empty((3 * PITCH, (depth + 2) * PARTS))
    u_bar = rewind(
        tape, used, ring, mu, gravity, arrival_bar, lanes, bars, trail, table, parts, whole
    )
    whole[WHOLE_PUSH] = 2.0 * push * u_bar
    bodies_bar[:] = 0.0
    for i in range(count):
        length, d, rho = height[i], thickness[i], density[i]
        inertia_bar, half_bar, slender_bar = parts[i, PART_INERTIA], parts[i, PART_HALF], parts[i, PART_SLENDER]  # noqa: E501  # fmt: skip
        square = (length * length + d * d) / 3.0
        bodies_bar[0, i] += (
            rho * length * (square + 2.0 * d * d / 3.0) * inertia_bar
            + 0.5 * rho * length * length * half_bar
            + slender_bar / length
        )
        bodies_bar[1, i] += (
            rho * d * (square + 2.0 * length * length / 3.0) * inertia_bar
            + rho * length * d * half_bar
            - d / (length * length) * slender_bar
        )
        bodies_bar[2, i] = length * d * (square * inertia_bar + 0.5 * length * half_bar)
        if i + 1 < count:
            p_bar, s_bar, d_bar = parts[i, PART_PITCH], parts[i, PART_GAP], parts[i, PART_THICK]
            gap_bar[i] = (p_bar + s_bar) / length
            bodies_bar[0, i + 1] += (p_bar + d_bar) / length
            bodies_bar[1, i] -= (
                ring[i, P_L] * p_bar + ring[i, S_L] * s_bar + ring[i, D_L] * d_bar
            ) / length


@numba.njit(**_JIT)
def pull_rows(
    first, last, spacing, thickness, height, density, mu, gravity, push, rtol, summary, gap_bar,
    bodies_bar, whole,
):  # fmt: skip
    """`solve_rows` with the gradient of the last arrival time; zeros where it never comes.

    gap_bar (B, N-1), bodies_bar (B, 3, N), whole (B, 3), as of `pull`.
    """
    count = thickness.shape[1]
    ring, lanes = np.zeros((ring_size(count), RING_COLUMNS)), np.zeros(LANE_ROWS * PITCH)
    state, unrecorded = np.zeros(STATE_SIZE), np.empty((0, 4))
    tape, arrival_bar = np.empty((4 * count + 16, TAPE_COLUMNS)), np.zeros(count)
    arrival_bar[count - 1] = 1.0
    for b in range(first, last):
        h, r = height[b if len(height) > 1 else 0], density[b if len(density) > 1 else 0]
        outcome, leader, struck, toppled = solve(
            spacing[b], thickness[b], h, r, mu, gravity, push, rtol, lanes, ring, state, True,
            unrecorded, tape,
        )  # fmt: skip
        if state[TAPED] > len(tape):
            tape = np.empty((int(1.5 * state[TAPED]), TAPE_COLUMNS))
            outcome, leader, struck, toppled = solve(
                spacing[b], thickness[b], h, r, mu, gravity, push, rtol, lanes, ring, state, True,
                unrecorded, tape,
            )  # fmt: skip
        summarise(summary[b], count, outcome, leader, struck, toppled, state)
        if outcome == PROPAGATED:
            pull(
                spacing[b], thickness[b], h, r, mu, gravity, push, tape, int(state[TAPED]),
                arrival_bar, gap_bar[b], bodies_bar[b], whole[b],
            )  # fmt: skip
        else:
            gap_bar[b], bodies_bar[b], whole[b] = 0.0, 0.0, 0.0


# --- The wave that never changes ------------------------------------------------------------------
@numba.njit(**_JIT)
def endless(ring, mask, n, spacing, thickness, height, density, state):
    """Fill the ring with a row that repeats a pattern of P dominoes for ever behind leader n."""
    period = len(thickness)
    state[BACK] = 0.0
    for i in range(n - mask, n + 2):
        j, ahead = i % period, (i + 1) % period
        row = i & mask
        stand(ring, mask, i, height[j], thickness[j], density[j])
        join(ring, mask, i, height[j], spacing[j], thickness[ahead])
        ring[row, TAIL] = ring[row, INERTIA] * (i - n + mask + 2)


@numba.njit(**_JIT)
def period_falls(
    spacing, thickness, height, density, mu, gravity, rtol, lanes, ring, state, u, out
):
    """The P falls of one period of an endless row, each with the stack of all that fell before.

    u > 0: ride a wave that enters with u; out (P, 3) gets time, release and impact velocity.
    u = 0: compose their maps.  Returns (outcome, leader, largest tail left beyond the ring).
    """
    period, mask = len(thickness), len(ring) - 1
    begin(state, 1.0)
    state[U] = u
    state[COMPOSING] = 1.0 if u == 0.0 else 0.0
    for j in range(period):
        state[KAPPA] = max(state[KAPPA], heaviest_force(height[j], thickness[j]))
    base = period * (1 + 2 * (mask + 1) // period)
    tail = 0.0
    untaped = np.empty((0, TAPE_COLUMNS))
    for j in range(period):
        n = base + j
        endless(ring, mask, n, spacing, thickness, height, density, state)
        state[DEPTH] = 0.0
        released = state[U]
        outcome = step(lanes, ring, mask, n, True, mu, gravity, rtol, state, True, untaped)
        if outcome != PROPAGATED:
            return outcome, j, tail
        tail = max(tail, state[CUT])
        if u > 0.0:
            out[j, 0] = state[FALL_TIME]
            out[j, 1] = math.sqrt(released)
            out[j, 2] = math.sqrt(state[U_IMPACT])
    return PROPAGATED, period, tail


# --- Motion, for those who watch ------------------------------------------------------------------
FLOOR = 1.55  # [rad] where the last leader is left, all but flat


@numba.njit(**_JIT)
def watch_chain(spacing, thickness, height, density, mu, gravity, push, rtol, ring, pieces, seen):
    """A chain looked at in `pieces` equal steps of angle a fall; returns how many falls were seen.

    seen: (N, pieces + 1, 3) leader's angle, time since it was hit, and its angular velocity.  A
    leader that strikes nothing falls on to FLOOR; one that stalls is left where it stops.
    """
    count, mask = len(thickness), len(ring) - 1
    lanes, state = np.zeros(LANE_ROWS * PITCH), np.zeros(STATE_SIZE)
    untaped = np.empty((0, TAPE_COLUMNS))
    begin(state, push)
    stand(ring, mask, 0, height[0], thickness[0], density[0])
    state[KAPPA] = heaviest_force(height[0], thickness[0])
    for n in range(count):
        strikes = n + 1 < count and spacing[n] < height[n]
        if n + 1 < count:
            d = thickness[n + 1]
            stand(ring, mask, n + 1, height[n + 1], d, density[n + 1])
            join(ring, mask, n, height[n], spacing[n], d)
            state[KAPPA] = max(state[KAPPA], heaviest_force(height[n + 1], d))
        if n > 0:
            ring[n & mask, TAIL] = ring[n & mask, INERTIA] + ring[(n - 1) & mask, TAIL]
        state[NOISE] = 8.0 * EPS * gravity * state[KAPPA]
        state[FALL_TIME] = 0.0
        state[MARGIN] = state[U]
        released = state[U]
        b = fall_angle(ring, mask, n, True) if strikes else FLOOR
        seen[n, 0] = (0.0, 0.0, math.sqrt(state[U]))
        outcome = PROPAGATED
        for j in range(1, pieces + 1):
            a = b * (j - 1) / pieces
            outcome = fall(
                lanes, ring, mask, n, a, b * j / pieces, mu, gravity, rtol, state, True, untaped
            )
            if outcome != PROPAGATED:  # it comes to rest as a stone does at the top of its flight
                rest = 2.0 * max(state[ANGLE] - a, 0.0) / max(seen[n, j - 1, 2], TINY)
                for i in range(j, pieces + 1):
                    seen[n, i] = (max(state[ANGLE], a), seen[n, j - 1, 1] + rest, 0.0)
                return n + 1
            seen[n, j] = (b * j / pieces, state[FALL_TIME], math.sqrt(state[U]))
        if not strikes:
            return n + 1
        if close_fall(ring, mask, n, b, released, True, mu, state, outcome) != PROPAGATED:
            return n + 1
    return count


# --- Forces, for those who ask --------------------------------------------------------------------
# What a diagnosis holds of each domino i: the least contact force on the next [N/m of width], the
# least impulse at a hit and at a flush [N s/m], the largest friction coefficient the floor needs to
# keep it from sliding, the least load on its pivot over its weight, the largest part of speed lost
# in a flush while it led, and the stall margin of its fall.
D_FORCE, D_HIT, D_FLUSH, D_FLOOR, D_LOAD, D_LOSS, D_MARGIN = range(7)
D_COLUMNS = 7
DEEPEST = 400  # dominoes behind the leader whose forces are followed
PIECES = 16  # looks at the stack in each fall


@numba.njit(**_JIT)
def stack_geometry(ring, mask, n, low, angle, mu, height, geo, flushing):
    """Rows of geo for dominoes low … n: sin, cos, J before, J after, D, w, arms A and B [m].

    flushing: links whose faces are flush have tip contact before and corner contact after.
    """
    half = 0.5 * angle
    s, c = math.sin(half), math.cos(half)
    v = 2.0 * s * s
    s = 2.0 * s * c
    before, after, drv, w = 1.0, 1.0, 0.0, 1.0
    geo[n, :] = (s, 1.0 - v, 1.0, 1.0, 0.0, 1.0, 0.0, 0.0)
    for i in range(n - 1, low - 1, -1):
        row = i & mask
        s_i, v_i, omega, psi, ratio = link(ring, row, s, v, mu)
        old = omega
        if flushing and ring[row, STATE] == CORNER:
            over = ring[row, P_L] * (v - ring[row, V_FLUSH])
            if abs(over) <= 2.0 * TOGETHER:
                old, omega = 1.0 - ring[row, P_L] * s, 0.0
        drv = omega * drv + psi * after * after
        before, after, w = old * before, omega * after, w * ratio
        if ring[row, STATE] == TIP:
            sd = ring[row, S_L] - ring[row, P_L] * v
            cd = math.sqrt(max((1.0 + sd) * (ring[row, REST] + ring[row, P_L] * v), TINY))
            arm = height[i] * (cd + mu * sd)
        else:
            r2 = ring[row, S_L] ** 2 + 2.0 * ring[row, P_L] * ring[row, D_L] * v
            arm = height[i] * math.sqrt(r2)
        s, v = s_i, v_i
        geo[i, :] = (s, 1.0 - v, before, after, drv, w, arm, arm * ratio)


@numba.njit(**_JIT)
def contact_impulses(ring, mask, n, low, geo, gain_before, gain_after, found, column):
    """Least impulse of each contact when the leader goes from one speed to another."""
    passed = 0.0
    for i in range(low, n):
        turn = ring[i & mask, INERTIA] * (geo[i, 3] * gain_after - geo[i, 2] * gain_before)
        arm_back = geo[i - 1, 7] if i > low else 0.0
        passed = (arm_back * passed - turn) / geo[i, 6]
        found[i, column] = min(found[i, column], passed)


@numba.njit(**_JIT)
def contact_forces(ring, mask, n, low, geo, u, gravity, mu, height, thickness, found):
    """Least contact forces and loads on the pivots, at one instant."""
    m, g, d = 0.0, 0.0, 0.0
    for i in range(low, n + 1):
        row = i & mask
        weight = gravity * ring[row, HALF_WEIGHT] * (geo[i, 0] - ring[row, SLENDER] * geo[i, 1])
        m += geo[i, 5] * ring[row, INERTIA] * geo[i, 3]
        g += geo[i, 5] * weight
        d += geo[i, 5] * ring[row, INERTIA] * geo[i, 4]
    lead = (g - u * d) / m
    force, push_x, push_z = 0.0, 0.0, 0.0
    for i in range(low, n + 1):
        row = i & mask
        s, c = geo[i, 0], geo[i, 1]
        weight = gravity * ring[row, HALF_WEIGHT] * (s - ring[row, SLENDER] * c)
        alpha = geo[i, 3] * lead + geo[i, 4] * u
        omega2 = geo[i, 3] * geo[i, 3] * u
        arm_back = geo[i - 1, 7] if i > low else 0.0
        back_x, back_z = push_x, push_z
        push_x, push_z = 0.0, 0.0
        if i < n:
            force = (weight - ring[row, INERTIA] * alpha + arm_back * force) / geo[i, 6]
            found[i, D_FORCE] = min(found[i, D_FORCE], force)
            # normal and friction on i+1, along the face that is slid upon
            j = i + 1 if ring[row, STATE] == TIP else i
            push_x = force * (geo[j, 1] - mu * geo[j, 0])
            push_z = force * (-geo[j, 0] - mu * geo[j, 1])
        mass = 2.0 * ring[row, HALF_WEIGHT] / height[i]
        x = 0.5 * (height[i] * s - thickness[i] * c)
        z = 0.5 * (height[i] * c + thickness[i] * s)
        floor_x = mass * (alpha * z - omega2 * x) - back_x + push_x
        floor_z = mass * (gravity - alpha * x - omega2 * z) - back_z + push_z
        load = floor_z / (mass * gravity)
        found[i, D_LOAD] = min(found[i, D_LOAD], load)
        need = abs(floor_x) / floor_z if floor_z > 0.0 else np.inf
        found[i, D_FLOOR] = max(found[i, D_FLOOR], need)


@numba.njit(**_JIT)
def diagnose_chain(spacing, thickness, height, density, mu, gravity, push, rtol, ring, found):
    """A chain with its forces looked at; returns (outcome, leader).  found: (N, D_COLUMNS)."""
    count, mask = len(thickness), len(ring) - 1
    lanes, state = np.zeros(LANE_ROWS * PITCH), np.zeros(STATE_SIZE)
    geo, untaped = np.zeros((count, 8)), np.empty((0, TAPE_COLUMNS))
    begin(state, push)
    stand(ring, mask, 0, height[0], thickness[0], density[0])
    state[KAPPA] = heaviest_force(height[0], thickness[0])
    for n in range(count):
        strikes = n + 1 < count and spacing[n] < height[n]
        if n + 1 < count:
            d = thickness[n + 1]
            stand(ring, mask, n + 1, height[n + 1], d, density[n + 1])
            join(ring, mask, n, height[n], spacing[n], d)
            state[KAPPA] = max(state[KAPPA], heaviest_force(height[n + 1], d))
        if n > 0:
            ring[n & mask, TAIL] = ring[n & mask, INERTIA] + ring[(n - 1) & mask, TAIL]
        state[NOISE] = 8.0 * EPS * gravity * state[KAPPA]
        state[FALL_TIME], state[FLUSH_LOSS] = 0.0, 0.0
        state[MARGIN] = state[U]
        released = state[U]
        b = fall_angle(ring, mask, n, strikes)
        outcome = PROPAGATED
        for piece in range(PIECES + 1):
            at = b * piece / PIECES
            if piece > 0:
                flushes, keep = state[FLUSHES], state[FLUSH_LOSS]
                came_from = b * (piece - 1) / PIECES
                outcome = fall(
                    lanes, ring, mask, n, came_from, at, mu, gravity, rtol, state, True, untaped
                )
                if outcome != PROPAGATED:
                    break
                if state[FLUSHES] > flushes:
                    low = max(int(state[BACK]), n - DEEPEST)
                    stack_geometry(ring, mask, n, low, state[SWITCHED], mu, height, geo, True)
                    contact_impulses(
                        ring, mask, n, low, geo, state[W_BEFORE], state[W_AFTER], found, D_FLUSH
                    )
                state[FLUSH_LOSS] = max(keep, state[FLUSH_LOSS])
            low = max(int(state[BACK]), n - DEEPEST)
            stack_geometry(ring, mask, n, low, at, mu, height, geo, False)
            contact_forces(ring, mask, n, low, geo, state[U], gravity, mu, height, thickness, found)
        found[n, D_LOSS] = state[FLUSH_LOSS]
        came = math.sqrt(state[U])
        outcome = close_fall(ring, mask, n, b, released, strikes, mu, state, outcome)
        found[n, D_MARGIN] = state[MARGIN]
        if outcome != PROPAGATED:
            return outcome, n
        if not strikes:
            return (PROPAGATED if n + 1 == count else OUT_OF_REACH), n
        went = math.sqrt(state[U])
        low = max(int(state[BACK]), n + 1 - DEEPEST)
        stack_geometry(ring, mask, n + 1, low, 0.0, mu, height, geo, False)
        contact_impulses(ring, mask, n + 1, low, geo, came, went, found, D_HIT)
    return PROPAGATED, count - 1


# --- The environment: one domino a step, all rows of a batch in one call --------------------------
# What a row remembers between two steps, besides its ring and its state: dominoes placed after the
# first, last pivot [m], sum of the rewards paid (what was given at reset counts as paid), phase,
# and once it is over: why, how far it came, its score, and whether `solve` has to be asked again.
B_PLACED, B_WAY, B_PAID, B_PHASE, B_OUTCOME, B_REACH, B_SCORE, B_DOUBT = range(8)
BOOK_SIZE = 8
IDLE, RUNS, OVER = 0.0, 1.0, 2.0

# The rules that all rows share: physics, the speed to lead against and the score to beat [m/s],
# course length (0: free), bounds [m] (in heights, where G_IN_HEIGHTS), largest change of a gap,
# bounds of growth, the height that rewards and observations are scaled by [m], whether single steps
# are paid, whether the score is a speed that is known at once, and how many dominoes are seen.
(
    G_FRICTION, G_GRAVITY, G_PUSH, G_RTOL, G_REFERENCE, G_UNIFORM, G_LENGTH,
    G_GAP_LOW, G_GAP_HIGH, G_THICK_LOW, G_THICK_HIGH, G_CHANGE, G_GROWS, G_GROW_LOW, G_GROW_HIGH,
    G_IN_HEIGHTS, G_UNIT, G_PAYS, G_SPEED, G_WINDOW, G_BOX,
) = range(21)  # fmt: skip
RULES_SIZE = 21

FRONT_LIMIT, LEAD_LIMIT, SPEED_LIMIT = 50.0, 100.0, 20.0  # observations are cut off there
LEAD_UNIT = 10.0  # heights of lead that an observation of 1 stands for


@numba.njit(**_INLINE)
def between(action, low, high):
    """The value that an action in [-1, 1] stands for; beyond them, the nearer bound."""
    value = low + 0.5 * (min(max(action, -1.0), 1.0) + 1.0) * (high - low)
    return min(max(value, low), high)


@numba.njit(**_INLINE)
def reachable(low, high, least, most):
    """[low, high] narrowed to [least, most]; a single value where rounding leaves none."""
    new_low, new_high = max(low, least), min(high, most)
    if new_low > new_high:
        middle = min(max(0.5 * (least + most), low), high)
        return middle, middle
    return new_low, new_high


@numba.njit(**_INLINE)
def pitch_bounds(rules, pairs_left, way):
    """Least and largest pitch of this pair from which the course length can still be met."""
    low = rules[G_GAP_LOW] + rules[G_THICK_LOW]
    high = rules[G_GAP_HIGH] + rules[G_THICK_HIGH]
    if rules[G_LENGTH] <= 0.0:
        return low, high
    left, after = rules[G_LENGTH] - way, pairs_left - 1
    return left - after * high, left - after * low


@numba.njit(**_INLINE)
def thickness_bounds(rules, pairs_left, way):
    """Bounds of the next domino's thickness: some gap must still fit its pitch."""
    low, high = rules[G_THICK_LOW], rules[G_THICK_HIGH]
    if rules[G_LENGTH] <= 0.0:
        return low, high
    least, most = pitch_bounds(rules, pairs_left, way)
    return reachable(low, high, least - rules[G_GAP_HIGH], most - rules[G_GAP_LOW])


@numba.njit(**_INLINE)
def gap_bounds(rules, pairs_left, way, thickness):
    """Bounds of the next gap, once the thickness of the domino behind it is chosen."""
    low, high = rules[G_GAP_LOW], rules[G_GAP_HIGH]
    if rules[G_LENGTH] <= 0.0:
        return low, high
    least, most = pitch_bounds(rules, pairs_left, way)
    return reachable(low, high, least - thickness, most - thickness)


@numba.njit(**_JIT)
def nearest_left(kinds, left, thickness):
    """Which of the kinds that are still in the box comes nearest."""
    best, away = 0, np.inf
    for k in range(len(kinds)):
        if left[k] > 0.0 and abs(kinds[k] - thickness) < away:
            best, away = k, abs(kinds[k] - thickness)
    return best


@numba.njit(**_JIT)
def nearest_within(values, low, high, gap):
    """The value of a list nearest to a gap among those in [low, high]."""
    best, away = gap, np.inf
    for value in values:
        if low - 1e-12 <= value <= high + 1e-12 and abs(value - gap) < away:
            best, away = value, abs(value - gap)
    return best


@numba.njit(**_INLINE)
def choose(action, rules, gaps, kinds, left, n, way, spacing, thickness, height):
    """Lay down what an action stands for: gap n, and thickness (and height) of domino n+1.

    gaps, kinds: the only values allowed, or none; left: how many there are of each kind.
    """
    pairs_left, column = len(spacing) - n, len(action) - 1
    behind = height[n]
    if rules[G_GROWS] > 0.0:
        growth = rules[G_GROW_LOW]
        if rules[G_GROW_LOW] < rules[G_GROW_HIGH]:
            growth = between(action[column], rules[G_GROW_LOW], rules[G_GROW_HIGH])
            column -= 1
        height[n + 1] = behind * growth
    ahead = height[n + 1]
    thick = rules[G_THICK_LOW]
    if rules[G_THICK_LOW] < rules[G_THICK_HIGH]:
        low, high = thickness_bounds(rules, pairs_left, way)
        thick = between(action[column], low, high)
        if len(kinds) > 0:
            k = nearest_left(kinds, left, thick)
            left[k] -= 1.0
            thick = kinds[k]
    gap = rules[G_GAP_LOW]
    if rules[G_GAP_LOW] < rules[G_GAP_HIGH]:
        low, high = gap_bounds(rules, pairs_left, way, thick)
        if rules[G_CHANGE] > 0.0 and n > 0:
            before = spacing[n - 1]
            low, high = max(low, before - rules[G_CHANGE]), min(high, before + rules[G_CHANGE])
        gap = between(action[0], low, high)
        if len(gaps) > 0:
            gap = nearest_within(gaps, low, high, gap)
    if rules[G_IN_HEIGHTS] > 0.0:
        thick *= ahead
        gap *= min(behind, ahead)
    spacing[n], thickness[n + 1] = gap, thick


@numba.njit(**_JIT)
def choose_all(actions, rules, gaps, kinds, left, spacing, thickness, height):
    """Lay down a whole row; actions (N-1, A)."""
    way = 0.0
    for n in range(len(spacing)):
        choose(actions[n], rules, gaps, kinds, left, n, way, spacing, thickness, height)
        way += spacing[n] + thickness[n + 1]


@numba.njit(**_JIT)
def open_row(rules, ring, state, book, thickness, height, density):
    """The first domino stands and has been pushed."""
    begin(state, rules[G_PUSH])
    stand(ring, len(ring) - 1, 0, height[0], thickness[0], density[0])
    state[KAPPA] = heaviest_force(height[0], thickness[0])
    book[:] = 0.0
    book[B_PHASE] = RUNS


@numba.njit(**_INLINE)
def next_fall(rules, lanes, ring, state, n, spacing, thickness, height, density):
    """Domino n+1 is placed and leader n falls, as in `chain`."""
    mask, count = len(ring) - 1, len(thickness)
    strikes = n + 1 < count and spacing[n] < height[n]
    lay(ring, mask, n, spacing, thickness, height, density, state)
    outcome = step(
        lanes, ring, mask, n, strikes, rules[G_FRICTION], rules[G_GRAVITY], rules[G_RTOL], state,
        False, ring[:0],
    )  # fmt: skip
    if outcome == PROPAGATED and not strikes and n + 1 < count:
        return OUT_OF_REACH
    return outcome


@numba.njit(**_JIT)
def close_row(rules, state, book, n, outcome, spacing, thickness, height, density):
    """The wave has run through or died under leader n: what the row is worth."""
    count = len(thickness)
    book[B_PHASE], book[B_OUTCOME] = OVER, outcome
    book[B_DOUBT] = 1.0 - rules[G_SPEED]
    if outcome == PROPAGATED:
        book[B_REACH] = 1.0
        book[B_SCORE] = book[B_WAY] / state[TIME]
        if state[WORST] > rules[G_RTOL] or is_uniform(spacing, thickness, height, density):
            book[B_DOUBT] = 1.0
    else:
        book[B_REACH] = (n + state[PART]) / count
        book[B_SCORE] = book[B_REACH] - 1.0
        if n >= count - 2 and state[WORST] > rules[G_RTOL]:
            book[B_DOUBT] = 1.0


@numba.njit(**_INLINE)
def worth(score, uniform):
    """The return of an episode: the gain over the best uniform row, in per cent."""
    if uniform > 0.0:
        return 100.0 * (score / uniform - 1.0)
    return 100.0 * (score - uniform) / max(-uniform, 1e-9)


@numba.njit(**_INLINE)
def place_next(rules, lanes, ring, state, book, spacing, thickness, height, density):
    """Let the leader fall on the domino just laid down in spacing and thickness; returns the
    lead gained over a wave at the reference speed, in heights."""
    n = int(book[B_PLACED])
    count = len(thickness)
    pitch = spacing[n] + thickness[n + 1]
    book[B_PLACED] = n + 1.0
    book[B_WAY] += pitch
    outcome = next_fall(rules, lanes, ring, state, n, spacing, thickness, height, density)
    lead = (pitch - rules[G_REFERENCE] * state[FALL_TIME]) / rules[G_UNIT]
    if outcome == PROPAGATED and n + 2 == count:  # the last domino falls free
        n += 1
        outcome = next_fall(rules, lanes, ring, state, n, spacing, thickness, height, density)
        if outcome == PROPAGATED:
            close_row(rules, state, book, n, outcome, spacing, thickness, height, density)
    if outcome != PROPAGATED:
        close_row(rules, state, book, n, outcome, spacing, thickness, height, density)
    return lead


@numba.njit(**_INLINE)
def observe(rules, progress, kinds, box, left, state, book, spacing, thickness, height, seen):
    """Write what is seen of a row; the order of the entries is that of the environment's page."""
    placed, way, unit = int(book[B_PLACED]), book[B_WAY], rules[G_UNIT]
    dead = book[B_PHASE] == OVER and book[B_OUTCOME] != PROPAGATED
    front = 0.0 if dead else math.sqrt(state[U] * unit / rules[G_GRAVITY])
    lead = (way - rules[G_REFERENCE] * state[TIME]) / (unit * LEAD_UNIT)
    speed = way / (state[TIME] * rules[G_REFERENCE]) - 1.0 if state[TIME] > 0.0 else 0.0
    seen[0] = min(front, FRONT_LIMIT)
    seen[1] = min(max(lead, -LEAD_LIMIT), LEAD_LIMIT)
    seen[2] = min(max(speed, -1.0), SPEED_LIMIT)
    at = 3
    if rules[G_LENGTH] > 0.0:
        rest = max(rules[G_LENGTH] - way, 0.0)
        pairs = len(spacing) - placed
        least = rules[G_GAP_LOW] + rules[G_THICK_LOW]
        most = rules[G_GAP_HIGH] + rules[G_THICK_HIGH]
        mean = 2.0 * (rest / pairs - least) / (most - least) - 1.0 if pairs > 0 else 0.0
        seen[at] = min(rest / rules[G_LENGTH], 1.0)
        seen[at + 1] = min(max(mean, -1.0), 1.0)
        at += 2
    window = int(rules[G_WINDOW])
    there, scaled = min(window, placed), rules[G_IN_HEIGHTS] > 0.0
    if rules[G_GAP_LOW] < rules[G_GAP_HIGH]:
        low, scale = rules[G_GAP_LOW], 2.0 / (rules[G_GAP_HIGH] - rules[G_GAP_LOW])
        for j in range(there):
            i = placed - 1 - j
            x = spacing[i] / min(height[i], height[i + 1]) if scaled else spacing[i]
            seen[at + j] = min(max(scale * (x - low) - 1.0, -1.0), 1.0)
        for j in range(there, window):
            seen[at + j] = 0.0
        at += window
    if rules[G_THICK_LOW] < rules[G_THICK_HIGH]:
        low, scale = rules[G_THICK_LOW], 2.0 / (rules[G_THICK_HIGH] - rules[G_THICK_LOW])
        for j in range(there):
            i = placed - j
            x = thickness[i] / height[i] if scaled else thickness[i]
            seen[at + j] = min(max(scale * (x - low) - 1.0, -1.0), 1.0)
        for j in range(there, window):
            seen[at + j] = 0.0
        at += window
    if rules[G_GROW_LOW] < rules[G_GROW_HIGH]:
        low, scale = rules[G_GROW_LOW], 2.0 / (rules[G_GROW_HIGH] - rules[G_GROW_LOW])
        for j in range(there):
            i = placed - j
            seen[at + j] = min(max(scale * (height[i] / height[i - 1] - low) - 1.0, -1.0), 1.0)
        for j in range(there, window):
            seen[at + j] = 0.0
        at += window
        most = math.log(rules[G_GROW_HIGH]) * len(spacing)
        seen[at] = min(math.log(height[placed] / height[0]) / most, 1.0)
        at += 1
    if rules[G_BOX] > 0.0:
        for k in range(len(kinds)):
            seen[at + k] = left[k] / max(box[k], 1.0)
        at += len(kinds)
    for j in range(progress.shape[1]):
        seen[at + j] = progress[placed, j]


@numba.njit(**_JIT)
def reset_rows(
    first, last, rules, progress, gaps, kinds, box, lefts, rings, states, books, spacing, thickness,
    height, density, chosen, given, seen,
):  # fmt: skip
    """Begin anew in the rows that are chosen, with the first `given` gaps as they are laid down.

    A row whose wave does not get past what is given is OVER afterwards.
    """
    lanes = np.zeros(LANE_ROWS * PITCH)
    for b in range(first, last):
        if not chosen[b]:
            continue
        h, rho = height[b if len(height) > 1 else 0], density[b if len(density) > 1 else 0]
        open_row(rules, rings[b], states[b], books[b], thickness[b], h, rho)
        lefts[b, :] = box
        for i in range(given[b]):
            if len(kinds) > 0:
                lefts[b, nearest_left(kinds, lefts[b], thickness[b, i + 1])] -= 1.0
            lead = place_next(
                rules, lanes, rings[b], states[b], books[b], spacing[b], thickness[b], h, rho
            )
            books[b, B_PAID] += lead * rules[G_PAYS]
            if books[b, B_PHASE] == OVER:
                break
        observe(
            rules, progress, kinds, box, lefts[b], states[b], books[b], spacing[b], thickness[b], h,
            seen[b],
        )  # fmt: skip


@numba.njit(**_JIT)
def step_rows(
    first, last, rules, progress, gaps, kinds, box, lefts, rings, states, books, spacing, thickness,
    height, density, actions, seen, rewards, ended,
):  # fmt: skip
    """One step of those rows first … last - 1 that run; returns how many episodes have ended.

    lefts: (B, K) what is left in each row's box; height: (1, N), or (B, N) where rows grow.
    actions: (B, A); seen: (B, O) observations; rewards: (B,); ended: (B,) booleans.  Of rows that
    are over, only rewards (0) and ended (False) are written.
    """
    owned = np.zeros(LANE_ROWS * PITCH)
    lanes, rules, progress = borrowed(owned), borrowed(rules), borrowed(progress)
    gaps, kinds, box, lefts = borrowed(gaps), borrowed(kinds), borrowed(box), borrowed(lefts)
    rings, states, books = borrowed(rings), borrowed(states), borrowed(books)
    spacing, thickness = borrowed(spacing), borrowed(thickness)
    height, density = borrowed(height), borrowed(density)
    actions, seen = borrowed(actions), borrowed(seen)
    number = 0
    for b in range(first, last):
        state, book, left, s, d = states[b], books[b], lefts[b], spacing[b], thickness[b]
        rewards[b], ended[b] = 0.0, False
        if book[B_PHASE] != RUNS:
            continue
        h, rho = height[b if len(height) > 1 else 0], density[b if len(density) > 1 else 0]
        choose(actions[b], rules, gaps, kinds, left, int(book[B_PLACED]), book[B_WAY], s, d, h)
        lead = place_next(rules, lanes, rings[b], state, book, s, d, h, rho)
        if book[B_PHASE] == OVER:
            rewards[b] = worth(book[B_SCORE], rules[G_UNIFORM]) - book[B_PAID]
            ended[b] = True
            number += 1
        else:
            rewards[b] = lead * rules[G_PAYS]
            book[B_PAID] += rewards[b]
        observe(rules, progress, kinds, box, left, state, book, s, d, h, seen[b])
    owned[0] = number  # keeps the lanes alive to here
    return number
