"""Measured gain of one layout over another, from several recordings of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from domino_env.core.checks import require
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import simulate
from domino_env.validation.measurement import Measurement

EQUAL = 1e-6  # relative range of sizes that count as equal
LEAST_RUNS = 5  # of each layout, for an interval
CONFIDENCE = 0.95
CERTAIN_GAIN = 0.03  # gain for which the number of further recordings is stated
MOST_RUNS = 10_000


@dataclass(frozen=True)
class MeasuredGain:
    """Gain in mean speed of a layout over another.

    Attributes
    ----------
    gain
        Ratio of the geometric means of the measured speeds, minus 1.
    interval
        95 % interval of the gain by Welch's t test of the logarithms of the speeds; None with less
        than five recordings of a layout.
    predicted
        Gain of the model, with the mean of the measured frictions and pushes; nan where a wave of
        the model stops.
    further
        Further recordings of each layout after which the interval would not contain 0 if the gain
        were 3 %; None with less than two recordings of a layout.
    """

    gain: float
    interval: tuple[float, float] | None
    predicted: float
    further: int | None

    def __str__(self) -> str:
        text = f"measured gain {self.gain:+.2%}"
        if self.interval is None:
            text += f" (no interval: it takes {LEAST_RUNS} recordings of each layout)"
        else:
            text += f" (95 % interval {self.interval[0]:+.2%} to {self.interval[1]:+.2%})"
        known = f"predicted {self.predicted:+.2%}"
        text += f", {known if np.isfinite(self.predicted) else 'in the model a wave stops'}"
        if self.further:
            text += f"; {self.further} further recordings of each would make a gain of 3 % certain"
        elif self.further == 0:
            text += "; the recordings suffice for a gain of 3 %"
        return text


def measured_gain(base: Sequence[Measurement], other: Sequence[Measurement]) -> MeasuredGain:
    """Compute the gain in mean speed of a layout over another.

    Parameters
    ----------
    base, other
        Measurements of the layout to compare with, and of the other one.

    Returns
    -------
    MeasuredGain
        The gain, its interval and the prediction.

    Raises
    ------
    ValueError
        If there is no measurement of a layout.
    """
    for name, group in ("base", base), ("other", other):
        require(f"number of measurements of {name}", len(group), 1, whole=True)
    logs = [np.log([m.mean_speed for m in group]) for group in (base, other)]
    difference = float(logs[1].mean() - logs[0].mean())
    friction, push = (
        float(np.mean([getattr(m, name) for m in (*base, *other)])) for name in ("friction", "push")
    )
    physics = base[0].physics.replace(friction=friction, push=push)
    speeds = [simulate(group[0].layout, physics).mean_speed for group in (base, other)]
    interval = further = None
    counts = [len(group) for group in (base, other)]
    if min(counts) >= LEAST_RUNS:
        test = stats.ttest_ind(logs[1], logs[0], equal_var=False)
        low, high = test.confidence_interval(CONFIDENCE)
        interval = float(np.expm1(low)), float(np.expm1(high))
    if min(counts) >= 2:
        further = max(_runs_needed(logs) - min(counts), 0)
    predicted = speeds[1] / speeds[0] - 1.0 if min(speeds) > 0.0 else np.nan
    return MeasuredGain(float(np.expm1(difference)), interval, float(predicted), further)


def _runs_needed(logs: Sequence[Floats]) -> int:
    """Return the number of recordings of each with which a gain of 3 % would be certain."""
    deviation = np.sqrt(np.mean([np.var(group, ddof=1) for group in logs]))
    runs = np.arange(LEAST_RUNS, MOST_RUNS)
    width = stats.t.ppf(0.5 + 0.5 * CONFIDENCE, 2 * runs - 2) * deviation * np.sqrt(2.0 / runs)
    return int(runs[min(np.searchsorted(-width, -np.log1p(CERTAIN_GAIN)), len(runs) - 1)])


def require_equal_dominoes(layout: Layout, name: str) -> None:
    """Raise a ValueError for a layout of unequal dominoes, or one on uneven ground."""
    sizes = layout.thickness, layout.height, layout.density
    if not layout.is_flat or any(np.ptp(values) > EQUAL * values[0] for values in sizes):
        raise ValueError(
            f"{name} is written for equal dominoes on flat ground: give a layout of such, or with "
            "its scene beside it for domino optimize; the form for measurements takes all others"
        )


def source_document(groups: Sequence[Sequence[Measurement]]) -> dict[str, Any]:
    """Return the tables of a file of a measured source, as `domino validate` reads them.

    Parameters
    ----------
    groups
        Measurements of each layout, all of equal dominoes and gaps.

    Raises
    ------
    ValueError
        For a layout with unequal gaps or dominoes, and layouts of different dominoes.
    """
    rows, settings = [], []
    for group in groups:
        layout, physics = group[0].layout, group[0].physics
        require_equal_dominoes(layout, "a source")
        if np.ptp(layout.spacing) > EQUAL * layout.height[0]:
            raise ValueError(
                "a source contains chains of equal gaps: leave out the layouts with unequal ones, "
                "which the form for measurements takes"
            )
        speeds = [m.mean_speed for m in group]
        error = float(np.mean([m.mean_speed_error for m in group]))
        if len(group) >= LEAST_RUNS:
            error = float(stats.sem(speeds))
        rows.append({
            "x": float(layout.spacing[0]), "value": float(np.mean(speeds)), "uncertainty": error,
        })  # fmt: skip
        settings.append({
            "count": layout.count, "thickness": float(layout.thickness[0]),
            "height": float(layout.height[0]), "width": layout.width,
            "gravity": physics.gravity,
        })  # fmt: skip
    if any(setting != settings[0] for setting in settings):
        raise ValueError(
            "the layouts have different dominoes or numbers of them: write one source for each"
        )
    pushes = [m.push for group in groups for m in group]
    return {
        "title": "Chains measured by their sound", "reference": "not published",
        "read": "own measurement", "method": "sound of the whole chain, domino measure",
        "errors": "standard errors of the mean, or of one recording with fewer than five",
        "unknown": ["the floor", "how the first domino was released"],
        "quantity": "speed", "unit": "m/s",
        "setting": settings[0] | {
            "measured": "row", "push": round(float(np.mean(pushes)), 4), "x_is": "gap",
        },
        "rows": rows,
    }  # fmt: skip
