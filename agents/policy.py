"""Policies that build layouts domino by domino, and the files in the folder of a training.

config.json     algorithm, seed, hyperparameters   progress.csv    learning curve
policy.npz      weights, as plain arrays           summary.json    result of the training
checkpoint.pt   state of a training to resume      scene.toml      the scene, or the distribution

With a single scene it also has

policy.json     result of the best policy          result.png      learning curve and layout
layout.csv/json the layout that it builds
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from agents.algorithms import ALGORITHMS, Hyperparameters
from agents.network import Policy, UnsupportedPolicyError, build_actor, read_network
from agents.rollout import Rollout, build
from domino_env import Scene, SceneDistribution
from domino_env.core.checks import require, require_choice, require_type
from domino_env.core.files import errors_with_path, read_json
from domino_env.core.models import Document, read_document
from domino_env.core.progress import notice
from domino_env.core.types import Floats, Singles
from domino_env.envs import CHAIN, ENVIRONMENTS, Environment
from domino_env.envs.spaces import ObservationLayout, action_entries
from domino_env.envs.vector import WINDOW
from domino_env.scenes.distribution import load_any

CONFIG, PROGRESS, POLICY = "config.json", "progress.csv", "policy.npz"
SUMMARY, CHECKPOINT, SCENE = "summary.json", "checkpoint.pt", "scene.toml"
BEST = "policy.json"
FILES = (
    CONFIG, PROGRESS, POLICY, SUMMARY, CHECKPOINT, SCENE, BEST, "layout.csv", "layout.json",
    "result.png",
)  # fmt: skip

POLICIES = Path(__file__).with_name("policies")
DESIGNER = "designer"  # name of the shipped scene-conditioned policy
MAX_WINDOW, MAX_FEATURES = 40, 20  # of observations that an error message recognises


class ConfigDocument(Document):
    """Arguments of a training, as in config.json; see `agents.train`."""

    algorithm: str
    seed: Annotated[int, Meta(ge=0, le=2**32 - 1)]
    steps: Annotated[int, Meta(ge=1)]
    hyperparameters: Hyperparameters
    num_scenes: Annotated[int, Meta(ge=1)] | None = None

    def __post_init__(self) -> None:
        require_choice("algorithm", self.algorithm, ALGORITHMS)


def policy_names() -> list[str]:
    """Return the names of the policies for one scene that come with the package."""
    return sorted(folder.parent.name for folder in POLICIES.glob(f"*/{SCENE}"))


def find_folder(run: str | Path) -> Path:
    """Return the folder of a training, or of the shipped policy under a name.

    A folder of the same name is given as a Path, or as "./name".
    """
    require_type("run", run, str | Path, "the name of a policy, or a folder or file")
    if run not in (*policy_names(), DESIGNER):
        return Path(run)
    if Path(run).exists():
        notice(f"'{run}' is the shipped policy: give ./{run} for the folder")
    return POLICIES / run


def read_config(folder: Path) -> ConfigDocument:
    """Read the arguments of a training; raise ValueError for a folder without them."""
    path = folder / CONFIG
    if not path.exists():
        raise ValueError(
            f"{folder} holds no training to resume: leave out --resume, and give another folder if "
            "this one holds other files of a run"
        )
    return read_document(ConfigDocument, path)


def read_summary(folder: Path) -> dict[str, Any]:
    """Read the summary of a training, else that of its best policy; empty if there is none."""
    path = folder / (SUMMARY if (folder / SUMMARY).exists() else BEST)
    if not path.exists():
        return {}
    with errors_with_path(path):
        summary = read_json(path)
        if not isinstance(summary, dict):
            raise ValueError("not a table, as domino train writes it: train again")
        require("seconds", summary.get("seconds", 0.0), 0.0)
        return dict(summary)


@dataclass(frozen=True, eq=False)
class ScenePolicy:
    """A policy that builds a layout domino by domino, trained on one scene or on a distribution.

    Attributes
    ----------
    source
        The folder or file that it was loaded from.
    policy
        Maps an observation to an action.
    bounds
        (2, O) smallest and largest value of each entry of an observation; nan if not known.
    scene
        The scene or the distribution that it was trained on; None if it is not known.
    """

    source: Path
    policy: Policy
    bounds: Floats
    scene: Scene | SceneDistribution | None = None

    @classmethod
    def load(cls, folder: Path) -> ScenePolicy:
        """Load the best policy of a training; NumPy alone is enough.

        Raises
        ------
        ValueError
            If the folder holds no such policy.
        """
        if not ((folder / SCENE).exists() and (folder / POLICY).exists()):
            raise ValueError(f"{folder} holds no policy: name the folder of a finished training")
        scene = load_any(folder / SCENE)
        bounds = observation_bounds(scene)
        outputs = action_entries(scene if isinstance(scene, Scene) else scene.first)
        actor = read_network(folder / POLICY, build_actor, bounds.shape[1], outputs)
        return cls(folder, actor.act, bounds, scene)

    def trained_on(self, distribution: SceneDistribution) -> ScenePolicy:
        """Return the policy of an archive for scenes of a distribution.

        If it observes the sampled numbers, it was trained on the distribution, and otherwise on a
        single scene.

        Raises
        ------
        ValueError
            If its observations are neither those of the distribution nor those of its scenes.
        """
        if same_observations(self.bounds, observation_bounds(distribution.first)):
            return self
        find_environment(distribution, self.bounds, self.policy)
        return replace(self, scene=distribution)

    def build(self, scene: Scene | None = None) -> Rollout:
        """Build a layout.

        Parameters
        ----------
        scene
            A scene with the same observations; None for that of the training.

        Returns
        -------
        Rollout
            The layout with its wave, its score and the uniform baseline.

        Raises
        ------
        ValueError
            If observations of the scene differ, or if no scene is known.
        """
        require_type("scene", scene, Scene | None, "a Scene, as load_scene returns")
        target = scene or self.scene
        if not isinstance(target, Scene):
            raise ValueError(f"policy '{self.source}' has no scene of its own: give one (--scene)")
        if isinstance(self.scene, SceneDistribution):
            return build(self.policy, target, distribution=self.scene)
        environment = find_environment(target, self.bounds, self.policy)
        return build(self.policy, target, environment=environment)


def policy_of(model: Any, size: int) -> Policy:
    """Return the policy of an object with the method `predict` of Stable-Baselines3.

    Parameters
    ----------
    model
        Its `predict(observations, deterministic=True)` maps observations (B, O) to a tuple of the
        actions (B, A) and None, or the state of a recurrent policy.
    size
        O, the number of entries of an observation.

    Raises
    ------
    UnsupportedPolicyError
        If the policy is recurrent, as layouts are built without a state between steps.
    """

    def act(observations: Singles) -> NDArray[Any]:
        actions = model.predict(np.atleast_2d(observations), deterministic=True)[0]
        return np.asarray(actions if observations.ndim > 1 else actions[0])

    _, *states = model.predict(np.zeros((1, size), np.float32), deterministic=True)
    if any(state is not None for state in states):
        raise UnsupportedPolicyError(
            "its policy is recurrent, but layouts are built without a state between steps: give "
            "another policy"
        )
    return act


def observation_bounds(
    target: Scene | SceneDistribution, environment: Environment = CHAIN
) -> Floats:
    """Return the smallest and largest values (2, O) of observations of one or many scenes."""
    space: Any = environment.make(target).observation_space
    return np.array([space.low, space.high], dtype=np.float64)


def same_observations(bounds: Floats, others: Floats) -> bool:
    """Return True if bounds (2, O) of observations are equal, as far as they are known."""
    if bounds.shape != others.shape:
        return False
    return bool(np.all(np.isclose(bounds, others, rtol=1e-6) | np.isnan(bounds)))


def find_environment(
    target: Scene | SceneDistribution, bounds: Floats, policy: Policy
) -> Environment:
    """Return the environment whose observations of one or many scenes have the bounds (2, O).

    Parameters
    ----------
    target
        The scene, or the distribution of the sampled scenes.
    bounds
        See `ScenePolicy`.
    policy
        The policy. Its actions distinguish environments with equal observations, and show whether
        the same variables are free.

    Raises
    ------
    ValueError
        If there is none; the message has the arguments of an environment that explain the
        difference, if there are any.
    """
    shape, alike = policy(np.zeros(bounds.shape[1], np.float32)).shape, list[Environment]()
    for environment in ENVIRONMENTS.values():
        with suppress(ValueError):  # it rejects such scenes
            if same_observations(bounds, observation_bounds(target, environment)):
                if environment.make(target).action_space.shape == shape:
                    return environment
                alike.append(environment)
    if alike:
        return alike[0]
    expected = observation_bounds(target)
    first = target if isinstance(target, Scene) else target.first
    total = 0 if isinstance(target, Scene) else len(target.features)
    same_variables = shape == (action_entries(first),)
    difference = ""
    for window, number in product(range(MAX_WINDOW + 1), range(MAX_FEATURES + 1)):
        space = ObservationLayout(first, window, number).space
        if same_variables and np.array_equal(bounds.astype(np.float32), [space.low, space.high]):
            parts = [f"window = {window} instead of {WINDOW}"] * (window != WINDOW)
            parts += [f"{number} instead of {total} sampled numbers"] * (number != total)
            difference = f", with {' and '.join(parts)}"
            break
    raise ValueError(
        f"an observation of scene '{target.name}' has shape ({expected.shape[1]},), this policy "
        f"was trained on ({bounds.shape[1]},){difference}: choose a scene with the same free "
        "variables and kind of ground, or for a policy of sampled scenes their distribution "
        "(--distribution); `hide`, another `window` and wrappers of environments change "
        "observations and are not supported here"
    )
