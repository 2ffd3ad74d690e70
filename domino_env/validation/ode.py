"""General ODE solvers on the equations of motion, with fixed and adaptive steps in time.

All of them solve the equations of `equations.py`: every state of contact, face impacts, friction,
unequal dominoes. They differ in their steps:

    euler      explicit Euler, hits at the end of the step that passed them: order one
    rk4-step   classic Runge-Kutta, the same
    rk4        classic Runge-Kutta with located hits: order four
    RK45, DOP853, Radau, LSODA   SciPy's solve_ivp with events
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome
from domino_env.validation import equations as eq

FIXED = {"euler": eq.EULER, "rk4-step": eq.RK4, "rk4": eq.LOCATED}
ADAPTIVE = ("RK45", "DOP853", "Radau", "LSODA")


@dataclass(frozen=True, eq=False)
class SteppedWave:
    """A wave computed by an ODE solver.

    Attributes
    ----------
    outcome
        As `Wave.outcome`.
    arrival_times
        Arrival times [s], shape (N,); inf for dominoes that are not hit.
    """

    outcome: Outcome
    arrival_times: Floats


def integrate(layout: Layout, physics: Physics, method: str, setting: float) -> SteppedWave:
    """Simulate a layout with an ODE solver.

    Parameters
    ----------
    layout, physics
        As of `simulate`.
    method
        One of `FIXED` or `ADAPTIVE`.
    setting
        The step [s] of a fixed method, the relative tolerance of an adaptive one.
    """
    sizes = layout.spacing, layout.thickness, layout.height, layout.density
    table = eq.table_of(*sizes, layout.rise, layout.tilt)
    stack = eq.Stack(table, 0, 0, physics.friction, physics.gravity)
    arrival = np.full(layout.count, np.inf)
    arrival[0] = 0.0
    if method in FIXED:
        code = eq.follow(stack, physics.push, setting, FIXED[method], arrival)
    else:
        code = _adaptive(stack, physics.push, method, setting, arrival)
    return SteppedWave(Outcome(code), arrival)


def _adaptive(stack: eq.Stack, push: float, method: str, rtol: float, arrival: Floats) -> int:
    """Simulate by solve_ivp, one call from event to event; return the outcome.

    Events end a call: the leader reaches the next domino (or tips), a contact changes, the leader
    stops.
    """
    table = stack.table
    end, hits = eq.goal(table, 0)

    def rate(_: float, y: Floats) -> tuple[float, float]:
        return y[1], eq.acceleration(stack, y[0], y[1])

    def arrives(_: float, y: Floats) -> float:
        return float(y[0] - end)

    def changes(_: float, y: Floats) -> float:
        return min(float(eq.sums(stack, y[0])[3]), 1.0)

    def stops(_: float, y: Floats) -> float:
        return float(y[1])

    events = (arrives, changes, stops)
    for event in events:
        event.terminal = True  # type: ignore[attr-defined]
    angle, speed, now = float(table[0, eq.TILT]), push, 0.0
    while True:
        # a change may be due at once: a face impact together with a hit, or a separation after it
        if changes(now, np.array([angle, speed])) <= 1e-14:
            keep, back = eq.change(stack, angle, eq.TOGETHER)
            if not 0.0 < keep < math.inf:
                return eq.JAMMED
            stack = stack._replace(back=back)
            speed *= keep
        if angle >= end:
            if not hits:
                return eq.PROPAGATED if stack.n + 1 == len(table) else eq.OUT_OF_REACH
            arrival[stack.n + 1] = now
            keep = eq.hit(stack, eq.sums(stack, angle)[0])
            if not 0.0 < keep < math.inf:
                return eq.JAMMED
            stack = stack._replace(n=stack.n + 1)
            angle, speed = float(table[stack.n, eq.TILT]), speed * keep
            end, hits = eq.goal(table, stack.n)
        if not eq.sums(stack, angle)[0] > 0.0:
            return eq.NO_RIGID_ANSWER
        swing = math.sqrt(table[stack.n, eq.HEIGHT] / stack.gravity)
        done = solve_ivp(
            rate, (now, now + 1e4 * swing), (angle, speed), method=method, rtol=max(rtol, 2.3e-14),
            atol=(rtol * (end - float(table[stack.n, eq.TILT])), rtol / swing), events=events,
        )  # fmt: skip
        if done.status == -1:  # the step size fell to nothing
            return eq.NO_RIGID_ANSWER
        if done.status == 0 or len(done.t_events[2]) > 0:  # time ran out, or the leader stops
            return eq.STALLED
        now = float(done.t[-1])
        angle, speed = float(done.y[0, -1]), float(done.y[1, -1])
        if len(done.t_events[0]) > 0:
            angle = end
