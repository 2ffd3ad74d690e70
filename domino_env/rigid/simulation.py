"""Simulation of rigid bodies on a floor or fixed pivots, with steps halved until it converges."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from domino_env.core.checks import require, require_type
from domino_env.core.progress import progress_bar
from domino_env.core.types import Bools, Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics, require_arguments
from domino_env.rigid import dynamics

FLOOR_FRICTION = 0.5  # of wood on wood, as it is mostly given
COARSEST_STEP, FINEST_STEP = 4.0, 1.0 / 32.0  # steps, in those of 0.16 ms for standard dominoes
SWEEP_TOLERANCE = 5e-6  # [sqrt(g L)] velocity at which the sweeps of a step of fineness 1 end
WINDOW = 24  # dominoes behind the leader that still move, at least
NEGLIGIBLE = 1e-4  # of the leader's speed: slower dominoes are at rest
PATIENCE = 3.0  # [sqrt(L/g)] without a hit after which a wave has stopped; a fall takes about one
SAFETY = 3.0  # times the largest change by halved steps
CHANCE_ERROR = 2e-4  # relative error at fineness 1 that a change may be too small to show
STEPS_AT_ONCE = 256  # of the compiled code, some 0.1 s
MAX_RUN_TIME = 1800.0  # [s] that a simulation may take
MIN_MEASURED_TIME = 10.0  # [s] of all its runs, after which its time can be estimated


@dataclass(frozen=True, eq=False)
class RigidWave:
    """Wave of a layout of rigid bodies, by this simulator or a third-party engine.

    Attributes
    ----------
    layout, physics
        As simulated.
    floor_friction
        Coulomb coefficient between dominoes and the floor; None for fixed pivots.
    arrival_times
        (N,) times at which each domino is first hit [s]: 0 for the first, inf where not reached.
    lean
        (N,) largest angle from upright, towards the next domino, while it moved [rad].
    slid
        (N,) largest distance of the front bottom edge from its place [m]; 0 with fixed pivots. An
        engine gives neither this nor openings: nan.
    opened
        (N-1,) largest opening of the contact with the next domino after it had closed [m], and
        before the tip slipped off.
    opened_at
        (N-1,) time of that opening [s]; 0 where there was none.
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
        Name, and version of an engine.
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
        """True for dominoes that passed their tipping angle (N,)."""
        tipping = np.arctan2(self.layout.thickness, self.layout.height)
        return np.asarray(self.lean > tipping)

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
        """True if all dominoes were hit and toppled, as of a wave of the model."""
        return self.hit == self.toppled == self.layout.count

    @property
    def mean_speed(self) -> float:
        """Length of the standing layout over the last arrival time [m/s]; 0 if it is not hit."""
        last = float(self.arrival_times[-1])
        return self.layout.length / last if 0.0 < last < math.inf else 0.0


def floor_name(floor_friction: float | None) -> str:
    """Return the name of a floor of this friction, or of fixed pivots."""
    return "fixed pivots" if floor_friction is None else f"floor {floor_friction:g}"


def largest_difference(times: Floats, reference: Floats) -> float:
    """Return the largest |t_k / t'_k - 1|; inf where the waves end at different dominoes."""
    hit = np.isfinite(reference)
    if not np.array_equal(hit, np.isfinite(times)):
        return math.inf
    hit &= reference > 0.0  # the push is the zero of time
    return float(np.max(np.abs(times[hit] / reference[hit] - 1.0), initial=0.0))


class StoppedError(Exception):
    """Raised by a simulation whose `stop` returned True."""


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
    The run time is some ten thousand times longer.

    Parameters
    ----------
    layout
        On flat ground or not; each domino's floor is the plane that it stands on.
    physics
        Friction between dominoes, gravity and push; by default those of `Physics()`.
    floor_friction
        Coulomb coefficient between dominoes and the floor, 0 or more; None turns every domino
        about its front bottom edge, as the analytic model does.
    rtol
        Relative error allowed in the arrival times, 1e-5 or more: steps are halved until the
        estimate meets it.
    progress
        True for a progress bar; None for a bar on a terminal, else a line every half minute.
    stop
        Function that is called about every 0.1 s; the simulation ends if it returns True.

    Returns
    -------
    RigidWave
        Arrival times with an estimate of their error, and which dominoes toppled, slid, opened.

    Raises
    ------
    ValueError
        For a friction or tolerance out of its range, and for a layout that would take more than
        half an hour.
    StoppedError
        If `stop` returned True.
    ArithmeticError
        If a velocity is not a number, which no layout is known to cause.

    Notes
    -----
    The error estimate is three times the largest change of an arrival time by halved steps, plus
    2e-4 of the last step in units of 0.16 ms (for standard dominoes). It holds where arrival times
    depend on the steps smoothly. An impact with friction may have two solutions, and finer steps
    may switch to the other one, of which coarser runs show nothing: of 45 runs of random layouts
    of 16 dominoes on floors (friction 0.3 and 0.5, flat and uneven ground, rtol=1e-3) 43 had an
    error below half of the estimate, and two had one of 2.6 and 9 times the estimate. With
    rtol=2e-4 all errors were below a third of it.

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
    run, steps = _run(layout, physics, floor_friction, COARSEST_STEP, progress, stop)
    fineness, largest = COARSEST_STEP, 0.0
    while fineness > FINEST_STEP:
        fineness /= 2.0
        finer, steps = _run(layout, physics, floor_friction, fineness, progress, stop)
        # an error halves with the steps; a change smaller than that may be small by chance
        change = largest_difference(run.arrival_times, finer.arrival_times)
        largest = max(change, 0.5 * largest)
        uncertainty = SAFETY * largest + CHANCE_ERROR * fineness
        run = finer
        if uncertainty <= rtol and fineness <= COARSEST_STEP / 4.0:
            break
    return RigidWave(
        layout=layout,
        physics=physics,
        floor_friction=floor_friction,
        **run._asdict(),
        error_estimate=uncertainty,
        converged=uncertainty <= rtol,
        rtol=rtol,
        steps=steps,
        run_time=time.perf_counter() - start_time,
    )


def _require_time(elapsed: float, hit_count: int, count: int, floor: str) -> None:
    """Raise a ValueError with an estimate if a simulation will take more than `MAX_RUN_TIME`."""
    expected = elapsed * count / max(hit_count, 1)
    if elapsed > MIN_MEASURED_TIME and expected > MAX_RUN_TIME:
        raise ValueError(
            f"{count:,} dominoes as rigid bodies ({floor}) would take about {expected / 3600:.2g} "
            f"hours: simulate the first {max(int(count * MAX_RUN_TIME / expected), 2):,} or fewer"
        )


def window_size(layout: Layout) -> int:
    """Return the number of dominoes behind the leader that still move in `simulate_standing`.

    Notes
    -----
    Behind a closed contact a domino turns by about 1 - √(λ² - d²)/L times the turn of the next one,
    with pitch λ, thickness d and height L: stacks with small gaps come to rest slowly.
    """
    pitch, thickness, height = layout.pitch, layout.thickness[1:], layout.height[:-1]
    ratios = 1.0 - np.sqrt(np.maximum(pitch**2 - thickness**2, 0.0)) / height
    decay = np.cumsum(np.append(0.0, -np.log(np.clip(ratios, 1e-3, 1.0 - 1e-3))))
    first = np.searchsorted(decay, decay + math.log(NEGLIGIBLE), side="right")
    return max(WINDOW, int(np.max(np.arange(layout.count) - first)) + 1)


def longest_wait(layout: Layout, physics: Physics) -> float:
    """Return the time without a hit after which a wave has stopped [s].

    For a push smaller than the least that tips the first domino, it is the time of the least.
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
    fineness: float,
    progress: bool | None = False,
    stop: Callable[[], bool] | None = None,
) -> tuple[dynamics.Record, int]:
    """Simulate with steps of one fineness; return the results and the number of steps."""
    count, height, thickness = layout.count, layout.height, layout.thickness
    mass, square = layout.density * height * thickness, height**2 + thickness**2
    edge = np.zeros((count, 2))
    if floor is not None:
        edge = np.stack([0.5 * thickness, -0.5 * height], axis=-1)
    inertia = mass * square / (3.0 if floor is None else 12.0)
    slope = np.stack([np.sin(layout.tilt), np.cos(layout.tilt)], axis=-1)
    sizes = height, thickness, mass, inertia
    chain = dynamics.Chain(*sizes, layout.pivots, layout.tilt, slope, edge)
    tallest = float(height.max())
    friction = dynamics.FIXED_PIVOTS if floor is None else floor
    setting = dynamics.Setting(
        physics.friction, friction, physics.gravity, fineness,
        SWEEP_TOLERANCE * fineness * math.sqrt(physics.gravity * tallest), window_size(layout),
        longest_wait(layout, physics),
    )  # fmt: skip
    arrival_times = np.append(0.0, np.full(count - 1, np.inf))
    lengths = count, count, count - 1, count - 1
    record = dynamics.Record(arrival_times, *map(np.zeros, lengths))
    state = dynamics.start(chain, setting, physics.push)
    status, advance = dynamics.RUNNING, cast("Any", dynamics.advance)
    first: tuple[float, int] | None = None  # time and hits at the end of the first piece
    description = f"{floor_name(floor)}, steps of {fineness:g}"
    with progress_bar(
        progress, total=count, desc=description, unit=" dominoes", leave=False, delay=1.0
    ) as bar:
        while status == dynamics.RUNNING:  # in pieces, between which Python handles signals
            if stop is not None and stop():
                raise StoppedError
            status = advance(chain, setting, state, record, STEPS_AT_ONCE)
            hit_count, now = int(state.run["leader"][0]) + 1, time.perf_counter()
            bar.update(hit_count - bar.n)
            first = first or (now, hit_count)  # the first piece may have been compiled
            # steps are halved at least until their fineness is 1: 2 c + 4 c after c for steps of 4
            elapsed = (now - first[0]) * max(2.0 * fineness - 1.0, 1.0)
            _require_time(elapsed, hit_count - first[1], count, floor_name(floor))
    if status == dynamics.FAILED:
        raise ArithmeticError(
            f"a velocity is not a number after {np.isfinite(arrival_times).sum()} of {count} "
            "dominoes were hit: this is a fault of the simulator: please report the layout"
        )
    return record, int(state.run["steps"][0])
