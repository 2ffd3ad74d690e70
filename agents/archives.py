"""Archives (.zip) of Stable-Baselines3 and sb3-contrib as policies.

Multilayer perceptrons are rebuilt from their tensors: `data` is read as JSON, in which pickled
objects are text that is not decoded, and `policy.pth` by torch without unpickling. All else is
loaded by Stable-Baselines3, which runs the code in the archive.
"""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from agents.algorithms import require_learning
from agents.network import Network, Policy, acting
from agents.policy import ScenePolicy, require_size
from domino_env.core.types import Singles
from domino_env.scenes.distribution import SceneDistribution

ArrayFunction = Callable[[Singles], Singles]


def _relu(values: Singles) -> Singles:
    return np.maximum(values, 0.0)


ACTIVATIONS: dict[str, ArrayFunction] = {"Tanh": np.tanh, "ReLU": _relu}


class Kind(NamedTuple):
    """Names of the layers of an actor, and its functions."""

    hidden: str  # names of the hidden layers
    last: str  # name of the last layer, if it differs
    activation: str  # default of the hidden layers
    squashed: bool  # whether actions are the tanh of the outputs


KINDS = (
    Kind(r"mlp_extractor\.policy_net\.\d+", "action_net", "Tanh", False),  # PPO, A2C, TRPO
    Kind(r"actor\.latent_pi\.\d+", "actor.mu", "ReLU", True),  # SAC, TQC
    Kind(r"actor\.mu\.\d+", "", "ReLU", True),  # TD3, DDPG
    Kind(r"action_net\.\d+", "", "ReLU", True),  # ARS
)
UNUSED = re.compile(
    r"(log_std|value_net|mlp_extractor\.value_net|actor\.log_std|actor_target|critic)"
)
CHANGING = ("features_extractor_class", "squash_output")  # options that change the function
MODULES = ("stable_baselines3.", "sb3_contrib.", "agents.sb3")  # of policies that are known


class _NoMLPError(ValueError):
    """Reason for which a policy cannot be rebuilt."""


def load_archive(
    path: Path, trust: bool = False, distribution: SceneDistribution | None = None
) -> ScenePolicy:
    """Load an archive of Stable-Baselines3 or sb3-contrib.

    Parameters
    ----------
    path
        The .zip file.
    trust
        Whether the code in the archive may be run, which policies other than plain multilayer
        perceptrons need.
    distribution
        The scene distribution that it was trained on, if any.

    Raises
    ------
    ValueError
        If the file is no such archive, if observations of the distribution have another size, and
        without `trust` if the policy cannot be rebuilt.
    ImportError
        If the extra "rl" is missing.
    """
    require_learning()
    try:
        policy, size = _unpickled(path) if trust else _rebuilt(path)
    except OSError:
        raise
    except Exception as error:  # of the code in the archive, or of damaged files
        advice = "" if trust else (
            "; add --trust to load it with Stable-Baselines3, which runs the code that it "
            "contains, if you know its source"
        )  # fmt: skip
        reason = str(error) if isinstance(error, _NoMLPError) else "damaged, or no such archive"
        raise ValueError(f"{path}: {reason}{advice}") from None
    if distribution is not None:
        require_size(distribution, size)
    return ScenePolicy(path, policy, size, distribution)


def _rebuilt(path: Path) -> tuple[Policy, int]:
    """Return the policy of a multilayer perceptron, and the size of its observations."""
    import torch

    with zipfile.ZipFile(path) as archive:
        data: dict[str, Any] = json.loads(archive.read("data"))
        file = io.BytesIO(archive.read("policy.pth"))
    state = torch.load(file, weights_only=True, map_location="cpu")
    arrays = {name: value.numpy() for name, value in state.items() if not UNUSED.match(name)}
    options = data.get("policy_kwargs") or {}
    module = str(data["policy_class"].get("__module__"))
    if not module.startswith(MODULES) or any(name in options for name in CHANGING):
        raise _NoMLPError(f"its policy is no plain multilayer perceptron ({module})")
    activation = re.search(r"(\w+)'>$", str(options.get("activation_fn", "")))
    layers = {name.rpartition(".")[0] for name in arrays}
    found = [kind for kind in KINDS if layers and set(_names(layers, kind)) == layers]
    if not found:
        raise _NoMLPError(f"its policy is no plain multilayer perceptron ({', '.join(arrays)})")
    function = activation.group(1) if activation else found[0].activation
    if function not in ACTIVATIONS:
        raise _NoMLPError(f"its activation function is {function}, only Tanh and ReLU are known")
    names = _names(layers, found[0])
    for name in names:  # linear policies of ARS have no bias
        arrays.setdefault(f"{name}.bias", np.zeros(len(arrays[f"{name}.weight"]), np.float32))
    network = Network.named(arrays, [f"{name}." for name in names], ACTIVATIONS[function])
    size = network.layers[0][0].shape[1]
    network.require(size, len(network.layers[-1][1]))
    squashed = found[0].squashed and names != ["action_net.0"]  # linear policies are clipped
    return acting(network, squashed=squashed), size


def _names(layers: set[str], kind: Kind) -> list[str]:
    """Return the names of the layers of a kind, in their order."""
    hidden = [name for name in layers if re.fullmatch(kind.hidden, name)]
    hidden.sort(key=lambda name: int(name.rpartition(".")[2]))
    return hidden + [kind.last] * (kind.last in layers)


def _unpickled(path: Path) -> tuple[Policy, int]:
    """Return the policy as Stable-Baselines3 makes it, and the size of its observations."""
    import torch
    from sb3_contrib.ars.policies import ARSPolicy
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.save_util import load_from_zip_file

    torch.set_num_threads(1)
    data, parameters, _ = load_from_zip_file(path, device="cpu")
    assert data is not None
    kind, space = data["policy_class"], data["observation_space"]
    options = dict(data.get("policy_kwargs") or {})
    if issubclass(kind, ActorCriticPolicy):
        options["use_sde"] = data.get("use_sde", False)
    rate = () if issubclass(kind, ARSPolicy) else (lambda _: 0.0,)  # of learning, not needed
    model = kind(space, data["action_space"], *rate, **options)
    model.load_state_dict(parameters["policy"])

    def policy(observation: Singles) -> NDArray[Any]:
        return np.asarray(model.predict(observation, deterministic=True)[0])

    return policy, int(space.shape[0])
