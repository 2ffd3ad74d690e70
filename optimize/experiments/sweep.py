"""Sweep of methods over many variations of one scene, on a grid of values."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Iterable
from contextlib import suppress
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from domino_env.core.checks import require
from domino_env.scenes.io.reading import read_named, scene_from_document
from domino_env.scenes.scene import Scene
from optimize.experiments.compare import as_list, plan_tasks, require_distinct
from optimize.experiments.experiment import Experiment
from optimize.experiments.runner import run_experiment
from optimize.experiments.task import Label, Task, describe_labels
from optimize.problem import Problem

Value = Label | list[Any]
Point = dict[str, Value]

MAX_NUMBER = 100_000  # values of a key, each of which is at least one scene
DEFAULT_BUDGET = 2000  # largest number of layouts that each search simulates
# keys of [spacing] and [thickness], with those that each replaces
OTHER_KEYS = {"fixed": ("min", "max"), "min": ("fixed",), "max": ("fixed",)}
SYNTAX = "write KEY=FROM:TO:NUMBER, KEY=FROM:TO:NUMBER:log or KEY=VALUE,VALUE,…"


def parse_axis(text: str) -> tuple[str, list[Value]]:
    """Read a key of a scene's file and its values from a text.

    Parameters
    ----------
    text
        KEY=FROM:TO:NUMBER for evenly spaced values, KEY=FROM:TO:NUMBER:log for values with evenly
        spaced logarithms, KEY=VALUE,VALUE for numbers or words, or KEY=[V, V] for values in JSON,
        such as those of keys that hold lists.

    Returns
    -------
    key : str
        Name with the tables before it, such as "physics.friction".
    values : list
        Its values.

    Raises
    ------
    ValueError
        If the text has another form; the message has the syntax.
    """
    key, _, listing = (part.strip() for part in str(text).partition("="))
    try:
        if not listing or not all(key.split(".")):
            raise ValueError("a key or its values are missing")
        if ":" in listing:
            texts: list[Any] = _spread_values(listing)
        else:
            texts = json.loads(listing) if listing.startswith("[") else listing.split(",")
        values: list[Value] = [_parse_value(v) if isinstance(v, str) else v for v in texts]
        if not values or len({repr(value) for value in values}) < len(values):
            raise ValueError("give at least one value, and each value once")
        return key, values
    except ValueError as error:
        raise ValueError(f"--set {text}: {error}; {SYNTAX}") from None


def _spread_values(text: str) -> list[str]:
    """Return the values of FROM:TO:NUMBER, with :log or without, as texts."""
    parts = text.split(":")
    log = parts[-1].strip() == "log"
    if len(parts) != 3 + log:
        raise ValueError("give two numbers and the number of values")
    ends = np.array([float(parts[0]), float(parts[1])])
    require("FROM, TO", ends, above=0.0 if log else -math.inf, array=True)
    require("NUMBER", int(parts[2]), 1, MAX_NUMBER, whole=True)
    spread = (np.geomspace if log else np.linspace)(ends[0], ends[1], int(parts[2]))
    return [f"{value:.12g}" for value in spread]  # 0.3, not 0.30000000000000004


def _parse_value(text: str) -> Label:
    """Convert a text to a number if it is one, to an integer if it is whole."""
    with suppress(ValueError):
        number = float(text)
        return int(number) if number.is_integer() and abs(number) < 1e15 else number
    return text.strip()


def make_scene(base: dict[str, Any], name: str, point: Point, file: str = "") -> Scene:
    """Return the scene of a document in which the values of a point replace or add others.

    In a range, `fixed` replaces `min` and `max`, and either of these replaces `fixed`.

    Parameters
    ----------
    base
        Document of a scene, which need not be valid without the values of the point.
    name
        Name of the scene unless the document has one.
    point
        Values by key.
    file
        Name of the document in messages.

    Raises
    ------
    ValueError
        If the values do not describe a scene, or leave nothing free to search; the message begins
        with the file and the coordinates of the point.
    """
    document = copy.deepcopy(base)
    place = " at ".join(filter(None, (file, describe_labels(_labels(point)))))
    for key, value in point.items():
        table_name, _, last = key.rpartition(".")
        table = document.setdefault(table_name, {}) if table_name else document
        if not isinstance(table, dict):
            raise ValueError(f"{place}: '{key}': {table_name} is not a table of the scene's file")
        if table_name in ("spacing", "thickness") and last in OTHER_KEYS:
            for other_key in OTHER_KEYS[last]:
                table.pop(other_key, None)
        table[last] = copy.deepcopy(value)
    scene = scene_from_document(document, name, place)
    try:
        Problem(scene)
    except ValueError as error:
        raise ValueError(f"{place}: {error}") from None
    return scene


def sweep(
    scene: Scene | str | Path,
    axes: str | Iterable[str],
    methods: str | Iterable[str] = "auto",
    seeds: int = 1,
    budget: int | None = None,
    *,
    seconds: float | None = None,
    **options: Any,
) -> Experiment:
    """Search many variations of a scene.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    axes
        One axis or several, such as "physics.friction=0:0.5:11"; see
        `optimize.experiments.sweep.parse_axis`.
    methods
        One name of a method or several.
    seeds
        Number of seeds, from 0, with which every method runs at every point.
    budget
        Number of layouts that each search may simulate; 2000 if `seconds` is not given either.
    seconds
        Time of each search [s], instead of `budget`.
    options
        `executor`, `study`, `name` and `progress`, see `run_experiment`.

    Returns
    -------
    Experiment
        Results, ordered by point, seed and method; the labels of a result are its point.

    Raises
    ------
    ValueError
        If an argument or a point is invalid, before any search starts, or if no search has a
        result.
    KeyboardInterrupt
        On Ctrl-C before the first result; later it ends the sweep with the results so far.

    Examples
    --------
    >>> table = sweep("sprint", ["physics.friction=0,0.5"], ["random"], budget=50)
    >>> table.problems
    ['physics.friction = 0', 'physics.friction = 0.5']
    """
    return run_experiment(plan_sweep(scene, axes, methods, seeds, budget, seconds), **options)


def plan_sweep(
    scene: Scene | str | Path,
    axes: str | Iterable[str],
    methods: str | Iterable[str] = "auto",
    seeds: int = 1,
    budget: int | None = None,
    seconds: float | None = None,
) -> list[Task]:
    """Return the tasks of a sweep, ordered by point, seed and method; check every point.

    Parameters
    ----------
    scene, axes, methods, seeds, budget, seconds
        See `sweep`.

    Raises
    ------
    ValueError
        If an argument or a point is invalid.
    """
    if isinstance(scene, Scene):
        base, name, file = scene.document(), scene.name, ""
    else:  # only the points are checked, as they may replace invalid values of the file
        base, name, file = read_named(scene)
    axis_values = [parse_axis(axis) for axis in as_list(axes)]
    if not axis_values:
        raise ValueError(f"no key is varied: add --set; {SYNTAX}")
    keys, values = zip(*axis_values, strict=True)
    require_distinct(keys=keys)
    require("seeds", seeds, 1, whole=True)
    if budget is None and seconds is None:
        budget = DEFAULT_BUDGET
    points = (dict(zip(keys, point, strict=True)) for point in product(*values))
    problems = ((make_scene(base, name, point, file), _labels(point)) for point in points)
    return plan_tasks(problems, methods, range(seeds), budget, seconds)


def _labels(point: Point) -> dict[str, Label]:
    """Return the labels of a point; lists become text."""
    return {key: json.dumps(v) if isinstance(v, list) else v for key, v in point.items()}
