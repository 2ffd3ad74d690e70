"""All runs of a benchmark, and what share of what there is to gain each has found, and when."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agents.algorithms import ALGORITHMS
from agents.benchmark.many import known_gain, problem_of
from agents.benchmark.statistics import (
    Estimate,
    interquartile_mean,
    middle_mean,
    performance_profile,
)
from domino_env import SceneDistribution
from optimize.records.shipped import best_known
from optimize.studies.running import Failure
from optimize.studies.task import TaskResult, scene_of

Floats = NDArray[np.float64]

SECONDS, STEPS = "processor seconds", "environment steps"  # the two clocks
POINTS = 120  # of a curve
TARGETS = np.linspace(-0.25, 1.0, 251)  # of the profile


@dataclass(frozen=True, eq=False)
class Benchmark:
    """Every result of every algorithm on every scene.

    Attributes
    ----------
    results
        All runs, the scenes and algorithms in the order given.
    best
        By scene, the best score known, these results among them.
    failures
        Runs that have no result.
    interrupted
        Whether it was ended by hand.
    """

    results: tuple[TaskResult, ...]
    best: dict[str, float]
    failures: tuple[Failure, ...] = ()
    interrupted: bool = False

    @property
    def scenes(self) -> list[str]:
        """Names of the scenes."""
        return list(dict.fromkeys(r.scene_name for r in self.results))

    @property
    def algorithms(self) -> list[str]:
        """Names of the algorithms, scripted policies and searches."""
        return list(dict.fromkeys(r.method for r in self.results))

    def of(self, algorithm: str, scene: str | None = None) -> list[TaskResult]:
        """List the runs of an algorithm, on one scene or on all."""
        return [
            r for r in self.results
            if r.method == algorithm and scene in (None, r.scene_name)
        ]  # fmt: skip

    def share(self, result: TaskResult, scores: Floats) -> Floats:
        """Give where scores lie between the best uniform row, 0, and the best row known, 1."""
        to_gain = self.best[result.scene_name] - result.uniform_score
        return (scores - result.uniform_score) / to_gain if to_gain > 0.0 else 0.0 * scores

    def shares(self, algorithm: str, scene: str) -> Floats:
        """Give the (R,) shares that the runs of an algorithm on a scene end with."""
        return np.array(
            [float(self.share(r, np.array(r.score))) for r in self.of(algorithm, scene)]
        )

    def strata(self, algorithm: str, scene: str | None = None) -> list[Floats]:
        """List the shares by scene, of one or of all that the algorithm has run on."""
        those = self.scenes if scene is None else [scene]
        return [self.shares(algorithm, one) for one in those if self.of(algorithm, one)]

    def gain(self, algorithm: str, scene: str | None = None) -> Estimate:
        """Estimate the interquartile mean of the shares."""
        return interquartile_mean(self.strata(algorithm, scene))

    def profile(self, algorithm: str) -> Estimate:
        """Estimate the part of the runs that come beyond each of `TARGETS`."""
        return performance_profile(self.strata(algorithm), TARGETS)

    def steps(self, result: TaskResult, clock: str) -> tuple[Floats, Floats]:
        """Give times (K,), by one of the two clocks, and best shares (K,) by then."""
        trace = np.array(result.trace, dtype=np.float64)
        times = trace[:, 2]
        if clock == STEPS:
            problem = problem_of(result.scene)
            counted = result.method in ALGORITHMS or isinstance(problem, SceneDistribution)
            placed = 1 if counted else scene_of(result.scene).count - 1
            times = trace[:, 0] * placed
        return times, self.share(result, trace[:, 3])

    def shares_at(self, result: TaskResult, times: Floats, clock: str = SECONDS) -> Floats:
        """Give the best share (T,) at each of the times; -inf before the first row."""
        found, shares = self.steps(result, clock)
        at = np.searchsorted(found, times, side="right") - 1
        return np.where(at >= 0, shares[np.maximum(at, 0)], -np.inf)

    def curve(
        self, algorithm: str, clock: str, scene: str | None = None
    ) -> tuple[Floats, Estimate] | None:
        """Estimate the interquartile mean of the best shares over a clock.

        From when all runs have built a row, to when the last one ends.

        Returns
        -------
        tuple or None
            (T,) times and (T,) shares; None where the algorithm has no runs.
        """
        runs = self.of(algorithm, scene)
        if not runs:
            return None
        spans = [self.steps(r, clock)[0] for r in runs]
        first = max(float(span[0]) for span in spans)
        last = max(float(span[-1]) for span in spans)
        times = np.geomspace(max(first, 1e-9), max(last, first, 1e-9), POINTS)
        times[0] = first  # to the bit
        return times, interquartile_mean(self._at(runs, times, clock))

    def gain_after(self, algorithm: str, seconds: float, scene: str | None = None) -> float:
        """Give the interquartile mean after a processor time [s]; -inf before there is one."""
        runs = self.of(algorithm, scene)
        shares = self._at(runs, np.array([seconds]), SECONDS)
        return float(middle_mean(np.concatenate(shares, axis=-1))[0])

    def _at(self, runs: Sequence[TaskResult], times: Floats, clock: str) -> list[Floats]:
        """(T, R) shares of the runs on each scene."""
        by_scene: dict[str, list[Floats]] = {}
        for r in runs:
            by_scene.setdefault(r.scene_name, []).append(self.shares_at(r, times, clock))
        return [np.array(shares).T for shares in by_scene.values()]

    def seconds_past_uniform(self, result: TaskResult) -> float:
        """Find when a run had passed the best uniform row [s]; inf where it never did."""
        times, shares = self.steps(result, SECONDS)
        past = np.flatnonzero(shares > 0.0)
        return float(times[past[0]]) if len(past) else np.inf


def best_scores(results: Sequence[TaskResult]) -> dict[str, float]:
    """Find the best score known of each scene: of a record that ships, or of these results."""
    records = best_known()
    best: dict[str, float] = {}
    for result in results:
        name = result.scene_name
        if name not in best:
            problem, known = problem_of(result.scene), records.get(name)
            # a scene of the same name may be another one: the record must be within its rules
            best[name] = -np.inf
            if isinstance(problem, SceneDistribution):
                best[name] = known_gain(problem)
            elif known and not problem.violations(known.layout):
                best[name] = problem.score(known.layout)
        best[name] = max(best[name], result.score)
    return best
