"""Sweep of methods over many variations of one scene, on a grid or sampled from ranges."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from domino_env.core.checks import require
from domino_env.scenes.io.reading import read_named, scene_of_document
from domino_env.scenes.scene import Scene
from optimize.experiments.compare import plan_tasks, require_distinct
from optimize.experiments.experiment import Experiment
from optimize.experiments.runner import run_experiment
from optimize.experiments.task import Label, Task, describe_labels
from optimize.problem import Problem

Value = Label | list[Any]
Point = dict[str, Value]

DEFAULT_BUDGET = 2000  # layouts of a search
MAX_POINTS = 100_000
WHOLE_KEYS = ("row.count", "robust.draws", "robust.seed")  # keys that hold whole numbers
RANGE_KEYS = ("fixed", "values", "min", "max", "step")  # of a table such as [spacing]
GRID_SYNTAX = "write KEY=FROM:TO:NUMBER, KEY=FROM:TO:NUMBER:log or KEY=VALUE,VALUE,…"
RANDOM_SYNTAX = "write KEY=FROM:TO, KEY=FROM:TO:log or KEY=VALUE,VALUE,… to sample from"


@dataclass(frozen=True)
class Axis:
    """A key of the scene's file and its values.

    Attributes
    ----------
    key
        Name with the tables before it, such as "physics.friction".
    values
        All values; None for the range from `low` to `high`.
    low, high
        Least and largest value of a range.
    log
        True for a range that is sampled evenly in the logarithm.
    """

    key: str
    values: tuple[Value, ...] | None
    low: float = 0.0
    high: float = 0.0
    log: bool = False

    def sample(self, rng: np.random.Generator) -> Value:
        """Draw a value."""
        if self.values is not None:
            return self.values[int(rng.integers(len(self.values)))]
        if self.key in WHOLE_KEYS:
            return int(rng.integers(math.ceil(self.low), math.floor(self.high) + 1))
        if self.log:
            return float(np.exp(rng.uniform(np.log(self.low), np.log(self.high))))
        return float(rng.uniform(self.low, self.high))


def parse_axis(text: str, *, sampled: bool = False) -> Axis:
    """Read an axis from a text such as "physics.friction=0:0.5:11".

    Parameters
    ----------
    text
        KEY=FROM:TO:NUMBER for evenly spread values, FROM:TO:NUMBER:log for values evenly spread in
        the logarithm, VALUE,VALUE for numbers or words, or [V, V] for a list of values in JSON, for
        keys that hold lists themselves.
    sampled
        True for FROM:TO and FROM:TO:log as ranges to sample from, without a number.

    Raises
    ------
    ValueError
        The text is none of these; the message has the syntax.
    """
    key, _, given = (part.strip() for part in text.partition("="))
    syntax = RANDOM_SYNTAX if sampled else GRID_SYNTAX
    try:
        if not given or not all(key.split(".")):
            raise ValueError("a key or its values are missing")
        if ":" in given:
            return _range(key, given, sampled=sampled)
        words = json.loads(given) if given.startswith("[") else given.split(",")
        values = [_number_or_word(key, w) if isinstance(w, str) else w for w in words]
        return Axis(key, _distinct(values))
    except ValueError as error:
        raise ValueError(f"--set {text}: {error}; {syntax}") from None


def _range(key: str, text: str, *, sampled: bool) -> Axis:
    """Read FROM:TO:NUMBER, or FROM:TO to sample from, each with :log or without."""
    parts = text.split(":")
    log = parts[-1].strip() == "log"
    first, last, *number = parts[: len(parts) - log]
    ends = np.array([float(first), float(last)])
    require("FROM, TO", ends, above=0.0 if log else -math.inf)
    low, high = ends.tolist()
    if sampled:
        if number or not low < high:
            raise ValueError("give two numbers, the smaller one first")
        return Axis(key, None, low, high, log)
    if len(number) != 1:
        raise ValueError("give the number of values")
    require("NUMBER", int(number[0]), 1, MAX_POINTS, whole=True)
    spread = (np.geomspace if log else np.linspace)(low, high, int(number[0]))
    # twelve digits: 0.3, not 0.30000000000000004
    return Axis(key, _distinct([_whole(key, float(f"{value:.12g}")) for value in spread]))


def _distinct(values: list[Value]) -> tuple[Value, ...]:
    """Return values of which each is given once."""
    if not values or len({repr(value) for value in values}) < len(values):
        raise ValueError("give each value once")
    return tuple(values)


def _number_or_word(key: str, word: str) -> Label:
    """Return a word as a number where it is one."""
    try:
        return _whole(key, float(word))
    except ValueError:
        return word.strip()


def _whole(key: str, number: float) -> float | int:
    """Return a whole number where the key holds such."""
    return int(number) if key in WHOLE_KEYS and number == int(number) else number


def grid(axes: Sequence[Axis]) -> list[Point]:
    """Combine the values in every way, the last axis changing first."""
    values = [axis.values for axis in axes if axis.values is not None]
    number = math.prod(len(v) for v in values)
    if number > MAX_POINTS:
        raise ValueError(f"{number} points: a sweep has at most {MAX_POINTS}; split it")
    keys = [axis.key for axis in axes]
    return [dict(zip(keys, chosen, strict=True)) for chosen in product(*values)]


def sample_points(axes: Sequence[Axis], number: int, rng: np.random.Generator) -> list[Point]:
    """Sample points from the axes; a point that is drawn twice is returned once."""
    require("random", number, 1, MAX_POINTS, whole=True)
    points = [{axis.key: axis.sample(rng) for axis in axes} for _ in range(number)]
    return list({repr(point): point for point in points}.values())


def scene_at(base: dict[str, Any], name: str, point: Point, file: str = "") -> Scene:
    """Return the scene of a document in which the values of a point replace others.

    A value for `fixed` replaces `min` and `max`, and so on.

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
        The values are no scene's, or nothing is left to search; the message begins with the file
        and the coordinates of the point.
    """
    document = copy.deepcopy(base)
    where = " at ".join(filter(None, (file, describe_labels(_labels(point)))))
    for key, value in point.items():
        *tables, last = key.split(".")
        table = document
        for part in tables:
            table = table.setdefault(part, {})
            if not isinstance(table, dict):
                raise ValueError(f"{where}: '{key}': {part} is no table of the scene's file")
        if tables in (["spacing"], ["thickness"]) and last in RANGE_KEYS:
            # one way of giving a range replaces the others; min, max and step are one way
            others = RANGE_KEYS if last in ("fixed", "values") else ("fixed", "values")
            for other in others:
                table.pop(other, None)
        table[last] = copy.deepcopy(value)
    scene = scene_of_document(document, name, where)
    try:
        Problem(scene)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    return scene


def sweep(
    scene: Scene | str | Path,
    axes: Sequence[str],
    methods: Sequence[str] = ("auto",),
    seeds: int = 1,
    budget: int | None = None,
    *,
    seconds: float | None = None,
    random: int | None = None,
    seed: int = 0,
    **options: Any,
) -> Experiment:
    """Search many variations of a scene.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    axes
        Axes such as "physics.friction=0:0.5:11"; see `optimize.experiments.sweep.parse_axis`.
    methods
        Names of methods.
    seeds
        Number of seeds, from 0, with which every method runs at every point.
    budget
        Number of layouts that each search may simulate; 2000 where `seconds` is not given either.
    seconds
        Time of each search [s], instead.
    random
        Number of points that are sampled, instead of all on the grid.
    seed
        Seed of these samples.
    options
        `executor`, `study`, `name` and `progress`: as of `run_experiment`.

    Returns
    -------
    Experiment
        Results, ordered by point, seed and method; the labels of a result are its point.

    Raises
    ------
    ValueError
        An argument is impossible, or a point, before any search starts; or no search has a result.
    KeyboardInterrupt
        Ctrl-C before the first result; later it ends the sweep with the results so far.

    Examples
    --------
    >>> table = sweep("sprint", ["physics.friction=0,0.5"], ["random"], budget=50)
    >>> [point for point, in table.points]
    [0.0, 0.5]
    """
    tasks = plan_sweep(scene, axes, methods, seeds, budget, seconds, random=random, seed=seed)
    return run_experiment(tasks, **options)


def plan_sweep(
    scene: Scene | str | Path,
    axes: Sequence[str],
    methods: Sequence[str] = ("auto",),
    seeds: int = 1,
    budget: int | None = None,
    seconds: float | None = None,
    *,
    random: int | None = None,
    seed: int = 0,
) -> list[Task]:
    """Return the tasks of a sweep, in order, with every point checked; see `sweep`."""
    if isinstance(scene, Scene):
        base, name, file = scene.document(), scene.name, ""
    else:  # only the points are checked: they may replace what is impossible in the file
        base, name, file = read_named(scene)
    parsed = [parse_axis(axis, sampled=random is not None) for axis in axes]
    if not parsed:
        raise ValueError(f"nothing is swept: --set KEY=…; {GRID_SYNTAX}")
    require_distinct(keys=[axis.key for axis in parsed])
    require("seed", seed, 0, whole=True)
    if random is None:
        points = grid(parsed)
    else:
        points = sample_points(parsed, random, np.random.default_rng(seed))
    if budget is None and seconds is None:
        budget = DEFAULT_BUDGET
    scenes = [scene_at(base, name, point, file) for point in points]
    labels = [_labels(point) for point in points]
    return plan_tasks(scenes, methods, range(seeds), budget, seconds, labels)


def _labels(point: Point) -> dict[str, Label]:
    """Return the labels of a point; lists become text."""
    return {key: json.dumps(v) if isinstance(v, list) else v for key, v in point.items()}
