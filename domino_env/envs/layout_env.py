"""DominoLayout-v0: a whole row as one action."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from numpy.typing import ArrayLike

from domino_env import kernels
from domino_env.chain.layout import Layout
from domino_env.envs.base import RTOL, RowEnv, checked_options, wrong_actions
from domino_env.envs.endings import LateWave
from domino_env.envs.episodes import Floats, Rows, Seen
from domino_env.envs.snapshot import Moment
from domino_env.scenes.scene import Scene


class DominoLayout(RowEnv):
    """A whole row of dominoes as one action: for bandits and black-box search.

    ## Description
    The same scenes and the same score as `DominoChain-v0`, one step an episode.

    ## Action space
    `Box(-1, 1, (A,), float32)`: one entry for each of the N - 1 gaps, then for each of the N - 1
    thicknesses (of dominoes 1 … N - 1), then for each of their growths, as far as the scene leaves
    them free; -1 stands for the least, 1 for the largest value, beyond them the value is cut off.
    Where the scene asks for a total length, the row is the nearest one (in metres) that has it;
    other rules narrow the entries from the first domino to the last, as in `DominoChain-v0`.

    ## Observation space
    `Box(0, 1, (1,), float32)`: 0 before the row is laid, 1 after.

    ## Rewards
    100 (score / score of the best uniform row - 1), as the return of `DominoChain-v0`.

    ## Starting state, episode end, info
    Nothing stands but the first domino; every step ends its episode. `info` has `score`, `gain`,
    `outcome`, `layout`, `wave`, as in `DominoChain-v0`.

    ## Version history
    - v0: first version.

    Parameters
    ----------
    scene
        As of `DominoChain`.
    render_mode
        As of `DominoChain`.
    rtol
        As of `DominoChain`.
    """

    def __init__(
        self,
        scene: str | Path | Scene = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
    ) -> None:
        super().__init__(scene, render_mode)
        self._rows = Rows(self.scene, 1, rtol, None, 0)
        self.rtol, self.mark = self._rows.rtol, self._rows.mark
        pairs = self.scene.count - 1
        bounds = [self.scene.spacing] * pairs * self.scene.free_spacing
        bounds += [self.scene.thickness] * pairs * self.scene.free_thickness
        bounds += [self.scene.growth or (1.0, 1.0)] * pairs * self.scene.free_height
        self._low, self._high = np.array(bounds).T
        self.action_space = Box(-1.0, 1.0, (len(bounds),), np.float32)
        self.observation_space = Box(0.0, 1.0, (1,), np.float32)
        self._ready = False
        self._wave: LateWave | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin an episode; there are no options."""
        super().reset(seed=seed)
        checked_options(options, ())
        self._ready, self._wave = True, None
        if self.render_mode == "human":
            self.render()
        return np.zeros(1, np.float32), {}

    def step(self, action: ArrayLike) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Lay the row and topple it.

        Parameters
        ----------
        action
            (A,) in [-1, 1], as of the class.

        Returns
        -------
        tuple
            Observation, reward, terminated, truncated and info, as of the class.

        Raises
        ------
        ValueError
            For an action of another shape or with entries that are not finite.
        ResetNeeded
            Before `reset`: an episode has one step.
        """
        values = np.asarray(action, dtype=np.float64)
        if values.shape != self.action_space.shape or not np.isfinite(values).all():
            raise ValueError(wrong_actions(values, self.action_space))
        if not self._ready:
            raise ResetNeeded("an episode has one step: call reset() before step()")
        layout = self._laid(values)
        wave = self.scene.simulate(layout, self.rtol)
        score = self.scene.score_wave(wave)
        reward = float(kernels.plain(kernels.episode_return)(score, self.mark.score))
        self._ready = False
        self._wave = LateWave.known(wave)
        info = {
            "score": score,
            "gain": reward / 100.0,
            "outcome": wave.outcome,
            "layout": layout,
            "wave": self._wave,
        }
        if self.render_mode == "human":
            self.render()
        return np.ones(1, np.float32), reward, True, False, info

    def _laid(self, action: Floats) -> Layout:
        """The row that an action stands for."""
        scene, pairs = self.scene, self.scene.count - 1
        if scene.length is None:
            return self._rows.lay(np.ascontiguousarray(action.reshape(-1, pairs).T))
        wide = 0.5 * (np.clip(action, -1.0, 1.0) + 1.0) * (self._high - self._low)
        fixed = scene.spacing[0] * (not scene.free_spacing)
        fixed += scene.thickness[0] * (not scene.free_thickness)
        values = nearest_with_sum(
            np.clip(self._low + wide, self._low, self._high), self._low, self._high,
            scene.length - pairs * fixed,
        )  # fmt: skip
        gaps = values[:pairs] if scene.free_spacing else scene.spacing[0]
        return scene.layout(gaps, values[-pairs:] if scene.free_thickness else None)

    def moment(self) -> Moment:
        """Show the first domino alone, or the row at its last hit."""
        mark_speed, wave = self.mark.wave.mean_speed, self._wave
        if wave is None:
            scene = self.scene
            thick, height = np.array([scene.first_thickness]), np.array([scene.height])
            return Moment(np.empty(0), thick, height, 1, 0.0, scene.physics.push, mark_speed)
        struck = np.isfinite(wave.arrival_times)
        front = wave.release_velocity[struck][-1]
        return Moment(
            spacing=wave.layout.spacing,
            thickness=wave.layout.thickness,
            height=wave.layout.height,
            hit=wave.hit,
            time=float(wave.arrival_times[struck][-1]),
            speed=float(front) if wave.mean_speed > 0.0 else 0.0,
            uniform_speed=mark_speed,
            wave=wave,
        )


def nearest_with_sum(values: Floats, low: Floats, high: Floats, total: float) -> Floats:
    """Find the point of {low ≤ x ≤ high, Σ x = total} nearest to `values`, (n,) each.

    The projection shifts all entries alike and cuts them off at their bounds; halving the range of
    the shift until nothing is left of it finds it to rounding, which one entry then takes up.
    """
    least, most = float(np.min(low - values)), float(np.max(high - values))
    for _ in range(200):
        shift = 0.5 * (least + most)
        if not least < shift < most:
            break
        if np.clip(values + shift, low, high).sum() < total:
            least = shift
        else:
            most = shift
    moved: Floats = np.clip(values + shift, low, high)
    free = (moved > low) & (moved < high)
    moved += free * (total - moved.sum()) / max(int(free.sum()), 1)
    return np.asarray(np.clip(moved, low, high))
