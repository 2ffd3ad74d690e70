"""Learner: an algorithm of stable-baselines3 set up by its preset, and its weights."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from agents.apg.algorithm import APG
from agents.base.arrays import read_weights
from agents.base.building import Policy
from agents.sb3.actor import acting, actor_of
from agents.sb3.presets import Preset
from agents.sb3.row_policy import NEAR_END, RowPolicy
from agents.sb3.side_by_side_ars import SideBySideARS
from domino_env.core.files import write_bytes

CLASSES: dict[str, type[BaseAlgorithm]] = {
    "apg": APG,
    "ppo": PPO,
    "ars": SideBySideARS,
}


OF_ROWS = ("apg", "ppo")  # with a `RowPolicy`, whose deviation a preset says


def learner(algorithm: str, plan: Preset, env: VecEnv, seed: int) -> BaseAlgorithm:
    """Make a new learner; it leaves torch with one thread, for more only slow such small networks.

    Parameters
    ----------
    algorithm
        One of `CLASSES`.
    plan
        Hyperparameters.
    env
        What it learns in.
    seed
        Of all its randomness.
    """
    torch.set_num_threads(1)
    options = dict(plan.options)

    def rate(left: float) -> float:
        # the last rollout may go beyond the plan: a rate below the last would turn negative there
        return plan.rate * (plan.last_rate + (1.0 - plan.last_rate) * max(left, 0.0))

    net = [plan.width] * plan.depth
    policy_options: dict[str, Any] = {"net_arch": net}
    if algorithm in OF_ROWS:
        policy_options["activation_fn"] = torch.nn.Tanh
    if algorithm == "apg":
        policy_options["optimizer_kwargs"] = {"eps": 1e-8}  # slopes become small in the end
    if algorithm == "ars":
        policy_options = {}
        spread = options.get("delta_std", 0.05)
        options["delta_std"] = lambda left: spread * rate(left) / plan.rate
    kind: Any = "LinearPolicy" if algorithm == "ars" else RowPolicy
    model = CLASSES[algorithm](
        kind, env, learning_rate=rate, policy_kwargs=policy_options, seed=seed, device="cpu",
        verbose=0, **options,
    )  # fmt: skip
    if algorithm in OF_ROWS:
        policy: Any = model.policy
        policy.end, policy.pull = plan.end, plan.pull
        layout = env.get_attr("observation_layout")[0]
        policy.near_end = layout["near_end"].start + NEAR_END
    return model


def set_deviation(model: BaseAlgorithm, deviation: float) -> None:
    """Set the standard deviation of the actions of APG and PPO, which do not learn it."""
    if isinstance(model.policy, RowPolicy):
        model.policy.deviation = deviation


def policy_of(model: BaseAlgorithm) -> Policy:
    """Give the policy as it is now, without noise."""
    if isinstance(model.policy, RowPolicy):
        return acting(actor_of(weights(model.policy)))
    return lambda observation: model.predict(observation, deterministic=True)[0]


def weights(policy: torch.nn.Module) -> dict[str, Any]:
    """Give a policy's weights as plain arrays, by name."""
    return {name: value.detach().numpy() for name, value in policy.state_dict().items()}


def save_weights(policy: torch.nn.Module, path: Path) -> None:
    """Write a policy's weights as plain arrays."""
    arrays = weights(policy)
    write_bytes(path, lambda file: np.savez_compressed(file, **arrays))


def load_weights(policy: torch.nn.Module, path: Path) -> None:
    """Read a policy's weights; nothing in the file is run.

    Raises
    ------
    ValueError
        Where they do not fit.
    """
    kinds = {name: (value.shape, value.dtype) for name, value in weights(policy).items()}
    arrays = read_weights(path, kinds)
    policy.load_state_dict({name: torch.from_numpy(value) for name, value in arrays.items()})
