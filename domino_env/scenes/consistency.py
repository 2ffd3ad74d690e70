"""Relations between the tables of a scene: one sentence for each that is broken."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from domino_env.core.models import model_of
from domino_env.physics.ground import Ground
from domino_env.physics.standard import ADVICE, MOST
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.tables import MOST_PAIRS, SceneFile, ThicknessTable

TALLEST = 1e30  # [m] that a domino of a growing row may become: its square is still a number


def tables_of(document: dict[str, Any]) -> SceneFile:
    """Check a scene's document and return its tables.

    Parameters
    ----------
    document
        As `tomllib` reads it from a file, or `Specification.document` writes it.

    Raises
    ------
    ValueError
        With key, value and what is allowed, or the tables that do not go together.
    """
    tables = model_of(SceneFile, document)
    for sentence in _clashes(tables):
        raise ValueError(sentence)
    return tables


# each rests on those before it


def _clashes(asked: SceneFile) -> Iterator[str]:
    if asked.thickness is None and asked.stock is None:
        keys = ", ".join(ThicknessTable.__struct_fields__)
        yield f"thickness is missing: give a table of {keys}"
    if asked.thickness is not None and asked.stock is not None:
        yield "[thickness] stands beside [stock]: give one or the other"
    yield from _clashes_of_heights(asked)
    yield from _slips_of_unit(asked)
    yield from _clashes_of_objective(asked)
    yield from _clashes_of_first(asked)
    yield from _too_many(asked)
    yield from _clashes_of_length(asked)
    yield from _clashes_of_ground(asked)


def _clashes_of_heights(asked: SceneFile) -> Iterator[str]:
    thick = asked.thickness is not None and asked.thickness.of is not None
    if asked.in_heights != thick and asked.thickness is not None:
        here, there = ("spacing", "thickness") if asked.in_heights else ("thickness", "spacing")
        yield f'{here}.of = "height" but {there} is in metres: give both in heights'
    if asked.growth is not None and not asked.in_heights:
        yield '[growth] needs spacing and thickness in heights: write of = "height" in both'
    if not asked.in_heights:
        return
    metres = {
        "row.length": asked.row.length,
        "spacing.step or values": asked.spacing.allowed()[1],
        "thickness.step or values": asked.thickness and asked.thickness.allowed()[1],
        "[stock]": asked.stock,
        "spacing.largest_change": asked.spacing.largest_change,
    }
    for name, value in metres.items():
        if value is not None:
            yield f'{name} is in metres: not with of = "height"'


def _slips_of_unit(asked: SceneFile) -> Iterator[str]:
    """A scene of which no row can fall, or no domino is one, is none to spend time on."""
    unit = 1.0 if asked.in_heights else asked.row.height
    said = "heights" if asked.in_heights else "m"
    least = asked.spacing.allowed()[0][0]
    if asked.growth is None and least >= unit:
        yield (
            f"spacing: no gap may be smaller than {least:g} {said}, and no domino reaches further "
            f"than its height of {asked.row.height:g} m: {ADVICE}"
        )
    thinnest = 0.0 if asked.stock is not None else asked.thickness_allowed()[0][0]
    if thinnest > MOST * unit:
        yield (
            f"thickness: no domino may be thinner than {thinnest:g} {said}, with a height of "
            f"{asked.row.height:g} m: {ADVICE}"
        )


def _clashes_of_objective(asked: SceneFile) -> Iterator[str]:
    for name, objective in OBJECTIVES.items():
        there = objective.table is not None and asked.settings(name) is not None
        needed = objective.table is not None and asked.objective == name
        if there != needed:
            what = "stands there" if there else "is missing"
            yield (
                f"the table [{name}] {what} and objective = {asked.objective!r}: "
                f"[{name}] and objective = {name!r} go together"
            )
    if asked.physics.floor_friction is not None:
        if not OBJECTIVES[asked.objective].is_mean_speed:
            yield (
                f"physics.floor_friction and objective = {asked.objective!r}: a row that stands is "
                "scored by its speed; choose objective = 'mean_speed' or 'time', or leave the "
                "floor out"
            )
        if asked.limits is not None:
            yield (
                "physics.floor_friction stands beside [limits]: stall margins and flushes are of "
                "the analytic wave, which a row that stands does not have; leave one of them out"
            )
    if asked.placement is not None:
        if asked.settings("robust") is not None:
            yield (
                "[placement] stands beside [robust], which draws errors of its own: leave one of "
                "them out"
            )
        if asked.row.length is not None:
            yield (
                "[placement] stands beside row.length, which a row whose gaps come out wrong does "
                "not meet: leave one of them out"
            )
    yield from OBJECTIVES[asked.objective].clashes(
        count=asked.row.count,
        length=asked.row.length,
        grows=asked.growth is not None,
        limited=asked.limits is not None,
        settings=asked.settings(asked.objective),
    )


def _clashes_of_first(asked: SceneFile) -> Iterator[str]:
    """Of domino 0, its height, and those that may follow it."""
    row = asked.row
    if row.first_thickness is None:
        low, high = asked.thickness.allowed()[0] if asked.thickness else (0.0, 1.0)
        if low < high:
            yield (
                "row.first_thickness is missing: give the thickness of domino 0 [m], as that "
                "of the others is free"
            )
    if asked.stock is not None:
        box = asked.stock
        if sum(box.count) < row.count:
            yield (
                f"stock.count adds up to {sum(box.count)} dominoes: row.count = {row.count} "
                "needs as many"
            )
        try:
            box.without(asked.first_thickness())
        except ValueError as error:
            yield f"row.first_thickness = {row.first_thickness}: {error}"
    if asked.growth is not None:
        tallest = math.log(row.height) + (row.count - 1) * math.log(asked.growth.max)
        if tallest > math.log(TALLEST):
            yield (
                f"growth.max = {asked.growth.max}: {row.count} dominoes could grow to "
                f"10^{tallest / math.log(10.0):.0f} m; let them grow less, or ask for fewer"
            )


def _too_many(asked: SceneFile) -> Iterator[str]:
    listed = len(asked.spacing.allowed()[1] or "1") * len(asked.thickness_allowed()[1] or "1")
    if listed > MOST_PAIRS:
        yield (
            f"spacing and thickness have {listed:,} pairs of listed values, and each is tried "
            f"for the best uniform row: list at most {MOST_PAIRS:,}"
        )


def _clashes_of_length(asked: SceneFile) -> Iterator[str]:
    """Whether a row within the bounds meets it; lists: `optimize.constraints.feasibility`."""
    length, count = asked.row.length, asked.row.count
    if length is None:
        return
    pairs = count - 1
    (low, high), _ = asked.spacing.allowed()
    if asked.stock is None:
        (thin, thick), _ = asked.thickness_allowed()
        least, most = pairs * (low + thin), pairs * (high + thick)
    else:
        box = asked.stock
        if sum(box.count) != count:
            yield (
                f"stock.count adds up to {sum(box.count)}: with row.length, give exactly "
                f"row.count = {count}"
            )
        bodies = float(box.without(asked.first_thickness()).dominoes.sum())
        least, most = pairs * low + bodies, pairs * high + bodies
    if not least - 1e-12 <= length <= most + 1e-12:
        yield (
            f"row.length = {length} m cannot be met: {count} dominoes within the bounds cover "
            f"{least:.6g} to {most:.6g} m"
        )


def _clashes_of_ground(asked: SceneFile) -> Iterator[str]:
    if asked.ground is None:
        return
    unit = asked.row.height if asked.in_heights else 1.0
    (low, high), _ = asked.spacing.allowed()
    (thin, thick), _ = asked.thickness_allowed()
    first = asked.first_thickness()
    refused = clash_with_ground(
        asked.ground,
        height=asked.row.height,
        thickness=(min(first, unit * thin), max(first, unit * thick)),
        spacing=(unit * low, unit * high),
        length=asked.row.length,
        grows=asked.growth is not None,
        unsteady=asked.placement is not None,
    )
    if refused is not None:
        yield refused


Bounds = tuple[float, float]


def clash_with_ground(
    ground: Ground,
    *,
    height: float,
    thickness: Bounds,
    spacing: Bounds,
    length: float | None,
    grows: bool,
    unsteady: bool,
) -> str | None:
    """Say why rows of a scene cannot stand on a ground, in a sentence; None where all can.

    No design within the bounds can then be one that does not stand, so that a search or an episode
    never meets it. It is enough, and nearly necessary, that the ground is nowhere too steep for
    the thinnest domino and nowhere bends so much that the narrowest gap, or the widest, were in
    trouble.

    Parameters
    ----------
    ground
        What they stand on.
    height
        Of all dominoes [m].
    thickness, spacing
        Least and largest [m].
    length
        From the first pivot to the last [m]; None where it is free.
    grows
        Whether heights are free.
    unsteady
        Whether gaps come out wrong while environments build.
    """
    thin, thick = thickness
    place, steepest = ground.steepest
    if steepest >= thin / height:
        slope, most = (math.degrees(math.atan(one)) for one in (steepest, thin / height))
        where = "" if ground.is_even else f" near x = {place:.4g} m"
        return (
            f"the ground slopes by {slope:.4g}°{where}, where a domino {1e3 * thin:.4g} mm thick "
            f"and {1e3 * height:.4g} mm high tips over by itself from {most:.4g}° on: make it "
            "flatter, or the dominoes thicker"
        )
    if ground.is_even:
        return None
    for there, what, why in (
        (length is not None, "row.length", "the length of a row depends on where its gaps lie"),
        (grows, "[growth]", "taller dominoes do not fit its bends"),
        (unsteady, "[placement]", "gaps may come out so narrow that dominoes lean on each other"),
    ):
        if there:
            return (
                f"{what} stands beside ground.profile: on uneven ground {why}; leave one of them "
                "out"
            )
    if refused := ground.bulge(thick):
        return refused
    return _bends_too_much(ground, height, thick, spacing)


def _bends_too_much(ground: Ground, height: float, thick: float, spacing: Bounds) -> str | None:
    """Whether the ground is too hollow for the narrowest gap, or bends too much for the widest.

    Where the ground bends by at most k, the slopes of two neighbouring chords differ by at most
    k (s + d), and a pivot lies at most k s (s + d)/2 off the line of the next chord. Dominoes do
    not lean against each other while L k (s + d) < s, and then a tip strikes below the top too, as
    L - √(L² - s²) > s²/2L. Both are tightest at the narrowest gap; that a pivot is not off by more
    than the contact height √(L² - s²), or than s, at the widest.
    """
    low, high = spacing
    for way, name in ((1.0, "hollow"), (-1.0, "crest")):
        place, bend = ground.curvature(way)
        if bend == 0.0:
            continue
        if way > 0.0 and height * _turned(bend, low + thick) >= low:
            # of the gap that is just wide enough, and 1 % more
            reach = height * bend
            need = f"at least {1e3 * _up(reach * thick / (1.0 - reach)):.3g} mm" * (reach < 0.9)
            return (
                f"spacing from {1e3 * low:.4g} mm on is too narrow for the hollow near x = "
                f"{place:.4g} m, of radius {1.0 / bend:.3g} m: dominoes would lean against each "
                f"other, or strike above the next one's top; make spacing.min {need or 'larger'}, "
                "or the ground less hollow"
            )
        off = 0.5 * high * _turned(bend, high + thick)
        if high >= height or off > min(high, 0.999 * math.sqrt(height**2 - high**2)):
            return (
                f"spacing up to {1e3 * high:.4g} mm is too wide for the {name} near x = "
                f"{place:.4g} m, of radius {1.0 / bend:.3g} m: a tip would miss the next domino; "
                "make spacing.max smaller, or the ground more even"
            )
    return None


def _turned(bend: float, reach: float) -> float:
    """By how much slopes differ at most over a way [m], seen from either."""
    turn = bend * reach
    return float(turn * (1.0 + turn * turn) ** 1.5)


def _up(least: float) -> float:
    return 1.02 * least
