"""Scene: a design problem, with the scores of layouts in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Self, cast

import numpy as np

from domino_env.core.checks import require, require_type
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave, simulate
from domino_env.scenes.objectives import Evaluation
from domino_env.scenes.objectives.robust import add_errors
from domino_env.scenes.specification import Specification
from domino_env.scenes.tables import format_toml
from domino_env.scenes.uniform import UniformBaseline, best_uniform, format_gain, gain
from domino_env.scenes.waves import LayoutBatch, Waves

SCORE_RTOL = 1e-10  # of reported scores; searches may be less exact


@dataclass(frozen=True, kw_only=True)
class Scene(Specification):
    """A design problem: dominoes, allowed values, objective.

    Scenes are equal if all their fields are. A scene made in Python has the defaults of a file and
    is checked like a file; `count`, `spacing` and `thickness` or `stock` are needed.

    Parameters
    ----------
    name
        Name of the scene and of its run folders.
    title
        Subject in one line.
    objective
        Scoring rule, one of `domino_env.scenes.objectives.OBJECTIVES`.
    physics
        Friction, gravity, push.
    count
        Number of dominoes N.
    height
        Height of every domino, or of the first if heights are free [m].
    width
        Width of every domino [m].
    density
        Density of every domino [kg/m³].
    first_thickness
        Thickness of domino 0, which is not a design variable [m].
    spacing
        Least and largest free gap [m]; equal if the scene fixes it. If `in_heights`, in
        heights of the shorter of the two dominoes at the gap.
    thickness
        Least and largest thickness of dominoes 1 … N-1 [m]; equal if the scene fixes it. Where
        `in_heights`, in heights of the domino itself.
    length
        Distance of the first and the last pivot [m], met to 1e-9 m; None if it is free.
    spacing_values
        All gaps allowed, rising [m]; None for any.
    thickness_values
        All thicknesses allowed, rising [m]; None for any.
    largest_change
        Largest change from one gap to the next [m]; None for any.
    stock
        Box from which all dominoes are taken, the first one included; None for no box.
    growth
        Least and largest ratio of a height to the one before, both 1 or more; None if all
        heights are equal.
    in_heights
        True if `spacing` and `thickness` count in heights.
    limits
        Smallest stall margin, largest flush loss; None for none.
    settings
        Table of the objective: a `Tempo` for "tempo", a `Placement` for "robust"; None for others.
    floor_friction
        Coulomb coefficient of the floor of free-standing dominoes, 0 or more: the score is
        then the speed by `domino_env.simulate_standing`, if all dominoes topple. None for fixed
        pivots, as in the analytic model.
    ground
        Ground on which layouts stand, a slope or a curve; None for flat ground.
    placement_deviation
        Placement noise of the environments: standard deviation of the normal error of every gap
        [m], which is never less than 0.2 mm. 0 for none.
    placement_draws
        Number of draws of placement noise over which a score is the mean, so that a search plans
        for the noise; 0 to score layouts without errors.

    Raises
    ------
    ValueError
        For a value out of its range, and for fields that contradict each other.

    Examples
    --------
    >>> import domino_env as de
    >>> scene = de.Scene(count=60, spacing=(0.002, 0.040), thickness=(0.0075, 0.0075))
    >>> round(scene.uniform().score, 3)
    0.833
    """

    known_point: ClassVar[tuple[float, float] | None] = None  # of the uniform baseline, if known

    @property
    def unit(self) -> str:
        """Unit of the score of a success, as in "m/s"; empty for none."""
        return self.criterion.unit

    def simulate(self, layout: Layout, rtol: float = SCORE_RTOL) -> Wave:
        """Simulate a layout with the scene's physics.

        Parameters
        ----------
        layout
            The layout.
        rtol
            Relative tolerance of the arrival times.

        Returns
        -------
        Wave
            Its wave.
        """
        return simulate(layout, self.physics, rtol=rtol)

    def score(self, layout: Layout | Wave) -> float:
        """Return the score of a layout; higher is better.

        Parameters
        ----------
        layout
            A layout, to be simulated with a relative tolerance of 1e-10, or its wave.

        Returns
        -------
        float
            More than 0 for a success: with "mean_speed", the mean speed [m/s]. A wave that stops
            scores between -1 and 0, higher the further it came. See
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
        if violations := self.violations(layout):
            raise ValueError(f"scene '{self.name}': {'; '.join(violations)}")

    def evaluate(self, batch: LayoutBatch, gradient: bool = False) -> Evaluation:
        """Simulate and score B layouts at once, without checking the scene's rules.

        Parameters
        ----------
        batch
            The layouts, see `Scene.batch`.
        gradient
            Compute the exact derivatives of the scores by gaps, thicknesses and heights too. On a
            floor they are approximate, see `Objective.evaluate`.

        Returns
        -------
        Evaluation
            Scores, reaches, numbers of falls, and derivatives if requested.
        """
        require_type("batch", batch, LayoutBatch, "a LayoutBatch, as scene.batch() returns")
        return self.criterion.evaluate(batch, gradient)

    def evaluate_waves(self, waves: Sequence[Wave]) -> Evaluation:
        """Score waves that have been simulated.

        The score of a wave that stopped in an incomplete layout does not depend on the dominoes
        that are missing. The objective "robust" simulates its draws, and a scene with a floor the
        free-standing layouts, by all threads.

        Parameters
        ----------
        waves
            Waves of layouts of the scene.

        Returns
        -------
        Evaluation
            Scores, reaches and numbers of falls.
        """
        require_type("waves", waves, Sequence, "a list of waves")
        criterion = self.criterion
        evaluation = criterion.score(Waves.from_waves(waves, self.count))
        complete = [b for b, wave in enumerate(waves) if wave.layout.count == self.count]
        if complete and criterion.simulates_anew:
            gaps, thicknesses, heights = (
                np.array([getattr(waves[b].layout, name) for b in complete])
                for name in ("spacing", "thickness", "height")
            )
            batch = self.batch(gaps, thicknesses[:, 1:], heights[:, 1:], waves[0].rtol)
            simulated = criterion.evaluate(batch)
            for name in ("score", "reach", "falls"):
                getattr(evaluation, name)[complete] = getattr(simulated, name)
        return evaluation

    def score_placed(self, layout: Layout, seeds: Sequence[int]) -> Floats:
        """Return the scores of a layout with sampled placement noise and orders of pieces.

        Parameters
        ----------
        layout
            The layout without errors. If pieces are drawn in random order, they replace its own.
        seeds
            One seed for each draw; an environment reset with the same seed makes the same errors
            and draws the same pieces.

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
        require("seeds", seed_array := np.atleast_1d(seeds), 0, whole=True, array=True)
        generators = [np.random.default_rng(seed) for seed in seed_array]
        errors = [self.placement_errors(generator) for generator in generators]
        gaps = add_errors(layout.spacing, np.array(errors))
        ones = np.ones((len(gaps), 1))
        thicknesses = self.orders(generators) if self.hand else ones * layout.thickness[1:]
        batch = self.batch(gaps, thicknesses, ones * layout.height[1:], SCORE_RTOL)
        return self.as_placed.evaluate(batch).score

    def placement_errors(self, generator: np.random.Generator) -> Floats:
        """Return random errors of the gaps of a layout.

        Parameters
        ----------
        generator
            Source of randomness.

        Returns
        -------
        NDArray
            (N-1,) errors [m]; zeros, and nothing is drawn, without placement noise.
        """
        if not self.placement_deviation:
            return np.zeros(self.count - 1)
        return self.placement_deviation * generator.standard_normal(self.count - 1)

    def format_score(self, score: float, wave: Wave) -> str:
        """Format a score with its unit.

        Parameters
        ----------
        score
            A score of the scene.
        wave
            The wave that has it.

        Returns
        -------
        str
            Such as "0.828550 m/s", or the reason why there is no success.
        """
        if score > 0.0:
            return self.criterion.format_score(score, wave)
        breaks_limit = self.limits is not None and wave.outcome == Outcome.PROPAGATED
        return "breaks a limit of the scene" if breaks_limit else self.criterion.failure

    def against_uniform(self, score: float, wave: Wave) -> str:
        """Format a score with its unit and, if there is one, its gain over the uniform baseline.

        Parameters
        ----------
        score
            A score of the scene.
        wave
            The wave that has it.

        Returns
        -------
        str
            Such as "0.828550 m/s, 3.18% over uniform".
        """
        relative = gain(score, self.uniform().score)
        suffix = "" if relative is None else f", {format_gain(relative)} uniform"
        return self.format_score(score, wave) + suffix

    def uniform(self, seconds: float | None = None) -> UniformBaseline:
        """Return the best layout with equal gaps, computed once for equal scenes.

        Parameters
        ----------
        seconds
            Time limit of its search on a floor [s]; the best layout found until then is the
            baseline from then on. None for no limit. Without a floor there is no limit.

        Returns
        -------
        UniformBaseline
            Its `layout`, `wave` and `score`.

        Raises
        ------
        ValueError
            If the rules allow no uniform layout.
        """
        require("seconds", seconds, 0.0, unit="s", optional=True)
        limit = None if self.floor_friction is None else seconds
        if "_uniform" not in vars(self):  # kept here too, so that it is pickled with the scene
            vars(self)["_uniform"] = _find_baseline(self, self.known_point, limit)
        return cast("UniformBaseline", vars(self)["_uniform"])

    def with_uniform(self, point: Floats) -> Self:
        """Return the same scene with a known uniform baseline.

        Parameters
        ----------
        point
            (2,) result of `best_point`.

        Returns
        -------
        Scene
            The scene; it is not checked again.
        """
        scene = object.__new__(type(self))  # checked already
        vars(scene).update(vars(self), known_point=tuple(map(float, point)))
        vars(scene).pop("_uniform", None)
        return scene

    def to_toml(self) -> str:
        """Return the file of the scene.

        Returns
        -------
        str
            TOML that `load_scene` reads as the same scene.
        """
        return format_toml(self.document())


@lru_cache(maxsize=32)
def _find_baseline(
    scene: Scene, known: tuple[float, float] | None, seconds: float | None
) -> UniformBaseline:
    layout, score = best_uniform(scene, known, seconds)
    wave = scene.simulate(layout)
    return UniformBaseline(layout, wave, scene.score(wave) if score is None else score)
