"""The Gymnasium environments: a row that is built while its wave runs through it.

    chain_env     DominoChain-v0, a domino a step, alone and many at once
    layout_env    DominoLayout-v0, a whole row as one action, alone and many at once
    base, vector  what single environments share, and those of many rows
    episodes      the rows of a DominoChain, single ones and many: beginning, stepping, looking
    endings       the end of an episode: score, return, and an info with layout and wave
    problems      the scenes that rows are built in: always the same, or drawn at every reset
    arrays        what B rows live in
    observation   what is observed
    snapshot      a row at the latest hit, of which a frame is drawn
    render        frames

Gymnasium learns only their names here; they are loaded when one is made.
"""

from __future__ import annotations

import gymnasium


def register() -> None:
    """Add the environments to Gymnasium's registry, once."""
    for name, single, vector in (
        ("DominoChain-v0", "chain_env:DominoChain", "chain_env:DominoChainVector"),
        ("DominoLayout-v0", "layout_env:DominoLayout", "layout_env:DominoLayoutVector"),
    ):
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point=f"domino_env.envs.{single}",
                vector_entry_point=f"domino_env.envs.{vector}",
                reward_threshold=0.0,  # per cent above the best uniform row, whatever the scene
            )
