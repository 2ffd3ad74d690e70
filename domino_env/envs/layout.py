"""DominoLayout-v1: a whole layout as one action, single or in a vector environment."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode

from domino_env.core.projection import nearest_with_sum
from domino_env.core.threads import share_evenly
from domino_env.core.types import Bools, Floats, Singles
from domino_env.envs.sources import Generators, SceneLike, SceneSource
from domino_env.envs.spaces import action_entries
from domino_env.envs.vector import RTOL, DominoEnv, DominoVectorEnv, Infos
from domino_env.kernels.step.batch import EPISODE, RUNNING
from domino_env.kernels.step.environment import place_batch
from domino_env.scenes.scene import Scene

SHARE = 16  # environments per thread at least


class DominoLayout(DominoEnv):
    """A whole layout as one action: for bandits and black-box search.

    ## Description
    Scenes and scores are those of `DominoChain-v1`; an episode is one step.

    ## Action space
    `Box(-1, 1, (A,), float32)`: one entry for each of the N - 1 gaps, then for each of the N - 1
    thicknesses (of dominoes 1 … N - 1), then for each of their growths, as far as the scene leaves
    them free. -1 is the smallest and 1 the largest value; other actions are clipped. If the scene
    has a total length, the layout is the nearest one (in metres) that has it. Other rules narrow
    the bounds from the first domino to the last, as in `DominoChain-v1`. If pieces are drawn in
    random order, each thickness of the action is replaced by the nearest in hand.

    ## Observation space
    `Box(0, 1, (1,), float32)`: 0 before the layout is placed, 1 after.

    ## Rewards
    100 times the gain, as the return of `DominoChain-v1`. On a floor
    the layout is simulated free-standing, some 130 ms of one core with forty dominoes.

    ## Starting state, episode end, info
    The first domino alone; every step ends its episode. `info` has `score`, `gain`, `outcome`,
    `layout`, `wave`, as in `DominoChain-v1`.

    ## Version history
    - v1: the reward of a wave that stops is 100 (score - 1).
    - v0: first version.

    Parameters
    ----------
    scene
        See `DominoChain`.
    render_mode
        See `DominoChain`.
    rtol
        See `DominoChain`.
    """

    def __init__(
        self, scene: SceneLike = "sprint", render_mode: str | None = None, rtol: float = RTOL
    ) -> None:
        super().__init__(DominoLayoutVector(1, scene, None, rtol), render_mode)


class DominoLayoutVector(DominoVectorEnv):
    """Vector environment of `DominoLayout`, bitwise equal to single ones; one simulation call.

    Infos, seeds and the option "reset_mask" are those of `DominoChainVector`.

    Parameters
    ----------
    num_envs
        B, the number of environments.
    scene
        See `DominoLayout`.
    render_mode
        None, "rgb_array" or "ansi".
    rtol
        See `DominoLayout`.
    autoreset_mode
        See `DominoChainVector`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scene: SceneLike = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        source = SceneSource(scene, num_envs, rtol, window=0)
        super().__init__(num_envs, source, render_mode, autoreset_mode)
        if self.distribution is not None:
            raise ValueError(
                f"'{self.distribution.name}' samples a scene for every episode, and the length of "
                "an action would change with its number of dominoes: use DominoChain-v1"
            )
        first = self.source.first
        self._batch.rules["length"] = 0.0  # a projection of the whole layout meets it
        entries = action_entries(first) * (first.count - 1)
        self._set_spaces(entries, Box(0.0, 1.0, (1,), np.float32))

    def begin(
        self, mask: Bools, observations: Singles, generators: Generators, **options: Any
    ) -> Infos:
        """Begin episodes in some environments; see `DominoVectorEnv.begin`."""
        self._episodes[mask] = np.zeros(1, EPISODE)
        self._episodes["phase"][mask] = RUNNING
        self._batch.states["u"][mask] = self.source.first.physics.push**2
        self._batch.states["time"][mask] = 0.0
        self._waves[mask] = None
        self._randomise(np.flatnonzero(mask), generators, {})
        observations[mask] = 0.0
        return {}

    def advance(self, actions: Floats) -> tuple[Singles, Floats, Bools, Infos]:
        """Place all dominoes and simulate them; see `DominoVectorEnv.advance`."""
        observations, scene = np.ones(self._observations.shape, np.float32), self.source.first
        rewards, ended = np.zeros(self.num_envs), self._episodes["phase"] == RUNNING
        envs = np.flatnonzero(ended)
        if not len(envs):
            return observations, rewards, ended, {}
        parts = actions.reshape(self.num_envs, action_entries(scene), -1).transpose(0, 2, 1)
        parts = np.ascontiguousarray(parts)
        share_evenly(place_batch, self.num_envs, SHARE, self._batch, ended, parts)
        if scene.length is not None:
            self._meet_length(scene, scene.length)
        rewards[envs], infos = self._end(envs)
        return observations, rewards, ended, infos

    def _meet_length(self, scene: Scene, length: float) -> None:
        """Project the layouts onto those of a total length."""
        spacing, thickness, pairs = self._batch.spacing, self._batch.thickness, scene.count - 1
        free = [(spacing, scene.spacing)] * scene.free_spacing
        free += [(thickness[:, 1:], scene.thickness)] * scene.free_thickness
        fixed = scene.spacing[0] * (not scene.free_spacing)
        fixed += scene.thickness[0] * (not scene.free_thickness)
        parts = [part for part, _ in free]
        low, high = np.repeat([bounds for _, bounds in free], pairs, axis=0).T
        projected = nearest_with_sum(np.hstack(parts), low, high, length - pairs * fixed)
        for part, values in zip(parts, np.split(projected, len(parts), axis=1), strict=True):
            part[:] = values
