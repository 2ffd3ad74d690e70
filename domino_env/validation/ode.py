"""General ODE solvers on the equations of motion, with fixed and adaptive steps in time.

All solve the equation of `kernels/stepping.py`, with all kinds of contact, face impacts, friction
and unequal dominoes. They differ in their steps:

    euler      explicit Euler, events at the end of the step that passes them: order one
    rk4-step   classic Runge-Kutta, events likewise: order one
    rk4        classic Runge-Kutta with located events: order four
    RK45, DOP853, Radau, LSODA   SciPy's solve_ivp with events
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from domino_env.core.types import Floats
from domino_env.kernels import stepping
from domino_env.kernels.arrays import Arrays
from domino_env.physics.gradient import arrays_from
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome, setting_from

# methods with fixed steps, and their codes in the kernels
FIXED = {"euler": stepping.EULER, "rk4-step": stepping.RK4, "rk4": stepping.LOCATED}
ADAPTIVE = ("RK45", "DOP853", "Radau", "LSODA")
# SciPy locates a change of contact where 1 - cos θ is past it by this, so that the change is due
OVERSHOOT = 1e-12


def integrate(
    layout: Layout, physics: Physics, method: str, setting: float
) -> tuple[Outcome, Floats]:
    """Simulate a layout with an ODE solver.

    Parameters
    ----------
    layout, physics
        See `simulate`.
    method
        One of `FIXED` or `ADAPTIVE`.
    setting
        The step [s] of a fixed method, the relative tolerance of an adaptive one.

    Returns
    -------
    tuple
        Outcome, and arrival times (N,) [s], inf for dominoes that are not hit.
    """
    arrays = arrays_from(layout)
    chain = stepping.push_chain(arrays, setting_from(physics, 0.0))
    arrivals = np.full(layout.count, np.inf)
    arrivals[0] = 0.0
    if method in FIXED:
        code = stepping.take_fixed_steps(arrays, *chain, setting, FIXED[method], arrivals)
    else:
        code = _adaptive(arrays, chain, physics, method, setting, arrivals)
    return Outcome(code), arrivals


def _adaptive(
    arrays: Arrays, chain: Any, physics: Physics, method: str, rtol: float, arrivals: Floats
) -> int:
    """Simulate by solve_ivp, one call from event to event; return the outcome.

    An event is a root of a function: the leader reaches the end of its fall (the next domino or its
    tipping angle), a contact changes, or the leader stops.
    """
    n, angle, speed, time = 0, 0.0, physics.push, 0.0

    def derivatives(_: float, y: Floats) -> tuple[float, float]:
        return y[1], stepping.right_side(*chain, n, y[0], y[1])[0]

    def arrives(_: float, y: Floats) -> float:
        return float(y[0] - end)

    def changes(_: float, y: Floats) -> float:
        left = stepping.right_side(*chain, n, y[0], y[1])[1]
        return min(float(left), 1.0) + OVERSHOOT  # left: inf if no contact can change

    def stops(_: float, y: Floats) -> float:
        return float(y[1])

    events = (arrives, changes, stops)
    for event in events:
        event.terminal = True  # type: ignore[attr-defined]
    while True:
        result = stepping.apply_events(arrays, *chain, n, angle, speed, time, arrivals)
        outcome, n, angle, speed, end = result
        if outcome != stepping.UNFINISHED:
            return int(outcome)
        if math.isnan(derivatives(time, np.array([angle, speed]))[1]):
            return Outcome.NO_RIGID_ANSWER
        time_scale = math.sqrt(arrays.height[n] / physics.gravity)
        # a leader that falls for longer than 1e4 √(L/g) counts as stalled;
        # SciPy accepts no rtol below 100 eps = 2.2e-14
        solution = solve_ivp(
            derivatives, (time, time + 1e4 * time_scale), (angle, speed), method=method,
            rtol=max(rtol, 2.3e-14), atol=(rtol * end, rtol / time_scale), events=events,
        )  # fmt: skip
        if solution.status == -1:  # the step size is below rounding
            return Outcome.NO_RIGID_ANSWER
        if solution.status == 0 or len(solution.t_events[2]) > 0:  # out of time, or it stops
            return Outcome.STALLED
        time = float(solution.t[-1])
        angle, speed = float(solution.y[0, -1]), float(solution.y[1, -1])
        if len(solution.t_events[0]) > 0:
            angle = end
