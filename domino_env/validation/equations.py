"""Equations of motion in time for ODE solvers, and fixed steps, compiled: arithmetic only.

Fixed steps: explicit Euler and classic Runge-Kutta (RK4) as Chapman's program takes them, a hit
falling on the first step past it; and RK4 with located events, which keeps its order four. The same
equations serve the adaptive solvers of SciPy (`ode.py`).

The right-hand side, for the leading domino n (symbols as in `domino_env.kernels`):

    α_n = (Σ w G - ω_n² Σ w I D) / Σ w I J          sums over the dominoes in contact, back … n

Nothing is shared with the kernels: contact geometry is in metres and plain sines and cosines, the
whole stack is summed, and changes of contact are located in time.

Source: Chapman, "The physics of toppling dominoes", eqs. 1-9; van Leeuwen 2004.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from domino_env.kernels.jit import compile_alone

PROPAGATED, STALLED, OUT_OF_REACH, JAMMED, NO_RIGID_ANSWER = 0, 1, 2, 3, 4  # as in `wave.Outcome`

TIP, FACE = 0.0, 1.0  # states of a contact
TOGETHER = 1e-9  # [rad] face impacts within this Δ are one impact
ROUNDING = 1e-15  # of a cosine, in which a change of contact is due
ITERATIONS = 60  # halvings of a step, to its rounding
EULER, RK4, LOCATED = 0, 1, 2

# Columns of the table of a chain: one line per domino and its contact with the next. PITCH and RISE
# lead from pivot to pivot, TILT is the lean at rest, with sine and cosine of that of the next. DUE
# is the cosine of the lean of i+1 from its rest at which the contact next changes, FREE the one at
# which it separates.
HEIGHT, THICK_NEXT, PITCH, INERTIA, WEIGHT, THICKNESS, STATE, DUE, FREE = range(9)
RISE, TILT, TILT_NEXT, SIN_NEXT, COS_NEXT = range(9, 14)
COLUMNS = 14
NEVER = -2.0  # no cosine


class Stack(NamedTuple):
    """The table of a chain, its leading domino, the last one in contact, friction and gravity."""

    table: Any
    n: int
    back: int
    mu: float
    gravity: float


@compile_alone
def table_of(spacing, thickness, height, density, rise, tilt):
    """Return the table (N, COLUMNS) of a chain, per unit of width; all contacts at the tip."""
    table = np.zeros((len(thickness), COLUMNS))
    for i in range(len(thickness)):
        length, d = height[i], thickness[i]
        mass = density[i] * length * d
        table[i, HEIGHT], table[i, THICKNESS] = length, d
        table[i, INERTIA] = mass * (length * length + d * d) / 3.0
        table[i, WEIGHT] = 0.5 * mass  # times gravity where it is used
        table[i, TILT] = tilt[i]
        if i + 1 < len(thickness):
            d = thickness[i + 1]
            s, c, e = math.sin(tilt[i + 1]), math.cos(tilt[i + 1]), rise[i]
            p = (spacing[i] + d + e * s) / c
            table[i, PITCH], table[i, RISE], table[i, THICK_NEXT] = p, e, d
            table[i, TILT_NEXT], table[i, SIN_NEXT], table[i, COS_NEXT] = tilt[i + 1], s, c
            face = cosine_at(d, p, e, tilt[i + 1])
            level = (p * p + e * e + d * d - length * length) / (2.0 * d)
            table[i, FREE] = cosine_at(level, p, e, tilt[i + 1])
            table[i, DUE] = max(face, table[i, FREE])
    return table


@compile_alone
def cosine_at(level, p, e, tilt):
    """Cosine of the lean from its rest at which p cos θ - e sin θ has fallen to a level."""
    if e == 0.0 and tilt == 0.0:
        return level / p
    far = math.sqrt(p * p + e * e)
    if level <= -far:
        return NEVER
    return math.cos(math.acos(min(level / far, 1.0)) - math.atan2(e, p) - tilt)


# --- One contact, the whole stack -----------------------------------------------------------------
@compile_alone
def contact(domino, state, s, c, mu):
    """Sin and cos of domino i, Ω, Ψ and B/A of its contact, from sin θ and cos θ of domino i+1."""
    length, d, p, e = domino[HEIGHT], domino[THICK_NEXT], domino[PITCH], domino[RISE]
    if state == TIP:
        sin_gap = (p * c - e * s - d) / length  # eq. 1
        cos_gap = math.sqrt(max(1.0 - sin_gap * sin_gap, 1e-30))
        q = p * s + e * c
        omega = 1.0 - q / (length * cos_gap)  # eq. 2
        s_i = s * cos_gap + c * sin_gap
        c_i = c * cos_gap - s * sin_gap
        bend = p * (c_i + s * sin_gap * omega) - e * (s_i - c * sin_gap * omega)
        psi = -bend / (length * cos_gap * cos_gap)  # eq. 3, corrected
        ratio = (length * cos_gap - q - mu * d) / (length * (cos_gap + mu * sin_gap))  # eq. 7
        return s_i, c_i, omega, psi, ratio
    square = p * p - 2.0 * p * d * c + d * d + e * (e + 2.0 * d * s)
    root = math.sqrt(square)
    s_i = (p - d * c) / root
    c_i = (d * s + e) / root
    omega = d * (d - p * c + e * s) / square
    psi = (p * d * s + e * d * c) * (p * p - d * d + e * e) / (square * square)
    ratio = d * (s * c_i - c * s_i - mu * (c * c_i + s * s_i)) / root
    return s_i, c_i, omega, psi, ratio


@compile_alone
def upright(domino, s, c):
    """Cosine of the lean of domino i+1 from its rest."""
    return c * domino[COS_NEXT] + s * domino[SIN_NEXT]


@compile_alone
def sums(stack, angle):
    """Σ w I J, Σ w (G/g), Σ w I D, and the least cosine less DUE, for leader n at an angle."""
    s, c = math.sin(angle), math.cos(angle)
    leader = stack.table[stack.n]
    w, jac, drv, margin = 1.0, 1.0, 0.0, np.inf
    sum_m = leader[INERTIA]
    sum_g = leader[WEIGHT] * (leader[HEIGHT] * s - leader[THICKNESS] * c)
    sum_d = 0.0
    for i in range(stack.n - 1, stack.back - 1, -1):
        domino = stack.table[i]
        margin = min(margin, upright(domino, s, c) - domino[DUE])
        s, c, omega, psi, ratio = contact(domino, domino[STATE], s, c, stack.mu)
        drv = omega * drv + psi * jac * jac
        jac *= omega
        w *= ratio
        sum_m += w * domino[INERTIA] * jac
        sum_g += w * domino[WEIGHT] * (domino[HEIGHT] * s - domino[THICKNESS] * c)
        sum_d += w * domino[INERTIA] * drv
    return sum_m, sum_g, sum_d, margin


@compile_alone
def acceleration(stack, angle, speed):
    """α_n at an angle and ω of the leader; nan where M is not positive."""
    sum_m, sum_g, sum_d, _ = sums(stack, angle)
    if not sum_m > 0.0:
        return np.nan
    return (stack.gravity * sum_g - speed * speed * sum_d) / sum_m


# --- Hits and changes of contact ------------------------------------------------------------------
@compile_alone
def hit(stack, sum_m):
    """ω⁺/ω⁻ where leader n, with its Σ w I J, hits n+1; 0 where friction jams (eqs. 8-9)."""
    leader, struck = stack.table[stack.n], stack.table[stack.n + 1]
    _, _, omega, _, ratio = contact(leader, TIP, leader[SIN_NEXT], leader[COS_NEXT], stack.mu)
    m = ratio * sum_m
    return m / (m * omega + struck[INERTIA]) if m > 0.0 else 0.0


@compile_alone
def change(stack, angle, slack):
    """ω⁺/ω⁻ and the last domino in contact, after every change of contact that is due.

    Face impacts at most `slack` [rad of Δ] ahead take place in the same impact.
    """
    s, c = math.sin(angle), math.cos(angle)  # with the old states; below with the new ones
    s_new, c_new = s, c
    jac, jac_new, w = 1.0, 1.0, 1.0
    before = after = stack.table[stack.n, INERTIA]
    i = stack.n
    while i > stack.back:
        i -= 1
        domino = stack.table[i]
        over = domino[DUE] - upright(domino, s, c)
        to_face = domino[STATE] == TIP and domino[DUE] > domino[FREE]
        if not to_face and over >= -10.0 * ROUNDING:
            return before / after, i + 1
        s, c, omega, _, _ = contact(domino, domino[STATE], s, c, stack.mu)
        if to_face and over * domino[PITCH] / domino[HEIGHT] >= -slack:
            domino[STATE], domino[DUE] = FACE, domino[FREE]
        s_new, c_new, omega_new, _, ratio = contact(domino, domino[STATE], s_new, c_new, stack.mu)
        w *= ratio
        jac *= omega
        jac_new *= omega_new
        before += w * domino[INERTIA] * jac
        after += w * domino[INERTIA] * jac_new
    return before / after, stack.back


# --- Steps ----------------------------------------------------------------------------------------
@compile_alone
def rk4_step(stack, angle, speed, a1, h):
    """(angle, speed) after one classic Runge-Kutta step of h seconds; a1: α at its start."""
    v2 = speed + 0.5 * h * a1
    a2 = acceleration(stack, angle + 0.5 * h * speed, v2)
    v3 = speed + 0.5 * h * a2
    a3 = acceleration(stack, angle + 0.5 * h * v2, v3)
    v4 = speed + h * a3
    a4 = acceleration(stack, angle + h * v3, v4)
    return (
        angle + h / 6.0 * (speed + 2.0 * v2 + 2.0 * v3 + v4),
        speed + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4),
    )


@compile_alone
def locate(stack, angle, speed, a1, h, end, changes):
    """(time, angle, speed) of the first change of contact in a step of h, or of `end`.

    Newton's method for the angle `end`, bisection for a change of contact, after which it returns.
    """
    low, high, t = 0.0, h, h
    new, v = angle, speed
    for _ in range(ITERATIONS):
        new, v = rk4_step(stack, angle, speed, a1, t)
        # nan, where the step leads too far, is over too
        over = sums(stack, min(new, end))[3] <= ROUNDING if changes else not new < end
        low, high = (low, t) if over else (t, high)
        closer = t - (new - end) / v
        if changes or not low < closer < high:
            closer = 0.5 * (low + high)
        if abs(closer - t) <= 1e-16 * h:
            break
        t = closer
    if changes:
        t = high
        new, v = rk4_step(stack, angle, speed, a1, t)
    return t, new, v


# --- A chain --------------------------------------------------------------------------------------
@compile_alone
def goal(table, n):
    """Angle of leader n at which its interval ends (it hits, or it tips), and whether it hits."""
    leader = table[n]
    gap = leader[PITCH] * leader[COS_NEXT] - leader[RISE] * leader[SIN_NEXT] - leader[THICK_NEXT]
    if n + 1 < len(table) and gap < leader[HEIGHT]:
        return math.asin(gap / leader[HEIGHT]) + leader[TILT_NEXT], True
    return math.atan(leader[THICKNESS] / leader[HEIGHT]), False


@compile_alone
def follow(stack, push, h, rule, arrival):
    """Follow a chain in steps of h until its wave ends; return its outcome.

    Arrival times go into `arrival`. With the rule LOCATED steps end at hits and changes of contact
    (order four). With the others the events of a step take place at its end, and the next leader
    starts from its rest: the overshoot of the last step is lost, as in the program of the article
    (order one).
    """
    slack = ROUNDING if rule == LOCATED else 0.0
    angle, speed, now = stack.table[0, TILT], push, 0.0
    end, hits = goal(stack.table, 0)
    while True:
        a = acceleration(stack, angle, speed)
        dt = h
        if rule == EULER:
            new, v = angle + h * speed, speed + h * a
        else:
            new, v = rk4_step(stack, angle, speed, a, h)
        due = sums(stack, min(new, end))[3] <= slack
        if rule == LOCATED and (due or not new < end):
            dt, new, v = locate(stack, angle, speed, a, h, end, due)
            if not due:
                new = end
        if not v > 0.0:
            return NO_RIGID_ANSWER if math.isnan(v) else STALLED
        angle, speed, now = new, v, now + dt
        if due:
            keep, back = change(stack, min(angle, end), TOGETHER if rule == LOCATED else 0.0)
            if not 0.0 < keep < np.inf:
                return JAMMED
            stack = Stack(stack.table, stack.n, back, stack.mu, stack.gravity)
            speed *= keep
        if angle < end:
            continue
        if not hits:
            return OUT_OF_REACH if stack.n + 1 < len(stack.table) else PROPAGATED
        keep = hit(stack, sums(stack, min(angle, end))[0])
        arrival[stack.n + 1] = now
        if not 0.0 < keep < np.inf:
            return JAMMED
        stack = Stack(stack.table, stack.n + 1, stack.back, stack.mu, stack.gravity)
        angle, speed = stack.table[stack.n, TILT], speed * keep
        end, hits = goal(stack.table, stack.n)
