"""Relations between the tables of a scene: one sentence for each that is broken."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from domino_env.core.models import model_of
from domino_env.physics.ground import Ground
from domino_env.physics.standard import ADVICE, MOST
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.tables import MOST_PAIRS, Bounds, SceneFile, ThicknessTable

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
    for sentence in _violations(tables):
        raise ValueError(sentence)
    return tables


# each rests on those before it


def _violations(tables: SceneFile) -> Iterator[str]:
    if tables.thickness is None and tables.stock is None:
        keys = ", ".join(ThicknessTable.__struct_fields__)
        yield f"thickness is missing: give a table of {keys}"
    if tables.thickness is not None and tables.stock is not None:
        yield "[thickness] stands beside [stock]: give one or the other"
    yield from _violations_of_heights(tables)
    yield from _slips_of_unit(tables)
    yield from _violations_of_objective(tables)
    yield from _violations_of_first(tables)
    yield from _too_many(tables)
    yield from _violations_of_length(tables)
    yield from _violations_of_ground(tables)


def _violations_of_heights(tables: SceneFile) -> Iterator[str]:
    thick = tables.thickness is not None and tables.thickness.of is not None
    if tables.in_heights != thick and tables.thickness is not None:
        here, there = ("spacing", "thickness") if tables.in_heights else ("thickness", "spacing")
        yield f'{here}.of = "height" but {there} is in metres: give both in heights'
    if tables.growth is not None and not tables.in_heights:
        yield '[growth] needs spacing and thickness in heights: write of = "height" in both'
    if not tables.in_heights:
        return
    metres = {
        "row.length": tables.row.length,
        "spacing.step or values": tables.spacing.allowed()[1],
        "thickness.step or values": tables.thickness and tables.thickness.allowed()[1],
        "[stock]": tables.stock,
        "spacing.largest_change": tables.spacing.largest_change,
    }
    for name, value in metres.items():
        if value is not None:
            yield f'{name} is in metres: not with of = "height"'


def _slips_of_unit(tables: SceneFile) -> Iterator[str]:
    """A scene of which no row can fall, or no domino is one, is none to spend time on."""
    unit = 1.0 if tables.in_heights else tables.row.height
    said = "heights" if tables.in_heights else "m"
    least = tables.spacing.allowed()[0][0]
    if tables.growth is None and least >= unit:
        yield (
            f"spacing: no gap may be smaller than {least:g} {said}, and no domino reaches further "
            f"than its height of {tables.row.height:g} m: {ADVICE}"
        )
    thinnest = 0.0 if tables.stock is not None else tables.thickness_allowed()[0][0]
    if thinnest > MOST * unit:
        yield (
            f"thickness: no domino may be thinner than {thinnest:g} {said}, with a height of "
            f"{tables.row.height:g} m: {ADVICE}"
        )


def _violations_of_objective(tables: SceneFile) -> Iterator[str]:
    for name, objective in OBJECTIVES.items():
        there = objective.table is not None and tables.settings(name) is not None
        needed = objective.table is not None and tables.objective == name
        if there != needed:
            what = "stands there" if there else "is missing"
            yield (
                f"the table [{name}] {what} and objective = {tables.objective!r}: "
                f"[{name}] and objective = {name!r} go together"
            )
    if tables.physics.floor_friction is not None:
        if not OBJECTIVES[tables.objective].is_mean_speed:
            yield (
                f"physics.floor_friction and objective = {tables.objective!r}: a row that stands "
                "is scored by its speed; choose objective = 'mean_speed' or 'time', or leave the "
                "floor out"
            )
        if tables.limits is not None:
            yield (
                "physics.floor_friction stands beside [limits]: stall margins and flushes are of "
                "the analytic wave, which a row that stands does not have; leave one of them out"
            )
    if tables.placement is not None:
        if tables.settings("robust") is not None:
            yield (
                "[placement] stands beside [robust], which draws errors of its own: leave one of "
                "them out"
            )
        if tables.row.length is not None:
            yield (
                "[placement] stands beside row.length, which a row whose gaps come out wrong does "
                "not meet: leave one of them out"
            )
    yield from OBJECTIVES[tables.objective].violations(tables)


def _violations_of_first(tables: SceneFile) -> Iterator[str]:
    """Of domino 0, its height, and those that may follow it."""
    row = tables.row
    if row.first_thickness is None:
        low, high = tables.thickness.allowed()[0] if tables.thickness else (0.0, 1.0)
        if low < high:
            yield (
                "row.first_thickness is missing: give the thickness of domino 0 [m], as that "
                "of the others is free"
            )
    if tables.stock is not None:
        box = tables.stock
        if sum(box.count) < row.count:
            yield (
                f"stock.count adds up to {sum(box.count)} dominoes: row.count = {row.count} "
                "needs as many"
            )
        try:
            box.without(tables.first_thickness())
        except ValueError as error:
            yield f"row.first_thickness = {row.first_thickness}: {error}"
    if tables.growth is not None:
        tallest = math.log(row.height) + (row.count - 1) * math.log(tables.growth.max)
        if tallest > math.log(TALLEST):
            yield (
                f"growth.max = {tables.growth.max}: {row.count} dominoes could grow to "
                f"10^{tallest / math.log(10.0):.0f} m; let them grow less, or ask for fewer"
            )


def _too_many(tables: SceneFile) -> Iterator[str]:
    listed = len(tables.spacing.allowed()[1] or "1") * len(tables.thickness_allowed()[1] or "1")
    if listed > MOST_PAIRS:
        yield (
            f"spacing and thickness have {listed:,} pairs of listed values, and each is tried "
            f"for the best uniform row: list at most {MOST_PAIRS:,}"
        )


def _violations_of_length(tables: SceneFile) -> Iterator[str]:
    """Whether a row within the bounds meets it; lists: `optimize.constraints.feasibility`."""
    length, count = tables.row.length, tables.row.count
    if length is None:
        return
    pairs = count - 1
    (low, high), _ = tables.spacing.allowed()
    if tables.stock is None:
        (thin, thick), _ = tables.thickness_allowed()
        least, most = pairs * (low + thin), pairs * (high + thick)
    else:
        box = tables.stock
        if sum(box.count) != count:
            yield (
                f"stock.count adds up to {sum(box.count)}: with row.length, give exactly "
                f"row.count = {count}"
            )
        bodies = float(box.without(tables.first_thickness()).dominoes.sum())
        least, most = pairs * low + bodies, pairs * high + bodies
    if not least - 1e-12 <= length <= most + 1e-12:
        yield (
            f"row.length = {length} m cannot be met: {count} dominoes within the bounds cover "
            f"{least:.6g} to {most:.6g} m"
        )


def _violations_of_ground(tables: SceneFile) -> Iterator[str]:
    """Yield why some layouts within the bounds cannot stand on the ground.

    No design can then be one that does not stand, so that a search or an episode never meets it. It
    is enough, and nearly necessary, that the ground is nowhere too steep for the thinnest domino
    and nowhere bends so much that the narrowest gap, or the widest, is in trouble.
    """
    ground, height, first = tables.ground, tables.row.height, tables.first_thickness()
    if ground is None:
        return
    unit = height if tables.in_heights else 1.0
    low, high = (unit * gap for gap in tables.spacing.allowed()[0])
    free = [unit * depth for depth in tables.thickness_allowed()[0]]
    thin, thick = min(first, *free), max(first, *free)
    place, steepest = ground.steepest
    if steepest >= thin / height:
        slope, most = (math.degrees(math.atan(one)) for one in (steepest, thin / height))
        where = "" if ground.is_even else f" near x = {place:.4g} m"
        yield (
            f"the ground slopes by {slope:.4g}°{where}, where a domino {1e3 * thin:.4g} mm thick "
            f"and {1e3 * height:.4g} mm high tips over by itself from {most:.4g}° on: make it "
            "flatter, or the dominoes thicker"
        )
    if ground.is_even:
        return
    for table, name, why in (
        (tables.row.length, "row.length", "the length of a row depends on where its gaps lie"),
        (tables.growth, "[growth]", "taller dominoes do not fit its bends"),
        (tables.placement, "[placement]", "gaps may come out so narrow that dominoes lean on each "
         "other"),
    ):  # fmt: skip
        if table is not None:
            yield (
                f"{name} stands beside ground.profile: on uneven ground {why}; leave one of them "
                "out"
            )
    if refused := ground.violation(thick):
        yield refused
    yield from _bends(ground, height, thick, (low, high))


def _bends(ground: Ground, height: float, thick: float, spacing: Bounds) -> Iterator[str]:
    """Yield where the ground is too hollow for the narrowest gap, or bends too much for the widest.

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
            # the gap that is just wide enough, and 2 % more
            reach = height * bend
            need = f"at least {1020.0 * reach * thick / (1.0 - reach):.3g} mm" * (reach < 0.9)
            yield (
                f"spacing from {1e3 * low:.4g} mm on is too narrow for the hollow near x = "
                f"{place:.4g} m, of radius {1.0 / bend:.3g} m: dominoes would lean against each "
                f"other, or strike above the next one's top; make spacing.min {need or 'larger'}, "
                "or the ground less hollow"
            )
        off = 0.5 * high * _turned(bend, high + thick)
        if high >= height or off > min(high, 0.999 * math.sqrt(height**2 - high**2)):
            yield (
                f"spacing up to {1e3 * high:.4g} mm is too wide for the {name} near x = "
                f"{place:.4g} m, of radius {1.0 / bend:.3g} m: a tip would miss the next domino; "
                "make spacing.max smaller, or the ground more even"
            )


def _turned(bend: float, reach: float) -> float:
    """Return by how much slopes differ at most over a distance [m], seen from either end."""
    turn = bend * reach
    return float(turn * (1.0 + turn * turn) ** 1.5)
