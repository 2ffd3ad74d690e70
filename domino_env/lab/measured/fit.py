"""Fit: the friction that explains measured hit frequencies of uniform rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from domino_env.chain.physics import Physics
from domino_env.chain.standard import HEIGHT
from domino_env.chain.steady import steady_wave

HIGHEST = 1.5  # friction looked for
LOOKS = 61  # frictions tried before the best of them is refined
CLOSE = 1e-7  # of the friction


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

    def model(pitch: float, friction: float) -> float:
        wave = steady_wave(pitch, thickness, height, Physics(friction, gravity))
        return wave.frequency  # 0 where friction is too high for a wave

    def misfit(friction: float) -> float:
        rows = zip(pitches, frequencies, strict=True)
        return sum((model(p, friction) / f - 1.0) ** 2 for p, f in rows)

    best = _lowest(misfit, 0.0, HIGHEST)
    single = tuple(
        _crossing(lambda m, p=p, f=f: model(p, m) - f)  # type: ignore[misc]
        for p, f in zip(pitches, frequencies, strict=True)
    )
    step = 1e-4
    low = max(best - step, 0.0)
    slopes = [
        (model(p, best + step) - model(p, low)) / (best + step - low) / f
        for p, f in zip(pitches, frequencies, strict=True)
    ]
    free = len(pitches) - 1
    scatter = np.sqrt(misfit(best) / free / sum(s * s for s in slopes)) if free else np.nan
    return Fit(best, float(scatter), single, tuple(model(p, best) for p in pitches))


def _lowest(function: Callable[[float], float], low: float, high: float) -> float:
    """The best of a coarse look, refined between its neighbours."""
    from scipy.optimize import minimize_scalar

    looks = np.linspace(low, high, LOOKS)
    k = int(np.argmin([function(float(x)) for x in looks]))
    around = float(looks[max(k - 1, 0)]), float(looks[min(k + 1, LOOKS - 1)])
    found = minimize_scalar(function, bounds=around, method="bounded", options={"xatol": CLOSE})
    return low if function(low) <= found.fun else float(found.x)  # it never tries the bounds


def _crossing(function: Callable[[float], float]) -> float:
    """Where a falling function crosses zero; nan where it does not."""
    from scipy.optimize import brentq

    if function(0.0) < 0.0 or function(HIGHEST) > 0.0:
        return float("nan")
    return float(brentq(function, 0.0, HIGHEST, xtol=CLOSE))
