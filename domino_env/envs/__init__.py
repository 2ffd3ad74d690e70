"""Gymnasium environments whose actions choose the layout of a chain.

    vector     DominoChain-v2 as a vector environment: one domino per step
    chain      the same as a single environment, a batch of one
    layout     DominoLayout-v2, single and vector: a whole layout per step
    arguments  scenes as arguments, and specifications that can be written as JSON
    spaces     names and bounds of observations, number of entries of an action
    catalogue  scenes of episodes: always the same one, or one sampled at every reset
    batch      arrays of these scenes and of a batch of environments, for the kernels
    baselines  uniform baselines of the scenes
    episodes   results of episodes: score, return, and an info with layout and wave
    rendering  frames

This module has the table of environments; the others are imported when an environment is made.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium


class Environment(NamedTuple):
    """Environment of Gymnasium, with a single and a vector version.

    Attributes
    ----------
    id
        Name in Gymnasium's registry.
    single, vector
        Names of the classes, `module:class` in this folder. The vector version has the methods of
        `DominoChainVector`, of which `step` begins the next episode and `advance` does not.
    """

    id: str
    single: str
    vector: str

    def make(self, scene: Any, **options: Any) -> Any:
        """Return a single environment."""
        return self._load(self.single)(scene, **options)

    def make_vec(self, num_envs: int, scene: Any, **options: Any) -> Any:
        """Return a vector environment."""
        return self._load(self.vector)(num_envs, scene, **options)

    @staticmethod
    def _load(name: str) -> Any:
        """Import a class of this folder."""
        from pkgutil import resolve_name

        return resolve_name(f"{__name__}.{name}")


CHAIN = Environment("DominoChain-v2", "chain:DominoChain", "vector:DominoChainVector")
LAYOUT = Environment("DominoLayout-v2", "layout:DominoLayout", "layout:DominoLayoutVector")
ENVIRONMENTS = {entry.id: entry for entry in (CHAIN, LAYOUT)}
"""All environments by name."""


def register() -> None:
    """Add the environments to Gymnasium's registry, unless they are in it."""
    for name, entry in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(
                id=name,
                entry_point=f"{__name__}.{entry.single}",
                vector_entry_point=f"{__name__}.{entry.vector}",
                reward_threshold=1.6,  # [%] half of the best known gain on `sprint`, the default
            )
