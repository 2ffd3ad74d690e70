"""Race data: everything a report page shows, as plain numbers ready for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env.motion import Motion
from domino_env.wave import Wave

Floats = NDArray[np.float64]

LOOKS = 32  # at the leader in every fall; straight lines between them are within 1e-4 rad
INSTANT = 1e-7  # [s] on either side of an instant, to tell before a hit from after, and for speeds
ENERGY_POINTS = 12  # in every fall
LARGEST_PIECE = 1_000_000  # leans at once, some 100 MB


@dataclass(frozen=True)
class Racer:
    """One row of a race.

    name: what it is called.  wave: how it topples.
    trace: (evaluations, best score) of the search that found it, if it was found by one.
    verification: what `verification.json` says of it, if it was checked.
    """

    name: str
    wave: Wave
    trace: tuple[list[float], list[float]] | None = None
    verification: dict[str, Any] | None = None


def race_data(racers: Sequence[Racer]) -> dict[str, Any]:
    """All rows of a race.  ValueError where there is none, or a row of fewer than two dominoes."""
    if not racers:
        raise ValueError("nothing to race: give at least one layout")
    for one in racers:
        if one.wave.layout.count < 2:
            raise ValueError(f"{one.name}: one domino does not race; give at least two")
    return {"headline": headline(racers), "rows": [_row(one) for one in racers]}


def headline(racers: Sequence[Racer]) -> dict[str, str]:
    """Who won and why, in two sentences."""
    ranked = sorted(racers, key=lambda one: -one.wave.mean_speed)
    first = ranked[0]
    if first.wave.mean_speed <= 0.0:
        far = max(racers, key=lambda one: one.wave.reach)
        return {"who": "No row topples to its end", "why": f"{far.name}: {far.wave.explanation}"}
    if len(ranked) == 1:
        return {"who": f"{first.name}: {first.wave.mean_speed:.4f} m/s", "why": _shape(first.wave)}
    second = ranked[1]
    if second.wave.mean_speed <= 0.0:
        return {
            "who": f"{first.name} wins",
            "why": f"{second.name} does not topple to its end: {second.wave.explanation}",
        }
    lead = first.wave.mean_speed / second.wave.mean_speed - 1.0
    return {
        "who": f"{first.name} wins by {lead:.1%}",
        "why": (
            f"Its wave runs at {first.wave.mean_speed:.4f} m/s on average, against "
            f"{second.wave.mean_speed:.4f} m/s of {second.name}. "
            f"{_parts(first.wave, second.wave)} {_shape(first.wave)}"
        ),
    }


def energies(motion: Motion, wave: Wave) -> dict[str, list[float]]:
    """Energy over time [J], reckoned from the row standing: what was put in, what is left of it.

    released: potential energy given off.  kinetic.  hits: kinetic energy lost in hits.  rubbed:
    what else is gone, to friction and flushes (and with dominoes that fall alone, which the motion
    leaves where they were lost; so a row that runs through is followed to its last hit only).
    """
    layout = wave.layout
    ends = wave.arrival_times[: wave.hit]
    if wave.hit < layout.count:
        ends = np.append(ends, motion.end)
    times = np.concatenate(
        [np.zeros(0)]
        + [
            np.linspace(a + 2.0 * INSTANT, b - 2.0 * INSTANT, ENERGY_POINTS)
            for a, b in pairwise(ends)
            if b - a > 8.0 * INSTANT
        ]
    )
    mass = layout.density * layout.height * layout.thickness * layout.width
    inertia = mass * (layout.height**2 + layout.thickness**2) / 3.0
    lever = 0.5 * wave.physics.gravity * mass
    released, kinetic = np.empty(len(times)), np.empty(len(times))
    piece = max(1, LARGEST_PIECE // layout.count)
    for first in range(0, len(times), piece):
        part = slice(first, first + piece)
        leans, later, sooner = (
            motion.angles(times[part] + shift) for shift in (0.0, INSTANT, -INSTANT)
        )
        high = layout.height * np.cos(leans) + layout.thickness * np.sin(leans)
        released[part] = ((layout.height - high) * lever).sum(axis=1)
        rates = (later - sooner) / (2.0 * INSTANT)
        kinetic[part] = 0.5 * (inertia * rates**2).sum(axis=1)
    drop = np.zeros(len(times))
    at = np.searchsorted(times, wave.arrival_times[1 : wave.hit])
    at = at[(at > 0) & (at < len(times))]
    drop[at] = kinetic[at - 1] - kinetic[at]
    hits = np.cumsum(drop)
    pushed = 0.5 * float(inertia[0]) * wave.physics.push**2
    rubbed = pushed + released - kinetic - hits
    return {
        "time": _short(times),
        "released": _short(released),
        "kinetic": _short(kinetic),
        "hits": _short(hits),
        "rubbed": _short(rubbed),
    }


def _row(one: Racer) -> dict[str, Any]:
    wave, layout = one.wave, one.wave.layout
    motion = Motion(layout, wave.physics)
    ends = np.append(wave.arrival_times[: wave.hit], motion.end)
    falls = []
    for k in range(wave.hit):
        inside = np.linspace(ends[k], max(ends[k + 1], ends[k]), LOOKS + 1)
        leader, angle = motion.leader(np.clip(inside, ends[k] + 1e-12, ends[k + 1] - 1e-12))
        falls.append(_short(np.where(leader == k, angle, angle.min())))
    with np.errstate(invalid="ignore", divide="ignore"):
        speed = layout.pitch / np.diff(wave.arrival_times)
    return {
        "name": one.name,
        "spacing": _short(layout.spacing),
        "thickness": _short(layout.thickness),
        "height": _short(layout.height),
        "positions": _short(layout.positions),
        "arrivals": _short(wave.arrival_times),
        "speed": _short(speed),
        "hit": wave.hit,
        "falls": falls,
        "end": float(motion.end),
        "mean_speed": wave.mean_speed,
        "outcome": wave.outcome.name.lower().replace("_", " "),
        "explanation": wave.explanation,
        "error": wave.error_estimate,
        "friction": wave.physics.friction,
        "push": wave.physics.push,
        "gravity": wave.physics.gravity,
        "flushes": wave.flushes,
        "flush_loss": wave.largest_flush_loss,
        "energy": energies(motion, wave),
        "trace": one.trace,
        "verification": one.verification,
    }


def _parts(first: Wave, second: Wave) -> str:
    """Where the winner is ahead, by thirds of the dominoes."""
    words = []
    for name, low, high in (("first", 0.0, 1 / 3), ("middle", 1 / 3, 2 / 3), ("last", 2 / 3, 1.0)):
        speeds = []
        for wave in (first, second):
            a, b = (round(x * (wave.layout.count - 1)) for x in (low, high))
            b = max(b, a + 1) if a + 1 < wave.layout.count else b
            if b <= a:
                return ""
            way = wave.layout.positions[b] - wave.layout.positions[a]
            speeds.append(float(way / (wave.arrival_times[b] - wave.arrival_times[a])))
        words.append((speeds[0] / speeds[1] - 1.0, name))
    best, worst = max(words), min(words)
    text = f"It gains most in the {best[1]} third of the row ({best[0]:+.1%})"
    if worst[0] < -0.005:
        text += f", and is slower in the {worst[1]} third ({worst[0]:+.1%})"
    return text + "."


def _shape(wave: Wave) -> str:
    """The gaps in a sentence."""
    gaps = wave.layout.spacing * 1e3
    if np.ptp(gaps) < 1e-6:
        return f"Its gaps are all {gaps[0]:.1f} mm."
    return (
        f"Its gaps begin at {gaps[0]:.0f} mm, are {np.median(gaps):.0f} mm in the middle (median) "
        f"and end at {gaps[-1]:.0f} mm."
    )


def _short(values: ArrayLike) -> list[Any]:
    """Seven digits, enough for the eye; null where there is no number."""
    return [
        float(f"{x:.7g}") if np.isfinite(x) else None for x in np.asarray(values, dtype=np.float64)
    ]
