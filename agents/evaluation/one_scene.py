"""Evaluation in one scene: whatever policy it is, the row that it builds and its score."""

from __future__ import annotations

from pathlib import Path

from agents.base.building import Built
from agents.base.run_files import algorithm_of
from agents.base.shipped import DESIGNER, POLICIES, shipped
from agents.conditioned.policy import ALGORITHM, ConditionedPolicy
from agents.single.policy import ScenePolicy
from agents.single.scripted import SCRIPTED, ScriptedPolicy
from domino_env import Scene, load_scene


def evaluate(run: str | Path, scene: str | Scene | None = None, *, trust: bool = False) -> Built:
    """Build a row with the best policy of a run, deterministically.

    A policy of PPO needs NumPy alone, as does the scene-conditioned one, the others the extra "rl".

    Parameters
    ----------
    run
        The folder that a training wrote; the name of a policy that ships: "designer", which was
        trained on many scenes, or one of `agents.base.shipped.shipped`; "uniform", "greedy" or
        "ramp", which are scripted; or, with `trust`, an archive of stable-baselines3 (.zip).
    scene
        Another one than it was trained on; its observations must have the same entries. What was
        trained on many or on none asks for one.
    trust
        Whether an archive may be loaded, which runs code that it holds.

    Returns
    -------
    Built
        The row, beside the best uniform one.

    Raises
    ------
    ValueError
        Where the scene's observations differ from those of the training, and for what is no run.
    """
    target = scene if scene is None or isinstance(scene, Scene) else load_scene(scene)
    return load_policy(run, trust=trust).build(target)


def load_policy(
    run: str | Path, *, trust: bool = False
) -> ScenePolicy | ConditionedPolicy | ScriptedPolicy:
    """Load the policy of a run.

    Parameters
    ----------
    run, trust
        As of `evaluate`.

    Returns
    -------
    ScenePolicy, ConditionedPolicy or ScriptedPolicy
        Its method `build` builds a row for a scene.

    Raises
    ------
    ValueError
        For what holds no policy.
    """
    if str(run) in SCRIPTED:
        return ScriptedPolicy(str(run))
    folder = folder_of(run)
    if folder.suffix == ".zip":
        return ScenePolicy.from_archive(folder, trust)
    if algorithm_of(folder) == ALGORITHM:
        return ConditionedPolicy.load(folder)
    return ScenePolicy.load(folder)


def folder_of(run: str | Path) -> Path:
    """Find the folder of a run, or of a policy that ships where there is no such folder."""
    path = Path(run)
    if path.exists():
        return path
    return POLICIES / str(run) if str(run) in (*shipped(), DESIGNER) else path
