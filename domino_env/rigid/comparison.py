"""Verification: our arrival times beside those of an independent rigid-body engine."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domino_env.chain.forces import Diagnosis, diagnose
from domino_env.chain.layout import Layout
from domino_env.chain.physics import Physics
from domino_env.chain.wave import Wave, simulate
from domino_env.rigid.engine import topple
from domino_env.support.brief import brief
from domino_env.support.files import write_text

Floats = NDArray[np.float64]

STEPS = (4e-5, 2e-5)  # [s]
AGREES, EXPLAINED = 0.001, 0.003  # relative; beyond the second the reason is looked for
LOSSY_FLUSH, NEAR_STALL = 0.02, 0.05  # from here on a flush or a slow fall is worth naming
WINDOW = 100  # dominoes behind the leader that still move; further back changes less than 1e-9


@dataclass(frozen=True, eq=False)
class Verification:
    """One row in the model and in the engine.

    Attributes
    ----------
    wave
        The model's.
    steps
        (S,) of the engine's time [s], falling.
    hinged
        (S, N) arrival times in the engine, of the row on hinges [s]; inf where the wave did not
        come.
    free
        (S, N) the same of the row that stands free.
    toppled
        Whether the last domino toppled at the finest step, on hinges.
    free_toppled
        The same of the row that stands free.
    """

    wave: Wave
    steps: Floats
    hinged: Floats
    free: Floats
    toppled: bool
    free_toppled: bool

    __repr__ = brief

    @property
    def limit(self) -> Floats:
        """(N,) hinged arrival times extrapolated to steps of zero [s]."""
        return extrapolated(self.steps, self.hinged)

    @property
    def free_limit(self) -> Floats:
        """(N,) the same of the row that stands free."""
        return extrapolated(self.steps, self.free)

    @property
    def difference(self) -> float:
        """Engine over model - 1 when the last domino is hit; nan if the wave died in either."""
        return _difference(self.limit, self.wave)

    @property
    def free_difference(self) -> float:
        """The same of the row that stands free."""
        return _difference(self.free_limit, self.wave)

    @property
    def largest_difference(self) -> float:
        """The largest relative one of the arrival times that both have; 0 if there are none."""
        ours = self.wave.arrival_times[1:]
        both = np.isfinite(ours) & np.isfinite(self.limit[1:])
        if not both.any():
            return 0.0
        return float(np.max(np.abs(self.limit[1:][both] / ours[both] - 1.0)))

    @property
    def spread(self) -> float:
        """How far the extrapolation reached beyond the finest step: a measure of its doubt."""
        both = np.isfinite(self.limit) & np.isfinite(self.hinged[-1]) & (self.limit > 0.0)
        if not both.any():
            return 0.0
        return float(np.max(np.abs(self.hinged[-1][both] / self.limit[both] - 1.0)))

    @property
    def verdict(self) -> str:
        """Plain words."""
        came = int(np.isfinite(self.limit).sum())
        if came != self.wave.hit:
            return (
                f"DIFFERS: the wave reaches {self.wave.hit} of {self.wave.layout.count} dominoes "
                f"in the model, {came} in the engine. {self.reason}"
            )
        share = self.largest_difference
        model_topples = self.wave.toppled == self.wave.layout.count
        if model_topples != self.toppled:
            where = "model, not in the engine" if model_topples else "engine, not in the model"
            return (
                f"DIFFERS: every arrival time within {share:.3%} of the engine's, but the last "
                f"domino topples in the {where}. {self.reason}"
            )
        if share <= AGREES:
            return f"AGREES: every arrival time within {share:.3%} of the engine's."
        if share <= EXPLAINED:
            return f"CLOSE: arrival times up to {share:.3%} from the engine's. {self.reason}"
        return f"DIFFERS: arrival times up to {share:.2%} from the engine's. {self.reason}"

    @cached_property
    def diagnosis(self) -> Diagnosis:
        """Contact forces, lifted pivots and flush losses of the row in the model."""
        return diagnose(self.wave.layout, self.wave.physics)

    @property
    def reason(self) -> str:
        """What in the row makes the two differ, as far as the model can say."""
        wave, found = self.wave, []
        if wave.largest_flush_loss > LOSSY_FLUSH:
            found.append(
                f"a flush takes {wave.largest_flush_loss:.1%} of the front's speed at once, where "
                "in the engine faces part for a moment"
            )
        margins = wave.stall_margin[np.isfinite(wave.stall_margin)]
        if len(margins) and float(margins.min()) < NEAR_STALL:
            found.append(
                f"domino {int(np.nanargmin(wave.stall_margin))} comes close to a stall (margin "
                f"{float(margins.min()):.2g}), where every small difference grows"
            )
        if wave.releases:
            found.append(f"{wave.releases} dominoes lose contact and fall alone")
        opened = self.diagnosis.opened
        if len(opened):
            found.append(
                f"{len(opened)} contacts would open that the model keeps closed (the first between "
                f"dominoes {opened[0]} and {opened[0] + 1})"
            )
        if wave.flushes and not found:
            found.append(f"{wave.flushes} flushes, which in the engine take a moment each")
        if not found:
            return "Nothing in the row says why; a smaller step may."
        return "Likely why: " + "; ".join(found) + "."


def verify(
    layout: Layout,
    physics: Physics,
    steps: Sequence[float] = STEPS,
    window: int | None = WINDOW,
) -> Verification:
    """Topple a row in the model and, hinged and free, in the engine at two or more time steps.

    Parameters
    ----------
    layout
        What stands.
    physics
        What makes it fall.
    steps
        Of the engine's time [s], two different ones at least.
    window
        So many dominoes behind the leader move in the engine; None for all.

    Raises
    ------
    ValueError
        For fewer than two different steps, or a row of one domino.
    ImportError
        Without the engine; says what to install.
    """
    fine = np.array(sorted(set(steps), reverse=True))
    if len(fine) < 2:
        raise ValueError(f"steps = {list(steps)}: give at least two different ones to extrapolate")
    if layout.count < 2:
        raise ValueError("a row of one domino has no wave to compare; give at least two")
    hinged, free = (
        [topple(layout, physics, float(h), hinged=held, window=window) for h in fine]
        for held in (True, False)
    )
    return Verification(
        wave=simulate(layout, physics),
        steps=fine,
        hinged=np.array([fallen.arrivals for fallen in hinged]),
        free=np.array([fallen.arrivals for fallen in free]),
        toppled=hinged[-1].toppled,
        free_toppled=free[-1].toppled,
    )


def extrapolated(steps: Floats, times: Floats) -> Floats:
    """Extrapolate arrival times (S, N) to steps of zero, (N,); inf where a run did not come.

    A straight line through all steps, as the engine's error is of first order.
    """
    came = np.isfinite(times).all(axis=0)
    limit = np.full(times.shape[1], np.inf)
    shifted = steps - steps.mean()
    slope = shifted @ times[:, came] / (shifted @ shifted)
    limit[came] = times[:, came].mean(axis=0) - slope * steps.mean()
    limit[0] = 0.0
    return limit


def table(checked: Verification) -> list[str]:
    """Tabulate arrival times side by side, every tenth domino and the last, then the verdict."""
    ours, hinged, free = checked.wave.arrival_times, checked.limit, checked.free_limit
    lines = ["domino   model [s]  hinged [s]    diff.    free [s]    diff."]
    count = len(ours)
    for i in sorted({*range(10, count, 10), min(5, count - 1), count - 1}):
        lines.append(
            f"{i:6d}  {_time(ours[i])}  {_time(hinged[i])}  {_share(hinged[i], ours[i])}"
            f"  {_time(free[i])}  {_share(free[i], ours[i])}"
        )
    finest = ", ".join(f"{h * 1e6:g}" for h in checked.steps)
    lines += ["", f"engine: Chipmunk (pymunk), steps of {finest} µs, extrapolated to zero "]
    lines[-1] += f"(the finest is {checked.spread:.3%} from it)"
    return [*lines, checked.verdict]


def document(checked: Verification) -> dict[str, object]:
    """Collect what `verification.json` holds; null where the wave did not come."""

    def cells(values: Floats) -> list[float | None]:
        return [float(x) if np.isfinite(x) else None for x in values]

    return {
        "engine": "pymunk",
        "steps": cells(checked.steps),
        "friction": checked.wave.physics.friction,
        "gravity": checked.wave.physics.gravity,
        "push": checked.wave.physics.push,
        "model": cells(checked.wave.arrival_times),
        "hinged": cells(checked.limit),
        "free": cells(checked.free_limit),
        "difference": cells(np.array([checked.difference]))[0],
        "free_difference": cells(np.array([checked.free_difference]))[0],
        "largest_difference": checked.largest_difference,
        "toppled": checked.toppled,
        "free_toppled": checked.free_toppled,
        "verdict": checked.verdict,
    }


def write_verification(checked: Verification, path: Path) -> None:
    """Write the document as JSON, whole."""
    write_text(path, json.dumps(document(checked), indent=1, allow_nan=False) + "\n")


def _difference(limit: Floats, wave: Wave) -> float:
    last, ours = float(limit[-1]), float(wave.arrival_times[-1])
    return last / ours - 1.0 if np.isfinite(last) and np.isfinite(ours) else float("nan")


def _time(value: float) -> str:
    return f"{value:10.6f}" if np.isfinite(value) else f"{'never':>10}"


def _share(value: float, ours: float) -> str:
    if not (np.isfinite(value) and np.isfinite(ours)):
        return f"{'':8}"
    return f"{value / ours - 1.0:+8.3%}"
