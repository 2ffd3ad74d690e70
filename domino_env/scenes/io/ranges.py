"""Ranges where a scene's file gives a number: what is drawn, between what, in which measure."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from msgspec import Meta

from domino_env.core.models import LARGEST, Number, Table, model_of

Place = tuple[str, str]

COUNT, PUSH = ("row", "count"), ("physics", "push")
IN_HEIGHTS = {PUSH, ("row", "first_thickness"), ("row", "length")} | {
    (table, key) for table in ("spacing", "thickness") for key in ("min", "max", "fixed")
}
"""Where a range may count in heights."""
UNFELT = {("row", "width"), ("row", "density")}


class Range(Table, frozen=True):  # type: ignore[misc]
    """A number that is drawn for every scene."""

    min: Annotated[Number, Meta(description="the least that is drawn")]
    max: Annotated[Number, Meta(description="the largest that is drawn")]
    spread: Annotated[
        Literal["even", "log"],
        Meta(description="drawn evenly, or evenly in the logarithm"),
    ] = "even"
    of: Annotated[
        Literal["height"] | None,
        Meta(
            description="counts in the scene's height; a push in √(gravity / height), so that "
            "scenes of any size have the same numbers"
        ),
    ] = None
    apart: Annotated[
        Annotated[float, Meta(ge=1, le=LARGEST)] | None,
        Meta(description="of a table's max: at least this times the min that was drawn"),
    ] = None

    SCHEMA: ClassVar = {"title": "a range"}

    def __post_init__(self) -> None:
        if self.min > self.max:
            raise ValueError(f"min = {self.min} is more than max = {self.max}")
        if self.spread == "log" and self.min <= 0.0:
            raise ValueError(f'min = {self.min}: spread = "log" needs more than 0')


def has_ranges(document: dict[str, Any]) -> bool:
    """Tell whether a file gives a range where a scene has a number."""
    return any(True for _ in _places(document))


def ranges_of(document: dict[str, Any]) -> dict[Place, Range]:
    """Read the ranges of a file, in its order.

    Parameters
    ----------
    document
        What `tomllib` made of it.

    Raises
    ------
    ValueError
        With the place, its value and what is allowed.
    """
    found: dict[Place, Range] = {}
    for place in _places(document):
        table, key = place
        where = f"{table}.{key}"
        drawn = model_of(Range, document[table][key], where)
        if place in UNFELT:
            raise ValueError(f"{where} changes no time: give a number, not a range")
        if drawn.of is not None and (place not in IN_HEIGHTS or "of" in document[table]):
            raise ValueError(
                f"{where}.of = 'height': only of a push, a length or a thickness in metres"
            )
        if place == COUNT and (drawn.min % 1 or drawn.max % 1):
            raise ValueError(f"{where} = {drawn.min} to {drawn.max}: give whole numbers")
        found[place] = drawn
    for place in found:
        _require_apart(document, found, place)
    return found


def filled(document: dict[str, Any], numbers: dict[Place, float]) -> dict[str, Any]:
    """Write the file of one scene: numbers in the place of ranges."""
    tables = {
        name: dict(table) if isinstance(table, dict) else table for name, table in document.items()
    }
    for (table, key), value in numbers.items():
        tables[table][key] = int(value) if (table, key) == COUNT else value
    return tables


def _places(document: dict[str, Any]) -> Iterator[Place]:
    for table, held in document.items():
        if isinstance(held, dict):
            for key, value in held.items():
                if isinstance(value, dict):
                    yield table, key


def _require_apart(document: dict[str, Any], found: dict[Place, Range], place: Place) -> None:
    """The least is to leave room for what lies apart from it."""
    (table, key), drawn = place, found[place]
    if drawn.apart is None:
        return
    least = found.get((table, "min"), document[table].get("min"))
    if key != "max" or least is None:
        raise ValueError(f"{table}.{key}.apart: only of a max beside a min")
    most, of = (least.max, least.of) if isinstance(least, Range) else (float(least), None)
    if of != drawn.of:
        raise ValueError(f"{table}.{key}.apart: min and max must be in the same unit")
    if drawn.apart * most > drawn.max:
        raise ValueError(
            f"{table}.min = {most}: {drawn.apart} times it is beyond {table}.max = {drawn.max}"
        )
