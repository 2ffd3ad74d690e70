"""The runs of a benchmark, in parallel, each once."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from agents.algorithms import ALGORITHMS
from agents.benchmark.results import Benchmark, best_scores
from agents.benchmark.task import BenchmarkTask
from agents.scripted import SCRIPTED
from domino_env import Scene, SceneDistribution
from domino_env.scenes.distribution import load_any
from optimize.methods import registry
from optimize.studies.progress import TaskLines
from optimize.studies.running import Failure, Keeper, run_tasks
from optimize.studies.task import Task, TaskResult

SCENES = ("sprint", "course", "sprint-thickness", "ideal", "varied")
PROBLEMS = Scene | SceneDistribution
RIVALS = ("ramp", "cma", "auto")  # what a learner has to be held against
SEEDS = 10
FEW = 5  # seeds of what takes longer than
SHORT = 120.0  # [s] of processor time a run, in the median


def benchmark_tasks(
    scenes: Sequence[Scene | SceneDistribution | str] = SCENES,
    algorithms: Sequence[str] = (*ALGORITHMS, *RIVALS),
    seeds: int = SEEDS,
    steps: int | None = None,
    seconds: float | None = None,
    home: str | Path = "runs/benchmark",
) -> list[BenchmarkTask]:
    """List the runs of a benchmark, in order: all of one seed before the next seed.

    Parameters
    ----------
    scenes
        Scenes, distributions of scenes that a test set ships with, or their names.
    algorithms
        Those that learn, scripted policies, and methods of a search.
    seeds
        How many, from 0; a scripted policy, and a search of drawn scenes, runs once.
    steps
        Dominoes that a training may place at most; None: its preset's.
    seconds
        Processor time of a search at most [s]; None: until it ends by itself.
    home
        Where trainings have a folder each.

    Raises
    ------
    ValueError
        For what is given twice or not at all, and what is unknown.
    """
    for name, values in (("scenes", scenes), ("algorithms", algorithms)):
        if not values:
            raise ValueError(f"{name} is empty: give at least one")
        if len(set(values)) < len(values):
            raise ValueError(f"{name} = {', '.join(map(str, values))}: give each once")
    for name, number in (("seeds", seeds), ("steps", steps), ("seconds", seconds)):
        if number is not None and not number > 0:
            raise ValueError(f"{name} = {number}: give more than 0")
    for name in algorithms:
        if name not in (*ALGORITHMS, *SCRIPTED):
            registry.load(name)
    loaded = [scene if isinstance(scene, PROBLEMS) else load_any(scene) for scene in scenes]
    return [
        BenchmarkTask(text, name, seed, None, seconds, labels, steps, str(home))
        for seed in range(seeds)
        for text, labels, many in map(_told, loaded)
        for name in algorithms
        # many scenes are many searches already
        if seed == 0 or name in ALGORITHMS or not (many or name in SCRIPTED)
    ]


def _told(problem: Scene | SceneDistribution) -> tuple[str, tuple[tuple[str, str], ...], bool]:
    """Its text, what its tasks are called, and whether scenes are drawn."""
    if isinstance(problem, Scene):
        return Task.of(problem, "auto", 0).scene, (), False
    return problem.to_toml(), (("scenes", problem.name),), True


def run_benchmark(
    tasks: Sequence[BenchmarkTask],
    executor: Executor | None = None,
    study: Keeper | None = None,
    *,
    progress: bool | None = False,
) -> Benchmark:
    """Run what a study has not yet: five seeds of all, then the others of what takes two minutes.

    Ctrl-C ends it with the runs that are complete; before the first of them it is raised.

    Parameters
    ----------
    tasks
        Of `benchmark_tasks`.
    executor
        Runs them, each run a task; None: this process, one after the other. Times are processor
        time, but equal ones are equal work only with one thread a run: give workers.
    study
        Keeps the runs as they come; those that it has are not run again.
    progress
        Whether to show lines with how far they are; None: on a terminal.

    Raises
    ------
    ValueError
        Where no run has a result; a run that fails beside others is one of the `failures`.
    """
    found: dict[str, TaskResult] = {}
    failures: list[Failure] = []
    interrupted = False

    def keep(task: Task, result: TaskResult) -> None:
        found[task.key] = result

    def begin(those: list[BenchmarkTask], name: str) -> None:
        lines = TaskLines(len(those), name, shown=progress, plain=progress is None)
        failures.extend(run_tasks(those, executor, study, keep, lines))

    try:
        begin([task for task in tasks if task.seed < FEW], f"the first {FEW} seeds")
        more = [task for task in tasks if task.seed >= FEW]
        if more:
            begin([task for task in more if _is_short(task, found)], "further seeds")
    except KeyboardInterrupt:
        if not found:
            raise
        interrupted = True
    if not found:
        raise ValueError(f"no run has a result: {failures[0].task.name}: {failures[0].reason}")
    return collected(tasks, found, failures, interrupted=interrupted)


def collected(
    tasks: Sequence[BenchmarkTask],
    found: dict[str, TaskResult],
    failures: Sequence[Failure] = (),
    *,
    interrupted: bool = False,
) -> Benchmark:
    """Gather what there is of the tasks, by key."""
    results = tuple(found[task.key] for task in tasks if task.key in found)
    return Benchmark(results, best_scores(results), tuple(failures), interrupted)


def _is_short(task: BenchmarkTask, found: dict[str, TaskResult]) -> bool:
    """Whether the same with other seeds took no longer than `SHORT`."""
    took = [
        r.seconds for r in found.values() if (r.scene, r.method) == (task.scene, task.method)
    ]  # fmt: skip
    return bool(took) and float(np.median(took)) <= SHORT
