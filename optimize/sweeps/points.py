"""The points of a sweep: a grid over keys of a scene's file, or scenes drawn from ranges."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from domino_env.scenes.io.reading import scene_of_document
from domino_env.scenes.io.writing import document_of
from domino_env.scenes.scene import Scene

Value = float | int | str | list[Any]
Point = tuple[tuple[str, Value], ...]

MOST_POINTS = 100_000
WHOLE = ("row.count", "robust.draws", "robust.seed")  # keys that hold whole numbers
# what says how wide a range is; one way takes the place of the other
_WAYS: dict[str, tuple[str, ...]] = {
    "fixed": ("min", "max", "step", "values"),
    "values": ("fixed", "min", "max", "step"),
}
_WAYS |= dict.fromkeys(("min", "max", "step"), ("fixed", "values"))
_HOW = "write KEY=FROM:TO:NUMBER, KEY=FROM:TO:NUMBER:log or KEY=VALUE,VALUE,…"
_HOW_RANDOM = "write KEY=FROM:TO, KEY=FROM:TO:log or KEY=VALUE,VALUE,… to draw from"


@dataclass(frozen=True)
class Axis:
    """A key of the scene's file and what it may be.

    Attributes
    ----------
    key
        As in "physics.friction".
    values
        All of them; None for any from `low` to `high`.
    low
        Least value, where any may be drawn.
    high
        Largest value, where any may be drawn.
    log
        Whether they are drawn evenly in the logarithm.
    """

    key: str
    values: tuple[Value, ...] | None
    low: float = 0.0
    high: float = 0.0
    log: bool = False


def axis_of(text: str, *, drawn: bool = False) -> Axis:
    """Read the axis that a text such as "physics.friction=0:0.5:11" says.

    Parameters
    ----------
    text
        KEY=FROM:TO:NUMBER are values evenly spread, FROM:TO:NUMBER:log evenly in the logarithm;
        VALUE,VALUE are these, numbers or words; [V, V] is a list of values as JSON has it, for keys
        that hold lists themselves.
    drawn
        Whether FROM:TO and FROM:TO:log are ranges to draw from, without a number.

    Raises
    ------
    ValueError
        For any other text, with how it is written.
    """
    key, sign, said = (part.strip() for part in text.partition("="))
    how = _HOW_RANDOM if drawn else _HOW
    if not sign or not said or not all(part for part in key.split(".")) or " " in key:
        raise ValueError(f"--set {text}: {how}")
    if said.startswith("["):
        return Axis(key, _listed(text, said))
    parts = said.split(":")
    if len(parts) == 1:
        values = tuple(_value(key, word.strip()) for word in said.split(","))
        if "" in values:
            raise ValueError(f"--set {text}: a value is empty; {how}")
        return Axis(key, _each_once(text, values))
    log = parts[-1].strip() == "log"
    numbers = parts[: len(parts) - log]
    if len(numbers) != (2 if drawn else 3):
        raise ValueError(f"--set {text}: {how}")
    try:
        low, high = float(numbers[0]), float(numbers[1])
        number = 0 if drawn else int(numbers[2])
    except ValueError:
        raise ValueError(f"--set {text}: {how}") from None
    if not (math.isfinite(low) and math.isfinite(high)) or (log and min(low, high) <= 0.0):
        more = " of more than 0" if log else ""
        raise ValueError(f"--set {text}: give finite numbers{more}")
    if drawn:
        if not low < high:
            raise ValueError(f"--set {text}: the first number must be less than the second")
        return Axis(key, None, low, high, log)
    if not 1 <= number <= MOST_POINTS:
        raise ValueError(f"--set {text}: give 1 to {MOST_POINTS} values, not {number}")
    spread = np.geomspace(low, high, number) if log else np.linspace(low, high, number)
    # 0.30000000000000004 is nothing that anyone has asked for
    found = tuple(_whole(key, float(f"{v:.12g}")) for v in spread)
    return Axis(key, _each_once(text, found))


def grid(axes: Sequence[Axis]) -> list[Point]:
    """Combine the values in every way, the last axis changing first; ValueError for too many."""
    _keys_once(axes)
    values = [axis.values for axis in axes if axis.values is not None]
    number = math.prod(len(v) for v in values)
    if number > MOST_POINTS:
        raise ValueError(f"{number} points: a sweep has at most {MOST_POINTS}; split it")
    keys = [axis.key for axis in axes]
    return [tuple(zip(keys, chosen, strict=True)) for chosen in product(*values)]


def drawn(axes: Sequence[Axis], number: int, rng: np.random.Generator) -> list[Point]:
    """Draw points from the axes.

    Parameters
    ----------
    axes
        What is varied, each key once.
    number
        Of points.
    rng
        Draws them.

    Returns
    -------
    list of Point
        The points, those that come twice left out.

    Raises
    ------
    ValueError
        For no points or too many.
    """
    _keys_once(axes)
    if not 1 <= number <= MOST_POINTS:
        raise ValueError(f"--random {number}: give 1 to {MOST_POINTS} points")
    found: dict[str, Point] = {}
    for _ in range(number):
        point = tuple((axis.key, _draw(axis, rng)) for axis in axes)
        found.setdefault(repr(point), point)
    return list(found.values())


def scene_at(base: Scene, point: Point) -> Scene:
    """Make the scene with the point's values in its file.

    A value for `fixed` takes the place of `min` and `max`, and so on.

    Raises
    ------
    ValueError
        For values that no scene can have; it begins with the point's coordinates.
    """
    document = document_of(base)
    where = in_words(point)
    for key, value in point:
        *tables, last = key.split(".")
        table = document
        for name in tables:
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                raise ValueError(f"{where}: '{key}': {name} is no table of the scene's file")
        for other in _WAYS.get(last, ()) if tables in (["spacing"], ["thickness"]) else ():
            table.pop(other, None)
        table[last] = copy.deepcopy(value)
    return scene_of_document(document, base.name, where)


def in_words(point: Point) -> str:
    """Say the coordinates of a point."""
    return ", ".join(f"{key} = {label(value)}" for key, value in point)


def label(value: Value) -> float | int | str:
    """Make a value the label of a task: lists become text."""
    return json.dumps(value) if isinstance(value, list) else value


def _draw(axis: Axis, rng: np.random.Generator) -> Value:
    if axis.values is not None:
        return axis.values[int(rng.integers(len(axis.values)))]
    if axis.key in WHOLE:
        return int(rng.integers(math.ceil(axis.low), math.floor(axis.high) + 1))
    if axis.log:
        return float(np.exp(rng.uniform(np.log(axis.low), np.log(axis.high))))
    return float(rng.uniform(axis.low, axis.high))


def _value(key: str, word: str) -> Value:
    try:
        return _whole(key, float(word))
    except ValueError:
        return word


def _whole(key: str, number: float) -> float | int:
    """A whole number where the key holds such."""
    return int(number) if key in WHOLE and number == int(number) else number


def _listed(text: str, said: str) -> tuple[Value, ...]:
    try:
        values = json.loads(said)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"--set {text}: not JSON: {error}") from None
    if not values or any(v is None or isinstance(v, bool | dict) for v in values):
        raise ValueError(f"--set {text}: give a list of numbers, words or lists of them")
    return _each_once(text, tuple(values))


def _each_once(text: str, values: tuple[Value, ...]) -> tuple[Value, ...]:
    if len({repr(value) for value in values}) < len(values):
        raise ValueError(f"--set {text}: give each value once")
    return values


def _keys_once(axes: Sequence[Axis]) -> None:
    keys = [axis.key for axis in axes]
    if not keys:
        raise ValueError(f"nothing is swept: --set KEY=…; {_HOW}")
    for key in keys:
        if keys.count(key) > 1:
            raise ValueError(f"--set {key} is given twice: give it once")
