"""Simulation of rigid bodies on a floor or fixed pivots, with steps halved until it converges."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from domino_env.core.checks import require, require_type
from domino_env.core.progress import leave_out, progress_bar
from domino_env.core.types import Bools, Floats, ReadOnlyArrays
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics, require_arguments
from domino_env.rigid import dynamics

FLOOR_FRICTION = 0.5  # of wood on wood, as it is mostly given
COARSEST, FINEST = 4.0, 1.0 / 32.0  # steps, over those of 0.16 ms for standard dominoes
SWEEP_TOLERANCE = 5e-6  # [√(g L)] change of velocity at which sweeps end, for coarseness 1
WINDOW = 24  # dominoes behind the leader that still move, at least
NEGLIGIBLE = 1e-4  # of the leader's speed: slower dominoes are held at rest
PATIENCE = 3.0  # [√(L/g)] without a hit after which a wave has stopped; a fall takes about one
SAFETY = 3.0  # ratio of the error estimate to the largest change by halved steps
CHANCE_ERROR = 2e-4  # relative error at coarseness 1 that halved steps may hide by chance
STEPS_AT_ONCE = 256  # steps in a call of the compiled code, which takes some 0.1 s


@dataclass(frozen=True, eq=False)
class RigidWave(ReadOnlyArrays):
    """Wave of a layout of rigid bodies, by `simulate_standing` or a third-party engine.

    Attributes
    ----------
    layout, physics
        Layout and physics that were simulated.
    floor_friction
        Coulomb coefficient between dominoes and the floor; None for fixed pivots.
    arrival_times
        (N,) times at which each domino is first hit [s]: 0 for the first, inf where not reached.
    lean
        (N,) largest angle from upright, towards the next domino, while it moved [rad].
    slid
        (N,) largest distance of the front bottom edge from its first place [m]; 0 with fixed
        pivots, nan for an engine.
    opened
        (N-1,) largest opening of the contact with the next domino after it had closed and before
        the tip slipped off [m]; nan for an engine.
    opened_at
        (N-1,) time of that opening [s]; 0 where there was none, nan for an engine.
    error_estimate
        Estimate of the largest |error|/t_k over the arrival times t_k, from runs with halved steps;
        see the notes of `simulate_standing`.
    converged
        True if the estimate is at most `rtol`.
    rtol
        Relative error allowed in the arrival times.
    steps
        Number of time steps in the finest run.
    run_time
        Time of the computation [s].
    simulator
        Name of the simulator, with the version of an engine.
    """

    layout: Layout
    physics: Physics
    floor_friction: float | None
    arrival_times: Floats
    lean: Floats
    slid: Floats
    opened: Floats
    opened_at: Floats
    error_estimate: float
    converged: bool
    rtol: float
    steps: int
    run_time: float
    simulator: str = "simulate_standing"

    def __repr__(self) -> str:
        count = self.layout.count
        if self.mean_speed > 0.0:
            result = f"{count} dominoes in {self.arrival_times[-1]:.5g} s"
            result = f"{result}, {self.mean_speed:.5g} m/s"
        else:
            result = f"{self.hit} of {count} dominoes were hit, {self.toppled} toppled"
        return f"RigidWave({floor_name(self.floor_friction)}: {result}, ±{self.error_estimate:.0e})"

    @property
    def hit(self) -> int:
        """Number of dominoes hit; the first counts."""
        return int(np.isfinite(self.arrival_times).sum())

    @property
    def topples(self) -> Bools:
        """Mask of dominoes that passed their tipping angle (N,)."""
        return np.asarray(self.lean > np.arctan2(self.layout.thickness, self.layout.height))

    @property
    def toppled(self) -> int:
        """Number of dominoes that passed their tipping angle."""
        return int(self.topples.sum())

    @property
    def staying_up(self) -> int:
        """Number of dominoes that did not topple."""
        return self.layout.count - self.toppled

    @property
    def propagated(self) -> bool:
        """True if all dominoes were hit and toppled."""
        return self.hit == self.toppled == self.layout.count

    @property
    def mean_speed(self) -> float:
        """Length of the layout over the last arrival time [m/s]; 0 if the last is not hit."""
        last = float(self.arrival_times[-1])  # 0 for a single domino
        return self.layout.length / last if 0.0 < last < math.inf else 0.0


def floor_name(floor_friction: float | None) -> str:
    """Return the name of a floor of this friction, or of fixed pivots."""
    return "fixed pivots" if floor_friction is None else f"floor {floor_friction:g}"


def largest_difference(times: Floats, reference: Floats) -> float:
    """Return the largest |t_k / t'_k - 1|; inf if different dominoes are hit.

    Parameters
    ----------
    times, reference
        Arrival times t and t' (N,) [s]; inf where not hit.
    """
    hit = np.isfinite(reference)
    if not np.array_equal(hit, np.isfinite(times)):
        return math.inf
    hit &= reference > 0.0  # the push is the zero of time
    return float(np.max(np.abs(times[hit] / reference[hit] - 1.0), initial=0.0))


class StoppedError(Exception):
    """Error of a simulation whose `stop` returned True."""


def simulate_standing(
    layout: Layout,
    physics: Physics | None = None,
    floor_friction: float | None = FLOOR_FRICTION,
    rtol: float = 1e-3,
    *,
    progress: bool | None = False,
    stop: Callable[[], bool] | None = None,
) -> RigidWave:
    """Simulate free-standing rigid bodies on a floor, or rigid bodies on fixed pivots.

    The analytic model of `simulate` assumes fixed pivots and closed contacts. Here bottom edges may
    slip and lift, and contacts open and close, all without restitution and with Coulomb friction.
    The run time is thousands of times longer.

    Parameters
    ----------
    layout
        Layout. On uneven ground the floor of each domino is the plane on which it stands.
    physics
        Friction between dominoes, gravity and push; by default those of `Physics()`.
    floor_friction
        Coulomb coefficient between dominoes and the floor, 0 or more. With None every domino turns
        about its front bottom edge, as in the analytic model.
    rtol
        Relative error allowed in the arrival times, from 1e-5 to below 1. Steps are halved until
        the error estimate is not larger, or the steps are the finest.
    progress
        True for a progress bar; None for a bar on a terminal, else a line every half minute.
    stop
        Function that is called about every 0.1 s; the simulation ends if it returns True.

    Returns
    -------
    RigidWave
        Arrival times with an estimate of their error, leans, slips and openings of contacts.

    Raises
    ------
    TypeError
        For a layout, physics or stop of another type.
    ValueError
        For a friction or tolerance out of its range.
    StoppedError
        If `stop` returned True.
    ArithmeticError
        If a velocity is not a number, which no layout is known to cause.

    Notes
    -----
    The error estimate is three times the largest relative change of an arrival time by halved
    steps, plus 2e-4 times the last step over 0.16 ms (for standard dominoes). The change by an
    earlier halving counts half at every further one. The estimate holds where arrival times depend
    on the steps smoothly. An impact with friction may have two solutions, and finer steps may
    switch to the other one without a sign of it in coarser runs. Of 45 runs of random layouts of 16
    dominoes on floors (friction 0.3 and 0.5, flat and uneven ground, rtol=1e-3) 43 had an error
    below half of the estimate, and two had errors of 2.6 and 9 times the estimate. With rtol=2e-4
    all errors were below a third of it.

    References
    ----------
    J. J. Moreau (1988), Unilateral contact and dry friction in finite freedom dynamics; M. Jean
    (1999), The non-smooth contact dynamics method, Comput. Methods Appl. Mech. Engrg. 177, 235-257.

    Examples
    --------
    >>> import domino_env as de
    >>> layout = de.Layout.uniform(10, pitch=0.024, thickness=0.0075)
    >>> de.simulate_standing(layout, de.Physics(push=8.0), floor_friction=0.5).toppled
    10
    """
    start_time, physics = time.perf_counter(), physics or Physics()
    require_arguments(layout, physics)
    require("floor_friction", floor_friction, 0.0, hint="None for fixed pivots", optional=True)
    floor_friction = None if floor_friction is None else float(floor_friction)
    require_type("stop", stop, Callable | None, "a function that returns True or False, or None")
    require("rtol", rtol, 1e-5, below=1.0, hint="1e-3 is quick")
    run, steps = _run(layout, physics, floor_friction, COARSEST, progress, stop)
    coarseness, largest = COARSEST, 0.0
    while coarseness > FINEST:
        coarseness /= 2.0
        finer, steps = _run(layout, physics, floor_friction, coarseness, progress, stop)
        # an error halves with the steps: a change below half of the last one may be small by chance
        change = largest_difference(run.arrival_times, finer.arrival_times)
        largest = max(change, 0.5 * largest)
        uncertainty = SAFETY * largest + CHANCE_ERROR * coarseness
        run = finer
        if uncertainty <= rtol and coarseness <= COARSEST / 4.0:  # at least two changes are known
            break
    for values in run:
        values.flags.writeable = False
    return RigidWave(
        layout, physics, floor_friction, **run._asdict(), error_estimate=uncertainty,
        converged=uncertainty <= rtol, rtol=rtol, steps=steps,
        run_time=time.perf_counter() - start_time,
    )  # fmt: skip


def window_size(layout: Layout) -> int:
    """Return the number of dominoes behind the leader that still move in `simulate_standing`.

    Notes
    -----
    Behind a closed contact a domino turns by about 1 - √(λ² - d²)/L times the turn of the next one,
    with pitch λ, thickness d and height L. With small gaps more dominoes are needed.
    """
    pitch, thickness, height = layout.pitch, layout.thickness[1:], layout.height[:-1]
    ratios = 1.0 - np.sqrt(np.maximum(pitch**2 - thickness**2, 0.0)) / height
    decay = np.cumsum(np.append(0.0, -np.log(np.clip(ratios, 1e-3, 1.0 - 1e-3))))
    first = np.searchsorted(decay, decay + math.log(NEGLIGIBLE), side="right")
    return max(WINDOW, int(np.max(np.arange(layout.count) - first)) + 1)


def longest_wait(layout: Layout, physics: Physics) -> float:
    """Return the time without a hit after which a wave has stopped [s].

    A push smaller than the least that tips the first domino counts as the least.
    """
    height, thickness, tilt = layout.height[0], layout.thickness[0], layout.tilt[0]
    diagonal = math.hypot(height, thickness)
    lift = diagonal - height * math.cos(tilt) - thickness * math.sin(tilt)
    tipping = math.sqrt(3.0 * physics.gravity * lift) / diagonal
    swing = math.sqrt(float(layout.height.max()) / physics.gravity)
    return float(PATIENCE * swing + 2.0 / max(physics.push, tipping))


def _run(
    layout: Layout,
    physics: Physics,
    floor: float | None,
    coarseness: float,
    progress: bool | None = False,
    stop: Callable[[], bool] | None = None,
) -> tuple[dynamics.Record, int]:
    """Simulate with steps of one coarseness; return the results and the number of steps."""
    count, height, thickness = layout.count, layout.height, layout.thickness
    mass, square = layout.density * height * thickness, height**2 + thickness**2
    edge = np.zeros((count, 2))
    if floor is not None:
        edge = np.stack([0.5 * thickness, -0.5 * height], axis=-1)
    inertia = mass * square / (3.0 if floor is None else 12.0)
    slope = np.stack([np.sin(layout.tilt), np.cos(layout.tilt)], axis=-1)
    sizes = height, thickness, mass, inertia
    bodies = dynamics.Bodies(*sizes, layout.pivots, layout.tilt, slope, edge)
    tallest = float(height.max())
    friction = dynamics.FIXED_PIVOTS if floor is None else floor
    setting = dynamics.Setting(
        physics.friction, friction, physics.gravity, coarseness,
        SWEEP_TOLERANCE * coarseness * math.sqrt(physics.gravity * tallest), window_size(layout),
        longest_wait(layout, physics),
    )  # fmt: skip
    arrival_times = np.append(0.0, np.full(count - 1, np.inf))
    record = dynamics.Record(arrival_times, *map(np.zeros, (count, count, count - 1, count - 1)))
    state = dynamics.start(bodies, setting, physics.push)
    status, advance = dynamics.RUNNING, cast("Any", dynamics.advance)
    description = f"{floor_name(floor)}, steps of {coarseness:g}"
    with progress_bar(
        progress, total=count, desc=description, unit=" dominoes", leave=False, delay=1.0
    ) as bar:
        while status == dynamics.RUNNING:  # between calls, Python handles signals
            if stop is not None and stop():
                raise StoppedError
            status = advance(bodies, setting, state, record, STEPS_AT_ONCE)
            hit_count = int(state.run["leader"][0]) + 1
            if bar.n == 0:  # after the first call
                leave_out(bar, hit_count)
            bar.update(hit_count - bar.n)
    if status == dynamics.FAILED:
        raise ArithmeticError(
            f"a velocity is not a number after {np.isfinite(arrival_times).sum()} of {count} "
            "dominoes were hit; this is a fault of the simulator: please report the layout"
        )
    return record, int(state.run["steps"][0])
