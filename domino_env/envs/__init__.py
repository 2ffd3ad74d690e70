"""Gymnasium environments whose actions choose the layout of a chain.

    chain      DominoChain-v2: one domino per step
    layout     DominoLayout-v2: a whole layout per step
    vector     base classes: batches of environments, and a single one as a batch of one
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
    for module, name in (("chain", "DominoChain"), ("layout", "DominoLayout")):
        if f"{name}-v2" not in gymnasium.registry:
            gymnasium.register(
                id=f"{name}-v2",
                entry_point=f"domino_env.envs.{module}:{name}",
                vector_entry_point=f"domino_env.envs.{module}:{name}Vector",
                reward_threshold=0.0,  # a gain of 0 %: the uniform baseline
            )
