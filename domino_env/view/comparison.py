"""Compared layouts: their ranking in words, and the data of their report page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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

STEPS = 32  # of time in an interval between hits; linear interpolation is within 1e-4 rad
MARGIN = 1e-5  # fraction of an interval left out at each of its ends
SIZES = "spacing", "thickness", "height", "positions"  # of a layout
WAVE_FIELDS = "mean_speed", "explanation", "flushes"  # of a wave
RUN_FIELDS = "trace", "learning", "verification", "score_text", "quantity"  # of a compared layout


@dataclass(frozen=True)
class ComparedLayout:
    """Layout of a comparison, with its wave.

    Attributes
    ----------
    name
        Label on the page.
    wave
        Wave of the layout.
    trace
        (seconds, `quantity`) of the search that found the layout; None without a search.
    learning
        (dominoes placed, `quantity` of the policy) of the training; None without one.
    verification
        `simulator`, `verdict`, and `last`: pairs of a floor and the relative difference of the time
        of the last hit, None if there was no such hit; None without a verification.
    score
        Score in the scene; None without a scene, and for a layout that breaks its rules.
    score_text
        The score as text with its unit; None without a score.
    quantity
        Name and unit of the numbers that are shown of scores.
    """

    name: str
    wave: Wave
    trace: tuple[list[float], list[float]] | None = None
    learning: tuple[list[float], list[float]] | None = None
    verification: dict[str, Any] | None = None
    score: float | None = None
    score_text: str | None = None
    quantity: str = "score [m/s]"


def comparison_data(compared: Sequence[ComparedLayout]) -> dict[str, Any]:
    """Return the data of the report page.

    Parameters
    ----------
    compared
        Layouts with their waves.

    Returns
    -------
    dict
        Numbers and texts ready for JSON. `headline`: texts, see `headline`; `best`: index of the
        best layout, None for a single one and without a positive score or speed; `compared`: data
        of each layout in SI units.

    Raises
    ------
    ValueError
        For a layout of one domino.
    """
    for entry in compared:
        if entry.wave.layout.count < 2:
            raise ValueError(f"{entry.name}: the layout has one domino: give at least two")
    merits = _merits(compared)
    best = int(np.argmax(merits))
    return {
        "headline": headline(compared),
        "best": best if len(compared) > 1 and merits[best] > 0.0 else None,
        "compared": [_layout_data(entry) for entry in compared],
    }


def headline(compared: Sequence[ComparedLayout]) -> dict[str, str]:
    """Return a sentence on the best layout, and the results of all.

    The best layout has the best score if every layout has a score, else the best mean speed.

    Parameters
    ----------
    compared
        Layouts with their waves.

    Returns
    -------
    dict
        `winner`: the sentence; `results`: the results from the best layout to the worst.
    """
    scored = all(entry.score is not None for entry in compared)
    by_speed = not scored or {entry.quantity for entry in compared} == {"score [m/s]"}
    # equal merits stay in their order
    ranked = sorted(zip(_merits(compared), compared, strict=True), key=lambda pair: -pair[0])
    highest, best = ranked[0]
    results, leads = [], []
    for merit, entry in ranked:
        result = f"{merit:.4f} m/s" if by_speed and merit > 0.0 else entry.score_text
        if entry.wave.mean_speed == 0.0:
            result = entry.wave.explanation
        results.append(f"{entry.name}: {result}")
        if merit > 0.0 and entry is not best:
            leads.append(f"{highest / merit - 1.0:.2%} faster than {entry.name}")
    winner = f"{best.name[0].upper()}{best.name[1:]} "
    if highest <= 0.0:
        failure = "keeps the limits of the scene" if best.wave.mean_speed else "topples to its end"
        winner = f"No layout {failure}"
    elif len(ranked) == 1:
        winner += "topples to its end"
    elif by_speed:
        winner += f"is the fastest{': ' * bool(leads)}{', '.join(leads)}"
    else:
        winner += "has the best score"
    return {"winner": winner, "results": "; ".join(results)}


def _merits(compared: Sequence[ComparedLayout]) -> list[float]:
    """Return the scores if all layouts have one, else the mean speeds [m/s]; higher is better."""
    scores = [entry.score for entry in compared if entry.score is not None]
    return scores if len(scores) == len(compared) else [entry.wave.mean_speed for entry in compared]


def _layout_data(entry: ComparedLayout) -> dict[str, Any]:
    """Return the data of one layout; the page computes all leans from those of the leaders."""
    wave = entry.wave
    motion = Motion(wave.layout, wave.physics)
    energy = energies(motion)
    return {
        "name": entry.name,
        **motion_data(wave, motion),
        "speed": _round_values(wave.local_speed),
        "outcome": wave.outcome.label,
        "error": wave.error_estimate,
        "friction": wave.physics.friction,
        "push": wave.physics.push,
        "flush_loss": wave.largest_flush_loss,
        "kinetic": [_round_values(values) for values in _kinetic_of_falls(energy)],
        "energy": {  # every fourth sample, for a small page
            name: _round_values(getattr(energy, name).reshape(-1, PIECES + 1)[:, ::4].ravel())
            for name in ("time", "released", "kinetic", "hits", "flushes", "friction")
        },
        **{name: getattr(wave, name) for name in WAVE_FIELDS},
        **{name: getattr(entry, name) for name in RUN_FIELDS},
    }


def layout_data(layout: Layout) -> dict[str, Any]:
    """Return sizes, positions and ground of a layout in SI units, for `motion.js`."""
    sizes = {name: _round_values(getattr(layout, name)) for name in SIZES}
    return {**sizes, "ground": _ground(layout)}


def motion_data(wave: Wave, motion: Motion) -> dict[str, Any]:
    """Return the data of a toppling layout, from which `motion.js` computes all leans.

    Parameters
    ----------
    wave
        The wave.
    motion
        Motion of its layout.

    Returns
    -------
    dict
        `layout_data`, and `arrivals` [s], `falls`: leans of each leader at equal steps of time
        between two hits [rad], `end` of the motion [s], `hit`: number of dominoes hit.
    """
    layout = wave.layout
    ends = np.append(wave.arrival_times[: wave.hit], motion.end)
    # Not at the hits themselves: wave and motion give their times with different rounding, so that
    # another domino could lead.
    fraction = np.clip(np.linspace(0.0, 1.0, STEPS + 1), MARGIN, 1.0 - MARGIN)
    times = ends[:-1, None] + fraction * np.maximum(np.diff(ends), 0.0)[:, None]
    leader, angle = (values.reshape(times.shape) for values in motion.leader(times.ravel()))
    # a domino that jams when it is hit does not lead: it stays at rest
    falls = np.where(leader == np.arange(wave.hit)[:, None], angle, layout.tilt[: wave.hit, None])
    return {
        **layout_data(layout),
        "arrivals": _round_values(wave.arrival_times),
        "falls": [_round_values(leans) for leans in falls],
        "end": float(motion.end),
        "hit": wave.hit,
    }


def _ground(layout: Layout) -> dict[str, list[Any]]:
    """Return pivots, tilts, rises of the contacts (`steps`) and the line of the ground."""
    steps = footing.normal_rises(layout.spacing, layout.thickness, layout.rise, layout.tilt)
    return {
        "x": _round_values(layout.pivots[:, 0]),
        "z": _round_values(layout.pivots[:, 1]),
        "tilt": _round_values(layout.tilt),
        "steps": _round_values(steps),
        "line": [_round_values(point) for point in ground_line(layout)],
    }


def _kinetic_of_falls(energy: Energy) -> tuple[Floats, Floats]:
    """Return the middle [s] and the mean kinetic energy [J] of each interval between hits.

    The energy drops at every hit, and curves with all samples would hide each other.
    """
    time, kinetic = (x.reshape(-1, PIECES + 1) for x in (energy.time, energy.kinetic))
    begins, ends = time[:, 0], time[:, -1]
    has_length = ends > begins  # the interval of a leader that stalls at once has no length
    integrals = np.trapezoid(kinetic[has_length], time[has_length], axis=1)
    return 0.5 * (begins + ends)[has_length], integrals / (ends - begins)[has_length]


def _round_values(values: ArrayLike) -> list[Any]:
    """Return values rounded to seven significant digits; None for one that is not finite."""
    numbers = np.asarray(values, dtype=np.float64)
    return [float(f"{x:.7g}") if np.isfinite(x) else None for x in numbers]
