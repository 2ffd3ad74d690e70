"""Steps in time: the equation of motion for ODE solvers, explicit Euler and classic Runge-Kutta.

Contacts, hits and changes of contact are those of all kernels. The angle of the leading domino n
is integrated in time, by

    α_n = (Σ w G - ω_n² Σ w I D) / Σ w I J

over all dominoes that lean on it, back … n, and changes of contact are located in time.

Fixed steps are those of Euler's or the classic Runge-Kutta method (RK4) with every event at the end
of the step that passes it, as in Chapman's program, which is of order one; or those of RK4 with
located events, which keeps its order four. `domino_env.validation.ode` compares them.
"""

import math

import numpy as np

from domino_env.kernels import arrays, fall
from domino_env.kernels.contact import contact_at, new_ring, past_flush, sin_versine
from domino_env.kernels.jit import entry_point, internal
from domino_env.kernels.stack import switch

EULER, RK4, LOCATED = 0, 1, 2
UNFINISHED = -1  # result of `apply_events` if the wave continues
ITERATIONS = 60  # halvings of a step, down to rounding
STEP_ROUNDING = 1e-16  # of a step: a smaller correction of its length ends the search


@entry_point
def push_chain(layout, mu, gravity, push):
    """Return the ring and the state (1,) of a chain whose first domino has just been pushed."""
    count, size = len(layout.thickness), 2
    while size <= count:
        size *= 2
    ring, states = new_ring(layout, size), np.zeros(1, arrays.STATE)
    fall.configure(states[0], ring, mu, gravity, 0.0, False)
    fall.start_chain(layout, push, ring, states[0])
    for n in range(count):
        fall.add_next_domino(layout, ring, states[0], n)
    return ring, states


@internal
def sums(ring, state, n, angle):
    """Return Σ w I J, Σ w G / g, Σ w I D, the least 1 - cos θ left to a change, and the lowest due.

    The lowest due is the last contact that changes together with one that changes here; n if none.
    """
    s, v = sin_versine(angle)
    leader = ring[n]
    w, jac, drv, left, lowest_due = 1.0, 1.0, 0.0, np.inf, n
    sum_m, sum_d = leader.inertia, 0.0
    sum_g = leader.half_weight * (s - leader.slenderness * (1.0 - v))
    for i in range(n - 1, state.back - 1, -1):
        contact = ring[i]
        left = min(left, contact.v_switch - v)
        if past_flush(contact, v - contact.v_switch) >= -arrays.IMPACT_TOLERANCE:
            lowest_due = i
        s, v, omega, psi, ratio = contact_at(contact, s, v, state.mu)
        drv = omega * drv + psi * jac * jac
        jac *= omega
        w *= ratio
        sum_m += w * contact.inertia * jac
        sum_g += w * contact.half_weight * (s - contact.slenderness * (1.0 - v))
        sum_d += w * contact.inertia * drv
    return sum_m, sum_g, sum_d, left, lowest_due


@internal
def acceleration(ring, state, n, angle, speed):
    """Return α_n at an angle and ω_n; nan where M is not positive."""
    sum_m, sum_g, sum_d, _, _ = sums(ring, state, n, angle)
    if not sum_m > 0.0:
        return np.nan
    return (state.gravity * sum_g - speed * speed * sum_d) / sum_m


@entry_point
def right_side(ring, states, n, angle, speed):
    """Return α_n, and the least 1 - cos θ left to a change of contact."""
    state = states[0]
    return acceleration(ring, state, n, angle, speed), sums(ring, state, n, angle)[3]


@entry_point
def apply_events(layout, ring, states, n, angle, speed, now, arrivals):
    """Change the contacts that are due at an angle, and hit the next domino at the end of the fall.

    Returns the outcome or UNFINISHED; then leader, angle, ω and angle of the end of its fall.
    """
    state, end = states[0], fall.fall_angle(ring[n], fall.strikes_next(layout, n))
    at = min(angle, end)
    state.u = speed * speed
    state.m_end, _, _, left, state.last_due = sums(ring, state, n, at)
    if left <= 0.0:
        keep = switch(ring, state, n, state.last_due, state.back, at)
        if not keep > 0.0:
            return arrays.JAMMED, n, angle, speed, end
        fall.slow_down(state, keep)
    if angle >= end:
        if not fall.strikes_next(layout, n):
            outcome = arrays.PROPAGATED if n + 1 == len(layout.thickness) else arrays.OUT_OF_REACH
            return outcome, n, angle, speed, end
        state.m_end = sums(ring, state, n, at)[0]
        arrivals[n + 1] = now
        if fall.hit(ring[n], ring[n + 1], state) == arrays.JAMMED:
            return arrays.JAMMED, n, angle, speed, end
        n, angle = n + 1, 0.0
        end = fall.fall_angle(ring[n], fall.strikes_next(layout, n))
    return UNFINISHED, n, angle, math.sqrt(state.u), end


@internal
def rk4_step(ring, state, n, angle, speed, a1, h):
    """Return angle and ω after one Runge-Kutta step of h seconds; a1: α at its start."""
    v2 = speed + 0.5 * h * a1
    a2 = acceleration(ring, state, n, angle + 0.5 * h * speed, v2)
    v3 = speed + 0.5 * h * a2
    a3 = acceleration(ring, state, n, angle + 0.5 * h * v2, v3)
    v4 = speed + h * a3
    a4 = acceleration(ring, state, n, angle + h * v3, v4)
    return (
        angle + h / 6.0 * (speed + 2.0 * v2 + 2.0 * v3 + v4),
        speed + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4),
    )


@internal
def locate(ring, state, n, angle, speed, a1, h, end, has_change):
    """Return time, angle and ω of the first change of contact in a step of h, or of `end`.

    By Newton's method for the angle `end`, by bisection for a change of contact.
    """
    low, high, t = 0.0, h, h
    new, v = angle, speed
    for _ in range(ITERATIONS):
        new, v = rk4_step(ring, state, n, angle, speed, a1, t)
        # nan, if the step goes too far, counts as past
        is_past = sums(ring, state, n, min(new, end))[3] <= 0.0 if has_change else not new < end
        low, high = (low, t) if is_past else (t, high)
        closer = t - (new - end) / v
        if has_change or not low < closer < high:
            closer = 0.5 * (low + high)
        if abs(closer - t) <= STEP_ROUNDING * h:
            break
        t = closer
    if has_change:
        t = high
        new, v = rk4_step(ring, state, n, angle, speed, a1, t)
    return t, new, v


@entry_point
def take_fixed_steps(layout, ring, states, h, rule, arrivals):
    """Advance a chain in steps of h seconds until its wave ends; return its outcome.

    Writes arrival times (N,).  Without located events the next leader starts from its rest: the
    overshoot of the last step is lost, as in Chapman's program.
    """
    state = states[0]
    n, angle, speed, now = 0, 0.0, math.sqrt(state.u), 0.0
    end = fall.fall_angle(ring[n], fall.strikes_next(layout, n))
    while True:
        a = acceleration(ring, state, n, angle, speed)
        dt = h
        if rule == EULER:
            new, v = angle + h * speed, speed + h * a
        else:
            new, v = rk4_step(ring, state, n, angle, speed, a, h)
        due = sums(ring, state, n, min(new, end))[3] <= 0.0
        if rule == LOCATED and (due or not new < end):
            dt, new, v = locate(ring, state, n, angle, speed, a, h, end, due)
            if not due:
                new = end
        if not v > 0.0:
            return arrays.NO_RIGID_ANSWER if math.isnan(v) else arrays.STALLED
        angle, speed, now = new, v, now + dt
        if due or angle >= end:
            events = apply_events(layout, ring, states, n, angle, speed, now, arrivals)
            outcome, n, angle, speed, end = events
            if outcome != UNFINISHED:
                return outcome
