"""Benchmark: learning algorithms, scripted policies and searches, over scenes and seeds.

All times are processor time [s], all steps dominoes placed.
"""

from __future__ import annotations

import csv
import platform
import re
import subprocess
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import msgspec
import numpy as np

from agents.algorithms import ALGORITHMS, Hyperparameters, default_hyperparameters
from agents.evaluation import STOPPED, gains_of, searched_scores
from agents.network import Policy
from agents.outside import fitted, load_fit
from agents.policy import CONFIG, PROGRESS, SUMMARY, ScenePolicy, summary_of
from agents.rollout import Rollout, build
from agents.scripted import SCRIPTED, ScriptedPolicy
from agents.training import episode_of, train
from domino_env import Scene, SceneDistribution, Wave
from domino_env.core.checks import require
from domino_env.scenes.distribution import load_any
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.io.reading import document_of_text
from domino_env.scenes.pool import load_test_set
from optimize.evaluator import Step
from optimize.experiments.compare import known_score, require_distinct
from optimize.experiments.task import Task, TaskResult, digest, scene_of
from optimize.methods import registry
from optimize.searching import compile_for

Target = Scene | SceneDistribution
SCENES = ("sprint", "course", "sprint-thickness", "ideal", "varied")
BASELINES = ("ramp", "cma", "auto")  # need no learning
SEEDS = 10
FIRST_SEED = 100  # hyperparameters were chosen with smaller ones
ENVIRONMENT = "DominoChain-v1"  # pins reward, observation and scenes
TRAININGS = Path("runs/benchmark")  # has a folder for each training
SEARCH_PART = 0.04  # time of the search of a scene of a test set, over that of a single scene
POINTS = 60  # of the trace of many searches


@dataclass(frozen=True)
class BenchmarkTask(Task):
    """One run of a benchmark.

    `method` is an algorithm of `domino train` or from outside, a scripted policy, or a method of a
    search; `seconds` limit a search only. Evaluations of its result are dominoes placed. With a
    scene distribution, scores are median gains in the test set, and there is no layout.

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
        decisive: list[object] = [ENVIRONMENT, self.scene, self.method, self.seed]
        if self.method in ALGORITHMS:
            decisive += [asdict(self.hyperparameters)]
        elif load_fit(self.method) is not None:
            decisive += [self.steps]
        elif self.method not in SCRIPTED:
            decisive += [self.seconds]
        return digest(decisive)

    @property
    def folder(self) -> Path:
        """Folder of a training; other hyperparameters have another folder."""
        return TRAININGS / f"{self.scene_name}-{self.method}-{self.seed}-{self.key[:6]}"

    def run(self, clock: Callable[[], float] = time.process_time) -> TaskResult:
        """Train and evaluate, build, or search; a training that was stopped is continued."""
        problem = problem_of_text(self.scene)
        sampled = isinstance(problem, SceneDistribution)
        scenes = load_test_set(problem.name) if sampled else [scene_of(self.scene)]
        compile_for(scenes[0], gradients=True, episodes=True)  # before any clock
        if self.method in ALGORITHMS:
            self._train()
            policy, summary = ScenePolicy.load(self.folder), summary_of(self.folder)
            counts = {
                name: getattr(summary, name) for name in ("simulations", "gradients", "updates")
            }
            trace = learning_curve(self.folder)
            return self._evaluated(policy.policy, policy.build, scenes, trace, **counts)
        if load_fit(self.method) is not None:
            act, work, seconds = fitted(self.method, problem, self.steps, self.seed)
            trace = [(work["steps"], work["steps"], seconds, np.nan)]
            counts = {"simulations": work["simulations"]}
            return self._evaluated(act, partial(build, act), scenes, trace, **counts)
        if self.method in SCRIPTED:
            return self._scripted(scenes, clock)
        if sampled:
            return self._search_all(scenes)
        result = super().run(clock)
        placed = scenes[0].count - 1
        trace = [(placed * n, falls, t, score) for n, falls, t, score in result.trace]
        return msgspec.structs.replace(result, trace=trace, evaluations=trace[-1][0])

    def _evaluated(
        self,
        policy: Policy,
        build_in: Callable[[Scene], Rollout],
        scenes: Sequence[Scene],
        trace: list[Step],
        **counts: int,
    ) -> TaskResult:
        """Return the result of a policy; its score is that at the end of the trace."""
        problem = problem_of_text(self.scene)
        if isinstance(problem, Scene):
            rollout = build_in(problem)
            score, uniform = rollout.score, rollout.uniform.score
            gain, wave = rollout.gain, rollout.wave
        else:
            score = gain = float(np.median(gains_of(policy, problem, scenes)))
            uniform, wave = 0.0, None
        trace[-1] = (*trace[-1][:3], score)
        return self.result_of(trace, score, uniform, gain, wave, **counts)

    def _scripted(self, scenes: Sequence[Scene], clock: Callable[[], float]) -> TaskResult:
        """Build a layout for each scene with a scripted policy."""
        began, policy = clock(), ScriptedPolicy(self.method)
        rollouts = [policy.build(scene) for scene in scenes]
        seconds, first = clock() - began, rollouts[0]
        placed = sum(r.simulations * (r.scene.count - 1) for r in rollouts)
        score, uniform, gain = first.score, first.uniform.score, first.gain
        wave: Wave | None = first.wave
        if isinstance(problem_of_text(self.scene), SceneDistribution):
            score = gain = float(np.median([_gain(rollout.gain) for rollout in rollouts]))
            uniform, wave = 0.0, None
        simulations = sum(rollout.simulations for rollout in rollouts)
        trace = [(placed, placed, seconds, score)]
        return self.result_of(trace, score, uniform, gain, wave, simulations=simulations)

    def software(self) -> dict[str, str]:
        """Return versions, the commit and the processor."""
        return super().software() | machine()

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
            Task(scene.to_toml(), self.method, self.seed, None, each).run(clock=time.process_time)
            for scene in scenes
        ]
        traces = [np.array(result.trace) for result in results]
        ends = [trace[-1, 2] for trace in traces]
        first, last = max(trace[0, 2] for trace in traces), max(ends)
        uniform = np.array([result.uniform_score for result in results])
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
        counts = {
            name: sum(getattr(result, name) for result in results)
            for name in ("simulations", "gradients")
        }
        return self.result_of(steps, score, 0.0, score, None, **counts)


def benchmark_tasks(
    scenes: Sequence[Target | str] = SCENES,
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
        Learning algorithms, also from outside (`agents.outside`), scripted policies, and methods of
        a search.
    seeds
        Number of seeds, from `FIRST_SEED`; a scripted policy runs once.
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
        if name not in SCRIPTED and not learns(name):
            registry.load(name)
    loaded = [load_any(scene) if isinstance(scene, str) else scene for scene in scenes]
    return [
        BenchmarkTask(problem.to_toml(), name, seed, None, seconds, {}, steps)
        for seed in range(FIRST_SEED, FIRST_SEED + seeds)
        for problem in loaded
        for name in algorithms
        if seed == FIRST_SEED or name not in SCRIPTED
    ]


def learns(name: str) -> bool:
    """Return whether a name is that of a learning algorithm, ours or from outside."""
    return name in ALGORITHMS or load_fit(name) is not None


def learning_curve(folder: Path) -> list[Step]:
    """Read the learning curve of a training, as the trace of a search.

    Returns
    -------
    list of tuple
        (dominoes placed, intervals simulated, seconds, score of the best policy so far, on the test
        set where scenes are sampled), at every change and at the end.
    """
    with (folder / PROGRESS).open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    trace: list[Step] = []
    for line in lines:
        steps = int(float(line["steps"]))
        score, seconds = float(line["test_score"]), float(line["processor_seconds"])
        if not trace or score != trace[-1][3] or line is lines[-1]:
            trace.append((steps, steps, seconds, score))
    return trace


@lru_cache(8)
def problem_of_text(text: str) -> Target:
    """Return the scene or scene distribution of a TOML text."""
    document = document_of_text(text, "scene")
    return SceneDistribution(document, "scene") if has_ranges(document) else scene_of(text)


@lru_cache(8)
def hash_of(target: Target) -> str:
    """Return a hash of the environment's name, a scene or scene distribution, and its test set."""
    tests = load_test_set(target.name) if isinstance(target, SceneDistribution) else []
    return digest([ENVIRONMENT, target.to_toml(), *(scene.to_toml() for scene in tests)])[:12]


@lru_cache(1)
def machine() -> dict[str, str]:
    """Return versions of the packages for learning, the commit and the processor, by name."""
    found = {}
    for name in ("torch", "stable-baselines3", "sb3-contrib"):
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    with suppress(OSError, subprocess.CalledProcessError):  # no repository
        words = ["git", "describe", "--always", "--dirty"]
        folder = Path(__file__).parent
        found["commit"] = subprocess.check_output(words, cwd=folder, text=True, stderr=-3).strip()
    found["processor"] = platform.processor() or platform.machine()
    with suppress(OSError):  # the name that Linux has
        names = re.findall(r"model name\s*:\s*(.+)", Path("/proc/cpuinfo").read_text("utf-8"))
        found["processor"] = names[0] if names else found["processor"]
    return found


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
