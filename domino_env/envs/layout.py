"""Environments in which one action is a whole layout: DominoLayout-v2, single and vector."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode

from domino_env.core.threads import share_evenly
from domino_env.core.types import Bools, Floats, Singles
from domino_env.envs.arguments import SceneLike
from domino_env.envs.catalogue import Generators
from domino_env.envs.chain import DominoEnv
from domino_env.envs.vector import RTOL, DominoChainVector, Infos
from domino_env.kernels.step.batch import BEGINNING, RUNNING
from domino_env.kernels.step.environment import place_batch

MIN_PER_THREAD = 16  # environments; placing them takes about as long as waking a thread


class DominoLayout(DominoEnv):
    """A chain of dominoes, placed by one action: for bandits and black-box search.

    ## Description
    Scenes and scores are those of `DominoChain-v2`; an episode is one step, which places the whole
    layout and simulates it.

    ## Action space
    `Box(-1, 1, (A,), float32)`: one entry for each of the N - 1 gaps, then for each of the N - 1
    thicknesses (of dominoes 1 … N - 1), then for each of their growths, as far as the scene leaves
    them free. With a stock, each kind of pieces, thin to thick, has N - 1 preferences in place of
    the thicknesses. The scale is that of `DominoChain-v2`: 0 is the uniform
    baseline, -1 the smallest and 1 the largest value; other actions are clipped. If the scene has a
    total length, the layout is the nearest one (in metres) of this length. Other rules narrow the
    bounds from the first domino to the last.

    ## Observation space
    `Box(0, 1, (1,), float32)`: 0 before the layout is placed, 1 after.

    ## Rewards
    The return of `DominoChain-v2` with an expected gain of 0: 100 times the gain for a score S of
    more than 0, otherwise 10 (S - 1), with an objective that does not reward steps, as "magnify",
    10 (S - 1) - 100. If the score of the uniform baseline is not more than 0, it is 100 times the
    gain. On a floor (`floor_friction`) the layout is simulated free-standing, which takes some
    0.2 s of one core in `table`, with forty dominoes, and several seconds for some layouts of
    random actions.

    ## Starting state
    Only the first domino is placed.

    ## Episode end
    An episode terminates after one step and is never truncated.

    ## Info
    Empty after a reset. After the step it has `score`, `gain`, `outcome`, `layout` and `wave`, as
    in `DominoChain-v2`.

    ## Version history
    - v2: actions and gains are those of `DominoChain-v2`; a wave that stops returns 10 (S - 1).
    - v1: the reward of a wave that stops is 100 (score - 1).
    - v0: first version.

    Parameters
    ----------
    scene
        See `DominoChain`.
        Scene distributions are rejected, as the size of the action is that of the layout.
    render_mode
        See `DominoChain`.
    rtol
        See `DominoChain`.
    info
        See `DominoChain`.

    Raises
    ------
    ValueError
        For a scene distribution, and as for `DominoChain`.

    Examples
    --------
    >>> import gymnasium, domino_env
    >>> env = gymnasium.make("DominoLayout-v2", scene="sprint")
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    """

    def __init__(
        self,
        scene: SceneLike = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        info: str = "all",
    ) -> None:
        super().__init__(DominoLayoutVector(1, scene, None, rtol, info=info), render_mode)


class DominoLayoutVector(DominoChainVector):
    """Vector environment of `DominoLayout`, bitwise equal to single environments.

    One call simulates all layouts. Infos, seeds and the option "reset_mask" are those of
    `DominoChainVector`.

    Parameters
    ----------
    num_envs
        B, the number of environments.
    scene
        See `DominoLayout`.
    render_mode
        None or "rgb_array".
    rtol
        See `DominoLayout`.
    autoreset_mode, max_episode_steps
        See `DominoChainVector`.
    info
        See `DominoChain`.

    Raises
    ------
    ValueError
        As for `DominoLayout`, for less than one environment, and for an unknown autoreset mode.
    """

    options = ()

    def __init__(
        self,
        num_envs: int = 1,
        scene: SceneLike = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        info: str = "all",
        max_episode_steps: int | None = None,
    ) -> None:
        super().__init__(
            num_envs, scene, render_mode, rtol, window=0, autoreset_mode=autoreset_mode, info=info,
            max_episode_steps=max_episode_steps,
        )  # fmt: skip
        self.longest_episode = 1
        if self.distribution is not None:
            raise ValueError(
                f"'{self.distribution.name}' samples a scene for every episode, and the length of "
                "an action would change with its number of dominoes: use DominoChain-v2"
            )
        self._batch.rules["length"] = 0.0  # left to `advance`
        _, pairs, entries = self._placing_shape
        self._set_spaces(entries * pairs, Box(0.0, 1.0, (1,), np.float32))

    def begin(
        self, mask: Bools, observations: Singles, generators: Generators, **options: Any
    ) -> Infos:
        """Begin episodes in some environments; see `DominoChainVector.begin`."""
        infos = self._prepare(mask, generators)
        self._episodes["phase"][mask], observations[mask] = RUNNING, 0.0
        return infos

    def advance(self, actions: Floats) -> tuple[Singles, Floats, Bools, Infos]:
        """Place all dominoes and simulate them; see `DominoChainVector.advance`."""
        observations, scene = np.ones(self._observations.shape, np.float32), self.catalogue.first
        phase, rewards = self._episodes["phase"], np.zeros(self.num_envs)
        begins, ended = phase == BEGINNING, phase == RUNNING
        phase[begins], observations[begins] = RUNNING, 0.0
        envs = np.flatnonzero(ended)
        if not len(envs):
            return observations, rewards, ended, {}
        placements = actions.reshape(self.num_envs, -1, scene.count - 1).transpose(0, 2, 1)
        placements = np.ascontiguousarray(placements)
        share_evenly(place_batch, self.num_envs, MIN_PER_THREAD, self._batch, ended, placements)
        if scene.length is not None:  # the nearest layouts of this length
            space, pairs = scene.space, scene.count - 1
            gaps = self._batch.spacing[:, :pairs]
            thickness = self._batch.thickness[:, 1 : 1 + pairs]
            gaps[:], thickness[:], _ = space.sizes(space.project(space.values(gaps, thickness)))
        rewards[envs], infos = self._end(envs)
        return observations, rewards, ended, infos
