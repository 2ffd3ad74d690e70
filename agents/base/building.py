"""Building: the row that a policy builds for a scene, and what the scene gives for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env import DominoChain, Layout, Scene, SceneDistribution, UniformMark, Wave
from domino_env.scenes.baseline import gain
from domino_env.view.notebook import MadeForScene
from optimize.compiling import compile_for

Observation = NDArray[np.float32]
Policy = Callable[[Observation], NDArray[Any]]

HANDS = 64  # rows that an unsteady hand places, with the errors of seeds 0, 1, …


@dataclass(frozen=True, eq=False)
class Built(MadeForScene):
    """A row that a policy built, beside the best uniform one.

    Attributes
    ----------
    scene
        What it was built for.
    layout
        The row.
    wave
        Its wave, simulated closely.
    score
        What the scene gives for it; where the hand is unsteady, the mean over `HANDS` rows that the
        policy built, of which this is the first.
    uniform
        The best uniform row, the baseline; where the hand is unsteady, with its mean score over
        the same errors.
    seconds
        Time that building took, without the simulation of the baseline.
    """

    scene: Scene
    layout: Layout
    wave: Wave
    score: float
    uniform: UniformMark
    seconds: float

    @property
    def gain(self) -> float | None:
        """Score over the uniform one, minus 1; None where one of the two rows does not run."""
        return gain(self.score, self.uniform.score)

    def __repr__(self) -> str:
        return f"Built({self.scene.name}: {self.scene.against_uniform(self.score, self.wave)})"


def build(
    policy: Policy,
    scene: Scene,
    reference_speed: float | None = None,
    *,
    drawn_from: SceneDistribution | None = None,
) -> Built:
    """Let a policy build one row, domino by domino.

    A row that dies on the way is completed with what the policy would have placed last, so that it
    can be shown; its score is that of the wave that died.

    Parameters
    ----------
    policy
        Maps an observation to an action.
    scene
        What is built.
    reference_speed
        Speed that single steps are rewarded against [m/s]; None for that of the best uniform row.
    drawn_from
        What the policy was trained on, where that was no single scene: then it observes which this
        is.
    """
    uniform = scene.uniform()
    compile_for(scene, episodes=True)
    env = DominoChain(drawn_from or scene, reference_speed=reference_speed)
    began = time.perf_counter()
    options = None if drawn_from is None else {"scene": scene}
    layout = completed(_episode(env, policy, 0, options)["layout"], scene)
    seconds = time.perf_counter() - began
    wave = scene.simulate(layout)
    score = scene.score(wave)
    if scene.placement_deviation:
        others = [_episode(env, policy, seed, options)["score"] for seed in range(1, HANDS)]
        score, uniform = float(np.mean([score, *others])), _uniform_as_placed(scene)
    return Built(scene, layout, wave, score, uniform, seconds)


def _episode(
    env: DominoChain, policy: Policy, seed: int, options: dict[str, Any] | None
) -> dict[str, Any]:
    """The last info of an episode."""
    observation, _ = env.reset(seed=seed, options=options)
    terminated, info = False, dict[str, Any]()
    while not terminated:
        observation, _, terminated, _, info = env.step(policy(observation))
    return info


def as_placed(built: Built) -> Built:
    """Give a row that was planned beforehand its mean score as an unsteady hand places it."""
    scene = built.scene
    if not scene.placement_deviation:
        return built
    score = float(scene.score_placed(built.layout, range(HANDS)).mean())
    return replace(built, score=score, uniform=_uniform_as_placed(scene))


def _uniform_as_placed(scene: Scene) -> UniformMark:
    mark = scene.uniform()
    return replace(mark, score=float(scene.score_placed(mark.layout, range(HANDS)).mean()))


def completed(layout: Layout, scene: Scene) -> Layout:
    """Complete a row to all dominoes: what was not placed is as the last that was."""
    missing = scene.count - layout.count
    if missing == 0:
        return layout
    return Layout(
        np.concatenate([layout.spacing, np.full(missing, layout.spacing[-1])]),
        np.concatenate([layout.thickness, np.full(missing, layout.thickness[-1])]),
        scene.height,
        layout.width,
        scene.density,
    )
