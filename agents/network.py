"""Multilayer perceptrons in NumPy, which evaluate trained policies without torch."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env.core.files import errors_with_path, read_bytes
from domino_env.core.types import Singles

Policy = Callable[[Singles], NDArray[Any]]
"""Function from observations (…, O) to actions (…, A)."""

ArrayFunction = Callable[[Singles], Singles]


ACTIVATIONS: dict[str, ArrayFunction] = {"Tanh": np.tanh, "ReLU": lambda x: np.maximum(x, 0.0)}


class UnsupportedPolicyError(ValueError):
    """Error for an archive that cannot be loaded as a plain multilayer perceptron."""


# names of the layers of an actor, with its default activation, and True if its actions are the tanh
# of the outputs
ACTORS = (
    (r"mlp_extractor\.policy_net\.\d+|action_net", "Tanh", False),  # PPO, A2C, TRPO
    (r"actor\.(latent_pi\.\d+|mu(\.\d+)?)|action_net\.\d+", "ReLU", True),  # SAC, TD3, TQC, ARS
)
# beginnings of the names of arrays on which mean actions do not depend
UNUSED_WEIGHTS = re.compile(
    r"(log_std|value_net|mlp_extractor\.value_net|actor\.log_std|actor_target|critic)"
)


@dataclass(frozen=True, eq=False)
class Network:
    """Multilayer perceptron with a linear last layer.

    Parameters
    ----------
    layers
        Weights (outputs, inputs) and biases (outputs,) of each layer, float32.
    activation
        Activation function of the hidden layers.
    squashed
        If True, actions are the tanh of the outputs, else the outputs clipped to [-1, 1].
    """

    layers: tuple[tuple[Singles, Singles], ...]
    activation: ArrayFunction = np.tanh
    squashed: bool = False

    def __call__(self, observations: Singles) -> Singles:
        """Return the outputs (…, outputs) for observations (…, inputs)."""
        values = observations
        for weight, bias in self.layers[:-1]:
            values = self.activation(values @ weight.T + bias)
        weight, bias = self.layers[-1]
        return np.asarray(values @ weight.T + bias)

    def act(self, observations: Singles) -> Singles:
        """Return the actions (…, outputs) without noise for observations (…, inputs)."""
        means = self(observations)
        actions = np.tanh(means) if self.squashed else np.clip(means, -1.0, 1.0)
        return np.asarray(actions, dtype=np.float32)

    @classmethod
    def make(
        cls,
        arrays: Mapping[str, Any],
        names: Sequence[str],
        activation: ArrayFunction = np.tanh,
        squashed: bool = False,
    ) -> Network:
        """Return the network whose layers have the arrays `{name}weight` and `{name}bias`."""
        layers = tuple((arrays[name + "weight"], arrays[name + "bias"]) for name in names)
        return cls(layers, activation, squashed)

    def require(self, inputs: int, outputs: int) -> Network:
        """Return the network if its layers fit together and it has these inputs and outputs.

        Raises
        ------
        ValueError
            If the shapes differ, or if weights are not finite float32 numbers.
        """
        size = inputs
        for i, (weight, bias) in enumerate(self.layers):
            if weight.ndim != 2 or weight.shape[1] != size or bias.shape != weight.shape[:1]:
                shapes = f"{weight.shape} and {bias.shape}"
                raise ValueError(f"layer {i} has shapes {shapes}: expected (n, {size}) and (n,)")
            for array in (weight, bias):
                if array.dtype != np.float32 or not np.isfinite(array).all():
                    raise ValueError(f"layer {i} has values that are not finite float32 numbers")
            size = weight.shape[0]
        if not self.layers or size != outputs:
            raise ValueError(f"the last layer has {size} outputs: expected {outputs}")
        return self


def read_arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of an .npz file; no pickled code is run.

    Returns
    -------
    dict
        Arrays by name.

    Raises
    ------
    ValueError
        If the file is damaged or contains anything else.
    OSError
        If it cannot be read.
    """
    with errors_with_path(path):
        file = io.BytesIO(read_bytes(path))  # NumPy does not close a file that is no archive
        try:
            with np.load(file, allow_pickle=False) as archive:
                return dict(archive)
        except Exception as error:  # a damaged archive raises errors of many kinds
            raise ValueError(f"not an archive of arrays (.npz), or damaged: {error}") from None


def read_network(
    path: Path, make: Callable[[Mapping[str, Any]], Network], inputs: int, outputs: int
) -> Network:
    """Return the network that `make` builds from the arrays of a file, after checks.

    Raises
    ------
    ValueError
        If the file does not have the weights of a network with these inputs and outputs.
    OSError
        If it cannot be read.
    """
    arrays = read_arrays(path)
    with errors_with_path(path):
        try:
            return make(arrays).require(inputs, outputs)
        except (ValueError, KeyError) as error:
            raise ValueError(f"not the weights of this policy: {error}; train it again") from None


def build_actor(arrays: Mapping[str, Any], activation: str | None = None) -> Network:
    """Return the network of mean actions of a policy of Stable-Baselines3 or sb3-contrib.

    Parameters
    ----------
    arrays
        Weights by name, in the order of the layers; those of critics are ignored.
    activation
        Name of the activation function in torch; None for the default of the policy.

    Raises
    ------
    UnsupportedPolicyError
        If the policy is not a multilayer perceptron with Tanh or ReLU.
    """
    arrays = {name: value for name, value in arrays.items() if not UNUSED_WEIGHTS.match(name)}
    layers = list(dict.fromkeys(name.rpartition(".")[0] for name in arrays))
    kinds = [kind for kind in ACTORS if all(re.fullmatch(kind[0], layer) for layer in layers)]
    if not (layers and kinds and all(name.endswith(("weight", "bias")) for name in arrays)):
        raise UnsupportedPolicyError(
            f"its policy is not a plain multilayer perceptron ({', '.join(arrays)})"
        )
    _, default, squashed = kinds[0]
    function = activation or default
    if function not in ACTIVATIONS:
        raise UnsupportedPolicyError(
            f"its activation function is {function}: expected Tanh or ReLU"
        )
    if not any(name.endswith("bias") for name in arrays):  # linear policies of ARS
        arrays |= {f"{x}.bias": np.zeros(len(arrays[f"{x}.weight"]), np.float32) for x in layers}
    squashed = squashed and layers != ["action_net.0"]  # linear policies are clipped
    return Network.make(arrays, [f"{name}." for name in layers], ACTIVATIONS[function], squashed)
