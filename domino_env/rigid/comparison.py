"""Verification: our arrival times beside those of a judge who keeps no contact closed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domino_env.core.files import write_text
from domino_env.core.results import brief
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Wave, simulate
from domino_env.rigid.built_in import Standing
from domino_env.rigid.converging import Engine
from domino_env.rigid.judges import Fall, Judge, in_words, largest_move
from domino_env.rigid.opening import Opening, openings

Floats = NDArray[np.float64]

FLOORS = (0.3, 0.5, 1.0)  # friction of smooth wood, of a table cloth, of rubber
AGREES, EXPLAINED = 0.001, 0.003  # relative; beyond the second the reason is looked for
NEAR_STALL = 0.05  # from here on a slow fall is worth naming


@dataclass(frozen=True, eq=False)
class Verification:
    """One row in the model, and as a judge saw it.

    Attributes
    ----------
    wave
        The model's.
    judge
        Name and version of who was asked.
    hinged
        What the judge saw of the row on hinges, as the model has it.
    standing
        The same of the row that stands free, one a floor.
    """

    wave: Wave
    judge: str
    hinged: Fall
    standing: tuple[Fall, ...]

    __repr__ = brief

    @property
    def falls(self) -> tuple[Fall, ...]:
        """All of them, the hinged one first."""
        return self.hinged, *self.standing

    @property
    def free(self) -> Fall | None:
        """The row on the roughest floor; None where none was asked for."""
        return max(self.standing, key=lambda one: one.floor or 0.0, default=None)

    @property
    def limit(self) -> Floats:
        """(N,) hinged arrival times [s]; inf where the wave did not come."""
        return self.hinged.arrivals

    @property
    def difference(self) -> float:
        """Judge over model - 1 when the last domino is hit, on hinges; nan if it never is."""
        return last_difference(self.hinged, self.wave)

    @property
    def free_difference(self) -> float:
        """The same of the row on the roughest floor."""
        return float("nan") if self.free is None else last_difference(self.free, self.wave)

    @property
    def largest_difference(self) -> float:
        """The largest relative one of the hinged arrival times; 0 if there are none."""
        came = min(self.wave.hit, self.hinged.hit)
        return largest_move(self.limit[:came], self.wave.arrival_times[:came])

    @property
    def spread(self) -> float:
        """The judge's doubt of the hinged arrival times."""
        return self.hinged.doubt

    @property
    def toppled(self) -> bool:
        """Whether the last domino toppled, on hinges."""
        return self.hinged.staying_up == 0

    @property
    def free_toppled(self) -> bool:
        """The same on the roughest floor."""
        return self.free is not None and self.free.staying_up == 0

    @property
    def verdict(self) -> str:
        """Plain words; of the difference only what exceeds the judge's own doubt counts."""
        came = self.hinged.hit
        if came != self.wave.hit:
            return (
                f"DIFFERS: the wave reaches {self.wave.hit} of {self.wave.layout.count} dominoes "
                f"in the model, {came} of the judge's. {self.reason}"
            )
        share, doubt = self.largest_difference, self.hinged.doubt
        within = f"within {share:.3%} of the judge's, whose own doubt is {doubt:.3%}"
        model_topples = self.wave.toppled == self.wave.layout.count
        if model_topples != self.toppled:
            where = "model, not for the judge" if model_topples else "judge's row, not in the model"
            return (
                f"DIFFERS: every arrival time {within}, but the last domino topples in the "
                f"{where}. {self.reason}"
            )
        excess = max(share - doubt, 0.0)
        if excess <= AGREES and doubt > AGREES:
            return (
                f"UNDECIDED: arrival times {within}: it has not converged within its limits "
                f"({self.hinged.how})."
            )
        if excess <= AGREES:
            return f"AGREES: every arrival time {within}."
        if excess <= EXPLAINED:
            return f"CLOSE: every arrival time {within}. {self.reason}"
        return f"DIFFERS: arrival times only {within}. {self.reason}"

    @cached_property
    def openings(self) -> tuple[Opening, ...]:
        """Contacts of the hinged row that opened for real and that the model keeps closed."""
        return tuple(openings(self.wave.layout, self.wave.physics))

    @property
    def reason(self) -> str:
        """What in the row makes the two differ."""
        wave, found = self.wave, []
        margins = wave.stall_margin[np.isfinite(wave.stall_margin)]
        if len(margins) and float(margins.min()) < NEAR_STALL:
            found.append(
                f"domino {int(np.nanargmin(wave.stall_margin))} comes close to a stall (margin "
                f"{float(margins.min()):.2g}), where every small difference grows"
            )
        if self.openings:
            widest = max(self.openings, key=lambda one: one.width)
            found.append(
                f"contacts open that the model keeps closed: {len(self.openings)}, the widest "
                f"{widest}"
            )
        if not found:
            return "Nothing in the row says why."
        return "Why: " + "; ".join(found) + "."


def verify(
    layout: Layout,
    physics: Physics,
    steps: Sequence[float] | None = None,
    *,
    floors: Sequence[float] = FLOORS,
    judge: Judge | None = None,
) -> Verification:
    """Topple a row in the model and, hinged and on floors, before a judge who knows no model.

    Parameters
    ----------
    layout
        What stands.
    physics
        What makes it fall.
    steps
        Of the engine's time [s]: the same as `judge=Engine(steps=steps)`.
    floors
        Friction of each floor that the row is to stand on.
    judge
        Who is asked: `Standing()`, the simulator of standing rows that comes with this package,
        unless told otherwise; `Engine()` is somebody else's (extra 'verify').

    Raises
    ------
    ValueError
        For a row of one domino, a floor whose friction is no positive number, and fewer than two
        different steps.
    ImportError
        Without the engine, where it is asked; says what to install.
    """
    if layout.count < 2:
        raise ValueError("a row of one domino has no wave to compare; give at least two")
    for floor in floors:
        if not 0.0 < floor < np.inf:
            raise ValueError(f"floor = {floor}: give its coefficient of friction, above 0")
    if steps is not None:
        judge = Engine(steps=tuple(steps))
    judge = judge or Standing()
    return Verification(
        wave=simulate(layout, physics),
        judge=judge.name,
        hinged=judge.fall(layout, physics, None),
        standing=tuple(judge.fall(layout, physics, floor) for floor in floors),
    )


def last_difference(fall: Fall, wave: Wave) -> float:
    """Give judge over model - 1 when the last domino is hit; nan if the wave died in either."""
    last, ours = float(fall.arrivals[-1]), float(wave.arrival_times[-1])
    return last / ours - 1.0 if np.isfinite(last) and np.isfinite(ours) else float("nan")


def table(checked: Verification) -> list[str]:
    """Tabulate by how much each arrival differs, every tenth domino and the last; the verdict."""
    ours, count = checked.wave.arrival_times, checked.wave.layout.count
    names = [in_words(fall.floor) for fall in checked.falls]
    lines = ["domino   model [s]" + "".join(f"{name:>12}" for name in names)]
    for i in sorted({*range(10, count, 10), min(5, count - 1), count - 1}):
        shares = "".join(f"{_share(fall.arrivals[i], ours[i]):>12}" for fall in checked.falls)
        lines.append(f"{i:6d}  {_time(ours[i])}{shares}")
    doubts = "".join(f"{f'{fall.doubt:.3%}':>12}" for fall in checked.falls)
    standing = "".join(f"{fall.staying_up:>12}" for fall in checked.falls)
    lines += [f"{'in doubt':18}{doubts}", f"{'stay up':18}{standing}", ""]
    lines += [f"judge: {checked.judge}, {checked.hinged.how}"]
    lines += [
        f"{in_words(fall.floor)}: not converged within its limits ({fall.how})"
        for fall in checked.falls
        if not fall.converged
    ]
    return [*lines, checked.verdict]


def between(one: Verification, other: Verification) -> list[str]:
    """Say how far two judges of one row are apart, floor by floor, beside their doubt."""
    lines = []
    for fall in one.falls:
        for second in other.falls:
            if second.floor != fall.floor:
                continue
            apart, doubt = largest_move(fall.arrivals, second.arrivals), fall.doubt + second.doubt
            said = "agree" if max(apart - doubt, 0.0) <= AGREES else "differ"
            lines.append(
                f"{in_words(fall.floor)}: the two judges {said}, arrival times at most {apart:.3%} "
                f"apart, {doubt:.3%} of it in doubt"
            )
    return lines


def document(checked: Verification, second: Verification | None = None) -> dict[str, object]:
    """Collect what `verification.json` holds; null where the wave did not come."""
    free = checked.free
    told: dict[str, object] = {
        "engine": checked.judge,
        "friction": checked.wave.physics.friction,
        "gravity": checked.wave.physics.gravity,
        "push": checked.wave.physics.push,
        "model": _cells(checked.wave.arrival_times),
        "hinged": _cells(checked.limit),
        "free": [] if free is None else _cells(free.arrivals),
        "difference": _cells([checked.difference])[0],
        "free_difference": _cells([checked.free_difference])[0],
        "largest_difference": checked.largest_difference,
        "toppled": checked.toppled,
        "free_toppled": checked.free_toppled,
        "verdict": checked.verdict,
        "floors": [
            {
                "floor": fall.floor,
                "arrivals": _cells(fall.arrivals),
                "difference": _cells([last_difference(fall, checked.wave)])[0],
                "doubt": _cells([fall.doubt])[0],
                "staying_up": fall.staying_up,
                "how": fall.how,
            }
            for fall in checked.falls
        ],
    }
    return told if second is None else told | {"second": document(second)}


def write_verification(
    checked: Verification, path: Path, second: Verification | None = None
) -> None:
    """Write the document as JSON, whole."""
    write_text(path, json.dumps(document(checked, second), indent=1, allow_nan=False) + "\n")


def _cells(values: Sequence[float] | Floats) -> list[float | None]:
    return [float(x) if np.isfinite(x) else None for x in values]


def _time(value: float) -> str:
    return f"{value:10.6f}" if np.isfinite(value) else f"{'never':>10}"


def _share(value: float, ours: float) -> str:
    if not (np.isfinite(value) and np.isfinite(ours)):
        return ""
    return f"{value / ours - 1.0:+.3%}"
