"""Race data: everything a report page shows, as plain numbers ready for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.types import Floats
from domino_env.physics import footing
from domino_env.physics.layout import Layout
from domino_env.physics.motion import PIECES, Motion
from domino_env.physics.wave import Wave
from domino_env.view.energy import Energy, energies
from domino_env.view.ground import ground_line

DRAW = 1e-6  # relative; who is ahead by less has not won
LOOKS = 32  # at the leader in every fall; straight lines between them are within 1e-4 rad
EDGE = 1e-5  # of a fall


@dataclass(frozen=True)
class Racer:
    """One row of a race.

    Attributes
    ----------
    name
        What it is called.
    wave
        How it topples.
    trace
        (seconds, best score) of the search that found it, if it was found by one.
    learning
        (dominoes placed, score of the policy) of the training of the agent that built it.
    verification
        What `verification.json` says of it, if it was checked.
    score
        What the scene gives it; None where there is no scene, or the row breaks its rules.
    worth
        The same in words.
    unit
        Of the score.
    """

    name: str
    wave: Wave
    trace: tuple[list[float], list[float]] | None = None
    learning: tuple[list[float], list[float]] | None = None
    verification: dict[str, Any] | None = None
    score: float | None = None
    worth: str | None = None
    unit: str = "m/s"


def race_data(racers: Sequence[Racer]) -> dict[str, Any]:
    """Collect all that the page shows of a race.

    Raises
    ------
    ValueError
        Where there is no row, or one of fewer than two dominoes.
    """
    if not racers:
        raise ValueError("nothing to race: give at least one layout")
    for one in racers:
        if one.wave.layout.count < 2:
            raise ValueError(f"{one.name}: one domino does not race; give at least two")
    merits = _merits(racers)
    first = max(range(len(racers)), key=lambda k: merits[k])
    return {
        "headline": headline(racers),
        "winner": first if len(racers) > 1 and merits[first] > 0.0 else None,
        "rows": [_row(one) for one in racers],
    }


def headline(racers: Sequence[Racer]) -> dict[str, str]:
    """Say who won and why, in a few sentences.

    The scene's score decides where every row has one, else the mean speed.
    """
    merits = _merits(racers)
    by_speed = all(one.score is None or one.unit == "m/s" for one in racers)
    by_speed |= any(one.score is None for one in racers)
    # the first of equals first
    order = sorted(range(len(racers)), key=lambda k: -merits[k])
    ranked, worth = [racers[k] for k in order], [merits[k] for k in order]
    first = ranked[0]
    if worth[0] <= 0.0:
        if first.wave.mean_speed > 0.0:
            return {"who": "No row keeps the limits of the scene", "why": _shape(first.wave)}
        far = max(racers, key=lambda one: one.wave.reach)
        return {"who": "No row topples to its end", "why": f"{far.name}: {far.wave.explanation}"}
    called = first.name[0].upper() + first.name[1:]
    if len(ranked) == 1:
        told = f"{worth[0]:.4f} m/s" if by_speed else first.worth
        return {"who": f"{called}: {told}", "why": _shape(first.wave)}
    second = ranked[1]
    if worth[1] <= 0.0:
        why = f"{second.name} does not topple to its end: {second.wave.explanation}"
        if second.wave.mean_speed > 0.0:
            why = f"{second.name}: {second.worth}."
        return {"who": f"{called} wins", "why": why}
    if worth[0] / worth[1] - 1.0 < DRAW:
        return {"who": f"{called} and {second.name} draw", "why": _shape(first.wave)}
    if not by_speed:
        told = "; ".join(f"{one.name}: {one.worth}" for one in ranked)
        return {"who": f"{called} wins", "why": f"{told}. {_shape(first.wave)}"}
    leads = ", ".join(
        f"{_lead(worth[0] / worth[k] - 1.0)} faster than {ranked[k].name}"
        for k in range(1, len(ranked))
        if worth[k] > 0.0
    )
    return {
        "who": f"{called} wins: {leads}",
        "why": (
            "Each row gets the same push, and what counts is how fast the wave of falling dominoes "
            f"runs to the last: {worth[0]:.4f} m/s against {worth[1]:.4f} m/s. "
            f"{_parts(first.wave, second.wave)} {_shape(first.wave)}"
        ),
    }


def _merits(racers: Sequence[Racer]) -> list[float]:
    """By what rows are ranked: their scores where all have one, else their speeds [m/s]."""
    scores = [one.score for one in racers if one.score is not None]
    return scores if len(scores) == len(racers) else [one.wave.mean_speed for one in racers]


def _lead(part: float) -> str:
    return f"{part:.1%}" if part >= 0.01 else f"{part:.2%}"


def _row(one: Racer) -> dict[str, Any]:
    wave, layout = one.wave, one.wave.layout
    motion = Motion(layout, wave.physics)
    ends = np.append(wave.arrival_times[: wave.hit], motion.end)
    falls = []
    for k in range(wave.hit):
        # off the two hits, which the motion may have a little sooner or later
        fall = np.clip(np.linspace(0.0, 1.0, LOOKS + 1), EDGE, 1.0 - EDGE)
        leader, angle = motion.leader(ends[k] + fall * max(ends[k + 1] - ends[k], 0.0))
        falls.append(_short(np.where(leader == k, angle, angle.min())))
    energy = energies(motion)
    return {
        "name": one.name,
        "spacing": _short(layout.spacing),
        "thickness": _short(layout.thickness),
        "height": _short(layout.height),
        "positions": _short(layout.positions),
        "hills": None if layout.is_flat else _hills(layout),
        "arrivals": _short(wave.arrival_times),
        "speed": _short(wave.local_speed),
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
        "unit": one.unit,
        "kinetic": [_short(values) for values in _kinetic_of_falls(energy)],
        "energy": {
            name: values
            if isinstance(values, float)
            else _short(values.reshape(-1, PIECES + 1)[:, ::4].ravel())
            for name, values in asdict(energy).items()
        },
        "trace": one.trace,
        "learning": one.learning,
        "verification": one.verification,
        "worth": one.worth,
    }


def _hills(layout: Layout) -> dict[str, list[Any]]:
    """What the page draws a row over ground with that is not flat."""
    steps = footing.steps(layout.spacing, layout.thickness, layout.rise, layout.tilt)
    return {
        "x": _short(layout.pivots[:, 0]),
        "z": _short(layout.pivots[:, 1]),
        "tilt": _short(layout.tilt),
        "steps": _short(steps),
        "ground": [_short(point) for point in ground_line(layout)],
    }


def _kinetic_of_falls(energy: Energy) -> tuple[Floats, Floats]:
    """When each fall is half over [s], and the kinetic energy on average over it [J].

    Every hit takes half of it: drawn as it is, the teeth of several rows hide each other.
    """
    time, kinetic = (x.reshape(-1, PIECES + 1) for x in (energy.time, energy.kinetic))
    begins, ends = time[:, 0], time[:, -1]
    moves = ends > begins
    sums = np.trapezoid(kinetic[moves], time[moves], axis=1)
    return 0.5 * (begins + ends)[moves], sums / (ends - begins)[moves]


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
