"""Evaluation: the layouts that a trained or scripted policy builds, in one scene or in many."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from agents.archives import load_archive
from agents.designer.features import FEATURES, features_of
from agents.designer.policy import Designer, shipped_designer
from agents.network import Policy
from agents.policy import DESIGNER, POLICIES, ScenePolicy, folder_of, summary_of
from agents.rollout import Rollout, last_infos
from agents.scripted import SCRIPTED, ScriptedPolicy
from domino_env import DominoChainVector, Scene, SceneDistribution, load_scene
from domino_env.core.checks import require
from domino_env.core.progress import progress_bar
from domino_env.core.tables import markdown_table, write_csv
from domino_env.core.types import Floats
from domino_env.scenes.distribution import load_distribution
from domino_env.scenes.io.reading import distribution_names
from domino_env.scenes.pool import load_test_set
from optimize.searching import compile_for

if TYPE_CHECKING:
    from optimize.evaluator import Evaluator

SAME_GAIN = 1e-9  # relative gain up to which a layout counts as the uniform one
LEAST_GAIN = 1e-4  # a smaller gain of a search is no reference
SEARCHED = Path(__file__).with_name("searched.csv")


def evaluate(run: str | Path, scene: str | Scene | None = None, *, trust: bool = False) -> Rollout:
    """Build a layout with the best policy of a training, deterministically.

    Only an archive needs the extra "rl".

    Parameters
    ----------
    run
        The folder of a training; the name of a shipped policy ("designer", or one of
        `agents.policy.shipped`) or of a scripted one ("uniform", "greedy", "ramp"); or an archive
        (.zip) of Stable-Baselines3 or sb3-contrib.
    scene
        Another scene than the policy was trained on, with observations of the same size. A
        scripted policy and one that was trained on sampled scenes need one.
    trust
        Whether an archive may be loaded by Stable-Baselines3, which runs the code that it
        contains. Plain multilayer perceptrons do not need it.

    Returns
    -------
    Rollout
        The layout with its wave and score, beside the uniform baseline.

    Raises
    ------
    ValueError
        If the observations of the scene have another size, and if `run` names no policy.

    Examples
    --------
    >>> from agents import evaluate
    >>> round(evaluate("sprint").score, 4)  # [m/s]
    0.8284
    """
    policy = load_policy(run, trust=trust)
    if isinstance(policy, ScenePolicy) and scene is None:
        return policy.build()
    if scene is None:
        raise ValueError(f"{run} was trained on no single scene: name one to build for (--scene)")
    return policy.build(scene if isinstance(scene, Scene) else load_scene(scene))


def load_policy(
    run: str | Path, *, trust: bool = False, distribution: SceneDistribution | None = None
) -> ScenePolicy | Designer | ScriptedPolicy:
    """Load a policy, whose method `build` builds a layout for a scene.

    Trained policies have the method `predict` of Stable-Baselines3 too.

    Parameters
    ----------
    run, trust
        As of `evaluate`.
    distribution
        The scene distribution that the policy of an archive was trained on, if any.

    Raises
    ------
    ValueError
        If `run` names no policy.
    """
    if str(run) in SCRIPTED:
        return ScriptedPolicy(str(run))
    folder = folder_of(run)
    if folder.suffix == ".zip":
        return load_archive(folder, trust, distribution)
    if folder == POLICIES / DESIGNER:
        return shipped_designer()
    return ScenePolicy.load(folder)


def agent(run: str) -> Callable[[Evaluator, np.random.Generator], None]:
    """Return the method `agent:RUN` of a search, which evaluates the layout of a policy.

    The time of its training counts as spent.

    Parameters
    ----------
    run
        As of `evaluate`.

    Raises
    ------
    ValueError
        If `run` names no policy.
    """
    try:
        policy = load_policy(run)
    except ValueError as error:
        raise ValueError(f"method 'agent:{run}': {error}") from None
    summary = summary_of(folder_of(run))

    def method(evaluator: Evaluator, rng: np.random.Generator) -> None:
        evaluator.add_seconds(summary.seconds)
        layout = policy.build(evaluator.problem.scene).layout
        evaluator.evaluate(evaluator.problem.design(layout))

    return method


def gains_of(policy: Policy, distribution: SceneDistribution, scenes: Sequence[Scene]) -> Floats:
    """Return the gains of the layouts that a policy builds in many scenes, side by side.

    Parameters
    ----------
    policy
        Maps observations (S, O) to actions (S, A).
    distribution
        The distribution that it was trained on.
    scenes
        S scenes of that kind.

    Returns
    -------
    ndarray
        (S,) gains over the uniform baselines; at most -1 where the wave stops.
    """
    env = DominoChainVector(len(scenes), distribution, autoreset_mode="SameStep")
    return np.array(last_infos(policy, env, "gain", options={"scene": list(scenes)}))


def searched_scores(name: str, number: int) -> Floats | None:
    """Return the scores of searches in the first scenes of a test set.

    They are those of `search(scene, budget=2500, seed=1)`.

    Parameters
    ----------
    name
        Name of the test set.
    number
        Number of scenes.

    Returns
    -------
    NDArray or None
        (number,) scores, nan where none was searched; None where there are none at all.
    """
    scores = np.full(number, np.nan)
    with SEARCHED.open(newline="", encoding="utf-8") as lines:
        for line in csv.DictReader(lines):
            if line["set"] == name and int(line["scene"]) < number:
                scores[int(line["scene"])] = float(line["score"])
    return scores if np.isfinite(scores).any() else None


@dataclass(frozen=True, eq=False)
class ScenesEvaluation:
    """Evaluation of a policy in S scenes, beside the uniform baselines and, if known, a search.

    Attributes
    ----------
    scenes
        The scenes.
    uniform
        (S,) scores of the uniform baselines.
    scores
        (S,) scores by name: "policy", and where it is the designer "proposal", the layouts of its
        networks without gradient steps, and where a search is known "search", with nan in scenes
        that were not searched.
    seconds
        (S,) processor time by name [s], not of the search.
    """

    scenes: Sequence[Scene]
    uniform: Floats
    scores: dict[str, Floats]
    seconds: dict[str, Floats]

    def table(self) -> str:
        """Return a table in Markdown with a line for the policy, its proposal and the search."""
        names = (
            "layout", "beats the uniform baseline", "median gain", "10th percentile", "worst",
            "median part of the search's gain", "10th percentile", "median time", "longest",
        )  # fmt: skip
        return "\n".join(markdown_table(names, map(self._line, self.scores)))

    def _line(self, name: str) -> tuple[str, ...]:
        scores = self.scores[name]
        gain = self.gains(name)
        gain = gain[np.isfinite(gain)]
        stopped = int(np.sum(scores <= 0.0))
        parts, times = ["", ""], ["", ""]
        if "search" in self.scores:
            searched = self.gains("search")
            gained = searched > LEAST_GAIN  # nan compares as False
            normalised = self.gains(name)[gained] / searched[gained]
            parts = [f"{np.quantile(normalised, q):.1%}" for q in (0.5, 0.1)]
        if name in self.seconds:
            seconds = 1e3 * self.seconds[name]
            times = [f"{np.median(seconds):.1f} ms", f"{seconds.max():.1f} ms"]
        return (
            name, f"{np.mean(gain > SAME_GAIN):.1%} of {len(gain)}", f"{np.median(gain):+.2%}",
            f"{np.quantile(gain, 0.1):+.2%}",
            f"{stopped} stop" if stopped else f"{gain.min():+.2%}", *parts, *times,
        )  # fmt: skip

    def gains(self, name: str = "policy") -> Floats:
        """Return the gains (S,) over the uniform baselines; below -1 where a wave stops."""
        return self.scores[name] / self.uniform - 1.0

    def save(self, path: Path) -> None:
        """Write a CSV file with the features, scores and times [s] of each scene."""
        columns = dict(zip(FEATURES, np.array([*map(features_of, self.scenes)]).T, strict=True))
        columns |= {"uniform": self.uniform, **self.scores}
        columns |= {f"{name} seconds": values for name, values in self.seconds.items()}
        lines = ([f"{x:.10g}" for x in line] for line in zip(*columns.values(), strict=True))
        write_csv(path, [name.replace(" ", "_") for name in columns], lines)


def scenes_of(
    name: str | Path | SceneDistribution, number: int, seed: int | None = None
) -> list[Scene]:
    """Return scenes to evaluate in: those of a shipped test set, or sampled ones.

    Parameters
    ----------
    name
        A scene distribution, the name of a shipped one, or the path of its file.
    number
        Number of scenes; of a test set its first, at most 200.
    seed
        Seed of the sampling; None for the test set.

    Raises
    ------
    ValueError
        For numbers out of range, and as of `load_distribution` and `load_test_set`.
    """
    require("scenes", number, 1, whole=True)
    distribution = name if isinstance(name, SceneDistribution) else load_distribution(name)
    if seed is not None:
        require("seed", seed, 0, whole=True)
        rng = np.random.default_rng(seed)
        return [distribution.sample(rng) for _ in range(number)]
    name = distribution.name
    if name not in distribution_names() or load_distribution(name) != distribution:
        raise ValueError(f"no test scenes ship for '{name}': give a seed (--seed)")
    tests = load_test_set(name)
    if number > len(tests):
        raise ValueError(f"the test set of {name} has {len(tests)} scenes: give a seed for more")
    return tests[:number]


def evaluate_scenes(
    scenes: Sequence[Scene],
    policy: ScenePolicy | Designer | ScriptedPolicy | None = None,
    searched: Floats | None = None,
    *,
    progress: bool | None = False,
) -> ScenesEvaluation:
    """Build a layout for each scene, and compare its score with the uniform baseline.

    Parameters
    ----------
    scenes
        One or more scenes.
    policy
        The designer, a policy that was trained on sampled scenes, or a scripted one; None for the
        shipped designer.
    searched
        (S,) scores of searches, to compare with; None for none.
    progress
        Whether to show a progress bar; None: on a terminal, elsewhere a line now and then.

    Returns
    -------
    ScenesEvaluation
        Scores and processor times in each scene.
    """
    builder = policy or shipped_designer()
    scorers: dict[str, Callable[[Scene], float]] = {
        "policy": lambda scene: builder.build(scene).score
    }
    if isinstance(builder, Designer):
        scorers = {
            "policy": lambda scene: builder.design(scene).score,
            "proposal": lambda scene: builder.design(scene, steps=0).score,
        }
    compile_for(scenes[0])
    scorers["policy"](scenes[0])  # the first call loads data and is not timed
    scores = {name: np.empty(len(scenes)) for name in scorers}
    seconds = {name: np.empty(len(scenes)) for name in scorers}
    for i, scene in enumerate(progress_bar(progress, iterable=scenes, unit=" scenes")):
        for name, score in scorers.items():
            began = time.process_time()
            scores[name][i] = score(scene)
            seconds[name][i] = time.process_time() - began
    if searched is not None:
        scores["search"] = searched
    uniform = np.array([scene.uniform().score for scene in scenes])
    return ScenesEvaluation(scenes, uniform, scores, seconds)
