"""Steps in time: the equation of motion for ODE solvers, explicit Euler and classic Runge-Kutta.

Contacts, hits and changes of contact are those of all kernels. The equation of motion of the
leading domino n is

    α_n = (Σ w G - ω_n² Σ w I D) / Σ w I J

with sums over the stack, back … n.

Fixed steps are those of Euler's method or of the classic Runge-Kutta method (RK4). Without located
events, every event takes place at the end of the step that passes it, as in Chapman's program, and
both are of order one. With located events RK4 keeps its order four. `domino_env.validation.ode`
compares these methods.
"""

import math

import numpy as np

from domino_env.kernels import arrays, fall
from domino_env.kernels.contact import contact_at, new_ring, past_flush, sin_versine, stack_terms
from domino_env.kernels.jit import borrow, entry_point, internal
from domino_env.kernels.stack import switch

EULER, RK4, LOCATED = 0, 1, 2  # methods of `take_fixed_steps`; LOCATED: RK4 with located events
UNFINISHED = -1  # result of `apply_events` if the wave continues
ITERATIONS = 60  # halvings of a step: down to rounding
STEP_ROUNDING = 1e-16  # of a step: a smaller correction of its length ends the search


@entry_point
def push_chain(layout, setting):
    """Return the ring and the state (1,) of a chain whose first domino has just been pushed.

    The ring holds all dominoes, domino i at ring[i].
    """
    count, size = len(layout.thickness), 2
    while size <= count:
        size *= 2
    ring, states = new_ring(layout, size), np.zeros(1, arrays.STATE)
    arrays.configure(states[0], ring, setting, False)
    fall.start_chain(layout, ring, states[0])
    for n in range(count):
        fall.add_next_domino(layout, ring, states[0], n)
    return ring, states


@internal
def sum_stack(ring, state, n, angle):
    """Return Σ w I J, Σ w G / g, Σ w I D, the distance to a change of contact, and the lowest due.

    The distance is the least by which 1 - cos θ of a domino is below that of the next change. The
    lowest due is the lowest contact that changes at this angle; n if none does.
    """
    s, v = sin_versine(angle)
    w, jac, drv, distance, lowest_due = 1.0, 1.0, 0.0, np.inf, n
    sum_m, sum_g, sum_d = stack_terms(ring[n], s, v, w, jac, drv)
    for i in range(n - 1, state.back - 1, -1):
        contact = ring[i]
        distance = min(distance, contact.v_switch - v)
        if past_flush(contact, v - contact.v_switch) >= -arrays.IMPACT_TOLERANCE:
            lowest_due = i
        s, v, omega, psi, ratio = contact_at(contact, s, v, state.friction)
        drv = omega * drv + psi * jac * jac
        jac *= omega
        w *= ratio
        m, g, d = stack_terms(contact, s, v, w, jac, drv)
        sum_m, sum_g, sum_d = sum_m + m, sum_g + g, sum_d + d
    return sum_m, sum_g, sum_d, distance, lowest_due


@internal
def acceleration(ring, state, n, angle, speed):
    """Return α_n at an angle and ω_n; nan where M is not positive."""
    sum_m, sum_g, sum_d, _, _ = sum_stack(ring, state, n, angle)
    if not sum_m > 0.0:
        return np.nan
    return (state.gravity * sum_g - speed * speed * sum_d) / sum_m


@entry_point
def right_side(ring, states, n, angle, speed):
    """Return α_n at an angle and ω_n, and the distance to a change of contact in 1 - cos θ."""
    state = states[0]
    return acceleration(ring, state, n, angle, speed), sum_stack(ring, state, n, angle)[3]


@entry_point
def apply_events(layout, ring, states, n, angle, speed, now, arrival_times):
    """Change the contacts that are due at an angle, and hit the next domino at the end of the fall.

    Writes the arrival time. Returns (outcome or UNFINISHED, leader, angle, ω, angle at which its
    fall ends).
    """
    state, end = states[0], fall.fall_angle(ring[n], fall.strikes_next(layout, n))
    at = min(angle, end)
    state.u = speed * speed
    state.m_end, _, _, distance, state.last_due = sum_stack(ring, state, n, at)
    if distance <= 0.0:
        keep = switch(ring, state, n, state.last_due, state.back, at)
        if not keep > 0.0:
            return arrays.JAMMED, n, angle, speed, end
        fall.slow_down(state, keep)
    if angle >= end:
        if not fall.strikes_next(layout, n):
            outcome = arrays.PROPAGATED if n + 1 == len(layout.thickness) else arrays.OUT_OF_REACH
            return outcome, n, angle, speed, end
        state.m_end = sum_stack(ring, state, n, at)[0]
        arrival_times[n + 1] = now
        if fall.hit(ring[n], ring[n + 1], state) == arrays.JAMMED:
            return arrays.JAMMED, n, angle, speed, end
        n, angle = n + 1, 0.0
        end = fall.fall_angle(ring[n], fall.strikes_next(layout, n))
    return UNFINISHED, n, angle, math.sqrt(state.u), end


@internal
def rk4_step(ring, state, n, angle, speed, a1, h):
    """Return angle and ω after one Runge-Kutta step of h seconds; a1: α at its start."""
    speed2 = speed + 0.5 * h * a1
    a2 = acceleration(ring, state, n, angle + 0.5 * h * speed, speed2)
    speed3 = speed + 0.5 * h * a2
    a3 = acceleration(ring, state, n, angle + 0.5 * h * speed2, speed3)
    speed4 = speed + h * a3
    a4 = acceleration(ring, state, n, angle + h * speed3, speed4)
    return (
        angle + h / 6.0 * (speed + 2.0 * speed2 + 2.0 * speed3 + speed4),
        speed + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4),
    )


@internal
def locate(ring, state, n, angle, speed, a1, h, end, at_change):
    """Return time, angle and ω at the first change of contact in a step of h, or at angle `end`.

    at_change: locate the change of contact, by bisection; else the angle, by Newton's method.
    """
    low, high, t = 0.0, h, h
    new, rate = angle, speed
    for _ in range(ITERATIONS):
        new, rate = rk4_step(ring, state, n, angle, speed, a1, t)
        # an angle that is nan, after too long a step, is past `end`
        is_past = sum_stack(ring, state, n, min(new, end))[3] <= 0.0 if at_change else not new < end
        low, high = (low, t) if is_past else (t, high)
        closer = t - (new - end) / rate
        if at_change or not low < closer < high:
            closer = 0.5 * (low + high)
        if abs(closer - t) <= STEP_ROUNDING * h:
            break
        t = closer
    if at_change:
        t = high
        new, rate = rk4_step(ring, state, n, angle, speed, a1, t)
    return t, new, rate


@entry_point
def take_fixed_steps(layout, ring, states, h, method, arrival_times):
    """Advance a chain in steps of h seconds until its wave ends; return its outcome.

    Writes arrival_times (N,). Without located events the next leader starts upright at the end of
    the step that passes the hit: the overshoot is lost, as in Chapman's program.
    """
    state = states[0]
    n, angle, speed, now = 0, 0.0, math.sqrt(state.u), 0.0
    end = fall.fall_angle(ring[n], fall.strikes_next(layout, n))
    while True:
        ring = borrow(ring)  # here, so that Python does not run for too long
        a = acceleration(ring, state, n, angle, speed)
        dt = h
        if method == EULER:
            new, rate = angle + h * speed, speed + h * a
        else:
            new, rate = rk4_step(ring, state, n, angle, speed, a, h)
        due = sum_stack(ring, state, n, min(new, end))[3] <= 0.0
        if method == LOCATED and (due or not new < end):
            dt, new, rate = locate(ring, state, n, angle, speed, a, h, end, due)
            if not due:
                new = end
        if not rate > 0.0:
            return arrays.NO_RIGID_ANSWER if math.isnan(rate) else arrays.STALLED
        angle, speed, now = new, rate, now + dt
        if due or angle >= end:
            result = apply_events(layout, ring, states, n, angle, speed, now, arrival_times)
            outcome, n, angle, speed, end = result
            if outcome != UNFINISHED:
                return outcome
