"""The policy of a run for one scene, as its folder holds it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from agents.base.building import Built, Observation, Policy, build
from agents.base.requirements import require_learning
from agents.base.run_files import CONFIG, POLICY
from agents.base.shipped import shipped
from agents.sb3.actor import acting, read_actor
from agents.single.documents import SCENE, ConfigDocument, read_config, read_reference
from domino_env import DominoChain, Scene, SceneDistribution
from domino_env.core.reading import naming
from domino_env.scenes.distribution import load_any


@dataclass(frozen=True, eq=False)
class ScenePolicy:
    """A policy that builds in the environment, domino by domino, trained on one scene or many.

    Attributes
    ----------
    source
        The folder or file that it is from.
    policy
        Maps an observation to an action.
    size
        Entries of an observation.
    scene
        What it was trained on, or what that was drawn from; None where nothing says so.
    reference
        Speed that it is used to, over the best uniform row's.
    """

    source: Path
    policy: Policy
    size: int
    scene: Scene | SceneDistribution | None
    reference: float | None

    @classmethod
    def load(cls, folder: Path) -> ScenePolicy:
        """Load the best policy of a run; that of ARS needs the extra "rl", the others NumPy alone.

        Raises
        ------
        ValueError
            Where the folder holds no such policy.
        ImportError
            Where it needs the extra "rl".
        """
        if not ((folder / SCENE).exists() and (folder / POLICY).exists()):
            raise ValueError(
                f"{folder} holds no policy: name the folder of a finished training, or one that "
                f"ships: {', '.join(shipped())}"
            )
        scene, begun = load_any(folder / SCENE), read_config(folder)
        env = DominoChain(scene)
        assert env.observation_space.shape is not None
        assert env.action_space.shape is not None
        (inputs,), (outputs,) = env.observation_space.shape, env.action_space.shape
        if begun.algorithm in ("apg", "ppo"):
            policy = acting(read_actor(folder / POLICY, inputs, outputs))
        else:
            policy = _learner_policy(folder, scene, begun)
        speed = read_reference(folder) if isinstance(scene, Scene) else None
        return cls(folder, policy, inputs, scene, speed)

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
        from agents.sb3.learner import CLASSES, policy_of

        for kind in CLASSES.values():
            try:
                model = kind.load(path, device="cpu")
            except OSError:
                raise
            except Exception:  # of the code that it holds, and of what it is not
                continue
            assert model.observation_space.shape is not None
            (size,) = model.observation_space.shape
            return cls(path, policy_of(model), size, None, None)
        raise ValueError(f"{path} is no archive of {', '.join(CLASSES)}")

    def build(self, scene: Scene | None = None) -> Built:
        """Build a row.

        Parameters
        ----------
        scene
            Another one than it was trained on; its observations must have the same entries.

        Raises
        ------
        ValueError
            Where they differ, and where no scene is known.
        """
        target = scene or self.scene
        if target is None:
            raise ValueError(f"{self.source} does not say which scene it builds: name one")
        if isinstance(self.scene, SceneDistribution):
            if not isinstance(target, Scene):
                raise ValueError(f"{self.source} was trained on many scenes: name one to build for")
            return build(self._act, target, drawn_from=self.scene)
        assert isinstance(target, Scene)
        shape = DominoChain(target).observation_space.shape
        if shape != (self.size,):
            raise ValueError(
                f"scene '{target.name}' shows {shape} numbers, this policy was trained on "
                f"({self.size},): choose a scene with the same things left free"
            )
        speed = None
        if self.reference is not None:
            speed = self.reference * target.uniform().wave.mean_speed
        return build(self._act, target, speed)

    def _act(self, observation: Observation) -> NDArray[Any]:
        # the largest weights that are finite overflow in a network
        with np.errstate(all="ignore"), naming(self.source):
            try:
                action = self.policy(observation)
            except (ValueError, RuntimeError):
                action = np.full(1, np.nan)
            if not np.isfinite(action).all():
                raise ValueError("its policy does not know what to do: its weights are too large")
            return action


def _learner_policy(
    folder: Path, scene: Scene | SceneDistribution, begun: ConfigDocument
) -> Policy:
    """The policy of an algorithm whose networks are stable-baselines3's own."""
    require_learning()
    from agents.sb3.learner import learner, load_weights, policy_of
    from agents.sb3.vec_env import DominoVecEnv

    plan = begun.preset
    with naming(folder / CONFIG):
        try:
            model = learner(begun.algorithm, plan, DominoVecEnv(scene, plan.rows), 0)
        except (TypeError, AssertionError, RuntimeError, ZeroDivisionError) as error:
            raise ValueError(f"preset: no learner is made like this: {error}") from None
    load_weights(model.policy, folder / POLICY)
    return policy_of(model)
