"""Builders that learn: reinforcement-learning baselines on the scenes of `domino_env`.

    from agents import train, evaluate
    run = train("sprint", algorithm="ppo", steps=2_000_000, seed=0, folder="runs/ppo")
    evaluate(run.folder).score
    design(scene).layout  # of a new scene, in milliseconds, by a policy that ships

They build with the environment DominoChain-v0; the scene's score counts, as in every search.
Importing this loads no torch; learning needs the extra: pip install "domino-chains[rl]".
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from agents.conditioned.policy import Design, design
    from agents.single.evaluation import Built, evaluate
    from agents.single.training import Run, train

_HOMES = {
    "train": "single.training",
    "Run": "single.training",
    "evaluate": "single.evaluation",
    "Built": "single.evaluation",
    "design": "conditioned.policy",
    "Design": "conditioned.policy",
}

__all__ = ["Built", "Design", "Run", "design", "evaluate", "train"]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'agents' has no attribute '{name}'")
    value = getattr(import_module(f"agents.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
