"""Scripted policies: baselines for the trained ones, evaluated in the same way."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from agents.rollout import Rollout, as_placed, build
from domino_env import DominoChain
from domino_env.core.types import Floats
from domino_env.scenes.scene import Scene

TRIED = 41  # actions that the greedy policy tries for each free number
SAMPLES = 4000  # ramps tried


def uniform(scene: Scene) -> Rollout:
    """Build the uniform baseline."""
    row = scene.uniform()
    return Rollout(scene, row.layout, row.wave, row.score, row, 0.0)


def greedy(scene: Scene) -> Rollout:
    """Place each domino where the reward of this step is largest, by simulation of one interval."""
    env = DominoChain(scene)
    began = time.perf_counter()
    size = env.action_space.shape[0]  # type: ignore[index]
    line = np.linspace(-1.0, 1.0, TRIED if size == 1 else 11)
    actions = np.stack(np.meshgrid(*[line] * size, indexing="ij"), axis=-1).reshape(-1, size)
    chosen: list[NDArray[np.float32]] = []
    env.reset()
    terminated = False
    while not terminated:
        rewards = []
        for action in actions:
            trial = copy.deepcopy(env)
            rewards.append(trial.step(action.astype(np.float32))[1])
        chosen.append(actions[int(np.argmax(rewards))].astype(np.float32))
        terminated = env.step(chosen[-1])[2]
    steps = iter(chosen)
    built = build(lambda _: next(steps), scene)
    return replace(built, seconds=time.perf_counter() - began)


def ramp(scene: Scene) -> Rollout:
    """Build a ramp, a plateau, a ramp: four numbers, the best of some thousand choices.

    First value, plateau, last value, and the part of the row that each ramp takes; where both gaps
    and thicknesses are free, the thickness is one number more, the same for all.
    """
    baseline = scene.uniform()
    began = time.perf_counter()
    rng = np.random.default_rng(0)
    best = rng.random((SAMPLES // 2, 5))
    best = best[np.argsort(-_ramp_scores(scene, best))[:20]]
    for width in (0.1, 0.03, 0.01):  # closer and closer around the best
        centres = best[rng.integers(20, size=SAMPLES // 6)]
        around = np.clip(centres + width * rng.standard_normal(centres.shape), 0.0, 1.0)
        pool = np.concatenate([best, around])
        best = pool[np.argsort(-_ramp_scores(scene, pool))[:20]]
    gaps, thick = _ramps(scene, best[:1])
    layout = scene.layout(gaps[0], None if thick is None else thick[0])
    wave = scene.simulate(layout)
    seconds = time.perf_counter() - began
    return Rollout(scene, layout, wave, scene.score(wave), baseline, seconds)


def _ramp_scores(scene: Scene, numbers: Floats) -> Floats:
    gaps, thick = _ramps(scene, numbers)
    if scene.length is not None:
        pitch = gaps + (scene.thickness[0] if thick is None else thick)
        off = np.abs(pitch.sum(axis=1) - scene.length)
        return np.where(off < 1e-9, scene.evaluate(scene.batch(gaps, thick)).score, -2.0 - off)
    return np.asarray(scene.evaluate(scene.batch(gaps, thick)).score)


def _ramps(scene: Scene, numbers: Floats) -> tuple[Floats, Floats | None]:
    """Gaps (B, N-1) and thicknesses of B choices of five numbers in [0, 1]."""
    place = np.linspace(0.0, 1.0, scene.count - 1)[None]
    first, plateau, last, part, thickness = (numbers[:, i : i + 1] for i in range(5))
    part = 0.02 + 0.48 * part
    up = np.clip(1.0 - place / part, 0.0, 1.0)
    down = np.clip(1.0 - (1.0 - place) / part, 0.0, 1.0)
    share = plateau + (first - plateau) * up + (last - plateau) * down
    low, high = scene.spacing
    gaps = low + share * (high - low)
    thick = None
    if scene.free_thickness:
        low, high = scene.thickness
        thick = low + np.broadcast_to(thickness, gaps.shape) * (high - low)
    if scene.length is not None:  # the nearest row of that length, all gaps moved alike
        taken = (scene.count - 1) * scene.thickness[0] if thick is None else thick.sum(1)
        for _ in range(50):
            gaps = gaps + ((scene.length - taken - gaps.sum(axis=1)) / gaps.shape[1])[:, None]
            gaps = np.clip(gaps, *scene.spacing)
    return gaps, thick


SCRIPTED: dict[str, Callable[[Scene], Rollout]] = {
    policy.__name__: policy for policy in (uniform, greedy, ramp)
}


@dataclass(frozen=True)
class ScriptedPolicy:
    """One of `SCRIPTED`, by name."""

    name: str

    def build(self, scene: Scene | None) -> Rollout:
        """Build a layout; ValueError where no scene is named."""
        if scene is None:
            raise ValueError(f"{self.name} was trained on no scene: name one to build for")
        if self.name == "greedy" and scene.placement_deviation:
            raise ValueError(
                f"scene '{scene.name}' has placement noise: greedy tries each domino in a copy of "
                "the chain, which draws the same error, so that it would know it beforehand"
            )
        return as_placed(SCRIPTED[self.name](scene))
