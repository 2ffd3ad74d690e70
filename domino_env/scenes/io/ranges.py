"""Ranges in the file of a scene distribution: bounds, spread and unit of each sampled number."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta

from domino_env.core.models import LARGEST, Number, Table, about, model_of

Place = tuple[str, str]
"""Table and key of a number in a scene's file."""

COUNT, PUSH = ("row", "count"), ("physics", "push")
IN_HEIGHTS = {PUSH, ("row", "first_thickness"), ("row", "length")} | {
    (table, key) for table in ("spacing", "thickness") for key in ("min", "max", "fixed")
}
"""Places where a range may count in heights."""


class Range(Table, frozen=True):  # type: ignore[misc]
    """A number that is sampled for every scene."""

    min: Annotated[Number, about("the smallest value")]
    max: Annotated[Number, about("the largest value")]
    spread: Annotated[
        Literal["even", "log"], about("distribution: even, or even in the logarithm")
    ] = "even"
    of: Annotated[
        Literal["height"] | None,
        about(
            "counts in the scene's height; a push in √(gravity / height), so that "
            "scenes of any size have the same numbers"
        ),
    ] = None
    min_ratio: Annotated[
        Annotated[float, Meta(ge=1, le=LARGEST)] | None,
        about("of a table's max: at least this times the sampled min"),
    ] = None

    def __post_init__(self) -> None:
        if self.min > self.max:
            raise ValueError(f"min = {self.min} is more than max = {self.max}")
        if self.spread == "log" and self.min <= 0.0:
            raise ValueError(f'min = {self.min}: spread = "log" needs more than 0')


def has_ranges(document: dict[str, Any]) -> bool:
    """Return True for a file that gives a range where a scene has a number."""
    return bool(_places(document))


def ranges_of(document: dict[str, Any]) -> dict[Place, Range]:
    """Return the ranges of a file, in its order.

    Parameters
    ----------
    document
        The file as `tomllib` reads it.

    Raises
    ------
    ValueError
        With the place, its value and the accepted range.
    """
    ranges: dict[Place, Range] = {}
    for table, key in _places(document):
        place, name = (table, key), f"{table}.{key}"
        ranges[place] = sampled = model_of(Range, document[table][key], name)
        if sampled.of is not None and (place not in IN_HEIGHTS or "of" in document[table]):
            raise ValueError(
                f"{name}.of = 'height': only of a push, a length or a thickness in metres"
            )
        if place == COUNT and (sampled.min % 1 or sampled.max % 1):
            raise ValueError(f"{name} = {sampled.min} to {sampled.max}: give whole numbers")
    for (table, key), sampled in ranges.items():
        if sampled.min_ratio is None:
            continue
        least = ranges.get((table, "min"), document[table].get("min"))
        if key != "max" or least is None:
            raise ValueError(f"{table}.{key}.min_ratio: only of a max beside a min")
        most, of = (least.max, least.of) if isinstance(least, Range) else (float(least), None)
        if of != sampled.of:
            raise ValueError(f"{table}.{key}.min_ratio: min and max must be in the same unit")
        if sampled.min_ratio * most > sampled.max:
            raise ValueError(
                f"{table}.min = {most}: {sampled.min_ratio} times it is beyond {table}.max = "
                f"{sampled.max}"
            )
    return ranges


def filled(document: dict[str, Any], numbers: dict[Place, float]) -> dict[str, Any]:
    """Return the document of one scene, with numbers in the place of ranges."""
    tables = {
        name: dict(table) if isinstance(table, dict) else table for name, table in document.items()
    }
    for (table, key), value in numbers.items():
        tables[table][key] = int(value) if (table, key) == COUNT else value
    return tables


def _places(document: dict[str, Any]) -> list[Place]:
    return [
        (name, key)
        for name, table in document.items()
        if isinstance(table, dict)
        for key, value in table.items()
        if isinstance(value, dict)
    ]
