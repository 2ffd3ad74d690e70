"""Experiment: the results of many tasks as one table, beside the best scores known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import msgspec
import numpy as np

from domino_env.core.results import brief
from domino_env.core.types import Floats
from optimize.experiments.runner import Callback, Failure, Progress, run_tasks
from optimize.experiments.store import Study
from optimize.experiments.task import Label, Task, TaskResult

TARGETS = 10.0 ** np.linspace(-1.0, -5.0, 41)  # relative gaps, as COCO spreads its targets
SMALLEST_GAP = 1e-7  # below it the search's own tolerance decides


@dataclass(frozen=True, eq=False)
class Experiment:
    """Results of problems × methods × settings × seeds.

    A problem is a scene, or the point of a sweep: a scene with its labels.

    Attributes
    ----------
    tasks
        All that were asked for.
    results
        Those that there are, in the order of the tasks.
    best
        Best score known by problem, these results among them.
    failures
        Tasks that have no result.
    interrupted
        Whether it was interrupted.
    """

    tasks: tuple[Task, ...]
    results: tuple[TaskResult, ...]
    best: dict[str, float]
    failures: tuple[Failure, ...] = ()
    interrupted: bool = False

    __repr__ = brief

    @property
    def problems(self) -> list[str]:
        """Names of the problems, in the order given."""
        return list(dict.fromkeys(problem_of(r) for r in self.results))

    @property
    def methods(self) -> list[str]:
        """Names of the methods, in the order given."""
        return list(dict.fromkeys(r.method for r in self.results))

    @property
    def keys(self) -> list[str]:
        """Names of the labels: what a sweep varies."""
        return list(self.results[0].labels)

    @property
    def points(self) -> list[tuple[Label, ...]]:
        """Values of the labels, each combination once."""
        return list(dict.fromkeys(tuple(r.labels.values()) for r in self.results))

    @property
    def clock(self) -> str:
        """Measure of the budget: "seconds", or "evaluations", with which results are repeatable."""
        return "seconds" if self.tasks[0].budget is None else "evaluations"

    @property
    def budget(self) -> str:
        """Budget of a run in words."""
        task = self.tasks[0]
        return f"{task.seconds:g} s" if task.budget is None else f"{task.budget} layouts"

    @property
    def seeds(self) -> int:
        """Number of seeds."""
        return len({r.seed for r in self.results})

    def over_seeds(self, what: str) -> str:
        """Return the number of seeds in words, after what is taken over them."""
        return "one seed" if self.seeds == 1 else f"{what} {self.seeds} seeds"

    def of(self, method: str, problem: str | None = None) -> list[TaskResult]:
        """Return the runs of a method, on one problem or on all."""
        return [r for r in self.results if r.method == method and problem in (None, problem_of(r))]

    def best_of(self, result: TaskResult) -> float:
        """Return the best score known of the problem of a result."""
        return self.best[problem_of(result)]

    def gap(self, result: TaskResult) -> float | None:
        """Return the relative gap of a result to the best known; None where that is zero."""
        best = self.best_of(result)
        return None if best == 0.0 else (best - result.score) / abs(best)

    def steps(self, result: TaskResult) -> tuple[Floats, Floats]:
        """Return times and best scores of a run, at every improvement and at the end."""
        trace = np.array(result.trace, dtype=np.float64)
        return trace[:, 2 if self.clock == "seconds" else 0], trace[:, 3]

    def gaps(self, result: TaskResult, times: Floats) -> Floats:
        """Return the relative gaps (T,) of a run to the best known; inf before its first layout."""
        found, scores = self.steps(result)
        best = self.best_of(result)
        gaps = np.maximum((best - scores) / abs(best), SMALLEST_GAP)
        at = np.searchsorted(found, times, side="right") - 1
        return np.where(at >= 0, gaps[np.maximum(at, 0)], np.inf)

    def time_to(self, result: TaskResult, gap: float) -> float:
        """Find when a run came within a relative gap of the best known; inf where it never did."""
        best = self.best_of(result)
        near = best - gap * abs(best)
        steps = zip(*self.steps(result), strict=True)
        return next((float(t) for t, score in steps if score >= near), np.inf)

    def reached(self, method: str, times: Floats, problem: str | None = None) -> Floats:
        """Return the part (T,) of all targets of all runs of a method that is reached by each time.

        It is an empirical cumulative distribution of run times, 0 to 1.

        References
        ----------
        Hansen, N., Auger, A., Ros, R., Mersmann, O., Tušar, T., Brockhoff, D. (2021). COCO: a
        platform for comparing continuous optimizers in a black-box setting. Optimization Methods
        and Software 36, 114-144.
        """
        runs = self.of(method, problem)
        when = np.array([[self.time_to(r, target) for target in TARGETS] for r in runs]).ravel()
        return np.searchsorted(np.sort(when), times, side="right") / len(when)

    def times(self) -> Floats:
        """Spread times evenly over the logarithm of the clock."""
        first = min(float(self.steps(r)[0][0]) for r in self.results)
        task = self.tasks[0]
        if task.seconds is not None:
            return np.geomspace(max(first, 1e-4), task.seconds, 200)
        return np.geomspace(max(first, 1.0), max(task.budget or 0, first + 1.0), 200)


def problem_of(result: TaskResult) -> str:
    """Return the name of the problem of a result: its labels, or its scene."""
    return in_words(result.labels) or result.scene_name


def in_words(point: dict[str, Label]) -> str:
    """Return the coordinates of a point in words."""
    return ", ".join(f"{key} = {value}" for key, value in point.items())


def unknown(_: TaskResult) -> float:
    """Return the score known of a problem beforehand: none."""
    return -np.inf


def run_experiment(
    tasks: Sequence[Task],
    executor: Executor | None = None,
    study: Study | None = None,
    callback: Callback | None = None,
    progress: Progress | None = None,
    known: Callable[[TaskResult], float] = unknown,
) -> Experiment:
    """Run tasks and gather their results.

    Ctrl-C ends it with the results that there are; before the first of them it is raised.

    Parameters
    ----------
    tasks, executor, study, callback, progress
        As of `run_tasks`.
    known
        Returns the best score known beforehand of the problem of a result.

    Raises
    ------
    ValueError
        Where no task has a result; a task that fails beside others is one of the `failures`.
    """
    found: dict[str, TaskResult] = {}

    def keep(task: Task, result: TaskResult) -> None:
        found[task.key] = result
        if callback is not None:
            callback(task, result)

    once = {task.key: task for task in tasks}  # two points may be the same scene
    failures: list[Failure] = []
    interrupted = False
    try:
        failures = run_tasks(list(once.values()), executor, study, keep, progress)
    except KeyboardInterrupt:
        if not found:
            raise
        interrupted = True
    return gathered(tasks, found, failures, known, interrupted=interrupted)


def gathered(
    tasks: Sequence[Task],
    found: dict[str, TaskResult],
    failures: Sequence[Failure] = (),
    known: Callable[[TaskResult], float] = unknown,
    *,
    interrupted: bool = False,
) -> Experiment:
    """Gather the results of tasks, by key; see `run_experiment`."""
    results = tuple(
        msgspec.structs.replace(found[task.key], labels=task.labels)
        for task in tasks
        if task.key in found
    )
    if not results:
        reason = f": {failures[0].task.name}: {failures[0].reason}" if failures else " yet"
        raise ValueError(f"no run has a result{reason}")
    best: dict[str, float] = {}
    for result in results:
        problem = problem_of(result)
        if problem not in best:
            best[problem] = known(result)
        best[problem] = max(best[problem], result.score)
    return Experiment(tuple(tasks), results, best, tuple(failures), interrupted)
