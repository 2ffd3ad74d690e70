"""Benchmark: algorithms that learn, scripted policies and searches, over scenes and seeds.

All times are processor time [s], all steps dominoes placed.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
from importlib import import_module
from pathlib import Path

import msgspec
import numpy as np

from agents.algorithms import ALGORITHMS, Hyperparameters, hyperparameters
from agents.evaluation import STOPPED, evaluate, gains_of, searched_scores
from agents.policy import CONFIG, PROGRESS, SUMMARY, ScenePolicy, summary_of
from agents.scripted import SCRIPTED
from agents.training import episode_of, train
from domino_env import Scene, SceneDistribution
from domino_env.scenes.distribution import load_any
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.io.reading import document_of_text
from domino_env.scenes.pool import load_test_set
from optimize.evaluator import Evaluator, Step
from optimize.experiments.compare import known_score, require_distinct
from optimize.experiments.experiment import Experiment
from optimize.experiments.runner import run_experiment
from optimize.experiments.store import Study
from optimize.experiments.task import Task, TaskResult, digest, scene_of
from optimize.methods import registry
from optimize.searching import compile_for, search

SCENES = ("sprint", "course", "sprint-thickness", "ideal", "varied")
BASELINES = ("ramp", "cma", "auto")  # what needs no learning
SEEDS, FEW = 10, 5  # numbers of seeds; the few for what takes longer than
SHORT = 120.0  # [s] in the median
EACH = 0.04  # part of the time of a search for each scene of a test set
POINTS = 60  # of the trace of many searches


@dataclass(frozen=True)
class BenchmarkTask(Task):
    """One run of a benchmark.

    `method` is an algorithm of `domino train`, a scripted policy, or a method of a search;
    `seconds` limit a search alone. Evaluations of its result are dominoes placed. With a scene
    distribution, its score is the median gain in the test set, its layout is empty, and the trace
    of a training is of scenes that are not in that set.

    Attributes
    ----------
    steps
        Most dominoes that a training may place; None for those of its hyperparameters.
    home
        Folder in which trainings have a folder each.
    """

    steps: int | None = None
    home: str = "runs/benchmark"

    @property
    def scene_name(self) -> str:
        """Name of the scene or scene distribution."""
        return problem_of_text(self.scene).name

    @property
    def plan(self) -> Hyperparameters:
        """Hyperparameters of a training, with its steps."""
        problem = problem_of_text(self.scene)
        drawn = isinstance(problem, SceneDistribution)
        plan = hyperparameters(self.method, episode_of(problem), drawn=drawn)
        return plan if self.steps is None else replace(plan, steps=min(plan.steps, self.steps))

    @property
    def key(self) -> str:
        """Digest of all that decides the result; of a training, the hyperparameters too."""
        decisive: list[object] = ["benchmark", self.scene, self.method, self.seed]
        if self.method in ALGORITHMS:
            defaults = {field.name: field.default for field in fields(Hyperparameters)}
            plan = asdict(self.plan).items()
            decisive += [sorted((k, v) for k, v in plan if v != defaults[k])]
        elif self.method not in SCRIPTED:
            decisive += [self.seconds]
        return digest(decisive)

    @property
    def folder(self) -> Path:
        """Folder of a training; other hyperparameters have another folder."""
        return Path(self.home) / f"{self.scene_name}-{self.method}-{self.seed}-{self.key[:6]}"

    def run(
        self,
        callback: Callable[[Evaluator], None] | None = None,
        clock: Callable[[], float] = time.process_time,
    ) -> TaskResult:
        """Train and evaluate, build, or search; a training that was stopped is continued."""
        problem = problem_of_text(self.scene)
        if isinstance(problem, SceneDistribution):
            return self._run_sampled(problem, load_test_set(problem.name))
        compile_for(problem, gradients=True, episodes=True)  # before any clock
        n = problem.count - 1
        if self.method not in (*ALGORITHMS, *SCRIPTED):
            found = super().run(callback, clock)
            steps = [(n * rows, falls, t, score) for rows, falls, t, score in found.trace]
            return msgspec.structs.replace(found, trace=steps, evaluations=steps[-1][0])
        if self.method in ALGORITHMS:
            self._train()
        began = clock()
        built = evaluate(self.folder if self.method in ALGORITHMS else self.method, problem)
        trace = [(n, n, clock() - began, built.score)]
        if self.method in ALGORITHMS:
            trace = learning_curve(self.folder)
        return self.result_of(trace, built.score, built.uniform.score, built.gain, built.wave)

    def _run_sampled(self, distribution: SceneDistribution, scenes: Sequence[Scene]) -> TaskResult:
        """Run in sampled scenes, evaluated in those of the test set."""
        compile_for(scenes[0], gradients=True, episodes=True)
        if self.method in ALGORITHMS:
            self._train()
            trace = learning_curve(self.folder)
            policy = ScenePolicy.load(self.folder).policy
            gains = gains_of(policy, distribution, scenes).tolist()
        else:
            trace, gains = self._build_many(scenes)
        score = float(np.median(gains))
        return self.result_of(trace, score, 0.0, score)

    def _train(self) -> None:
        """Train what is not trained yet."""
        folder = self.folder
        summary = summary_of(folder) if (folder / SUMMARY).exists() else None
        if summary is None or not summary.finished:
            import_module("torch._dynamo")  # as the first optimiser would, on the clock
            done = train(
                problem_of_text(self.scene), self.method, None, self.seed, folder,
                resume=(folder / CONFIG).exists(), plan=self.plan,
            )  # fmt: skip
            if done.interrupted:
                raise KeyboardInterrupt

    def _build_many(self, scenes: Sequence[Scene]) -> tuple[list[Step], list[float]]:
        """Build or search in each scene of a test set.

        Returns
        -------
        trace : list of tuple
            (dominoes placed, intervals, seconds, median gain), as if all searches went on side by
            side: after any time each has had the same share of it.
        gains : list of float
            The gain in each scene in the end.
        """
        if self.method in SCRIPTED:
            began = time.process_time()
            gains = [_gain(SCRIPTED[self.method](scene).gain) for scene in scenes]
            n = sum(scene.count - 1 for scene in scenes)
            return [(n, n, time.process_time() - began, float(np.median(gains)))], gains
        each = None if self.seconds is None else EACH * self.seconds
        found = [
            search(
                scene, self.method, seed=self.seed, seconds=each, clock=time.process_time,
                progress=False,
            )
            for scene in scenes
        ]  # fmt: skip
        traces = [np.array(one.trace) for one in found]
        ends = [trace[-1, 2] for trace in traces]
        first, last = max(trace[0, 2] for trace in traces), max(ends)
        steps: list[Step] = []
        for at in np.geomspace(max(first, 1e-6), max(last, 1e-6), POINTS):
            now = [trace[np.searchsorted(trace[:, 2], at, "right") - 1] for trace in traces]
            gains = [_gain(s[3] / r.uniform.score - 1.0) for s, r in zip(now, found, strict=True)]
            placed = sum(s[0] * (scene.count - 1) for s, scene in zip(now, scenes, strict=True))
            falls, spent = sum(s[1] for s in now), float(np.minimum(at, ends).sum())
            steps.append((int(placed), int(falls), spent, float(np.median(gains))))
        return steps, [_gain(one.gain) for one in found]


def benchmark_tasks(
    scenes: Sequence[Scene | SceneDistribution | str] = SCENES,
    algorithms: Sequence[str] = (*ALGORITHMS, *BASELINES),
    seeds: int = SEEDS,
    steps: int | None = None,
    seconds: float | None = None,
    home: str | Path = "runs/benchmark",
) -> list[BenchmarkTask]:
    """Return the runs of a benchmark, in order: all of one seed before the next seed.

    Parameters
    ----------
    scenes
        Scenes, scene distributions that have a test set, or their names.
    algorithms
        Those that learn, scripted policies, and methods of a search.
    seeds
        Number of seeds, from 0; a scripted policy, and a search of sampled scenes, runs once.
    steps
        Most dominoes that a training may place; None: those of its hyperparameters.
    seconds
        Most processor time of a search [s]; None: until it ends by itself.
    home
        Folder of the trainings.

    Raises
    ------
    ValueError
        For what is given twice or not at all, and what is unknown.
    """
    require_distinct(scenes=scenes, algorithms=algorithms)
    for name, number in (("seeds", seeds), ("steps", steps), ("seconds", seconds)):
        if number is not None and not number > 0:
            raise ValueError(f"{name} = {number}: give more than 0")
    for name in algorithms:
        if name not in (*ALGORITHMS, *SCRIPTED):
            registry.load(name)
    loaded = [load_any(scene) if isinstance(scene, str) else scene for scene in scenes]
    return [
        BenchmarkTask(problem.to_toml(), name, seed, None, seconds, {}, steps, str(home))
        for seed in range(seeds)
        for problem in loaded
        for name in algorithms
        # sampled scenes are many searches already
        if seed == 0
        or name in ALGORITHMS
        or not (isinstance(problem, SceneDistribution) or name in SCRIPTED)
    ]


def run_benchmark(
    tasks: Sequence[BenchmarkTask],
    executor: Executor | None = None,
    study: Study | None = None,
    *,
    progress: bool | None = False,
) -> Experiment:
    """Run what a study lacks: five seeds of all, then the others of what takes two minutes.

    Ctrl-C ends it with the runs that are complete; before the first of them it is raised.

    Parameters
    ----------
    tasks
        Those of `benchmark_tasks`.
    executor
        Runs them; None: this process, one after the other. Equal processor times are equal work
        only with one thread a run: give workers.
    study
        Keeps the runs as they come; those that it has are not run again.
    progress
        Whether to show lines with how far they are; None: on a terminal.

    Raises
    ------
    ValueError
        Where no run has a result; a run that fails beside others is one of the `failures`.
    """
    few = [task for task in tasks if task.seed < FEW]
    done = run_experiment(
        few, executor, study, known_score=known_in, name=f"the first {FEW} seeds", progress=progress
    )
    more = [task for task in tasks if task.seed >= FEW and _is_short(task, done)]
    if done.interrupted or not more:
        return done
    return run_experiment(
        more, executor, study, known_score=known_in, name="further seeds", progress=progress,
        earlier=done,
    )  # fmt: skip


def learning_curve(folder: Path) -> list[Step]:
    """Read the learning curve of a training, as the trace of a search.

    Returns
    -------
    list of tuple
        (dominoes placed, intervals simulated, seconds, best score), at every improvement and at the
        end.
    """
    with (folder / PROGRESS).open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    trace: list[Step] = []
    for row in rows:
        steps = int(float(row["steps"]))
        best, seconds = float(row["best_score"]), float(row["processor_seconds"])
        if not trace or best > trace[-1][3] or row is rows[-1]:
            trace.append((steps, steps, seconds, best))
    return trace


@lru_cache(8)
def problem_of_text(text: str) -> Scene | SceneDistribution:
    """Read the scene or scene distribution of a TOML text."""
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


def _is_short(task: BenchmarkTask, done: Experiment) -> bool:
    """Return True where the same with other seeds took no longer than `SHORT`."""
    seconds = [r.seconds for r in done.runs(task.method) if r.scene == task.scene]
    return bool(seconds) and float(np.median(seconds)) <= SHORT


def _gain(gain: float | None) -> float:
    return STOPPED if gain is None else max(float(gain), STOPPED)
