"""Energy: what gravity gives to a falling row, and who takes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from domino_env.core.results import brief
from domino_env.core.types import Floats, Ints
from domino_env.kernels.arrays import FLIP, SWITCH
from domino_env.physics.layout import Layout
from domino_env.physics.motion import Motion, stack_leans
from domino_env.physics.wave import simulate

STEP = 1e-6  # [rad] of the leader, by which the rates of all dominoes are found
LARGEST_PIECE = 1_000_000  # leans at once, some 100 MB


@dataclass(frozen=True, eq=False)
class Energy:
    """Energy over time, (T,) [J] each, from the row standing.

    At any instant pushed + released = kinetic + hits + flushes + friction.

    Attributes
    ----------
    time
        Instants [s], 33 from just after every hit to just before the next.
    pushed
        What the push puts in, one number [J].
    released
        Potential energy given off so far.
    kinetic
        Of all dominoes.
    hits
        What hits have taken so far.
    flushes
        What face impacts have taken so far.
    friction
        What friction has taken so far. Dominoes that fall alone count here, as the motion leaves
        them where they were lost, and so do face impacts after the last hit of a row that stops.

    Notes
    -----
    A row that runs through is followed to its last hit.
    """

    time: Floats
    pushed: float
    released: Floats
    kinetic: Floats
    hits: Floats
    flushes: Floats
    friction: Floats

    __repr__ = brief


def energies(motion: Motion) -> Energy:
    """Compute where the energy of a wave comes from and where it goes.

    Notes
    -----
    Only the leader moves freely: the kinetic energy is that of its angular velocity, as simulated,
    times the rates at which all others follow. Hits and face impacts take theirs at an instant,
    across which the kinetic energy drops. What else is gone is friction where the row rubs; without
    friction face impacts take all of it.
    """
    layout, physics = motion.layout, motion.physics
    looks = motion.samples[: layout.count - 1]
    shape = looks.shape
    leader, angle = np.repeat(np.arange(len(looks)), shape[1]), looks["angle"].ravel()
    released, inertia = (part.reshape(shape) for part in _at(layout, leader, angle, STEP, STEP))
    released *= physics.gravity
    kinetic = 0.5 * inertia * looks["speed"] ** 2
    hits = np.zeros((len(looks), 1))
    hits[1:, 0] = np.cumsum(kinetic[:-1, -1] - kinetic[1:, 0])
    pushed = float(kinetic[0, 0]) if len(looks) else 0.0
    gone = pushed + released - kinetic - hits
    flushes = gone if physics.friction == 0.0 else _taken_by_flushes(motion, looks)
    time = motion.starts[: len(looks), None] + looks["time"]
    hits = np.repeat(hits, shape[1], axis=1)
    series = released, kinetic, hits, flushes, gone - flushes
    return Energy(time.ravel(), pushed, *(values.ravel() for values in series))


def _at(
    layout: Layout, leader: Ints, angle: Floats, back: float, on: float
) -> tuple[Floats, Floats]:
    """Potential energy given off over gravity [kg m], and inertia at the leader [kg m²].

    Rates are differences from `back` to `on` about the angle of the leader [rad].
    """
    mass = layout.density * layout.height * layout.thickness * layout.width
    own = mass * (layout.height**2 + layout.thickness**2) / 3.0
    standing = _centres(layout, layout.tilt)
    fallen, inertia = np.empty(len(leader)), np.empty(len(leader))
    piece = max(1, LARGEST_PIECE // layout.count)
    for first in range(0, len(leader), piece):
        part = slice(first, first + piece)
        n, lean = leader[part], angle[part] + layout.tilt[leader[part]]
        low, high = stack_leans(layout, n, lean - back), stack_leans(layout, n, lean + on)
        centres = 0.5 * (_centres(layout, low) + _centres(layout, high))
        fallen[part] = (standing - centres) @ mass
        inertia[part] = ((high - low) / (back + on)) ** 2 @ own
    return fallen, inertia


def _centres(layout: Layout, leans: Floats) -> Floats:
    """How far the centres lie above their pivots [m]."""
    return np.asarray(0.5 * (layout.height * np.cos(leans) + layout.thickness * np.sin(leans)))


def _taken_by_flushes(motion: Motion, looks: Any) -> Floats:
    """What face impacts have taken so far [J], at every look."""
    tape: Any = simulate(motion.layout, motion.physics, gradient=True).tape
    tape = tape[tape["kind"] != FLIP]
    at = np.flatnonzero((tape["kind"][:-1] == SWITCH) & tape["flushed"][:-1])
    leader, angle, before = (tape[name][at] for name in ("leader", "angle", "u"))
    after = tape["u"][at + 1]
    # the angle is known to some 1e-12; an impact is a jump of the rates
    first, last = 2.0 * STEP, -0.5 * STEP
    _, rate_before = _at(motion.layout, leader, angle, first, last)
    _, rate_after = _at(motion.layout, leader, angle, last, first)
    taken = np.zeros(looks.shape)
    for n, place, energy in zip(
        leader, angle, 0.5 * (rate_before * before - rate_after * after), strict=True
    ):
        if n < len(looks):
            taken[n, min(np.searchsorted(looks["angle"][n], place), looks.shape[1] - 1)] += energy
    return np.cumsum(taken).reshape(looks.shape)
