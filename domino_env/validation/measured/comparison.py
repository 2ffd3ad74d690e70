"""A source beside the model: friction fitted, each spacing left out in turn, other readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from domino_env.validation.measured.fit import Model, friction_of, least_squares
from domino_env.validation.measured.model import row_model
from domino_env.validation.measured.source import Row, Setting, Source

MOST = 2.0  # standard uncertainties that a row may be off and still count as explained


@dataclass(frozen=True)
class LeftOut:
    """One spacing, foretold by a fit to all others.

    Attributes
    ----------
    x
        The spacing, as its source tells it.
    friction
        Fitted without it.
    error
        Foretold over measured, less one; the largest where the spacing has several rows.
    off
        The same in standard uncertainties of the row.
    """

    x: float
    friction: float
    error: float
    off: float


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
        uncertainties say, as they scatter.
    sigmas
        (K,) one standard uncertainty of each value, that of x included.
    explained
        (K,) values at that friction.
    single
        (K,) friction that explains each row alone; nan where none does.
    smooth
        (K,) values without friction.
    left_out
        One for each spacing; empty where there is only one.
    factors
        (K,) what the model's speeds were multiplied with; 1 without an effect.
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
    left_out: tuple[LeftOut, ...]
    factors: tuple[float, ...]

    @property
    def off(self) -> tuple[float, ...]:
        """(K,) model less measured, in standard uncertainties."""
        rows = zip(self.explained, self.rows, self.sigmas, strict=True)
        return tuple((e - r.value) / s for e, r, s in rows)

    @property
    def square(self) -> float:
        """The sum of their squares, χ²; with K rows, around K - 1 where the model is right."""
        return sum(o * o for o in self.off)

    @property
    def worst(self) -> float:
        """The largest of these."""
        return max(map(abs, self.off))

    @property
    def holds(self) -> bool:
        """Whether every row is within `MOST` standard uncertainties."""
        return self.worst <= MOST


def compare(
    source: Source, setting: Setting, what: str = "", factors: Sequence[float] | None = None
) -> Comparison:
    """Put a source beside the model in one reading.

    Parameters
    ----------
    source
        What was measured.
    setting
        What the experiment is taken to be.
    what
        That in words.
    factors
        (K,) what the model's speeds are multiplied with, such as the effect of a floor; none
        without.
    """
    rows = source.kept(setting)
    factors = tuple(factors or [1.0] * len(rows))
    scales = [_scale(source, factor) for factor in factors]
    models = [
        _times(row_model(setting, source.quantity, row.x), scale)
        for row, scale in zip(rows, scales, strict=True)
    ]
    values = [r.value for r in rows]
    sigmas = [r.uncertainty for r in rows]
    best, _ = least_squares(models, values, sigmas)
    if setting.x_uncertainty:
        sigmas = [
            math.hypot(r.uncertainty, f * _slope(source, setting, r.x, best) if f < math.inf else 0)
            for r, f in zip(rows, scales, strict=True)
        ]
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
        left_out=leave_out([r.x for r in rows], models, values, sigmas),
        factors=factors,
    )


def leave_out(
    places: Sequence[float],
    models: Sequence[Model],
    values: Sequence[float],
    sigmas: Sequence[float],
) -> tuple[LeftOut, ...]:
    """Foretell each spacing from a fit to all others.

    Parameters
    ----------
    places
        (K,) spacings; rows of equal spacing are left out together.
    models, values, sigmas
        (K,) as for `least_squares`.
    """
    different = list(dict.fromkeys(places))
    if len(different) < 2:
        return ()
    found = []
    for place in different:
        rows = list(zip(places, models, values, sigmas, strict=True))
        _, kept, told, doubt = zip(*(r for r in rows if r[0] != place), strict=True)
        friction, _ = least_squares(kept, told, doubt)
        errors = [
            (m(friction) / v - 1.0, (m(friction) - v) / s) for x, m, v, s in rows if x == place
        ]
        worst = max(errors, key=lambda e: abs(e[1]))
        found.append(LeftOut(place, friction, *worst))
    return tuple(found)


def _slope(source: Source, setting: Setting, x: float, friction: float) -> float:
    """What one standard uncertainty of x does to the model's value."""
    beside = (x - setting.x_uncertainty, x + setting.x_uncertainty)
    low, high = (row_model(setting, source.quantity, b)(friction) for b in beside)
    return 0.5 * (high - low) if math.isfinite(high - low) else 0.0


def _scale(source: Source, factor: float) -> float:
    """What a factor on the speed does to what was measured."""
    if source.quantity != "time":
        return factor
    return 1.0 / factor if factor else math.inf


def _times(model: Model, factor: float) -> Model:
    return lambda friction: factor * model(friction)
