"""The scene-conditioned policy: trained on many scenes, a row for a new one in milliseconds.

It first plans how many gaps at the end will be as tight as the rules allow (the one thing in which
good rows differ by whole numbers), then places domino after domino. What it observes at each is the
scene (its features), the plan, and how far it has come; the wave itself follows from these, so that
it need not be observed. NumPy alone is enough to use it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import ThreadpoolController

from agents.base.arrays import read_arrays
from agents.base.building import Built, as_placed
from agents.base.network import Network, network_of, require_network, unfit
from agents.base.run_files import POLICY
from agents.base.shipped import DESIGNER, POLICIES
from agents.conditioned.features import features_of, outside, require_kind
from agents.conditioned.laying import laid
from agents.conditioned.observations import (
    PLANS,
    SCENE,
    SIZE,
    observations,
    plans_of,
    scaled,
)
from agents.conditioned.polishing import polished, steps_of
from domino_env import Layout, Scene, Wave, load_scene
from domino_env.core.results import brief
from domino_env.view.notebook import MadeForScene
from optimize.compiling import compile_for

Floats = NDArray[np.float64]

TRIES = PLANS  # that are simulated
AMPLITUDES = (0.5, 0.7, 0.85, 1.0, 1.2, 1.4)  # of a row's shape where more than gaps is asked for
ALGORITHM = "designer"  # what config.json of its training says


@dataclass(frozen=True, eq=False)
class Design(MadeForScene):
    """A row designed for a scene.

    Attributes
    ----------
    scene
        What it was designed for.
    layout
        The row.
    wave
        Its wave, simulated closely.
    score
        What the scene gives for it.
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

    def rows(self, scene: Scene, plans: Floats) -> tuple[Floats, Floats]:
        """Give the gaps and thicknesses (K, N-1) [m] that K plans lead to."""
        return laid(scene, self._said(scene, plans), plans)

    def _said(self, scene: Scene, plans: Floats) -> Floats:
        """What the network says of each domino under each plan, (K, N-1, 2)."""
        said = _outputs(self.row, observations(features_of(scene), plans))
        return said.reshape(len(plans), scene.count - 1, 2)

    def ranked(self, scene: Scene) -> NDArray[np.intp]:
        """Rank the plans for a scene, the preferred one first."""
        values = _outputs(self.plan, scaled(features_of(scene))[None])[0]
        return np.argsort(-values[: plans_of(scene.count)], kind="stable")

    def propose(self, scene: Scene, tries: int = TRIES) -> tuple[Layout, int]:
        """Give the best row of the plans that it prefers, simulated together, and its plan.

        Parameters
        ----------
        scene
            What it is designed for.
        tries
            Plans; 1 for the preferred one, untried.
        """
        plans = self.ranked(scene)[:tries].astype(np.float64)
        said = self._said(scene, plans)
        gaps, thickness = laid(scene, said, plans)
        best = 0
        if len(plans) > 1:
            best = int(np.argmax(scene.evaluate(scene.batch(gaps, thickness)).score))
        plan = plans[best]
        if len(plans) > 1 and (scene.free_thickness or scene.length is not None):
            rows = np.repeat(said[best : best + 1], len(AMPLITUDES), axis=0)
            mean = rows[..., 0].mean(axis=1, keepdims=True)
            rows[..., 0] = mean + np.array(AMPLITUDES)[:, None] * (rows[..., 0] - mean)
            gaps, thickness = laid(scene, rows, np.full(len(rows), plan))
            best = int(np.argmax(scene.evaluate(scene.batch(gaps, thickness)).score))
        free = thickness[best] if scene.free_thickness else None
        return scene.layout(gaps[best], free), int(plan)

    def design(self, scene: Scene, tries: int = TRIES, steps: int | None = None) -> Design:
        """Design a row: the best of the plans it prefers, polished by exact-gradient steps.

        Parameters
        ----------
        scene
            What it is designed for.
        tries
            Plans; 1 for the preferred one, untried.
        steps
            Evaluations with gradient; 0 for the networks' own row, None for as many as take some
            milliseconds, see `steps_of`.

        Raises
        ------
        ValueError
            For a scene that asks for something else than fast rows.
        """
        if tries < 1 or (steps is not None and steps < 0):
            raise ValueError(f"tries = {tries}, steps = {steps}: give 1 or more, and 0 or more")
        require_kind(scene)
        _threads()  # what it looks up once is no part of a design's time
        began = time.perf_counter()
        layout, plan = self.propose(scene, tries)
        layout = polished(scene, layout, steps_of(scene.count) if steps is None else steps)
        wave = scene.simulate(layout)
        score = scene.score(wave)
        seconds = time.perf_counter() - began
        return Design(scene, layout, wave, score, plan, seconds, outside(scene))

    def build(self, scene: Scene | None) -> Built:
        """Design a row, beside the best uniform one.

        Raises
        ------
        ValueError
            Where no scene is named, and as of `design`.
        """
        if scene is None:
            raise ValueError("this policy was trained on many scenes: name one to design for")
        require_kind(scene)
        compile_for(scene)
        made = self.design(scene)
        row = Built(scene, made.layout, made.wave, made.score, scene.uniform(), made.seconds)
        return as_placed(row)

    @classmethod
    def load(cls, folder: Path) -> ConditionedPolicy:
        """Read the weights in the folder of a training; nothing in the file is run.

        Raises
        ------
        ValueError
            Where they are no such weights: names, shapes, or values that are not finite.
        """
        path = folder / POLICY
        read = read_arrays(path)
        try:
            arrays = {name: np.asarray(array, dtype=np.float32) for name, array in read.items()}
            row, plan = (network_of(arrays, _layers(arrays, name)) for name in ("row", "plan"))
            if 2 * (len(row.layers) + len(plan.layers)) != len(arrays):
                raise ValueError("arrays of other names")
            return cls(require_network(row, SIZE, 2), require_network(plan, SCENE, PLANS))
        except (ValueError, KeyError) as error:
            raise unfit(path, error) from None


def _layers(arrays: dict[str, NDArray[np.float32]], part: str) -> list[str]:
    number = sum(name.startswith(f"{part}_") for name in arrays) // 2
    return [f"{part}_{i}_" for i in range(number)]


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
    """Design a layout for a scene in some milliseconds: a proposal, and a few exact-gradient steps.

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
