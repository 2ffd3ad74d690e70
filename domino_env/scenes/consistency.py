"""Relations between the tables of a scene: one sentence for each violation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from domino_env.core.checks import require_choice
from domino_env.core.models import read_model
from domino_env.physics.footing import MAX_STEP
from domino_env.physics.ground import Ground
from domino_env.physics.standard import MAX_RATIO, unit_hint
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.placement import MOST_DRAWN_DOMINOES
from domino_env.scenes.rules import MAX_DOMINOES, Bounds
from domino_env.scenes.tables import DEFAULTS, RangeTable, SceneFile

MAX_LOG10_HEIGHT = 30.0  # decimal logarithm of the largest height [m]; products remain finite

EXCLUSIVE = (
    ("[thickness]", "[stock]", "both give the thicknesses"),
    ("physics.floor_friction", "[limits]",
     "stall margins are those of fixed pivots"),
    ("stock.hand", "physics.floor_friction",
     "the uniform baseline is a mean over orders, which takes too long on a floor"),
    ("stock.hand", "row.length", "no environment has both a stock and a length"),
    ("[run_out]", "[stock]", "the pieces of a stock do not include those of a run-out"),
    ("[run_out]", "[growth]", "the dominoes of a run-out have one height"),
    ("[run_out]", "[tempo]", "the schedule has times of the designed dominoes only"),
    ("[run_out]", "ground.profile",
     "the ground is checked for the gaps within the bounds of spacing only"),
    ("ground.profile", "row.length", "the length of a layout depends on where its gaps lie"),
    ("ground.profile", "[growth]", "its curvature is checked for one height only"),
)  # fmt: skip
"""Pairs of tables or keys that exclude each other, each with the reason."""


def check_document(document: dict[str, Any]) -> SceneFile:
    """Check the document of a scene and return its tables.

    Parameters
    ----------
    document
        Tables of the scene, as `tomllib` reads them from a file or `Scene.document` returns
        them.

    Returns
    -------
    SceneFile
        The tables.

    Raises
    ------
    ValueError
        For the first violation; the message has key, value and accepted range, or the tables that
        contradict each other.
    """
    if isinstance(document, dict):  # otherwise the model's error
        require_choice("objective", document.get("objective", DEFAULTS["objective"]), OBJECTIVES)
    tables = read_model(SceneFile, document)
    for sentence in _violations(tables):
        raise ValueError(sentence)
    return tables


def _violations(tables: SceneFile) -> Iterator[str]:
    """Yield a sentence for each violation; a check relies on those before it."""
    if tables.thickness is None and tables.stock is None:
        keys = ", ".join(RangeTable.__struct_fields__)
        yield f"thickness is missing: give a table of {keys}"
    for first, second, reason in EXCLUSIVE:
        if tables.value_at(first) is not None and tables.value_at(second) is not None:
            yield f"{first} and {second} exclude each other: {reason}; leave one of them out"
    yield from _violations_in_heights(tables)
    yield from _violations_of_units(tables)
    yield from _violations_of_number(tables)
    yield from _violations_of_objective(tables)
    yield from _violations_of_sizes(tables)
    yield from _violations_of_length(tables)
    if tables.ground is not None:
        yield from _violations_of_ground(tables, tables.ground)


def _violations_in_heights(tables: SceneFile) -> Iterator[str]:
    """Yield sentences about keys in metres that contradict others in heights, and the reverse."""
    thickness_in_heights = tables.thickness is not None and tables.thickness.of is not None
    if tables.in_heights != thickness_in_heights and tables.thickness is not None:
        here, there = ("spacing", "thickness") if tables.in_heights else ("thickness", "spacing")
        yield f'{here}.of = "height" but {there} is in metres: give both in heights'
    if tables.growth is not None and not tables.in_heights:
        yield '[growth] needs spacing and thickness in heights: write of = "height" in both'
    if not tables.in_heights:
        return
    for name in ("row.length", "[stock]"):
        if tables.value_at(name) is not None:
            yield f'{name} is in metres: leave it out, or leave out of = "height"'


def _violations_of_units(tables: SceneFile) -> Iterator[str]:
    """Yield sentences about lengths that were probably given in another unit."""
    height, unit = tables.row.height, tables.row.height if tables.in_heights else 1.0
    low, high = (unit * gap for gap in tables.spacing.bounds())
    # a stock is checked later; until then a plausible thickness takes its place
    thicknesses = (height, height) if tables.stock else tables.thickness_bounds()
    thinnest, thickest = (unit * thickness for thickness in thicknesses)
    if (tables.growth is None and low >= height) or thinnest > MAX_RATIO * height:
        hint = unit_hint(height, (low, high), (thinnest, thickest))
        yield f"within the bounds of spacing and thickness no domino falls on the next: {hint}"
    if tables.placement is not None and tables.placement.deviation > high:
        yield (
            f"placement.deviation = {tables.placement.deviation:g} m is more than the largest gap, "
            f"{high:g} m: lengths are in metres, 0.5 mm is 0.0005"
        )
    if tables.run_out is not None and tables.run_out.spacing >= height:
        yield (
            f"run_out.spacing = {tables.run_out.spacing:g} m is out of reach of a domino "
            f"{height:g} m high: give less; lengths are in metres, 3 mm is 0.003"
        )


def _violations_of_number(tables: SceneFile) -> Iterator[str]:
    """Yield sentences about rows of too many dominoes, or too many draws of them."""
    count = tables.row.count + (tables.run_out.count if tables.run_out else 0)
    if count > MAX_DOMINOES:
        yield f"row.count and run_out.count add up to {count}: use at most {MAX_DOMINOES} dominoes"
    if tables.placement is not None and count * tables.placement.draws > MOST_DRAWN_DOMINOES:
        yield (
            f"placement.draws = {tables.placement.draws} of {count} dominoes take too much memory: "
            f"give at most {MOST_DRAWN_DOMINOES // count}"
        )


def _violations_of_objective(tables: SceneFile) -> Iterator[str]:
    """Yield contradictions between the objective and other tables."""
    for name, objective in OBJECTIVES.items():
        given = tables.value_at(name) is not None
        if given != (objective.table is not None and tables.objective == name):
            yield (
                f"the table [{name}] {'is given' if given else 'is missing'} and objective = "
                f"{tables.objective!r}: give both [{name}] and objective = {name!r}, or neither"
            )
    objective = OBJECTIVES[tables.objective]
    if tables.physics.floor_friction is not None and not objective.is_mean_speed:
        speeds = " or ".join(repr(n) for n, kind in OBJECTIVES.items() if kind.is_mean_speed)
        yield (
            f"physics.floor_friction and objective = {tables.objective!r}: free-standing layouts "
            f"are scored by their speed; choose objective = {speeds}, or leave the floor out"
        )
    yield from objective.violations(tables)


def _violations_of_sizes(tables: SceneFile) -> Iterator[str]:
    """Yield contradictions between the number of dominoes, first thickness, stock and growth."""
    row, stock = tables.row, tables.stock
    # a stock, like bounds that differ, does not fix the thickness of domino 0
    low, high = tables.thickness.bounds() if tables.thickness else (0.0, 1.0)
    if row.first_thickness is None and low < high:
        yield (
            "row.first_thickness is missing: give the thickness of domino 0 [m], as that of the "
            "others is not fixed"
        )
    if stock is not None:
        if sum(stock.count) < row.count or (row.length and sum(stock.count) > row.count):
            needed = " and row.length need exactly" if row.length else " needs at least"
            yield (
                f"stock.count adds up to {sum(stock.count)} dominoes: row.count = {row.count}"
                f"{needed} as many"
            )
        try:
            stock.without(tables.first_thickness())
        except ValueError as error:
            yield f"row.first_thickness = {row.first_thickness}: {error}"
    if tables.growth is not None:
        tallest = math.log10(row.height) + (row.count - 1) * math.log10(tables.growth.max)
        if tallest > MAX_LOG10_HEIGHT:
            yield (
                f"growth.max = {tables.growth.max}: {row.count} dominoes could grow to "
                f"10^{tallest:.0f} m; make growth.max or row.count smaller"
            )


def _pitches(tables: SceneFile) -> Bounds:
    """Return the smallest and the largest mean pitch within the bounds [m]."""
    unit = tables.row.height if tables.in_heights else 1.0
    low, high = tables.spacing.bounds()
    thinnest, thickest = tables.thickness_bounds()
    if tables.stock is not None:
        dominoes = tables.stock.without(tables.first_thickness()).dominoes
        thinnest = thickest = float(dominoes.mean())
    return unit * (low + thinnest), unit * (high + thickest)


def _violations_of_length(tables: SceneFile) -> Iterator[str]:
    """Yield a sentence if no layout within the bounds has the total length.

    The constants 1e-12 m and 1e-9 allow for rounding.
    """
    length, pairs = tables.row.length, tables.row.count - 1
    if length is None:
        return
    low, high = _pitches(tables)
    if pairs * low - 1e-12 <= length <= pairs * high + 1e-12:
        return
    hint = unit_hint(tables.row.height, tables.spacing.bounds(), tables.thickness_bounds())
    if hint is None and pairs * low <= 1e-3 * length <= pairs * high:
        hint = f"{length:g} mm is row.length = {1e-3 * length:g}"
    if hint is None and pairs * low <= 1e3 * length <= pairs * high:
        hint = f"row.length = {1e3 * length:g} would fit: is the length in the right unit?"
    fewest, most = math.ceil(length / high - 1e-9) + 1, math.floor(length / low + 1e-9) + 1
    most = min(most, MAX_DOMINOES)
    if hint is None and tables.stock is None and 2 <= fewest <= most:
        counts = f"{fewest} to {most}" if fewest < most else f"{most}"
        hint = f"row.count = {counts} would fit"
    yield (
        f"row.length = {length:g} m cannot be met: {pairs + 1} dominoes within the bounds cover "
        f"{pairs * low:.6g} to {pairs * high:.6g} m; {hint or 'change the length or the bounds'}"
    )


def _violations_of_ground(tables: SceneFile, ground: Ground) -> Iterator[str]:
    """Yield the reasons why some layouts within the bounds cannot stand on the ground.

    Without violations every layout within the bounds stands, so a search or an episode cannot
    produce one that does not. It is sufficient, and nearly necessary, that the ground is nowhere
    too steep for the thinnest domino and nowhere too curved for the narrowest or the widest gap.
    """
    height, first = tables.row.height, tables.first_thickness()
    unit = height if tables.in_heights else 1.0
    others = [unit * thickness for thickness in tables.thickness_bounds()]
    thinnest, thickest = min(first, *others), max(first, *others)
    place, steepest = ground.steepest
    if steepest >= thinnest / height:
        tangents = steepest, thinnest / height
        slope, tipping = (math.degrees(math.atan(tangent)) for tangent in tangents)
        where = "" if ground.is_even else f" near x = {place:.4g} m"
        yield (
            f"the ground slopes by {slope:.4g}°{where}, where a domino {1e3 * thinnest:.4g} mm "
            f"thick and {1e3 * height:.4g} mm high tips over by itself from {tipping:.4g}° on: "
            "make the ground flatter, or the dominoes thicker"
        )
    if ground.is_even:
        return
    if violation := ground.violation(thickest):
        yield violation
    low, high = (unit * gap for gap in tables.spacing.bounds())
    yield from _violations_of_bends(ground, height, thickest, (low, high))


def _violations_of_bends(
    ground: Ground, height: float, thickest: float, spacing: Bounds
) -> Iterator[str]:
    """Yield a sentence for each place that is too curved for the narrowest or the widest gap.

    If the curvature is at most k, the slopes of the chords under two neighbouring dominoes differ
    by at most k (s + d), and a pivot lies at most k s (s + d)/2 from the line of the next chord.
    Dominoes do not lean against each other if L k (s + d) < s; a tip then strikes below the top
    too, as L - √(L² - s²) > s²/2L. Both conditions are strictest at the narrowest gap. At the
    widest gap, the distance of a pivot from that line must not exceed s, nor `MAX_STEP` times the
    contact height √(L² - s²).
    """
    low, high = spacing
    for sign, name in ((1.0, "hollow"), (-1.0, "crest")):  # sign of the curvature
        place, curvature = ground.curvature(sign)
        if curvature == 0.0:
            continue
        where = f"the {name} near x = {place:.4g} m, of radius {1.0 / curvature:.3g} m"
        if sign > 0.0 and height * _slope_difference(curvature, low + thickest) >= low:
            yield (
                f"the smallest gap, {1e3 * low:.4g} mm, is too narrow for {where}: dominoes would "
                "lean against each other, or strike above the next one's top; make spacing.min "
                "larger, or the ground less hollow"
            )
        offset = 0.5 * high * _slope_difference(curvature, high + thickest)  # [m]
        if high >= height or offset > min(high, MAX_STEP * math.sqrt(height**2 - high**2)):
            yield (
                f"the largest gap, {1e3 * high:.4g} mm, is too wide for {where}: a tip would miss "
                "the next domino; make spacing.max smaller, or the ground more even"
            )


def _slope_difference(curvature: float, distance: float) -> float:
    """Return a bound on the difference of the slopes at two places a distance apart [m].

    Their angles differ by about `turn` [rad]. The factor, which is larger than tan(turn)/turn,
    allows for the tangent and for arcs longer than their chords.
    """
    turn = curvature * distance
    return float(turn * (1.0 + turn * turn) ** 1.5)
