"""Designing with the scene-conditioned policy."""

from __future__ import annotations

from pathlib import Path

from agents.conditioned.policy import TRIES, ConditionedPolicy, Design, shipped_policy
from domino_env import Scene, load_scene


def design(
    scene: str | Path | Scene,
    *,
    tries: int = TRIES,
    steps: int | None = None,
    designer: ConditionedPolicy | None = None,
) -> Design:
    """Design a row for a scene in some milliseconds: a proposal, and a few exact-gradient steps.

    The policy lays a row for each of a few plans, these are simulated together, and the best is
    polished.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    tries
        Plans that are laid and simulated, those that it prefers. 1 for the preferred one, untried.
    steps
        Evaluations with gradient that polish it; 0 for the networks' own row, None for as many as
        take some milliseconds.
    designer
        The policy; None for the one that ships.

    Returns
    -------
    Design
        The row, its wave and score.

    Raises
    ------
    ValueError
        For a scene that asks for something else than fast rows.
    """
    target = scene if isinstance(scene, Scene) else load_scene(scene)
    return (designer or shipped_policy()).design(target, tries, steps)
