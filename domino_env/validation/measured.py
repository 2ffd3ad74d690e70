"""Comparison of measured chains with the model: fitted friction, predictions, reason codes.

A source is compared in its own setting, in its other readings (interpretations of the experiment,
see `source`), and with each of several effects that the model neglects. The size of an effect is
that in simulated layouts at the fitted friction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import msgspec
import numpy as np

from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.standard import HEIGHT
from domino_env.physics.steady import steady_wave
from domino_env.physics.wave import simulate, simulate_batch
from domino_env.rigid.simulation import simulate_standing
from domino_env.validation.source import TEMPLATE, MeasuredChain, Quantity, Setting, Source

Effect = Callable[[Setting, float, float], float]
"""Function of setting, pitch [m] and friction: speed with an effect over speed without it."""

RTOL = 1e-6  # of simulated times; measurements are known to a thousandth at best
MAX_FRICTION = 1.5  # of fits
GRID_POINTS = 61  # frictions that are tried before the best is refined
FRICTION_TOLERANCE = 1e-7  # of the refined one
FRICTION_STEP = 1e-4  # for the derivative with respect to the friction
MAX_DEVIATION = 2.0  # [standard uncertainties] of an explained chain
MIN_TREND = 1.0  # [standard uncertainties] deviations of opposite sign at the two ends of a trend
HELPFUL_RATIO = 0.75  # largest deviation with a helpful effect, over that without
# simulations on a floor: number of dominoes, and the first from which the wave counts as steady
COUNT_ON_FLOOR, STEADY_ON_FLOOR = 24, 10
RTOL_ON_FLOOR = 1e-2  # the coarsest steps give times within 0.1 % of the finest
# layouts with uneven gaps: their number, and the seed of the gaps
SAMPLES, SEED = 20, 18
# their number of dominoes, and the first from which the wave counts as steady
COUNT_UNEVEN, STEADY_UNEVEN = 60, 20
LARGEST_PART = 0.9  # by which a gap changes, of its distance to 0 or to the height, at most
NARROWEST, WIDEST = 0.05, 0.999  # limits of an uneven gap, in mean gaps and in heights


@dataclass(frozen=True, eq=False)
class Comparison:
    """A source compared with the model in one reading.

    Attributes
    ----------
    label
        Description of the reading; empty for the source's own.
    setting
        Setting of the reading.
    chains
        (K,) measured chains on the floor of the reading.
    factors
        (K,) factors of an effect on the speeds of the model; 1 without an effect.
    friction, uncertainty
        Friction between dominoes by least squares, and its standard error. If the chains scatter by
        more than their uncertainties, it is larger in proportion.
    sigmas
        (K,) standard uncertainty of each measured value, that of x included.
    model
        (K,) values of the model at the fitted friction.
    frictionless
        (K,) values of the model without friction.
    predicted
        (K,) values of the model at the friction fitted to the chains of all other spacings; nan if
        there are none.
    """

    label: str
    setting: Setting
    chains: tuple[MeasuredChain, ...]
    factors: Floats
    friction: float
    uncertainty: float
    sigmas: Floats
    model: Floats
    frictionless: Floats
    predicted: Floats

    @property
    def deviations(self) -> Floats:
        """(K,) model minus measured value, in standard uncertainties."""
        return (self.model - [chain.value for chain in self.chains]) / self.sigmas

    @property
    def chi_square(self) -> float:
        """Sum of squared deviations; around K - 1 for K chains if the model is right."""
        return float(np.sum(self.deviations**2))

    @property
    def worst(self) -> float:
        """Largest deviation, as a magnitude."""
        return float(np.max(np.abs(self.deviations)))

    @property
    def holds(self) -> bool:
        """True if every chain is within `MAX_DEVIATION`."""
        return self.worst <= MAX_DEVIATION


@dataclass(frozen=True, eq=False)
class Validation:
    """A source compared with the model in all readings.

    Attributes
    ----------
    source
        The measurements.
    main
        Comparison in the source's own setting.
    readings
        Comparisons in other readings.
    effects
        Comparisons in its own setting, each with one effect that the model neglects.
    reasons
        Codes of the evidence against the model, or for an explanation; docs/measured.md lists them.
    """

    source: Source
    main: Comparison
    readings: tuple[Comparison, ...]
    effects: tuple[Comparison, ...]
    reasons: tuple[str, ...]

    @property
    def explained(self) -> bool:
        """True if friction alone explains every chain, and agrees with a measurement of it."""
        return self.main.holds and "friction-disagrees" not in self.reasons


@cache
def hit_frequency(setting: Setting, pitch: float, friction: float) -> float:
    """Return the hits per second of the model at a pitch [m]; 0 if friction stops the wave."""
    if setting.measured == "steady":
        physics = Physics(friction, setting.gravity)
        wave = steady_wave(pitch, setting.thickness, setting.height, physics, rtol=RTOL)
        return float(wave.frequency)
    sizes = {"thickness": setting.thickness, "height": setting.height}
    layout = Layout.uniform(setting.count, pitch=pitch, **sizes)
    physics = Physics(friction, setting.gravity, setting.push)
    return float(simulate(layout, physics, rtol=RTOL).mean_speed / pitch)


def model_value(
    quantity: Quantity, setting: Setting, x: float, friction: float, factor: float = 1.0
) -> float:
    """Return the model's frequency [1/s], speed [m/s] or time [s] of a chain.

    The factor multiplies the speed. If friction stops the wave, frequency and speed are 0 and the
    time is infinite.
    """
    pitch = setting.pitch(x)
    frequency = factor * hit_frequency(setting, pitch, friction)
    if quantity == "time":
        return (setting.count - 1) / frequency if frequency else math.inf
    return frequency if quantity == "frequency" else frequency * pitch


def compare(
    source: Source, setting: Setting, label: str = "", factors: Sequence[float] | float = 1.0
) -> Comparison:
    """Compare a source with the model in one reading, at the friction that fits best.

    Parameters
    ----------
    source
        The measurements.
    setting
        Setting of the reading.
    label
        Description of the reading; empty for the source's own.
    factors
        (K,) factors on the speeds of the model, such as the effect of a floor.

    Returns
    -------
    Comparison
        Fitted friction and values of the model.
    """
    chains = source.chains_of(setting)
    x, values, sigmas = np.array([(c.x, c.value, c.uncertainty) for c in chains]).T
    scale = np.broadcast_to(np.asarray(factors, dtype=np.float64), len(chains))

    def model(friction: float, shift: float | Floats = 0.0) -> Floats:
        return np.array([
            model_value(source.quantity, setting, xk, friction, factor)
            for xk, factor in zip(x + shift, scale, strict=True)
        ])  # fmt: skip

    friction, uncertainty = fit(model, values, sigmas)
    if setting.x_uncertainty:
        gaps = np.array([setting.pitch(xk) - setting.thickness for xk in x])
        room = np.minimum(gaps, setting.height - gaps) / setting.x_length
        change = np.minimum(setting.x_uncertainty, LARGEST_PART * room)
        low, high = (model(friction, sign * change) for sign in (-1, 1))
        with np.errstate(invalid="ignore"):  # infinite times of waves that stop
            effect = 0.5 * (high - low) * (setting.x_uncertainty / change)
        sigmas = np.hypot(sigmas, np.nan_to_num(effect, posinf=0.0, neginf=0.0))
        friction, uncertainty = fit(model, values, sigmas)
    predicted = np.full(len(chains), np.nan)
    for k, others in enumerate(x != x[:, None]):  # chains of other spacings
        if others.any():
            predicted[k] = model(fit(model, values, sigmas, others)[0])[k]
    deviations = (model(friction) - values) / sigmas
    if len(chains) > 1:
        uncertainty *= max(1.0, float(np.linalg.norm(deviations)) / math.sqrt(len(chains) - 1))
    return Comparison(
        label, setting, chains, scale, friction, uncertainty, sigmas, model(friction), model(0.0),
        predicted,
    )  # fmt: skip


def fit(
    model: Callable[[float], Floats], values: Floats, sigmas: Floats, chosen: Any = slice(None)
) -> tuple[float, float]:
    """Fit the friction by least squares, from 0 to `MAX_FRICTION`.

    Parameters
    ----------
    model
        Function of the friction that returns the values of the model, (K,).
    values, sigmas
        (K,) measured values and their standard uncertainties.
    chosen
        Index of the values that count; all by default.

    Returns
    -------
    tuple
        Friction, and the standard error that follows from `sigmas`: infinite if the wave of a chain
        stops at this friction, or if no chain depends on it.
    """
    from scipy.optimize import minimize_scalar

    def misfit(friction: float) -> float:
        return float(np.sum((((model(friction) - values) / sigmas)[chosen]) ** 2))

    grid = np.linspace(0.0, MAX_FRICTION, GRID_POINTS)
    k = int(np.argmin([misfit(float(x)) for x in grid]))
    bounds = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, GRID_POINTS - 1)])
    refined = minimize_scalar(
        misfit, bounds=bounds, method="bounded", options={"xatol": FRICTION_TOLERANCE}
    )
    # the refinement does not evaluate its bounds, of which 0 may be the best
    best = 0.0 if misfit(0.0) <= refined.fun else float(refined.x)
    low, high = max(best - FRICTION_STEP, 0.0), best + FRICTION_STEP
    with np.errstate(invalid="ignore"):  # infinite times of waves that stop
        rates = ((model(high) - model(low)) / (high - low) / sigmas)[chosen]
    steepness = float(np.linalg.norm(rates))
    return best, 1.0 / steepness if 0.0 < steepness < math.inf else math.inf


def fit_friction(
    pitches: Sequence[float],
    frequencies: Sequence[float],
    thickness: float = 0.0075,
    height: float = HEIGHT,
    gravity: float = 9.81,
) -> Comparison:
    """Fit the friction between dominoes to measured hit frequencies of long uniform chains.

    Parameters
    ----------
    pitches
        (K,) pitch of each chain [m], taken as exact.
    frequencies
        (K,) hits per second [1/s], each with a standard uncertainty of 2 %.
    thickness, height
        Sizes of all dominoes [m].
    gravity
        Acceleration of gravity [m/s²].

    Returns
    -------
    Comparison
        Fitted `friction` and its `uncertainty`, and the values of the model beside the measured.

    Raises
    ------
    ValueError
        For pitches that no chain can have, frequencies that are not positive, and different numbers
        of them.

    Examples
    --------
    >>> import domino_env as de
    >>> round(de.fit_friction([0.016, 0.024, 0.032], [64.4, 42.3, 28.1]).friction, 2)
    0.18
    """
    setting = {"thickness": thickness, "height": height, "gravity": gravity}
    source = Source.from_frequencies(pitches, frequencies, **setting)
    return compare(source, source.setting)


# Effects that the model neglects ------------------------------------------------------------------


def uneven_gap_factor(deviation: float, setting: Setting, pitch: float, friction: float) -> float:
    """Return the mean speed with random gaps over the speed with equal gaps.

    deviation: standard deviation of the gaps [heights]. The result is 1 if the wave stops
    in the uniform layout or in all of the random ones.
    """
    gap, count, first = pitch - setting.thickness, COUNT_UNEVEN, STEADY_UNEVEN
    noise = np.random.default_rng(SEED).standard_normal((SAMPLES, count - 1))
    # the first layout is uniform
    gaps = gap + deviation * setting.height * np.vstack([np.zeros(count - 1), noise])
    gaps = np.clip(gaps, NARROWEST * gap, WIDEST * setting.height)
    thickness = np.full(count, setting.thickness)
    waves = simulate_batch(gaps, thickness, _firm_push(setting, friction), height=setting.height)
    length = gaps[:, first:].sum(axis=1) + (count - 1 - first) * setting.thickness
    with np.errstate(invalid="ignore"):  # infinite times of waves that stop
        speed = length / (waves.arrival_times[:, -1] - waves.arrival_times[:, first])
    completes = np.isfinite(speed) & (speed > 0.0)
    if not completes[0] or not completes[1:].any():
        return 1.0
    return float(speed[1:][completes[1:]].mean() / speed[0])


def floor_factor(floor: float, setting: Setting, pitch: float, friction: float) -> float:
    """Return the speed on a floor of this friction over that on fixed pivots; 0 if a wave stops."""
    sizes = {"thickness": setting.thickness, "height": setting.height}
    layout = Layout.uniform(COUNT_ON_FLOOR, pitch=pitch, **sizes)
    physics = _firm_push(setting, friction)
    free = simulate_standing(layout, physics, floor, RTOL_ON_FLOOR).arrival_times
    fixed = simulate(layout, physics).arrival_times
    on_floor, on_pivots = (times[-1] - times[STEADY_ON_FLOOR] for times in (free, fixed))
    return float(on_pivots / on_floor) if np.isfinite([on_floor, on_pivots]).all() else 0.0


def _firm_push(setting: Setting, friction: float) -> Physics:
    """Return physics with a push of √(g/L), firm for dominoes of any size."""
    return Physics(friction, setting.gravity, math.sqrt(setting.gravity / setting.height))


EFFECTS: Mapping[str, Effect] = {
    "gaps uneven by 1 % of the height": partial(uneven_gap_factor, 0.01),
    "gaps uneven by 2 % of the height": partial(uneven_gap_factor, 0.02),
} | {f"a floor of friction {floor:g}": partial(floor_factor, floor) for floor in (1.0, 0.5, 0.3)}


# All readings of a source -------------------------------------------------------------------------


def validate(source: Source, effects: Mapping[str, Effect] = EFFECTS) -> Validation:
    """Compare a source with the model in its own setting, in other readings and with each effect.

    If the source gives its spacings no uncertainty, one more reading has that of a template.

    Parameters
    ----------
    source
        The measurements.
    effects
        Effects that the model neglects, by their labels.

    Returns
    -------
    Validation
        All comparisons, and the reason codes.
    """
    setting, settings = source.setting, source.readings
    if not setting.x_uncertainty:
        uncertain = msgspec.structs.replace(setting, x_uncertainty=TEMPLATE / setting.x_length)
        settings[f"spacings uncertain by {1e3 * TEMPLATE:g} mm"] = uncertain
    main = compare(source, setting)
    readings = tuple(compare(source, reading, label) for label, reading in settings.items())
    with_effects = tuple(
        compare(source, setting, label, [
            effect(setting, setting.pitch(chain.x), main.friction) for chain in main.chains
        ])
        for label, effect in effects.items()
    )  # fmt: skip
    reasons = _reasons(source, main, readings, with_effects)
    return Validation(source, main, readings, with_effects, reasons)


def _reasons(
    source: Source, main: Comparison, readings: Sequence[Comparison], effects: Sequence[Comparison]
) -> tuple[str, ...]:
    """Return the reason codes; those of patterns only if friction does not explain every chain."""
    sign = -1.0 if source.quantity == "time" else 1.0  # of a change of the value if speed rises
    order = np.argsort([chain.x for chain in main.chains], kind="stable")
    # deviations at the ends, positive if the measured wave is faster; one chain is both ends
    narrow, *_, wide = np.repeat(-sign * main.deviations[order], 2)
    measured = np.array([chain.value for chain in main.chains])
    # a single spacing is explained by some friction, whatever the reading
    explaining = [r.label for r in readings if r.holds and len({c.x for c in r.chains}) > 1]
    best = min(effects, key=lambda comparison: comparison.worst, default=main)
    patterns = {
        "no-wave": not np.all((main.model > 0.0) & (main.model < math.inf)),
        "faster-than-frictionless": np.any(
            sign * (measured - main.frictionless) > MAX_DEVIATION * main.sigmas
        ),
        "friction-grows-with-gap": narrow > MIN_TREND and wide < -MIN_TREND,
        "friction-falls-with-gap": narrow < -MIN_TREND and wide > MIN_TREND,
        "floors-differ": len({chain.floor for chain in main.chains}) > 1,
        f"explained-in-another-reading: {''.join(explaining[:1])}": explaining,
        f"helped-by: {best.label}": best.worst < HELPFUL_RATIO * main.worst,
    }
    codes = [code for code, applies in patterns.items() if applies and not main.holds]
    codes += ["single-chain"] * (len(main.chains) == 1)
    if (independent := source.friction) is not None and math.isfinite(main.uncertainty):
        difference = abs(main.friction - independent.value)
        if difference > MAX_DEVIATION * math.hypot(independent.uncertainty, main.uncertainty):
            codes.append("friction-disagrees")
    return tuple(codes)
