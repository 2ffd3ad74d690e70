"""Methods against the best uniform pitch and against each other, over seeds, with equal clocks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from domino_env.scene import Scene, load_scene
from optimize.best_known import best_known
from optimize.result import SearchResult
from optimize.searching import search

Floats = NDArray[np.float64]

TARGETS = 10.0 ** np.linspace(-1.0, -5.0, 41)  # relative gaps, as COCO spreads its targets
SMALLEST_GAP = 1e-7  # below it the search's own tolerance decides


@dataclass(frozen=True, eq=False)
class Comparison:
    """Every result of every method on every scene.

    results: all runs.  seconds: that each was given.
    best: by scene, the best score known, these results among them.
    """

    results: tuple[SearchResult, ...]
    seconds: float
    best: dict[str, float]

    @property
    def scenes(self) -> list[str]:
        """Names of the scenes, in the order given."""
        return list(dict.fromkeys(r.scene.name for r in self.results))

    @property
    def methods(self) -> list[str]:
        """Names of the methods, in the order given."""
        return list(dict.fromkeys(r.method for r in self.results))

    def of(self, scene: str, method: str) -> list[SearchResult]:
        """The runs of one method on one scene."""
        return [r for r in self.results if r.scene.name == scene and r.method == method]

    def gaps(self, result: SearchResult, times: Floats) -> Floats:
        """(T,) relative gap of a run to the best known at each time; inf before its first row."""
        found = np.array([t for _, _, t, _ in result.trace])
        scores = np.array([s for _, _, _, s in result.trace])
        best = self.best[result.scene.name]
        gap = np.maximum((best - scores) / abs(best), SMALLEST_GAP)
        at = np.searchsorted(found, times, side="right") - 1
        return np.where(at >= 0, gap[np.maximum(at, 0)], np.inf)

    def time_to(self, result: SearchResult, gap: float) -> float:
        """When a run came within a relative gap of the best known [s]; inf where it never did."""
        best = self.best[result.scene.name]
        near = best - gap * abs(best)
        return next((t for _, _, t, score in result.trace if score >= near), np.inf)

    def reached(self, method: str, times: Floats, scene: str | None = None) -> Floats:
        """(T,) part of all targets of all runs of a method that are reached by each time."""
        runs = [r for r in self.results if r.method == method]
        runs = [r for r in runs if scene is None or r.scene.name == scene]
        when = np.array([[self.time_to(r, target) for target in TARGETS] for r in runs]).ravel()
        return np.searchsorted(np.sort(when), times, side="right") / len(when)

    def times(self) -> Floats:
        """Times evenly spread over the logarithm of the clock."""
        first = min(r.trace[0][2] for r in self.results)
        return np.geomspace(max(first, 1e-4), self.seconds, 200)


def compare(
    scenes: Sequence[Scene | str],
    methods: Sequence[str],
    seeds: Iterable[int],
    seconds: float,
    told: Callable[[SearchResult], None] | None = None,
) -> Comparison:
    """Run every method on every scene with every seed, each `seconds` long.

    told: called with every result as it comes.  Ctrl-C ends the comparison with the runs that are
    complete; before the first of them it is raised.
    Raises ValueError for what is given twice or not at all, and whatever `search` raises.
    """
    seeds = list(seeds)
    for name, values in (("scenes", scenes), ("methods", methods), ("seeds", seeds)):
        if not values:
            raise ValueError(f"{name} is empty: give at least one")
        if len(set(values)) < len(values):
            raise ValueError(f"{name} = {', '.join(map(str, values))}: give each once")
    loaded = [scene if isinstance(scene, Scene) else load_scene(scene) for scene in scenes]
    results: list[SearchResult] = []
    # seeds outermost: what else the machine does then falls on all methods alike
    order = [(scene, seed, method) for scene in loaded for seed in seeds for method in methods]
    for scene, seed, method in order:
        try:
            result = search(scene, method, seed=seed, seconds=seconds, progress=False)
        except KeyboardInterrupt:
            break
        if result.interrupted:
            break
        results.append(result)
        if told is not None:
            told(result)
    if not results:
        raise KeyboardInterrupt
    return Comparison(tuple(results), seconds, _best_scores(results))


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
