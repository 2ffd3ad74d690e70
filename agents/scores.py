"""Scores of a policy along its training, in one scene or in scenes of a distribution."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from agents.evaluation import gains_of
from agents.network import Policy
from agents.policy import BUILT
from agents.rollout import build
from domino_env import Scene, SceneDistribution
from domino_env.core.files import write_text
from domino_env.scenes.pool import ScenePool

POOL_SCENES = 50  # of the pool of a distribution


class SceneScore:
    """Score of the layout that a policy builds for the one scene of a training."""

    def __init__(self, scene: Scene, folder: Path) -> None:
        self.scene, self.folder = scene, folder

    def __call__(self, policy: Policy, reference_speed: float) -> float:
        """Evaluate a policy without noise."""
        self.rollout, self.speed = build(policy, self.scene, reference_speed), reference_speed
        return self.rollout.score

    def keep(self, steps: int, seconds: float) -> None:
        """Write what the policy of the last evaluation built; it is the best so far."""
        built, uniform_speed = self.rollout, self.scene.uniform().wave.mean_speed
        reference = self.speed / uniform_speed if uniform_speed > 0.0 else 1.0
        document = {
            "score": built.score,
            "gain": built.gain,
            "steps": steps,
            "seconds": seconds,
            "reference_over_uniform": reference,
        }
        write_text(self.folder / BUILT, json.dumps(document, indent=1) + "\n")
        built.layout.to_csv(self.folder / "layout.csv")
        built.layout.to_json(self.folder / "layout.json")


class PoolScore:
    """Median gain over the uniform baselines, in scenes of a distribution's pool."""

    def __init__(self, distribution: SceneDistribution) -> None:
        self.distribution = distribution
        pool = ScenePool(distribution)
        self.scenes = [pool.scene(len(pool) - 1 - i) for i in range(POOL_SCENES)]

    def __call__(self, policy: Policy, reference_speed: float) -> float:
        """Evaluate a policy without noise."""
        return float(np.median(gains_of(policy, self.distribution, self.scenes)))

    def keep(self, steps: int, seconds: float) -> None:
        """Keep nothing: the weights say all."""
