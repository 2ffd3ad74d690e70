"""Every reading of a source, and the verdict: does the model explain it, and if not, what may."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from domino_env.validation.measured.comparison import MOST, Comparison, compare
from domino_env.validation.measured.effects import EFFECTS, Effect
from domino_env.validation.measured.source import Source

CLEARLY = 1.0  # standard uncertainties that both ends of a trend have to be off
HELPFUL = 0.75  # of how far the worst row is off without an effect


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
    explained
        Whether friction alone explains every row within its uncertainty, and is what was measured
        where it was measured.
    verdict
        That in sentences, with what may be the reason where it does not.
    """

    source: Source
    main: Comparison
    readings: tuple[Comparison, ...]
    effects: tuple[Comparison, ...]
    explained: bool
    verdict: tuple[str, ...]


def validate(source: Source, effects: Mapping[str, Effect] = EFFECTS) -> Validation:
    """Compare a source with the model, in its own setting, other readings, with each effect.

    Parameters
    ----------
    source
        What was measured.
    effects
        What the model leaves out, by its words.
    """
    main = compare(source, source.setting)
    readings = tuple(compare(source, i.of(source.setting), i.what) for i in source.instead)
    several = [r for r in readings if len(r.left_out) > 1]  # one spacing always has its friction
    tried = tuple(_with_effect(source, main, what, effects[what]) for what in effects)
    agrees = _friction_off(source, main) <= MOST
    sentences = [_fit(main), _measured_friction(source, main), *_pattern(source, main)]
    sentences += [_others(main, several), _span(main, several), _helps(main, tried)]
    verdict = tuple(s for s in sentences if s)
    return Validation(source, main, readings, tried, main.holds and agrees, verdict)


def _with_effect(source: Source, main: Comparison, what: str, effect: Effect) -> Comparison:
    """The source's own setting with an effect, as large as it is at the friction found."""
    setting = main.setting
    factors = [effect(setting, setting.pitch(row.x), main.friction) for row in main.rows]
    return compare(source, setting, what, factors)


def friction_words(comparison: Comparison) -> str:
    """The friction found, with its uncertainty where it has one."""
    doubt = f" ± {comparison.uncertainty:.3f}" if math.isfinite(comparison.uncertainty) else ""
    return f"{comparison.friction:.3f}{doubt}"


def _place(comparison: Comparison, x: float) -> str:
    return f"a {comparison.setting.x_is} of {comparison.setting.words(x)}"


def _fit(main: Comparison) -> str:
    found = f"friction {friction_words(main)}"
    if main.holds and len(main.rows) == 1:
        return f"One row, which {found} explains; nothing is left to check it by."
    if main.holds:
        return f"Explained: with {found} every row is within {main.worst:.1f} of its uncertainties."
    k = max(range(len(main.rows)), key=lambda i: abs(main.off[i]))
    told, row = main.explained[k], main.rows[k]
    if not 0.0 < told < math.inf:
        return (
            f"Not explained: at the best, {found}, the model's row dies at {_place(main, row.x)}."
        )
    return (
        f"Not explained: at the best, {found}, the model is {told / row.value - 1.0:+.1%} off at "
        f"{_place(main, row.x)}, {main.worst:.1f} of that row's uncertainties."
    )


def _friction_off(source: Source, main: Comparison) -> float:
    """The friction found less the one measured, in standard uncertainties."""
    if source.friction is None or not math.isfinite(main.uncertainty):
        return 0.0
    doubt = math.hypot(source.friction.uncertainty, main.uncertainty)
    return abs(main.friction - source.friction.value) / doubt


def _measured_friction(source: Source, main: Comparison) -> str:
    if source.friction is None:
        return ""
    off, told = _friction_off(source, main), source.friction
    agrees = "which agrees" if off <= MOST else "which disagrees"
    return (
        f"Measured by itself, friction is {told.value:g} ± {told.uncertainty:g}, {agrees} "
        f"({off:.1f} of their uncertainties apart)."
    )


def _pattern(source: Source, main: Comparison) -> list[str]:
    """What the pattern of what is left speaks for; nothing where friction explains it all."""
    if main.holds:
        return []
    faster = -1.0 if source.quantity == "time" else 1.0
    ahead = [-faster * off for off in main.off]  # measured faster than the model
    reasons = []
    beyond = [
        row.x
        for row, smooth, sigma in zip(main.rows, main.smooth, main.sigmas, strict=True)
        if faster * (row.value - smooth) > MOST * sigma
    ]
    if beyond:
        reasons.append(
            f"At {_place(main, min(beyond))} the row is faster than the model without any "
            "friction: the model loses too much there, or the time or the gap is not as told."
        )
    ends = sorted(zip((r.x for r in main.rows), ahead, strict=True))
    narrow, wide = ends[0][1], ends[-1][1]
    if narrow > CLEARLY and wide < -CLEARLY:
        reasons.append(
            "The friction asked for grows with the gap: wide gaps cost more, beside narrow ones, "
            "than contacts that slide."
        )
    if narrow < -CLEARLY and wide > CLEARLY:
        reasons.append(
            "The friction asked for falls as gaps widen: narrow gaps cost more, beside wide ones, "
            "than contacts that slide."
        )
    if len({row.floor for row in main.rows}) > 1:
        reasons.append(
            "Rows stand on different floors, and the model, whose feet never slip, gives all of "
            "them one speed."
        )
    return reasons


def _helps(main: Comparison, effects: Sequence[Comparison]) -> str:
    """Which of what the model leaves out brings it nearer to the rows."""
    if main.holds or not effects:
        return ""
    best = min(effects, key=lambda e: e.worst)
    if not best.worst < HELPFUL * main.worst:
        most = max(e.worst for e in effects)
        return (
            "Nothing tried of what the model leaves out mends it (worst row "
            f"{best.worst:.1f} to {most:.1f} off)."
        )
    low, high = min(best.factors) - 1.0, max(best.factors) - 1.0
    return (
        f"{'Explained' if best.holds else 'Nearer the mark'} with {best.what}, which changes the "
        f"speeds by {low:+.1%} to {high:+.1%}: friction is then {friction_words(best)}, the worst "
        f"row {best.worst:.1f} off."
    )


def _others(main: Comparison, readings: Sequence[Comparison]) -> str:
    if main.holds:
        wrong = [r.what for r in readings if not r.holds and math.isfinite(r.worst)]
        return f"Not explained in other readings: {'; '.join(wrong)}." if wrong else ""
    right = [f"{r.what} (friction {friction_words(r)})" for r in readings if r.holds]
    return f"Explained in other readings: {'; '.join(right)}." if right else ""


def _span(main: Comparison, readings: Sequence[Comparison]) -> str:
    every = [main, *(r for r in readings if math.isfinite(r.worst))]
    frictions, worst = [r.friction for r in every], [r.worst for r in every]
    dead = [r.what for r in readings if not math.isfinite(r.worst)]
    dies = f" A row of the model dies in this reading: {'; '.join(dead)}." if dead else ""
    if len(every) == 1:
        return dies.strip()
    return (
        f"What is not known moves the friction between {min(frictions):.2f} and "
        f"{max(frictions):.2f}, and the worst row between {min(worst):.1f} and {max(worst):.1f} "
        f"uncertainties.{dies}"
    )
