"""ODE solvers of the field on the equations of motion, with fixed and adaptive steps in time.

All of them solve the equations of `equations.py`: every state of contact, face impacts, friction,
unequal dominoes. They differ in how they move through time:

    euler      explicit Euler, hits at the end of the step that passed them
    rk4-step   classic Runge-Kutta, the same; both are of order one for that
    rk4        classic Runge-Kutta with hits located: order four
    RK45, DOP853, Radau, LSODA   SciPy's solve_ivp with events
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from domino_env.core.checks import require, require_choice
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome
from domino_env.validation import equations as eq

FIXED = {"euler": eq.EULER, "rk4-step": eq.RK4, "rk4": eq.LOCATED}
ADAPTIVE = ("RK45", "DOP853", "Radau", "LSODA")


@dataclass(frozen=True, eq=False)
class SteppedWave:
    """A wave as an ODE solver computes it.

    Attributes
    ----------
    outcome
        As `Wave.outcome`; None where the evaluations allowed did not reach the end.
    arrival_times
        (N,) [s], inf where the wave did not come.
    evaluations
        How often the acceleration of the stack was computed.
    """

    outcome: Outcome | None
    arrival_times: Floats
    evaluations: int


def integrate(
    layout: Layout, physics: Physics, method: str, setting: float, most: int = 10**9
) -> SteppedWave:
    """Simulate a layout with an ODE solver.

    Parameters
    ----------
    layout, physics
        As of `simulate`.
    method
        One of `FIXED` or `ADAPTIVE`.
    setting
        The step [s] of a fixed method, the relative tolerance of an adaptive one.
    most
        Evaluations of the stack's acceleration that are allowed.

    Raises
    ------
    ValueError
        For an unknown method, or a setting that is not positive and finite.
    """
    require_choice("method", method, (*FIXED, *ADAPTIVE))
    require("setting", setting, above=0.0, hint="a step [s] or a tolerance")
    sizes = layout.spacing, layout.thickness, layout.height, layout.density
    rows = eq.table(*sizes, layout.rise, layout.tilt)
    arrival = np.full(layout.count, np.inf)
    arrival[0] = 0.0
    if method in FIXED:
        numbers = physics.friction, physics.gravity, physics.push, setting
        code, used = eq.follow(rows, *numbers, FIXED[method], most, arrival)
    else:
        code, used = _adaptive(rows, physics, method, setting, most, arrival)
    outcome = None if code == eq.UNFINISHED else Outcome(code)
    return SteppedWave(outcome, arrival, used)


class _SpentError(Exception):
    """The evaluations allowed are used up."""


def _adaptive(
    rows: Floats, physics: Physics, method: str, rtol: float, most: int, arrival: Floats
) -> tuple[int, int]:
    """Simulate by solve_ivp, one call from event to event; return (outcome, evaluations).

    Events end a call: the leader reaches the next domino (or tips), a link switches, the leader
    stops.
    """
    mu, gravity = physics.friction, physics.gravity
    n = back = used = 0
    end, strikes = eq.goal(rows, 0)

    def rate(_: float, y: Floats) -> tuple[float, float]:
        nonlocal used
        used += 1
        if used > most:
            raise _SpentError
        return y[1], eq.acceleration(rows, n, back, y[0], y[1] * y[1], mu, gravity)

    def arrives(_: float, y: Floats) -> float:
        return float(y[0] - end)

    def switches(_: float, y: Floats) -> float:
        return min(float(eq.stack(rows, n, back, y[0], mu)[3]), 1.0)

    def stops(_: float, y: Floats) -> float:
        return float(y[1])

    events = (arrives, switches, stops)
    for event in events:
        event.terminal = True  # type: ignore[attr-defined]
    angle, speed, now = float(rows[0, eq.TILT]), physics.push, 0.0
    while True:
        # a link may be due at once: flush together with a hit, or released by a flush
        if switches(now, np.array([angle, speed])) <= 1e-14:
            keep, back = eq.switch(rows, n, back, angle, mu, eq.TOGETHER)
            if not 0.0 < keep < math.inf:
                return eq.JAMMED, used
            speed *= keep
        if angle >= end:
            sums = eq.stack(rows, n, back, angle, mu)
            if not strikes:
                return (eq.PROPAGATED if n + 1 == len(rows) else eq.OUT_OF_REACH), used
            arrival[n + 1] = now
            keep = eq.hit(rows, n, sums[0], mu)
            if not 0.0 < keep < math.inf:
                return eq.JAMMED, used
            n += 1
            angle, speed = float(rows[n, eq.TILT]), speed * keep
            end, strikes = eq.goal(rows, n)
        if not eq.stack(rows, n, back, angle, mu)[0] > 0.0:
            return eq.NO_RIGID_ANSWER, used
        swing = math.sqrt(rows[n, eq.HEIGHT] / gravity)
        try:
            done = solve_ivp(
                rate,
                (now, now + 1e4 * swing),
                (angle, speed),
                method=method,
                rtol=max(rtol, 2.3e-14),
                atol=(rtol * (end - float(rows[n, eq.TILT])), rtol * 1.0 / swing),
                events=events,
            )
        except _SpentError:
            return eq.UNFINISHED, used
        if done.status != 1:  # the step size fell to nothing, or time ran out
            return (eq.NO_RIGID_ANSWER if done.status == -1 else eq.UNFINISHED), used
        if len(done.t_events[2]) > 0:
            return eq.STALLED, used
        now = float(done.t[-1])
        angle, speed = float(done.y[0, -1]), float(done.y[1, -1])
        if len(done.t_events[0]) > 0:
            angle = end
