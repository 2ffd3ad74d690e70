"""Network: the one form in which trained policies are used, from weights alone, without torch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from domino_env.core.results import brief

Single = NDArray[np.float32]

LARGEST = 1e6  # weight that is believed: with larger ones sums might overflow


@dataclass(frozen=True, eq=False)
class Network:
    """Layers of tanh with a linear one on top: a weight (outputs, inputs) and a bias (outputs,)."""

    layers: tuple[tuple[Single, Single], ...]

    __repr__ = brief

    def __call__(self, observations: Single) -> Single:
        """Compute the outputs (…, outputs) for observations (…, inputs)."""
        values = observations
        for weight, bias in self.layers[:-1]:
            values = np.tanh(values @ weight.T + bias)
        weight, bias = self.layers[-1]
        return np.asarray(values @ weight.T + bias)

    def arrays(self, names: Sequence[str]) -> dict[str, Single]:
        """Name the weights, for a file: each layer's name with "weight" and "bias" behind it."""
        return {
            name + part: array
            for name, layer in zip(names, self.layers, strict=True)
            for part, array in zip(("weight", "bias"), layer, strict=True)
        }


def network_of(arrays: Mapping[str, Single], names: Sequence[str]) -> Network:
    """Make the network whose layers have these names, the inverse of `Network.arrays`."""
    return Network(tuple((arrays[name + "weight"], arrays[name + "bias"]) for name in names))


def require_network(network: Network, inputs: int, outputs: int) -> Network:
    """Return the network if it can be used.

    Parameters
    ----------
    network
        The network.
    inputs, outputs
        Entries of an observation and of an action.

    Raises
    ------
    ValueError
        For layers that do not fit each other or these sizes, and for values that are no single
        precision numbers, not finite or too large.
    """
    size = inputs
    for i, (weight, bias) in enumerate(network.layers):
        for array in (weight, bias):
            if array.dtype != np.float32:
                raise ValueError(f"layer {i} is of {array.dtype}, not float32")
        if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
            raise ValueError(f"layer {i} has shapes {weight.shape} and {bias.shape}")
        if not all(np.all(np.abs(array) <= LARGEST) for array in (weight, bias)):
            raise ValueError(f"layer {i} holds values that are not finite or beyond ±{LARGEST:g}")
        size = weight.shape[0]
    if not network.layers or size != outputs:
        raise ValueError(f"it ends in {size} numbers, not {outputs}")
    return network


def unfit(path: Path, reason: object) -> ValueError:
    """Make the error for a file that does not hold the weights of a policy."""
    return ValueError(f"{path}: it does not hold the weights of such a policy: {reason}")
