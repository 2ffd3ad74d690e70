"""Policies that build layouts domino by domino, and the files in the folder of a training.

config.json     algorithm, seed, hyperparameters   progress.csv    learning curve
policy.npz      weights, as plain arrays           summary.json    result of the training
checkpoint.pt   state of a training to resume      scene.toml      the scene, or the distribution

With a single scene it also has

policy.json     result of the best policy          result.png      learning curve and layout
layout.csv/json the layout that it builds
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta

from agents.algorithms import Hyperparameters
from agents.network import Policy, build_actor, read_network
from agents.rollout import Rollout, build
from domino_env import DominoChain, Scene, SceneDistribution
from domino_env.core.checks import require, require_type
from domino_env.core.files import errors_with_path, read_json
from domino_env.core.models import Document, read_document
from domino_env.core.progress import notice
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


class ConfigDocument(Document):
    """Arguments of a training, as in config.json; see `agents.train`."""

    algorithm: Literal["apg", "ppo", "ars", "sac", "td3", "tqc"]
    seed: Annotated[int, Meta(ge=0, le=2**32 - 1)]
    steps: Annotated[int, Meta(ge=1)]
    hyperparameters: Hyperparameters
    num_scenes: Annotated[int, Meta(ge=1)] | None = None


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
    size
        Number of entries of an observation.
    scene
        The scene or the distribution that it was trained on; None if it is not known.
    """

    source: Path
    policy: Policy
    size: int
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
        env = DominoChain(scene)
        (inputs,), (outputs,) = env.observation_space.shape, env.action_space.shape  # type: ignore[misc]
        actor = read_network(folder / POLICY, build_actor, inputs, outputs)
        return cls(folder, actor.act, inputs, scene)

    def build(self, scene: Scene | None = None) -> Rollout:
        """Build a layout.

        Parameters
        ----------
        scene
            A scene with observations of the same size; None for that of the training.

        Returns
        -------
        Rollout
            The layout with its wave, its score and the uniform baseline.

        Raises
        ------
        ValueError
            If observations of the scene have another size, or if no scene is known.
        """
        require_type("scene", scene, Scene | None, "a Scene, as load_scene returns")
        target = scene or self.scene
        if not isinstance(target, Scene):
            raise ValueError(f"policy '{self.source}' has no scene of its own: give one (--scene)")
        if isinstance(self.scene, SceneDistribution):
            return build(self.policy, target, distribution=self.scene)
        require_size(target, self.size)
        return build(self.policy, target)


def require_size(target: Scene | SceneDistribution, size: int) -> None:
    """Raise ValueError if observations of a scene or of sampled scenes have another size."""
    shape = DominoChain(target).observation_space.shape
    if shape != (size,):
        raise ValueError(
            f"an observation of scene '{target.name}' has shape {shape}, this policy was trained "
            f"on ({size},): choose a scene with the same free variables and kind of ground, or for "
            "a policy of sampled scenes their distribution (--distribution); `hide`, another "
            "`window` and wrappers of environments change the shape and are not supported here"
        )
