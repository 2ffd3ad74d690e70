"""What the vector environments share: seeds, masks, autoreset, infos of all rows in arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from domino_env.envs.base import (
    RENDER_FPS,
    Bools,
    Episodes,
    Floats,
    Observations,
    checked_actions,
    checked_options,
    checked_render_mode,
    new_painter,
)
from domino_env.scenes.distribution import SceneDistribution
from domino_env.scenes.scene import Scene

RENDER_MODES = ("rgb_array", "ansi")


class RowVectorEnv(VectorEnv[Observations, Observations, NDArray[Any]]):
    """An environment of many rows, moved together; see `DominoChainVector`.

    Parameters
    ----------
    num_envs
        B, the number of rows.
    render_mode
        None, "rgb_array" or "ansi".
    autoreset_mode
        When the episode after an ended one begins.
    """

    _episodes: Episodes

    def __init__(
        self,
        num_envs: int,
        render_mode: str | None,
        autoreset_mode: str | AutoresetMode,
    ) -> None:
        if not (isinstance(num_envs, int | np.integer) and num_envs >= 1):
            raise ValueError(f"num_envs = {num_envs!r}: give the number of rows, 1 or more")
        self.num_envs = int(num_envs)
        self.render_mode = checked_render_mode(render_mode, RENDER_MODES)
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {
            "render_modes": list(RENDER_MODES),
            "render_fps": RENDER_FPS,
            "autoreset_mode": self.autoreset_mode,
        }
        self._over = np.zeros(self.num_envs, np.bool_)  # rows that the next step begins anew
        self._begun = np.zeros(self.num_envs, np.bool_)
        self._seeds: list[int | None] = [None] * self.num_envs
        self._generators: list[np.random.Generator | None] = [None] * self.num_envs
        self._painter: Any = None

    def _use(self, episodes: Episodes) -> None:
        """Stand on these episodes, of which there are num_envs."""
        self._episodes = episodes
        self.single_action_space = episodes.actions
        self.single_observation_space = episodes.observations
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        shape = (self.num_envs, *episodes.observations.shape)
        self._observations: Observations = np.zeros(shape, np.float32)

    @property
    def scenes(self) -> tuple[Scene, ...]:
        """What is built in each row."""
        return tuple(self._episodes.scene(b) for b in range(self.num_envs))

    @property
    def scene(self) -> Scene:
        """What is built in all rows.

        Raises
        ------
        AttributeError
            Where rows have scenes of their own, which are drawn at their resets.
        """
        if self.distribution is not None:
            raise AttributeError(
                f"a scene of '{self.distribution.name}' is drawn for each row: ask for `scenes`"
            )
        return self._episodes.scene(0)

    @property
    def distribution(self) -> SceneDistribution | None:
        """What scenes are drawn from; None where there is but one."""
        return self._episodes.problems.distribution

    # beginning ------------------------------------------------------------------------------------

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin anew in all rows, or in those of a mask.

        Parameters
        ----------
        seed
            A number (row i gets seed + i) or one for each row, of the generators that scenes are
            drawn with; where the scene is fixed, nothing is random.
        options
            What may be set:

            - "reset_mask": (B,) booleans, which rows begin anew; the others stay as they are.
            - what the class takes besides.

        Returns
        -------
        tuple
            Observations (B, O) and infos, which hold the "scene" of each row if one was drawn.

        Raises
        ------
        ValueError
            For other options or seeds, for a layout that breaks the scene's rules or dies, and for
            a scene of another kind than those drawn.
        TypeError
            For a mask that is no array of booleans.
        """
        given = {**checked_options(options, (*self._episodes.options, "reset_mask"))}
        chosen = self._checked_mask(given.pop("reset_mask", None))
        for i, value in enumerate(self._checked_seeds(seed)):
            if chosen[i] and value is not None:
                self._seeds[i], self._generators[i] = value, None
        begun = self._episodes.reset(chosen, self._observations, self._generator, **given)
        self._over &= ~chosen
        self._begun |= chosen
        return self._observations.copy(), self._spread({}, begun, chosen)

    def _checked_mask(self, mask: object) -> Bools:
        if mask is None:
            return np.ones(self.num_envs, np.bool_)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_:
            kind = getattr(mask, "dtype", type(mask).__name__)
            raise TypeError(f"options['reset_mask'] is {kind}: give a NumPy array of booleans")
        if mask.shape != (self.num_envs,):
            raise ValueError(
                f"options['reset_mask'] has shape {mask.shape}: expected ({self.num_envs},)"
            )
        if not mask.any():
            raise ValueError("options['reset_mask'] chooses no row: at least one must be True")
        return mask

    def _checked_seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            seeds: list[int | None] = [int(seed) + i for i in range(self.num_envs)]
        else:
            seeds = list(seed)
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds for {self.num_envs} rows: give one for each")
        for value in seeds:
            if value is not None and not (isinstance(value, int | np.integer) and value >= 0):
                raise ValueError(f"seed = {value!r}: give whole numbers, 0 or more")
        return seeds

    @property
    def np_random_seed(self) -> tuple[int | None, ...]:  # type: ignore[override]
        """The seed of each row; None where it has none yet."""
        return tuple(self._seeds)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The generator of each row: what its scenes are drawn with, if they are drawn."""
        return tuple(self._generator(i) for i in range(self.num_envs))

    def _generator(self, i: int) -> np.random.Generator:
        generator = self._generators[i]
        if generator is None:
            generator, self._seeds[i] = seeding.np_random(self._seeds[i])
            self._generators[i] = generator
        return generator

    # stepping -------------------------------------------------------------------------------------

    def step(self, actions: ArrayLike) -> tuple[Observations, Floats, Bools, Bools, dict[str, Any]]:
        """Take a step in every row.

        Parameters
        ----------
        actions
            (B, A) in [-1, 1].

        Returns
        -------
        tuple
            Observations, rewards, terminated, truncated and infos, as of the class.

        Raises
        ------
        ValueError
            For actions of another shape or with entries that are not finite.
        ResetNeeded
            Before `reset`, and with DISABLED once an episode is over.
        """
        values = checked_actions(actions, self.action_space)
        if not self._begun.all():
            raise ResetNeeded("call reset() before the first step()")
        renewed = self._over
        if self.autoreset_mode == AutoresetMode.DISABLED and renewed.any():
            raise ResetNeeded(
                f"the episode of row {int(np.argmax(renewed))} is over: "
                'call reset(options={"reset_mask": …}) before the next step()'
            )
        observations, rewards, ended, last = self._episodes.step(values)
        infos = self._spread({}, last, ended)
        if renewed.any():
            begun = self._episodes.reset(renewed, observations, self._generator)
            infos = self._spread(infos, begun, renewed)
        self._over = ended
        if last and self.autoreset_mode == AutoresetMode.SAME_STEP:
            final = np.full(self.num_envs, None, object)
            for i in np.flatnonzero(ended):
                final[i] = observations[i].copy()
            infos = {
                "final_obs": final,
                "_final_obs": ended.copy(),
                "final_info": infos,
                "_final_info": ended.copy(),
            }
            begun = self._episodes.reset(ended, observations, self._generator)
            infos = self._spread(infos, begun, ended)
            self._over = np.zeros(self.num_envs, np.bool_)
        self._observations[:] = observations
        return observations, rewards, ended.copy(), np.zeros(self.num_envs, np.bool_), infos

    def _spread(
        self, infos: dict[str, Any], values: dict[str, NDArray[Any]], rows: Bools
    ) -> dict[str, Any]:
        """Add infos of some rows, arrays in their order, to those in arrays of all rows."""
        for key, some in values.items():
            if key not in infos:
                # of None, where they are objects
                blank = np.empty if some.dtype == object else np.zeros
                infos[key] = blank(self.num_envs, some.dtype)
                infos[f"_{key}"] = np.zeros(self.num_envs, np.bool_)
            infos[key][rows] = some
            infos[f"_{key}"] |= rows
        return infos

    # looking --------------------------------------------------------------------------------------

    def render(self) -> tuple[Any, ...] | None:
        """Draw a frame of every row at its latest hit."""
        if self.render_mode is None:
            return None
        if self._painter is None:
            self._painter = new_painter(self.render_mode)
        rows = self._episodes
        return tuple(
            self._painter.frame(rows.snapshot(b), rows.scene(b)) for b in range(self.num_envs)
        )

    def close_extras(self, **kwargs: Any) -> None:
        """Let go of what draws."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_painter": None}
