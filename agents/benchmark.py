"""Benchmark: learning algorithms, scripted policies and searches, over scenes and seeds.

All times are processor time [s], all steps dominoes placed.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache
from importlib import import_module
from pathlib import Path

import msgspec
import numpy as np

from agents.algorithms import ALGORITHMS, Hyperparameters, default_hyperparameters
from agents.evaluation import STOPPED, evaluate, gains_of, searched_scores
from agents.policy import CONFIG, PROGRESS, SUMMARY, ScenePolicy, summary_of
from agents.scripted import SCRIPTED
from agents.training import episode_of, train
from domino_env import Scene, SceneDistribution
from domino_env.core.checks import require
from domino_env.scenes.distribution import load_any
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.io.reading import document_of_text
from domino_env.scenes.pool import load_test_set
from optimize.evaluator import Evaluator, Step
from optimize.experiments.compare import known_score, require_distinct
from optimize.experiments.task import Task, TaskResult, digest, scene_of
from optimize.methods import registry
from optimize.searching import compile_for, search

SCENES = ("sprint", "course", "sprint-thickness", "ideal", "varied")
BASELINES = ("ramp", "cma", "auto")  # need no learning
SEEDS = 10
TRAININGS = Path("runs/benchmark")  # has a folder for each training
SEARCH_PART = 0.04  # time of the search of a scene of a test set, over that of a single scene
POINTS = 60  # of the trace of many searches


@dataclass(frozen=True)
class BenchmarkTask(Task):
    """One run of a benchmark.

    `method` is an algorithm of `domino train`, a scripted policy, or a method of a search;
    `seconds` limit a search only. Evaluations of its result are dominoes placed. With a scene
    distribution, the score is the median gain in the test set, there is no layout, and the trace
    of a training is of scenes that are not in that set.

    Attributes
    ----------
    steps
        Largest number of dominoes that a training places; None for that of its hyperparameters.
    """

    steps: int | None = None

    @property
    def scene_name(self) -> str:
        """Name of the scene or scene distribution."""
        return problem_of_text(self.scene).name

    @property
    def hyperparameters(self) -> Hyperparameters:
        """Hyperparameters of a training, with its steps."""
        problem = problem_of_text(self.scene)
        sampled = isinstance(problem, SceneDistribution)
        chosen = default_hyperparameters(self.method, episode_of(problem), sampled=sampled)
        steps = chosen.steps if self.steps is None else min(chosen.steps, self.steps)
        return replace(chosen, steps=steps)

    @property
    def key(self) -> str:
        """Digest of all that decides the result; of a training, the hyperparameters too."""
        decisive: list[object] = ["benchmark", self.scene, self.method, self.seed]
        if self.method in ALGORITHMS:
            decisive += [asdict(self.hyperparameters)]
        elif self.method not in SCRIPTED:
            decisive += [self.seconds]
        return digest(decisive)

    @property
    def folder(self) -> Path:
        """Folder of a training; other hyperparameters have another folder."""
        return TRAININGS / f"{self.scene_name}-{self.method}-{self.seed}-{self.key[:6]}"

    def run(
        self,
        callback: Callable[[Evaluator], None] | None = None,
        clock: Callable[[], float] = time.process_time,
    ) -> TaskResult:
        """Train and evaluate, build, or search; a training that was stopped is continued."""
        problem = problem_of_text(self.scene)
        sampled = isinstance(problem, SceneDistribution)
        scenes = load_test_set(problem.name) if sampled else [scene_of(self.scene)]
        compile_for(scenes[0], gradients=True, episodes=True)  # before any clock
        placed = sum(scene.count - 1 for scene in scenes)
        trained = self.method in ALGORITHMS
        if trained:
            self._train()
        elif self.method not in SCRIPTED and not sampled:
            result = super().run(callback, clock)
            trace = [(placed * n, falls, t, score) for n, falls, t, score in result.trace]
            return msgspec.structs.replace(result, trace=trace, evaluations=trace[-1][0])
        began = clock()
        uniform, wave = 0.0, None
        if isinstance(problem, Scene):
            rollout = evaluate(self.folder if trained else self.method, problem)
            score, uniform, gain = rollout.score, rollout.uniform.score, rollout.gain
            wave = rollout.wave
        else:
            if trained:
                gains = gains_of(ScenePolicy.load(self.folder).policy, problem, scenes)
            elif self.method in SCRIPTED:
                gains = np.array([_gain(SCRIPTED[self.method](scene).gain) for scene in scenes])
            else:
                return self._search_all(scenes)
            score = gain = float(np.median(gains))
        trace = [(placed, placed, clock() - began, score)]
        if trained:
            trace = learning_curve(self.folder)
        return self.result_of(trace, score, uniform, gain, wave)

    def _train(self) -> None:
        """Train, unless the folder has a finished training."""
        folder = self.folder
        if (folder / SUMMARY).exists() and summary_of(folder).finished:
            return
        import_module("torch._dynamo")  # as the first optimiser would do while the clock runs
        done = train(
            problem_of_text(self.scene), self.method, None, self.seed, folder,
            resume=(folder / CONFIG).exists(), hyperparameters=self.hyperparameters,
        )  # fmt: skip
        if done.interrupted:
            raise KeyboardInterrupt

    def _search_all(self, scenes: Sequence[Scene]) -> TaskResult:
        """Search in each scene of a test set.

        The trace is that of the median gain, as if all searches ran at the same time with equal
        shares of it.
        """
        each = None if self.seconds is None else SEARCH_PART * self.seconds
        results = [
            search(
                scene, self.method, seed=self.seed, seconds=each, clock=time.process_time,
                progress=False,
            )
            for scene in scenes
        ]  # fmt: skip
        traces = [np.array(result.trace) for result in results]
        ends = [trace[-1, 2] for trace in traces]
        first, last = max(trace[0, 2] for trace in traces), max(ends)
        uniform = np.array([result.uniform.score for result in results])
        pairs = np.array([scene.count - 1 for scene in scenes])
        steps: list[Step] = []
        for at in np.geomspace(max(first, 1e-6), max(last, 1e-6), POINTS):
            now = np.array([t[np.searchsorted(t[:, 2], at, "right") - 1] for t in traces])
            gains = np.maximum(now[:, 3] / uniform - 1.0, STOPPED)
            placed, falls = int(now[:, 0] @ pairs), int(now[:, 1].sum())
            steps.append(
                (placed, falls, float(np.minimum(at, ends).sum()), float(np.median(gains)))
            )
        score = float(np.median([_gain(result.gain) for result in results]))
        return self.result_of(steps, score, 0.0, score)


def benchmark_tasks(
    scenes: Sequence[Scene | SceneDistribution | str] = SCENES,
    algorithms: Sequence[str] = (*ALGORITHMS, *BASELINES),
    seeds: int = SEEDS,
    steps: int | None = None,
    seconds: float | None = None,
) -> list[BenchmarkTask]:
    """Return the runs of a benchmark, in order: all of one seed before the next seed.

    Parameters
    ----------
    scenes
        Scenes, scene distributions that have a test set, or their names.
    algorithms
        Learning algorithms, scripted policies, and methods of a search.
    seeds
        Number of seeds, from 0; a scripted policy, and a search of sampled scenes, runs once.
    steps
        Largest number of dominoes that a training places; None: that of its hyperparameters.
    seconds
        Processor time of a search [s]; None: until it ends by itself.

    Raises
    ------
    ValueError
        For a name that is unknown or given twice, for empty lists and numbers out of range.
    """
    require_distinct(scenes=scenes, algorithms=algorithms)
    for name, number in (("seeds", seeds), ("steps", steps), ("seconds", seconds)):
        if number is not None:
            require(name, number, above=0)
    for name in algorithms:
        if name not in (*ALGORITHMS, *SCRIPTED):
            registry.load(name)
    loaded = [load_any(scene) if isinstance(scene, str) else scene for scene in scenes]
    return [
        BenchmarkTask(problem.to_toml(), name, seed, None, seconds, {}, steps)
        for seed in range(seeds)
        for problem in loaded
        for name in algorithms
        # sampled scenes are many searches already
        if seed == 0
        or name in ALGORITHMS
        or not (isinstance(problem, SceneDistribution) or name in SCRIPTED)
    ]


def learning_curve(folder: Path) -> list[Step]:
    """Read the learning curve of a training, as the trace of a search.

    Returns
    -------
    list of tuple
        (dominoes placed, intervals simulated, seconds, best score), at every improvement and at the
        end.
    """
    with (folder / PROGRESS).open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    trace: list[Step] = []
    for line in lines:
        steps = int(float(line["steps"]))
        best, seconds = float(line["best_score"]), float(line["processor_seconds"])
        if not trace or best > trace[-1][3] or line is lines[-1]:
            trace.append((steps, steps, seconds, best))
    return trace


@lru_cache(8)
def problem_of_text(text: str) -> Scene | SceneDistribution:
    """Return the scene or scene distribution of a TOML text."""
    document = document_of_text(text, "scene")
    return SceneDistribution(document, "scene") if has_ranges(document) else scene_of(text)


def known_in(result: TaskResult) -> float:
    """Return the best known score, or median gain in a test set, of a result's problem."""
    problem = problem_of_text(result.scene)
    if isinstance(problem, Scene):
        return known_score(result)
    tests = load_test_set(problem.name)
    scores = searched_scores(problem.name, len(tests))
    if scores is None:
        return -np.inf
    some = np.flatnonzero(np.isfinite(scores))
    return float(np.median([scores[i] / tests[i].uniform().score - 1.0 for i in some]))


def _gain(gain: float | None) -> float:
    return STOPPED if gain is None else max(float(gain), STOPPED)
