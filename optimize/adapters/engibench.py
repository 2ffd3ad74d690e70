"""Scenes as problems of EngiBench, for models that generate designs (extra `engibench`).

EngiBench (https://engibench.ethz.ch) is under the GPL, version 3; nothing of it is copied here.
"""

# no `from __future__ import annotations`: EngiBench reads the constraints from annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from engibench.constraint import IMPL, THEORY, bounded, constraint, greater_than
from engibench.core import ObjectiveDirection, OptiStep, Problem
from gymnasium import spaces
from msgspec.structs import asdict
from PIL import Image

from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from domino_env.view.drawing import Scale, draw_strip
from domino_env.view.ground import relief
from optimize.evaluator import Evaluator
from optimize.methods import registry
from optimize.methods.scipy_methods import descend
from optimize.problem import Problem as UnitBox
from optimize.searching import search

WIDTH, HEIGHT = 1000, 200  # of a drawing [px]
DEFAULT_PHYSICS = Physics()


class DominoProblem(Problem[Floats]):
    """Scene as a problem of EngiBench.

    A design (n,) has the free values of the scene in its own units: gaps [m], then thicknesses [m],
    then heights divided by that of the domino before; gaps and thicknesses are in heights if the
    scene gives them so. Unlike a design vector of `optimize.Problem` it is not projected: if it
    breaks a rule of the scene (a length, a list, a stock), `check_constraints` returns a violation.
    The objective is the scene's score, which is maximised; a wave that stops scores less than 0.

    Parameters
    ----------
    seed
        Seed of `random_design` and `optimize`.
    config
        Values of `Config` that differ from those of the scene.
    scene
        A scene, its name, or the path of its file.

    Attributes
    ----------
    scene
        Scene under the conditions of `config`.

    Examples
    --------
    >>> problem = DominoProblem(seed=0, config={"friction": 0.1}, scene="gentle")
    >>> design, _ = problem.random_design()
    >>> problem.simulate(design).shape
    (1,)
    """

    version = 0
    objectives = (("mean_speed", ObjectiveDirection.MAXIMIZE),)
    container_id = None
    dataset_id = "domino-chains/none"  # none is published

    @dataclass
    class Conditions:
        """Physics of the chain.

        Attributes
        ----------
        friction
            Coulomb coefficient between dominoes.
        gravity
            Gravitational acceleration [m/s²].
        push
            Angular velocity of the first domino at the start [rad/s].
        """

        friction: Annotated[float, bounded(lower=0.0).category(THEORY)] = DEFAULT_PHYSICS.friction
        gravity: Annotated[float, greater_than(0.0).category(THEORY)] = DEFAULT_PHYSICS.gravity
        push: Annotated[float, greater_than(0.0).category(THEORY)] = DEFAULT_PHYSICS.push

    @dataclass
    class Config(Conditions):
        """Conditions, and the limit of `optimize`.

        Attributes
        ----------
        budget
            Largest number of layouts that a search simulates.
        """

        budget: Annotated[int, bounded(lower=1).category(IMPL)] = 2000

    def __init__(
        self,
        seed: int = 0,
        config: dict[str, Any] | None = None,
        *,
        scene: Scene | str | Path = "sprint",
    ) -> None:
        super().__init__(seed=seed)
        self.scene = scene if isinstance(scene, Scene) else load_scene(scene)
        self.config = self.Config(**asdict(self.scene.physics) | (config or {}))
        self.scene = self._scene_under({})
        self.conditions = self.Conditions(**asdict(self.scene.physics))
        self.objectives = ((self.scene.objective, ObjectiveDirection.MAXIMIZE),)
        self._box = UnitBox(self.scene)
        self.design_space = spaces.Box(self._box.low, self._box.high, dtype=np.float64)
        self.design_constraints = (constraint(categories=THEORY)(self._rules),)

    @property
    def dataset(self) -> Any:
        """Published designs; there are none, and access raises ValueError."""
        raise ValueError("no data set is published: make designs with random_design or optimize")

    def layout(self, design: Floats) -> Layout:
        """Return the layout of a design (n,).

        Raises
        ------
        ValueError
            If the design has another shape, or if its dominoes cannot stand.
        """
        return self._box.layout_from(self._box.as_batch(design))

    def simulate(self, design: Floats, config: dict[str, Any] | None = None) -> Floats:
        """Simulate the layout of a design and return its score; higher is better.

        Parameters
        ----------
        design
            Design (n,).
        config
            Values of `Config` that differ here.

        Returns
        -------
        ndarray
            Score (1,).
        """
        scene = self._scene_under(config)
        return np.array([scene.score(scene.simulate(self.layout(design)))])

    def optimize(
        self, starting_point: Floats, config: dict[str, Any] | None = None
    ) -> tuple[Floats, list[OptiStep]]:
        """Search for a better design, by exact gradients from a given one and then by `auto`.

        Parameters
        ----------
        starting_point
            Design (n,); if it breaks a rule, the search starts from the nearest design that
            satisfies all rules.
        config
            Values of `Config` that differ here.

        Returns
        -------
        design : ndarray
            Best design (n,).
        history : list of OptiStep
            Best score at every improvement; a step is the number of layouts simulated so far.
        """
        start = self._box.design(self.layout(starting_point))
        auto = registry.load("auto")

        def from_start(evaluator: Evaluator, rng: np.random.Generator) -> None:
            descend("L-BFGS-B", evaluator, start)
            auto(evaluator, rng)

        budget, scene = self._config(config).budget, self._scene_under(config)
        result = search(scene, from_start, budget, self.seed, progress=False)
        best = self._values(self._box.design(result.layout)[None])
        return best, [OptiStep(np.array([score]), count) for count, _, _, score in result.trace]

    def render(self, design: Floats, *, open_window: bool = False) -> Image.Image:
        """Draw the layout of a design (n,) before it topples.

        Parameters
        ----------
        design
            Design (n,).
        open_window
            True to show the drawing in a window.

        Returns
        -------
        PIL.Image.Image
            The drawing, 1000 by 200 pixels.
        """
        layout = self.layout(design)
        tallest, leans = float(layout.height.max()), np.zeros(layout.count)
        scale = Scale.fitting(layout.length, tallest, WIDTH, HEIGHT, relief(layout))
        image = draw_strip(layout, leans, 0, scale, self.scene.title, ground=self.scene.ground)
        if open_window:
            image.show()
        return image

    def random_design(self) -> tuple[Floats, int]:
        """Return a random design (n,) within the rules, and -1, as it is in no data set."""
        return self._values(self.np_random.random((1, self._box.dimension))), -1

    def reset(self, seed: int | None = None) -> None:
        """Restart the random numbers; the simulator has no state."""
        super().reset(seed)

    def _rules(self, design: Floats) -> None:
        """Assert that a design satisfies the scene's rules; EngiBench checks the design space."""
        if self.design_space.contains(design):
            violations = self.scene.violations(self.layout(design))
            assert not violations, "; ".join(violations)

    def _values(self, designs: Floats) -> Floats:
        """Return the free values (n,) of one design vector (1, n) in the unit box."""
        return np.asarray(np.clip(self._box.values(designs)[0], self._box.low, self._box.high))

    def _config(self, config: dict[str, Any] | None) -> Config:
        """Return the configuration with some values replaced."""
        return dataclasses.replace(self.config, **config or {})

    def _scene_under(self, config: dict[str, Any] | None) -> Scene:
        """Return the scene under other conditions."""
        values = self._config(config)
        changes = {name: getattr(values, name) for name in Physics.__struct_fields__}
        return self.scene.replace(physics=self.scene.physics.replace(**changes))
