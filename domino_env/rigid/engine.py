"""Third-party engine: the same layout in Chipmunk (pymunk), which shares no code with the model.

Every domino is a box with its mass and moment of inertia; neighbours collide without restitution
and with the friction of the physics. With fixed pivots each domino turns about its front bottom
edge, as in the model, and a stop keeps it from leaning back. On a floor it may slide and lift. On
uneven ground each domino stands on a separate plank along the chord under its base, so that boxes
cannot catch on joints. The engine computes in millimetres, as its tolerances are meant for numbers
near one.

In every step the engine's contact solver makes a fixed number of sweeps over all contacts. The
impulse of a face impact acts on the whole stack, which bounces back if the sweeps are too few.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from domino_env.core.checks import require_extra
from domino_env.core.progress import progress_bar
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.rigid import dynamics, simulation

MM = 1000.0  # millimetres in a metre
KINDS = 32  # bits of a collision filter: domino i collides with i ± 1; half are for planks, if any
PLANK = 1.5  # [heights] length before and behind a pivot, where a domino may come to lie
OVERLAP = 1e-4  # [mm] overlap of faces that the engine tolerates
DEPTH = 10.0  # [mm] thickness of a floor or plank
RTOL = 5e-4  # relative error allowed in the arrival times
STEPS = (8e-5, 4e-5, 2e-5)  # [s] time steps, of which the last is not always needed
SWEEPS, MAX_SWEEPS = 60, 1920  # first and largest number of sweeps in a step


def simulate_in_engine(
    layout: Layout, physics: Physics, floor_friction: float | None, progress: bool | None = False
) -> simulation.RigidWave:
    """Simulate in Chipmunk, with more sweeps and finer steps until the arrival times converge.

    At the coarsest step the sweeps are doubled until no arrival time changes by more than half of
    `RTOL`. Then the steps become finer until the limit, extrapolated linearly from the two finest
    steps to a step of zero, converges. The error estimate is the change by the last doubling plus
    the change of the limit by the last step. With two steps only, the latter is the difference of
    the limit from the result of the finer step.

    Parameters
    ----------
    layout, physics, floor_friction, progress
        As for `simulate_standing`.

    Returns
    -------
    RigidWave
        Arrival times and leans; slips and openings are nan. `lean` is the last angle, not the
        largest.

    Raises
    ------
    ImportError
        If pymunk is missing; the message has the command that installs it.
    """
    start_time = time.perf_counter()
    window = simulation.window_size(layout)

    def run(step: float, sweeps: int) -> tuple[Floats, Floats]:
        place = simulation.floor_name(floor_friction)
        description = f"engine, {place}, {1e6 * step:g} µs, {sweeps} sweeps"
        with progress_bar(
            progress, total=layout.count, desc=description, unit=" dominoes", leave=False, delay=1.0
        ) as bar:
            return run_engine(layout, physics, floor_friction, step, sweeps, window, bar.update)

    sweeps, change = min(SWEEPS, MAX_SWEEPS), math.inf
    times, lean = run(STEPS[0], sweeps)
    while change > 0.5 * RTOL and 2 * sweeps <= MAX_SWEEPS:
        sweeps *= 2
        before, (times, lean) = times, run(STEPS[0], sweeps)
        change = simulation.largest_difference(before, times)
    limit, uncertainty, finest = times, math.inf, STEPS[0]
    for k, step in enumerate(STEPS[1:]):
        coarse, (times, lean) = times, run(step, sweeps)
        before = limit if k else times
        hit = np.isfinite(coarse) & np.isfinite(times)
        limit = np.full(layout.count, np.inf)
        limit[hit] = times[hit] + (times[hit] - coarse[hit]) * step / (finest - step)
        finest, uncertainty = step, change + simulation.largest_difference(limit, before)
        if uncertainty <= RTOL:
            break
    unknown = np.full(layout.count, np.nan)
    steps = math.ceil(float(np.max(times[np.isfinite(times)])) / finest)
    return simulation.RigidWave(
        layout, physics, floor_friction, arrival_times=limit, lean=lean, slid=unknown,
        opened=unknown[1:], opened_at=unknown[1:], error_estimate=uncertainty,
        converged=uncertainty <= RTOL, rtol=RTOL, steps=steps,
        run_time=time.perf_counter() - start_time, simulator=engine_name(),
    )  # fmt: skip


def run_engine(
    layout: Layout,
    physics: Physics,
    floor_friction: float | None,
    step: float,
    sweeps: int,
    window: int | None = None,
    on_hit: Callable[[], object] = lambda: None,
) -> tuple[Floats, Floats]:
    """Simulate in Chipmunk with one step, until the last domino topples or comes to rest.

    A wave that stops ends the simulation, too.

    Parameters
    ----------
    layout, physics, floor_friction
        As for `simulate_standing`.
    step
        Time step [s].
    sweeps
        Number of sweeps of the contact solver in every step.
    window
        Number of dominoes behind the leader that still move; those further back are removed, to
        save time. None keeps all.
    on_hit
        Function without arguments that is called whenever a domino is hit.

    Returns
    -------
    tuple of ndarray
        Arrival times (N,) [s], at which the tip of the domino before reaches the rear face; leans
        (N,) [rad] at the end, or when the domino was removed.
    """
    space = _Space(layout, physics, sweeps, floor_friction)
    arrivals = np.full(layout.count, np.inf)
    arrivals[0] = 0.0
    patience = simulation.longest_wait(layout, physics)
    now, leader, before = 0.0, 0, space.tip_distance(0) if layout.count > 1 else 0.0
    while leader < layout.count - 1:
        space.advance(step)
        after = space.tip_distance(leader)
        now += step
        if after <= 0.0:
            leader += 1
            arrivals[leader] = now - step * after / (after - before)
            on_hit()
            if leader == layout.count - 1:
                break
            space.place_up_to(leader + 1)
            if window is not None:
                space.remove_up_to(leader - window - 1)
            after = space.tip_distance(leader)
        elif now - arrivals[leader] > patience:
            break
        before = after
    if np.isfinite(arrivals[-1]):
        space.let_last_fall(step, patience)
    lean = np.zeros(layout.count)
    lean[: len(space.bodies)] = [-body.angle for body in space.bodies]
    return arrivals, lean


class _Space:
    """Space of the engine, in which dominoes are placed shortly before the wave reaches them."""

    def __init__(self, layout: Layout, physics: Physics, sweeps: int, floor: float | None) -> None:
        self._pymunk = pymunk = _engine()
        self._layout, self._fixed = layout, floor is None
        self._space = space = pymunk.Space()
        space.gravity = (0.0, -physics.gravity * MM)
        space.iterations, space.collision_slop = sweeps, OVERLAP
        self.bodies: list[Any] = []
        self._removed_count = 0
        self.advance: Callable[[float], None] = space.step
        # The engine multiplies the coefficients of two bodies. That of dominoes must not be 0, as
        # that of the floor is divided by it.
        self._friction = math.sqrt(max(physics.friction, 1e-6))
        self._floor = None if floor is None else floor / self._friction
        # of each domino, from its pivot and along the ground to the axes of the space [mm]
        self._frames = [
            pymunk.Transform.translation(x * MM, y * MM) @ pymunk.Transform.rotation(-tilt)
            for (x, y), tilt in zip(layout.pivots.tolist(), layout.tilt.tolist(), strict=True)
        ]
        if layout.is_flat:
            reach = 2.0 * float(layout.height.max())
            self._add_floor(self._frames[0], -reach * MM, (layout.length + reach) * MM, None)
        self.place_up_to(min(1, layout.count - 1))
        first = self.bodies[0]
        centre = first.position - self._frames[0] @ (0.0, 0.0)
        first.angular_velocity = -physics.push
        first.velocity = physics.push * centre.y, -physics.push * centre.x

    def place_up_to(self, last: int) -> None:
        """Place the dominoes up to this one."""
        pymunk, layout = self._pymunk, self._layout
        for i in range(len(self.bodies), last + 1):
            height, thickness = float(layout.height[i]) * MM, float(layout.thickness[i]) * MM
            mass, frame = float(layout.density[i] * height * thickness), self._frames[i]
            body = pymunk.Body(mass, mass * (height * height + thickness * thickness) / 12.0)
            body.position = frame @ (-thickness / 2.0, height / 2.0)
            body.angle = -float(layout.tilt[i])
            shape = pymunk.Poly.create_box(body, (thickness, height))
            shape.friction, shape.elasticity = self._friction, 0.0
            kinds = KINDS if layout.is_flat else KINDS // 2
            kind = 1 << i % kinds
            partners = 1 << (i - 1) % kinds | 1 << (i + 1) % kinds
            if not layout.is_flat:
                plank = pymunk.ShapeFilter(categories=kind << kinds, mask=kind)
                partners |= kind << kinds
                self._add_floor(frame, -PLANK * height, PLANK * height, plank)
            shape.filter = pymunk.ShapeFilter(categories=kind, mask=partners)
            self._space.add(body, shape)
            if self._fixed:
                static = self._space.static_body
                hinge = pymunk.PivotJoint(static, body, frame @ (0.0, 0.0))
                stop = pymunk.RotaryLimitJoint(static, body, -math.pi, body.angle)
                hinge.collide_bodies = stop.collide_bodies = False
                self._space.add(hinge, stop)
            self.bodies.append(body)

    def _add_floor(self, frame: Any, begin: float, end: float, plank: Any) -> None:
        """Add a floor from begin to end [mm] along the first axis of a frame.

        plank: filter of its collisions; None if it collides with every domino.
        """
        if self._floor is None:
            return
        corners = [(begin, -DEPTH), (end, -DEPTH), (end, 0.0), (begin, 0.0)]
        ground = self._pymunk.Poly(self._space.static_body, corners, frame)
        ground.friction = self._floor
        if plank is not None:
            ground.filter = plank
        self._space.add(ground)

    def remove_up_to(self, last: int) -> None:
        """Remove the dominoes up to this one; held in place instead, they would push others."""
        for body in self.bodies[self._removed_count : max(last + 1, 0)]:
            self._space.remove(*body.constraints, *body.shapes, body)
            self._removed_count += 1

    def let_last_fall(self, step: float, patience: float) -> None:
        """Advance until the last domino passes its tipping angle or rests for `patience` [s]."""
        last, furthest, resting = self.bodies[-1], 0.0, 0.0
        tipping = math.atan2(self._layout.thickness[-1], self._layout.height[-1])
        while resting < patience and -last.angle <= tipping:
            self.advance(step)
            resting = 0.0 if -last.angle > furthest + dynamics.AT_REST else resting + step
            furthest = max(furthest, -last.angle)

    def tip_distance(self, i: int) -> float:
        """Return the distance from the tip of i to the rear face of i+1, which stands [mm]."""
        layout, frame = self._layout, self._frames[i + 1]
        half = float(layout.thickness[i]) * MM / 2.0, float(layout.height[i]) * MM / 2.0
        tip = self.bodies[i].local_to_world(half) - (frame.tx, frame.ty)
        return float(-tip.dot((frame.a, frame.b)) - layout.thickness[i + 1] * MM)


def engine_name() -> str:
    """Return name and version of the engine.

    Raises
    ------
    ImportError
        If pymunk is missing; the message has the command that installs it.
    """
    return f"pymunk {_engine().version}"


def _engine() -> Any:
    require_extra("the third-party engine", "verify", "pymunk")
    import pymunk

    return pymunk
