"""Policies from archives (.zip) of Stable-Baselines3 and sb3-contrib.

Multilayer perceptrons are rebuilt from their tensors without running code of the archive: `data` is
read as JSON, whose pickled objects stay encoded text, and torch reads `policy.pth` without
unpickling. Archives that are trusted are loaded by Stable-Baselines3, unless their policy is
recurrent, which runs the code in them. Statistics of `VecNormalize` are stored as a pickle, which
can also run code. They are read from `vecnormalize.pkl` or `vec_normalize.pkl` in the folder of the
archive, or from `vecnormalize.pkl` in a subfolder with the name of the environment, as rl-zoo3
writes it. If there is no such file, but the last observations of the training, whose bytes are in
`data`, are outside the observation space, they were normalised, and the archive is rejected.
"""

from __future__ import annotations

import base64
import io
import json
import pickletools
import re
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.algorithms import require_learning
from agents.network import Policy, UnsupportedPolicyError, build_actor
from agents.policy import ScenePolicy, find_environment, policy_of
from domino_env.core.types import Floats, Singles
from domino_env.scenes.distribution import SceneDistribution

# keys of policy_kwargs with which the tensors alone do not determine the actions
UNSUPPORTED_OPTIONS = ("features_extractor_class", "squash_output", "use_sde")
STATISTICS = "vecnormalize.pkl", "vec_normalize.pkl"  # names of files, the first of rl-zoo3
MODULES = ("stable_baselines3.", "sb3_contrib.", "agents.sb3")  # modules of supported policies


def load_archive(
    path: Path, trust: bool = False, distribution: SceneDistribution | None = None
) -> ScenePolicy:
    """Load an archive of Stable-Baselines3 or sb3-contrib.

    Parameters
    ----------
    path
        The .zip file.
    trust
        If True, code in the archive may be run. Required for policies other than plain multilayer
        perceptrons, and for archives with statistics of `VecNormalize`.
    distribution
        The scene distribution of the training; None for a single scene.

    Returns
    -------
    ScenePolicy
        The policy, without exploration noise.

    Raises
    ------
    ValueError
        If the file is not such an archive, if observations of the distribution differ from those in
        training, if the policy cannot be rebuilt and `trust` is False, if it is recurrent, or if
        its observations were normalised and the statistics are missing.
    OSError
        If a file cannot be read.
    ImportError
        If the extra "rl" is missing.
    """
    require_learning()
    try:
        statistics = _find_statistics(path)
        if statistics is not None and not trust:
            raise UnsupportedPolicyError(
                f"its observations were normalised by {statistics}, a pickle"
            )
        with zipfile.ZipFile(path) as archive:
            data: dict[str, Any] = json.loads(archive.read("data"))
        policy, size = _unpickle(path) if trust else _rebuild(path, data)
        bounds, latest = _bounds(data["observation_space"], size), _last_observations(data, size)
        if statistics is not None:
            policy = _normalise(policy, statistics)
    except OSError:
        raise
    except Exception as error:  # of any kind: from code in the archive, or from a damaged file
        advice = "" if trust else (
            "; add --trust to load it with Stable-Baselines3, which runs the code that it "
            "contains, if you trust its source"
        )  # fmt: skip
        reason = "damaged, or not an archive of Stable-Baselines3 or sb3-contrib"
        if isinstance(error, UnsupportedPolicyError):
            reason = str(error)
        raise ValueError(f"{path}: {reason}{advice}") from None
    if statistics is None and np.any((latest < bounds[0]) | (latest > bounds[1])):
        raise ValueError(
            f"{path}: its observations were normalised in training (VecNormalize), and the "
            f"statistics are missing: save them as {path.parent / STATISTICS[0]}"
        )
    if distribution is not None:
        find_environment(distribution, bounds, policy)
    return ScenePolicy(path, policy, bounds, distribution)


def _bounds(space: dict[str, Any], size: int) -> Floats:
    """Return the bounds (2, O) of observations from the text of a space; nan if not readable."""
    rows = [re.findall(r"[-+.\w]+", str(space.get(name))) for name in ("low", "high")]
    if any(len(row) != size for row in rows):
        return np.full((2, size), np.nan)
    return np.array(rows, dtype=np.float64)


def _last_observations(data: dict[str, Any], size: int) -> Singles:
    """Return the last observations (B, O) of the training; none if the archive has none.

    They are a pickled array, whose bytes are read without unpickling.
    """
    encoded = (data.get("_last_obs") or {}).get(":serialized:", "")
    code = base64.b64decode(encoded) or b"."
    found = [x for _, x, _ in pickletools.genops(code) if isinstance(x, bytes | bytearray)]
    arrays = [np.frombuffer(x, np.float32) for x in found if len(x) % (4 * size) == 0]
    return (arrays or [np.empty(0, np.float32)])[0].reshape(-1, size)


def _rebuild(path: Path, data: dict[str, Any]) -> tuple[Policy, int]:
    """Rebuild a multilayer perceptron; return the policy and the size of its observations."""
    import torch

    with zipfile.ZipFile(path) as archive:
        file = io.BytesIO(archive.read("policy.pth"))
    state = torch.load(file, weights_only=True, map_location="cpu")
    arrays = {name: value.numpy() for name, value in state.items()}
    options = data.get("policy_kwargs") or {}
    module = str(data["policy_class"].get("__module__"))
    if not module.startswith(MODULES) or any(map(options.get, UNSUPPORTED_OPTIONS)):
        raise UnsupportedPolicyError(f"its policy is not a plain multilayer perceptron ({module})")
    activation = re.search(r"(\w+)'>$", str(options.get("activation_fn", "")))
    network = build_actor(arrays, activation.group(1) if activation else None)
    size = network.layers[0][0].shape[1]
    network.require(size, len(network.layers[-1][1]))
    return network.act, size


def _unpickle(path: Path) -> tuple[Policy, int]:
    """Load a policy with Stable-Baselines3; return it and the size of its observations."""
    import torch
    from sb3_contrib.ars.policies import ARSPolicy
    from stable_baselines3.common.policies import ActorCriticPolicy
    from stable_baselines3.common.save_util import load_from_zip_file

    torch.set_num_threads(1)
    data, parameters, _ = load_from_zip_file(path, device="cpu")
    assert data is not None
    policy_class, space = data["policy_class"], data["observation_space"]
    options = dict(data.get("policy_kwargs") or {})
    if issubclass(policy_class, ActorCriticPolicy):
        options["use_sde"] = data.get("use_sde", False)
    # policies require a schedule of the learning rate, which is not used here
    rate = () if issubclass(policy_class, ARSPolicy) else (lambda _: 0.0,)
    model = policy_class(space, data["action_space"], *rate, **options)
    model.load_state_dict(parameters["policy"])
    size = int(space.shape[0])
    return policy_of(model, size), size


def _find_statistics(path: Path) -> Path | None:
    """Return the file with the `VecNormalize` statistics of an archive; None if there is none."""
    folder = path.parent
    files = (folder / name for name in STATISTICS)
    return next(filter(Path.exists, (*files, *folder.glob(f"Domino*-v*/{STATISTICS[0]}"))), None)


def _normalise(policy: Policy, statistics: Path) -> Policy:
    """Return a policy whose observations are normalised by the statistics in a pickle."""
    import pickle

    from stable_baselines3.common.vec_env import VecNormalize

    with statistics.open("rb") as file:
        wrapper = pickle.load(file)
    if not isinstance(wrapper, VecNormalize):
        raise UnsupportedPolicyError(f"{statistics} has no VecNormalize statistics: move it away")

    def act(observation: Singles) -> NDArray[Any]:
        return policy(np.asarray(wrapper.normalize_obs(observation), dtype=np.float32))

    return act
