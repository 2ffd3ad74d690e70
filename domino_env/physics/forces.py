"""Contact forces, impulses and floor friction of a wave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from domino_env.core.results import dataclass_repr
from domino_env.core.types import Floats
from domino_env.kernels.diagnosis import LOADS, diagnose_chain
from domino_env.physics.gradient import arrays_from
from domino_env.physics.layout import Layout
from domino_env.physics.physics import STANDARD, Physics, require_arguments
from domino_env.physics.wave import Outcome, checked_setting


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Forces and losses of a wave, which show where the model's assumptions fail.

    Values are nan for dominoes that the wave did not reach.

    Attributes
    ----------
    outcome
        Reason why the wave ended.
    least_contact_force
        (N-1,) smallest force between domino i and i+1 while they touch [N]; negative where the
        model keeps a contact closed that would separate.
    least_hit_impulse
        (N-1,) smallest impulse of that contact in hits [N s]; negative in the same case.
    least_flush_impulse
        (N-1,) smallest impulse of that contact in face impacts [N s]; negative in the same case,
        nan where there was none.
    floor_friction
        (N,) smallest coefficient of friction with the floor that keeps the pivot from sliding; inf
        where the pivot is not pressed onto the ground.
    least_load
        (N,) smallest load on the pivot, normal to the ground, over the domino's weight; negative
        where the pivot would lift off.
    flush_loss
        (N,) largest fraction of the leader's speed lost in one face impact while domino i led.
    stall_margin
        (N,) lowest u = ω² over its value just after the hit, while domino i led.

    Notes
    -----
    Forces are evaluated at 17 angles of each interval between hits, impulses at every hit and, of
    several face impacts within a sixteenth of an interval, at the last.
    """

    outcome: Outcome
    least_contact_force: Floats
    least_hit_impulse: Floats
    least_flush_impulse: Floats
    floor_friction: Floats
    least_load: Floats
    flush_loss: Floats
    stall_margin: Floats

    __repr__ = dataclass_repr


def diagnose(layout: Layout, physics: Physics = STANDARD, rtol: float = 1e-8) -> Diagnosis:
    """Compute contact forces and impulses, floor friction and losses in face impacts of a wave.

    Forces of dominoes more than 400 behind the leader are neglected.

    Parameters
    ----------
    layout
        The layout.
    physics
        Friction, gravity and push; by default those of `Physics()`.
    rtol
        Relative error allowed in the arrival times, as for `simulate`.

    Returns
    -------
    Diagnosis
        Values per domino.

    Raises
    ------
    TypeError
        For a layout or physics of another type.
    ValueError
        For `rtol` out of its range.
    """
    require_arguments(layout, physics)
    loads = np.full(layout.count, np.nan, LOADS)
    extremes = dict.fromkeys(("contact_force", "hit_impulse", "flush_impulse", "load"), np.inf)
    extremes["floor_friction"] = -np.inf
    for name, unreached in extremes.items():
        loads[name] = unreached
    outcome = diagnose_chain(arrays_from(layout), checked_setting(physics, rtol), loads)
    for name, unreached in extremes.items():
        loads[name][loads[name] == unreached] = np.nan
    # forces and impulses of the kernels are per width
    return Diagnosis(
        outcome=Outcome(outcome),
        least_contact_force=loads["contact_force"][:-1] * layout.width,
        least_hit_impulse=loads["hit_impulse"][:-1] * layout.width,
        least_flush_impulse=loads["flush_impulse"][:-1] * layout.width,
        floor_friction=loads["floor_friction"],
        least_load=loads["load"],
        flush_loss=loads["flush_loss"],
        stall_margin=loads["margin"],
    )
