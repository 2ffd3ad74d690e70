"""State of an algorithm of Stable-Baselines3, to resume its training."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm

from domino_env.core.files import errors_with_path

# arrays of a replay buffer
TRANSITIONS = "observations", "next_observations", "actions", "rewards", "dones", "timeouts"


def model_state(model: Any) -> dict[str, Any]:
    """Return weights, optimiser, counters and transitions of an algorithm, for `restore`."""
    state: dict[str, Any] = {
        "parameters": model.get_parameters(),
        "steps": model.num_timesteps,
        "updates": getattr(model, "_n_updates", 0),
        "variables": {name: getattr(model, name).detach() for name in _variables(model)},
    }
    if isinstance(model, OffPolicyAlgorithm):
        buffer: Any = model.replay_buffer
        stored = {name: getattr(buffer, name)[: buffer.size()] for name in TRANSITIONS}
        state["transitions"] = {name: torch.from_numpy(x) for name, x in stored.items()}
        state["next_transition"] = int(buffer.pos)
    return state


def restore(model: Any, state: dict[str, Any]) -> None:
    """Restore the state of an algorithm from `model_state`."""
    model.set_parameters(state["parameters"], exact_match=True, device="cpu")
    model.num_timesteps = int(state["steps"])
    model._n_updates = int(state["updates"])
    for name in _variables(model):
        getattr(model, name).data.copy_(state["variables"][name])
    if isinstance(model, OffPolicyAlgorithm):
        buffer: Any = model.replay_buffer
        for name in TRANSITIONS:
            values = state["transitions"][name].numpy()
            getattr(buffer, name)[: len(values)] = values
        buffer.pos, buffer.full = state["next_transition"], len(values) == buffer.buffer_size
    if hasattr(model, "weights"):  # ARS computes its candidates from a copy of the weights
        model.weights = torch.nn.utils.parameters_to_vector(model.policy.parameters()).detach()


def _variables(model: Any) -> list[str]:
    """Return the names of trained tensors outside the networks, as the entropy coefficient."""
    return list(model._get_torch_save_params()[1])


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint of numbers and tensors without running pickled code.

    Raises
    ------
    ValueError
        If the file is damaged or not a checkpoint.
    """
    with errors_with_path(path):
        try:
            state: dict[str, Any] = torch.load(path, weights_only=True, map_location="cpu")
        except Exception:  # of any kind; its message recommends running pickled code
            raise ValueError(
                "not a checkpoint, or damaged: resume from a copy, or train in another folder"
            ) from None
    return state
