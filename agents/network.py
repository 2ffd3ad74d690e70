"""Network: what a trained PPO policy does without noise, from its weights alone; needs no torch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.arrays import read_arrays

Single = NDArray[np.float32]

HIDDEN, LAST = "mlp_extractor.policy_net.", "action_net."  # as stable-baselines3 calls its layers


@dataclass(frozen=True, eq=False)
class Network:
    """Layers of tanh with a linear one on top: a weight (outputs, inputs) and a bias (outputs,)."""

    layers: tuple[tuple[Single, Single], ...]

    @property
    def inputs(self) -> int:
        """Numbers that it is shown."""
        return int(self.layers[0][0].shape[1])

    def __call__(self, seen: Single) -> Single:
        """(M,) the action for what is seen (inputs,), each entry from -1 to 1."""
        values = seen
        for weight, bias in self.layers[:-1]:
            values = np.tanh(weight @ values + bias)
        weight, bias = self.layers[-1]
        return np.asarray(np.clip(weight @ values + bias, -1.0, 1.0), dtype=np.float32)


def network_of(arrays: dict[str, Single]) -> Network:
    """The network in a policy's arrays.  ValueError where they are none."""
    names = [name for name in arrays if name.startswith(HIDDEN) and name.endswith(".weight")]
    names.sort(key=lambda name: int(name.removeprefix(HIDDEN).removesuffix(".weight")))
    stems = [name.removesuffix("weight") for name in names] + [LAST]
    layers = []
    size = None
    for stem in stems:
        weight, bias = arrays.get(stem + "weight"), arrays.get(stem + "bias")
        if weight is None or bias is None:
            raise ValueError(f"no {stem}weight and {stem}bias")
        fits = weight.ndim == 2 and bias.shape == weight.shape[:1]
        if not fits or (size is not None and weight.shape[1] != size):
            raise ValueError(f"{stem}weight {weight.shape} does not fit {size} values before it")
        if not (np.isfinite(weight).all() and np.isfinite(bias).all()):
            raise ValueError(f"{stem} is not finite throughout")
        size = weight.shape[0]
        layers.append((np.asarray(weight, np.float32), np.asarray(bias, np.float32)))
    return Network(tuple(layers))


def read_weights(path: Path) -> dict[str, Single]:
    """The arrays in a policy's file; nothing in it is run.  ValueError where it holds none."""
    try:
        return read_arrays(path)
    except ValueError as error:
        raise ValueError(f"{path} does not hold the weights of a policy: {error}") from None


def read_network(path: Path) -> Network:
    """The network in a policy's file.  ValueError where it holds none."""
    try:
        return network_of(read_weights(path))
    except ValueError as error:
        told = str(error)
        told = (
            told if str(path) in told else f"{path} does not hold the weights of a policy: {told}"
        )
        raise ValueError(told) from None
