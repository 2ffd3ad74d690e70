"""The designer: a scene-conditioned policy, a layout for a new scene in milliseconds.

It first plans how many gaps at the end will be as tight as the rules allow (the one thing in which
good layouts differ by whole numbers), then places domino after domino. It observes the scene (its
features), the plan, and the position in the chain; the wave itself follows from these, so that it
need not be observed. The layouts of all plans are simulated together, and the best is improved by a
few exact-gradient steps. NumPy alone is enough to use it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from agents.designer.decoding import decoded
from agents.designer.features import (
    PLANS,
    SCENE,
    SIZE,
    features_of,
    observations,
    outside,
    plans_of,
    require_kind,
    scaled,
)
from agents.network import Network, read_network
from agents.policy import DESIGNER, POLICIES, POLICY
from agents.rollout import Rollout, as_placed
from domino_env import Layout, Scene, Wave, load_scene
from domino_env.core.checks import require
from domino_env.core.results import brief
from domino_env.core.types import Floats
from domino_env.view.notebook import MadeForScene
from optimize.methods.gradient.local_search import LocalSearch
from optimize.problem import Problem
from optimize.searching import compile_for

TRIES = PLANS  # that are simulated
AMPLITUDES = (0.5, 0.7, 0.85, 1.0, 1.2, 1.4)  # of a layout's shape where more is free than gaps
LEAST, MOST, DOMINOES = 4, 12, 320  # steps, and dominoes in all of them that take some 4 ms
BEND = 1.0  # second derivative of ln(score) by the logarithm of a gap, times how many there are


@dataclass(frozen=True, eq=False)
class Design(MadeForScene):
    """A layout designed for a scene.

    Attributes
    ----------
    scene
        The scene that it was designed for.
    layout
        The layout.
    wave
        Its wave, simulated closely.
    score
        Its score.
    plan
        Tight gaps planned at the end.
    seconds
        Time that the design took, its simulation included.
    outside
        In what the scene lies beyond those of the training; empty if in nothing.
    """

    scene: Scene
    layout: Layout
    wave: Wave
    score: float
    plan: int
    seconds: float
    outside: tuple[str, ...]

    def __repr__(self) -> str:
        return f"Design({self.scene.name}: {self.scene.against_uniform(self.score, self.wave)})"


@dataclass(frozen=True, eq=False)
class ConditionedPolicy:
    """The networks of a policy.

    Attributes
    ----------
    row
        From the observation at a domino to the logarithm of the gap over the height.
    plan
        From the scene to a preference for each plan.
    """

    row: Network
    plan: Network

    __repr__ = brief

    def ranked(self, scene: Scene) -> NDArray[np.intp]:
        """Rank the plans for a scene, the preferred one first."""
        values = _outputs(self.plan, scaled(features_of(scene))[None])[0]
        return np.argsort(-values[: plans_of(scene.count)], kind="stable")

    def propose(self, scene: Scene, tries: int = TRIES) -> tuple[Layout, int]:
        """Return the best layout of the preferred plans, simulated together, and its plan.

        Parameters
        ----------
        scene
            The scene to design for.
        tries
            Plans; 1 for the preferred one, untried.
        """
        plans = self.ranked(scene)[:tries].astype(np.float64)
        outputs = _outputs(self.row, observations(features_of(scene), plans))
        outputs = outputs.reshape(len(plans), scene.count - 1, 2)
        gaps, thickness = decoded(scene, outputs, plans)
        best = 0
        if len(plans) > 1:
            best = int(np.argmax(scene.evaluate(scene.batch(gaps, thickness)).score))
        plan = plans[best]
        if len(plans) > 1 and (scene.free_thickness or scene.length is not None):
            rows = np.repeat(outputs[best : best + 1], len(AMPLITUDES), axis=0)
            mean = rows[..., 0].mean(axis=1, keepdims=True)
            rows[..., 0] = mean + np.array(AMPLITUDES)[:, None] * (rows[..., 0] - mean)
            gaps, thickness = decoded(scene, rows, np.full(len(rows), plan))
            best = int(np.argmax(scene.evaluate(scene.batch(gaps, thickness)).score))
        free = thickness[best] if scene.free_thickness else None
        return scene.layout(gaps[best], free), int(plan)

    def design(self, scene: Scene, tries: int = TRIES, steps: int | None = None) -> Design:
        """Design a layout: the best of the preferred plans, improved by exact-gradient steps.

        Parameters
        ----------
        scene
            The scene to design for.
        tries
            Plans; 1 for the preferred one, untried.
        steps
            Evaluations with gradient; 0 for the networks' own layout, None for as many as take
            some milliseconds, see `steps_of`.

        Raises
        ------
        ValueError
            For a scene that asks for something else than fast layouts.
        """
        require("tries", tries, 1, whole=True)
        if steps is not None:
            require("steps", steps, 0, whole=True)
        require_kind(scene)
        _threads()  # what it looks up once is no part of a design's time
        began = time.perf_counter()
        layout, plan = self.propose(scene, tries)
        layout = refined(scene, layout, steps_of(scene.count) if steps is None else steps)
        wave = scene.simulate(layout)
        score = scene.score(wave)
        seconds = time.perf_counter() - began
        return Design(scene, layout, wave, score, plan, seconds, outside(scene))

    def build(self, scene: Scene | None) -> Rollout:
        """Design a layout, beside the best uniform one.

        Raises
        ------
        ValueError
            Where no scene is named, and as of `design`.
        """
        if scene is None:
            raise ValueError("this policy was trained on many scenes: name one to design for")
        require_kind(scene)
        compile_for(scene)
        made, uniform = self.design(scene), scene.uniform()
        return as_placed(Rollout(scene, made.layout, made.wave, made.score, uniform, made.seconds))

    @classmethod
    def load(cls, folder: Path) -> ConditionedPolicy:
        """Read the weights in a folder; no code in the file is run.

        Raises
        ------
        ValueError
            Where they are no such weights: names, shapes, or values that are not finite.
        """
        path = folder / POLICY
        return cls(
            read_network(path, lambda arrays: _part(arrays, "row"), SIZE, 2),
            read_network(path, lambda arrays: _part(arrays, "plan"), SCENE, PLANS),
        )


def _part(arrays: Mapping[str, Any], part: str) -> Network:
    number = sum(name.startswith(f"{part}_") for name in arrays) // 2
    return Network.named(arrays, [f"{part}_{i}_" for i in range(number)])


def steps_of(count: int) -> int:
    """Return the steps that are worth their time for a layout of `count` dominoes."""
    return int(np.clip(DOMINOES // count, LEAST, MOST))


def refined(scene: Scene, layout: Layout, steps: int) -> Layout:
    """Improve a layout by quasi-Newton steps with the exact gradient of the score.

    Near good layouts the curvature of the score is much the same in all scenes, so that the first
    step can rely on it; what face contacts change of it is learned on the way.

    Parameters
    ----------
    scene
        Whose score counts, and whose rules are kept.
    layout
        Where to begin.
    steps
        Evaluations with gradient; 0 for none.

    Returns
    -------
    Layout
        The best layout met.
    """
    if steps < 1:
        return layout
    problem = Problem(scene)
    start, span = problem.design(layout), problem.high - problem.low
    inverse = ((problem.low + start * span) / span) ** 2 * (scene.count - 1) / BEND
    unit = float(np.sqrt(scene.physics.gravity * scene.height))  # of which scores are about one
    project = problem.project if problem.coupled else None
    local = LocalSearch(start, project, inverse / unit)
    while local.evaluations < steps and not local.done:
        found = problem.evaluate(local.wanted, gradient=True, differences=False)
        local.update(found.score, found.gradient)
    return problem.layout(local.design)


def _outputs(network: Network, values: Floats) -> Floats:
    with _threads().limit(limits=1, user_api="blas"):  # so small products only wait for threads
        return network(values.astype(np.float32)).astype(np.float64)


@lru_cache(maxsize=1)
def _threads() -> ThreadpoolController:
    return ThreadpoolController()


@lru_cache(maxsize=1)
def shipped_policy() -> ConditionedPolicy:
    """Load the policy that comes with the package."""
    return ConditionedPolicy.load(POLICIES / DESIGNER)


def design(
    scene: str | Path | Scene,
    *,
    tries: int = TRIES,
    steps: int | None = None,
    designer: ConditionedPolicy | None = None,
) -> Design:
    """Design a layout for a scene in some milliseconds: a proposal and a few exact-gradient steps.

    The policy proposes a layout for each of a few plans, these are simulated together, and the best
    is improved.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    tries
        Plans that are simulated, those that it prefers; 1 for the preferred one, untried.
    steps
        Evaluations with gradient that improve it; 0 for the networks' own layout, None for as many
        as take some milliseconds.
    designer
        The policy; None for the one that ships.

    Returns
    -------
    Design
        The layout, its wave and score.

    Raises
    ------
    ValueError
        For a scene that asks for something else than fast layouts.
    """
    target = scene if isinstance(scene, Scene) else load_scene(scene)
    return (designer or shipped_policy()).design(target, tries, steps)
