"""A scene as a problem of EngiBench, for whoever trains models that design: extra `engibench`.

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
from PIL import Image

from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from domino_env.view.drawing import Scale, strip
from optimize.evaluator import Evaluator
from optimize.methods import registry
from optimize.methods.scipy_methods import descend
from optimize.problem import Problem as UnitBox
from optimize.searching import search

WIDTH, HEIGHT = 1000, 200  # of a drawing [px]


class DominoRow(Problem[Floats]):
    """A row of dominoes that is to topple as a scene asks, as a problem of EngiBench.

    A design is what the scene leaves free, (n,) in its own units: gaps [m], then thicknesses [m],
    then heights over that of the domino before; gaps and thicknesses in heights where the scene
    gives them so. Unlike a design of `optimize.Problem` it is built as it is: one that breaks a
    rule of the scene (a length, a list, a stock) is a violation, which `check_constraints` tells.
    The objective is the scene's score, which is maximised; a wave that dies scores less than 0.

    Parameters
    ----------
    seed
        Of `random_design` and `optimize`.
    config
        Values of `Config` that are not the scene's.
    scene
        A scene, its name, or the path of its file.

    Attributes
    ----------
    scene
        The scene, under the conditions given.
    """

    version = 0
    objectives = (("mean_speed", ObjectiveDirection.MAXIMIZE),)
    container_id = None
    dataset_id = "domino-chains/none"  # none is published

    @dataclass
    class Conditions:
        """What the row stands under.

        Attributes
        ----------
        friction
            Coulomb coefficient between dominoes.
        gravity
            [m/s²].
        push
            Angular velocity that the first domino is given [rad/s].
        """

        friction: Annotated[float, bounded(lower=0.0).category(THEORY)] = Physics.friction
        gravity: Annotated[float, greater_than(0.0).category(THEORY)] = Physics.gravity
        push: Annotated[float, greater_than(0.0).category(THEORY)] = Physics.push

    @dataclass
    class Config(Conditions):
        """Conditions, and what `optimize` may spend.

        Attributes
        ----------
        budget
            Number of layouts that a search may simulate.
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
        given = {name: getattr(self.scene.physics, name) for name in self._names()}
        self.config = self.Config(**given | (config or {}))
        self.scene = self._under({})
        self.conditions = self.Conditions(**{n: getattr(self.config, n) for n in self._names()})
        self.objectives = ((self.scene.objective, ObjectiveDirection.MAXIMIZE),)
        self._box = UnitBox(self.scene)
        self.design_space = spaces.Box(self._box.low, self._box.high, dtype=np.float64)

        self.design_constraints = (constraint(categories=THEORY)(self._rules),)

    @property
    def dataset(self) -> Any:
        """None is published: designs for conditions of one's own are what `optimize` finds.

        Raises
        ------
        ValueError
            Always.
        """
        raise ValueError(
            "there is no published data set of layouts: random_design and optimize make designs"
        )

    def layout(self, design: Floats) -> Layout:
        """Give the row of a design (n,).

        Raises
        ------
        ValueError
            For a design of another shape, and for what cannot be built.
        """
        return self._box.layout_of(self._box.one(design))

    def simulate(self, design: Floats, config: dict[str, Any] | None = None) -> Floats:
        """Topple the row of a design (n,), and give its score, (1,); higher is better."""
        scene = self._under(config)
        return np.array([scene.score(scene.simulate(self.layout(design)))])

    def optimize(
        self, starting_point: Floats, config: dict[str, Any] | None = None
    ) -> tuple[Floats, list[OptiStep]]:
        """Search a better row: by exact gradients from a start, then by `auto`.

        Parameters
        ----------
        starting_point
            (n,) a design; where it breaks a rule, the nearest that does not is the start.
        config
            Values of `Config` that differ here.

        Returns
        -------
        design : ndarray
            (n,) the best that was found.
        history : list of OptiStep
            Its score at every improvement; a step is the number of rows simulated by then.
        """
        start = self._box.design(self.layout(starting_point))
        others = registry.load("auto")

        def from_start(evaluator: Evaluator, rng: np.random.Generator) -> None:
            descend("L-BFGS-B", evaluator, start)
            others(evaluator, rng)

        budget = self._config(config).budget
        found = search(self._under(config), from_start, budget, self.seed or 0, progress=False)
        best = self._values(self._box.design(found.layout)[None])
        return best, [OptiStep(np.array([score]), rows) for rows, _, _, score in found.trace]

    def render(self, design: Floats, *, open_window: bool = False) -> Image.Image:
        """Draw the row of a design (n,) as it stands.

        Parameters
        ----------
        design
            The design.
        open_window
            Whether to show it in a window.

        Returns
        -------
        PIL.Image.Image
            The drawing.
        """
        row = self.layout(design)
        scale = Scale.fitting(row.length, float(row.height.max()), WIDTH, HEIGHT)
        image = strip(row, np.zeros(row.count), 0, scale, self.scene.title)
        if open_window:
            image.show()
        return image

    def random_design(self) -> tuple[Floats, int]:
        """Draw a design (n,) that keeps the rules; its number is -1, as it is in no data set."""
        return self._values(self.np_random.random((1, self._box.dimension))), -1

    def reset(self, seed: int | None = None) -> None:
        """Begin the random numbers anew; the simulator remembers nothing."""
        super().reset(seed)

    def _rules(self, design: Floats) -> None:
        """Assert that a design keeps the scene's rules; the design space is told of elsewhere."""
        if self.design_space.contains(design):
            broken = self.scene.violations(self.layout(design))
            assert not broken, "; ".join(broken)

    def _values(self, designs: Floats) -> Floats:
        """The free values (n,) of one design (1, n) of the unit box."""
        return np.asarray(np.clip(self._box.values(designs)[0], self._box.low, self._box.high))

    def _names(self) -> list[str]:
        return [field.name for field in dataclasses.fields(self.Conditions)]

    def _config(self, config: dict[str, Any] | None) -> Config:
        return dataclasses.replace(self.config, **config or {})

    def _under(self, config: dict[str, Any] | None) -> Scene:
        """The scene under other conditions."""
        wanted = self._config(config)
        changes = {name: getattr(wanted, name) for name in self._names()}
        return self.scene.replace(physics=self.scene.physics.replace(**changes))
