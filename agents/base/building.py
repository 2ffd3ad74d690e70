"""Building: the row that a policy builds for a scene, and what the scene gives for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env import DominoChain, Layout, Scene, UniformMark, Wave
from domino_env.scenes.baseline import gain
from domino_env.view.shown import MadeForScene
from optimize.searching.compiling import compile_for

Observation = NDArray[np.float32]
Policy = Callable[[Observation], NDArray[Any]]


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
        What the scene gives for it.
    uniform
        The best uniform row, the baseline.
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


def build(policy: Policy, scene: Scene, reference_speed: float | None = None) -> Built:
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
    """
    uniform = scene.uniform()
    compile_for(scene, episodes=True)
    env = DominoChain(scene, reference_speed=reference_speed)
    began = time.perf_counter()
    observation, _ = env.reset()
    terminated, info = False, dict[str, Any]()
    while not terminated:
        observation, _, terminated, _, info = env.step(policy(observation))
    layout = completed(info["layout"], scene)
    seconds = time.perf_counter() - began
    wave = scene.simulate(layout)
    return Built(scene, layout, wave, scene.score_wave(wave), uniform, seconds)


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
