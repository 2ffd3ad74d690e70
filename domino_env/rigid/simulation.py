"""Simulation of rigid bodies on a floor or fixed pivots: steps are halved until times converge."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env.core.checks import require
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.rigid import dynamics

Floats = NDArray[np.float64]

FLOOR_FRICTION = 0.5  # of wood on wood, as it is mostly given
COARSEST, FINEST = 4.0, 1.0 / 32.0  # steps, in those of 0.16 ms for standard dominoes
CALM = 5e-6  # of sqrt(g L): the velocity at which the sweeps of a step of fineness 1 end
WINDOW = 24  # dominoes behind the leader that still move, at least
FORGOTTEN = 1e-4  # of the leader's speed: dominoes that a tight row gives less lie still
PATIENCE = 3.0  # [sqrt(L/g)] without a hit before a wave counts as dead; a fall takes about one
SAFETY = 3.0  # times what halving the steps changed
GRAIN = 2e-4  # relative error of steps of fineness 1 that a change may hide by chance

NEVER: Floats = np.zeros(0)


@dataclass(frozen=True, eq=False)
class RigidWave:
    """Wave of a layout of rigid bodies, by this simulator or by a third-party engine.

    Attributes
    ----------
    layout, physics
        As of `simulate`.
    floor_friction
        Coulomb coefficient between dominoes and the floor; None for fixed pivots.
    arrival_times
        (N,) when each domino is first struck [s]: 0 for the first, inf where the wave did not come.
    lean
        (N,) largest angle from upright, towards the next domino, while it was followed [rad].
    slid
        (N,) how far the front bottom edge was from its place at most [m]; 0 with fixed pivots. An
        engine does not tell this, nor what opened: nan.
    opened
        (N-1,) how wide the contact with the next domino opened after it had closed [m], and before
        the tip slipped off for good.
    opened_at
        (N-1,) when it was that wide [s]; 0 where it never opened.
    error_estimate
        Largest |error|/t_k over the arrival times t_k, from runs with steps halved.
    converged
        False where the finest steps still moved the times by more than `rtol` allows.
    rtol
        The tolerance asked for.
    times
        (F,) at which poses were asked for [s].
    poses
        (F, N, 3) places (x, y) of the front bottom edges [m] and leans [rad] at `times`.
    steps
        Of time, in the finest run.
    run_time
        Spent computing [s].
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
    times: Floats
    poses: Floats
    steps: int
    run_time: float
    simulator: str = "simulate_standing"

    def __repr__(self) -> str:
        count = self.layout.count
        if self.mean_speed > 0.0:
            how = f"{count} dominoes in {self.arrival_times[-1]:.5g} s, {self.mean_speed:.5g} m/s"
        else:
            how = f"{self.hit} of {count} dominoes were struck, {self.toppled} toppled"
        return f"RigidWave({floor_name(self.floor_friction)}: {how}, ±{self.error_estimate:.0e})"

    @property
    def hit(self) -> int:
        """Dominoes struck; the first counts."""
        return int(np.isfinite(self.arrival_times).sum())

    @property
    def topples(self) -> NDArray[np.bool_]:
        """(N,) whether each domino passed its tipping angle."""
        tipping = np.arctan2(self.layout.thickness, self.layout.height)
        return np.asarray(self.lean > tipping)

    @property
    def toppled(self) -> int:
        """Dominoes that passed their tipping angle."""
        return int(self.topples.sum())

    @property
    def staying_up(self) -> int:
        """Dominoes that did not topple."""
        return self.layout.count - self.toppled

    @property
    def propagated(self) -> bool:
        """Whether the last domino was struck and toppled."""
        return bool(np.isfinite(self.arrival_times[-1]) and self.topples[-1])

    @property
    def mean_speed(self) -> float:
        """First pivot to last as they stood, over the last arrival time [m/s]; 0 unless struck."""
        last = float(self.arrival_times[-1])
        return self.layout.length / last if 0.0 < last < math.inf else 0.0


def floor_name(floor_friction: float | None) -> str:
    """Name a floor."""
    return "fixed pivots" if floor_friction is None else f"floor {floor_friction:g}"


def largest_difference(times: Floats, others: Floats) -> float:
    """Return the largest |t_k / t'_k - 1|; inf where the waves end at different dominoes."""
    came = np.isfinite(others)
    if not np.array_equal(came, np.isfinite(times)):
        return math.inf
    struck = came & (others > 0.0)
    return float(np.max(np.abs(times[struck] / others[struck] - 1.0), initial=0.0))


def simulate_standing(
    layout: Layout,
    physics: Physics,
    floor_friction: float | None = FLOOR_FRICTION,
    rtol: float = 1e-3,
    *,
    times: ArrayLike = (),
) -> RigidWave:
    """Simulate rigid bodies that stand free on a floor, or turn about fixed pivots.

    The analytic model of `simulate` holds every pivot to the floor and keeps every contact closed.
    Here neither is assumed: feet may slip and lift, contacts open and close, all without
    restitution and with Coulomb friction.  It costs some ten thousand times as much.

    Parameters
    ----------
    layout
        On flat ground or not; each domino's floor is the plane that it stands on.
    physics
        Its friction is that between dominoes.
    floor_friction
        Coulomb coefficient between dominoes and the floor, 0 or more; None turns every domino
        about its front bottom edge, as the analytic model does.
    rtol
        Steps are halved until no arrival time moves by more than half of this, relative to itself.
    times
        (F,) moments at which the pose of every domino is wanted too [s], 0 or later.

    Returns
    -------
    RigidWave
        Arrival times with an estimate of their error, what toppled, slid and opened.

    Raises
    ------
    ValueError
        For a friction, tolerance or moment out of its range.
    ArithmeticError
        Where a velocity is not a number, which no row is known to bring about.

    References
    ----------
    J. J. Moreau (1988), Unilateral contact and dry friction in finite freedom dynamics; M. Jean
    (1999), The non-smooth contact dynamics method, Comput. Methods Appl. Mech. Engrg. 177, 235-257.
    """
    begun = time.perf_counter()
    if floor_friction is not None:
        require("floor_friction", floor_friction, 0.0, hint="None for fixed pivots")
    require("rtol", rtol, 1e-5, below=1.0, hint="1e-3 is quick")
    moments = np.array(times, dtype=np.float64).reshape(-1)
    require("times", moments, 0.0, unit="s")
    if (np.diff(moments) < 0.0).any():
        raise ValueError("times: give moments in their order [s]")
    run, largest = _run(layout, physics, floor_friction, COARSEST), 0.0
    fineness = COARSEST
    while fineness > FINEST:
        fineness /= 2.0
        finer = _run(layout, physics, floor_friction, fineness)
        # an error halves with the steps; a change smaller than that may be small by chance
        largest = max(largest_difference(run.arrival_times, finer.arrival_times), 0.5 * largest)
        uncertainty = SAFETY * largest + GRAIN * fineness
        run = finer
        if uncertainty <= rtol and fineness <= COARSEST / 4.0:
            break
    if len(moments):
        run = _run(layout, physics, floor_friction, fineness, moments)
    return RigidWave(
        layout=layout,
        physics=physics,
        floor_friction=None if floor_friction is None else float(floor_friction),
        error_estimate=uncertainty,
        converged=uncertainty <= rtol,
        rtol=rtol,
        times=moments,
        run_time=time.perf_counter() - begun,
        **vars(run),
    )


def window_of(layout: Layout) -> int:
    """How many dominoes behind the leader still move in `simulate_standing`.

    Notes
    -----
    Where a contact has closed, a domino turns by about 1 - √(λ² - d²)/L of what the next one turns,
    with pitch λ, thickness d and height L: tight rows forget their stacks slowly.
    """
    pitch, thick, tall = layout.pitch, layout.thickness[1:], layout.height[:-1]
    passed = 1.0 - np.sqrt(np.maximum(pitch**2 - thick**2, 0.0)) / tall
    forgotten = np.cumsum(np.append(0.0, -np.log(np.clip(passed, 1e-3, 1.0 - 1e-3))))
    first = np.searchsorted(forgotten, forgotten + math.log(FORGOTTEN), side="right")
    return max(WINDOW, int(np.max(np.arange(layout.count) - first)) + 1)


@dataclass(frozen=True, eq=False)
class _Run:
    """One run with steps of one fineness."""

    arrival_times: Floats
    lean: Floats
    slid: Floats
    opened: Floats
    opened_at: Floats
    poses: Floats
    steps: int


def _run(
    layout: Layout, physics: Physics, floor: float | None, fineness: float, times: Floats = NEVER
) -> _Run:
    count, tallest = layout.count, float(layout.height.max())
    arrivals = np.append(0.0, np.full(count - 1, np.inf))
    moved = np.zeros(count), np.zeros(count), np.zeros(count - 1), np.zeros(count - 1)
    poses = np.zeros((len(times), count, 3))
    follow: Any = dynamics.follow
    steps, _, _ = follow(
        layout.height, layout.thickness, layout.density * layout.height * layout.thickness,
        layout.pivots, layout.tilt, physics.friction, -1.0 if floor is None else float(floor),
        physics.gravity, physics.push, fineness,
        CALM * fineness * math.sqrt(physics.gravity * tallest), window_of(layout),
        PATIENCE * math.sqrt(tallest / physics.gravity) + 2.0 / physics.push,
        times, arrivals, *moved, poses,
    )  # fmt: skip
    if steps < 0:
        raise ArithmeticError(
            f"a velocity is not a number any more after {np.isfinite(arrivals).sum()} of {count} "
            "dominoes were struck: this is a fault of the simulator, so please report the layout"
        )
    return _Run(arrivals, *moved, poses, steps)
