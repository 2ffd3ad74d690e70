"""Fit: the friction that explains what was measured of uniform rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from domino_env.physics.physics import Physics
from domino_env.physics.standard import HEIGHT
from domino_env.physics.steady import steady_wave

HIGHEST = 1.5  # friction looked for
LOOKS = 61  # frictions tried before the best of them is refined
CLOSE = 1e-7  # of the friction
STEP = 1e-4  # of the friction, for slopes

Model = Callable[[float], float]
"""What is measured, as a function of the friction between dominoes."""


@dataclass(frozen=True)
class Fit:
    """The friction that explains all rows best.

    Attributes
    ----------
    friction
        Of least squares in relative frequency.
    uncertainty
        Its standard error, as the rows' scatter implies it; nan for a single row.
    single
        (K,) friction that explains each row alone; nan where none does.
    explained
        (K,) hits a second at the common friction.
    """

    friction: float
    uncertainty: float
    single: tuple[float, ...]
    explained: tuple[float, ...]


def fit_friction(
    pitches: Sequence[float],
    frequencies: Sequence[float],
    thickness: float = 0.0075,
    height: float = HEIGHT,
    gravity: float = 9.81,
) -> Fit:
    """Find the friction that explains measured hit frequencies of long uniform rows.

    Parameters
    ----------
    pitches
        (K,) pivot to pivot, of each row [m].
    frequencies
        (K,) hits a second.
    thickness
        Of all dominoes [m].
    height
        Of all dominoes [m].
    gravity
        [m/s²]

    Raises
    ------
    ValueError
        For pitches that no row can have, frequencies that are not positive, or no pairs of them.
    """
    if len(pitches) != len(frequencies) or not len(pitches):
        raise ValueError(f"{len(pitches)} pitches and {len(frequencies)} frequencies: give pairs")
    for pitch, told in zip(pitches, frequencies, strict=True):
        if not thickness < pitch < thickness + height:
            raise ValueError(
                f"pitch = {pitch} m: must be between the thickness {thickness} m and that plus "
                f"the height {height} m"
            )
        if not 0.0 < told < np.inf:
            raise ValueError(f"frequency = {told}: must be positive and finite")

    def model(pitch: float) -> Model:
        @cache
        def frequency(friction: float) -> float:  # 0 where friction is too high for a wave
            return steady_wave(pitch, thickness, height, Physics(friction, gravity)).frequency

        return frequency

    models = [model(p) for p in pitches]
    best, error = least_squares(models, frequencies, frequencies)
    free = len(pitches) - 1
    scatter = sum((m(best) / f - 1.0) ** 2 for m, f in zip(models, frequencies, strict=True))
    single = tuple(friction_of(m, f) for m, f in zip(models, frequencies, strict=True))
    uncertainty = error * np.sqrt(scatter / free) if free else np.nan
    return Fit(best, float(uncertainty), single, tuple(m(best) for m in models))


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
        The friction, between 0 and `HIGHEST`, and its standard error as the `sigmas` imply it;
        infinite where a row of the model dies there, or none tells the friction.
    """
    rows = list(zip(models, values, sigmas, strict=True))

    def misfit(friction: float) -> float:
        return sum(((m(friction) - v) / s) ** 2 for m, v, s in rows)

    best = _lowest(misfit, 0.0, HIGHEST)
    low = max(best - STEP, 0.0)
    slopes = [(m(best + STEP) - m(low)) / (best + STEP - low) / s for m, _, s in rows]
    steep = sum(s * s for s in slopes)
    known = np.isfinite(steep) and steep > 0.0
    return best, float(1.0 / np.sqrt(steep)) if known else float("inf")


def friction_of(model: Model, value: float) -> float:
    """Find the friction at which a model gives a value; nan where none up to `HIGHEST` does."""
    from scipy.optimize import brentq

    smooth, rough = model(0.0) - value, model(HIGHEST) - value
    if smooth * rough > 0.0:
        return float("nan")
    return float(brentq(lambda m: model(m) - value, 0.0, HIGHEST, xtol=CLOSE))


def _lowest(function: Callable[[float], float], low: float, high: float) -> float:
    """The best of a coarse look, refined between its neighbours."""
    from scipy.optimize import minimize_scalar

    looks = np.linspace(low, high, LOOKS)
    k = int(np.argmin([function(float(x)) for x in looks]))
    around = float(looks[max(k - 1, 0)]), float(looks[min(k + 1, LOOKS - 1)])
    found = minimize_scalar(function, bounds=around, method="bounded", options={"xatol": CLOSE})
    return low if function(low) <= found.fun else float(found.x)  # it never tries the bounds
