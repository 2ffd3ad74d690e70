"""Verification of a wave by simulators of rigid bodies that keep no contact closed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from domino_env.core.checks import numbers, require, require_choice
from domino_env.core.results import as_json, dataclass_repr, document
from domino_env.core.tables import text_table
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics, require_arguments
from domino_env.physics.wave import Wave, simulate
from domino_env.rigid.engine import simulate_in_engine
from domino_env.rigid.simulation import RigidWave, floor_name, largest_difference, simulate_standing

FLOORS = (0.3, 0.5, 1.0)  # friction of smooth wood, of a table cloth, of rubber
AGREES, CLOSE = 0.001, 0.003  # largest relative differences for these verdicts
NEAR_STALL = 0.05  # stall margins below this are given as a reason
NEAR = 10  # contacts behind the leader that affect it; openings further back are no reason
WIDE = 1e-3  # of the height: smaller openings of contacts are not given as a reason


@dataclass(frozen=True, eq=False)
class Verification:
    """Comparison of a layout in the model and in simulators that keep no contact closed.

    Attributes
    ----------
    wave
        Wave of the model.
    reference
        Waves of `simulate_standing`: with fixed pivots, as in the model, then one per floor.
    engine
        Waves of the third-party engine, likewise; empty if it was not run.
    """

    wave: Wave
    reference: tuple[RigidWave, ...]
    engine: tuple[RigidWave, ...] = ()

    __repr__ = dataclass_repr

    @property
    def fixed(self) -> RigidWave:
        """Wave of the reference simulator with fixed pivots."""
        return self.reference[0]

    @property
    def standing(self) -> tuple[RigidWave, ...]:
        """Waves of the reference simulator of the free-standing layout, one per floor."""
        return self.reference[1:]

    @property
    def difference(self) -> float:
        """Time of the last hit with fixed pivots, over that of the model, minus one; or nan."""
        return last_difference(self.wave, self.fixed)

    @property
    def largest_difference(self) -> float:
        """Largest relative difference, with fixed pivots, of arrival times that both waves have."""
        return common_difference(self.wave, self.fixed)

    @property
    def verdict(self) -> str:
        """Verdict with its reason, beginning with AGREES, CLOSE, DIFFERS or UNDECIDED."""
        return self._verdict(self.fixed)

    @property
    def verdicts(self) -> tuple[str, ...]:
        """Verdicts of the reference simulator and of the engine, if it was run."""
        return tuple(self._verdict(waves[0]) for waves in (self.reference, self.engine) if waves)

    def _verdict(self, fixed: RigidWave) -> str:
        """Return the verdict on fixed pivots; only differences beyond the uncertainty count."""
        wave, count = self.wave, self.wave.layout.count
        if fixed.hit != wave.hit:
            return (
                f"DIFFERS: the wave reaches {wave.hit} of {count} dominoes in the model, "
                f"{fixed.hit} in {fixed.simulator}. {self.reason}"
            )
        uncertainty, largest = fixed.error_estimate, common_difference(wave, fixed)
        within = f"within {largest:.3%} of {fixed.simulator}, uncertainty {uncertainty:.3%}"
        if (wave.toppled == count) != (fixed.staying_up == 0):
            where = "the model" if wave.toppled == count else fixed.simulator
            return (
                f"DIFFERS: every arrival time {within}, but the last domino topples in {where} "
                f"only. {self.reason}"
            )
        excess = max(largest - uncertainty, 0.0)
        if excess <= AGREES:
            if uncertainty > AGREES:
                return f"UNDECIDED: arrival times {within}, not converged in {fixed.steps} steps."
            return f"AGREES: every arrival time {within}."
        verdict = "CLOSE: every arrival time" if excess <= CLOSE else "DIFFERS: arrival times only"
        return f"{verdict} {within}. {self.reason}"

    @property
    def reason(self) -> str:
        """Sentence with the reasons in the layout for a difference of model and reference."""
        margins, reasons = self.wave.stall_margin, []
        if np.isfinite(margins).any() and np.nanmin(margins) < NEAR_STALL:
            reasons.append(
                f"domino {int(np.nanargmin(margins))} comes close to a stall (margin "
                f"{np.nanmin(margins):.2g}), where every small difference grows"
            )
        rigid, height = self.fixed, self.wave.layout.height[:-1]
        # time at which the leader is NEAR dominoes ahead
        latest = np.append(rigid.arrival_times, np.full(NEAR, np.inf))[NEAR:-1]
        is_wide = (rigid.opened > WIDE * height) & (rigid.opened_at <= latest)
        if is_wide.any():
            i = int(np.argmax(np.where(is_wide, rigid.opened, 0.0)))
            reasons.append(
                f"contacts open that the model keeps closed: {is_wide.sum()}, the widest "
                f"between dominoes {i} and {i + 1} by {1e3 * rigid.opened[i]:.2g} mm, "
                f"{rigid.opened_at[i]:.3f} s after the push"
            )
        return f"Why: {'; '.join(reasons)}." if reasons else "No reason is found in the layout."


def verify(
    layout: Layout,
    physics: Physics,
    *,
    floors: Sequence[float] = FLOORS,
    engine: bool = False,
    rtol: float = 1e-3,
    progress: bool | None = False,
) -> Verification:
    """Simulate a layout in the model and as rigid bodies on fixed pivots and floors.

    Parameters
    ----------
    layout, physics
        As for `simulate`; two dominoes or more.
    floors
        Friction of each floor, above 0.
    engine
        True to simulate fixed pivots and floors with the third-party engine Chipmunk (extra
        ``verify``) too, which takes seconds to minutes.
    rtol
        Relative error allowed in the arrival times of the reference simulator, from 1e-5 to 1.
    progress
        As for `simulate_standing`.

    Returns
    -------
    Verification
        All waves.

    Raises
    ------
    TypeError
        For a layout or physics of another type.
    ImportError
        For `engine` without pymunk; the message has the command that installs it.
    ValueError
        For a single domino, a floor without friction, and a tolerance out of its range.
    """
    require_arguments(layout, physics)
    if layout.count < 2:
        raise ValueError("one domino has no wave: give a layout of two or more")
    frictions = np.atleast_1d(numbers("floors", floors))
    require("floors", frictions, above=0.0, hint="coefficients of friction", array=True)
    require_choice("engine", engine, (False, True))
    places = (None, *frictions.tolist())  # None: fixed pivots
    standing = partial(simulate_standing, layout, physics, rtol=rtol, progress=progress)
    reference = tuple(map(standing, places))
    engines = [simulate_in_engine(layout, physics, place, progress) for place in places if engine]
    return Verification(simulate(layout, physics), reference, tuple(engines))


def last_difference(wave: Wave, rigid: RigidWave) -> float:
    """Return the time of the last hit, rigid over model, minus one; nan if a wave ended before."""
    last, model = float(rigid.arrival_times[-1]), float(wave.arrival_times[-1])
    return last / model - 1.0 if math.isfinite(last) and math.isfinite(model) else math.nan


def common_difference(wave: Wave, rigid: RigidWave) -> float:
    """Return the largest relative difference of the arrival times that both have."""
    hit = min(wave.hit, rigid.hit)
    return largest_difference(rigid.arrival_times[:hit], wave.arrival_times[:hit])


def verification_table(verification: Verification) -> list[str]:
    """Return the lines of a table of differences at every tenth domino, and the verdicts."""
    model, count = verification.wave.arrival_times, verification.wave.layout.count
    waves = (*verification.reference, *verification.engine)
    names = ["domino", "model [s]"]
    names += [floor_name(rigid.floor_friction) for rigid in verification.reference]
    names += [f"engine, {floor_name(rigid.floor_friction)}" for rigid in verification.engine]
    cells = [
        [str(i), f"{model[i]:.6f}" if np.isfinite(model[i]) else "never"]
        + [_percent(rigid.arrival_times[i], model[i]) for rigid in waves]
        for i in sorted({*range(10, count, 10), min(5, count - 1), count - 1})
    ]
    cells.append(["uncertainty", "", *(f"{rigid.error_estimate:.3%}" for rigid in waves)])
    staying_up = str(count - verification.wave.toppled)
    cells.append(["not toppled", staying_up, *(str(rigid.staying_up) for rigid in waves)])
    lines = text_table(names, cells, right=names[1:])
    lines += [
        f"{floor_name(rigid.floor_friction)}: {rigid.simulator} has not converged within its "
        f"limits ({rigid.steps} steps)"
        for rigid in waves
        if not rigid.converged
    ]
    for rigid, engine in zip(verification.reference, verification.engine, strict=False):
        difference = largest_difference(rigid.arrival_times, engine.arrival_times)
        uncertainties = rigid.error_estimate, engine.error_estimate
        verb = "are undecided" if max(uncertainties) > AGREES else "agree"
        if difference == math.inf or difference - sum(uncertainties) > AGREES:
            verb = "differ"
        lines.append(
            f"{floor_name(rigid.floor_friction)}: {rigid.simulator} and {engine.simulator} {verb}, "
            f"arrival times at most {difference:.3%} apart, uncertainty of both "
            f"{sum(uncertainties):.3%}"
        )
    return [*lines, *verification.verdicts]


def as_document(verification: Verification) -> dict[str, Any]:
    """Return the document of `domino verify --json`; null for arrival times that do not exist."""
    wave = verification.wave

    def floor(rigid: RigidWave) -> dict[str, Any]:
        return document(rigid, "simulator staying_up") | {
            "floor": rigid.floor_friction,
            "arrivals": rigid.arrival_times,
            "difference": last_difference(wave, rigid),
            "uncertainty": rigid.error_estimate,
        }

    result = document(wave.physics, "friction gravity push")
    result |= document(verification, "difference largest_difference verdict")
    result |= {
        "engine": verification.fixed.simulator,
        "model": wave.arrival_times,
        "toppled": verification.fixed.staying_up == 0,
        "floors": list(map(floor, verification.reference)),
        "engine_floors": list(map(floor, verification.engine)),
    }
    return {name: as_json(value) for name, value in result.items()}


def _percent(value: float, model: float) -> str:
    """Return the relative difference of a time from that of the model; "" if one is not finite."""
    return f"{value / model - 1.0:+.3%}" if math.isfinite(value) and math.isfinite(model) else ""
