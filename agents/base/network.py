"""Network: a trained PPO policy without noise, from its weights alone; needs no torch."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.base.arrays import read_weights

Single = NDArray[np.float32]

# as stable-baselines3 calls its layers
LAST = "action_net."
_HIDDEN = re.compile(r"mlp_extractor\.policy_net\.[0-9]+\.weight")


@dataclass(frozen=True, eq=False)
class Network:
    """Layers of tanh with a linear one on top: a weight (outputs, inputs) and a bias (outputs,)."""

    layers: tuple[tuple[Single, Single], ...]

    def __call__(self, seen: Single) -> Single:
        """Compute the action (outputs,) for an observation (inputs,), each entry from -1 to 1."""
        values = seen
        for weight, bias in self.layers[:-1]:
            values = np.tanh(weight @ values + bias)
        weight, bias = self.layers[-1]
        return np.asarray(np.clip(weight @ values + bias, -1.0, 1.0), dtype=np.float32)


def network_of(arrays: Mapping[str, Single]) -> Network:
    """Make the network in the arrays of a policy."""
    stems = sorted(
        (name.removesuffix("weight") for name in arrays if _HIDDEN.fullmatch(name)),
        key=lambda stem: int(stem.split(".")[2]),
    )
    return Network(tuple((arrays[s + "weight"], arrays[s + "bias"]) for s in [*stems, LAST]))


def read_network(path: Path, inputs: int, outputs: int, width: int, depth: int) -> Network:
    """Read the network in a policy's file; nothing in it is run.

    Parameters
    ----------
    path
        The file.
    inputs, outputs
        Entries of an observation and of an action.
    width, depth
        Size and number of the hidden layers.

    Raises
    ------
    ValueError
        Where it holds another policy.
    """
    kinds = arrays_of(inputs, outputs, width, depth)
    single = np.dtype(np.float32)
    return network_of(read_weights(path, {name: (kind, single) for name, kind in kinds.items()}))


def arrays_of(inputs: int, outputs: int, width: int, depth: int) -> dict[str, tuple[int, ...]]:
    """Give names and shapes of all arrays of such a policy, those of its critic too."""
    shapes: dict[str, tuple[int, ...]] = {"log_std": (outputs,)}
    layers = []
    for i in range(depth):
        for net in ("policy_net", "value_net"):
            layers.append((f"mlp_extractor.{net}.{2 * i}.", width, width if i else inputs))
    last = width if depth else inputs
    for stem, rows, columns in [*layers, (LAST, outputs, last), ("value_net.", 1, last)]:
        shapes[stem + "weight"], shapes[stem + "bias"] = (rows, columns), (rows,)
    return shapes
