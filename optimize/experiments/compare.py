"""Comparison of methods with the uniform baseline and with each other, with equal budgets."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from domino_env.core.checks import require, require_type
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from optimize.experiments.best_known import best_known_score
from optimize.experiments.experiment import Experiment
from optimize.experiments.runner import run_experiment
from optimize.experiments.task import Label, Task, TaskResult, describe_labels, read_scene
from optimize.methods import registry
from optimize.methods.registry import Method


def compare(
    scenes: Scene | str | Iterable[Scene | str],
    methods: str | Method | Iterable[str | Method],
    seeds: Iterable[int],
    budget: int | None = None,
    *,
    seconds: float | None = None,
    **options: Any,
) -> Experiment:
    """Run every method on every scene with every seed, each with the same limit.

    Parameters
    ----------
    scenes
        One scene or several, or their names.
    methods
        One name of a method or several, also "package.module:function", or functions
        `run(evaluator, rng)` that other processes can import.
    seeds
        Seeds; each method runs on each scene with each of them.
    budget
        Number of layouts that each run may simulate, which makes the comparison bitwise
        reproducible.
    seconds
        Time of each run [s], instead of `budget`; that of the uniform baseline, which all runs
        share, is part of each. Equal seconds are a fair comparison only if every run has a core
        for itself: an executor must have no more workers than its machines have cores.
    options
        `executor`, `study`, `name` and `progress`, see `run_experiment`.

    Returns
    -------
    Experiment
        Results, ordered by scene, seed and method.

    Raises
    ------
    ValueError
        If an argument is empty, has an entry twice or is out of its range, or if no run has a
        result; a run that fails beside others is one of the `failures`.
    TypeError
        If `seeds` is a single number.
    KeyboardInterrupt
        On Ctrl-C before the first result; later it ends the comparison with the results so far.

    Examples
    --------
    >>> table = compare(["sprint"], ["cma", "random"], range(2), 50)
    >>> [len(table.runs(method)) for method in table.methods]
    [2, 2]
    """
    scene_objects = [s if isinstance(s, Scene) else load_scene(s) for s in as_list(scenes)]
    tasks = plan_tasks([(s, {}) for s in scene_objects], methods, seeds, budget, seconds)
    return run_experiment(tasks, known_score=known_score, **options)


def plan_tasks(
    problems: Iterable[tuple[Scene, dict[str, Label]]],
    methods: str | Method | Iterable[str | Method],
    seeds: Iterable[int],
    budget: int | None = None,
    seconds: float | None = None,
) -> list[Task]:
    """Return a task for each scene with its labels, seed and method, in this order.

    Seeds come before methods so that other load on the machine affects all methods alike.

    Parameters
    ----------
    problems
        Scenes, each with its labels; they are read when all else has been checked.
    methods, seeds, budget, seconds
        See `compare`.

    Raises
    ------
    ValueError
        See `compare`.
    """
    if (seconds is None) == (budget is None):
        raise ValueError(f"budget = {budget}, seconds = {seconds}: give exactly one of the two")
    for name, limit in (("budget", budget), ("seconds", seconds)):
        require(name, limit, above=0.0, whole=name == "budget", optional=True)
    require_type("seeds", seeds, Iterable, "several, such as range(5)")
    seeds = list(seeds)
    names = [registry.method_name(method) for method in as_list(methods)]
    require_distinct(methods=names, seeds=seeds)
    for name in names:
        registry.load(name)
    points = [(scene.name, scene.to_toml(), labels) for scene, labels in problems]
    require_distinct(scenes=[describe_labels(labels) or name for name, _, labels in points])
    return [
        Task(text, method, seed, budget, seconds, labels)
        for _, text, labels in points
        for seed in seeds
        for method in names
    ]


def as_list(value: Any) -> list[Any]:
    """Return several values as a list, or a list of one value; a string is one value."""
    return list(value) if isinstance(value, Iterable) and not isinstance(value, str) else [value]


def require_distinct(**lists: Sequence[object]) -> None:
    """Raise ValueError for a list, given by its name, that is empty or has an entry twice."""
    for name, values in lists.items():
        if not values or "" in values:
            raise ValueError(f"{name} is empty: give at least one")
        if len(set(values)) < len(values):
            raise ValueError(f"{name} = {', '.join(map(str, values))}: give each once")


def known_score(result: TaskResult) -> float:
    """Return the score of the best known layout of a result's scene; -inf if there is none."""
    return best_known_score(read_scene(result.scene))
