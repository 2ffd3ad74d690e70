"""Tables of a scene's file: the keys that each may hold, and how one is read, or refused."""

from __future__ import annotations

import difflib
import re
from typing import Any

import numpy as np

from domino_env.support.reading import one_line, shown

LONGEST_TITLE = 300  # [characters]
SMALLEST, LARGEST = 1e-9, 1e9  # of every size in a file, SI: products of four still have digits
MOST_DOMINOES = 100_000  # the best uniform row takes some 3 ms a domino
NAME = re.compile(r"[^\W_][^\x00-\x1f/\\<>:\"|?*`$]{0,99}")

TOP = (
    "name", "title", "objective", "row", "spacing", "thickness", "stock", "growth", "physics",
    "limits", "tempo", "robust",
)  # fmt: skip
ROW = ("count", "height", "width", "density", "first_thickness", "length")
THICKNESS = ("min", "max", "fixed", "step", "values", "of")
SPACING = (*THICKNESS, "largest_change")
STOCK = ("thickness", "count")
GROWTH = ("min", "max")
# what may be as small as it likes: nothing is divided by it
TINY = (
    "friction",
    "deviation",
    "quantile",
    "stall_margin",
    "flush_loss",
    "largest_change",
    "step",
)
PHYSICS = ("friction", "gravity", "push")
LIMITS = ("stall_margin", "flush_loss")
TEMPO = ("from", "to", "times", "tolerance")
ROBUST = ("deviation", "quantile", "draws", "seed")


def require_known(table: dict[str, Any], allowed: tuple[str, ...], file: str, where: str) -> None:
    for key in table:
        if key not in allowed:
            near = difflib.get_close_matches(key[:LONGEST_TITLE], allowed, n=1)
            hint = f"did you mean '{near[0]}'? " if near else ""
            raise ValueError(
                f"{file}: unknown key '{where}{one_line(key, 60)}': {hint}allowed: "
                f"{', '.join(allowed)}"
            )


def table_of(
    document: dict[str, Any], name: str, allowed: tuple[str, ...], file: str
) -> dict[str, Any]:
    table = document.get(name)
    if not isinstance(table, dict):
        what = "is missing" if table is None else "is no table"
        raise ValueError(f"{file}: the table [{name}] {what}; it holds {', '.join(allowed)}")
    require_known(table, allowed, file, f"{name}.")
    return table


def name_of(document: dict[str, Any], file: str, default: str) -> str:
    """What a scene is called, and its run's folder after it."""
    name = line_of(document, "name", file, default)
    if not NAME.fullmatch(name):
        raise ValueError(
            f"{file}: name = {shown(name)}: begin with a letter or a digit, at most 100 "
            'characters, none of / \\ < > : " | ? * ` $: a folder may be called after the scene'
        )
    return name


def line_of(document: dict[str, Any], key: str, file: str, default: str) -> str:
    value = document.get(key, default)
    good = isinstance(value, str) and value.strip() and len(value) <= LONGEST_TITLE
    if not (good and value.isprintable()):
        what = f"give a line of text, 1 to {LONGEST_TITLE} characters that can be printed"
        raise ValueError(f"{file}: {key} = {shown(value)}: {what}")
    return str(value)


def finite(table: dict[str, Any], where: str, key: str, file: str, default: float | None) -> float:
    value = table.get(key, default)
    if value is None:
        raise ValueError(f"{file}: {where}.{key} is missing: give a number, SI units")
    # compared, not converted: TOML's whole numbers may be larger than any float
    number = isinstance(value, int | float) and not isinstance(value, bool)
    least = 0.0 if value == 0 or key in TINY else SMALLEST
    if not (number and least <= abs(value) <= LARGEST):
        raise ValueError(
            f"{file}: {where}.{key} = {shown(value)}: give a finite number, SI units, 0 or of a "
            f"size from {SMALLEST:g} to {LARGEST:g}"
        )
    return float(value)


def positive(
    table: dict[str, Any], where: str, key: str, file: str, default: float | None
) -> float:
    value = finite(table, where, key, file, default)
    if value <= 0.0:
        raise ValueError(f"{file}: {where}.{key} = {value}: must be more than 0, SI units")
    return value


def whole(
    table: dict[str, Any], where: str, key: str, file: str, default: int | None, low: int, high: int
) -> int:
    value = table.get(key, default)
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        what = f"{where}.{key} is missing" if value is None else f"{where}.{key} = {shown(value)}"
        raise ValueError(f"{file}: {what}: give a whole number from {low} to {high}")
    return value


def numbers(table: dict[str, Any], where: str, key: str, file: str) -> tuple[float, ...]:
    values = table.get(key)
    if not isinstance(values, list) or not values:
        what = "is missing" if values is None else f"= {shown(values)}"
        raise ValueError(f"{file}: {where}.{key} {what}: give a list of numbers, [0.005, 0.0075]")
    entries = {f"{key}[{i}]": value for i, value in enumerate(values)}
    return tuple(positive(entries, where, entry, file, None) for entry in entries)


def steps(low: float, high: float, step: float) -> tuple[float, ...]:
    """low, low + step, … up to high [m], to the picometre."""
    number = int(np.floor((high - low) / step + 1e-9)) + 1
    return tuple(round(low + k * step, 12) for k in range(number))
