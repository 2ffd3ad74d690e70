"""Networks in NumPy, which evaluate trained policies without torch."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env.core.files import naming, read_bytes
from domino_env.core.results import brief
from domino_env.core.types import Singles

Policy = Callable[[Singles], NDArray[Any]]
"""Maps an observation to an action."""

# names of layers in Stable-Baselines3
_HIDDEN = re.compile(r"mlp_extractor\.policy_net\.[0-9]+\.weight")
_LAST, _LINEAR = "action_net.", "action_net.0."


@dataclass(frozen=True, eq=False)
class Network:
    """Hidden layers and a linear one: weights (outputs, inputs) and biases (outputs,) of each."""

    layers: tuple[tuple[Singles, Singles], ...]
    activation: Callable[[Singles], Singles] = np.tanh

    __repr__ = brief

    def __call__(self, observations: Singles) -> Singles:
        """Return the outputs (…, outputs) for observations (…, inputs)."""
        values = observations
        for weight, bias in self.layers[:-1]:
            values = self.activation(values @ weight.T + bias)
        weight, bias = self.layers[-1]
        return np.asarray(values @ weight.T + bias)

    @classmethod
    def named(
        cls,
        arrays: Mapping[str, Any],
        names: Sequence[str],
        activation: Callable[[Singles], Singles] = np.tanh,
    ) -> Network:
        """Make a network from the arrays "weight" and "bias" of each named layer."""
        layers = tuple((arrays[name + "weight"], arrays[name + "bias"]) for name in names)
        return cls(layers, activation)

    def require(self, inputs: int, outputs: int) -> Network:
        """Return the network if its layers fit together and have these numbers at their ends.

        Raises
        ------
        ValueError
            For other shapes, and for weights that are not finite float32 numbers.
        """
        size = inputs
        for i, (weight, bias) in enumerate(self.layers):
            shapes = f"layer {i} has shapes {weight.shape} and {bias.shape}"
            if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
                raise ValueError(f"{shapes}: expected {size} inputs")
            for array in (weight, bias):
                if array.dtype != np.float32 or not np.isfinite(array).all():
                    raise ValueError(f"layer {i} has values that are not finite float32 numbers")
            size = weight.shape[0]
        if not self.layers or size != outputs:
            raise ValueError(f"it has {size} outputs, {outputs} are expected")
        return self


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of an .npz file; no pickled code is run.

    Raises
    ------
    ValueError
        If the file is damaged or contains anything else.
    OSError
        If it cannot be read.
    """
    with naming(path):
        file = io.BytesIO(read_bytes(path))  # NumPy does not close a file that is no archive
        try:
            with np.load(file, allow_pickle=False) as archive:
                return dict(archive)
        except Exception as error:  # a damaged archive raises errors of many kinds
            raise ValueError(f"not an archive of arrays (.npz), or damaged: {error}") from None


def read_network(
    path: Path, make: Callable[[Mapping[str, Any]], Network], inputs: int, outputs: int
) -> Network:
    """Read the network that `make` returns for the arrays of a file.

    Raises
    ------
    ValueError
        If the file holds the weights of another policy, or none.
    """
    arrays = read_arrays(path)
    with naming(path):
        try:
            return make(arrays).require(inputs, outputs)
        except (ValueError, KeyError) as error:
            raise ValueError(f"it does not hold the weights of such a policy: {error}") from None


def actor_of(arrays: Mapping[str, Any]) -> Network:
    """Return the network of mean actions of a policy of Stable-Baselines3."""
    if _LINEAR + "weight" in arrays:
        weight = arrays[_LINEAR + "weight"]
        return Network(((weight, np.zeros(len(weight), np.float32)),))
    names = (name.removesuffix("weight") for name in arrays if _HIDDEN.fullmatch(name))
    return Network.named(arrays, [*sorted(names, key=lambda name: int(name.split(".")[2])), _LAST])


def acting(actor: Network, *, squashed: bool = False) -> Policy:
    """Return the policy without noise: the mean action, clipped to [-1, 1] or its tanh."""

    def act(observation: Singles) -> Singles:
        means = actor(observation)
        action = np.tanh(means) if squashed else np.clip(means, -1.0, 1.0)
        return np.asarray(action, dtype=np.float32)

    return act
