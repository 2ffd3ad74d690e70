"""The actor of a PPO policy of stable-baselines3 as a NumPy network; needs no torch."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from agents.base.arrays import read_arrays
from agents.base.building import Observation, Policy
from agents.base.network import Network, Single, network_of, require_network, unfit

# as stable-baselines3 calls its layers
LAST = "action_net."
_HIDDEN = re.compile(r"mlp_extractor\.policy_net\.[0-9]+\.weight")


def actor_of(arrays: Mapping[str, Single]) -> Network:
    """Make the network of means in the arrays of a policy."""
    names = (name.removesuffix("weight") for name in arrays if _HIDDEN.fullmatch(name))
    return network_of(arrays, [*sorted(names, key=lambda name: int(name.split(".")[2])), LAST])


def acting(actor: Network) -> Policy:
    """Make the policy without noise: the mean, within the box of actions."""

    def act(observation: Observation) -> Single:
        return np.asarray(np.clip(actor(observation), -1.0, 1.0), dtype=np.float32)

    return act


def read_actor(path: Path, inputs: int, outputs: int) -> Network:
    """Read the actor in a policy's file; nothing in it is run.

    Parameters
    ----------
    path
        The file.
    inputs, outputs
        Entries of an observation and of an action.

    Raises
    ------
    ValueError
        Where it holds another policy.
    """
    arrays = read_arrays(path)
    try:
        return require_network(actor_of(arrays), inputs, outputs)
    except (ValueError, KeyError) as error:
        raise unfit(path, error) from None
