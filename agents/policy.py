"""Policies that build domino by domino, as the folder of a training holds them.

config.json     scene, seed, hyperparameters       progress.csv    learning curve
policy.npz      weights, as plain arrays           summary.json    result of the training
checkpoint.pt   state of a training to resume      scene.toml      the scene, or the distribution

and for one scene

policy.json     result of the best policy          result.png      learning curve and layout
layout.csv/json the layout that it builds
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from msgspec import Meta
from numpy.typing import NDArray

from agents.network import Policy, actor_of, read_network
from agents.rollout import Rollout, build
from domino_env import DominoChain, Scene, SceneDistribution
from domino_env.core.files import naming, read_json
from domino_env.core.models import Document, model_of
from domino_env.core.progress import notice
from domino_env.core.types import Singles
from domino_env.scenes.distribution import load_any

CONFIG, PROGRESS, POLICY = "config.json", "progress.csv", "policy.npz"
SUMMARY, CHECKPOINT, SCENE = "summary.json", "checkpoint.pt", "scene.toml"
BEST = "policy.json"
FILES = (
    CONFIG, PROGRESS, POLICY, SUMMARY, CHECKPOINT, SCENE, BEST, "layout.csv", "layout.json",
    "result.png",
)  # fmt: skip

POLICIES = Path(__file__).with_name("policies")
DESIGNER = "designer"  # the scene-conditioned policy


class SummaryDocument(Document):
    """Parts of summary.json and policy.json that are read again."""

    finished: bool = True
    seconds: Annotated[float, Meta(ge=0, le=1e9)] = 0.0
    simulations: Annotated[int, Meta(ge=0)] = 0
    gradients: Annotated[int, Meta(ge=0)] = 0
    updates: Annotated[int, Meta(ge=0)] = 0
    reference_over_uniform: Annotated[
        float, Meta(gt=0, le=1000, description="reference speed over that of the uniform baseline")
    ] = 1.0


def shipped() -> list[str]:
    """Return the names of the policies for one scene that come with the package."""
    return sorted(folder.parent.name for folder in POLICIES.glob(f"*/{SCENE}"))


def folder_of(run: str | Path) -> Path:
    """Return the folder of a training, or of the shipped policy under a name.

    A folder of the same name is given as a Path, or as "./name".
    """
    if run not in (*shipped(), DESIGNER):
        return Path(run)
    if Path(run).exists():
        notice(f"'{run}' is the shipped policy; the folder is ./{run}")
    return POLICIES / run


def summary_of(folder: Path, names: tuple[str, ...] = (SUMMARY, BEST)) -> SummaryDocument:
    """Read the first of some files in the folder of a training; defaults where there is none."""
    for path in (folder / name for name in names):
        if path.exists():
            with naming(path):
                return model_of(SummaryDocument, read_json(path))
    return SummaryDocument()


@dataclass(frozen=True, eq=False)
class ScenePolicy:
    """A policy that builds domino by domino, trained on one scene or on a scene distribution.

    Attributes
    ----------
    source
        The folder or file that it was loaded from.
    policy
        Maps an observation to an action.
    size
        Number of entries of an observation.
    scene
        The scene or the distribution that it was trained on; None where it is not known.
    reference
        Reference speed of its rewards, over that of the uniform baseline.
    """

    source: Path
    policy: Policy
    size: int
    scene: Scene | SceneDistribution | None = None
    reference: float = 1.0

    @classmethod
    def load(cls, folder: Path) -> ScenePolicy:
        """Load the best policy of a training; NumPy alone is enough.

        Raises
        ------
        ValueError
            If the folder holds no such policy.
        """
        if not ((folder / SCENE).exists() and (folder / POLICY).exists()):
            raise ValueError(
                f"{folder} holds no policy: name the folder of a finished training, or a "
                f"shipped policy: {', '.join(shipped())}"
            )
        scene = load_any(folder / SCENE)
        env = DominoChain(scene)
        (inputs,), (outputs,) = env.observation_space.shape, env.action_space.shape  # type: ignore[misc]
        actor = read_network(folder / POLICY, actor_of, inputs, outputs)
        reference = summary_of(folder, (BEST,)).reference_over_uniform
        return cls(folder, actor.act, inputs, scene, reference)

    def predict(
        self,
        observation: Singles,
        state: Any = None,
        episode_start: Any = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[Any], None]:
        """Return the actions for observations, as policies of Stable-Baselines3 do.

        Parameters
        ----------
        observation
            (O,) or (B, O).
        state, episode_start, deterministic
            Without effect: the policy has no memory and no noise.

        Returns
        -------
        actions : NDArray
            (A,) or (B, A), each from -1 to 1.
        state : None
            No state.
        """
        return self.policy(observation), None

    def build(self, scene: Scene | None = None) -> Rollout:
        """Build a layout.

        Parameters
        ----------
        scene
            Another scene than it was trained on, with observations of the same size.

        Raises
        ------
        ValueError
            If the size differs, and if no scene is known.
        """
        if isinstance(self.scene, SceneDistribution):
            if scene is None:
                raise ValueError(
                    f"{self.source} was trained on sampled scenes: name one to build for (--scene)"
                )
            return build(self.policy, scene, distribution=self.scene)
        target = scene or self.scene
        if target is None:
            raise ValueError(f"{self.source} names no scene: name one to build for (--scene)")
        require_size(target, self.size)
        if self.reference == 1.0:
            return build(self.policy, target)
        speed = self.reference * target.uniform().wave.mean_speed
        return build(self.policy, target, speed or None)


def require_size(target: Scene | SceneDistribution, size: int) -> None:
    """Raise ValueError if observations of a scene or of sampled scenes have another size."""
    shape = DominoChain(target).observation_space.shape
    if shape != (size,):
        raise ValueError(
            f"an observation of scene '{target.name}' has shape {shape}, this policy was trained "
            f"on ({size},): choose a scene with the same free variables, or for a policy of "
            "sampled scenes their distribution (--distribution)"
        )
