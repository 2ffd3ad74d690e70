"""Data of a report page, as plain numbers ready for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.progress import progress_bar
from domino_env.core.types import Floats
from domino_env.physics import footing
from domino_env.physics.layout import Layout
from domino_env.physics.motion import PIECES, Motion
from domino_env.physics.wave import Wave
from domino_env.view.energy import Energy, energies
from domino_env.view.ground import ground_line

EQUAL = 1e-6  # relative difference below which two speeds are equal
STEPS = 32  # of time in every interval between hits; straight lines between are within 1e-4 rad
EDGE = 1e-5  # part of an interval left out at its ends


@dataclass(frozen=True)
class Racer:
    """Layout of a comparison, with its wave.

    Attributes
    ----------
    name
        Label.
    wave
        The wave.
    trace
        (seconds, best score) of the search that found the layout, if there was one.
    learning
        (dominoes placed, score of the policy) of the training that made it, if there was one.
    verification
        Summary of its `verification.json`, if it was verified.
    score
        Score in the scene; None without a scene, and for a layout that breaks its rules.
    score_text
        The same in words.
    unit
        Unit of the score.
    """

    name: str
    wave: Wave
    trace: tuple[list[float], list[float]] | None = None
    learning: tuple[list[float], list[float]] | None = None
    verification: dict[str, Any] | None = None
    score: float | None = None
    score_text: str | None = None
    unit: str = "m/s"


def race_data(racers: Sequence[Racer], progress: bool | None = False) -> dict[str, Any]:
    """Return the data of the page.

    Raises
    ------
    ValueError
        Without a layout, and for a layout of less than two dominoes.
    """
    if not racers:
        raise ValueError("nothing to show: give at least one layout")
    for one in racers:
        if one.wave.layout.count < 2:
            raise ValueError(f"{one.name}: the layout has one domino: give at least two")
    merits = _merits(racers)
    first = max(range(len(racers)), key=lambda k: merits[k])
    return {
        "headline": headline(racers),
        "best": first if len(racers) > 1 and merits[first] > 0.0 else None,
        "racers": [
            _data_of(one) for one in progress_bar(progress, iterable=racers, unit=" layouts")
        ],
    }


def headline(racers: Sequence[Racer]) -> dict[str, str]:
    """Return in a few sentences which layout is the best ("who") and "why".

    The scene's score decides where every layout has one, else the mean speed.
    """
    merits = _merits(racers)
    by_speed = None in [one.score for one in racers] or {one.unit for one in racers} == {"m/s"}
    # the first of equals first
    order = sorted(range(len(racers)), key=lambda k: -merits[k])
    ranked, merits = [racers[k] for k in order], [merits[k] for k in order]
    first, shape = ranked[0], _shape(ranked[0].wave)
    name = first.name[0].upper() + first.name[1:]
    results = []
    for one, merit in zip(ranked, merits, strict=True):
        result = f"{merit:.4f} m/s" if by_speed and merit > 0.0 else one.score_text
        results.append(result if one.wave.mean_speed > 0.0 else one.wave.explanation)
    why = "; ".join(f"{one.name}: {text}" for one, text in zip(ranked, results, strict=True))
    if merits[0] <= 0.0:
        keeps = "keeps the limits of the scene" if first.wave.mean_speed else "topples to its end"
        return {"who": f"No layout {keeps}", "why": why}
    if len(ranked) == 1:
        return {"who": f"{name}: {results[0]}", "why": shape}
    if merits[1] <= 0.0 or not by_speed:
        best = "is the fastest" if by_speed else "has the best score"
        return {"who": f"{name} {best}", "why": f"{why}. {shape}"}
    if merits[0] / merits[1] - 1.0 < EQUAL:
        return {"who": f"{name} and {ranked[1].name} are equally fast", "why": shape}
    leads = ", ".join(
        f"{_lead(merits[0] / merit - 1.0)} faster than {one.name}"
        for one, merit in zip(ranked[1:], merits[1:], strict=True)
        if merit > 0.0
    )
    return {
        "who": f"{name} is the fastest: {leads}",
        "why": f"{why}. {_parts(first.wave, ranked[1].wave)} {shape}",
    }


def _merits(racers: Sequence[Racer]) -> list[float]:
    """Return the numbers that rank: the scores where all have one, else the speeds [m/s]."""
    scores = [one.score for one in racers if one.score is not None]
    return scores if len(scores) == len(racers) else [one.wave.mean_speed for one in racers]


def _lead(part: float) -> str:
    return f"{part:.1%}" if part >= 0.01 else f"{part:.2%}"


def _data_of(one: Racer) -> dict[str, Any]:
    """Return the data of one layout; the page turns leans of the leader into those of all."""
    wave, layout = one.wave, one.wave.layout
    motion = Motion(layout, wave.physics)
    ends = np.append(wave.arrival_times[: wave.hit], motion.end)
    # off the two hits, which the motion may have a little earlier or later
    part = np.clip(np.linspace(0.0, 1.0, STEPS + 1), EDGE, 1.0 - EDGE)
    times = ends[:-1, None] + part * np.maximum(np.diff(ends), 0.0)[:, None]
    leader, angle = (values.reshape(times.shape) for values in motion.leader(times.ravel()))
    led = leader == np.arange(wave.hit)[:, None]
    falls = np.where(led, angle, angle.min(axis=1, keepdims=True))
    energy = energies(motion)
    return {
        "name": one.name,
        "spacing": _short(layout.spacing),
        "thickness": _short(layout.thickness),
        "height": _short(layout.height),
        "positions": _short(layout.positions),
        "ground": _ground(layout),
        "arrivals": _short(wave.arrival_times),
        "speed": _short(wave.local_speed),
        "hit": wave.hit,
        "falls": [_short(leans) for leans in falls],
        "end": float(motion.end),
        "mean_speed": wave.mean_speed,
        "outcome": wave.outcome.name.lower().replace("_", " "),
        "explanation": wave.explanation,
        "error": wave.error_estimate,
        "friction": wave.physics.friction,
        "push": wave.physics.push,
        "flushes": wave.flushes,
        "flush_loss": wave.largest_flush_loss,
        "unit": one.unit,
        "kinetic": [_short(values) for values in _kinetic_of_falls(energy)],
        "energy": {
            name: _short(getattr(energy, name).reshape(-1, PIECES + 1)[:, ::4].ravel())
            for name in ("time", "released", "kinetic", "hits", "flushes", "friction")
        },
        "trace": one.trace,
        "learning": one.learning,
        "verification": one.verification,
        "score_text": one.score_text,
    }


def _ground(layout: Layout) -> dict[str, list[Any]]:
    """Return the pivots, the tilt and the line of the ground."""
    steps = footing.steps(layout.spacing, layout.thickness, layout.rise, layout.tilt)
    return {
        "x": _short(layout.pivots[:, 0]),
        "z": _short(layout.pivots[:, 1]),
        "tilt": _short(layout.tilt),
        "steps": _short(steps),
        "line": [_short(point) for point in ground_line(layout)],
    }


def _kinetic_of_falls(energy: Energy) -> tuple[Floats, Floats]:
    """Return the middle [s] and the mean kinetic energy [J] of each interval between hits.

    Every hit takes half of the energy: the teeth of several curves would hide each other.
    """
    time, kinetic = (x.reshape(-1, PIECES + 1) for x in (energy.time, energy.kinetic))
    begins, ends = time[:, 0], time[:, -1]
    moves = ends > begins
    sums = np.trapezoid(kinetic[moves], time[moves], axis=1)
    return 0.5 * (begins + ends)[moves], sums / (ends - begins)[moves]


def _parts(first: Wave, second: Wave) -> str:
    """Return the third of the dominoes in which the fastest layout gains most, in words."""
    leads = []
    for name, low, high in (("first", 0.0, 1 / 3), ("middle", 1 / 3, 2 / 3), ("last", 2 / 3, 1.0)):
        speeds = []
        for wave in (first, second):
            a, b = (round(x * (wave.layout.count - 1)) for x in (low, high))
            b = max(b, a + 1) if a + 1 < wave.layout.count else b
            if b <= a:
                return ""
            length = wave.layout.positions[b] - wave.layout.positions[a]
            speeds.append(float(length / (wave.arrival_times[b] - wave.arrival_times[a])))
        leads.append((speeds[0] / speeds[1] - 1.0, name))
    best, worst = max(leads), min(leads)
    text = f"It gains most in the {best[1]} third of the layout ({best[0]:+.1%})"
    if worst[0] < -0.005:
        text += f", and is slower in the {worst[1]} third ({worst[0]:+.1%})"
    return text + "."


def _shape(wave: Wave) -> str:
    """Return the gaps in a sentence."""
    gaps = wave.layout.spacing * 1e3
    if np.ptp(gaps) < 1e-6:
        return f"Its gaps are all {gaps[0]:.1f} mm."
    return (
        f"Its gaps begin at {gaps[0]:.0f} mm, are {np.median(gaps):.0f} mm in the middle (median) "
        f"and end at {gaps[-1]:.0f} mm."
    )


def _short(values: ArrayLike) -> list[Any]:
    """Return values with seven digits, enough for a page; None where they are not finite."""
    return [
        float(f"{x:.7g}") if np.isfinite(x) else None for x in np.asarray(values, dtype=np.float64)
    ]
