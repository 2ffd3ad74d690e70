"""Scene: a design problem that simulates and scores layouts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Self, cast

import numpy as np

from domino_env.core.checks import numbers, require, require_type
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave, simulate
from domino_env.scenes.objectives import Scores
from domino_env.scenes.placement import add_errors
from domino_env.scenes.simulators import Stop
from domino_env.scenes.specification import Specification
from domino_env.scenes.tables import format_toml
from domino_env.scenes.uniform import UniformBaseline, best_uniform
from domino_env.scenes.waves import LayoutBatch, Waves

SCORE_RTOL = 1e-10  # relative tolerance of reported scores; that of searches may be larger


@dataclass(frozen=True, kw_only=True)
class Scene(Specification):
    """Design problem: dominoes, allowed values, objective.

    Scenes are equal if all their fields are equal. A scene made in Python has the defaults of a
    scene file and is checked like one; `count`, `spacing`, and either `thickness` or `stock` are
    required.

    Parameters
    ----------
    name
        Name of the scene and of its run folders.
    title
        Subject in one line; by default the name.
    objective
        Scoring rule, one of `domino_env.scenes.objectives.OBJECTIVES`.
    physics
        Friction, gravity, push.
    count
        Number of dominoes N.
    height
        Height of every domino, or of the first if heights grow [m].
    width
        Width of every domino [m].
    density
        Density of every domino [kg/m³].
    first_thickness
        Thickness of domino 0, which is not a design variable [m]; by default that of the others,
        if the scene fixes it.
    spacing
        Least and largest free gap [m]; equal if the scene fixes it. If `in_heights`, in heights of
        the shorter of the two dominoes at the gap.
    thickness
        Least and largest thickness of dominoes 1 … N-1 [m]; equal if the scene fixes it. If
        `in_heights`, in heights of the domino itself. With a stock, those of its pieces.
    length
        Distance from the first to the last pivot [m], with a tolerance of 1e-9 m; None if it is
        free.
    spacing_values
        All allowed gaps in increasing order [m]; None for any within the bounds.
    thickness_values
        All allowed thicknesses in increasing order [m]; None for any within the bounds.
    largest_change
        Largest change from one gap to the next [m]; None for any.
    stock
        Stock from which all dominoes are taken, the first one included; None for no stock.
    growth
        Least and largest ratio of a height to the one before, both 1 or more; None if all heights
        are equal.
    in_heights
        True if `spacing` and `thickness` are given in heights of a domino.
    limits
        Smallest allowed stall margin, and largest allowed loss of speed in a face impact; None for
        no limits.
    settings
        Table of the objective: a `Tempo` for "tempo"; None for others.
    floor_friction
        Coulomb coefficient of the floor of free-standing dominoes, 0 or more. Scores are then
        computed from the speeds of `domino_env.simulate_standing`, and a success needs all dominoes
        to topple. None for fixed pivots, as in the analytic model.
    ground
        Ground on which layouts stand, a slope or a curve; None for flat ground.
    placement
        Placement noise: normal errors of all gaps in every episode of an environment and, with
        draws, in scores; a gap with its error is at least 0.2 mm. None for no noise.
    run_out
        Dominoes with fixed gaps after the `count` dominoes that are designed. Waves, scores and
        pictures are those of the whole row; layouts have the designed dominoes only. None for none.

    Raises
    ------
    TypeError
        For physics that are no `Physics`, and for `in_heights` other than True or False.
    ValueError
        For a value out of its range, and for fields that contradict each other; the message has
        key, value and accepted range.

    Examples
    --------
    >>> import domino_env as de
    >>> scene = de.Scene(count=60, spacing=(0.002, 0.040), thickness=(0.0075, 0.0075))
    >>> round(scene.uniform().score, 3)
    0.833
    """

    known_point: ClassVar[tuple[float, float] | None] = None  # `best_point`, set by `with_uniform`

    @property
    def unit(self) -> str:
        """Unit of the score of a success, such as "m/s"; empty for none."""
        return self.criterion.unit

    def simulate(self, layout: Layout, rtol: float = SCORE_RTOL) -> Wave:
        """Simulate a layout with the scene's physics.

        Parameters
        ----------
        layout
            The layout; the scene's rules are not checked.
        rtol
            Relative tolerance of the arrival times.

        Returns
        -------
        Wave
            The wave of the layout, with the run-out of the scene.
        """
        return simulate(self.row(layout), self.physics, rtol=rtol)

    def score(self, layout: Layout | Wave) -> float:
        """Return the score of a layout; higher is better.

        Parameters
        ----------
        layout
            A layout, which is simulated with a relative tolerance of 1e-10, or its wave, for which
            the scene's rules are not checked.

        Returns
        -------
        float
            More than 0 for a success: with "mean_speed", the mean speed [m/s]. A wave that stops
            scores between -1 and 0, higher the further it came; with "toppled" it scores more than
            0 too. See `domino_env.scenes.objectives`.

        Raises
        ------
        TypeError
            For anything but a layout or a wave.
        ValueError
            For a layout that violates the scene's rules, and for a wave of other physics or of
            another number of dominoes.
        """
        if isinstance(layout, Wave):
            if layout.physics != self.physics:
                raise ValueError(
                    f"wave of {layout.physics}: give one of the scene's {self.physics}"
                )
            return float(self.evaluate_waves([layout]).score[0])
        self._require_valid(layout)
        return self.score(self.simulate(layout))

    def _require_valid(self, layout: Layout) -> None:
        """Raise a ValueError for a layout that violates the scene's rules."""
        if violations := self.violations(layout):
            raise ValueError(f"scene '{self.name}': {'; '.join(violations)}")

    def evaluate(self, batch: LayoutBatch, gradient: bool = False, stop: Stop = None) -> Scores:
        """Simulate and score B layouts at once, without checking the scene's rules.

        Parameters
        ----------
        batch
            The layouts, see `Scene.batch`.
        gradient
            Compute the exact derivatives of the scores with respect to gaps, thicknesses and
            heights too. On a floor they are approximate: the derivatives with fixed pivots, times
            the ratio of the scores on the floor and with fixed pivots.
        stop
            Function that returns True to end a simulation on a floor; None to run it to its end.

        Returns
        -------
        Scores
            Scores, reaches, numbers of falls, and derivatives if requested.

        Raises
        ------
        TypeError
            For anything but a batch.
        StoppedError
            If `stop` returned True.
        """
        require_type("batch", batch, LayoutBatch, "a LayoutBatch, as scene.batch() returns")
        return self.scoring.evaluate(batch, gradient, stop)

    def evaluate_waves(self, waves: Sequence[Wave]) -> Scores:
        """Score waves that have been simulated.

        The wave of an incomplete layout can be scored if it stopped. Its `reach` must then refer to
        all N dominoes of the scene, not to those of the layout. Complete layouts are simulated
        again, with all threads, if the scores need their draws of placement noise or free-standing
        dominoes.

        Parameters
        ----------
        waves
            Waves of layouts of the scene, complete or not.

        Returns
        -------
        Scores
            Scores, reaches and numbers of falls.

        Raises
        ------
        TypeError
            For anything but a sequence of waves.
        ValueError
            For a wave of more dominoes than the scene has, or of fewer if it propagated.
        """
        require_type("waves", waves, Sequence, "a list of waves")
        scores = self.scoring.score(Waves.from_waves(waves, self.row_count))
        complete = [b for b, wave in enumerate(waves) if wave.layout.count == self.row_count]
        if complete and not self.scoring.follows_wave:
            first = slice(0, self.count - 1)  # without the run-out
            layouts = [waves[b].layout for b in complete]
            batch = self.batch(
                np.array([layout.spacing[first] for layout in layouts]),
                np.array([layout.thickness[1:][first] for layout in layouts]),
                np.array([layout.height[1:][first] for layout in layouts]),
                waves[0].rtol,
            )
            simulated = self.scoring.evaluate(batch)
            for name in ("score", "reach", "falls"):
                getattr(scores, name)[complete] = getattr(simulated, name)
        return scores

    def score_placed(self, layout: Layout, seeds: Sequence[int]) -> Floats:
        """Return the scores of a layout with random errors of its gaps and random orders of pieces.

        Parameters
        ----------
        layout
            The layout without errors. If the scene draws pieces in random order, these replace
            those of the layout.
        seeds
            One seed per draw, 0 or more; an environment reset with the same seed has the same
            errors and the same order of pieces.

        Returns
        -------
        NDArray
            (len(seeds),) scores of the placed layouts.

        Raises
        ------
        ValueError
            For a layout that violates the scene's rules, and for invalid seeds.
        """
        self._require_valid(layout)
        require("seeds", seed_array := np.atleast_1d(seeds), 0, whole=True, array=True)
        numbers("seeds", seed_array, None, ("draws",), "one seed per draw")
        generators = [np.random.default_rng(seed) for seed in seed_array]
        errors = [self.placement_errors(generator) for generator in generators]
        gaps = add_errors(layout.spacing, np.array(errors))
        ones = np.ones((len(gaps), 1))
        thicknesses = self.orders(generators) if self.hand else ones * layout.thickness[1:]
        batch = self.batch(gaps, thicknesses, ones * layout.height[1:], SCORE_RTOL)
        return np.asarray(self.as_placed.evaluate(batch).score)

    def placement_errors(self, generator: np.random.Generator) -> Floats:
        """Draw random errors of the gaps of a layout.

        Parameters
        ----------
        generator
            Source of randomness.

        Returns
        -------
        NDArray
            (N-1,) errors [m]; without placement noise zeros, for which nothing is drawn.
        """
        if self.placement is None:
            return np.zeros(self.count - 1)
        return self.placement.deviation * generator.standard_normal(self.count - 1)

    def gain(self, score: float, reference: float) -> float | None:
        """Return the gain of a score over a reference, such as that of the uniform baseline.

        Parameters
        ----------
        score, reference
            Two scores of the scene.

        Returns
        -------
        float or None
            score / reference - 1, or with a schedule of hits a tenth of the decimal logarithm of
            score / reference; None if one of the scores is 0 or less, as without a success.
        """
        if min(score, reference) <= 0.0:
            return None
        return float(self.criterion.gain(np.array(score), np.array(reference)))

    def format_score(self, score: float, wave: Wave) -> str:
        """Format a score with its unit.

        Parameters
        ----------
        score
            A score of the scene.
        wave
            The wave that has this score.

        Returns
        -------
        str
            Text such as "0.828550 m/s", or the reason for a score of 0 or less.
        """
        if score > 0.0:
            return self.scoring.format_score(score, wave)
        violates_limit = self.limits is not None and wave.outcome == Outcome.PROPAGATED
        return "violates a limit of the scene" if violates_limit else self.criterion.failure

    def format_with_gain(self, score: float, wave: Wave) -> str:
        """Format a score with its unit, and compare it with the uniform baseline.

        Parameters
        ----------
        score
            A score of the scene.
        wave
            The wave that has this score.

        Returns
        -------
        str
            Text such as "0.828550 m/s, 3.18% over uniform", with a schedule of hits such as
            "RMS error 1.42904 ms, 18.73 ms with uniform".
        """
        comparison = self.criterion.compare(score, self.uniform().score, "uniform")
        return ", ".join(filter(None, (self.format_score(score, wave), comparison)))

    def uniform(self, seconds: float | None = None) -> UniformBaseline:
        """Return the best layout with equal gaps, computed once for equal scenes.

        Parameters
        ----------
        seconds
            Time limit of the search on a floor [s]; the best layout found until then is the
            baseline of this scene from then on. None for no limit. Ignored without a floor.

        Returns
        -------
        UniformBaseline
            The baseline, with its `layout`, `wave` and `score`.

        Raises
        ------
        ValueError
            If the rules allow no uniform layout, and for a negative time limit.
        """
        require("seconds", seconds, 0.0, unit="s", optional=True)
        limit = seconds if self.simulator.is_slow else None
        if "_uniform" not in vars(self):  # also stored here, so that it is pickled with the scene
            vars(self)["_uniform"] = _find_baseline(self, self.known_point, limit)
        return cast("UniformBaseline", vars(self)["_uniform"])

    def with_uniform(self, point: Floats) -> Self:
        """Return the same scene with a given uniform baseline.

        Parameters
        ----------
        point
            (2,) result of `best_point`.

        Returns
        -------
        Scene
            The scene.
        """
        scene = object.__new__(type(self))  # without the checks, which the fields have passed
        vars(scene).update(vars(self), known_point=tuple(map(float, point)))
        vars(scene).pop("_uniform", None)
        return scene

    def to_toml(self) -> str:
        """Return the text of the scene's file.

        Returns
        -------
        str
            TOML that `load_scene` reads as the same scene.
        """
        return format_toml(self.document())


@lru_cache(maxsize=32)  # scenes
def _find_baseline(
    scene: Scene, known: tuple[float, float] | None, seconds: float | None
) -> UniformBaseline:
    """Return the uniform baseline of a scene; arguments as for `best_uniform`."""
    layout, score = best_uniform(scene, known, seconds)
    wave = scene.simulate(layout)
    return UniformBaseline(layout, wave, scene.score(wave) if score is None else score)
