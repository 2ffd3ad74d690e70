"""Builders that learn: reinforcement-learning baselines on the scenes of `domino_env`.

    from agents import train, evaluate
    run = train("sprint", algorithm="ppo", steps=2_000_000, seed=0, folder="runs/ppo")
    evaluate(run.folder).score
    design(scene).layout  # of a new scene, in milliseconds, by a policy that ships

They build with the environment DominoChain-v0; the scene's score counts, as in every search.
Importing this loads no torch; learning needs the extra: pip install "domino-chains[rl]".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from domino_env.core.lazy import lazy_names

if TYPE_CHECKING:
    from agents.base.building import Built
    from agents.conditioned.designing import design
    from agents.conditioned.policy import Design
    from agents.evaluation.one_scene import evaluate
    from agents.sb3.vec_env import DominoVecEnv
    from agents.single.drawn import train_drawn
    from agents.single.result import Run
    from agents.single.training import train

__all__ = ["Built", "Design", "DominoVecEnv", "Run", "design", "evaluate", "train", "train_drawn"]

__getattr__, __dir__ = lazy_names(
    __name__,
    {
        "Design": "conditioned.policy",
        "design": "conditioned.designing",
        "Built": "base.building",
        "DominoVecEnv": "sb3.vec_env",
        "evaluate": "evaluation.one_scene",
        "Run": "single.result",
        "train": "single.training",
        "train_drawn": "single.drawn",
    },
)
