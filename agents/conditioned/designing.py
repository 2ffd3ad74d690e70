"""Designing with the scene-conditioned policy: a whole row at once, or domino by domino."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from agents.base.building import Observation, Policy
from agents.base.network import Single
from agents.conditioned.distribution import require_kind
from agents.conditioned.observations import PLANS, plans_of
from agents.conditioned.policy import ConditionedPolicy, Design, shipped_policy
from domino_env import Scene, load_scene


def design(
    scene: str | Path | Scene, *, tries: int = PLANS, designer: ConditionedPolicy | None = None
) -> Design:
    """Design a row for a scene, without search: the policy lays a row for each of a few plans.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    tries
        Plans that are laid and simulated, those that it prefers; the best is kept. 1 for the
        preferred one, untried.
    designer
        The policy; None for the one that ships.

    Returns
    -------
    Design
        The row, its wave and score.

    Raises
    ------
    ValueError
        For a scene that asks for something else than fast rows of equal dominoes.
    """
    target = scene if isinstance(scene, Scene) else load_scene(scene)
    return (designer or shipped_policy()).design(target, tries)


def acting(
    scene: Scene, plan: int | None = None, designer: ConditionedPolicy | None = None
) -> Policy:
    """Wrap the policy as one that acts in `DominoChain` of this scene, domino by domino.

    It goes by how many dominoes are placed, wherever the row began; what has been placed before is
    left as it is.

    Parameters
    ----------
    scene
        What is built.
    plan
        Tight gaps at the end; None for the policy's own choice.
    designer
        The policy; None for the one that ships.

    Returns
    -------
    callable
        Maps an observation of the environment to an action.

    Raises
    ------
    ValueError
        For a plan that a row of the scene cannot have, and for a scene as `design` refuses.
    """
    from domino_env.envs.observation import progress_entries

    require_kind(scene)
    policy = designer or shipped_policy()
    chosen = int(policy.ranked(scene)[0]) if plan is None else plan
    if not 0 <= chosen < plans_of(scene.count):
        raise ValueError(f"plan = {chosen}: choose 0 to {plans_of(scene.count) - 1} tight gaps")
    gaps = policy.gaps(scene, np.array([float(chosen)]))[0]
    low, high = scene.spacing
    actions = (2.0 * (gaps - low) / (high - low) - 1.0).astype(np.float32)[:, None]
    part = progress_entries()  # the first of the last entries: the part of the row

    def act(observation: Observation) -> Single:
        return np.asarray(actions[round(float(observation[-part]) * (scene.count - 1))])

    return act
