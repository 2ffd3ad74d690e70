"""Ranges in the file of a scene distribution: bounds, spread and unit of each sampled number."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from msgspec import Meta

from domino_env.core.models import LARGEST, Number, Table, about, read_model

Place = tuple[str, str]
"""Table and key of a number in a scene's file, "thickness[0]" for the first one of a list."""

COUNT, PUSH = ("row", "count"), ("physics", "push")
SCALABLE_PLACES = {PUSH, ("row", "first_thickness"), ("row", "length")} | {
    (table, key) for table in ("spacing", "thickness") for key in ("min", "max", "fixed")
}
"""Places of numbers whose ranges may be given in heights."""


class Range(Table, frozen=True):  # type: ignore[misc]
    """Number that is sampled for every scene."""

    min: Annotated[Number, about("the smallest value")]
    max: Annotated[Number, about("the largest value")]
    spread: Annotated[
        Literal["even", "log"], about("distribution: even, or even in the logarithm")
    ] = "even"
    of: Annotated[
        Literal["height"] | None,
        about(
            "unit: the scene's height, for a push √(gravity / height), so that "
            "scenes of any size have the same numbers"
        ),
    ] = None
    min_ratio: Annotated[
        Annotated[float, Meta(ge=1, le=LARGEST)] | None,
        about("for a table's max: least ratio of it to the sampled min"),
    ] = None

    def __post_init__(self) -> None:
        if self.min > self.max:
            raise ValueError(f"min = {self.min} is more than max = {self.max}: give min <= max")
        if self.spread == "log" and self.min <= 0.0:
            raise ValueError(f'min = {self.min}: give more than 0 for spread = "log"')


def has_ranges(document: dict[str, Any]) -> bool:
    """Return True if the document of a file has a range in place of a number."""
    return bool(_find_ranges(document))


def read_ranges(document: dict[str, Any]) -> dict[Place, Range]:
    """Return the ranges of a file, in its order.

    Parameters
    ----------
    document
        Tables of the file, as `tomllib` reads them.

    Returns
    -------
    dict
        Ranges by table and key.

    Raises
    ------
    ValueError
        For an invalid range; the message has its place, its value and the accepted values.
    """
    ranges: dict[Place, Range] = {}
    for table, key in _find_ranges(document):
        place, name = (table, key), f"{table}.{key}"
        ranges[place] = sampled = read_model(Range, entries(document[table])[key], name)
        is_size = place in SCALABLE_PLACES or (table == "stock" and key.startswith("thickness["))
        if table == "stock" and not is_size:
            raise ValueError(f"{name}: only thicknesses may have ranges; give one number")
        if sampled.of is not None and (not is_size or "of" in document[table]):
            raise ValueError(
                f"{name}.of = 'height': only for a push or metres along the chain; leave it out"
            )
        if place == COUNT and (sampled.min % 1 or sampled.max % 1):
            raise ValueError(f"{name} = {sampled.min} to {sampled.max}: give whole numbers")
    for (table, key), sampled in ranges.items():
        if sampled.min_ratio is None:
            continue
        least = ranges.get((table, "min"), document[table].get("min"))
        if key != "max" or least is None:
            raise ValueError(f"{table}.{key}.min_ratio: only for max beside a min; leave it out")
        largest, of = (least.max, least.of) if isinstance(least, Range) else (float(least), None)
        if of != sampled.of:
            raise ValueError(f"{table}.{key}.min_ratio: give `of` in both min and max, or neither")
        if sampled.min_ratio * largest > sampled.max:
            raise ValueError(
                f"{table}.max = {sampled.max}: give at least min_ratio = {sampled.min_ratio} times "
                f"{table}.min = {largest}"
            )
    return ranges


def fill_in(document: dict[str, Any], numbers: dict[Place, float]) -> dict[str, Any]:
    """Return the document of a scene, with numbers in place of the ranges."""
    tables = {key: dict(x) if isinstance(x, dict) else x for key, x in document.items()}
    for (table, key), value in numbers.items():
        name, _, index = key.rstrip("]").partition("[")
        if index:
            tables[table][name] = list(tables[table][name])
            tables[table][name][int(index)] = value
        else:
            tables[table][key] = int(value) if (table, key) == COUNT else value
    return tables


def entries(table: dict[str, Any]) -> dict[str, Any]:
    """Return the values of a table by key; those of a list by "key[0]", "key[1]", …."""
    values: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, list):
            values |= {f"{key}[{i}]": x for i, x in enumerate(value)}
        else:
            values[key] = value
    return values


def _find_ranges(document: dict[str, Any]) -> list[Place]:
    """Return the places at which a document has a table in place of a number."""
    return [
        (name, key)
        for name, table in document.items()
        if isinstance(table, dict)
        for key, value in entries(table).items()
        if isinstance(value, dict)
    ]
