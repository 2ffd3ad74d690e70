"""Scenes that a policy is trained on: pools of the distributions that ship."""

from __future__ import annotations

from collections.abc import Sequence

from domino_env import Scene
from domino_env.envs.problems import pool_of
from domino_env.scenes.distribution import load_distribution

DISTRIBUTIONS = ("varied", "varied-thickness", "varied-course")


class Pools:
    """Scenes of several distributions in turn, numbered.

    Parameters
    ----------
    names
        Of the distributions.
    """

    def __init__(self, names: Sequence[str] = DISTRIBUTIONS) -> None:
        self._pools = [pool_of(load_distribution(name)) for name in names]
        self._made: dict[int, Scene] = {}

    def __len__(self) -> int:
        return sum(len(pool) for pool in self._pools)

    def __getitem__(self, i: int) -> Scene:
        """Make scene i, which keeps its best uniform row."""
        if i not in self._made:
            number, which = divmod(i, len(self._pools))
            self._made[i] = self._pools[which].scene(number)
        return self._made[i]
