"""The native vector environment as stable-baselines3 wants it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from domino_env import DominoChainVector, Scene, SceneDistribution

NOTHING: dict[str, Any] = {}


class DominoVecEnv(VecEnv):
    """Rows that are built side by side in one compiled call a step.

    An episode that ends begins anew in the same step; its info holds `terminal_observation`,
    `TimeLimit.truncated` (never), `episode` (return, length, seconds), and what the environment
    reports at the end: score, gain, outcome, layout, wave, and the scene where one is drawn.

    Parameters
    ----------
    scene
        What is built: a scene, or what one is drawn from for every episode, such as "varied".
    number
        Of rows.

    Attributes
    ----------
    rows
        The native vector environment.
    """

    def __init__(self, scene: str | Path | Scene | SceneDistribution, number: int) -> None:
        self.vector = DominoChainVector(number, scene, autoreset_mode="SameStep")
        self.render_mode = None
        super().__init__(
            number, self.vector.single_observation_space, self.vector.single_action_space
        )
        self._actions: NDArray[Any] = np.zeros((number, 1))
        self._returns = np.zeros(number)
        self._lengths = np.zeros(number, dtype=np.int64)
        self._began = time.perf_counter()

    def reset(self) -> NDArray[np.float32]:
        """Begin anew in every row."""
        self._returns[:] = 0.0
        self._lengths[:] = 0
        seeds: Any = self._seeds if any(s is not None for s in self._seeds) else None
        observations, _ = self.vector.reset(seed=seeds)
        self._reset_seeds()
        self._reset_options()
        return observations

    def follow(self, score: float) -> None:
        """Reward single steps against the best row so far (Dinkelbach 1967), or the uniform one.

        Parameters
        ----------
        score
            Of that row; nothing changes where its wave died, where the score is no speed, or where
            every episode has a scene of its own.
        """
        if self.vector.distribution is not None:
            return
        scene = self.vector.scene
        if scene.criterion.is_ratio and score > 0.0:
            self.vector.reference_speed = max(score, scene.uniform().wave.mean_speed)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions (R, A) for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Place a domino in every row."""
        observations, rewards, ended, _, info = self.vector.step(self._actions)
        self._returns += rewards
        self._lengths += 1
        infos = [NOTHING] * self.num_envs
        if ended.any():
            elapsed = time.perf_counter() - self._began
            final = info["final_info"]
            keys = [key for key in final if not key.startswith("_")]
            for i in np.flatnonzero(ended):
                infos[i] = {key: final[key][i] for key in keys} | {
                    "terminal_observation": info["final_obs"][i],
                    "TimeLimit.truncated": False,
                    "episode": {
                        "r": float(self._returns[i]),
                        "l": int(self._lengths[i]),
                        "t": elapsed,
                    },
                }
            self._returns[ended] = 0.0
            self._lengths[ended] = 0
        return observations, rewards.astype(np.float32), ended, infos

    def close(self) -> None:
        """Close the native environment."""
        self.vector.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Get an attribute of the native environment, once for each row."""
        return [getattr(self.vector, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the native environment, for all rows."""
        setattr(self.vector, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the native environment; its result, once for each row."""
        found = getattr(self.vector, method_name)(*method_args, **method_kwargs)
        return [found] * len(self._chosen(indices))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Say that no row is wrapped."""
        return [False] * len(self._chosen(indices))

    def _chosen(self, indices: int | Sequence[int] | None) -> list[int]:
        return list(self._get_indices(indices))
