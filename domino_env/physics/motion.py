"""Motion: positions of all dominoes of a falling chain at any instant."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from domino_env import kernels
from domino_env.core.types import Floats, Ints
from domino_env.physics import footing
from domino_env.physics.gradient import arrays_of
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics

PIECES = 32  # equal steps of angle between two samples of a fall


class Motion:
    """Lean of every domino of a chain over time.

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
        Time at which all that moves has come to rest or lies flat [s]; nothing moves afterwards.
    starts
        Times at which each domino begins to lead [s], and the end, shape (F+1,).
    samples
        The leader at equal steps of angle in each interval between hits, shape (F, 33): `angle`
        [rad] from upright to its ground, `time` [s] since it was hit, `speed` [rad/s].

    Notes
    -----
    The leader's angle is interpolated between 33 samples of each of its falls (to some 1e-4 rad, at
    the kinks that face impacts make); all others follow from it by their contacts. What the model
    does not follow keeps its last position: dominoes behind a separated contact, a leader that has
    stalled.
    """

    def __init__(self, layout: Layout, physics: Physics, rtol: float = 1e-8) -> None:
        self.layout, self.physics = layout, physics
        snapshots = np.zeros((layout.count, PIECES + 1), kernels.SNAPSHOT)
        falls = kernels.trace_motion(
            arrays_of(layout), physics.friction, physics.gravity, physics.push, rtol, snapshots
        )
        self.samples = snapshots[:falls]
        self.starts = np.concatenate(([0.0], np.cumsum(self.samples["time"][:, -1])))
        self.end = float(self.starts[-1])

    def leader(self, times: ArrayLike) -> tuple[Ints, Floats]:
        """Return the leading domino at each instant and its lean from the vertical.

        Parameters
        ----------
        times
            (T,) instants since the push [s].

        Returns
        -------
        tuple of ndarray
            Index of the leader (T,) and its lean (T,) [rad].
        """
        t = np.clip(np.asarray(times, dtype=np.float64), 0.0, self.end)
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
            (T,) instants since the push [s].

        Returns
        -------
        ndarray
            Leans (T, N) [rad].
        """
        n, angle = self.leader(np.atleast_1d(np.asarray(times, dtype=np.float64)))
        return stack_leans(self.layout, n, angle)


def stack_leans(layout: Layout, leader: Ints, angle: Floats) -> Floats:
    """Return the leans of all dominoes of a chain whose leader leans by a given angle.

    Those ahead of the leader stand upright to their ground. Contacts are those of the model: a tip
    slides down until the faces meet, then the front face rests on the rear edge, until the contact
    separates. Angles only grow, so each lean determines its contact.

    Parameters
    ----------
    layout
        The layout that topples.
    leader
        (T,) index of the leading domino.
    angle
        (T,) lean of the leader from the vertical [rad].

    Returns
    -------
    ndarray
        Leans from the vertical (T, N) [rad].

    References
    ----------
    J. M. J. van Leeuwen, The domino effect (2004), arXiv physics/0401018;
    Chapman, The physics of toppling dominoes, eq. 1.
    """
    leans = np.tile(layout.tilt, (len(leader), 1))
    leans[np.arange(len(leader)), leader] = angle
    rises = footing.steps(layout.spacing, layout.thickness, layout.rise, layout.tilt)
    order = np.argsort(leader, kind="stable")
    lean, last = angle[order], int(leader.max())
    starts = np.searchsorted(leader[order], np.arange(last), side="right")
    for i in range(last - 1, -1, -1):  # each contact is seen from the ground of the domino ahead
        behind, stand, length = slice(starts[i], None), layout.tilt[i + 1], layout.height[i]
        d, e = layout.thickness[i + 1] / length, rises[i] / length
        p = layout.spacing[i] / length + d
        # p cos ψ - e sin ψ = r cos(ψ + slant) falls; a contact that separated stays as it was
        r, slant = math.hypot(p, e), math.atan2(e, p)
        lowest = (r * r + d * d - 1.0) / (2.0 * d * r)
        separation = math.acos(min(max(lowest, -1.0), 1.0)) - slant
        psi = np.minimum(lean[behind] - stand, separation)
        gap = r * np.cos(psi + slant) - d
        tip = psi + np.arcsin(np.clip(gap, -1.0, 1.0))
        corner = np.arctan2(p - d * np.cos(psi), e + d * np.sin(psi))
        lean[behind] = np.where(gap < 0.0, corner, tip) + stand
        leans[order[behind], i] = lean[behind]
    return leans


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
        domino turns), top front, top rear, bottom rear.
    """
    up = np.stack([np.sin(leans), np.cos(leans)], axis=-1) * layout.height[:, None]
    back = np.stack([-np.cos(leans), np.sin(leans)], axis=-1) * layout.thickness[:, None]
    foot = layout.pivots
    return np.stack([foot, foot + up, foot + up + back, foot + back], axis=1)


def _hermite(t: Floats, times: Floats, values: Floats, slopes: Floats) -> Floats:
    """Interpolate a table by cubics that match its values and slopes."""
    i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    h = times[i + 1] - times[i]
    x = np.clip((t - times[i]) / np.where(h > 0.0, h, 1.0), 0.0, 1.0)
    y = 1.0 - x
    return np.asarray(
        values[i] * y * y * (1.0 + 2.0 * x)
        + values[i + 1] * x * x * (1.0 + 2.0 * y)
        + h * x * y * (slopes[i] * y - slopes[i + 1] * x)
    )
