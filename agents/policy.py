"""Policies that build domino by domino, as the folder of a training holds them.

config.json     what the training was begun with   progress.csv    the learning curve
policy.npz      weights, as plain arrays           summary.json    its result
checkpoint.pt   what a resumed training needs      scene.toml      the scene, or the distribution

and for one scene

policy.json     what the best policy built         result.png      learning curve and layout
layout.csv/json the layout that it builds          tensorboard/    losses, if that is installed
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta

from agents.algorithms import require_learning
from agents.network import Policy, acting, actor_of, read_network
from agents.rollout import Rollout, build
from domino_env import DominoChain, Scene, SceneDistribution
from domino_env.core.files import naming, read_json
from domino_env.core.models import Document, model_of
from domino_env.core.types import Singles
from domino_env.scenes.distribution import load_any

CONFIG, PROGRESS, POLICY = "config.json", "progress.csv", "policy.npz"
SUMMARY, CHECKPOINT, SCENE = "summary.json", "checkpoint.pt", "scene.toml"
BUILT = "policy.json"
FILES = (
    CONFIG, PROGRESS, POLICY, SUMMARY, CHECKPOINT, SCENE, BUILT, "layout.csv", "layout.json",
    "result.png",
)  # fmt: skip

POLICIES = Path(__file__).with_name("policies")
DESIGNER = "designer"  # the scene-conditioned policy


class SummaryDocument(Document):
    """What is read of summary.json, and of the policy.json of a policy that ships."""

    finished: bool = True
    seconds: Annotated[float, Meta(ge=0, le=1e9)] = 0.0


class BuiltDocument(Document):
    """What is read of policy.json."""

    reference_over_uniform: Annotated[
        float, Meta(gt=0, le=1000, description="reference speed over that of the uniform baseline")
    ]


def shipped() -> list[str]:
    """List the names of the policies for one scene that come with the package."""
    return sorted(folder.parent.name for folder in POLICIES.glob(f"*/{SCENE}"))


def folder_of(run: str | Path) -> Path:
    """Return the folder of a training, or of a policy that ships if there is no such folder."""
    path = Path(run)
    ships = not path.exists() and str(run) in (*shipped(), DESIGNER)
    return POLICIES / str(run) if ships else path


def summary_of(folder: Path) -> SummaryDocument | None:
    """Read the summary of a training, or the policy.json of a policy that ships, if any."""
    for path in (folder / SUMMARY, folder / BUILT):
        if path.exists():
            with naming(path):
                return model_of(SummaryDocument, read_json(path))
    return None


@dataclass(frozen=True, eq=False)
class ScenePolicy:
    """A policy that builds domino by domino, trained on one scene or on a scene distribution.

    Attributes
    ----------
    source
        The folder or file that it is from.
    policy
        Maps an observation to an action.
    size
        Entries of an observation.
    scene
        The scene or the distribution that it was trained on; None where nothing says so.
    reference
        Speed that it was rewarded against, over that of the uniform baseline.
    """

    source: Path
    policy: Policy
    size: int
    scene: Scene | SceneDistribution | None = None
    reference: float | None = None

    @classmethod
    def load(cls, folder: Path) -> ScenePolicy:
        """Load the best policy of a training; NumPy alone is enough.

        Raises
        ------
        ValueError
            Where the folder holds no such policy.
        """
        if not ((folder / SCENE).exists() and (folder / POLICY).exists()):
            raise ValueError(
                f"{folder} holds no policy: name the folder of a finished training, or one that "
                f"ships: {', '.join(shipped())}"
            )
        scene, speed = load_any(folder / SCENE), None
        env = DominoChain(scene)
        (inputs,), (outputs,) = env.observation_space.shape, env.action_space.shape  # type: ignore[misc]
        actor = read_network(folder / POLICY, actor_of, inputs, outputs)
        if isinstance(scene, Scene):
            path = folder / BUILT
            with naming(path):
                speed = model_of(BuiltDocument, read_json(path)).reference_over_uniform
        return cls(folder, acting(actor), inputs, scene, speed)

    @classmethod
    def from_archive(cls, path: Path, trust: bool) -> ScenePolicy:
        """Load an archive of stable-baselines3 (.zip), which runs code that it holds.

        Raises
        ------
        ValueError
            Where `trust` does not allow it, and for what is no such archive.
        ImportError
            Where the extra "rl" is missing.
        """
        if not trust:
            raise ValueError(
                f"loading {path} runs code that it holds: say --trust if you know where it comes "
                "from"
            )
        require_learning()
        from agents.sb3 import CLASSES

        for kind in CLASSES.values():
            try:
                model = kind.load(path, device="cpu")
            except OSError:
                raise
            except Exception:  # of the code that it holds, and of what it is not
                continue
            assert model.observation_space.shape is not None
            (size,) = model.observation_space.shape
            return cls(path, partial(_predicted, model), size)
        raise ValueError(f"{path} is no archive of {', '.join(CLASSES)}")

    def build(self, scene: Scene | None = None) -> Rollout:
        """Build a layout.

        Parameters
        ----------
        scene
            Another scene than it was trained on; its observations must have the same entries.

        Raises
        ------
        ValueError
            Where they differ, and where no scene is known.
        """
        if isinstance(self.scene, SceneDistribution):
            if scene is None:
                raise ValueError(f"{self.source} was trained on many scenes: name one to build for")
            return build(self.policy, scene, distribution=self.scene)
        target = scene or self.scene
        if target is None:
            raise ValueError(f"{self.source} does not say which scene it builds: name one")
        shape = DominoChain(target).observation_space.shape
        if shape != (self.size,):
            raise ValueError(
                f"scene '{target.name}' shows {shape} numbers, this policy was trained on "
                f"({self.size},): choose a scene with the same things left free"
            )
        speed = None
        if self.reference is not None:
            speed = self.reference * target.uniform().wave.mean_speed
        return build(self.policy, target, speed)


def _predicted(model: Any, observation: Singles) -> Any:
    return model.predict(observation, deterministic=True)[0]
