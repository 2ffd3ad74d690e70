"""Evaluation of trained and scripted policies by the layouts they build in one or more scenes."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from agents.archives import load_archive
from agents.designer.policy import Designer, shipped_designer
from agents.network import Policy
from agents.policy import DESIGNER, POLICIES, ScenePolicy, find_folder, policy_names, read_summary
from agents.rollout import SELECTION_SEEDS, Rollout, is_random, last_infos
from agents.scripted import SCRIPTED, ScriptedPolicy
from domino_env import DominoChainVector, Scene, SceneDistribution, load_scene
from domino_env.core.checks import require, require_choice
from domino_env.core.progress import progress_bar
from domino_env.core.tables import markdown_table
from domino_env.core.types import Floats
from domino_env.scenes.distribution import load_distribution
from domino_env.scenes.io.reading import distribution_names
from domino_env.scenes.pool import load_test_set
from optimize.evaluator import Evaluator
from optimize.methods.registry import Method
from optimize.searching import compile_simulations

SAME_GAIN = 1e-9  # a layout beats the uniform baseline if its gain is larger
EPISODES = 4  # of each random scene in a training's evaluations
LEAST_GAIN = 1e-4  # smallest gain of a search from which normalised scores are computed
SEARCH_SCORES = Path(__file__).with_name("searched.csv")  # scores of searches in the test sets


def evaluate(run: str | Path, scene: str | Scene | None = None, *, trust: bool = False) -> Rollout:
    """Build a layout with the best policy of a training, without noise on its actions.

    The extra "rl" is needed only for an archive.

    Parameters
    ----------
    run
        The folder of a training; the name of a shipped policy ("designer", or one of
        `agents.policy.policy_names`) or of a scripted policy such as "uniform", "plan" or "ramp";
        or an archive (.zip) of Stable-Baselines3 or sb3-contrib.
    scene
        The scene; None for the scene of the training. Its observations must have the size of those
        in training. Scripted policies, archives and policies trained on sampled scenes require one.
    trust
        If True, Stable-Baselines3 may load an archive, which runs the code in the archive. Not
        needed for plain multilayer perceptrons.

    Returns
    -------
    Rollout
        The layout with its wave, its score and the uniform baseline.

    Raises
    ------
    ValueError
        If `run` names no policy, if the scene is unknown, or required and not given, if the policy
        cannot build it, or if its observations have another size.

    Examples
    --------
    >>> from agents import evaluate
    >>> round(evaluate("sprint").score, 4)  # [m/s]
    0.8284
    """
    policy = load_policy(run, trust=trust)
    target = scene if isinstance(scene, Scene | None) else load_scene(scene)
    if isinstance(policy, ScenePolicy):
        return policy.build(target)
    if target is None:
        raise ValueError(f"policy '{run}' has no scene of its own: give one (--scene)")
    return policy.build(target)


def load_policy(
    run: str | Path, *, trust: bool = False, distribution: SceneDistribution | None = None
) -> ScenePolicy | Designer | ScriptedPolicy:
    """Load a policy, whose method `build` builds a layout for a scene.

    Parameters
    ----------
    run, trust
        See `evaluate`.
    distribution
        The scene distribution that the policy of an archive was trained on; None for a scene.

    Raises
    ------
    ValueError
        If `run` names no policy, or for the reasons of `agents.archives.load_archive`.
    """
    if str(run) in SCRIPTED:
        return ScriptedPolicy(str(run))
    folder = find_folder(run)
    if not folder.exists():
        others = "the existing folder of a training", "an existing archive (.zip)"
        require_choice("policy", str(run), (*SCRIPTED, DESIGNER, *policy_names(), *others))
    if folder.suffix == ".zip":
        return load_archive(folder, trust, distribution)
    if folder == POLICIES / DESIGNER:
        return shipped_designer()
    return ScenePolicy.load(folder)


def agent(run: str) -> Method:
    """Return the search method `agent:RUN`, which evaluates the layout of a policy.

    The time of the training counts as time of the search.

    Parameters
    ----------
    run
        See `evaluate`.

    Raises
    ------
    ValueError
        If `run` names no policy.
    """
    policy = load_policy(run)
    seconds = read_summary(find_folder(run)).get("seconds", 0.0)

    def method(evaluator: Evaluator, rng: np.random.Generator) -> None:
        evaluator.add_seconds(seconds)
        layout = policy.build(evaluator.problem.scene).layout
        evaluator.evaluate(evaluator.problem.design(layout))

    return method


def evaluate_gains(
    policy: Policy,
    distribution: SceneDistribution,
    scenes: Sequence[Scene],
    episodes: int = EPISODES,
    first_seed: int = SELECTION_SEEDS[0],
) -> Floats:
    """Return the gains of the layouts that a policy builds in a batch of scenes.

    In random scenes, they are those of mean scores over episodes.

    Parameters
    ----------
    policy
        Maps observations (S, O) to actions (S, A).
    distribution
        The scene distribution of the training.
    scenes
        S scenes of this distribution; their sampled numbers may be outside its ranges.
    episodes
        Number of episodes in each scene, if they are random.
    first_seed
        Seed of the first of these episodes; the others have the seeds after it, so that scenes do
        not share what is random.

    Returns
    -------
    ndarray
        (S,) gains over the uniform baselines; at most -1 if the wave stops.
    """
    if not is_random(distribution):
        env, options = DominoChainVector(len(scenes), distribution), {"scene": list(scenes)}
        return np.array(last_infos(policy, env, "gain", options=options))
    options = {"scene": [scene for scene in scenes for _ in range(episodes)]}
    env = DominoChainVector(len(options["scene"]), distribution)
    scores = last_infos(policy, env, "score", seed=first_seed, options=options)
    means = np.reshape(scores, (-1, episodes)).mean(axis=1)
    return gains_over(scenes, means, np.array([scene.uniform().score for scene in scenes]))


def read_search_scores(name: str, number: int) -> Floats | None:
    """Return the scores of `search(scene, budget=2500, seed=1)` in the first scenes of a test set.

    Parameters
    ----------
    name
        Name of the test set.
    number
        Number of scenes.

    Returns
    -------
    ndarray or None
        (number,) scores [m/s], nan for a scene without a search; None if no scene has a search.
    """
    scores = np.full(number, np.nan)
    with SEARCH_SCORES.open(newline="", encoding="utf-8") as lines:
        for line in csv.DictReader(lines):
            if line["set"] == name and int(line["scene"]) < number:
                scores[int(line["scene"])] = float(line["score"])
    return scores if np.isfinite(scores).any() else None


@dataclass(frozen=True, eq=False)
class ScenesEvaluation:
    """Scores of a policy, of the uniform baselines and, if known, of searches in S scenes.

    Attributes
    ----------
    scenes
        The scenes.
    uniform
        (S,) scores of the uniform baselines.
    scores
        (S,) scores by name: "policy"; for the designer also "proposal", the layouts of its networks
        without gradient steps; and if searches are known "search", nan in scenes without one.
    seconds
        (S,) processor times by the same names, without "search" [s].
    """

    scenes: Sequence[Scene]
    uniform: Floats
    scores: dict[str, Floats]
    seconds: dict[str, Floats]

    def table(self) -> str:
        """Return a table in Markdown, with one line per name in `scores`."""
        names = (
            "layout", "beats the uniform baseline", "median gain", "10th percentile", "worst",
            "median normalised score", "10th percentile", "median time", "longest",
        )  # fmt: skip
        return "\n".join(markdown_table(names, map(self._line, self.scores)))

    def _line(self, name: str) -> tuple[str, ...]:
        """Return the cells of a line; in normalised scores the best known is that of searches."""
        scores = self.scores[name]
        gains = self.gains(name)
        gains = gains[np.isfinite(gains)]
        stops = int(np.sum(scores <= 0.0))
        normalised, times = ["", ""], ["", ""]
        if "search" in self.scores:
            best_known = self.gains("search")
            has_gain = best_known > LEAST_GAIN  # nan compares as False
            quotients = self.gains(name)[has_gain] / best_known[has_gain]
            if has_gain.any():
                normalised = [f"{np.quantile(quotients, q):.1%}" for q in (0.5, 0.1)]
        if name in self.seconds:
            seconds = 1e3 * self.seconds[name]
            times = [f"{np.median(seconds):.1f} ms", f"{seconds.max():.1f} ms"]
        return (
            name, f"{np.mean(gains > SAME_GAIN):.1%} of {len(gains)}", f"{np.median(gains):+z.2%}",
            f"{np.quantile(gains, 0.1):+z.2%}",
            f"{stops} stop" if stops else f"{gains.min():+z.2%}", *normalised, *times,
        )  # fmt: skip

    def gains(self, name: str = "policy") -> Floats:
        """Return the gains (S,) over the uniform baselines; at most -1 if a wave stops."""
        return gains_over(self.scenes, self.scores[name], self.uniform)


def gains_over(scenes: Sequence[Scene], scores: Floats, uniform: Floats) -> Floats:
    """Return the gains (S,) of scores over those of uniform baselines; at most -1 of failures."""
    gains = scenes[0].criterion.gain(np.maximum(scores, 0.0), uniform)
    return np.where(scores > 0.0, gains, scores / uniform - 1.0)


def choose_scenes(
    distribution: str | Path | SceneDistribution, number: int | None = None, seed: int | None = None
) -> list[Scene]:
    """Return scenes for an evaluation, from a shipped test set or sampled.

    Parameters
    ----------
    distribution
        A scene distribution, the name of a shipped one, or the path of its file.
    number
        Number of scenes; None for the whole test set. Required with a seed.
    seed
        Seed of the sampled scenes; None for the first scenes of the test set.

    Raises
    ------
    ValueError
        If a number is out of range, if `seed` is None and the distribution has no test set, or for
        the reasons of `load_distribution`.
    """
    require("scenes", number, 1, whole=True, optional=seed is None)
    if not isinstance(distribution, SceneDistribution):
        distribution = load_distribution(distribution)
    if seed is not None:
        require("seed", seed, 0, whole=True)
        rng = np.random.default_rng(seed)
        return [distribution.sample(rng) for _ in range(number or 0)]
    name = distribution.name
    if not has_test_set(distribution):
        raise ValueError(f"'{name}' has no test set: sample scenes with --seed N --scenes N")
    tests = load_test_set(name)
    hint = f"the test set of {name}; others are sampled with a seed (--seed)"
    require("scenes", number, high=len(tests), hint=hint, whole=True, optional=True)
    return tests[:number]


def has_test_set(distribution: SceneDistribution) -> bool:
    """Return True for a scene distribution of the package."""
    name = distribution.name
    return name in distribution_names() and load_distribution(name) == distribution


def evaluate_scenes(
    scenes: Sequence[Scene],
    policy: ScenePolicy | Designer | ScriptedPolicy | None = None,
    search_scores: Floats | None = None,
    *,
    progress: bool | None = False,
) -> ScenesEvaluation:
    """Build a layout for each scene and compare its score with that of the uniform baseline.

    Parameters
    ----------
    scenes
        One or more scenes.
    policy
        The designer, a policy trained on sampled scenes, or a scripted policy; None for the shipped
        designer.
    search_scores
        (S,) scores of searches for comparison, nan for a scene without one; None if there are
        none.
    progress
        If True, a progress bar is shown; None for a bar on a terminal and lines elsewhere.

    Returns
    -------
    ScenesEvaluation
        Scores and processor times in each scene.

    Raises
    ------
    ValueError
        If the policy cannot build a layout for one of the scenes.
    """
    builder = policy or shipped_designer()
    scorers: dict[str, Callable[[Scene], float]]
    scorers = {"policy": lambda scene: builder.build(scene).score}
    if isinstance(builder, Designer):
        scorers = {
            "policy": lambda scene: builder.design(scene).score,
            "proposal": lambda scene: builder.design(scene, steps=0).score,
        }
    compile_simulations(scenes[0], gradients=True, episodes=True)
    scorers["policy"](scenes[0])  # not timed, as the first call loads data
    uniform = np.empty(len(scenes))
    scores = {name: np.empty(len(scenes)) for name in scorers}
    seconds = {name: np.empty(len(scenes)) for name in scorers}
    for i, scene in enumerate(progress_bar(progress, iterable=scenes, unit=" scenes")):
        uniform[i] = SCRIPTED["uniform"](scene).uniform.score  # not timed
        for name, score in scorers.items():
            start = time.process_time()
            scores[name][i] = score(scene)
            seconds[name][i] = time.process_time() - start
    if search_scores is not None and len(search_scores) != len(scenes):
        raise ValueError(f"{len(search_scores)} search_scores: give one for each of the scenes")
    if search_scores is not None and np.isfinite(search_scores).any():
        scores["search"] = search_scores
    return ScenesEvaluation(scenes, uniform, scores, seconds)
