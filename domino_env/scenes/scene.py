"""Scene: a design problem, and how layouts are judged in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar, Self

import numpy as np

from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave, simulate
from domino_env.scenes.objectives import Evaluation
from domino_env.scenes.objectives.robust import placed
from domino_env.scenes.specification import Specification
from domino_env.scenes.tables import text_of
from domino_env.scenes.uniform import UniformBaseline, best_uniform, gain, gain_in_words
from domino_env.scenes.waves import LayoutBatch, Waves

SCORE_RTOL = 1e-10  # what is reported; searches may look less closely


@dataclass(frozen=True, kw_only=True)
class Scene(Specification):
    """A design problem: the dominoes, what may be chosen, what counts.

    Scenes are equal if all of their fields are. One that is made in Python has the defaults of a
    file and is checked as a file is; `count`, `spacing` and `thickness` or `stock` are needed.

    Parameters
    ----------
    name
        How it is called.
    title
        What it is about.
    objective
        What counts, one of `domino_env.scenes.objectives.OBJECTIVES`.
    physics
        Friction, gravity, push.
    count
        Number of dominoes N.
    height
        Of every domino, or of the first where heights are free [m].
    width
        Of every domino [m].
    density
        Of every domino [kg/m³].
    first_thickness
        Of domino 0, which is the scene's [m].
    spacing
        Least and largest free gap [m]; equal where the scene fixes it. Where `in_heights`, in
        heights of the shorter of the two dominoes at the gap.
    thickness
        Least and largest thickness of dominoes 1 … N-1 [m]; equal where the scene fixes it. Where
        `in_heights`, in heights of the domino itself.
    length
        First pivot to last [m], met to 1e-9 m; None where it is free.
    spacing_values
        The only gaps allowed, rising [m]; None for any.
    thickness_values
        The only thicknesses allowed, rising [m]; None for any.
    largest_change
        From one gap to the next [m]; None for any.
    stock
        The box that all dominoes are taken from, the first among them; None for no box.
    growth
        Least and largest height over that of the domino before, both 1 or more; None where all are
        equally high.
    in_heights
        Whether `spacing` and `thickness` count in heights.
    limits
        Smallest stall margin, largest flush loss; None for none.
    settings
        What the objective needs besides: a `Tempo` for "tempo", a `Placement` for "robust"; None
        for the others.
    floor_friction
        Coulomb coefficient of the floor on which the row stands free, 0 or more: what counts is
        then its speed by `domino_env.simulate_standing`, if all dominoes topple. None where every
        domino is held to the floor, as the analytic model has it.
    ground
        What the row stands on, a slope or a landscape; None for flat ground.
    placement_deviation
        Placement noise of the environments: every gap comes out wrong by a normal error of this
        standard deviation [m], but never less than 0.2 mm. 0 for none. Searches do not apply it:
        they look for the layout as it is meant.

    Raises
    ------
    ValueError
        For a value out of its range, and for fields that do not go together.
    """

    known_point: ClassVar[tuple[float, float] | None] = None  # of the best uniform row, if told

    @property
    def unit(self) -> str:
        """The unit of a success's score, as in "m/s"; empty for none."""
        return self.criterion.unit

    @property
    def simulations_per_score(self) -> int:
        """How many rows are simulated for one score, or take as long as one that stands."""
        return self.criterion.simulations_per_score

    def simulate(self, layout: Layout, rtol: float = SCORE_RTOL) -> Wave:
        """Topple a layout under the scene's physics."""
        return simulate(layout, self.physics, rtol=rtol)

    def score(self, layout: Layout | Wave) -> float:
        """Score a layout, as every method is judged; higher is better.

        Parameters
        ----------
        layout
            A layout, to be simulated to a relative error of 1e-10, or its wave, which has been
            simulated already; see `evaluate_waves`.

        Returns
        -------
        float
            More than 0 for a success: with "mean_speed", the mean speed [m/s]. A wave that stops
            scores between -1 and 0, higher the further it came, so that a search can climb. See
            `domino_env.scenes.objectives`.

        Raises
        ------
        ValueError
            For a layout that breaks the scene's rules.
        """
        if isinstance(layout, Wave):
            return float(self.evaluate_waves([layout]).score[0])
        self._require(layout)
        return self.score(self.simulate(layout))

    def _require(self, layout: Layout) -> None:
        broken = self.violations(layout)
        if broken:
            raise ValueError(f"scene '{self.name}': {'; '.join(broken)}")

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate and score B layouts at once; the scene's rules are not checked again.

        Parameters
        ----------
        batch
            The layouts, as `batch` of the scene makes them.
        gradient
            Whether to compute the exact derivatives of the scores by gaps, thicknesses and heights
            too. On a floor they are approximate, see `Objective.evaluate`.
        """
        return self.criterion.evaluate(batch, gradient)

    def evaluate_waves(self, waves: Sequence[Wave]) -> Evaluation:
        """Score waves that have been simulated.

        A layout that is not yet complete, as its wave stopped while it was built, is scored too:
        its score does not depend on what is not yet placed. The objective "robust" simulates its
        draws and a scene with a floor the free-standing layouts, which takes all threads.

        Parameters
        ----------
        waves
            Waves of layouts of the scene.
        """
        criterion = self.criterion
        found = criterion.score(Waves.of_waves(waves, self.count))
        if not criterion.simulates_anew:
            return found
        complete = [b for b, wave in enumerate(waves) if wave.layout.count == self.count]
        if complete:
            batch = LayoutBatch.of_waves([waves[b] for b in complete], self.ground)
            again = criterion.evaluate(batch)
            for name in ("score", "reach", "falls"):
                getattr(found, name)[complete] = getattr(again, name)
        return found

    def score_placed(
        self, layout: Layout, seeds: Sequence[int], rtol: float = SCORE_RTOL
    ) -> Floats:
        """Score a layout with placement noise.

        Parameters
        ----------
        layout
            The layout as it is meant.
        seeds
            One for each time that it is placed. With the same seed an environment that has just
            been reset makes the same errors.
        rtol
            Relative error allowed in the arrival times.

        Returns
        -------
        NDArray
            (len(seeds),) scores.

        Raises
        ------
        ValueError
            For a layout that breaks the scene's rules.
        """
        self._require(layout)
        drawn = [self.placement_errors(np.random.default_rng(seed)) for seed in seeds]
        gaps = placed(layout.spacing, np.array(drawn))
        ones = np.ones((len(gaps), 1))
        tall = ones * layout.height[1:] if self.growth is not None else None
        return self.evaluate(self.batch(gaps, ones * layout.thickness[1:], tall, rtol)).score

    def placement_errors(self, generator: np.random.Generator) -> Floats:
        """Draw placement noise that is added to the gaps of a layout (N-1,) [m]."""
        return self.placement_deviation * generator.standard_normal(self.count - 1)

    def in_words(self, score: float, wave: Wave) -> str:
        """Say a score in the words and units of the objective."""
        if score > 0.0:
            return self.criterion.in_words(score, wave)
        broken = self.limits is not None and wave.outcome == Outcome.PROPAGATED
        return "breaks a limit of the scene" if broken else self.criterion.failure

    def against_uniform(self, score: float, wave: Wave) -> str:
        """Say a score, and its gain over the best uniform row where there is one."""
        lead = gain(score, self.uniform().score)
        return self.in_words(score, wave) + (
            "" if lead is None else f", {gain_in_words(lead)} uniform"
        )

    def uniform(self) -> UniformBaseline:
        """Find the best uniform row within the scene's rules; found once for all equal scenes."""
        return self._uniform

    @cached_property
    def _uniform(self) -> UniformBaseline:
        return _mark(
            self, self.known_point
        )  # kept here too, so that it goes along to other processes

    def with_uniform(self, point: Floats) -> Self:
        """Give the same scene, whose best uniform row was searched before.

        Parameters
        ----------
        point
            (2,) what `best_point` found.
        """
        scene = object.__new__(type(self))  # checked already
        vars(scene).update(vars(self), known_point=tuple(map(float, point)))
        vars(scene).pop("_uniform", None)
        return scene

    def to_toml(self) -> str:
        """Write the scene as the text of a file that `load_scene` reads."""
        return text_of(self.document())


@lru_cache(maxsize=32)
def _mark(scene: Scene, known: tuple[float, float] | None) -> UniformBaseline:
    layout = best_uniform(scene, known)
    wave = scene.simulate(layout)
    return UniformBaseline(layout, wave, scene.score(wave))
