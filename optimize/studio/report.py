"""Report: the page with the rows of runs, and why one is faster."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.checks import require
from domino_env.core.files import errors_with_path, read_text
from domino_env.physics.motion import PIECES, Motion
from domino_env.rigid.known import known_verification
from domino_env.rigid.simulation import floor_name
from domino_env.scenes.io.link import layout_document
from domino_env.view.compared import ComparedLayout
from domino_env.view.energy import Energy, energies
from optimize.studio.page import scene_for, write_page

TERMS = ("time", "released", "kinetic", "hits", "flushes", "friction")  # of an energy balance
SPEEDS = "score [m/s]"  # quantity of scores that are speeds
FALL = PIECES + 1  # samples of the energy between two hits


def write_report(compared: Sequence[ComparedLayout], path: Path) -> int:
    """Write the page with the rows of compared layouts; it shows the best one first.

    Parameters
    ----------
    compared
        Layouts with their waves.
    path
        Output file, HTML.

    Returns
    -------
    int
        Size of the page [bytes].

    Raises
    ------
    ValueError
        For a layout of one domino, and for a file in a run folder with wrong content.
    """
    for entry in compared:
        if entry.wave.layout.count < 2:
            raise ValueError(f"{entry.name}: the layout has one domino: give at least two")
    balances = [energies(Motion(entry.wave.layout, entry.wave.physics)) for entry in compared]
    rows = [_row(entry, energy) for entry, energy in zip(compared, balances, strict=True)]
    rows[0]["energy"] = _energy_curves(balances[0])
    ranked = sorted(zip(_merits(compared), compared, strict=True), key=lambda pair: -pair[0])
    best = next((entry for _, entry in ranked if entry.scene), compared[0])
    scene = best.scene or scene_for(best.wave.layout, best.wave.physics)
    scene = scene.replace(physics=best.wave.physics)
    layout = best.layout or best.wave.layout
    first = None if scene.violations(layout) else layout
    return write_page(path, scene, first, rows, headline(compared))


def headline(compared: Sequence[ComparedLayout]) -> str:
    """Return a sentence on the best layout, and the results of all from the best to the worst.

    The best layout has the best score if every layout has a score, else the best mean speed.

    Parameters
    ----------
    compared
        Layouts with their waves.

    Returns
    -------
    str
        The sentences.
    """
    scored = all(entry.score is not None for entry in compared)
    by_speed = not scored or {_quantity(entry) for entry in compared} == {SPEEDS}
    # equal merits stay in their order
    ranked = sorted(zip(_merits(compared), compared, strict=True), key=lambda pair: -pair[0])
    highest, best = ranked[0]
    results, leads = [], []
    for merit, entry in ranked:
        result = f"{merit:.4f} m/s" if by_speed and merit > 0.0 else _score_text(entry)
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
    return f"{winner}: {'; '.join(results)}"


def _merits(compared: Sequence[ComparedLayout]) -> list[float]:
    """Return the scores if all layouts have one, else the mean speeds [m/s]; higher is better."""
    scores = [entry.score for entry in compared if entry.score is not None]
    return scores if len(scores) == len(compared) else [entry.wave.mean_speed for entry in compared]


def _quantity(entry: ComparedLayout) -> str:
    return entry.scene.criterion.quantity() if entry.scene else SPEEDS


def _score_text(entry: ComparedLayout) -> str | None:
    if entry.scene is None or entry.score is None:
        return None
    return entry.scene.format_score(entry.score, entry.wave)


def _row(entry: ComparedLayout, energy: Energy) -> dict[str, Any]:
    """Return the data of a layout for report.js."""
    layout, physics = entry.layout or entry.wave.layout, entry.wave.physics
    scene = (entry.scene or scene_for(layout, physics)).replace(physics=physics)
    fits = not scene.violations(layout)
    return {
        "name": entry.name,
        "document": (scene if fits else scene_for(entry.wave.layout, physics)).document(),
        "layout": layout_document(layout if fits else entry.wave.layout),
        "fits": fits,
        "score": _score_text(entry),
        "quantity": _quantity(entry),
        "kinetic": _kinetic_of_falls(energy),
        "search": _curve(entry, "trace.csv", "seconds", "best_score"),
        "training": _curve(entry, "progress.csv", "steps", "score"),
        "verification": _verification(entry),
    }


def _curve(
    entry: ComparedLayout, name: str, x_column: str, y_column: str
) -> tuple[list[Any], list[Any]] | None:
    """Return a curve of a CSV file in the run folder; None if there is no such file."""
    if entry.folder is None or not (entry.folder / name).exists():
        return None
    path = entry.folder / name
    with errors_with_path(path):
        table = np.genfromtxt(io.StringIO(read_text(path)), delimiter=",", names=True, ndmin=1)
        for column in (x_column, y_column):
            if column not in (table.dtype.names or ()):
                raise ValueError(f"no column {column}: remove the file, or write that of the run")
            require(column, table[column], array=True)
    scores = table[y_column]
    if entry.scene is not None:
        scores = np.asarray(entry.scene.criterion.displayed(scores))
    shown = np.isfinite(scores)
    return _round_values(table[x_column][shown]), _round_values(scores[shown])


def _verification(entry: ComparedLayout) -> dict[str, Any] | None:
    """Return the shipped verification of a layout; None if there is none."""
    known = known_verification(entry.layout or entry.wave.layout, entry.wave.physics)
    if known is None:
        return None
    last = [(floor_name(check.floor), check.last) for check in known.floors]
    return {"simulator": known.checks[0].simulator, "verdict": known.verdict, "last": last}


def _energy_curves(energy: Energy) -> dict[str, list[Any]]:
    """Return the terms of an energy balance, every fourth sample."""
    every = slice(None, None, 4)
    shape = -1, FALL
    return {
        name: _round_values(getattr(energy, name).reshape(shape)[:, every].ravel())
        for name in TERMS
    }


def _kinetic_of_falls(energy: Energy) -> tuple[list[Any], list[Any]]:
    """Return the middle [s] and the mean kinetic energy [J] of each interval between hits.

    The energy drops at every hit, and curves with all samples would hide each other.
    """
    time, kinetic = (x.reshape(-1, FALL) for x in (energy.time, energy.kinetic))
    begins, ends = time[:, 0], time[:, -1]
    has_length = ends > begins  # the interval of a leader that stalls at once has no length
    integrals = np.asarray(np.trapezoid(kinetic[has_length], time[has_length], axis=1))
    means = integrals / (ends - begins)[has_length]
    return _round_values(0.5 * (begins + ends)[has_length]), _round_values(means)


def _round_values(values: ArrayLike) -> list[Any]:
    """Return values rounded to seven significant digits; None for one that is not finite."""
    numbers = np.asarray(values, dtype=np.float64)
    return [float(f"{x:.7g}") if np.isfinite(x) else None for x in numbers]
