"""Algorithms of Stable-Baselines3 and sb3-contrib: their classes and networks, and archives."""

from __future__ import annotations

import math
import warnings
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from sb3_contrib import ARS, TQC
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import VecEnv

from agents import policy as files
from agents.algorithms import Hyperparameters
from agents.apg import APG
from agents.network import read_arrays
from agents.rollout import SEEDS_PER_TRAINING
from agents.sb3.ars import VectorARS
from agents.sb3.scheduled import ScheduledPolicy
from agents.vec_env import DominoVecEnv
from domino_env import Scene, SceneDistribution
from domino_env.core.files import write_bytes
from domino_env.envs.spaces import DECAY_LENGTHS

NEAR_END_ENTRY = DECAY_LENGTHS.index(4.0)  # index of exp(-(dominoes to place) / 4) in "near_end"


class Kind(NamedTuple):
    """Classes and network of an algorithm.

    Attributes
    ----------
    trained, archived
        Class of the algorithm in trainings, and in archives that do not need this package.
    policy
        Name of a policy class of Stable-Baselines3.
    is_scheduled
        True if a `ScheduledPolicy` is trained, with a network of tanh units.
    """

    trained: Any
    archived: Any
    policy: str = "MlpPolicy"
    is_scheduled: bool = False


KINDS = {
    "apg": Kind(APG, PPO, is_scheduled=True),
    "ppo": Kind(PPO, PPO, is_scheduled=True),
    "ars": Kind(VectorARS, ARS, policy="LinearPolicy"),
    "sac": Kind(SAC, SAC),
    "td3": Kind(TD3, TD3),
    "tqc": Kind(TQC, TQC),
}


def make_model(
    target: Scene | SceneDistribution,
    algorithm: str,
    hyperparameters: Hyperparameters,
    seed: int,
    num_scenes: int | None = None,
    env: VecEnv | None = None,
) -> Any:
    """Return a new algorithm of Stable-Baselines3 or sb3-contrib, with its environments.

    It limits torch to one thread, as more threads are slower for such small networks.

    Parameters
    ----------
    target, algorithm, hyperparameters, seed, num_scenes
        See `agents.train`.
    env
        Environments of the training; None for a `DominoVecEnv`.
    """
    torch.set_num_threads(1)
    if env is None:
        env = DominoVecEnv(target, hyperparameters.num_envs, num_scenes=num_scenes)
    options = dict(hyperparameters.options)
    first, last = hyperparameters.learning_rate, hyperparameters.last_rate

    def rate(remaining: float) -> float:
        # `remaining` is negative if the last rollout exceeds the number of steps
        return first * (last + (1.0 - last) * max(remaining, 0.0))

    kind = KINDS[algorithm]
    policy_class: Any = ScheduledPolicy if kind.is_scheduled else kind.policy
    policy_options = _policy_options(kind, hyperparameters)
    options.pop("policy_kwargs", None)
    if "action_noise" in options:
        size = env.action_space.shape or ()
        deviations = np.full(size, options["action_noise"])
        options["action_noise"] = NormalActionNoise(np.zeros(size), deviations)
    if kind.trained is VectorARS:
        deviation = options.get("delta_std", 0.05)  # the default of ARS
        options["delta_std"] = lambda remaining: deviation * rate(remaining) / first
    if kind.is_scheduled and options.get("use_sde"):
        raise ValueError(
            f"use_sde = True: the noise of {algorithm} follows a schedule; leave it out, or "
            "choose sac or tqc"
        )
    if kind.trained is APG:
        # smaller than the default of Stable-Baselines3: gradients become small late in a training
        policy_options["optimizer_kwargs"] = {"eps": 1e-8}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about minibatches of unequal size
        model: Any = kind.trained(
            policy_class, env, learning_rate=rate, policy_kwargs=policy_options, seed=seed,
            device="cpu", verbose=0, **options,
        )  # fmt: skip
    model.set_logger(Logger(folder=None, output_formats=[]))
    env.seed(SEEDS_PER_TRAINING * (1 + seed))  # no episode of another training
    policy = model.policy
    if isinstance(policy, ScheduledPolicy):
        policy.end_factor, policy.penalty = hyperparameters.end_factor, hyperparameters.penalty
        policy.near_end = env.get_attr("observation_layout")[0]["near_end"].start + NEAR_END_ENTRY
    return model


def _policy_options(kind: Kind, hyperparameters: Hyperparameters) -> dict[str, Any]:
    """Return the arguments of the policy class of an algorithm."""
    if kind.policy == "LinearPolicy":
        return {}
    options: dict[str, Any] = {"net_arch": [hyperparameters.width] * hyperparameters.depth}
    if kind.is_scheduled:
        options["activation_fn"] = torch.nn.Tanh
    return {**options, **hyperparameters.options.get("policy_kwargs", {})}


def save_zip(folder: Path, path: str | Path) -> None:
    """Write the best policy of a training as an archive of Stable-Baselines3 or sb3-contrib.

    The archive can be loaded without this package; that of "apg" is one of PPO.

    Parameters
    ----------
    folder
        Folder of the training.
    path
        The .zip file.

    Raises
    ------
    ValueError
        If the folder holds no training.
    OSError
        If the archive cannot be written.
    """
    config, env = files.read_config(folder), DominoVecEnv(folder / files.SCENE)
    kind = KINDS[config.algorithm]
    options = _policy_options(kind, config.hyperparameters)
    model = kind.archived(kind.policy, env, policy_kwargs=options, device="cpu")
    state = {name: torch.from_numpy(x) for name, x in read_arrays(folder / files.POLICY).items()}
    if "log_std" in state:
        deviation = math.log(config.hyperparameters.last_deviation)
        state["log_std"] = torch.full_like(state["log_std"], deviation)
    model.policy.load_state_dict(state)
    write_bytes(Path(path), model.save)


def weights(policy: torch.nn.Module) -> dict[str, Any]:
    """Return the weights of a policy as NumPy arrays by name."""
    return {name: value.detach().numpy() for name, value in policy.state_dict().items()}
