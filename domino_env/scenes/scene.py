"""Scene: a design problem, and how layouts are judged in it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from domino_env.core.progress import underway
from domino_env.core.reading import one_line
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave, simulate
from domino_env.scenes.baseline import UniformMark, best_uniform, gain, lead_in_words
from domino_env.scenes.io.writing import to_toml
from domino_env.scenes.objectives import Evaluation, Slopes
from domino_env.scenes.specification import Specification
from domino_env.scenes.unsteady import errors, placed
from domino_env.scenes.waves import Waves

Floats = NDArray[np.float64]

SCORE_RTOL = 1e-10  # what is reported; searches may look less closely


@dataclass(frozen=True)
class Scene(Specification):
    """A design problem: what stands, what may be chosen, what counts; equal if all of it is.

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
        Of the hand that builds in the environments: every gap comes out wrong by a normal error of
        this standard deviation [m], but never less than 0.2 mm. 0 for a steady hand. Searches
        know nothing of it: what they look for is the row as it is meant.


    Raises
    ------
    ValueError
        For an objective that there is not, or that lacks its settings or has those of another, for
        a floor under an objective that is no speed, or beside limits, and for ground on which not
        every row within the bounds can stand.
    """

    known_point: ClassVar[tuple[float, float] | None] = None  # of the best uniform row, if told

    @property
    def unit(self) -> str:
        """The unit of a success's score, as in "m/s"; empty for none."""
        return self.criterion.unit

    @property
    def waves_a_score(self) -> int:
        """How many rows are simulated for one score, or take as long as one that stands."""
        return self.criterion.waves_a_score

    def simulate(self, layout: Layout, rtol: float = SCORE_RTOL) -> Wave:
        """Topple a layout under the scene's physics."""
        return simulate(layout, self.physics, rtol=rtol)

    def score(self, layout: Layout) -> float:
        """Score a layout, as every method is judged; higher is better.

        Returns
        -------
        float
            More than 0 for a success: with "mean_speed", the mean speed [m/s]. A wave that dies
            scores between -1 and 0, higher the further it came, so that a search can climb. See
            `domino_env.scenes.objectives`.

        Raises
        ------
        ValueError
            For a layout that breaks the scene's rules.
        """
        self._require(layout)
        return self.score_wave(self.simulate(layout))

    def _require(self, layout: Layout) -> None:
        broken = self.violations(layout)
        if broken:
            raise ValueError(f"scene '{self.name}': {'; '.join(broken)}")

    def score_wave(self, wave: Wave) -> float:
        """Score a wave that has been simulated; "robust" topples its draws, a floor the row.

        A row that is not yet whole, as its wave died while it was built, is scored too: how such a
        wave is judged depends on nothing that is not yet placed.
        """
        return float(self.evaluate_wave(wave).score[0])

    def score_waves(self, waves: Sequence[Wave]) -> Floats:
        """Score many waves (W,) as `score_wave` does, those that take long by all threads."""
        scores = np.empty(len(waves))
        whole = [i for i, wave in enumerate(waves) if wave.layout.count == self.count]
        if whole:
            scores[whole] = self.criterion.evaluate_waves([waves[i] for i in whole]).score
        for i in set(range(len(waves))) - set(whole):
            scores[i] = self.score_wave(waves[i])
        return scores

    def evaluate_wave(self, wave: Wave) -> Evaluation:
        """Give score, reach and falls of a wave, (1,) each: see `score_wave`."""
        if wave.layout.count < self.count:
            return self.criterion.judge(Waves.of_one(wave))
        return self.criterion.evaluate_wave(wave)

    def score_placed(
        self, layout: Layout, seeds: Sequence[int], rtol: float = SCORE_RTOL
    ) -> Floats:
        """Score a row as an unsteady hand places it.

        Parameters
        ----------
        layout
            The row as it is meant.
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
        height = layout.height[1:] if self.growth is not None else None
        rows = [
            self.layout(placed(layout.spacing, error), layout.thickness[1:], height)
            for error in drawn
        ]
        return self.score_waves([self.simulate(row, rtol) for row in rows])

    def placement_errors(self, generator: np.random.Generator) -> Floats:
        """Draw what an unsteady hand adds to the gaps of a row (N-1,) [m]."""
        return errors(self.placement_deviation, self.count - 1, generator)

    def score_batch(
        self,
        spacing: Floats,
        thickness: Floats | None,
        rtol: float = 1e-6,
        height: Floats | None = None,
    ) -> Floats:
        """Score B layouts at once; the scene's rules are not checked again.

        Parameters
        ----------
        spacing
            (B, N-1) free gaps [m].
        thickness
            (B, N-1) of dominoes 1 … N-1 [m]; None where it is fixed.
        rtol
            Relative error allowed in the arrival times.
        height
            (B, N-1) of dominoes 1 … N-1 [m]; None where all are equally high.

        Returns
        -------
        NDArray
            (B,) scores.
        """
        return self.evaluate_batch(spacing, thickness, rtol, height).score

    def evaluate_batch(
        self,
        spacing: Floats,
        thickness: Floats | None,
        rtol: float = 1e-6,
        height: Floats | None = None,
    ) -> Evaluation:
        """Give scores, reaches and falls of B layouts: see `score_batch`."""
        return self.criterion.evaluate(self.batch(spacing, thickness, rtol, height))

    def score_batch_gradient(
        self,
        spacing: Floats,
        thickness: Floats | None,
        rtol: float = 1e-8,
        height: Floats | None = None,
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Score B layouts at once, with the exact gradients of the scores.

        Parameters
        ----------
        spacing
            As of `score_batch`.
        thickness
            As of `score_batch`.
        rtol
            Relative error allowed in the arrival times.
        height
            As of `score_batch`.

        Returns
        -------
        tuple
            Scores (B,), and their derivatives (B, N-1) by gaps, by thicknesses and by heights of
            dominoes 1 … N-1, each with the others fixed [score/m]; zero for a row without success.
        """
        found, slopes = self.evaluate_batch_gradient(spacing, thickness, rtol, height)
        return found.score, slopes.spacing, slopes.thickness, slopes.height

    def evaluate_batch_gradient(
        self,
        spacing: Floats,
        thickness: Floats | None,
        rtol: float = 1e-8,
        height: Floats | None = None,
    ) -> tuple[Evaluation, Slopes]:
        """Give scores, reaches and falls of B layouts with slopes: see `score_batch_gradient`."""
        rows = self.batch(spacing, thickness, rtol, height)
        found, slopes = self.criterion.evaluate_with_slopes(rows)
        return found, slopes.where(found.score > 0.0)

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
            "" if lead is None else f", {lead_in_words(lead)} uniform"
        )

    def uniform(self) -> UniformMark:
        """Find the best uniform row within the scene's rules; found once for all equal scenes."""
        return self._uniform

    @cached_property
    def _uniform(self) -> UniformMark:
        return _mark(
            self, self.known_point
        )  # kept here too, so that it goes along to other processes

    def knowing(self, point: Floats) -> Self:
        """Give the same scene, whose best uniform row was searched before.

        Parameters
        ----------
        point
            (2,) what `best_point` found.
        """
        scene = replace(self)
        object.__setattr__(scene, "known_point", tuple(map(float, point)))
        return scene

    def to_toml(self) -> str:
        """Write the scene as the text of a file that `load_scene` reads."""
        return to_toml(self)


@lru_cache(maxsize=32)
def _mark(scene: Scene, known: tuple[float, float] | None) -> UniformMark:
    with underway(f"finding the best uniform row of '{one_line(scene.name, 40)}'"):
        layout = best_uniform(scene, known)
    wave = scene.simulate(layout)
    return UniformMark(layout, wave, scene.score_wave(wave))
