"""The Gymnasium environments: a row that is built while its wave runs through it.

    base          what single environments share: a scene, frames on demand, checks of what is given
    chain_env     DominoChain-v0, a domino a step
    layout_env    DominoLayout-v0, a whole row as one action
    vector_env    both for many rows at once
    episodes      the rows that they stand on, B of them, single ones with B = 1
    endings       the end of an episode: score, gain, outcome, layout, wave
    snapshot      a row at the latest hit, of which a frame is drawn
    render, bench frames; steps against the clock

Only their names are told to Gymnasium here; they are loaded when one is made.
"""

from __future__ import annotations

import gymnasium


def register() -> None:
    """Add the environments to Gymnasium's registry, once."""
    for name, single, vector in (
        ("DominoChain-v0", "chain_env:DominoChain", "vector_env:DominoChainVector"),
        ("DominoLayout-v0", "layout_env:DominoLayout", None),
    ):
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point=f"domino_env.envs.{single}",
                vector_entry_point=vector and f"domino_env.envs.{vector}",
            )
