"""Energy balance of a falling chain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from domino_env.core.types import Floats
from domino_env.kernels.arrays import FLIP, SWITCH
from domino_env.physics.motion import PIECES, Motion, stack_sums
from domino_env.physics.wave import simulate

STEP = 1e-6  # [rad] step of the leader's angle in the finite differences of all other leans


@dataclass(frozen=True, eq=False)
class Energy:
    """Energy balance of a wave over time, arrays (T,).

    At any instant pushed + released = kinetic + hits + flushes + friction. A wave that completes is
    followed to its last hit.

    Attributes
    ----------
    time
        Instants [s], 33 from just after every hit to just before the next.
    pushed
        Energy of the push [J], a single number.
    released
        Potential energy released so far [J].
    kinetic
        Kinetic energy of all dominoes [J].
    hits
        Energy lost in hits so far [J].
    flushes
        Energy lost in face impacts so far [J].
    friction
        Energy lost to friction so far [J]. It includes the kinetic energy of dominoes behind a
        separated contact, whose motion is not computed, and losses in face impacts after the last
        hit of a wave that stops.
    """

    time: Floats
    pushed: float
    released: Floats
    kinetic: Floats
    hits: Floats
    flushes: Floats
    friction: Floats


def energies(motion: Motion) -> Energy:
    """Compute the energy balance of a wave.

    Parameters
    ----------
    motion
        Motion of all dominoes in the wave.

    Returns
    -------
    Energy
        The terms of the balance.

    Notes
    -----
    The kinetic energy is ½ I ω²: ω is the simulated angular velocity of the leader, and the inertia
    I contains the rates at which all other dominoes follow it. Hits and face impacts are
    instantaneous, and the kinetic energy drops across them. The difference that is left in the
    balance is the loss to friction; without friction it is the loss in face impacts.
    """
    layout, physics = motion.layout, motion.physics
    samples = motion.samples[: layout.count - 1]
    shape, leader = samples.shape, np.repeat(np.arange(len(samples)), PIECES + 1)
    sums = stack_sums(layout, leader, samples["angle"].ravel(), STEP, STEP)
    released, inertia = (values.reshape(shape) for values in sums)
    released *= physics.gravity
    kinetic = 0.5 * inertia * samples["speed"] ** 2
    hits = np.zeros(shape)
    hits[1:] = np.cumsum(kinetic[:-1, -1] - kinetic[1:, 0])[:, None]
    pushed = float(kinetic[0, 0]) if len(samples) else 0.0
    lost = pushed + released - kinetic - hits
    flushes = lost if physics.friction == 0.0 else _face_impact_losses(motion)
    time = motion.starts[: len(samples), None] + samples["time"]
    series = released, kinetic, hits, flushes, lost - flushes
    return Energy(time.ravel(), pushed, *(values.ravel() for values in series))


def _face_impact_losses(motion: Motion) -> Floats:
    """Return the energy lost in face impacts so far [J], at every sample of the motion."""
    tape: Any = simulate(motion.layout, motion.physics, gradient=True).tape
    tape = tape[tape["kind"] != FLIP]  # the event after a SWITCH then has u = ω² after it
    samples = motion.samples[: motion.layout.count - 1]
    is_flush = (tape["kind"][:-1] == SWITCH) & tape["is_flush"][:-1]
    impact = np.flatnonzero(is_flush & (tape["leader"][:-1] < len(samples)))
    leader, angle = tape["leader"][impact], tape["angle"][impact]
    # Rates jump at an impact, whose angle is known to some 1e-12 rad: no difference spans it.
    near, far = 0.5 * STEP, 2.0 * STEP
    _, inertia_before = stack_sums(motion.layout, leader, angle, far, -near)
    _, inertia_after = stack_sums(motion.layout, leader, angle, -near, far)
    losses = 0.5 * (inertia_before * tape["u"][impact] - inertia_after * tape["u"][impact + 1])
    lost = np.zeros(samples.shape)
    next_sample = np.minimum((samples["angle"][leader] < angle[:, None]).sum(axis=1), PIECES)
    np.add.at(lost, (leader, next_sample), losses)
    return np.cumsum(lost).reshape(lost.shape)
