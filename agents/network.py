"""Networks in NumPy: the form in which trained policies are used, from weights alone, no torch."""

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

# names of layers in stable-baselines3
_HIDDEN = re.compile(r"mlp_extractor\.policy_net\.[0-9]+\.weight")
_LAST, _LINEAR = "action_net.", "action_net.0."


@dataclass(frozen=True, eq=False)
class Network:
    """Layers of tanh with a linear one on top: a weight (outputs, inputs) and a bias (outputs,)."""

    layers: tuple[tuple[Singles, Singles], ...]

    __repr__ = brief

    def __call__(self, observations: Singles) -> Singles:
        """Compute the outputs (…, outputs) for observations (…, inputs)."""
        values = observations
        for weight, bias in self.layers[:-1]:
            values = np.tanh(values @ weight.T + bias)
        weight, bias = self.layers[-1]
        return np.asarray(values @ weight.T + bias)

    @classmethod
    def named(cls, arrays: Mapping[str, Any], names: Sequence[str]) -> Network:
        """Make a network of arrays: the name of each layer, followed by "weight" and by "bias"."""
        return cls(tuple((arrays[name + "weight"], arrays[name + "bias"]) for name in names))

    def require(self, inputs: int, outputs: int) -> Network:
        """Return the network if its layers fit each other and these sizes.

        Raises
        ------
        ValueError
            For other shapes, and for weights that are not finite single-precision numbers.
        """
        size = inputs
        for i, (weight, bias) in enumerate(self.layers):
            shapes = f"layer {i} has shapes {weight.shape} and {bias.shape}"
            if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
                raise ValueError(f"{shapes}, where {size} numbers enter")
            for array in (weight, bias):
                if array.dtype != np.float32 or not np.isfinite(array).all():
                    raise ValueError(f"layer {i} holds other values than finite float32 numbers")
            size = weight.shape[0]
        if not self.layers or size != outputs:
            raise ValueError(f"it ends in {size} numbers, where {outputs} are expected")
        return self


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of an .npz file; no pickled code is run.

    Raises
    ------
    ValueError
        Where the file is damaged or holds anything else.
    OSError
        Where it cannot be read.
    """
    with naming(path):
        file = io.BytesIO(read_bytes(path))  # NumPy leaves files open that are no archives
        try:
            with np.load(file, allow_pickle=False) as archive:
                return dict(archive)
        except Exception as error:  # damaged archives lead their readers to many kinds of errors
            raise ValueError(f"not an archive of arrays (.npz), or damaged: {error}") from None


def read_network(
    path: Path, make: Callable[[Mapping[str, Any]], Network], inputs: int, outputs: int
) -> Network:
    """Read the network that `make` builds of the arrays of a file.

    Raises
    ------
    ValueError
        Where the file holds the weights of another policy, or none.
    """
    arrays = read_arrays(path)
    with naming(path):
        try:
            return make(arrays).require(inputs, outputs)
        except (ValueError, KeyError) as error:
            raise ValueError(f"it does not hold the weights of such a policy: {error}") from None


def actor_of(arrays: Mapping[str, Any]) -> Network:
    """Make the network of mean actions of a policy of stable-baselines3: layers, or linear."""
    if _LINEAR + "weight" in arrays:
        weight = arrays[_LINEAR + "weight"]
        return Network(((weight, np.zeros(len(weight), np.float32)),))
    names = (name.removesuffix("weight") for name in arrays if _HIDDEN.fullmatch(name))
    return Network.named(arrays, [*sorted(names, key=lambda name: int(name.split(".")[2])), _LAST])


def acting(actor: Network) -> Policy:
    """Make the policy without noise: the mean action, limited to [-1, 1]."""

    def act(observation: Singles) -> Singles:
        return np.asarray(np.clip(actor(observation), -1.0, 1.0), dtype=np.float32)

    return act
