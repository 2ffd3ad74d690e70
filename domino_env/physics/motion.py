"""Motion: where every domino of a falling row is, at any instant."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env import kernels
from domino_env.physics import footing
from domino_env.physics.gradient import arrays_of
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PIECES = 32  # looks at every fall


class Motion:
    """The lean of every domino of a row over time.

    Parameters
    ----------
    layout
        What stands.
    physics
        What makes it fall.

    Attributes
    ----------
    end
        When all that moves has come to rest or lies flat [s]; nothing moves afterwards.
    starts
        When each domino begins to lead [s], and the end, (F+1,).
    samples
        The leader at equal steps of angle in each interval between hits, (F, 33): `angle` [rad]
        from upright to its ground, `time` [s] since it was hit, `speed` [rad/s].

    Notes
    -----
    The leader's angle is interpolated between 32 looks at each of its falls (to some 1e-4 rad, at
    the kinks that flushes make); all others follow from it by their contacts. What the model does
    not follow stays where it was lost: dominoes behind a released link, a leader that has stalled.
    """

    def __init__(self, layout: Layout, physics: Physics, rtol: float = 1e-8) -> None:
        self.layout, self.physics = layout, physics
        row = arrays_of(layout)
        snapshots = np.zeros((layout.count, PIECES + 1), kernels.SNAPSHOT)
        falls = kernels.trace_motion(
            row, physics.friction, physics.gravity, physics.push, rtol, snapshots
        )
        self.samples = snapshots[:falls]
        self.starts = np.concatenate(([0.0], np.cumsum(self.samples["time"][:, -1])))
        self.end = float(self.starts[-1])

    def leader(self, times: ArrayLike) -> tuple[Ints, Floats]:
        """Who leads at each instant, and its lean from the vertical [rad]."""
        t = np.clip(np.asarray(times, dtype=np.float64), 0.0, self.end)
        n = np.clip(np.searchsorted(self.starts, t, side="right") - 1, 0, len(self.samples) - 1)
        angle = np.empty(len(t))
        for k in np.unique(n):
            at, fall = n == k, self.samples[k]
            angle[at] = _hermite(t[at] - self.starts[k], fall["time"], fall["angle"], fall["speed"])
        return n, angle + self.layout.tilt[n]

    def angles(self, times: ArrayLike) -> Floats:
        """Lean of every domino from the vertical (T, N) [rad] at T instants [s] since the push."""
        n, angle = self.leader(np.atleast_1d(np.asarray(times, dtype=np.float64)))
        return stack_leans(self.layout, n, angle)


def stack_leans(layout: Layout, leader: Ints, angle: Floats) -> Floats:
    """Return (T, N) leans from the vertical of a row whose leader (T,) leans by angle (T,) [rad].

    Those ahead of the leader stand, upright to their ground. Contacts as of physics: a tip slides
    down until the faces are flush, then the front face rests on the rear edge, until that is lost;
    angles only grow, so each lean tells its contact.

    References
    ----------
    J. M. J. van Leeuwen, The domino effect (2004), arXiv physics/0401018;
    Chapman, The physics of toppling dominoes, eq. 1.
    """
    if not layout.is_flat:
        return _lean_over_hills(layout, leader, angle)
    leans = np.zeros((len(leader), layout.count))
    s, c = np.sin(angle), np.cos(angle)
    leans[np.arange(len(leader)), leader] = angle
    for i in range(int(leader.max()) - 1, -1, -1):
        length = layout.height[i]
        gap, d = layout.spacing[i] / length, layout.thickness[i + 1] / length
        p = gap + d
        behind = leader > i
        # a link that is lost stays as it was when it was lost
        lowest = 1.0 - (1.0 - gap * gap) / (2.0 * p * d)
        lost = behind & (c < lowest)
        c = np.where(lost, lowest, c)
        s = np.where(lost, np.sqrt(np.maximum(1.0 - c * c, 0.0)), s)
        sine = np.clip(gap - p * (1.0 - c), -1.0, 1.0)  # of the difference of the two leans
        cosine = np.sqrt(1.0 - sine * sine)
        tip = s * cosine + c * sine, c * cosine - s * sine
        # rounding takes a cosine above 1 where nothing is flush
        r = np.sqrt(gap * gap + np.maximum(2.0 * p * d * (1.0 - c), 0.0))
        corner = (gap + d * (1.0 - c)) / r, d * s / r
        flush = c < d / p
        s_i, c_i = np.where(flush, corner[0], tip[0]), np.where(flush, corner[1], tip[1])
        s, c = np.where(behind, s_i, s), np.where(behind, c_i, c)
        leans[:, i] = np.where(behind, np.arctan2(s, c), leans[:, i])
    return leans


def _lean_over_hills(layout: Layout, leader: Ints, angle: Floats) -> Floats:
    """`stack_leans`; each link is seen upright from the stand of the domino ahead."""
    leans = np.tile(layout.tilt, (len(leader), 1))
    leans[np.arange(len(leader)), leader] = angle
    rises = footing.steps(layout.spacing, layout.thickness, layout.rise, layout.tilt)
    theta = np.array(angle)
    for i in range(int(leader.max()) - 1, -1, -1):
        length, stand, behind = layout.height[i], layout.tilt[i + 1], leader > i
        p, d = (
            (layout.spacing[i] + layout.thickness[i + 1]) / length,
            layout.thickness[i + 1] / length,
        )
        e = rises[i] / length
        # p cos ψ - e sin ψ = r cos(ψ + slant) falls; a link that is lost stays as it was
        r, slant = np.hypot(p, e), np.arctan2(e, p)
        lowest = (r * r + d * d - 1.0) / (2.0 * d)
        last = np.arccos(np.clip(lowest / r, -1.0, 1.0)) - slant
        psi = np.minimum(np.where(behind, theta - stand, 0.0), last)
        gap = r * np.cos(psi + slant) - d
        tip = psi + np.arcsin(np.clip(gap, -1.0, 1.0))
        corner = np.arctan2(p - d * np.cos(psi), e + d * np.sin(psi))
        theta = np.where(behind, np.where(gap < 0.0, corner, tip) + stand, theta)
        leans[:, i] = np.where(behind, theta, leans[:, i])
    return leans


def outlines(layout: Layout, leans: Floats) -> Floats:
    """Return the corners of every domino of leans (N,) [rad], (N, 4, 2) [m].

    x runs forward, z up. In order: the front bottom edge it turns about, top front, top rear,
    bottom rear.
    """
    up = np.stack([np.sin(leans), np.cos(leans)], axis=-1) * layout.height[:, None]
    back = np.stack([-np.cos(leans), np.sin(leans)], axis=-1) * layout.thickness[:, None]
    foot = layout.pivots
    return np.stack([foot, foot + up, foot + up + back, foot + back], axis=1)


def _hermite(t: Floats, times: Floats, values: Floats, slopes: Floats) -> Floats:
    """Cubic between two neighbours of a table that match values and slopes."""
    i = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    h = times[i + 1] - times[i]
    x = np.clip((t - times[i]) / np.where(h > 0.0, h, 1.0), 0.0, 1.0)
    y = 1.0 - x
    return np.asarray(
        values[i] * y * y * (1.0 + 2.0 * x)
        + values[i + 1] * x * x * (1.0 + 2.0 * y)
        + h * x * y * (slopes[i] * y - slopes[i + 1] * x)
    )
