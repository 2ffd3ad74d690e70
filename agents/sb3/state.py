"""The state of a learner, as plain numbers and tensors: what going on to the same bits needs."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm

from agents.base.checkpoint import require_finite


def state_of(model: BaseAlgorithm) -> dict[str, Any]:
    """Give weights, optimisers, counters and random numbers."""
    _, keys, place, _, _ = np.random.get_state(legacy=True)  # noqa: NPY002 - the learner draws from it
    return {
        "parameters": model.get_parameters(),
        "steps": model.num_timesteps,
        "updates": getattr(model, "_n_updates", 0),
        "episodes": model._episode_num,
        "torch": torch.get_rng_state(),
        "numpy": torch.from_numpy(np.asarray(keys).astype(np.int64)),
        "place": int(place),
    }


def restore(model: Any, state: dict[str, Any]) -> None:
    """Take a learner back to what `state_of` gave.

    Raises
    ------
    ValueError
        For weights that are not finite; a state that does not fit raises whatever it leads to, see
        `agents.base.checkpoint.read_checkpoint`. The learner is of no use then.
    """
    model.set_parameters(state["parameters"], exact_match=True, device="cpu")
    require_finite(model.policy)
    torch.set_rng_state(state["torch"])
    model.num_timesteps = int(state["steps"])
    model._n_updates = int(state["updates"])
    model._episode_num = int(state["episodes"])
    keys = state["numpy"].numpy().astype(np.uint32)
    np.random.set_state(("MT19937", keys, state["place"], 0, 0.0))  # noqa: NPY002
