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
from domino_env.core.checks import require_choice, require_type
from domino_env.envs import CHAIN, ENVIRONMENTS

# attributes of single environments that the native one has under another name
NATIVE = {
    "scene": "scenes",
    "action_space": "single_action_space",
    "observation_space": "single_observation_space",
}
PER_ENVIRONMENT = ("scenes", "np_random", "np_random_seed")  # one value for each environment


class DominoVecEnv(VecEnv):
    """Vector environment of Stable-Baselines3: B environments, stepped by one compiled call.

    The step that ends an episode also begins the next one, whose info is in `reset_infos`. Its info
    has `terminal_observation`, `TimeLimit.truncated` (False without `max_episode_steps`), `episode`
    ("r": return, "l": length, "t": wall-clock time since the environment was made [s]), and the
    info of the environment: `score`, `gain`, `outcome`, `layout`, `wave`, and `scene` if one was
    sampled. Small networks learn fastest with one thread of PyTorch: call
    `torch.set_num_threads(1)`, after `numba.set_num_threads` if that is used, as Numba sets the
    number of OpenMP's threads.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file; or a scene distribution from which every episode
        samples one, such as "varied".
    num_envs
        B, the number of environments.
    environment
        Name of the environment.
    options
        Other keyword arguments of its vector version, such as `rtol` and `window`.

    Raises
    ------
    ValueError
        For an `autoreset_mode`, an unknown environment, and as for `DominoChainVector`.

    Attributes
    ----------
    vector
        The native environment, such as a `domino_env.DominoChainVector`.

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
        environment: str = CHAIN.id,
        **options: Any,
    ) -> None:
        if "autoreset_mode" in options:
            raise ValueError(
                f"autoreset_mode = {options['autoreset_mode']!r}: Stable-Baselines3 begins an "
                "episode on the last step of the one before; leave it out"
            )
        require_choice("environment", environment, ENVIRONMENTS)
        make = ENVIRONMENTS[environment].make_vec
        vector: DominoChainVector = make(num_envs, scene, autoreset_mode="SameStep", **options)
        self.vector = vector
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
        observations, info = self.vector.reset(seed=seeds, options=options)
        self.reset_infos = self._split(info)
        return observations

    def set_options(self, options: dict[str, Any] | None = None) -> None:  # type: ignore[override]
        """Set the options of the next reset, as for `DominoChainVector.reset`.

        Episodes that begin by themselves, after those of this reset, begin without options.

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
        observations, rewards, terminated, truncated, info = self.vector.step(self._actions)
        dones = terminated | truncated
        self._returns += rewards
        self._lengths += 1
        final, last = info.pop("final_info", {}), info.pop("final_obs", None)
        infos = begun = self._split(info)
        if last is not None:
            elapsed = time.perf_counter() - self._start
            infos = [old if not dones[i] else {} for i, old in enumerate(begun)]
            for i, values in zip(np.flatnonzero(dones), self._split(final, dones), strict=True):
                self.reset_infos[i] = begun[i]
                infos[i] = values | {
                    "terminal_observation": last[i],
                    "TimeLimit.truncated": bool(truncated[i] and not terminated[i]),
                    "episode": {  # rounded as by `Monitor`
                        "r": round(float(self._returns[i]), 6),
                        "l": int(self._lengths[i]),
                        "t": round(elapsed, 6),
                    },
                }
            self._returns[dones] = 0.0
            self._lengths[dones] = 0
        return observations, rewards.astype(np.float32), dones, infos

    def _split(self, info: dict[str, Any], mask: Any = slice(None)) -> list[dict[str, Any]]:
        """Return the info of each environment of a mask, by default of all."""
        infos: list[dict[str, Any]] = [{} for _ in np.arange(self.num_envs)[mask]]
        for key in [key for key in info if f"_{key}" in info]:
            entries = zip(infos, info[key][mask], info[f"_{key}"][mask], strict=True)
            for own, value, is_set in entries:
                if is_set:
                    own[key] = value
        return infos

    def close(self) -> None:
        """Close the native environment."""
        self.vector.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of each environment, under its name in a single or native one.

        Raises
        ------
        AttributeError
            For a name that neither has.
        IndexError
            For an index that no environment has.
        """
        chosen, name = self._chosen(indices), NATIVE.get(attr_name, attr_name)
        value = getattr(self.vector, name)
        return [value[i] if name in PER_ENVIRONMENT else value for i in chosen]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the native environment, for all environments.

        Raises
        ------
        IndexError
            For an index that no environment has.
        ValueError
            For indices of some environments.
        """
        if len(set(self._chosen(indices))) < self.num_envs:
            raise ValueError(
                f"indices = {indices}: '{attr_name}' is set for all {self.num_envs} environments, "
                "which share it; leave indices out"
            )
        setattr(self.vector, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the native environment; return its result once per environment.

        Raises
        ------
        IndexError
            For an index that no environment has.
        """
        chosen = self._chosen(indices)
        result = getattr(self.vector, method_name)(*method_args, **method_kwargs)
        return [result] * len(chosen)

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return True for `Monitor`, whose `episode` info is provided; False otherwise."""
        return [issubclass(wrapper_class, Monitor)] * len(self._chosen(indices))

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return a frame of each environment, with `render_mode="rgb_array"`."""
        return list(self.vector.render() or ())

    def _chosen(self, indices: Any) -> list[int]:
        """Return the environments of some indices, of which those below 0 count from the end."""
        chosen = [int(i) for i in self._get_indices(indices)]
        for i in chosen:
            if not -self.num_envs <= i < self.num_envs:
                raise IndexError(
                    f"indices: there is no environment {i}; give numbers from 0 to "
                    f"{self.num_envs - 1}"
                )
        return [i % self.num_envs for i in chosen]
