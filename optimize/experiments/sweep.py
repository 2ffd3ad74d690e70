"""sweep(): methods on many variations of one scene, on a grid or drawn from ranges."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from domino_env.scenes.io.reading import load_scene, scene_of_document
from domino_env.scenes.scene import Scene
from optimize.experiments.compare import require_each_once
from optimize.experiments.experiment import Experiment, in_words, run_experiment
from optimize.experiments.runner import Callback, Progress
from optimize.experiments.store import Study
from optimize.experiments.task import Label, Task
from optimize.methods import registry
from optimize.problem import Problem

Value = Label | list[Any]
Point = dict[str, Value]

DEFAULT_BUDGET = 2000  # of a task, where no budget is given
MOST_POINTS, MOST_TASKS = 100_000, 1_000_000
WHOLE = ("row.count", "robust.draws", "robust.seed")  # keys that hold whole numbers
# what says how wide a range is; one way replaces the other
_WAYS: dict[str, tuple[str, ...]] = {
    "fixed": ("min", "max", "step", "values"),
    "values": ("fixed", "min", "max", "step"),
}
_WAYS |= dict.fromkeys(("min", "max", "step"), ("fixed", "values"))
_HOW = "write KEY=FROM:TO:NUMBER, KEY=FROM:TO:NUMBER:log or KEY=VALUE,VALUE,…"
_HOW_RANDOM = "write KEY=FROM:TO, KEY=FROM:TO:log or KEY=VALUE,VALUE,… to draw from"


@dataclass(frozen=True)
class Axis:
    """A key of the scene's file and its values.

    Attributes
    ----------
    key
        For instance "physics.friction".
    values
        All of them; None for any from `low` to `high`.
    low, high
        Least and largest value, where any may be drawn.
    log
        Whether they are drawn evenly in the logarithm.
    """

    key: str
    values: tuple[Value, ...] | None
    low: float = 0.0
    high: float = 0.0
    log: bool = False


def axis_of(text: str, *, drawn: bool = False) -> Axis:
    """Read an axis from a text such as "physics.friction=0:0.5:11".

    Parameters
    ----------
    text
        KEY=FROM:TO:NUMBER are values evenly spread, FROM:TO:NUMBER:log evenly in the logarithm;
        VALUE,VALUE are these, numbers or words; [V, V] is a list of values in JSON, for keys that
        hold lists themselves.
    drawn
        Whether FROM:TO and FROM:TO:log are ranges to draw from, without a number.

    Raises
    ------
    ValueError
        For any other text, with how it is written.
    """
    key, sign, given = (part.strip() for part in text.partition("="))
    how = _HOW_RANDOM if drawn else _HOW
    if not sign or not given or not all(key.split(".")) or " " in key:
        raise ValueError(f"--set {text}: {how}")
    *numbers, last = given.split(":")
    log = last.strip() == "log"
    numbers += [] if log else [last]
    values: tuple[Value, ...]
    try:
        if given.startswith("["):
            values = _listed(text, given)
        elif not numbers[1:]:
            values = tuple(_value(key, word.strip()) for word in given.split(","))
        elif drawn:
            low, high = map(float, numbers)
            _require_range(text, low, high, log)
            if not low < high:
                raise ValueError(f"--set {text}: the first number must be less than the second")
            return Axis(key, None, low, high, log)
        else:
            first, last, count = numbers
            low, high, number = float(first), float(last), int(count)
            _require_range(text, low, high, log)
            if not 1 <= number <= MOST_POINTS:
                raise ValueError(f"--set {text}: give 1 to {MOST_POINTS} values, not {number}")
            spread = np.geomspace(low, high, number) if log else np.linspace(low, high, number)
            # nobody asks for 0.30000000000000004
            values = tuple(_whole(key, float(f"{v:.12g}")) for v in spread)
    except ValueError as error:
        raise (
            error if str(error).startswith("--set") else ValueError(f"--set {text}: {how}")
        ) from None
    if "" in values:
        raise ValueError(f"--set {text}: a value is empty; {how}")
    if len({repr(value) for value in values}) < len(values):
        raise ValueError(f"--set {text}: give each value once")
    return Axis(key, values)


def grid(axes: Sequence[Axis]) -> list[Point]:
    """Combine the values in every way, the last axis changing first; ValueError for too many."""
    values = [axis.values for axis in axes if axis.values is not None]
    number = math.prod(len(v) for v in values)
    if number > MOST_POINTS:
        raise ValueError(f"{number} points: a sweep has at most {MOST_POINTS}; split it")
    keys = [axis.key for axis in axes]
    return [dict(zip(keys, chosen, strict=True)) for chosen in product(*values)]


def drawn_points(axes: Sequence[Axis], number: int, rng: np.random.Generator) -> list[Point]:
    """Draw a number of points from the axes; those that come twice are left out."""
    if not 1 <= number <= MOST_POINTS:
        raise ValueError(f"--random {number}: give 1 to {MOST_POINTS} points")
    found: dict[str, Point] = {}
    for _ in range(number):
        point = {axis.key: _draw(axis, rng) for axis in axes}
        found.setdefault(repr(point), point)
    return list(found.values())


def scene_at(base: Scene, point: Point) -> Scene:
    """Make the scene with the values of a point in its file.

    A value for `fixed` replaces `min` and `max`, and so on.

    Raises
    ------
    ValueError
        For values that no scene can have, and a scene that cannot be searched; it begins with the
        coordinates of the point.
    """
    document = base.document()
    where = in_words(_labels(point))
    for key, value in point.items():
        *tables, last = key.split(".")
        table = document
        for name in tables:
            table = table.setdefault(name, {})
            if not isinstance(table, dict):
                raise ValueError(f"{where}: '{key}': {name} is no table of the scene's file")
        for other in _WAYS.get(last, ()) if tables in (["spacing"], ["thickness"]) else ():
            table.pop(other, None)
        table[last] = copy.deepcopy(value)
    scene = scene_of_document(document, base.name, where)
    try:
        Problem(scene)
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None
    return scene


def sweep(
    scene: Scene | str | Path,
    axes: Sequence[str],
    *,
    executor: Executor | None = None,
    study: Study | None = None,
    callback: Callback | None = None,
    progress: Progress | None = None,
    **tasks: Any,
) -> Experiment:
    """Search many variations of a scene.

    Ctrl-C ends it with what is done; before the first result it is raised.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    axes
        What is varied, such as "physics.friction=0:0.5:11"; see `axis_of`.
    executor, study, callback, progress
        As of `run_tasks`.
    tasks
        `methods`, `seeds`, `budget`, `seconds`, `random`, `seed`: as of `sweep_tasks`.

    Raises
    ------
    ValueError
        For impossible arguments, with its coordinates for a point, before anything runs.
    """
    loaded = scene if isinstance(scene, Scene) else load_scene(scene)
    planned = sweep_tasks(loaded, axes, **tasks)
    return run_experiment(planned, executor, study, callback, progress)


def sweep_tasks(
    scene: Scene,
    axes: Sequence[str],
    methods: Sequence[str] = ("auto",),
    seeds: int = 1,
    budget: int | None = None,
    seconds: float | None = None,
    *,
    random: int | None = None,
    seed: int = 0,
) -> list[Task]:
    """Return the tasks of a sweep, in order, all of them checked.

    Parameters
    ----------
    scene, axes
        As of `sweep`.
    methods
        Names of methods.
    seeds
        Every method runs at every point with the seeds 0, 1, … of this number.
    budget
        Number of evaluations of each task; 2000 where there is no budget of seconds either.
    seconds
        Budget of each task [s].
    random
        Number of points to draw instead of all on the grid.
    seed
        Seed of these draws.
    """
    chosen = [axis_of(axis, drawn=random is not None) for axis in axes]
    if not chosen:
        raise ValueError(f"nothing is swept: --set KEY=…; {_HOW}")
    require_each_once(keys=[axis.key for axis in chosen], methods=methods)
    for name in methods:
        registry.load(name)
    if seeds < 1:
        raise ValueError(f"--seeds {seeds}: give at least one")
    if budget is not None and budget < 1:
        raise ValueError(f"--budget {budget}: give at least one")
    if seconds is not None and not seconds > 0.0:
        raise ValueError(f"--seconds {seconds}: give a time of more than 0 s")
    if budget is None and seconds is None:
        budget = DEFAULT_BUDGET
    if seed < 0:
        raise ValueError(f"--seed {seed}: give a whole number, 0 or more")
    rng = np.random.default_rng(seed)
    points = grid(chosen) if random is None else drawn_points(chosen, random, rng)
    number = len(points) * len(methods) * seeds
    if number > MOST_TASKS:
        raise ValueError(f"{number} tasks: a sweep has at most {MOST_TASKS}; split it")
    varied = [(scene_at(scene, point), _labels(point)) for point in points]
    return [
        Task.of(one, method, run, budget, seconds, labels)
        for one, labels in varied
        for method in methods
        for run in range(seeds)
    ]


def _labels(point: Point) -> dict[str, Label]:
    """Return the labels of a point; lists become text."""
    return {key: json.dumps(v) if isinstance(v, list) else v for key, v in point.items()}


def _draw(axis: Axis, rng: np.random.Generator) -> Value:
    if axis.values is not None:
        return axis.values[int(rng.integers(len(axis.values)))]
    if axis.key in WHOLE:
        return int(rng.integers(math.ceil(axis.low), math.floor(axis.high) + 1))
    if axis.log:
        return float(np.exp(rng.uniform(np.log(axis.low), np.log(axis.high))))
    return float(rng.uniform(axis.low, axis.high))


def _value(key: str, word: str) -> Label:
    try:
        return _whole(key, float(word))
    except ValueError:
        return word


def _whole(key: str, number: float) -> float | int:
    """Return a whole number where the key holds such."""
    return int(number) if key in WHOLE and number == int(number) else number


def _listed(text: str, given: str) -> tuple[Value, ...]:
    try:
        values = json.loads(given)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"--set {text}: not JSON: {error}") from None
    if not values or any(v is None or isinstance(v, bool | dict) for v in values):
        raise ValueError(f"--set {text}: give a list of numbers, words or lists of them")
    return tuple(values)


def _require_range(text: str, low: float, high: float, log: bool) -> None:
    if not (math.isfinite(low) and math.isfinite(high)) or (log and min(low, high) <= 0.0):
        more = " of more than 0" if log else ""
        raise ValueError(f"--set {text}: give finite numbers{more}")
