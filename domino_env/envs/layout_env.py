"""DominoLayout-v0: a whole row as one action, alone or many at once."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from domino_env import kernels
from domino_env.core.threads import share_rows
from domino_env.envs.arrays import draw_errors, new_batch
from domino_env.envs.base import RTOL, Bools, Episodes, Floats, Observations, RowEnv, Start, loaded
from domino_env.envs.endings import Endings
from domino_env.envs.problems import Generators, Problems, choices
from domino_env.envs.snapshot import Snapshot
from domino_env.envs.vector import RowVectorEnv
from domino_env.scenes.distribution import SceneDistribution
from domino_env.scenes.scene import Scene

PIECE = 16  # rows whose dominoes are placed by one thread, at least
NEWTON, CLOSE = 5, 1e-15  # steps towards a shift, and how close they are likely to come [m]


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
    `Box(0, 1, (1,), float32)`: 0 before the row is placed, 1 after.

    ## Rewards
    100 (score / score of the best uniform row - 1), as the return of `DominoChain-v0`. On a floor
    the row is toppled standing, which takes some 130 ms of one core with forty dominoes.

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
        scene: str | Path | Scene | SceneDistribution = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
    ) -> None:
        super().__init__(render_mode)
        self._use(LayoutEpisodes(loaded(scene), 1, rtol))


class DominoLayoutVector(RowVectorEnv):
    """`DominoLayout` times num_envs, bit for bit, with all rows simulated as one batch.

    Infos, seeds and the option "reset_mask" are those of `DominoChainVector`.

    Parameters
    ----------
    num_envs
        B, the number of rows.
    scene
        As of `DominoLayout`.
    render_mode
        None, "rgb_array" or "ansi".
    rtol
        As of `DominoLayout`.
    autoreset_mode
        As of `DominoChainVector`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        scene: str | Path | Scene | SceneDistribution = "sprint",
        render_mode: str | None = None,
        rtol: float = RTOL,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
    ) -> None:
        super().__init__(num_envs, render_mode, autoreset_mode)
        self._use(LayoutEpisodes(loaded(scene), self.num_envs, rtol))


class LayoutEpisodes(Episodes):
    """B rows of one scene, each placed and toppled by one step.

    Parameters
    ----------
    scene
        What is built.
    number
        B.
    rtol
        Relative error allowed in the arrival times.

    Raises
    ------
    ValueError
        For what `Problems` refuses, and for scenes that are drawn.
    """

    def __init__(self, scene: Scene | SceneDistribution, number: int, rtol: float) -> None:
        if isinstance(scene, SceneDistribution):
            raise ValueError(
                f"'{scene.name}' draws a scene for every episode, and with the count of its "
                "dominoes the length of an action would change: build it by DominoChain-v0"
            )
        self.number, self.rtol = number, float(rtol)
        self.problems = Problems(scene, number, self.rtol, 0)
        self._scene = scene
        self._batch = new_batch(self.problems, number, falls=False)
        self._batch.rules[0] = self.problems.rules[0]
        pairs = scene.count - 1
        bounds = [scene.spacing] * pairs * scene.free_spacing
        bounds += [scene.thickness] * pairs * scene.free_thickness
        bounds += [scene.growth or (1.0, 1.0)] * pairs * scene.free_height
        self._low, self._high = np.array(bounds).T
        self.actions = Box(-1.0, 1.0, (len(bounds),), np.float32)
        self.observations = Box(0.0, 1.0, (1,), np.float32)
        self._running = np.zeros(number, np.bool_)
        self._waves = np.full(number, None, object)  # of rows that are over

    def scene(self, row: int) -> Scene:
        """Return what is built."""
        return self._scene

    def reset(
        self,
        chosen: Bools,
        observations: Observations,
        generators: Generators,
        layout: Start = None,
        scene: Sequence[Scene | None] | Scene | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Begin anew in the chosen rows; see `Episodes.reset`."""
        self._running |= chosen
        self._waves[chosen] = None
        draw_errors(self._batch, np.flatnonzero(chosen), self.scene, generators)
        observations[chosen] = 0.0
        return {}

    def step(self, actions: Floats) -> tuple[Observations, Floats, Bools, dict[str, NDArray[Any]]]:
        """Place and topple every row that has begun; see `Episodes.step`."""
        observations = np.ones((self.number, 1), np.float32)
        rewards, ended = np.zeros(self.number), self._running
        self._running = np.zeros(self.number, np.bool_)
        rows = np.flatnonzero(ended)
        if not len(rows):
            return observations, rewards, ended, {}
        self._place(actions)
        batch = self._batch
        endings = Endings(
            scenes=[self._scene] * len(rows),
            baseline=np.full(len(rows), self.problems.score[0]),
            rtol=self.rtol,
            spacing=batch.spacing[ended],
            thickness=batch.thickness[ended],
            height=batch.height[ended] if len(batch.height) == self.number else batch.height,
            placed=[self._scene.count - 1] * len(rows),
        )
        endings.judge(range(len(rows)))
        rewards[rows] = endings.returns
        infos = endings.infos()
        self._waves[rows] = infos["wave"]
        return observations, rewards, ended, infos

    def _place(self, actions: Floats) -> None:
        """Write the rows that the actions stand for."""
        scene, batch, pairs = self._scene, self._batch, self._scene.count - 1
        if scene.length is None:
            each = actions.reshape(self.number, choices(scene), pairs).transpose(0, 2, 1)
            share_rows(kernels.place_rows, self.number, PIECE, batch, np.ascontiguousarray(each))
            return
        wide = 0.5 * (np.clip(actions, -1.0, 1.0) + 1.0) * (self._high - self._low)
        fixed = scene.spacing[0] * (not scene.free_spacing)
        fixed += scene.thickness[0] * (not scene.free_thickness)
        values = nearest_with_sum(
            np.clip(self._low + wide, self._low, self._high), self._low, self._high,
            scene.length - pairs * fixed,
        )  # fmt: skip
        batch.spacing[:] = values[:, :pairs] if scene.free_spacing else scene.spacing[0]
        unit = scene.height if scene.in_heights else 1.0
        batch.thickness[:, 1:] = (
            values[:, -pairs:] if scene.free_thickness else scene.thickness[0] * unit
        )

    def snapshot(self, row: int) -> Snapshot:
        """Show the first domino alone, or the row at its last hit."""
        scene, wave, uniform_speed = self._scene, self._waves[row], float(self.problems.speed[0])
        if wave is None:
            thick, height = np.array([scene.first_thickness]), np.array([scene.height])
            return Snapshot(np.empty(0), thick, height, 1, 0.0, scene.physics.push, uniform_speed)
        struck = np.isfinite(wave.arrival_times)
        front = wave.release_velocity[struck][-1]
        return Snapshot(
            spacing=wave.layout.spacing,
            thickness=wave.layout.thickness,
            height=wave.layout.height,
            hit=wave.hit,
            time=float(wave.arrival_times[struck][-1]),
            speed=float(front) if wave.mean_speed > 0.0 else 0.0,
            uniform_speed=uniform_speed,
            wave=wave,
        )


def nearest_with_sum(values: Floats, low: Floats, high: Floats, total: float) -> Floats:
    """Find the points of {low ≤ x ≤ high, Σ x = total} nearest to `values`.

    The projection shifts all entries of a point alike and cuts them off at their bounds. Newton's
    method comes close to the shift, and halving what is left finds it to rounding, which the
    entries between their bounds then take up.

    Parameters
    ----------
    values
        (B, n).
    low, high
        (n,) bounds.
    total
        Of the entries of a point; between the sums of the bounds.
    """

    def shifted(shift: Floats) -> Floats:
        return np.minimum(np.maximum(values + shift[:, None], low), high)

    least, most = np.min(low - values, axis=1), np.max(high - values, axis=1)
    shift = np.zeros(len(values))
    for _ in range(NEWTON):
        moved = shifted(shift)
        free = np.add.reduce((moved > low) & (moved < high), axis=1, dtype=np.int64)
        shift += (total - np.add.reduce(moved, axis=1)) / np.maximum(free, 1)
    # the sum rises with the shift, rounded or not, so that it is found from any bounds around it
    shift = np.minimum(np.maximum(shift, least), most)
    below, above = np.maximum(shift - CLOSE, least), np.minimum(shift + CLOSE, most)
    least = np.where(np.add.reduce(shifted(below), axis=1) < total, below, least)
    most = np.where(np.add.reduce(shifted(above), axis=1) < total, most, above)
    shift = np.full(len(values), np.nan)
    for _ in range(200):
        before, shift = shift, 0.5 * (least + most)
        moved = shifted(shift)
        if (shift == before).all():
            break
        short = np.add.reduce(moved, axis=1) < total
        least, most = np.where(short, shift, least), np.where(short, most, shift)
    free = (moved > low) & (moved < high)
    rest = total - np.add.reduce(moved, axis=1)
    moved += free * (rest / np.maximum(np.add.reduce(free, axis=1, dtype=np.int64), 1))[:, None]
    return np.asarray(np.clip(moved, low, high))
