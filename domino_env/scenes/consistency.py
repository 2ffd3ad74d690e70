"""Relations between the fields of a scene: one sentence for each violation.

Sentences name fields as the keys and tables of scene files.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from domino_env.physics.footing import MAX_STEP
from domino_env.physics.ground import Ground
from domino_env.physics.standard import MAX_RATIO, unit_hint
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.placement import MOST_DRAWN_DOMINOES
from domino_env.scenes.rules import MAX_DOMINOES, Bounds
from domino_env.scenes.tables import RangeTable

MAX_LOG10_HEIGHT = 30.0  # decimal logarithm of the largest height [m]; products remain finite

EXCLUSIVE = (
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


def require_consistent(sentences: Iterator[str]) -> None:
    """Raise a ValueError for the first violation."""
    for sentence in sentences:
        raise ValueError(sentence)


def contradictions(scene: Any) -> Iterator[str]:
    """Yield a sentence for each violation by the fields of a scene, some of which may be missing.

    A check relies on those before it.
    """
    if scene.thickness is None and scene.stock is None:
        keys = ", ".join(RangeTable.__struct_fields__)
        yield f"thickness is missing: give a table of {keys}"
    for name in ("spacing", "thickness", "growth"):
        low, high = getattr(scene, name) or (0.0, 0.0)
        if low > high:
            yield f"{name}.min = {low} is more than max = {high}: give min <= max"
    for first, second, reason in EXCLUSIVE:
        if _value_at(scene, first) is not None and _value_at(scene, second) is not None:
            yield f"{first} and {second} exclude each other: {reason}; leave one of them out"
    if scene.growth is not None and not scene.in_heights:
        yield '[growth] needs spacing and thickness in heights: write of = "height" in both'
    for name in ("row.length", "[stock]") if scene.in_heights else ():
        if _value_at(scene, name) is not None:
            yield f'{name} is in metres: leave it out, or leave out of = "height"'
    yield from _violations_of_number(scene)
    yield from _violations_of_objective(scene)
    yield from _violations_of_sizes(scene)


def violations(scene: Any) -> Iterator[str]:
    """Yield a sentence for each violation by a scene without missing fields."""
    yield from _violations_of_units(scene)
    yield from _violations_of_length(scene)
    if scene.ground is not None:
        yield from _violations_of_ground(scene, scene.ground)


def _value_at(scene: Any, place: str) -> Any:
    """Return the value at a place of the file, such as "[stock]" or "row.length", or None."""
    value = scene
    for name in place.strip("[]").replace("row.", "").replace("physics.", "").split("."):
        value = getattr(value, name, None)
    return value


def _violations_of_number(scene: Any) -> Iterator[str]:
    """Yield sentences about rows of too many dominoes, or too many draws of them."""
    count = scene.row_count
    if count > MAX_DOMINOES:
        yield f"row.count and run_out.count add up to {count}: use at most {MAX_DOMINOES} dominoes"
    if scene.placement is not None and count * scene.placement.draws > MOST_DRAWN_DOMINOES:
        yield (
            f"placement.draws = {scene.placement.draws} of {count} dominoes take too much memory: "
            f"give at most {MOST_DRAWN_DOMINOES // count}"
        )


def _violations_of_objective(scene: Any) -> Iterator[str]:
    """Yield contradictions between the objective and other tables."""
    for name, objective in OBJECTIVES.items():
        given = objective.table is not None and isinstance(scene.settings, objective.table)
        if given != (objective.table is not None and scene.objective == name):
            yield (
                f"the table [{name}] {'is given' if given else 'is missing'} and objective = "
                f"{scene.objective!r}: give both [{name}] and objective = {name!r}, or neither"
            )
    objective = OBJECTIVES[scene.objective]
    if scene.floor_friction is not None and not objective.is_mean_speed:
        speeds = " or ".join(repr(n) for n, kind in OBJECTIVES.items() if kind.is_mean_speed)
        yield (
            f"physics.floor_friction and objective = {scene.objective!r}: free-standing layouts "
            f"are scored by their speed; choose objective = {speeds}, or leave the floor out"
        )
    yield from objective.violations(scene)


def _violations_of_sizes(scene: Any) -> Iterator[str]:
    """Yield contradictions between the number of dominoes, first thickness, stock and growth."""
    stock, first = scene.stock, scene.first_thickness
    # a stock, like bounds that differ, does not fix the thickness of domino 0
    if first is None and (stock is not None or scene.thickness[0] < scene.thickness[1]):
        yield (
            "row.first_thickness is missing: give the thickness of domino 0 [m], as that of the "
            "others is not fixed"
        )
    if stock is not None:
        pieces = sum(stock.count)
        if pieces < scene.count or (scene.length and pieces > scene.count):
            needed = " and row.length need exactly" if scene.length else " needs at least"
            yield (
                f"stock.count adds up to {pieces} dominoes: row.count = {scene.count}{needed} as "
                "many"
            )
        try:
            stock.without(first)
        except ValueError as error:
            yield f"row.first_thickness = {first}: {error}"
    if scene.growth is not None:
        tallest = math.log10(scene.height) + (scene.count - 1) * math.log10(scene.growth[1])
        if tallest > MAX_LOG10_HEIGHT:
            yield (
                f"growth.max = {scene.growth[1]}: {scene.count} dominoes could grow to "
                f"10^{tallest:.0f} m; make growth.max or row.count smaller"
            )


def _metres(scene: Any) -> tuple[Bounds, Bounds]:
    """Return the bounds of gaps and thicknesses [m], for the height of the first domino."""
    unit = scene.height if scene.in_heights else 1.0
    (low, high), (thinnest, thickest) = scene.spacing, scene.thickness
    return (unit * low, unit * high), (unit * thinnest, unit * thickest)


def _violations_of_units(scene: Any) -> Iterator[str]:
    """Yield sentences about lengths that were probably given in another unit."""
    height, ((low, high), thicknesses) = scene.height, _metres(scene)
    if (scene.growth is None and low >= height) or thicknesses[0] > MAX_RATIO * height:
        hint = unit_hint(height, (low, high), thicknesses)
        yield f"within the bounds of spacing and thickness no domino falls on the next: {hint}"
    if scene.placement is not None and scene.placement.deviation > high:
        yield (
            f"placement.deviation = {scene.placement.deviation:g} m is more than the largest gap, "
            f"{high:g} m: lengths are in metres, 0.5 mm is 0.0005"
        )
    if scene.run_out is not None and scene.run_out.spacing >= height:
        yield (
            f"run_out.spacing = {scene.run_out.spacing:g} m is out of reach of a domino "
            f"{height:g} m high: give less; lengths are in metres, 3 mm is 0.003"
        )


def _violations_of_length(scene: Any) -> Iterator[str]:
    """Yield a sentence if no layout within the bounds has the total length.

    The constants 1e-12 m and 1e-9 allow for rounding.
    """
    length, pairs = scene.length, scene.count - 1
    if length is None:
        return
    spacing, (thinnest, thickest) = _metres(scene)
    if scene.space.pieces is not None:
        thinnest = thickest = float(scene.space.pieces.dominoes.mean())
    low, high = spacing[0] + thinnest, spacing[1] + thickest  # mean pitches
    if pairs * low - 1e-12 <= length <= pairs * high + 1e-12:
        return
    hint = unit_hint(scene.height, scene.spacing, scene.thickness)
    if hint is None and pairs * low <= 1e-3 * length <= pairs * high:
        hint = f"{length:g} mm is row.length = {1e-3 * length:g}"
    if hint is None and pairs * low <= 1e3 * length <= pairs * high:
        hint = f"row.length = {1e3 * length:g} would fit: is the length in the right unit?"
    fewest, most = math.ceil(length / high - 1e-9) + 1, math.floor(length / low + 1e-9) + 1
    most = min(most, MAX_DOMINOES)
    if hint is None and scene.stock is None and 2 <= fewest <= most:
        counts = f"{fewest} to {most}" if fewest < most else f"{most}"
        hint = f"row.count = {counts} would fit"
    yield (
        f"row.length = {length:g} m cannot be met: {pairs + 1} dominoes within the bounds cover "
        f"{pairs * low:.6g} to {pairs * high:.6g} m; {hint or 'change the length or the bounds'}"
    )


def _violations_of_ground(scene: Any, ground: Ground) -> Iterator[str]:
    """Yield the reasons why some layouts within the bounds cannot stand on the ground.

    Without violations every layout within the bounds stands, so a search or an episode cannot
    produce one that does not. It is sufficient, and nearly necessary, that the ground is nowhere
    too steep for the thinnest domino and nowhere too curved for the narrowest or the widest gap.
    """
    height, first = scene.height, scene.first_thickness
    spacing, others = _metres(scene)
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
    yield from _violations_of_bends(ground, height, thickest, spacing)


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
