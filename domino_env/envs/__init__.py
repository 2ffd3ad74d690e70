"""Gymnasium environments whose actions choose the layout of a chain.

    vector     DominoChain-v2 as a vector environment: one domino per step
    chain      the same as a single environment, a batch of one
    layout     DominoLayout-v2, single and vector: a whole layout per step
    arguments  scenes as arguments, and specifications that can be written as JSON
    spaces     names and bounds of observations, number of entries of an action
    sources    scenes of episodes: always the same one, or one sampled at every reset
    episodes   results of episodes: score, return, and an info with layout and wave
    rendering  frames

This module registers names only; the others are imported when an environment is made.
"""

from __future__ import annotations

import gymnasium


def register() -> None:
    """Add the environments to Gymnasium's registry, unless they are in it."""
    for name, single, vector in (
        ("DominoChain", "chain", "vector"),
        ("DominoLayout", "layout", "layout"),
    ):
        if f"{name}-v2" not in gymnasium.registry:
            gymnasium.register(
                id=f"{name}-v2",
                entry_point=f"domino_env.envs.{single}:{name}",
                vector_entry_point=f"domino_env.envs.{vector}:{name}Vector",
                reward_threshold=1.6,  # [%] half of the best known gain on `sprint`, the default
            )
