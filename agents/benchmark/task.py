"""One run of a benchmark: an algorithm that learns, a scripted policy or a search, on one scene."""

from __future__ import annotations

import csv
import hashlib
import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from importlib import import_module
from pathlib import Path

import numpy as np

from agents.algorithms import ALGORITHMS, Hyperparameters, hyperparameters
from agents.benchmark.many import problem_of, scripted_in, searched_in
from agents.evaluation import evaluate, gains_of
from agents.policy import CONFIG, PROGRESS, SUMMARY, ScenePolicy, summary_of
from agents.rollout import Rollout
from agents.scripted import SCRIPTED
from agents.training import episode_of, train
from domino_env import SceneDistribution
from domino_env.core.reading import read_json
from domino_env.core.results import versions
from domino_env.scenes.pool import load_test_set
from optimize.compiling import compile_for
from optimize.evaluator import Budget, Step
from optimize.studies.task import Task, TaskResult

EACH = 0.04  # of the time of a search: so much it has for each scene of a test set


@dataclass(frozen=True)
class BenchmarkTask(Task):
    """One run of a benchmark.

    `method` is an algorithm of `domino train`, a scripted policy, or a method of a search;
    `seconds` limit a search alone.  All times of its result are processor time [s].  Where it
    trains, and where scenes are drawn, `evaluations` of its result are dominoes placed, not rows.
    Where scenes are drawn its score is the median gain in the test set, the row is empty, and the
    trace of a training is of scenes that are not in that set.

    Attributes
    ----------
    steps
        Dominoes that a training may place at most; None for the preset's.
    home
        Folder in which trainings have a folder each.
    """

    steps: int | None = None
    home: str = "runs/benchmark"

    @property
    def trains(self) -> bool:
        """Whether an algorithm learns."""
        return self.method in ALGORITHMS

    @property
    def plan(self) -> Hyperparameters:
        """Preset of a training, with its steps."""
        problem = problem_of(self.scene)
        drawn = isinstance(problem, SceneDistribution)
        plan = hyperparameters(self.method, episode_of(problem), drawn=drawn)
        return plan if self.steps is None else replace(plan, steps=min(plan.steps, self.steps))

    @property
    def key(self) -> str:
        """A digest of all that decides the result; of a training, the preset too."""
        decisive = [self.scene, self.method, self.seed]
        if self.trains:
            defaults = {field.name: field.default for field in fields(Hyperparameters)}
            plan = asdict(self.plan).items()
            decisive += [sorted((k, v) for k, v in plan if v != defaults[k])]
        elif self.method not in SCRIPTED:
            decisive += [self.seconds]
        return hashlib.sha256(json.dumps(["benchmark", *decisive]).encode()).hexdigest()[:32]

    @property
    def folder(self) -> Path:
        """Where a training is kept: another preset, another folder."""
        name = problem_of(self.scene).name
        return Path(self.home) / f"{name}-{self.method}-{self.seed}-{self.key[:6]}"

    def run(
        self, watch: Callable[[Budget], None] | None = None, *, progress: bool | None = False
    ) -> TaskResult:
        """Train and evaluate, build, or search; a training that was stopped goes on.

        Parameters
        ----------
        watch, progress
            As of `optimize.search`; of a search alone.

        Raises
        ------
        KeyboardInterrupt
            Where it is ended by hand.
        """
        problem = problem_of(self.scene)
        if isinstance(problem, SceneDistribution):
            return self._in_many(problem)
        compile_for(problem, gradients=True, episodes=True)  # before any clock
        if self.trains:
            steps = self._train()
            return self._result(evaluate(self.folder, problem), steps, curve(self.folder))
        if self.method in SCRIPTED:
            began = time.process_time()
            built = evaluate(self.method, problem)
            return self._result(built, 1, [(1, 1, time.process_time() - began, built.score)])
        return self.searched(time.process_time, watch, progress)

    def _train(self) -> int:
        """Train what is not trained yet, and give the dominoes that were placed."""
        folder = self.folder
        summary = summary_of(folder) if (folder / SUMMARY).exists() else None
        if summary is None or not summary.finished:
            begun = (folder / CONFIG).exists()
            import_module("torch._dynamo")  # as the first optimiser would, on the clock
            done = train(
                problem_of(self.scene), self.method, None, self.seed, folder,
                resume=begun, plan=self.plan,
            )  # fmt: skip
            if done.interrupted:
                raise KeyboardInterrupt
        return int(read_json(folder / SUMMARY)["steps"])

    def _in_many(self, distribution: SceneDistribution) -> TaskResult:
        """The same in scenes that are drawn, judged in the test set."""
        tests = load_test_set(distribution.name)
        compile_for(tests[0], gradients=True, episodes=True)
        if self.trains:
            self._train()
            trace = curve(self.folder)
            score = float(
                np.median(gains_of(ScenePolicy.load(self.folder).policy, distribution, tests))
            )
        elif self.method in SCRIPTED:
            trace, score = scripted_in(self.method, tests)
        else:
            each = None if self.seconds is None else EACH * self.seconds
            trace, score = searched_in(self.method, self.seed, each, tests)
        none = np.empty(0)
        return TaskResult(
            key=self.key,
            scene_name=distribution.name,
            method=self.method,
            seed=self.seed,
            score=score,
            uniform_score=0.0,
            gain=score,
            outcome="PROPAGATED",
            mean_speed=0.0,
            spacing=none,
            thickness=none,
            height=none,
            evaluations=trace[-1][0],
            falls=trace[-1][1],
            seconds=trace[-1][2],
            trace=trace,
            labels=self.labels,
            versions=versions(),
            scene=self.scene,
        )

    def _result(self, built: Rollout, evaluations: int, trace: list[Step]) -> TaskResult:
        return TaskResult(
            key=self.key,
            scene_name=built.scene.name,
            method=self.method,
            seed=self.seed,
            score=built.score,
            uniform_score=built.uniform.score,
            gain=built.gain,
            outcome=built.wave.outcome.name,
            mean_speed=built.wave.mean_speed,
            spacing=built.layout.spacing,
            thickness=built.layout.thickness,
            height=built.layout.height,
            evaluations=evaluations,
            falls=trace[-1][1],
            seconds=trace[-1][2],
            trace=trace,
            labels=self.labels,
            versions=versions(),
            scene=self.scene,
        )


def curve(folder: Path) -> list[Step]:
    """Read the learning curve of a training.

    Returns
    -------
    list of tuple
        (dominoes placed, falls simulated, processor seconds, best score), at every improvement and
        at the end: the trace of a search.
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
