"""Rollouts: layouts that policies build for scenes, and their scores."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from agents.network import Policy
from domino_env import DominoChainVector, Layout, Scene, SceneDistribution
from domino_env.core.types import Floats
from domino_env.envs import CHAIN, Environment
from domino_env.envs.spaces import check_actions
from domino_env.scenes.uniform import UniformBaseline
from domino_env.view.notebook import SceneResult

SELECTION_SEEDS = range(64)  # seeds on which plans and policies are selected
EVALUATION_SEEDS = range(10_000, 10_200)  # seeds of reported scores; no plan is fitted to them
SEEDS_PER_TRAINING = 10**6  # training with seed k uses those from (k + 1) times this number


@dataclass(frozen=True, eq=False, repr=False)
class Rollout(SceneResult):
    """A layout that a policy built, with its score and the uniform baseline.

    Attributes
    ----------
    scene
        The scene that the layout was built for.
    layout
        The layout of the first episode.
    wave
        Wave in the layout.
    score
        Score in the unit of the scene; under placement noise or with pieces in random order, the
        mean over episodes with `evaluation_seeds`.
    uniform
        The uniform baseline, `Scene.uniform()`. If it is scored without the placement errors of
        episodes, its score is the mean over the same seeds.
    seconds
        Time to build the layout [s], without the simulation of the baseline; see
        `domino_env.compiled`.
    simulations
        Number of layouts that were simulated to build it; without those to which a rule was fitted.
    """

    uniform: UniformBaseline
    seconds: float
    simulations: int = 1

    @property
    def gain(self) -> float | None:
        """Gain over the uniform baseline, see `Scene.gain`; None if one of the waves stops."""
        return self.scene.gain(self.score, self.uniform.score)

    @property
    def score_text(self) -> str:
        """The score, a mean if episodes are random, and its comparison with the baseline."""
        if not is_random(self.scene):
            return super().score_text
        criterion = self.scene.criterion
        comparison = criterion.compare(self.score, self.uniform.score, "uniform")
        return ", ".join(filter(None, (criterion.label(self.score), comparison)))


def build(
    policy: Policy,
    scene: Scene,
    *,
    distribution: SceneDistribution | None = None,
    seeds: range | None = None,
    environment: Environment = CHAIN,
) -> Rollout:
    """Build a layout with a policy.

    A layout whose wave stops is completed with copies of the domino placed last; its score is that
    of the wave that stops.

    Parameters
    ----------
    policy
        Function from an observation (O,) to an action (A,).
    scene
        The scene to build for.
    distribution
        The scene distribution that the policy was trained on, whose features it observes; None for
        a policy that was trained on a single scene.
    seeds
        Seeds of the episodes over which the score is the mean; None for `evaluation_seeds`.
    environment
        Environment of the policy.

    Returns
    -------
    Rollout
        The layout with its wave and score.
    """
    seeds = seeds or evaluation_seeds(scene)
    scene.uniform()  # not timed
    env = environment.make(distribution or scene)
    options = None if distribution is None else {"scene": scene}
    start = time.perf_counter()
    observation, _ = env.reset(seed=seeds[0], options=options)
    terminated = False
    while not terminated:
        observation, _, terminated, _, info = env.step(policy(observation))
    layout = complete_layout(info["layout"], scene)
    seconds = time.perf_counter() - start
    scores = None
    if len(seeds) > 1:
        scores = episode_scores(policy, scene, seeds, distribution, environment)
    return make_rollout(scene, layout, seconds, scores=scores, seeds=seeds)


def make_rollout(
    scene: Scene,
    layout: Layout,
    seconds: float = 0.0,
    simulations: int = 1,
    *,
    scores: Floats | None = None,
    seeds: range | None = None,
) -> Rollout:
    """Return the rollout of a layout.

    Parameters
    ----------
    scene
        The scene.
    layout
        The layout, of the first episode if they differ.
    seconds, simulations
        See `Rollout`.
    scores
        (S,) scores of episodes of the seeds, if a policy reacts to what is random; None for those
        of the layout.
    seeds
        Seeds over which scores are averaged; None for `evaluation_seeds`.
    """
    uniform, wave, seeds = scene.uniform(), scene.simulate(layout), seeds or evaluation_seeds(scene)
    score = scene.score(wave)
    if len(seeds) > 1:
        scores = scene.score_placed(layout, seeds) if scores is None else scores
        score = float(scores.mean())
        if not scene.hand and scene.scoring.placement is None:  # scored without placement errors
            mean = scene.score_placed(uniform.layout, seeds).mean()
            uniform = replace(uniform, score=float(mean))
    return Rollout(scene, layout, wave, score, uniform, seconds, simulations)


def episode_scores(
    policy: Policy,
    scene: Scene,
    seeds: Sequence[int],
    distribution: SceneDistribution | None = None,
    environment: Environment = CHAIN,
) -> Floats:
    """Return the scores of a policy in the episodes of given seeds, run as one batch.

    Parameters
    ----------
    policy
        Function from observations (S, O) to actions (S, A).
    scene
        The scene.
    seeds
        Seeds of the S episodes.
    distribution, environment
        See `build`.

    Returns
    -------
    ndarray
        (S,) scores in the unit of the scene.
    """
    env = environment.make_vec(len(seeds), distribution or scene)
    options = None if distribution is None else {"scene": scene}
    return np.array(last_infos(policy, env, "score", seed=list(seeds), options=options))


def last_infos(policy: Policy, env: DominoChainVector, key: str, **reset: Any) -> list[Any]:
    """Run one episode in each environment, and return one value of the last `info` of each.

    Parameters
    ----------
    policy
        Function from observations (B, O) to actions (B, A).
    env
        B environments.
    key
        Key of the value, such as "score".
    reset
        Arguments of `env.reset`, such as `seed`.

    Returns
    -------
    list
        B values.
    """
    observations, _ = env.reset(**reset)
    values: list[Any] = [None] * env.num_envs
    running = np.ones(env.num_envs, np.bool_)
    while running.any():
        actions = check_actions(policy(observations), env.action_space.shape)
        latest, _, ended, infos = env.advance(actions)  # `step` would begin other episodes
        for b, value in zip(np.flatnonzero(ended), infos.get(key, ()), strict=True):
            values[b] = value
        observations[running] = latest[running]
        running &= ~ended
    return values


def is_random(target: Scene | SceneDistribution) -> bool:
    """Return True if episodes in one scene differ, by placement noise or an order of pieces."""
    scene = target if isinstance(target, Scene) else target.first
    return len(evaluation_seeds(scene)) > 1


def evaluation_seeds(scene: Scene) -> range:
    """Return the seeds over which scores are averaged; one seed if the scene is deterministic."""
    return EVALUATION_SEEDS if scene.hand or scene.placement else range(1)


def complete_layout(layout: Layout, scene: Scene) -> Layout:
    """Return a layout with all dominoes of a scene, by copies of the last domino and its gap."""
    missing = scene.count - layout.count
    if missing == 0:
        return layout
    sizes = layout.spacing, layout.thickness[1:], layout.height[1:]
    spacing, thickness, height = (np.pad(size, (0, missing), mode="edge") for size in sizes)
    return scene.layout(spacing, thickness, height)
