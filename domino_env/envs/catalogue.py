"""Catalogue of the scenes of episodes: always the same one, or one that every reset samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from domino_env.core.checks import require, require_choice
from domino_env.core.types import Floats, Ints
from domino_env.envs.arguments import SceneLike, as_scene
from domino_env.envs.spaces import action_entries
from domino_env.scenes.distribution import SceneDistribution
from domino_env.scenes.io.ranges import COUNT
from domino_env.scenes.pool import ScenePool
from domino_env.scenes.scene import Scene

Generators = Callable[[int], np.random.Generator]  # returns the generator of an environment

# pools of distributions, which all environments of this process share
shared_pool = lru_cache(maxsize=8)(ScenePool)
COUNT_FACTOR = 2  # largest count of a scene given to a reset, over the largest sampled count


class Catalogue:
    """Scenes of episodes by index: the fixed one, or the pool of a distribution and given ones.

    Parameters
    ----------
    scene
        Scene of all episodes, or distribution from which every reset samples one; see `as_scene`.
    num_envs
        B, the number of environments.
    num_scenes, first_scene, hide
        See `DominoChain`.

    Attributes
    ----------
    distribution
        The distribution; None if the scene is fixed.
    first
        The scene, or an example of the distribution.
    names, observed
        Names of the sampled numbers, and indices of those that are observed.
    pool
        P scenes of the distribution; None if the scene is fixed.
    indices
        Indices of the scenes that resets sample.
    size
        S, number of indices: P, and two of each environment for scenes given to resets, so that a
        reset that fails leaves the scene of the present episode; 1 if the scene is fixed.
    count, longest
        Largest number of dominoes of a scene that resets sample, and N, that of a scene given to
        one; without those of a run-out.
    longest_episode
        Number of steps of an episode, if its wave does not stop; None if it is sampled.

    Raises
    ------
    ValueError
        For a scene that leaves nothing free or has rules that need the whole layout, for a
        distribution with uneven ground, and for numbers out of range.
    """

    def __init__(
        self,
        scene: SceneLike,
        num_envs: int,
        num_scenes: int | None = None,
        first_scene: int = 0,
        hide: Sequence[str] = (),
    ) -> None:
        require("num_envs", num_envs, 1, whole=True)
        self.num_envs, scene = int(num_envs), as_scene(scene)
        self.distribution = scene if isinstance(scene, SceneDistribution) else None
        self.first = scene.first if isinstance(scene, SceneDistribution) else scene
        _check_scene(self.first, self.distribution is not None)
        self.names = () if self.distribution is None else self.distribution.features
        self.observed = _observed_indices(self.names, hide)
        self.pool, self.size, self.count = None, 1, self.first.count
        self.longest_episode: int | None = self.first.count - 1
        if self.distribution is not None:
            self.pool = shared_pool(self.distribution)
            self.size = len(self.pool) + 2 * self.num_envs
            if COUNT in self.distribution.ranges:
                self.longest_episode = None
                self.count = int(self.distribution.ranges[COUNT].max)
        self.longest = self.count * (1 if self.distribution is None else COUNT_FACTOR)
        size = len(self.pool or (0,))
        hint = f"scenes are numbered from 0 to {size - 1}" if size > 1 else "the scene is fixed"
        require("first_scene", first_scene, 0, size - 1, whole=True, hint=hint)
        most = size - first_scene
        require("num_scenes", num_scenes, 1, most, whole=True, hint=hint, optional=True)
        self.indices = range(size)[first_scene:][:num_scenes]

    def sample(self, generator: np.random.Generator) -> int:
        """Sample a scene and return its index; 0 if the scene is fixed."""
        if self.distribution is None:
            return 0
        return self.indices[int(len(self.indices) * generator.random())]

    def around(self, missing: Ints) -> list[int]:
        """Return indices of scenes to load with those that are missing.

        The more environments, the sooner all scenes are used; but computing a baseline that is not
        known takes long.
        """
        assert self.pool is not None
        blocks = np.unique(missing // self.num_envs)[:, None] * self.num_envs
        near = (blocks + np.arange(self.num_envs)).ravel()
        near = near[(near >= self.indices.start) & (near < self.indices.stop)]
        chosen: list[int] = np.union1d(missing, near[self.pool.is_known(near)]).tolist()
        return chosen

    def place(self, env: int, scene: Scene, present: int) -> tuple[int, Floats]:
        """Return the index for a scene given to one environment, and its sampled numbers, scaled.

        Parameters
        ----------
        env
            Index of the environment.
        scene
            The scene.
        present
            Index of the present scene of the environment, which another index is returned for.

        Raises
        ------
        ValueError
            For a scene that the distribution does not cover, or with too many dominoes.
        """
        assert self.distribution is not None
        numbers = self.distribution.numbers(scene)
        if scene.count > self.longest:
            raise ValueError(
                f"scene '{scene.name}' has {scene.count} dominoes: use at most {self.longest}, "
                f"{COUNT_FACTOR} times as many as '{self.distribution.name}' samples"
            )
        index = len(self.pool or ()) + 2 * env
        return index + (index == present), self.distribution.scale(numbers)


def _observed_indices(features: Sequence[str], hide: object) -> list[int]:
    """Return the indices of the features that are not hidden."""
    hidden = list(hide) if np.iterable(hide) and not isinstance(hide, str) else [hide]
    for name in hidden:
        if not features:
            raise ValueError(f"hide = '{name}': a fixed scene has no features; leave hide out")
        require_choice("hide", name, features)
    return [i for i, name in enumerate(features) if name not in hidden]


def _check_scene(scene: Scene, is_sampled: bool) -> None:
    """Raise a ValueError for a scene without free sizes, or whose rules need the whole layout."""
    is_uneven = scene.ground is not None and not scene.ground.is_even
    has_length, has_noise = scene.length is not None, scene.placement is not None
    instead = "leave one out, or search with `optimize`"
    for applies, reason in (
        (not action_entries(scene),
         "leaves nothing free to choose: give spacing or thickness a min and a max"),
        (has_noise and has_length,
         f"has [placement], and gaps with errors do not add up to its length: {instead}"),
        (has_noise and is_uneven,
         "has [placement], and gaps with errors may be so narrow that dominoes lean against each "
         f"other: {instead}"),
        (has_length and scene.stock is not None,
         "has a length and also a stock: an environment cannot compute after which actions the "
         f"length can still be met; {instead}"),
        (is_sampled and scene.ground is not None,
         "has uneven ground, which only a fixed scene may have: leave out [ground], or the ranges"),
    ):  # fmt: skip
        if applies:
            raise ValueError(f"scene '{scene.name}' {reason}")
