"""Benchmark of learning algorithms, scripted policies and searches, over scenes and seeds.

All times are processor times [s]. A step places one domino.
"""

from __future__ import annotations

import csv
import platform
import re
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path

import msgspec
import numpy as np

from agents.algorithms import ALGORITHMS, Hyperparameters, default_hyperparameters
from agents.evaluation import evaluate_gains, has_test_set, read_search_scores
from agents.policy import CONFIG, PROGRESS, ScenePolicy, read_summary
from agents.rollout import EVALUATION_SEEDS, is_random
from agents.scripted import SCRIPTED, ScriptedPolicy
from agents.third_party import load_fit, train_third_party
from agents.training import train
from domino_env import Scene, SceneDistribution
from domino_env.core.checks import require_choice
from domino_env.core.files import read_json
from domino_env.core.models import plain
from domino_env.core.results import versions
from domino_env.core.types import Floats
from domino_env.scenes.distribution import load_any
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.io.reading import distribution_names, parse_document
from domino_env.scenes.pool import load_test_set
from optimize.experiments.best_known import best_known_score as scene_score
from optimize.experiments.compare import require_distinct
from optimize.experiments.estimates import normalise
from optimize.experiments.task import (
    STOPPED_GAIN,
    Task,
    TaskResult,
    Trace,
    digest,
    read_scene,
)
from optimize.methods import registry
from optimize.searching import compile_simulations

Target = Scene | SceneDistribution
# sampled scenes and random episodes first; fixed scenes, on which a search is better, after them
SCENES = (
    "varied-draw", "varied-tempo", "varied", "draw", "tempo-noise",
    "sprint", "course", "sprint-thickness", "ideal",
)  # fmt: skip
REFERENCES = Path(__file__).with_name("references.json")
BUDGETS = 30_000, 2_000_000  # [steps] of the classes in which trainings are compared
BASELINES = ("ramp", "cma", "auto")  # scripted policy and searches without learning
SEEDS = 10
FIRST_SEED = 100  # hyperparameters were chosen with smaller seeds
ENVIRONMENT = "DominoChain-v2"  # its version fixes rewards, observations and scenes
TRAININGS = Path("runs/benchmark")  # one folder for each training of an algorithm of `domino train`
EPISODES = 32  # in each random scene of a test set
SEARCH_TIME_RATIO = 0.04  # time limit of each search in a test set over that in a single scene
TRACE_POINTS = 60  # entries of the trace of searches in a test set, and in the table of runs
COLUMNS = (  # of the file of the runs
    "scene", "algorithm", "seed", "revision", "uniform", "score", "normalised_score", "steps",
    "simulations", "gradients", "updates", "processor_seconds", "key", "scene_hash", "versions",
    "trace",
)  # fmt: skip


@dataclass(frozen=True)
class BenchmarkTask(Task):
    """Run of a benchmark.

    `method` is an algorithm of `domino train`, a third-party algorithm, a scripted policy or a
    search method; `seconds` limits only searches, see `benchmark_tasks`. All results have the
    clocks "steps" and "seconds". With a scene distribution, scores are median gains in the test
    set, the score of the uniform baseline is 0, and there is no layout.

    Attributes
    ----------
    steps
        Number of dominoes that a training places at most, a third-party one about; None for that of
        the hyperparameters, 100 000 for a third-party algorithm.
    """

    steps: int | None = None

    @property
    def target(self) -> Target:
        """Scene or scene distribution of the run."""
        return read_target(self.scene)

    @property
    def scene_name(self) -> str:
        """Name of the scene or scene distribution."""
        return self.target.name

    @property
    def hyperparameters(self) -> Hyperparameters:
        """Hyperparameters of a training, including its number of steps."""
        defaults = default_hyperparameters(self.method, self.target)
        return defaults.replace(steps=min(defaults.steps, self.steps or defaults.steps))

    @property
    def key(self) -> str:
        """Digest of everything that determines the result, such as the hyperparameters."""
        determinants: list[object] = [ENVIRONMENT, self.scene, self.method, self.seed]
        if self.method in ALGORITHMS:
            determinants += [plain(self.hyperparameters)]
        elif load_fit(self.method) is not None:
            determinants += [self.steps]
        elif self.method not in SCRIPTED:
            determinants += [self.seconds]
        return digest(determinants)

    @property
    def folder(self) -> Path:
        """Folder of a training, whose name depends on `key`."""
        return TRAININGS / f"{self.scene_name}-{self.method}-{self.seed}-{self.key[:6]}"

    def run(self, clock: Callable[[], float] = time.process_time) -> TaskResult:
        """Train, build or search, and evaluate; continue a stopped training.

        Parameters
        ----------
        clock
            Function that returns the time [s], for scripted policies and for searches in a single
            scene; searches in a test set use `time.process_time`.

        Returns
        -------
        TaskResult
            Result of the run.

        Raises
        ------
        KeyboardInterrupt
            If the run was interrupted: its result would not be that of the task.
        """
        target = self.target
        scenes = [target] if isinstance(target, Scene) else load_test_set(target.name)
        compile_simulations(scenes[0], gradients=True, episodes=True)  # before time is measured
        trace: Trace
        work: dict[str, int]
        if is_learner(self.method):
            policy, trace, work = self._train()
            if isinstance(target, SceneDistribution) and is_random(target):
                gains = evaluate_gains(policy.policy, target, scenes, EPISODES, EVALUATION_SEEDS[0])
                trace["score"][-1] = gain = float(np.median(np.maximum(gains, STOPPED_GAIN)))
                return self.make_result(trace, gain, 0.0, gain, None, **work)
            rollouts = [policy.build(scene) for scene in scenes]
        elif self.method in SCRIPTED:
            start, scripted = clock(), ScriptedPolicy(self.method)
            rollouts = [scripted.build(scene) for scene in scenes]
            placed = sum(r.simulations * (r.scene.count - 1) for r in rollouts)  # dominoes
            trace = {"steps": [placed], "seconds": [clock() - start], "score": [np.nan]}
            work = {"simulations": sum(rollout.simulations for rollout in rollouts)}
        elif isinstance(target, Scene):
            result = super().run(clock)
            steps = [(target.count - 1) * number for number in result.trace["evaluations"]]
            trace, work = result.trace | {"steps": steps}, {**result.work, "steps": int(steps[-1])}
            return msgspec.structs.replace(result, trace=trace, work=work)
        else:
            return self._search_all(scenes)
        first = rollouts[0]
        if isinstance(target, Scene):
            trace["score"][-1] = first.score
            return self.make_result(
                trace, first.score, first.uniform.score, first.gain, first.wave, **work
            )
        gain = float(np.median([_gain(rollout.gain) for rollout in rollouts]))
        trace["score"][-1] = gain
        return self.make_result(trace, gain, 0.0, gain, None, **work)

    def _train(self) -> tuple[ScenePolicy, Trace, dict[str, int]]:
        """Train; return the policy, its learning curve, and counts such as "simulations"."""
        if self.method not in ALGORITHMS:
            return train_third_party(self.method, self.target, self.steps, self.seed)
        folder = self.folder
        if not read_summary(folder).get("finished"):  # only in the summary of a training
            # imported before time is measured; otherwise the first optimiser imports it
            import_module("torch._dynamo")
            run = train(
                self.target, self.method, None, self.seed, folder,
                resume=(folder / CONFIG).exists(), hyperparameters=self.hyperparameters,
            )  # fmt: skip
            if run.interrupted:
                raise KeyboardInterrupt
        summary = read_summary(folder)
        work = {name: summary[name] for name in ("simulations", "gradients", "updates")}
        return ScenePolicy.load(folder), learning_curve(folder), work

    def software_versions(self) -> dict[str, str]:
        """Return the revision, the versions of packages and the processor."""
        return machine_versions()

    def _search_all(self, scenes: Sequence[Scene]) -> TaskResult:
        """Search in each scene of a test set.

        The trace has the median gain when all searches have run for the same time, and the sum of
        these times.
        """
        limit = None if self.seconds is None else SEARCH_TIME_RATIO * self.seconds
        results = [
            Task(scene.to_toml(), self.method, self.seed, None, limit).run(clock=time.process_time)
            for scene in scenes
        ]
        names = "evaluations", "seconds", "score"
        traces = [np.array([result.trace[name] for name in names]).T for result in results]
        ends = [trace[-1, 1] for trace in traces]
        first, last = max(trace[0, 1] for trace in traces), max(ends)
        uniform = np.array([result.uniform_score for result in results])
        pairs = np.array([scene.count - 1 for scene in scenes])
        entries: list[tuple[int, float, float]] = []
        # the logarithmic scale starts above 0 [s]
        for elapsed in np.geomspace(max(first, 1e-6), max(last, 1e-6), TRACE_POINTS):
            latest = np.array([t[np.searchsorted(t[:, 1], elapsed, "right") - 1] for t in traces])
            gain = np.median(np.maximum(latest[:, 2] / uniform - 1.0, STOPPED_GAIN))
            entries.append((int(latest[:, 0] @ pairs), np.minimum(elapsed, ends).sum(), gain))
        score = float(np.median([_gain(result.gain) for result in results]))
        steps, seconds, scores = zip(*entries, strict=True)
        trace = {"steps": steps, "seconds": seconds, "score": scores}
        work = {
            name: sum(result.work[name] for result in results)
            for name in ("simulations", "gradients")
        }
        return self.make_result(trace, score, 0.0, score, None, **work)


def benchmark_tasks(
    scenes: Sequence[Target | str] = SCENES,
    algorithms: Sequence[str] = (*ALGORITHMS, *BASELINES),
    seeds: int = SEEDS,
    steps: int | None = None,
    seconds: float | None = None,
) -> list[BenchmarkTask]:
    """Return the runs of a benchmark, ordered by seed, scene and algorithm.

    Parameters
    ----------
    scenes
        Scenes, scene distributions that have a test set, or their names.
    algorithms
        Learning algorithms, also third-party ones (`agents.third_party`), scripted policies and
        search methods. In a random scene the last two are replaced, see `others`.
    seeds
        Number of seeds, from `FIRST_SEED` on; a scripted policy runs once.
    steps
        Number of dominoes that a training places at most, a third-party one about; None for that of
        the hyperparameters, 100 000 for a third-party algorithm.
    seconds
        Largest processor time of a search in a single scene [s]; in each scene of a test set,
        `SEARCH_TIME_RATIO` times that. None for no limit.

    Raises
    ------
    ValueError
        If names are unknown or repeated, if lists are empty, or if a scene distribution has no test
        set.
    """
    require_distinct(scenes=scenes, algorithms=algorithms)
    known = *ALGORITHMS, *SCRIPTED, *registry.METHODS, *registry.THIRD_PARTY
    for name in algorithms:
        if ":" not in name:
            require_choice("algorithm", name, dict.fromkeys((*known, "package.module:function")))
        if name not in SCRIPTED and not is_learner(name):
            registry.load(name)
    targets = [scene if isinstance(scene, Target) else load_any(scene) for scene in scenes]
    require_distinct(scenes=[target.name for target in targets])
    for target in targets:
        if isinstance(target, SceneDistribution) and not has_test_set(target):
            raise ValueError(
                f"scene distribution '{target.name}' has no test set: name a fixed scene, or one "
                f"of {', '.join(distribution_names())}"
            )
    return [
        BenchmarkTask(target.to_toml(), name, seed, None, seconds, {}, steps)
        for seed in range(FIRST_SEED, FIRST_SEED + seeds)
        for target in targets
        for name in (*learners(target, algorithms), *others(target, algorithms))
        if seed == FIRST_SEED or name not in SCRIPTED
    ]


def learners(target: Target, algorithms: Sequence[str]) -> list[str]:
    """Return the learning algorithms that can learn in a target.

    APG does not if scenes are sampled and episodes are random.
    """
    excluded = {"apg"} if isinstance(target, SceneDistribution) and is_random(target) else set()
    return [name for name in algorithms if is_learner(name) and name not in excluded]


def others(target: Target, algorithms: Sequence[str]) -> list[str]:
    """Return scripted policies and searches among algorithms, or the references of a random scene.

    References are the open-loop plan and, if there is one, a policy that reacts to what is random.
    """
    if is_random(target):
        scene = target if isinstance(target, Scene) else target.first
        return ["plan", *(["rule"] if scene.hand else ["controller"] * (scene.tempo is not None))]
    return [name for name in algorithms if not is_learner(name)]


def is_learner(name: str) -> bool:
    """Return True for the name of a learning algorithm, shipped or third-party."""
    return name in ALGORITHMS or load_fit(name) is not None


def learning_curve(folder: Path) -> Trace:
    """Read the learning curve of a training, see `TaskResult.trace`.

    Returns
    -------
    dict
        Dominoes placed, "steps", processor "seconds", and "score" of the best policy so far, at
        every change of the score and at the end. If scenes are sampled, the score is that in the
        test set.
    """
    with (folder / PROGRESS).open(newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    scores, last = [line["test_score"] for line in lines], len(lines) - 1
    changes = [line for k, line in enumerate(lines) if k in (0, last) or scores[k] != scores[k - 1]]
    return {
        "steps": [int(float(line["steps"])) for line in changes],
        "seconds": [float(line["processor_seconds"]) for line in changes],
        "score": [float(line["test_score"]) for line in changes],
    }


@lru_cache(16)  # more than the default targets of a benchmark
def read_target(text: str) -> Target:
    """Read a scene or scene distribution from TOML text."""
    document = parse_document(text, "scene")
    return SceneDistribution(document, "scene") if has_ranges(document) else read_scene(text)


@lru_cache(16)
def target_hash(target: Target) -> str:
    """Return a short hash of the environment's name, of a target and of its test set."""
    tests = load_test_set(target.name) if isinstance(target, SceneDistribution) else []
    return digest([ENVIRONMENT, target.to_toml(), *(scene.to_toml() for scene in tests)])[:12]


@lru_cache(1)
def machine_versions() -> dict[str, str]:
    """Return the revision, the versions of packages and the processor by name."""
    values = versions("torch", "stable-baselines3", "sb3-contrib")
    values["processor"] = platform.processor() or platform.machine()
    with suppress(OSError):  # only Linux has this file
        models = re.findall(r"model name\s*:\s*(.+)", Path("/proc/cpuinfo").read_text("utf-8"))
        values["processor"] = models[0] if models else values["processor"]
    return values


@cache
def references() -> dict[str, dict[str, float]]:
    """Return the scores of `references.json` by scene: "zero", "one" and "hindsight".

    In a scene with random episodes, "zero" and "one" are normalised as 0 and 1. Values of a scene
    distribution are median gains in its test set.
    """
    return dict(read_json(REFERENCES))


def ends_of_scale(target: Target) -> tuple[float, float]:
    """Return the scores of a target that are normalised as 0 and 1; the second -inf if unknown.

    They are those of `references` in random scenes; else the score of the uniform baseline and the
    best known score, for a scene distribution median gains in its test set.
    """
    if is_random(target):
        ends = references().get(target.name)
        if ends is not None and load_any(target.name) == target:
            return ends["zero"], ends["one"]
        return uniform_score(target), -np.inf
    if isinstance(target, Scene):
        return uniform_score(target), scene_score(target)
    best = -np.inf
    if has_test_set(target):
        tests = load_test_set(target.name)
        scores = read_search_scores(target.name, len(tests))
        if scores is not None:
            indices = np.flatnonzero(np.isfinite(scores))
            gains = [scores[i] / tests[i].uniform().score - 1.0 for i in indices]
            best = float(np.median(gains))
    return 0.0, best


def uniform_score(target: Target) -> float:
    """Return the score of the uniform baseline; 0 for a scene distribution, as scores are gains."""
    return target.uniform().score if isinstance(target, Scene) else 0.0


def normalised_score(
    score: Floats | float, scene: str | Path | Scene | SceneDistribution
) -> Floats:
    """Return (score - zero) / (one - zero), which can be averaged over scenes.

    Returns of episodes have other units in other scenes, and other best values.

    Parameters
    ----------
    score
        Score in the unit of the scene, as `score` in the info of an environment, of any shape. In a
        scene with random episodes, a mean over seeds; for a scene distribution, the median gain in
        its test set, 0.01 for 1 %.
    scene
        The scene or scene distribution, its name, or the path of its file.

    Returns
    -------
    ndarray
        0 for the uniform baseline and 1 for the best known layout. With random episodes, 0 for the
        best open-loop plan if there is a single scene, and 1 for the best known policy. 0 if the
        uniform baseline is best known.

    Raises
    ------
    ValueError
        If no best known score is shipped.

    Examples
    --------
    >>> from agents import evaluate, normalised_score
    >>> round(float(normalised_score(evaluate("sprint").score, "sprint")), 2)
    1.0
    """
    target = scene if isinstance(scene, Target) else load_any(scene)
    zero, one = ends_of_scale(target)
    if one == -np.inf:
        raise ValueError(
            f"scene '{target.name}' has no best known score: compare with `optimize.search` instead"
        )
    return normalise(score, zero, one)


def _gain(gain: float | None) -> float:
    """Return a gain, or `STOPPED_GAIN` for a wave that stops."""
    return STOPPED_GAIN if gain is None else max(float(gain), STOPPED_GAIN)
