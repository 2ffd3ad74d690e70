"""DominoChain-v0 for many rows at once: one compiled call a step, over all cores."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from domino_env.chain.layout import Layout
from domino_env.envs.base import (
    RENDER_FPS,
    RTOL,
    WINDOW,
    checked_options,
    checked_render_mode,
    new_painter,
    wrong_actions,
)
from domino_env.envs.episodes import Bools, Floats, Rows, Seen, shared_scene
from domino_env.scenes.scene import Scene

RENDER_MODES = ("rgb_array", "ansi")


class DominoChainVector(VectorEnv[Seen, Seen, NDArray[Any]]):
    """`DominoChain` times num_envs, bit for bit, with all rows moved by one compiled call a step.

    Actions (B, A), observations (B, O), rewards (B,) float64, as Gymnasium's vector environments
    have them; infos hold an array of length B for each key of the single environment's info, and
    under "_key" which entries are set. The number of threads is Numba's (`numba.set_num_threads`).

    Parameters
    ----------
    num_envs
        B, the number of rows.
    scene
        As of `DominoChain`.
    render_mode
        None, "rgb_array" or "ansi".
    rtol
        As of `DominoChain`.
    reference_speed
        As of `DominoChain`; may be set at any time.
    window
        As of `DominoChain`.
    autoreset_mode
        When the episode after an ended one begins:

        - NEXT_STEP: with the step after the last, which takes no notice of the action and pays 0.
        - SAME_STEP: with the last step itself; the last observation and info are in
          infos["final_obs"] and infos["final_info"].
        - DISABLED: with `reset(options={"reset_mask": …})`, before the next step.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scene: str | Path | Scene = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        reference_speed: float | None = None,
        window: int = WINDOW,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
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
        self.scene = shared_scene(scene)
        self._rows = Rows(self.scene, self.num_envs, rtol, reference_speed, window)
        self.single_action_space = Box(-1.0, 1.0, (self._rows.choices,), np.float32)
        self.single_observation_space = Box(
            self._rows.seen_low, self._rows.seen_high, dtype=np.float32
        )
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._seen = np.zeros((self.num_envs, len(self._rows.seen_low)), np.float32)
        self._over = np.zeros(self.num_envs, np.bool_)  # rows that the next step begins anew
        self._begun = np.zeros(self.num_envs, np.bool_)
        self._seeds: list[int | None] = [None] * self.num_envs
        self._generators: list[np.random.Generator | None] = [None] * self.num_envs
        self._painter: Any = None

    @property
    def reference_speed(self) -> float:
        """Speed that the rewards of single steps count against [m/s]; may be set at any time."""
        return self._rows.reference_speed

    @reference_speed.setter
    def reference_speed(self, speed: float) -> None:
        self._rows.reference_speed = speed

    # beginning ------------------------------------------------------------------------------------

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin anew in all rows, or in those of a mask.

        Parameters
        ----------
        seed
            A number (row i gets seed + i) or one for each row; nothing is random, so it changes
            nothing but `np_random`.
        options
            What may be set:

            - "reset_mask": (B,) booleans, which rows begin anew; the others stay as they are.
            - "layout": a Layout that all of those start from, or one (or None) for each row.

        Returns
        -------
        tuple
            Observations (B, O) and an empty info.

        Raises
        ------
        ValueError
            For other options or seeds, and for a layout that breaks the scene's rules or dies.
        TypeError
            For a mask that is no array of booleans.
        """
        given = checked_options(options, ("layout", "reset_mask"))
        chosen = self._checked_mask(given.get("reset_mask"))
        seeds = self._checked_seeds(seed)
        self._rows.reset(chosen, self._seen, given.get("layout"))
        for i, value in enumerate(seeds):
            if chosen[i] and value is not None:
                self._seeds[i], self._generators[i] = value, None
        self._over &= ~chosen
        self._begun |= chosen
        return self._seen.copy(), {}

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
        """The generator of each row; the rows themselves draw nothing."""
        for i, generator in enumerate(self._generators):
            if generator is None:
                self._generators[i], self._seeds[i] = seeding.np_random(self._seeds[i])
        return tuple(self._generators)  # type: ignore[arg-type]

    # stepping -------------------------------------------------------------------------------------

    def step(self, actions: ArrayLike) -> tuple[Seen, Floats, Bools, Bools, dict[str, Any]]:
        """Place a domino in every row.

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
        values = np.asarray(actions, dtype=np.float64)
        if values.shape != self.action_space.shape or not np.isfinite(values).all():
            raise ValueError(wrong_actions(values, self.action_space))
        if not self._begun.all():
            raise ResetNeeded("call reset() before the first step()")
        renewed = self._over
        if self.autoreset_mode == AutoresetMode.DISABLED and renewed.any():
            raise ResetNeeded(
                f"the episode of row {int(np.argmax(renewed))} is over: "
                'call reset(options={"reset_mask": …}) before the next step()'
            )
        seen, rewards, ended = self._rows.step(values)
        if renewed.any():
            self._rows.reset(renewed, seen)
        infos: dict[str, Any] = {}
        self._over = ended
        if ended.any():
            told = self._told(np.flatnonzero(ended), rewards, ended)
            if self.autoreset_mode == AutoresetMode.SAME_STEP:
                last = np.full(self.num_envs, None, object)
                for i in np.flatnonzero(ended):
                    last[i] = seen[i].copy()
                infos = {
                    "final_obs": last,
                    "_final_obs": ended.copy(),
                    "final_info": told,
                    "_final_info": ended.copy(),
                }
                self._rows.reset(ended, seen)
                self._over = np.zeros(self.num_envs, np.bool_)
            else:
                infos = told
        self._seen[:] = seen
        return seen, rewards, ended.copy(), np.zeros(self.num_envs, np.bool_), infos

    def _told(self, rows: NDArray[np.intp], rewards: Floats, ended: Bools) -> dict[str, Any]:
        """What the episodes that ended have to tell, spread over all rows."""
        infos: dict[str, Any] = {}
        for key, values in self._rows.settle(rows, rewards).items():
            empty = None if values.dtype == object else 0.0
            infos[key] = np.full(self.num_envs, empty, values.dtype)
            infos[key][rows] = values
            infos[f"_{key}"] = ended.copy()
        return infos

    # seeing ---------------------------------------------------------------------------------------

    def bounds_ahead(self, row: int) -> dict[str, tuple[float, float]]:
        """Return what the next action of a row ranges over; see `DominoChain.bounds_ahead`."""
        return self._rows.bounds_ahead(row)

    def actions_towards(self, layout: Layout) -> Floats:
        """Return actions (B, A) that place the next domino of every row as in a layout.

        Where the rules no longer leave its place, the nearest they do; 0 for rows that are over.
        """
        return self._rows.actions_towards(layout)

    def render(self) -> tuple[Any, ...] | None:
        """Draw a frame of every row at its latest hit."""
        if self.render_mode is None:
            return None
        if self._painter is None:
            self._painter = new_painter(self.scene, self.render_mode)
        return tuple(self._painter.frame(self._rows.moment(b)) for b in range(self.num_envs))

    def close_extras(self, **kwargs: Any) -> None:
        """Let go of what draws."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_painter": None}
