"""Contacts that open for real, and that the model keeps closed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.standing.simulation import simulate_standing

Floats = NDArray[np.float64]

FRAMES = 4000  # at which a row is looked at
NEAR = 10  # contacts behind the leader; what happens further back hardly moves it
WIDE = 1e-3  # of the height: a contact that opens by less is not worth a word


@dataclass(frozen=True)
class Opening:
    """A contact that opened after it had closed.

    Attributes
    ----------
    link
        Domino i of the contact between i and i+1.
    width
        How wide [m].
    time
        When it was widest [s].
    """

    link: int
    width: float
    time: float

    def __str__(self) -> str:
        return (
            f"between dominoes {self.link} and {self.link + 1} by {1e3 * self.width:.2g} mm, "
            f"{self.time:.3f} s after the push"
        )


def openings(layout: Layout, physics: Physics, floor: float | None = None) -> list[Opening]:
    """Find the contacts near the leader that open before the model would release them.

    Parameters
    ----------
    layout, physics
        As of `simulate_standing`, which is asked.
    floor
        Friction of the floor; None where the dominoes are hinged.

    Returns
    -------
    list of Opening
        The widest of every contact that opens by more than a thousandth of the height.
    """
    arrivals = simulate_standing(layout, physics, floor_friction=floor).arrival_times
    end = float(np.max(arrivals[np.isfinite(arrivals)]))
    times = np.linspace(0.0, end, FRAMES)
    poses = simulate_standing(layout, physics, floor_friction=floor, times=times).poses
    leader = np.searchsorted(arrivals, times, side="right") - 1
    found = []
    for i in range(layout.count - 1):
        gaps = np.where((leader > i) & (leader <= i + NEAR), link_gap(layout, i, poses), 0.0)
        gaps[poses[:, i + 1, 2] > released_at(layout, i)] = 0.0
        k = int(np.argmax(gaps))
        if gaps[k] > WIDE * layout.height[i]:
            found.append(Opening(i, float(gaps[k]), float(times[k])))
    return found


def link_gap(layout: Layout, i: int, poses: Floats) -> Floats:
    """How far domino i is from i+1, (F,) [m]: 0 where they touch, or can touch no more.

    Parameters
    ----------
    layout
        What stood.
    i
        The domino behind.
    poses
        (F, N, 3) places of the front bottom edges [m] and leans [rad].

    Notes
    -----
    The smaller of two distances, each where its foot is on the face: of the tip of i from the rear
    face of i+1, and of the rear bottom edge of i+1 from the front face of i.
    """
    (x, y, a), (u, v, b) = (np.moveaxis(poses[:, k], -1, 0) for k in (i, i + 1))
    tip = x + layout.height[i] * np.sin(a), y + layout.height[i] * np.cos(a)
    edge = u - layout.thickness[i + 1] * np.cos(b), v + layout.thickness[i + 1] * np.sin(b)
    gaps = np.full(len(poses), np.inf)
    for lean, (across, up), tall in (
        (b, (edge[0] - tip[0], tip[1] - edge[1]), layout.height[i + 1]),
        (a, (edge[0] - x, edge[1] - y), layout.height[i]),
    ):
        sign = 1.0 if lean is a else -1.0  # from the face's foot to the point
        along = sign * across * np.sin(lean) + up * np.cos(lean)
        apart = across * np.cos(lean) - sign * up * np.sin(lean)
        gaps = np.where((along >= 0.0) & (along <= tall), np.minimum(gaps, apart), gaps)
    return np.where(np.isfinite(gaps), np.maximum(gaps, 0.0), 0.0)


def released_at(layout: Layout, i: int) -> float:
    """Lean of domino i+1 at which the model has i lose it [rad]; π where it never does."""
    length = float(layout.height[i])
    gap, thick = layout.spacing[i] / length, layout.thickness[i + 1] / length
    lowest = 1.0 - (1.0 - gap * gap) / (2.0 * (gap + thick) * thick)
    return float(np.arccos(max(lowest, -1.0)))
