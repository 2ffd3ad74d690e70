"""Motion: positions of all dominoes of a toppling chain at any time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.checks import numbers, require
from domino_env.core.types import Floats, Ints
from domino_env.kernels.arrays import SNAPSHOT
from domino_env.kernels.diagnosis import trace_motion
from domino_env.kernels.jit import compile_alone
from domino_env.physics import footing
from domino_env.physics.gradient import arrays_from
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics, require_arguments
from domino_env.physics.wave import checked_setting

PIECES = 32  # equal steps of the leader's angle in each interval between hits


class Motion:
    """Leans of all dominoes of a chain over time.

    Parameters
    ----------
    layout
        The layout that topples.
    physics
        Friction, gravity and push.
    rtol
        Relative error allowed in the times, as for `simulate`.

    Attributes
    ----------
    end
        Time at which the last leader lies almost flat or has stalled [s]; nothing moves afterwards.
    starts
        Times at which each leading domino begins to fall [s], and the end, shape (F+1,).
    samples
        Leader at equal steps of its angle in each of F intervals between hits, (F, 33) records:
        `angle` from its pose at rest [rad], `time` since it was hit [s], `speed` [rad/s].

    Raises
    ------
    TypeError
        For a layout or physics of another type.
    ValueError
        For `rtol` out of its range.

    Notes
    -----
    The leader's angle is interpolated between its 33 samples; the largest errors, some 1e-4 rad,
    are those at face impacts. All other leans follow from it by the contacts. Dominoes behind a
    separated contact, and a leader that has stalled, keep their last position.
    """

    def __init__(self, layout: Layout, physics: Physics, rtol: float = 1e-8) -> None:
        require_arguments(layout, physics)
        self.layout, self.physics = layout, physics
        snapshots = np.zeros((layout.count, PIECES + 1), SNAPSHOT)
        falls = trace_motion(arrays_from(layout), checked_setting(physics, rtol), snapshots)
        self.samples = snapshots[:falls]
        self.starts = np.concatenate(([0.0], np.cumsum(self.samples["time"][:, -1])))
        self.end = float(self.starts[-1])

    def leader(self, times: ArrayLike) -> tuple[Ints, Floats]:
        """Return the leading domino at each time and its lean from the vertical.

        Parameters
        ----------
        times
            (T,) times since the push [s].

        Returns
        -------
        tuple of ndarray
            Index of the leader (T,) and its lean (T,) [rad].

        Raises
        ------
        ValueError
            For times that are not finite, or another shape.
        """
        require("times", t := numbers("times", times, shape=("T",)), unit="s", array=True)
        t = np.clip(t, 0.0, self.end)
        n = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, len(self.samples) - 1)
        angle = np.empty(len(t))
        for k in np.unique(n):
            at, fall = n == k, self.samples[k]
            angle[at] = _hermite(t[at] - self.starts[k], fall["time"], fall["angle"], fall["speed"])
        return n, angle + self.layout.tilt[n]

    def angles(self, times: ArrayLike) -> Floats:
        """Return the lean of every domino from the vertical.

        Parameters
        ----------
        times
            (T,) times since the push [s].

        Returns
        -------
        ndarray
            Leans (T, N) [rad].

        Raises
        ------
        ValueError
            For times that are not finite, or another shape.
        """
        n, angle = self.leader(np.atleast_1d(numbers("times", times)))
        return stack_leans(self.layout, n, angle)


def stack_leans(layout: Layout, leader: Ints, angle: Floats) -> Floats:
    """Return the leans of all dominoes of a chain whose leader leans by a given angle.

    Dominoes ahead of the leader are at rest. Contacts are those of the model: a tip slides down the
    next rear face until the faces meet, then the front face rests on the next rear bottom edge
    until the contact separates. Leans only grow, so each lean determines its contact.

    Parameters
    ----------
    layout
        The layout that topples.
    leader
        (T,) index of the leading domino, 0 to N - 1.
    angle
        (T,) lean of the leader from the vertical [rad].

    Returns
    -------
    ndarray
        Leans from the vertical (T, N) [rad].

    Raises
    ------
    ValueError
        For indices that are not those of dominoes, and arrays of another shape.

    References
    ----------
    J. M. J. van Leeuwen, The domino effect (2004), arXiv physics/0401018;
    Chapman, The physics of toppling dominoes, eq. 1.
    """
    leader, angle = _leaders(layout, leader, angle)
    leans = np.tile(layout.tilt, (len(leader), 1))
    _lean_stacks(_contacts(layout), leader, angle, leans)
    return leans


def stack_sums(
    layout: Layout, leader: Ints, angle: Floats, backward: float, forward: float
) -> tuple[Floats, Floats]:
    """Compute the potential energy that a chain has released, and its effective inertia.

    Parameters
    ----------
    layout
        The layout that topples.
    leader
        (T,) index of the leading domino, 0 to N - 1.
    angle
        (T,) angle of the leader from its pose at rest [rad].
    backward, forward
        Steps of this angle to both sides [rad]; rates of all leans are differences between them.

    Returns
    -------
    released : ndarray
        Potential energy over gravity (T,) [kg m].
    inertia : ndarray
        Effective inertia (T,) [kg m²]: twice the kinetic energy over the square of the leader's
        angular velocity.

    Raises
    ------
    ValueError
        For indices that are not those of dominoes, and arrays of another shape.
    """
    leader, angle = _leaders(layout, leader, angle)
    mass = layout.density * layout.height * layout.thickness * layout.width
    inertias = mass * (layout.height**2 + layout.thickness**2) / 3.0
    bodies = np.stack([layout.height, layout.thickness, layout.tilt, mass, inertias], axis=1)
    sums = np.empty((2, len(leader)))
    lean = angle + layout.tilt[leader]
    _sum_stacks(_contacts(layout), bodies, leader, lean - backward, lean + forward, sums)
    return sums[0], sums[1]


def _leaders(layout: Layout, leader: ArrayLike, angle: ArrayLike) -> tuple[Ints, Floats]:
    """Return leading dominoes (T,) and their angles, which compiled code reads unchecked."""
    numbers("leader", n := np.asarray(leader), None, ("T",))
    require("leader", n, 0, layout.count - 1, whole=True, array=True)
    return n.astype(np.int64, copy=False), numbers("angle", angle, None, n.shape)


def _contacts(layout: Layout) -> Floats:
    """Return the geometry of the contacts (N-1, 7), lengths over the height of the domino behind.

    p, e: pivot ahead, along the ground under it and normal to it; d: thickness of the domino ahead;
    r, slant: p and e in polar form; separation: angle ψ at which the contact separates [rad];
    stand: tilt ahead [rad]. ψ is the angle of the domino ahead from its pose at rest.
    """
    length, stand = layout.height[:-1], layout.tilt[1:]
    d = layout.thickness[1:] / length
    p = layout.spacing / length + d
    e = footing.normal_rises(layout.spacing, layout.thickness, layout.rise, layout.tilt) / length
    r, slant = np.hypot(p, e), np.arctan2(e, p)
    cosine = (r * r + d * d - 1.0) / (2.0 * d * r)
    separation = np.arccos(np.clip(cosine, -1.0, 1.0)) - slant
    return np.stack([p, e, d, r, slant, separation, stand], axis=1)


@compile_alone
def _lean_behind(contact: Floats, lean: Any) -> Any:
    """Return the lean of the domino behind a contact from that of the domino ahead."""
    p, e, d, r, slant, separation, stand = contact
    psi = min(lean - stand, separation)  # the domino behind a separated contact keeps its lean
    # p cos ψ - e sin ψ - d, which decreases with ψ: for a tip contact the sine of the lean relative
    # to the domino ahead, negative for a corner contact
    sine = r * math.cos(psi + slant) - d
    if sine < 0.0:
        return math.atan2(p - d * math.cos(psi), e + d * math.sin(psi)) + stand
    return psi + math.asin(min(sine, 1.0)) + stand


@compile_alone
def _lean_stacks(contacts: Floats, leader: Ints, angle: Floats, leans: Floats) -> None:
    """Write the leans of all dominoes up to the leader; see `stack_leans`."""
    for t in range(len(leader)):
        lean = leans[t, leader[t]] = angle[t]
        for i in range(leader[t] - 1, -1, -1):
            lean = leans[t, i] = _lean_behind(contacts[i], lean)


@compile_alone
def _sum_stacks(
    contacts: Floats, bodies: Floats, leader: Ints, first: Floats, last: Floats, sums: Floats
) -> None:
    """Write the sums of `stack_sums`; first, last: leans of the leader at both ends of a step.

    Far behind the leader leans do not change from one time to the next. The sums of these dominoes
    are kept, so that the computation takes a time proportional to the length of the chain.
    """
    count = len(bodies)
    # nan: not computed yet, unequal to every lean
    leans, totals = np.full((count, 2), np.nan), np.zeros((count + 1, 2))
    for t in range(len(leader)):
        i, low, high = leader[t], first[t], last[t]
        step = high - low
        while i >= 0 and not (leans[i, 0] == low and leans[i, 1] == high):
            leans[i, 0], leans[i, 1] = low, high
            i -= 1
            if i >= 0:
                low, high = _lean_behind(contacts[i], low), _lean_behind(contacts[i], high)
        for k in range(i + 1, leader[t] + 1):
            height, thickness, tilt, mass, inertia = bodies[k]
            # twice the drop of the centre of mass, from rest to the mean of both leans
            fallen = height * math.cos(tilt) + thickness * math.sin(tilt)
            for lean in leans[k]:
                fallen -= 0.5 * (height * math.cos(lean) + thickness * math.sin(lean))
            totals[k + 1, 0] = totals[k, 0] + 0.5 * mass * fallen
            rate = (leans[k, 1] - leans[k, 0]) / step
            totals[k + 1, 1] = totals[k, 1] + inertia * rate * rate
        sums[:, t] = totals[leader[t] + 1]


def outlines(layout: Layout, leans: Floats) -> Floats:
    """Return the corners of every domino.

    Parameters
    ----------
    layout
        The layout.
    leans
        (N,) leans from the vertical [rad].

    Returns
    -------
    ndarray
        Corners (N, 4, 2) [m], x forward and z up, in the order front bottom edge (about which the
        domino topples), top front, top rear, bottom rear.
    """
    up = np.stack([np.sin(leans), np.cos(leans)], axis=-1) * layout.height[:, None]
    back = np.stack([-np.cos(leans), np.sin(leans)], axis=-1) * layout.thickness[:, None]
    pivots = layout.pivots
    return np.stack([pivots, pivots + up, pivots + up + back, pivots + back], axis=1)


def _hermite(t: Floats, times: Floats, values: Floats, derivatives: Floats) -> Floats:
    """Interpolate a table by cubics that match values and derivatives."""
    i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    h = times[i + 1] - times[i]
    x = np.clip((t - times[i]) / np.where(h > 0.0, h, 1.0), 0.0, 1.0)
    y = 1.0 - x
    return np.asarray(
        values[i] * y * y * (1.0 + 2.0 * x)
        + values[i + 1] * x * x * (1.0 + 2.0 * y)
        + h * x * y * (derivatives[i] * y - derivatives[i + 1] * x)
    )
