"""Learner: an algorithm of stable-baselines3 set up by its preset; its state without pickles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from sb3_contrib import TQC
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.vec_env import VecEnv

from agents.base.arrays import read_weights
from agents.base.checkpoint import require_finite, taken_up
from agents.base.network import network_of
from agents.sb3.presets import Preset
from agents.sb3.row_policy import RowPolicy
from agents.sb3.side_by_side_ars import SideBySideARS
from domino_env.support.files import write_bytes

CLASSES: dict[str, type[BaseAlgorithm]] = {
    "ppo": PPO,
    "sac": SAC,
    "td3": TD3,
    "tqc": TQC,
    "ars": SideBySideARS,
}


NOISY = ("ppo", "td3")  # whose actions get the deviation that a preset says


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
    if algorithm == "ppo":
        policy_options["activation_fn"] = torch.nn.Tanh
    assert env.action_space.shape is not None
    size = env.action_space.shape[0]
    if "target_entropy" in options:
        options["target_entropy"] *= size
    if algorithm == "td3":
        first = plan.first_deviation
        options["action_noise"] = NormalActionNoise(np.zeros(size), np.full(size, first))
    if algorithm == "ars":
        policy_options = {}
        spread = options.get("delta_std", 0.05)
        options["delta_std"] = lambda left: spread * rate(left) / plan.rate
    kind: Any = {"ppo": RowPolicy, "ars": "LinearPolicy"}.get(algorithm, "MlpPolicy")
    model = CLASSES[algorithm](
        kind, env, learning_rate=rate, policy_kwargs=policy_options, seed=seed, device="cpu",
        verbose=0, **options,
    )  # fmt: skip
    if algorithm == "ppo":
        policy: Any = model.policy
        policy.end, policy.pull = plan.end, plan.pull
    return model


def set_deviation(model: BaseAlgorithm, deviation: float) -> None:
    """Set the standard deviation of the actions of PPO and TD3, which do not learn it."""
    if isinstance(model.policy, RowPolicy):
        model.policy.deviation = deviation
    noise: Any = getattr(model, "action_noise", None)
    for one in getattr(noise, "noises", ()):
        one._sigma = np.full_like(one._sigma, deviation)


def builder(model: BaseAlgorithm, algorithm: str) -> Callable[[Any], Any]:
    """Give the policy without noise, as a function from observation to action."""
    if algorithm == "ppo":
        return network_of(weights(model.policy))
    return lambda seen: model.predict(seen, deterministic=True)[0]


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


def save_state(model: BaseAlgorithm, more: dict[str, Any], path: Path) -> None:
    """Write all that going on needs: weights, optimisers, counters, random numbers, buffer."""
    _, keys, place, _, _ = np.random.get_state(legacy=True)  # noqa: NPY002 - the learner draws from it
    state: dict[str, Any] = {
        "parameters": model.get_parameters(),
        "steps": model.num_timesteps,
        "updates": getattr(model, "_n_updates", 0),
        "episodes": model._episode_num,
        "torch": torch.get_rng_state(),
        "numpy": torch.from_numpy(np.asarray(keys).astype(np.int64)),
        "place": int(place),
        "more": more,
    }
    entropy = getattr(model, "log_ent_coef", None)
    if entropy is not None:
        state["entropy"] = entropy.detach()
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        state["buffer"] = {
            name: torch.from_numpy(getattr(buffer, name))
            for name in ("observations", "next_observations", "actions", "rewards", "dones")
        }
        state["buffer_place"] = [int(buffer.pos), bool(buffer.full)]
    write_bytes(path, lambda file: torch.save(state, file))


def load_state(model: Any, path: Path) -> dict[str, Any]:
    """Take a learner back to where `save_state` left it.

    Returns
    -------
    dict
        What was kept beside it.

    Raises
    ------
    ValueError
        For what is no checkpoint of such a learner, which is of no use then.
    """
    with taken_up(path) as state:
        model.set_parameters(state["parameters"], exact_match=True, device="cpu")
        require_finite(model.policy)
        torch.set_rng_state(state["torch"])
        model.num_timesteps = int(state["steps"])
        model._n_updates = int(state["updates"])
        model._episode_num = int(state["episodes"])
        keys = state["numpy"].numpy().astype(np.uint32)
        np.random.set_state(("MT19937", keys, state["place"], 0, 0.0))  # noqa: NPY002
        if "entropy" in state:
            model.log_ent_coef.data.copy_(state["entropy"])
        if "buffer" in state:
            buffer = model.replay_buffer
            for name, values in state["buffer"].items():
                getattr(buffer, name)[:] = values.numpy()
            buffer.pos, buffer.full = state["buffer_place"]
        more: dict[str, Any] = state["more"]
    return more
