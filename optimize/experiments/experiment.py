"""Experiment: results of many tasks, compared with each other and with the best known scores."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Any

import numpy as np
from msgspec.structs import replace as replace_fields

from domino_env.core.checks import require_choice
from domino_env.core.results import dataclass_repr
from domino_env.core.types import Floats
from optimize.experiments.estimates import Estimate, interquartile_mean, normalise
from optimize.experiments.task import Task, TaskResult

SMALLEST_SHORTFALL = 1e-7  # relative; a smaller one is within the tolerance of the searches
CURVE_POINTS, SHORTFALL_POINTS = 120, 200  # times of a curve: enough for smooth lines in a panel
EARLIEST = {"evaluations": 1.0, "seconds": 1e-4}  # least time of the curves of shortfalls
KnownScore = Callable[[TaskResult], float]
"""Function that returns the best score known beforehand of a result's problem; -inf for none."""


@dataclass(frozen=True)
class Failure:
    """A task that has no result, and the reason in a sentence."""

    task: Task
    reason: str


@dataclass(frozen=True, eq=False)
class Experiment:
    """Results of problems × methods × settings × seeds.

    A problem is a scene, or a point of a sweep: a scene with labels. A normalised score is
    (score - zero) / (best - zero): 0 for the uniform baseline, or another reference, and 1 for the
    best known layout.

    Attributes
    ----------
    tasks
        Tasks that were requested.
    results
        Results that are available, in the order of the tasks.
    best
        Best known score of each problem, by which scores are normalised and compared.
    failures
        Tasks that failed.
    interrupted
        True if Ctrl-C ended the experiment.
    zero
        Score of each problem that is 0 if normalised, where it is not that of the uniform baseline.
    """

    tasks: tuple[Task, ...]
    results: tuple[TaskResult, ...]
    best: dict[str, float]
    failures: tuple[Failure, ...] = ()
    interrupted: bool = False
    zero: dict[str, float] = field(default_factory=dict)

    __repr__ = dataclass_repr

    @property
    def problems(self) -> list[str]:
        """Names of the problems that have results, in the order of the tasks."""
        return list(dict.fromkeys(r.problem for r in self.results))

    @property
    def methods(self) -> list[str]:
        """Names of the methods that have results, in the order of the tasks."""
        return list(dict.fromkeys(r.method for r in self.results))

    @property
    def complete_methods(self) -> list[str]:
        """Names of the methods with runs on all problems; all methods if there is none."""
        problems = set(self.problems)
        complete = [m for m in self.methods if {r.problem for r in self.runs(m)} == problems]
        return complete or self.methods

    @property
    def keys(self) -> list[str]:
        """Names of the settings that a sweep varies; empty for other experiments."""
        return list(self.results[0].labels)

    @property
    def clock(self) -> str:
        """Clock by which runs are limited; with "evaluations" they are reproducible."""
        return "seconds" if self.tasks[0].budget is None else "evaluations"

    def describe_seeds(self, statistic: str) -> str:
        """Return the number of seeds in words, after a statistic such as "medians over"."""
        number = len({r.seed for r in self.results})
        return "one seed" if number == 1 else f"{statistic} {number} seeds"

    def runs(self, method: str, problem: str | None = None) -> list[TaskResult]:
        """Return the results of a method, on one problem or on all.

        Raises
        ------
        ValueError
            If no task and no result has the method.
        """
        known = dict.fromkeys([*(task.method for task in self.tasks), *self.methods])
        require_choice("method", method, known)
        return [r for r in self.results if r.method == method and problem in (None, r.problem)]

    def best_steps(self, result: TaskResult, clock: str | None = None) -> tuple[Floats, Floats]:
        """Return times (K,) and best scores (K,) of a run, at every improvement and at the end.

        Parameters
        ----------
        result
            Result of the run.
        clock
            Clock of the trace (see `TaskResult`) for the times; None for that of the limit.
        """
        trace = result.trace
        return np.array(trace[clock or self.clock]), np.array(trace["score"])

    def best_scores(self, result: TaskResult, times: Floats, clock: str | None = None) -> Floats:
        """Return the best scores (T,) of a run at each time; -inf before its first layout.

        Parameters
        ----------
        result
            Result of the run.
        times
            (T,) times on the clock.
        clock
            Clock of the trace; None for that of the limit.
        """
        step_times, scores = self.best_steps(result, clock)
        last = np.searchsorted(step_times, times, side="right") - 1
        return np.where(last >= 0, scores[np.maximum(last, 0)], -np.inf)

    # shortfalls from the best known -------------------------------------------------------------

    def shortfall(self, result: TaskResult) -> float | None:
        """Return the shortfall of a result, relative to the best known score; None if that is 0."""
        best = self.best[result.problem]
        return None if best == 0.0 else (best - result.score) / abs(best)

    def shortfalls(self, result: TaskResult, times: Floats) -> Floats:
        """Return the relative shortfalls (T,) of a run; inf before its first layout."""
        best = self.best[result.problem]
        return np.maximum((best - self.best_scores(result, times)) / abs(best), SMALLEST_SHORTFALL)

    def time_to(self, result: TaskResult, shortfall: float) -> float:
        """Return the first time on the clock with at most a relative shortfall; inf if never."""
        best = self.best[result.problem]
        times, scores = self.best_steps(result)
        reached = scores >= best - shortfall * abs(best)
        return float(times[reached.argmax()]) if reached.any() else np.inf

    def curve_times(self) -> Floats:
        """Return times (T,) up to the limit of a run, evenly spaced in the logarithm."""
        first = max(EARLIEST[self.clock], min(self.best_steps(r)[0][0] for r in self.results))
        limit = self.tasks[0].budget or self.tasks[0].seconds or 0.0
        return np.geomspace(first, max(limit, 2.0 * first), SHORTFALL_POINTS)

    # normalised scores --------------------------------------------------------------------------

    def normalise(self, result: TaskResult, scores: Floats | float) -> Floats:
        """Return normalised scores on a result's problem; 0 if the uniform one is best known.

        Parameters
        ----------
        result
            Result of a run on the problem.
        scores
            Scores of any shape.
        """
        zero = self.zero.get(result.problem, result.uniform_score)
        return normalise(scores, zero, self.best[result.problem])

    def final_scores(self, method: str, problem: str | None = None) -> list[Floats]:
        """Return the normalised scores (R,) of the final layouts on each problem, or on one."""
        return _by_problem(self.runs(method, problem), lambda r: self.normalise(r, r.score))

    def mean_score(self, method: str, problem: str | None = None) -> Estimate:
        """Estimate the interquartile mean of the normalised scores, on all problems or on one."""
        return interquartile_mean(self.final_scores(method, problem))

    def until(self, clock: str, limit: float, last: float = 0.0) -> Experiment:
        """Return the experiment with its runs cut at a time on a clock of their traces.

        Runs that have no score until then are left out, and those that end until `last` are whole.
        Of a run that is cut, the scores, the trace and its counts are those until then; its layout
        and what follows from it are left out.
        """
        results = []
        for run in self.results:
            times = run.trace[clock]
            end = int(np.searchsorted(times, limit, side="right"))
            if times[-1] <= max(limit, last):
                results.append(run)
            elif end:
                trace = {name: values[:end] for name, values in run.trace.items()}
                results.append(replace_fields(
                    run, trace=trace, score=trace["score"][-1], seconds=trace["seconds"][-1],
                    work={name: int(trace[name][-1]) for name in run.work if name in trace},
                    gain=None, mean_speed=0.0, spacing=(), thickness=(), height=(),
                ))  # fmt: skip
        return replace(self, results=tuple(results))

    def curve(
        self, method: str, clock: str, problem: str | None = None, earliest: float = 1e-9
    ) -> tuple[Floats, Estimate]:
        """Estimate the interquartile mean of the normalised best scores over a clock.

        Parameters
        ----------
        method
            Name of the method.
        clock
            Clock of the trace, which all runs have.
        problem
            Name of a problem; None for all.
        earliest
            Least time of the curve, on the clock.

        Returns
        -------
        times : ndarray
            (T,) from the time when all runs have scored a layout to the end of the last run, evenly
            spaced in the logarithm.
        mean : Estimate
            (T,) interquartile means.
        """
        runs = self.runs(method, problem)
        spans = [self.best_steps(r, clock)[0][[0, -1]] for r in runs]
        first, last = np.maximum(np.max(spans, axis=0), earliest)
        times = np.geomspace(first, last, CURVE_POINTS)
        scores = _by_problem(runs, lambda r: self.normalise(r, self.best_scores(r, times, clock)))
        return times, interquartile_mean([group.T for group in scores])

    def rank(self, first: Collection[str], problem: str | None = None) -> list[str]:
        """Return the methods in the order of their mean scores, the best first.

        Parameters
        ----------
        first
            Methods that come before all others.
        problem
            Name of a problem; None for all.
        """
        methods = [m for m in self.methods if self.runs(m, problem)]
        return sorted(
            methods, key=lambda m: (m not in first, -float(self.mean_score(m, problem).value))
        )


def best_of_problems(
    results: Iterable[TaskResult],
    known_score: KnownScore = lambda _: -np.inf,
    *,
    fixed: bool = False,
) -> dict[str, float]:
    """Return the best known score of each problem, by its name.

    Parameters
    ----------
    results
        Results of all runs.
    known_score
        See `KnownScore`.
    fixed
        True to keep the score known beforehand, if there is one, even if a result is better.
    """
    best: dict[str, float] = {}
    for problem, runs in group_runs(results, "problem").items():
        reference = known_score(runs[0])
        is_kept = fixed and reference > -np.inf
        best[problem] = reference if is_kept else max(reference, *(run.score for run in runs))
    return best


def _by_problem(runs: Iterable[TaskResult], value: Callable[[TaskResult], Floats]) -> list[Floats]:
    """Return the values of the runs on each problem, as an array."""
    groups = group_runs(runs, "problem").values()
    return [np.array([value(run) for run in group]) for group in groups]


def group_runs(runs: Iterable[TaskResult], *names: str) -> dict[Any, list[TaskResult]]:
    """Group runs by the value of an attribute, or by the tuple of the values of several."""
    groups: dict[Any, list[TaskResult]] = {}
    for run in runs:
        groups.setdefault(attrgetter(*names)(run), []).append(run)
    return groups
