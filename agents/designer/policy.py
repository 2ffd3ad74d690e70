"""Designer: a scene-conditioned policy, which designs a layout for a new scene in milliseconds.

Good layouts end with a number of tight gaps, which depends on the scene. A first network ranks the
candidates for this number. A second one computes gap and thickness of each domino from the features
of the scene, this number, and the position in the chain; the state of the wave follows from these,
so it is not observed. The layouts of all candidates are simulated in one batch; with free thickness
or a given length also the best of them with more and less variation of its gaps. The best is
improved by a few exact-gradient steps. The networks need NumPy only.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

from agents.designer import features
from agents.designer.decoding import decode
from agents.designer.features import OBSERVATION_SIZE, SCENE_SIZE, TRIES
from agents.network import Network, read_network
from agents.policy import DESIGNER, POLICIES, POLICY
from agents.rollout import Rollout, make_rollout
from domino_env import Layout, Scene, load_scene
from domino_env.core.checks import require, require_type
from domino_env.core.types import Floats
from domino_env.view.notebook import SceneResult
from optimize.methods.gradient.local_search import LocalSearch
from optimize.problem import Problem
from optimize.searching import compile_simulations

AMPLITUDES = (0.5, 0.7, 0.85, 1.0, 1.2, 1.4)  # factors of deviations of ln(gap) from its mean
MIN_STEPS, MAX_STEPS = 4, 12  # gradient steps
STEPPED_DOMINOES = 320  # dominoes times gradient steps, which take some 4 ms
CURVATURE = 1.0  # minus (N-1) d² ln(score) / d ln(gap)²


@dataclass(frozen=True, eq=False, repr=False)
class Design(SceneResult):
    """A layout designed for a scene.

    Attributes
    ----------
    scene
        The scene for which the layout was designed.
    layout
        The layout.
    wave
        Wave of the layout.
    score
        Score of the layout in the scene.
    tight_gaps
        Number of tight gaps at the end of the proposal, before gradient steps.
    seconds
        Wall-clock time of the design, simulations included [s].
    range_violations
        One text for each feature of the scene that is outside the ranges of the training.
    """

    tight_gaps: int
    seconds: float
    range_violations: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Designer:
    """A scene-conditioned policy that designs layouts.

    Attributes
    ----------
    layout
        Network from an observation, one per gap, to the logarithms of gap and thickness.
    tight
        Network from the scaled features of a scene to a preference for each number of tight gaps.
    """

    layout: Network
    tight: Network

    def propose(self, scene: Scene, tries: int = TRIES) -> tuple[Layout, int]:
        """Return the best of the layouts that the networks propose.

        Parameters
        ----------
        scene
            The scene.
        tries
            Number of preferred candidates for the number of tight gaps that are simulated; 1 for
            the most preferred one, without a simulation.

        Returns
        -------
        layout : Layout
            The layout.
        number : int
            Number of tight gaps at its end.
        """
        values = features.scene_features(scene)
        preferences = _outputs(self.tight, features.scale_features(values)[None])[0]
        preferences = preferences[: features.tight_candidates(scene.count)]
        tight = np.argsort(-preferences, kind="stable")[:tries].astype(np.float64)
        outputs = _outputs(self.layout, features.observations(values, tight))
        outputs = outputs.reshape(len(tight), scene.count - 1, 2)
        gaps, thickness = decode(scene, outputs, tight)
        best = _best(scene, gaps, thickness) if len(tight) > 1 else 0
        number = tight[best]
        if len(tight) > 1 and (scene.free_thickness or scene.length is not None):
            shapes = np.repeat(outputs[best : best + 1], len(AMPLITUDES), axis=0)
            mean = shapes[..., 0].mean(axis=1, keepdims=True)
            shapes[..., 0] = mean + np.array(AMPLITUDES)[:, None] * (shapes[..., 0] - mean)
            gaps, thickness = decode(scene, shapes, np.full(len(shapes), number))
            best = _best(scene, gaps, thickness)
        free = thickness[best] if scene.free_thickness else None
        return scene.layout(gaps[best], free), int(number)

    def design(self, scene: Scene, tries: int = TRIES, steps: int | None = None) -> Design:
        """Design a layout; see `agents.design` for arguments, result and errors."""
        require("tries", tries, 1, whole=True)
        require("steps", steps, 0, whole=True, optional=True)
        features.require_kind(scene)
        _threads()  # its first call is not timed
        start = time.perf_counter()
        layout, number = self.propose(scene, tries)
        layout = refine(scene, layout, gradient_steps(scene.count) if steps is None else steps)
        wave = scene.simulate(layout)
        score = scene.score(wave)
        seconds = time.perf_counter() - start
        return Design(scene, layout, wave, score, number, seconds, features.range_violations(scene))

    def build(self, scene: Scene) -> Rollout:
        """Design a layout, and compare it with the uniform baseline.

        Parameters
        ----------
        scene
            The scene.

        Returns
        -------
        Rollout
            The layout, its wave and score, and the uniform baseline.

        Raises
        ------
        ValueError
            If the scene is of another kind than those of the training.
        """
        require_type("scene", scene, Scene, "a Scene, as load_scene returns")
        compile_simulations(scene, gradients=True)
        design = self.design(scene)
        return make_rollout(scene, design.layout, design.seconds)

    @classmethod
    def load(cls, folder: Path) -> Designer:
        """Read the weights in a folder, without running code.

        Parameters
        ----------
        folder
            Folder with the file of weights.

        Returns
        -------
        Designer
            The policy.

        Raises
        ------
        ValueError
            If names or shapes of arrays differ from those of these networks, or if values are not
            finite.
        OSError
            If the file cannot be read.
        """
        path = folder / POLICY
        return cls(
            read_network(path, lambda arrays: _network(arrays, "layout"), OBSERVATION_SIZE, 2),
            read_network(path, lambda arrays: _network(arrays, "tight"), SCENE_SIZE, TRIES),
        )


def _best(scene: Scene, gaps: Floats, thickness: Floats) -> int:
    """Return the index of the layout with the highest score."""
    return int(np.argmax(scene.evaluate(scene.batch(gaps, thickness)).score))


def _network(arrays: Mapping[str, Any], name: str) -> Network:
    """Return the network of this name from arrays of weights and biases, two per layer."""
    count = sum(key.startswith(f"{name}_") for key in arrays) // 2
    return Network.make(arrays, [f"{name}_{i}_" for i in range(count)])


def gradient_steps(count: int) -> int:
    """Return the default number of gradient steps for a layout of `count` dominoes."""
    return int(np.clip(STEPPED_DOMINOES // count, MIN_STEPS, MAX_STEPS))


def refine(scene: Scene, layout: Layout, steps: int) -> Layout:
    """Improve a layout by quasi-Newton steps with the exact gradient of the score.

    Near good layouts the curvature of the score is similar in all scenes, and the first step uses
    this typical value. Face contacts change it, so the later steps estimate it from gradients.

    Parameters
    ----------
    scene
        The scene.
    layout
        The layout from which the steps start.
    steps
        Largest number of evaluations with gradient; 0 returns the layout itself.

    Returns
    -------
    Layout
        The best layout.
    """
    if steps < 1:
        return layout
    problem = Problem(scene)
    start, span = problem.design(layout), problem.high - problem.low
    inverse = ((problem.low + start * span) / span) ** 2 * (scene.count - 1) / CURVATURE
    unit = float(np.sqrt(scene.physics.gravity * scene.height))  # [m/s] scores are about one unit
    local = LocalSearch(start, problem.projection, inverse / unit)
    while local.evaluations < steps and not local.done:
        scores = problem.evaluate(local.candidate, gradient=True)
        local.update(scores.score, scores.gradient)
    return problem.layout(local.design)


def _outputs(network: Network, values: Floats) -> Floats:
    """Return the outputs of a network, whose weights are float32, as float64."""
    with _threads().limit(limits=1, user_api="blas"):  # several threads slow small products down
        return network(values.astype(np.float32)).astype(np.float64)


@lru_cache(maxsize=1)
def _threads() -> ThreadpoolController:
    """Return the controller of thread pools, which takes long to create."""
    return ThreadpoolController()


@lru_cache(maxsize=1)
def shipped_designer() -> Designer:
    """Load the designer that comes with the package."""
    return Designer.load(POLICIES / DESIGNER)


def design(scene: str | Path | Scene, *, tries: int = TRIES, steps: int | None = None) -> Design:
    """Design a layout for a scene in milliseconds: a proposal and a few exact-gradient steps.

    The networks propose a layout for each of up to 13 numbers of tight gaps at the end. The
    proposals are simulated in one batch, with free thickness or a given length also the best of
    them with more and less variation of its gaps. The best is improved.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    tries
        Number of preferred candidates for the number of tight gaps that are simulated; 1 for the
        most preferred one, without a simulation.
    steps
        Largest number of evaluations with gradient that improve the best proposal; 0 for the
        proposal itself, None for 4 to 12, which take some milliseconds.

    Returns
    -------
    Design
        The layout, its wave and score.

    Raises
    ------
    ValueError
        If the scene is unknown or of another kind than those of the training, and for `tries` below
        1 or `steps` below 0.

    Examples
    --------
    >>> from agents import design
    >>> round(design("sprint").score, 3)  # [m/s]
    0.828
    """
    target = scene if isinstance(scene, Scene) else load_scene(scene)
    return shipped_designer().design(target, tries, steps)
