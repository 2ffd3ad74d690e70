"""Methods against the best uniform pitch and against each other, over seeds, with equal budgets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from domino_env.core.results import brief
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from optimize.methods.registry import METHODS, importable_name
from optimize.records.shipped import best_known
from optimize.result import SearchResult
from optimize.searching import search
from optimize.studies.progress import TaskLines
from optimize.studies.running import Failure, Keeper, run_tasks
from optimize.studies.task import Task, TaskResult, scene_of, search_result

if TYPE_CHECKING:
    from optimize.methods.registry import Method

Floats = NDArray[np.float64]

TARGETS = 10.0 ** np.linspace(-1.0, -5.0, 41)  # relative gaps, as COCO spreads its targets
TRIAL = 150  # rows of a search from which is judged how long a longer one takes
SMALLEST_GAP = 1e-7  # below it the search's own tolerance decides


@dataclass(frozen=True, eq=False)
class Comparison:
    """Every result of every method on every scene.

    Times are seconds, or evaluations where these were given: then they can be repeated.

    Attributes
    ----------
    results
        All runs.
    seconds
        That each run was given; None where evaluations were.
    best
        By scene, the best score known, these results among them.
    evaluations
        That each run was given; None where seconds were.
    failures
        Runs that have no result.
    interrupted
        Whether it was ended by hand.
    """

    results: tuple[SearchResult, ...]
    seconds: float | None
    best: dict[str, float]
    evaluations: int | None = None
    failures: tuple[Failure, ...] = ()
    interrupted: bool = False

    __repr__ = brief

    @property
    def unit(self) -> str:
        """Unit of times: "s", or "rows"."""
        return "s" if self.evaluations is None else "rows"

    def steps(self, result: SearchResult) -> tuple[Floats, Floats]:
        """Give times and best scores of a run, at every improvement and at the end."""
        clock = 2 if self.evaluations is None else 0
        trace = np.array(result.trace, dtype=np.float64)
        return trace[:, clock], trace[:, 3]

    @property
    def scenes(self) -> list[str]:
        """Names of the scenes, in the order given."""
        return list(dict.fromkeys(r.scene.name for r in self.results))

    @property
    def methods(self) -> list[str]:
        """Names of the methods, in the order given."""
        return list(dict.fromkeys(r.method for r in self.results))

    def of(self, scene: str, method: str) -> list[SearchResult]:
        """List the runs of one method on one scene."""
        return [r for r in self.results if r.scene.name == scene and r.method == method]

    def gaps(self, result: SearchResult, times: Floats) -> Floats:
        """Compute the relative gap of a run to the best known.

        Parameters
        ----------
        result
            The run.
        times
            (T,) times.

        Returns
        -------
        ndarray
            (T,) gaps; inf before the run's first row.
        """
        found, scores = self.steps(result)
        best = self.best[result.scene.name]
        gap = np.maximum((best - scores) / abs(best), SMALLEST_GAP)
        at = np.searchsorted(found, times, side="right") - 1
        return np.where(at >= 0, gap[np.maximum(at, 0)], np.inf)

    def time_to(self, result: SearchResult, gap: float) -> float:
        """Find when a run came within a relative gap of the best known; inf where it never did."""
        best = self.best[result.scene.name]
        near = best - gap * abs(best)
        steps = zip(*self.steps(result), strict=True)
        return next((float(t) for t, score in steps if score >= near), np.inf)

    def reached(self, method: str, times: Floats, scene: str | None = None) -> Floats:
        """Compute the part of all targets of all runs of a method that are reached by each time.

        Parameters
        ----------
        method
            Its name.
        times
            (T,) times.
        scene
            Of one scene; None for all.

        Returns
        -------
        ndarray
            (T,) parts, 0 to 1: an empirical cumulative distribution of run times.

        References
        ----------
        Hansen, N., Auger, A., Ros, R., Mersmann, O., Tušar, T., Brockhoff, D. (2021). COCO: a
        platform for comparing continuous optimizers in a black-box setting. Optimization Methods
        and Software 36, 114-144.
        """
        runs = [r for r in self.results if r.method == method]
        runs = [r for r in runs if scene is None or r.scene.name == scene]
        when = np.array([[self.time_to(r, target) for target in TARGETS] for r in runs]).ravel()
        return np.searchsorted(np.sort(when), times, side="right") / len(when)

    def times(self) -> Floats:
        """Spread times evenly over the logarithm of the clock."""
        first = min(float(self.steps(r)[0][0]) for r in self.results)
        if self.evaluations is not None:
            return np.geomspace(max(first, 1.0), max(self.evaluations, first + 1.0), 200)
        assert self.seconds is not None
        return np.geomspace(max(first, 1e-4), self.seconds, 200)


def compare(
    scenes: Sequence[Scene | str],
    methods: Sequence[str | Method],
    seeds: Iterable[int],
    seconds: float | None = None,
    told: Callable[[SearchResult], None] | None = None,
    *,
    evaluations: int | None = None,
    executor: Executor | None = None,
    study: Keeper | None = None,
    progress: bool | None = False,
) -> Comparison:
    """Run every method on every scene with every seed, each with the same budget.

    Ctrl-C ends the comparison with the runs that are complete; before the first of them it is
    raised.

    Parameters
    ----------
    scenes
        Scenes, or their names.
    methods
        Names of methods, those of your own as "package.module:function" among them, or functions
        `run(budget, rng)` that other processes can import.
    seeds
        A run of every method on every scene has each of them.
    seconds
        Budget of each run, unless `evaluations` is given. Equal seconds are equal chances only
        where every run has a core for itself: an executor must have no more workers than its
        machines have cores.
    told
        Called with every result as it comes.
    evaluations
        Budget of each run, which makes the comparison repeatable to the bit.
    executor
        Runs them, each run a task; None: this process, one after the other.
    study
        Keeps the runs as they come; those that it has are not run again.
    progress
        Whether to show lines with how far they are; None: on a terminal.

    Raises
    ------
    ValueError
        For what is given twice or not at all, and where no run has a result; a run that fails
        beside others that do not is one of the `failures`.
    """
    tasks = comparison_tasks(scenes, methods, seeds, seconds, evaluations)
    found: dict[str, SearchResult] = {}

    def keep(task: Task, kept: TaskResult) -> None:
        result = search_result(scene_of(task.scene), kept)
        found[task.key] = result
        if told is not None:
            told(result)

    failures: list[Failure] = []
    interrupted = False
    lines = TaskLines(len(tasks), "compare", shown=progress)
    try:
        failures = run_tasks(tasks, executor, study, keep, lines)
    except KeyboardInterrupt:
        if not found:
            raise
        interrupted = True
    if not found:
        raise ValueError(f"no run has a result: {failures[0].task.name}: {failures[0].reason}")
    results = [found[task.key] for task in tasks if task.key in found]
    best = _best_scores(results)
    return Comparison(tuple(results), seconds, best, evaluations, tuple(failures), interrupted)


def seconds_expected(tasks: Iterable[Task]) -> float:
    """Say how long runs take, one after the other, by a short search of each kind [s].

    Methods of other packages count for nothing: what a learner takes, its first rows do not tell.
    """
    pace: dict[tuple[str, str], float] = {}
    total = 0.0
    for task in tasks:
        kind = task.scene, task.method
        if kind not in pace:
            pace[kind] = 0.0
            if task.method in METHODS:
                tried = search(scene_of(task.scene), task.method, TRIAL, progress=False)
                pace[kind] = tried.seconds / tried.evaluations
        total += pace[kind] * (task.evaluations or 0)
    return total


def comparison_tasks(
    scenes: Sequence[Scene | str],
    methods: Sequence[str | Method],
    seeds: Iterable[int],
    seconds: float | None,
    evaluations: int | None,
) -> list[Task]:
    """List the runs of a comparison, in order; see `compare`."""
    if (seconds is None) == (evaluations is None):
        raise ValueError("give each run seconds or evaluations, one of the two")
    seeds, chosen = list(seeds), [importable_name(method) for method in methods]
    for name, values in (("scenes", scenes), ("methods", chosen), ("seeds", seeds)):
        if not values:
            raise ValueError(f"{name} is empty: give at least one")
        if len(set(values)) < len(values):
            raise ValueError(f"{name} = {', '.join(map(str, values))}: give each once")
    loaded = [scene if isinstance(scene, Scene) else load_scene(scene) for scene in scenes]
    # seeds outermost: what else the machine does then falls on all methods alike
    return [
        Task.of(scene, method, seed, evaluations, seconds)
        for scene in loaded
        for seed in seeds
        for method in chosen
    ]


def _best_scores(results: list[SearchResult]) -> dict[str, float]:
    records = best_known()
    best: dict[str, float] = {}
    for result in results:
        name = result.scene.name
        if name not in best:
            known = records.get(name)
            # a scene of the same name may be another one: the record must be within its rules
            fits = known is not None and not result.scene.violations(known.layout)
            best[name] = result.scene.score(known.layout) if fits and known else -np.inf
        best[name] = max(best[name], result.score)
    return best
