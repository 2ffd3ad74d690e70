"""sweep(): methods on many variations of one scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from domino_env.core.results import brief
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from optimize.methods import registry
from optimize.problem import Problem
from optimize.studies.progress import TaskLines
from optimize.studies.running import Failure, Keeper, run_tasks
from optimize.studies.task import Task, TaskResult
from optimize.sweeps.points import Axis, Point, axis_of, drawn, grid, in_words, label, scene_at

DEFAULT_EVALUATIONS = 2000  # a task, where nothing is said
MOST_TASKS = 1_000_000


@dataclass(frozen=True, eq=False)
class Sweep:
    """Results of a sweep.

    Attributes
    ----------
    scene
        What was varied.
    keys
        Keys of its file that were.
    results
        Of every task that is done, in the order of the tasks: points, methods, seeds.
    failures
        Tasks that have no result.
    interrupted
        Whether it was ended by hand.
    """

    scene: Scene
    keys: tuple[str, ...]
    results: tuple[TaskResult, ...]
    failures: tuple[Failure, ...] = ()
    interrupted: bool = False

    __repr__ = brief

    @property
    def points(self) -> list[tuple[float | int | str, ...]]:
        """Values of the keys at each point."""
        return list(dict.fromkeys(self.point(result) for result in self.results))

    @property
    def methods(self) -> list[str]:
        """Names of the methods, in the order given."""
        return list(dict.fromkeys(result.method for result in self.results))

    def point(self, result: TaskResult) -> tuple[float | int | str, ...]:
        """Give the values of the keys for one result."""
        return tuple(value for _, value in result.labels)

    def best_of(self, result: TaskResult) -> float:
        """Find the best score at the point of a result."""
        return self.best[self.point(result)]

    @cached_property
    def best(self) -> dict[tuple[float | int | str, ...], float]:
        """Best score at each point, whoever found it."""
        best: dict[tuple[float | int | str, ...], float] = {}
        for result in self.results:
            point = self.point(result)
            best[point] = max(best.get(point, -np.inf), result.score)
        return best


def sweep(
    scene: Scene | str | Path,
    axes: Sequence[Axis | str],
    methods: Sequence[str] = ("auto",),
    seeds: int = 1,
    evaluations: int | None = None,
    seconds: float | None = None,
    *,
    random: int | None = None,
    seed: int = 0,
    executor: Executor | None = None,
    study: Keeper | None = None,
    told: Callable[[Task, TaskResult], None] | None = None,
    lines: TaskLines | None = None,
) -> Sweep:
    """Search many variations of a scene.

    Ctrl-C ends it with what is done; before the first result it is raised.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    axes
        What is varied, such as "physics.friction=0:0.5:11"; see `optimize.sweeps.points.axis_of`.
    methods
        Names of methods.
    seeds
        Every method runs at every point with the seeds 0, 1, … of this number.
    evaluations
        Budget of each task; 2000 where there is no budget of seconds either.
    seconds
        Budget of each task [s].
    random
        Draw so many points instead of all on the grid.
    seed
        Of these draws.
    executor, study, told, lines
        As of `optimize.studies.running.run_tasks`.

    Raises
    ------
    ValueError
        For anything wrong, with its coordinates where it is a point, before anything runs.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    tasks = sweep_tasks(scene, axes, methods, seeds, evaluations, seconds, random=random, seed=seed)
    return run_sweep(scene, tasks, executor=executor, study=study, told=told, lines=lines)


def sweep_tasks(
    scene: Scene,
    axes: Sequence[Axis | str],
    methods: Sequence[str] = ("auto",),
    seeds: int = 1,
    evaluations: int | None = None,
    seconds: float | None = None,
    *,
    random: int | None = None,
    seed: int = 0,
) -> list[Task]:
    """List the tasks of a sweep, in order, all of them checked; see `sweep`."""
    is_drawn = random is not None
    chosen = [axis_of(a, drawn=is_drawn) if isinstance(a, str) else a for a in axes]
    if not methods or len(set(methods)) < len(methods):
        raise ValueError(f"methods = {', '.join(methods) or 'none'}: give each once")
    for name in methods:
        registry.load(name)
    if seeds < 1:
        raise ValueError(f"--seeds {seeds}: give at least one")
    if evaluations is not None and evaluations < 1:
        raise ValueError(f"--evaluations {evaluations}: give at least one")
    if seconds is not None and not seconds > 0.0:
        raise ValueError(f"--seconds {seconds}: give a time of more than 0 s")
    if evaluations is None and seconds is None:
        evaluations = DEFAULT_EVALUATIONS
    if seed < 0:
        raise ValueError(f"--seed {seed}: give a whole number, 0 or more")
    points = grid(chosen) if random is None else drawn(chosen, random, np.random.default_rng(seed))
    number = len(points) * len(methods) * seeds
    if number > MOST_TASKS:
        raise ValueError(f"{number} tasks: a sweep has at most {MOST_TASKS}; split it")
    checked = [(point, _checked(scene, point)) for point in points]
    return [
        Task.of(varied, method, run, evaluations, seconds, _labels(point))
        for point, varied in checked
        for method in methods
        for run in range(seeds)
    ]


def run_sweep(
    scene: Scene,
    tasks: Sequence[Task],
    *,
    executor: Executor | None = None,
    study: Keeper | None = None,
    told: Callable[[Task, TaskResult], None] | None = None,
    lines: TaskLines | None = None,
) -> Sweep:
    """Run what `sweep_tasks` has made of a scene."""
    found: dict[str, TaskResult] = {}

    def keep(task: Task, result: TaskResult) -> None:
        found[task.key] = result
        if told is not None:
            told(task, result)

    once = {task.key: task for task in tasks}  # two points may be the same scene
    failures: list[Failure] = []
    interrupted = False
    try:
        failures = run_tasks(list(once.values()), executor, study, keep, lines)
    except KeyboardInterrupt:
        if not found:
            raise
        interrupted = True
    results = [replace(found[t.key], labels=t.labels) for t in tasks if t.key in found]
    keys = tuple(key for key, _ in tasks[0].labels)
    return Sweep(scene, keys, tuple(results), tuple(failures), interrupted)


def _checked(scene: Scene, point: Point) -> Scene:
    """The scene at a point; ValueError with its coordinates where it cannot be searched."""
    varied = scene_at(scene, point)
    try:
        Problem(varied)
    except ValueError as error:
        raise ValueError(f"{in_words(point)}: {error}") from None
    return varied


def _labels(point: Point) -> tuple[tuple[str, float | int | str], ...]:
    return tuple((key, label(value)) for key, value in point)
