"""Evaluation: what a builder builds, and what the scene gives for it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from domino_env import DominoChain
from domino_env.chain.layout import Layout
from domino_env.chain.wave import Wave
from domino_env.scenes.baseline import UniformMark, gain
from domino_env.scenes.files.reading import load_scene
from domino_env.scenes.scene import Scene
from domino_env.support.reading import naming

if TYPE_CHECKING:
    from stable_baselines3.common.base_class import BaseAlgorithm

POLICIES = Path(__file__).parents[1] / "policies"
FAMILY = "family"  # the one that was taught many scenes

Seen = NDArray[np.float32]
Policy = Callable[[Seen], NDArray[Any]]


@dataclass(frozen=True, eq=False)
class Built:
    """A row that a builder built, beside the best uniform one.

    Attributes
    ----------
    scene
        What it was built for.
    layout
        The row.
    wave
        Its wave, simulated closely.
    score
        What the scene gives for it.
    uniform
        The best uniform row, the baseline.
    seconds
        Time that building took, without the simulation of the baseline.
    """

    scene: Scene
    layout: Layout
    wave: Wave
    score: float
    uniform: UniformMark
    seconds: float

    @property
    def gain(self) -> float | None:
        """Score over the uniform one, minus 1; None where one of the two rows does not run."""
        return gain(self.score, self.uniform.score)


def build(policy: Policy, scene: Scene, reference_speed: float | None = None) -> Built:
    """Let a policy build one row, domino by domino.

    A row that dies on the way is completed with what the policy would have placed last, so that it
    can be shown; its score is that of the wave that died.

    Parameters
    ----------
    policy
        Maps an observation to an action.
    scene
        What is built.
    reference_speed
        Speed that single steps are rewarded against [m/s]; None for that of the best uniform row.
    """
    uniform = scene.uniform()
    env = DominoChain(scene, reference_speed=reference_speed)
    env.reset()
    env.step(np.zeros(env.action_space.shape, np.float32))  # loads what is compiled
    began = time.perf_counter()
    seen, _ = env.reset()
    over, told = False, dict[str, Any]()
    while not over:
        seen, _, over, _, told = env.step(policy(seen))
    layout = completed(told["layout"], scene)
    seconds = time.perf_counter() - began
    wave = scene.simulate(layout)
    return Built(scene, layout, wave, scene.score_wave(wave), uniform, seconds)


def evaluate(run: str | Path, scene: str | Scene | None = None, *, trust: bool = False) -> Built:
    """Build a row with the best policy of a run, deterministically.

    A policy of PPO needs NumPy alone, the others the extra "rl".

    Parameters
    ----------
    run
        The folder that `train` wrote; the name of a policy that ships (`shipped`); or, with
        `trust`, an archive of stable-baselines3 (.zip).
    scene
        Another one than it was trained on; its observations must have the same entries. "family",
        which was trained on many, asks for one.
    trust
        Whether an archive may be loaded, which runs code that it holds.

    Raises
    ------
    ValueError
        Where the scene's observations differ from those of the training, and for what is no run.
    """
    from agents.base.run_files import is_family
    from agents.conditioned.evaluation import built_for

    path = Path(run)
    if path.suffix == ".zip":
        if scene is None:
            raise ValueError(f"{path} does not say which scene it builds: name one")
        judged = load_scene(scene) if not isinstance(scene, Scene) else scene
        model = _from_archive(path, trust)
        assert model.observation_space.shape is not None
        (size,), speed = model.observation_space.shape, None
        policy: Policy = lambda seen: model.predict(seen, deterministic=True)[0]  # noqa: E731
    else:
        from agents.base.run_files import read_reference

        if not path.exists() and str(run) in (*shipped(), FAMILY):
            path = POLICIES / str(run)
        if is_family(path):
            return built_for(path, scene)
        home = load_scene(path / "scene.toml") if (path / "scene.toml").exists() else None
        if home is None or not (path / "policy.npz").exists():
            raise ValueError(
                f"{path} holds no policy: name the folder of a finished training, or one that "
                f"ships: {', '.join(shipped())}"
            )
        judged = home if scene is None else scene if isinstance(scene, Scene) else load_scene(scene)
        policy, size = load_policy(path, home)
        speed = read_reference(path) * judged.uniform().wave.mean_speed
    shape = DominoChain(judged).observation_space.shape
    if shape != (size,):
        raise ValueError(
            f"scene '{judged.name}' shows {shape} numbers, this policy was trained on ({size},): "
            "choose a scene with the same things left free"
        )

    def certain(seen: Seen) -> NDArray[Any]:
        # the largest weights that are finite overflow in a network
        with np.errstate(all="ignore"), naming(path):
            try:
                action = policy(seen)
            except (ValueError, RuntimeError):
                action = np.full(1, np.nan)
            if not np.isfinite(action).all():
                raise ValueError("its policy does not know what to do: its weights are too large")
            return action

    return build(certain, judged, speed)


def shipped() -> list[str]:
    """List the names of the policies for one scene that come with the package."""
    return sorted(folder.parent.name for folder in POLICIES.glob("*/scene.toml"))


def load_policy(folder: Path, scene: Scene) -> tuple[Policy, int]:
    """Load the best policy of a run on a scene.

    Returns
    -------
    policy : callable
        Maps an observation to an action.
    size : int
        Entries of an observation.

    Raises
    ------
    ValueError
        Where the folder holds no such policy.
    ImportError
        Where it needs the extra "rl".
    """
    from agents.base.run_files import read_config

    begun = read_config(folder)
    plan, env = begun.preset, DominoChain(scene)
    assert env.observation_space.shape is not None
    assert env.action_space.shape is not None
    (inputs,), (outputs,) = env.observation_space.shape, env.action_space.shape
    if begun.algorithm == "ppo":
        from agents.base.network import read_network

        path = folder / "policy.npz"
        return read_network(path, inputs, outputs, plan.width, plan.depth), inputs
    from agents.base.requirements import require_extra

    require_extra()
    from agents.sb3.learner import builder, learner, load_weights
    from agents.sb3.vec_env import DominoVecEnv

    small = {"buffer_size": 10} if "buffer_size" in plan.options else {}
    plan = replace(plan, options=plan.options | small)
    with naming(folder / "config.json"):
        try:
            model = learner(begun.algorithm, plan, DominoVecEnv(scene, plan.rows), 0)
        except (TypeError, AssertionError, RuntimeError, ZeroDivisionError) as error:
            raise ValueError(f"preset: no learner is made like this: {error}") from None
    load_weights(model.policy, folder / "policy.npz")
    return builder(model, begun.algorithm), inputs


def _from_archive(path: Path, trust: bool) -> BaseAlgorithm:
    if not trust:
        raise ValueError(
            f"loading {path} runs code that it holds: say --trust if you know where it comes from"
        )
    from agents.sb3.learner import CLASSES

    for kind in CLASSES.values():
        try:
            return kind.load(path, device="cpu")
        except OSError:
            raise
        except Exception:  # of the code that it holds, and of what it is not
            continue
    raise ValueError(f"{path} is no archive of {', '.join(CLASSES)}")


def completed(layout: Layout, scene: Scene) -> Layout:
    """Complete a row to all dominoes: what was not placed is as the last that was."""
    missing = scene.count - layout.count
    if missing == 0:
        return layout
    return Layout(
        np.concatenate([layout.spacing, np.full(missing, layout.spacing[-1])]),
        np.concatenate([layout.thickness, np.full(missing, layout.thickness[-1])]),
        scene.height,
        layout.width,
        scene.density,
    )
