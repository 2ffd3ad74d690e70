"""Equations of motion in time for ODE solvers, and fixed steps, compiled: arithmetic only.

Fixed steps: explicit Euler and classic Runge-Kutta (RK4) as Chapman's program takes them, a hit
falling on the first step past it; and RK4 with hits located, which keeps its order four. The same
equations serve the adaptive solvers of SciPy (`ode.py`).

The right-hand side, for n the leader (symbols as in `domino_env.kernels`):

    α_n = (Σ w G - ω_n² Σ w I D) / Σ w I J          sums over the dominoes in contact, 0 … n

Nothing is shared with the kernels: contact geometry is in metres and plain sines and cosines, the
whole stack is summed, and switches are watched in time.

Source: Chapman, "The physics of toppling dominoes", eqs. 1-9; van Leeuwen 2004.
"""

import math

import numpy as np

from domino_env.kernels.jit import compile_alone

PROPAGATED, STALLED, OUT_OF_REACH, JAMMED, NO_RIGID_ANSWER = 0, 1, 2, 3, 4  # as in `wave.Outcome`
UNFINISHED = -1  # the evaluations allowed were used up

TIP, CORNER = 0.0, 1.0
TOGETHER = 1e-9  # [rad] links flush within this Δ switch in one impact
EULER, RK4, LOCATED = 0, 1, 2

# Columns of a row's table: one line a domino and its link to the next.  PITCH and RISE lead from
# pivot to pivot, TILT is the lean at rest, with sine and cosine of that of the next.  DUE is the
# cosine of the lean of i+1 from its rest at which the link next switches, FREE the one at which it
# is released.
HEIGHT, THICK_NEXT, PITCH, INERTIA, WEIGHT, THICKNESS, STATE, DUE, FREE = range(9)
RISE, TILT, TILT_NEXT, SIN_NEXT, COS_NEXT = range(9, 14)
COLUMNS = 14
NEVER = -2.0  # no cosine


@compile_alone
def table(spacing, thickness, height, density, rise, tilt):
    """Return (N, COLUMNS) what the equations need of a row, per unit of width; all tips."""
    rows = np.zeros((len(thickness), COLUMNS))
    for i in range(len(thickness)):
        length, d = height[i], thickness[i]
        mass = density[i] * length * d
        rows[i, HEIGHT], rows[i, THICKNESS] = length, d
        rows[i, INERTIA] = mass * (length * length + d * d) / 3.0
        rows[i, WEIGHT] = 0.5 * mass  # times gravity where it is used
        rows[i, TILT] = tilt[i]
        if i + 1 < len(thickness):
            d = thickness[i + 1]
            p = spacing[i] + d
            s, c, e = math.sin(tilt[i + 1]), math.cos(tilt[i + 1]), rise[i]
            p = (p + e * s) / c
            rows[i, PITCH], rows[i, RISE], rows[i, THICK_NEXT] = p, e, d
            rows[i, TILT_NEXT], rows[i, SIN_NEXT], rows[i, COS_NEXT] = tilt[i + 1], s, c
            flush = cosine_at(d, p, e, tilt[i + 1])
            free = cosine_at(
                (p * p + e * e + d * d - length * length) / (2.0 * d), p, e, tilt[i + 1]
            )
            rows[i, FREE], rows[i, DUE] = free, max(flush, free)
    return rows


@compile_alone
def cosine_at(level, p, e, tilt):
    """Cosine of the lean from its rest at which p cos θ - e sin θ has fallen to a level."""
    if e == 0.0 and tilt == 0.0:
        return level / p
    far = math.sqrt(p * p + e * e)
    if level <= -far:
        return NEVER
    return math.cos(math.acos(min(level / far, 1.0)) - math.atan2(e, p) - tilt)


# --- One link, the whole stack --------------------------------------------------------------------
@compile_alone
def link(row, state, s, c, mu):
    """One link at sin θ, cos θ of the domino ahead: sin and cos of the one behind, Ω, Ψ, B/A."""
    length, d, p, e = row[HEIGHT], row[THICK_NEXT], row[PITCH], row[RISE]
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
def upright(row, s, c):
    """Cosine of the lean of the domino ahead from its rest."""
    return c * row[COS_NEXT] + s * row[SIN_NEXT]


@compile_alone
def stack(rows, n, back, angle, mu):
    """Sum over the stack that n leads.

    Returns Σ w I J, Σ w (G/g), Σ w I D, and the least cos θ_{i+1} minus the one at which link i
    switches.
    """
    s, c = math.sin(angle), math.cos(angle)
    lead = rows[n]
    w, jac, drv, margin = 1.0, 1.0, 0.0, np.inf
    sum_m = lead[INERTIA]
    sum_g = lead[WEIGHT] * (lead[HEIGHT] * s - lead[THICKNESS] * c)
    sum_d = 0.0
    for i in range(n - 1, back - 1, -1):
        row = rows[i]
        margin = min(margin, upright(row, s, c) - row[DUE])
        s, c, omega, psi, ratio = link(row, row[STATE], s, c, mu)
        drv = omega * drv + psi * jac * jac
        jac *= omega
        w *= ratio
        sum_m += w * row[INERTIA] * jac
        sum_g += w * row[WEIGHT] * (row[HEIGHT] * s - row[THICKNESS] * c)
        sum_d += w * row[INERTIA] * drv
    return sum_m, sum_g, sum_d, margin


@compile_alone
def from_sums(sums, speed2, gravity):
    """α_n from the sums of a stack and the leader's ω²; nan where M is not positive."""
    if not sums[0] > 0.0:
        return np.nan
    return (gravity * sums[1] - speed2 * sums[2]) / sums[0]


@compile_alone
def acceleration(rows, n, back, angle, speed2, mu, gravity):
    """α_n at one angle and ω² of the leader."""
    return from_sums(stack(rows, n, back, angle, mu), speed2, gravity)


# --- Hits and switches ----------------------------------------------------------------------------
@compile_alone
def hit(rows, n, sum_m, mu):
    """ω⁺/ω⁻ where leader n, upon a stack of Σ w I J, strikes n+1, with friction.

    0 where friction passes no push on.

    References
    ----------
    Chapman, The physics of toppling dominoes, eqs. 8-9.
    """
    _, _, omega, _, ratio = link(rows[n], TIP, rows[n, SIN_NEXT], rows[n, COS_NEXT], mu)
    m = ratio * sum_m
    return m / (m * omega + rows[n + 1, INERTIA]) if m > 0.0 else 0.0


@compile_alone
def switch(rows, n, back, angle, mu, slack):
    """Switch every link that is due at the leader's angle, those flush together in one impact.

    Parameters
    ----------
    rows, n, back, angle, mu
        As of `stack`.
    slack
        By how much a flush may still be ahead [rad of Δ].

    Returns
    -------
    float
        ω⁺/ω⁻.
    int
        The last domino still in contact.
    """
    s, c = math.sin(angle), math.cos(angle)  # with the old states; below with the new ones
    s_new, c_new = s, c
    jac, jac_new, w = 1.0, 1.0, 1.0
    before = after = rows[n, INERTIA]
    i = n
    while i > back:
        i -= 1
        row = rows[i]
        over = row[DUE] - upright(row, s, c)
        flushes = row[STATE] == TIP and row[DUE] > row[FREE]
        if not flushes and over >= -1e-14:
            back = i + 1
            break
        s, c, omega, _, _ = link(row, row[STATE], s, c, mu)
        if flushes and over * row[PITCH] / row[HEIGHT] >= -slack:
            row[STATE], row[DUE] = CORNER, row[FREE]
        s_new, c_new, omega_new, _, ratio = link(row, row[STATE], s_new, c_new, mu)
        w *= ratio
        jac *= omega
        jac_new *= omega_new
        before += w * row[INERTIA] * jac
        after += w * row[INERTIA] * jac_new
    return before / after, back


@compile_alone
def lead_by(rows, n, i, angle):
    """Lean of leader n at which domino i leans by `angle`, from contact to contact, closed form."""
    for k in range(i, n):
        row = rows[k]
        p, d, e = row[PITCH], row[THICK_NEXT], row[RISE]
        if row[STATE] == TIP:
            a, b = p - row[HEIGHT] * math.sin(angle), row[HEIGHT] * math.cos(angle) - e
            angle = math.atan2(b, a) - math.acos(min(d / math.sqrt(a * a + b * b), 1.0))
        else:
            x = p / d * math.cos(angle) - e / d * math.sin(angle)
            angle += math.acos(min(max(x, -1.0), 1.0))
    return angle


@compile_alone
def first_switch(rows, n, back, angle):
    """Find the least lean of the leader at which one of the links switches that have by `angle`."""
    s, c = math.sin(angle), math.cos(angle)
    first = angle
    for i in range(n - 1, back - 1, -1):
        row = rows[i]
        if upright(row, s, c) < row[DUE]:
            goes = row[TILT_NEXT] + math.acos(row[DUE])
            first = min(first, lead_by(rows, n, i + 1, goes))
        s, c, _, _, _ = link(row, row[STATE], s, c, 0.0)
    return first


# --- Steps ----------------------------------------------------------------------------------------
@compile_alone
def rk4_step(rows, n, back, angle, speed, a1, h, mu, gravity):
    """(angle, speed) after one classic Runge-Kutta step of h seconds; a1: α at its start."""
    v2 = speed + 0.5 * h * a1
    a2 = acceleration(rows, n, back, angle + 0.5 * h * speed, v2 * v2, mu, gravity)
    v3 = speed + 0.5 * h * a2
    a3 = acceleration(rows, n, back, angle + 0.5 * h * v2, v3 * v3, mu, gravity)
    v4 = speed + h * a3
    a4 = acceleration(rows, n, back, angle + h * v3, v4 * v4, mu, gravity)
    return (
        angle + h / 6.0 * (speed + 2.0 * v2 + 2.0 * v3 + v4),
        speed + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4),
    )


@compile_alone
def rk4_to_angle(rows, n, back, angle, speed, a1, end, sums, mu, gravity):
    """(time, speed) of one Runge-Kutta step in the angle that ends exactly at `end`.

    The stack has the given sums there. The speed comes out as nan where the leader stops, or nearly
    does, on the way.

    References
    ----------
    M. Hénon, On the numerical computation of Poincaré maps, Physica D 5 (1982) 412.
    """
    x = end - angle
    u1 = speed * speed
    u2 = u1 + x * a1
    a2 = acceleration(rows, n, back, angle + 0.5 * x, u2, mu, gravity)
    u3 = u1 + x * a2
    a3 = acceleration(rows, n, back, angle + 0.5 * x, u3, mu, gravity)
    u4 = u1 + 2.0 * x * a3
    u = u1 + x / 3.0 * (a1 + 2.0 * a2 + 2.0 * a3 + from_sums(sums, u4, gravity))
    for v in (u2, u3, u4, u):
        if not v > 0.25 * u1:
            return 0.0, np.nan
    slow = 1.0 / speed + 2.0 / math.sqrt(u2) + 2.0 / math.sqrt(u3) + 1.0 / math.sqrt(u4)
    return x / 6.0 * slow, math.sqrt(u)


@compile_alone
def rk4_until(rows, n, back, angle, speed, a1, end, h, mu, gravity):
    """(time, speed) at which the step in time reaches `end`, by bisection.

    For a leader that has nearly stopped. Where it does not get there within h, (h, speed there).
    """
    low, high = 0.0, h
    new, v = rk4_step(rows, n, back, angle, speed, a1, h, mu, gravity)
    if not new >= end:
        return h, v
    for _ in range(60):
        middle = 0.5 * (low + high)
        new, reached = rk4_step(rows, n, back, angle, speed, a1, middle, mu, gravity)
        if new < end:
            low = middle
        else:
            high, v = middle, reached
    return high, v


# --- A row ----------------------------------------------------------------------------------------
@compile_alone
def goal(rows, n):
    """Angle of leader n at which its fall ends (it hits, or it tips), and whether it hits."""
    row = rows[n]
    gap = row[PITCH] * row[COS_NEXT] - row[RISE] * row[SIN_NEXT] - row[THICK_NEXT]
    if n + 1 < len(rows) and gap < row[HEIGHT]:
        return math.asin(gap / row[HEIGHT]) + row[TILT_NEXT], True
    return math.atan(row[THICKNESS] / row[HEIGHT]), False


@compile_alone
def follow(rows, mu, gravity, push, h, rule, most, arrival):
    """Follow a chain in fixed steps of h until its wave ends; arrival times go into `arrival`.

    With the rule LOCATED steps end exactly at hits and changes of contact (order four). With the
    others what happens in a step takes place at its end, and the next leader starts from its rest:
    what the last step had gone too far is lost, as in the program of the article (order one).

    Returns
    -------
    int
        The outcome.
    int
        Evaluations of the stack's acceleration.
    """
    angle, speed, now, n, back, used = rows[0, TILT], push, 0.0, 0, 0, 0
    end, strikes = goal(rows, 0)
    sums = stack(rows, n, back, angle, mu)
    while used < most:
        a = from_sums(sums, speed * speed, gravity)
        new, v, dt = end, speed, h
        used += 1
        if rule == EULER:
            new, v = angle + h * speed, speed + h * a
        elif rule == RK4 or angle + h * (speed + 0.5 * h * a) < end:
            new, v = rk4_step(rows, n, back, angle, speed, a, h, mu, gravity)
            used += 3  # a step that is expected to end in a hit is not taken in time
        new_sums = stack(rows, n, back, min(new, end), mu)
        due = new_sums[3] <= (1e-15 if rule == LOCATED else 0.0)
        if rule == LOCATED and (due or new >= end):
            new = max(first_switch(rows, n, back, min(new, end)), angle) if due else end
            new_sums = stack(rows, n, back, new, mu)
            dt, v = rk4_to_angle(rows, n, back, angle, speed, a, new, new_sums, mu, gravity)
            used += 3
            if math.isnan(v):
                dt, v = rk4_until(rows, n, back, angle, speed, a, new, h, mu, gravity)
                used += 240
                if dt == h:  # slower than expected: an ordinary step after all
                    new, v = rk4_step(rows, n, back, angle, speed, a, h, mu, gravity)
                    new_sums = stack(rows, n, back, new, mu)
                    due = False
        if not v > 0.0:
            return (NO_RIGID_ANSWER if math.isnan(v) else STALLED), used
        angle, speed, now, sums = new, v, now + dt, new_sums
        if due:
            slack = TOGETHER if rule == LOCATED else 0.0
            keep, back = switch(rows, n, back, min(angle, end), mu, slack)
            if not 0.0 < keep < np.inf:
                return JAMMED, used
            speed *= keep
            sums = stack(rows, n, back, min(angle, end), mu)
            used += 1
        if angle < end:
            continue
        if not strikes:
            return (OUT_OF_REACH if n + 1 < len(rows) else PROPAGATED), used
        keep = hit(rows, n, sums[0], mu)
        arrival[n + 1] = now
        if not 0.0 < keep < np.inf:
            return JAMMED, used
        n += 1
        angle, speed = rows[n, TILT], speed * keep
        end, strikes = goal(rows, n)
        sums = stack(rows, n, back, angle, mu)
    return UNFINISHED, used
