"""The native vector environment with the interface of Stable-Baselines3."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecEnv

from domino_env import DominoChainVector, Scene, SceneDistribution
from domino_env.core.checks import require_type


class DominoVecEnv(VecEnv):
    """Vector environment of Stable-Baselines3: B environments, stepped by one compiled call.

    The step that ends an episode also begins the next one. Its info has `terminal_observation`,
    `TimeLimit.truncated` (always False), `episode` ("r": return, "l": length, "t": wall-clock time
    since the environment was made [s]), and the info of the environment: `score`, `gain`,
    `outcome`, `layout`, `wave`, and `scene` if one was sampled. Small networks learn fastest with
    one thread of PyTorch: call `torch.set_num_threads(1)`, after `numba.set_num_threads` if that is
    used, as Numba sets the number of OpenMP's threads.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file; or a scene distribution from which every episode
        samples one, such as "varied".
    num_envs
        B, the number of environments.
    options
        Other keyword arguments of `domino_env.DominoChainVector`, such as `rtol` and `window`.

    Attributes
    ----------
    vector
        The `domino_env.DominoChainVector`, the native environment.

    Examples
    --------
    >>> from agents import DominoVecEnv
    >>> env = DominoVecEnv("sprint", 16, window=4)
    >>> env.reset().shape
    (16, 16)
    """

    def __init__(
        self,
        scene: str | Path | Scene | SceneDistribution,
        num_envs: int = 1,
        **options: Any,
    ) -> None:
        self.vector = DominoChainVector(num_envs, scene, autoreset_mode="SameStep", **options)
        vector = self.vector
        super().__init__(num_envs, vector.single_observation_space, vector.single_action_space)
        self._actions: NDArray[Any] = np.zeros((num_envs, 1))
        self._returns = np.zeros(num_envs)
        self._lengths = np.zeros(num_envs, dtype=np.int64)
        self._start = time.perf_counter()

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode in every environment, and return the observations (B, O).

        Raises
        ------
        ValueError
            For options that `DominoChainVector.reset` rejects.
        """
        self._returns[:] = 0.0
        self._lengths[:] = 0
        seeds: Any = self._seeds if any(s is not None for s in self._seeds) else None
        options = self._options[0]
        self._reset_seeds()  # before the reset, so that a failed one is not repeated
        self._reset_options()
        return self.vector.reset(seed=seeds, options=options)[0]

    def set_options(self, options: dict[str, Any] | None = None) -> None:  # type: ignore[override]
        """Set the options of the next reset, as for `DominoChainVector.reset`.

        Raises
        ------
        TypeError
            For a list: one dictionary holds for all environments.
        """
        require_type("options", options, dict | None, "one dictionary for all environments")
        super().set_options(options)

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions (B, A) for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> Any:
        """Place a domino in every environment.

        Returns
        -------
        tuple
            Observations (B, O), rewards (B,), ends of episodes (B,) and a list of B infos.
        """
        observations, rewards, dones, _, info = self.vector.step(self._actions)
        self._returns += rewards
        self._lengths += 1
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if dones.any():
            elapsed = time.perf_counter() - self._start
            final = info["final_info"]
            keys = [key for key in final if not key.startswith("_")]
            for i in np.flatnonzero(dones):
                infos[i] = {key: final[key][i] for key in keys} | {
                    "terminal_observation": info["final_obs"][i],
                    "TimeLimit.truncated": False,
                    "episode": {  # rounded as by `Monitor`
                        "r": round(float(self._returns[i]), 6),
                        "l": int(self._lengths[i]),
                        "t": round(elapsed, 6),
                    },
                }
            self._returns[dones] = 0.0
            self._lengths[dones] = 0
        return observations, rewards.astype(np.float32), dones, infos

    def close(self) -> None:
        """Close the native environment."""
        self.vector.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the native environment, once for each environment."""
        return [getattr(self.vector, attr_name)] * self._count(indices)

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the native environment, for all environments."""
        setattr(self.vector, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the native environment; return its result once per environment."""
        result = getattr(self.vector, method_name)(*method_args, **method_kwargs)
        return [result] * self._count(indices)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return True for `Monitor`, whose `episode` info is provided; False otherwise."""
        return [issubclass(wrapper_class, Monitor)] * self._count(indices)

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return a frame of each environment, with `render_mode="rgb_array"`."""
        return list(self.vector.render() or ())

    def _count(self, indices: Any) -> int:
        return len(list(self._get_indices(indices)))
