"""Measured chains beside the model: friction fitted, each spacing left out in turn, reasons.

A source is compared in its own setting, in the other readings that its file names, and with each
effect that the model leaves out, as large as simulated layouts have it at the friction found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.standard import HEIGHT
from domino_env.physics.steady import steady_wave
from domino_env.physics.wave import simulate, simulate_batch
from domino_env.rigid.simulation import simulate_standing
from domino_env.validation.source import (
    Quantity,
    Row,
    Setting,
    Source,
    source_of_frequencies,
)

Model = Callable[[float], float]
"""What is measured, as a function of the friction between dominoes."""
Effect = Callable[[Setting, float, float], float]
"""Speed with the effect over speed without, of a setting at a pitch and a friction."""

RTOL = 1e-6  # of times; what is measured is known to a thousandth at best
ROUGHEST = 1.5  # friction looked for
TRIED = 61  # frictions tried before the best of them is refined
CLOSE = 1e-7  # of the friction
STEP = 1e-4  # of the friction, for slopes
MOST = 2.0  # standard uncertainties that a row may deviate and still count as explained
CLEARLY = 1.0  # standard uncertainties by which both ends of a trend have to deviate
HELPFUL = 0.75  # of the largest deviation without an effect
STANDING, SETTLED = 24, 10  # dominoes on a floor, and those before their wave is steady
STANDING_RTOL = 1e-2  # coarsest steps give times within 0.1 % of the finest
DRAWS, SEED = 20, 18  # layouts with uneven gaps, and their seed
DOMINOES, STARTED = 60, 20  # in them, and those before the wave counts as steady
NARROWEST, HIGHEST = 0.05, 0.999  # [gaps], [heights]: gaps drawn beyond are as wide as this


@dataclass(frozen=True)
class Comparison:
    """A source beside the model, in one reading.

    Attributes
    ----------
    what
        The reading in words; empty for the source's own.
    setting
        The same as numbers.
    rows
        (K,) those that it speaks of.
    friction, uncertainty
        Of least squares, and its standard error; where the rows scatter more than their
        uncertainties, as they scatter.
    sigmas
        (K,) one standard uncertainty of each value, that of x included.
    explained
        (K,) values at that friction.
    single
        (K,) friction that explains each row alone; nan where none does.
    smooth
        (K,) values without friction.
    predicted
        (K,) values at the friction fitted to the rows of all other spacings; nan for one spacing.
    factors
        (K,) factors of an effect on the model's speeds; 1 without.
    """

    what: str
    setting: Setting
    rows: tuple[Row, ...]
    friction: float
    uncertainty: float
    sigmas: tuple[float, ...]
    explained: tuple[float, ...]
    single: tuple[float, ...]
    smooth: tuple[float, ...]
    predicted: tuple[float, ...]
    factors: tuple[float, ...]

    @property
    def deviations(self) -> tuple[float, ...]:
        """(K,) model less measured, in standard uncertainties."""
        rows = zip(self.explained, self.rows, self.sigmas, strict=True)
        return tuple((e - r.value) / s for e, r, s in rows)

    @property
    def chi_square(self) -> float:
        """Sum of their squares; with K rows, around K - 1 where the model is right."""
        return sum(one * one for one in self.deviations)

    @property
    def worst(self) -> float:
        """The largest of them."""
        return max(map(abs, self.deviations))

    @property
    def holds(self) -> bool:
        """Whether every row is within `MOST` standard uncertainties."""
        return self.worst <= MOST

    @property
    def several(self) -> bool:
        """Whether the rows have more than one spacing; a single one always has its friction."""
        return len({row.x for row in self.rows}) > 1


@dataclass(frozen=True)
class Validation:
    """A source beside the model.

    Attributes
    ----------
    source
        What was measured.
    main
        In the source's own setting.
    readings
        In the other readings that its file names.
    effects
        In its own setting, with one thing that the model leaves out.
    reasons
        Codes of what speaks against the model, or for an explanation; docs/measured.md tells them.
    """

    source: Source
    main: Comparison
    readings: tuple[Comparison, ...]
    effects: tuple[Comparison, ...]
    reasons: tuple[str, ...]

    @property
    def explained(self) -> bool:
        """Whether friction alone explains every row, and is the one measured by itself."""
        return self.main.holds and "friction-disagrees" not in self.reasons


def speed_of(quantity: Quantity, setting: Setting, x: float, value: float) -> float:
    """Return the speed that a measured value means [m/s]."""
    if quantity == "time":
        value = (setting.count - 1) / value
    return value if quantity == "speed" else value * setting.pitch(x)


def row_model(setting: Setting, quantity: Quantity, x: float, factor: float = 1.0) -> Model:
    """Make the model of a row: hits a second, m/s or seconds as a function of the friction.

    Frequency and speed are 0 and a time is infinite where friction is too high for a wave. Each
    friction is simulated once. The factor is on the speed.
    """
    pitch = setting.pitch(x)

    @cache
    def value(friction: float) -> float:
        if setting.measured == "steady":
            physics = Physics(friction, setting.gravity)
            wave = steady_wave(pitch, setting.thickness, setting.height, physics, rtol=RTOL)
            frequency = factor * wave.frequency
        else:
            sizes = {"thickness": setting.thickness, "height": setting.height}
            layout = Layout.uniform(setting.count, pitch=pitch, **sizes)
            whole = simulate(layout, Physics(friction, setting.gravity, setting.push), rtol=RTOL)
            frequency = factor * float(whole.mean_speed / pitch)
        if quantity == "time":
            return (setting.count - 1) / frequency if frequency else math.inf
        return frequency if quantity == "frequency" else frequency * pitch

    return value


def compare(
    source: Source, setting: Setting, what: str = "", factors: Sequence[float] | None = None
) -> Comparison:
    """Compare a source with the model in one reading.

    Parameters
    ----------
    source
        What was measured.
    setting
        What the experiment is taken to be.
    what
        That in words.
    factors
        (K,) factors on the model's speeds, such as the effect of a floor; none without.
    """
    rows, quantity = source.kept(setting), source.quantity
    factors = tuple(factors or [1.0] * len(rows))
    models = [row_model(setting, quantity, r.x, f) for r, f in zip(rows, factors, strict=True)]
    values = [r.value for r in rows]
    sigmas = [r.uncertainty for r in rows]
    best, error = least_squares(models, values, sigmas)
    if setting.x_uncertainty:
        for k, (row, factor) in enumerate(zip(rows, factors, strict=True)):
            beside = (row.x - setting.x_uncertainty, row.x + setting.x_uncertainty)
            low, high = (row_model(setting, quantity, x, factor)(best) for x in beside)
            if math.isfinite(high - low):
                sigmas[k] = math.hypot(row.uncertainty, 0.5 * (high - low))
        best, error = least_squares(models, values, sigmas)
    explained = tuple(m(best) for m in models)
    square = sum(((e - v) / s) ** 2 for e, v, s in zip(explained, values, sigmas, strict=True))
    free = len(rows) - 1
    return Comparison(
        what=what,
        setting=setting,
        rows=rows,
        friction=best,
        uncertainty=error * max(1.0, math.sqrt(square / free) if free else 1.0),
        sigmas=tuple(sigmas),
        explained=explained,
        single=tuple(friction_of(m, v) for m, v in zip(models, values, strict=True)),
        smooth=tuple(m(0.0) for m in models),
        predicted=leave_out([r.x for r in rows], models, values, sigmas),
        factors=factors,
    )


def leave_out(
    places: Sequence[float],
    models: Sequence[Model],
    values: Sequence[float],
    sigmas: Sequence[float],
) -> tuple[float, ...]:
    """Predict each row from a fit to the rows of all other spacings; nan where there are none."""
    found = []
    for place, model in zip(places, models, strict=True):
        rows = zip(places, models, values, sigmas, strict=True)
        others = [row[1:] for row in rows if row[0] != place]
        found.append(model(least_squares(*zip(*others, strict=True))[0]) if others else math.nan)
    return tuple(found)


def least_squares(
    models: Sequence[Model], values: Sequence[float], sigmas: Sequence[float]
) -> tuple[float, float]:
    """Find the friction of the smallest sum of squared errors in units of their uncertainty.

    Parameters
    ----------
    models
        One a value.
    values
        What was measured.
    sigmas
        One standard uncertainty of each.

    Returns
    -------
    tuple
        The friction, between 0 and `ROUGHEST`, and its standard error as the `sigmas` imply it;
        infinite where a wave of the model stops there, or no row depends on the friction.
    """
    from scipy.optimize import minimize_scalar

    rows = list(zip(models, values, sigmas, strict=True))

    def misfit(friction: float) -> float:
        return sum(((m(friction) - v) / s) ** 2 for m, v, s in rows)

    tried = np.linspace(0.0, ROUGHEST, TRIED)
    k = int(np.argmin([misfit(float(x)) for x in tried]))
    around = float(tried[max(k - 1, 0)]), float(tried[min(k + 1, TRIED - 1)])
    refined = minimize_scalar(misfit, bounds=around, method="bounded", options={"xatol": CLOSE})
    # the refinement never tries its bounds
    best = 0.0 if misfit(0.0) <= refined.fun else float(refined.x)
    low = max(best - STEP, 0.0)
    slopes = [(m(best + STEP) - m(low)) / (best + STEP - low) / s for m, _, s in rows]
    steep = sum(s * s for s in slopes)
    known = np.isfinite(steep) and steep > 0.0
    return best, float(1.0 / np.sqrt(steep)) if known else float("inf")


def friction_of(model: Model, value: float) -> float:
    """Find the friction at which a model gives a value; nan where none up to `ROUGHEST` does."""
    from scipy.optimize import brentq

    smooth, rough = model(0.0) - value, model(ROUGHEST) - value
    if smooth * rough > 0.0:
        return float("nan")
    return float(brentq(lambda m: model(m) - value, 0.0, ROUGHEST, xtol=CLOSE))


def fit_friction(
    pitches: Sequence[float],
    frequencies: Sequence[float],
    thickness: float = 0.0075,
    height: float = HEIGHT,
    gravity: float = 9.81,
) -> Comparison:
    """Find the friction that explains measured hit frequencies of long uniform rows.

    Parameters
    ----------
    pitches
        (K,) pivot to pivot, of each row [m].
    frequencies
        (K,) hits a second, each known to 2 %.
    thickness, height
        Of all dominoes [m].
    gravity
        [m/s²]

    Raises
    ------
    ValueError
        For pitches that no row can have, frequencies that are not positive, or no pairs of them.
    """
    source = source_of_frequencies(pitches, frequencies, thickness, height, gravity)
    return compare(source, source.setting)


# What the model leaves out ------------------------------------------------------------------------


def uneven(deviation: float, setting: Setting, pitch: float, friction: float) -> float:
    """Return the factor on the speed of gaps with a standard deviation, in heights."""
    gap = pitch - setting.thickness
    draws = np.random.default_rng(SEED).standard_normal((DRAWS, DOMINOES - 1))
    gaps = np.vstack([np.full(DOMINOES - 1, gap), gap + deviation * setting.height * draws])
    gaps = np.clip(gaps, NARROWEST * gap, HIGHEST * setting.height)
    thickness = np.full(DOMINOES, setting.thickness)
    waves = simulate_batch(gaps, thickness, _pushed(setting, friction), height=setting.height)
    length = gaps[:, STARTED:].sum(axis=1) + (DOMINOES - 1 - STARTED) * setting.thickness
    speed = length / (waves.arrival_times[:, -1] - waves.arrival_times[:, STARTED])
    fell = np.isfinite(speed) & (speed > 0.0)
    return float(speed[1:][fell[1:]].mean() / speed[0]) if fell[0] and fell[1:].any() else 1.0


def slipping(floor: float, setting: Setting, pitch: float, friction: float) -> float:
    """Return the factor on the speed of a floor of this friction, on which feet slide."""
    sizes = {"thickness": setting.thickness, "height": setting.height}
    layout, physics = Layout.uniform(STANDING, pitch=pitch, **sizes), _pushed(setting, friction)
    free = simulate_standing(layout, physics, floor, STANDING_RTOL).arrival_times
    held = simulate(layout, physics).arrival_times
    spent = free[-1] - free[SETTLED], held[-1] - held[SETTLED]
    return float(spent[1] / spent[0]) if np.all(np.isfinite(spent)) else 0.0


def _pushed(setting: Setting, friction: float) -> Physics:
    """A firm push, whatever the size."""
    return Physics(friction, setting.gravity, math.sqrt(setting.gravity / setting.height))


EFFECTS: Mapping[str, Effect] = {
    "gaps uneven by 1 % of the height": partial(uneven, 0.01),
    "gaps uneven by 2 % of the height": partial(uneven, 0.02),
} | {f"a floor of friction {floor:g}": partial(slipping, floor) for floor in (1.0, 0.5, 0.3)}


# Every reading of a source ------------------------------------------------------------------------


def validate(source: Source, effects: Mapping[str, Effect] = EFFECTS) -> Validation:
    """Compare a source with the model in its own setting, in other readings, with each effect.

    Parameters
    ----------
    source
        What was measured.
    effects
        What the model leaves out, by its words.
    """
    main = compare(source, source.setting)
    readings = tuple(compare(source, one, what) for what, one in source.readings.items())
    setting, tried = main.setting, []
    for what, effect in effects.items():
        factors = [effect(setting, setting.pitch(row.x), main.friction) for row in main.rows]
        tried.append(compare(source, setting, what, factors))
    return Validation(source, main, readings, tuple(tried), _reasons(source, main, readings, tried))


def _reasons(
    source: Source, main: Comparison, readings: Sequence[Comparison], effects: Sequence[Comparison]
) -> tuple[str, ...]:
    """Codes; those of a pattern where friction does not explain every row."""
    # a time falls where a speed rises
    sign = -1.0 if source.quantity == "time" else 1.0
    ahead = sorted((row.x, -sign * d) for row, d in zip(main.rows, main.deviations, strict=True))
    narrow, wide = ahead[0][1], ahead[-1][1]
    told, uncertainty = source.friction, main.uncertainty
    off = 0.0
    if told is not None and math.isfinite(uncertainty):
        off = abs(main.friction - told.value) / math.hypot(told.uncertainty, uncertainty)
    rows = list(zip(main.rows, main.smooth, main.sigmas, strict=True))
    best = min(effects, key=lambda one: one.worst, default=main)
    patterns = {
        "no-wave": not all(0.0 < value < math.inf for value in main.explained),
        "faster-than-frictionless": any(sign * (r.value - v) > MOST * s for r, v, s in rows),
        "friction-grows-with-gap": narrow > CLEARLY and wide < -CLEARLY,
        "friction-falls-with-gap": narrow < -CLEARLY and wide > CLEARLY,
        "floors-differ": len({row.floor for row in main.rows}) > 1,
        "explained-in-another-reading": any(r.holds and r.several for r in readings),
        f"helped-by: {best.what}": best.worst < HELPFUL * main.worst,
    }
    found = [code for code, is_so in patterns.items() if is_so and not main.holds]
    found += ["single-row"] if len(main.rows) == 1 else []
    return (*found, "friction-disagrees") if off > MOST else tuple(found)
