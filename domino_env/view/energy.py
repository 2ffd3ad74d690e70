"""Energy: what gravity gives to a falling row, and who takes it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from domino_env.core.brief import brief
from domino_env.core.types import Floats
from domino_env.physics import footing
from domino_env.physics.layout import Layout
from domino_env.physics.motion import Motion
from domino_env.physics.wave import Wave

INSTANT = 1e-7  # [s] on either side of an instant, to tell before a hit from after, and for speeds
POINTS = 12  # in every fall
SMEAR = 1.0 / 32.0  # of a fall: how far apart the motion is known; a jump is blurred over it
HALVINGS = 45
LARGEST_PIECE = 1_000_000  # leans at once, some 100 MB


@dataclass(frozen=True, eq=False)
class Energy:
    """Energy over time, (T,) [J] each, reckoned from the row standing.

    At any instant pushed + released = kinetic + hits + flushes + friction.

    Attributes
    ----------
    time
        (T,) instants [s].
    pushed
        What the push puts in, one number [J].
    released
        Potential energy given off so far.
    kinetic
        Of all dominoes.
    hits
        What hits have taken so far.
    flushes
        What flushes have taken so far.
    friction
        What friction has taken so far. Dominoes that fall alone count here, as the motion leaves
        them where they were lost.

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


def energies(motion: Motion, wave: Wave) -> Energy:
    """Find where the energy of a wave comes from and where it goes.

    Parameters
    ----------
    motion
        Of the same row.
    wave
        The wave.

    Notes
    -----
    Hits take theirs at an instant, as read from the motion just before and after. What else is gone
    is friction where the row rubs; in the blur around a flush, what is gone beyond the rate of
    friction on both sides is the flush's. Without friction all of it is.
    """
    layout = wave.layout
    ends = wave.arrival_times[: wave.hit]
    if wave.hit < layout.count:
        ends = np.append(ends, motion.end)
    instants = _flush_instants(motion, wave)
    pieces = []
    for a, b in pairwise(ends):
        if b - a <= 8.0 * INSTANT:
            continue
        inside = np.linspace(a + 2.0 * INSTANT, b - 2.0 * INSTANT, POINTS)
        near = instants[(instants > a) & (instants < b)]
        around = np.concatenate([near + k * SMEAR * (b - a) for k in (-2.0, -1.0, 1.0, 2.0)])
        pieces.append(np.union1d(inside, np.clip(around, inside[0], inside[-1])))
    times = np.concatenate(pieces) if pieces else np.zeros(0)
    released, kinetic = _at(motion, wave, times)
    drop = np.zeros(len(times))
    at = np.searchsorted(times, wave.arrival_times[1 : wave.hit])
    at = at[(at > 0) & (at < len(times))]
    drop[at] = kinetic[at - 1] - kinetic[at]
    hits = np.cumsum(drop)
    inertia = layout.density[0] * layout.height[0] * layout.thickness[0] * layout.width
    inertia *= (layout.height[0] ** 2 + layout.thickness[0] ** 2) / 3.0
    pushed = 0.5 * float(inertia) * wave.physics.push**2
    gone = pushed + released - kinetic - hits
    if wave.physics.friction == 0.0:
        flushes = gone
    elif len(instants):
        flushes = _taken_by_flushes(times, gone, ends, instants)
    else:
        flushes = np.zeros(len(times))
    return Energy(times, pushed, released, kinetic, hits, flushes, gone - flushes)


def _at(motion: Motion, wave: Wave, times: Floats) -> tuple[Floats, Floats]:
    """Potential energy given off and kinetic energy of the whole row at instants [J]."""
    layout = wave.layout
    mass = layout.density * layout.height * layout.thickness * layout.width
    inertia = mass * (layout.height**2 + layout.thickness**2) / 3.0
    lever = 0.5 * wave.physics.gravity * mass
    standing = _height_of_centres(layout, layout.tilt)
    released, kinetic = np.empty(len(times)), np.empty(len(times))
    piece = max(1, LARGEST_PIECE // layout.count)
    for first in range(0, len(times), piece):
        part = slice(first, first + piece)
        leans, later, sooner = (
            motion.angles(times[part] + shift) for shift in (0.0, INSTANT, -INSTANT)
        )
        released[part] = ((standing - _height_of_centres(layout, leans)) * lever).sum(axis=1)
        rates = (later - sooner) / (2.0 * INSTANT)
        kinetic[part] = 0.5 * (inertia * rates**2).sum(axis=1)
    return released, kinetic


def _height_of_centres(layout: Layout, leans: Floats) -> Floats:
    """Twice how far the centres lie above their pivots [m]."""
    return np.asarray(layout.height * np.cos(leans) + layout.thickness * np.sin(leans))


def _flush_instants(motion: Motion, wave: Wave) -> Floats:
    """When faces come to lie flush [s], rising, found by halving."""
    layout = wave.layout
    height = layout.height[:-1]
    gap, d = layout.spacing / height, layout.thickness[1:] / height
    rises = footing.steps(layout.spacing, layout.thickness, layout.rise, layout.tilt) / height
    # seen upright from the stand of the domino ahead
    reach, slant = np.hypot(gap + d, rises), np.arctan2(rises, gap + d)
    lowest = (reach * reach + d * d - 1.0) / (2.0 * reach * d)  # where a link is lost instead
    due = np.arccos(np.clip(d / reach, -1.0, 1.0)) - slant + layout.tilt[1:]
    ends = motion.angles([motion.end])[0][1:]
    links = np.flatnonzero((d / reach > lowest) & (ends > due))
    low, high = np.zeros(len(links)), np.full(len(links), motion.end)
    which = np.arange(len(links))
    for _ in range(HALVINGS if len(links) else 0):
        middle = 0.5 * (low + high)
        over = motion.angles(middle)[which, links + 1] > due[links]
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    return np.sort(0.5 * (low + high))


def _taken_by_flushes(times: Floats, gone: Floats, ends: Floats, instants: Floats) -> Floats:
    """(T,) what flushes have taken so far [J]: jumps of the rest beyond friction's steady rate."""
    drop = np.zeros(len(times))
    for a, b in pairwise(ends):
        near = instants[(instants > a) & (instants < b)]
        inside = np.flatnonzero((times > a) & (times < b))
        if not len(near) or len(inside) < 4:
            continue
        t, q = times[inside], gone[inside]
        rates = np.diff(q) / np.diff(t)
        blur = SMEAR * (b - a)
        blurred = (np.abs(0.5 * (t[1:] + t[:-1])[:, None] - near) < blur).any(axis=1)
        if blurred.all():
            continue
        middle = 0.5 * (t[1:] + t[:-1])
        usual = np.interp(middle[blurred], middle[~blurred], rates[~blurred])
        excess = (rates[blurred] - usual) * np.diff(t)[blurred]
        drop[inside[1:][blurred]] = excess
    # a blur gives back what it took too early
    return np.maximum.accumulate(np.maximum(np.cumsum(drop), 0.0))
