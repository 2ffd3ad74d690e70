"""Scene: a design problem, with its rules, scores, file and uniform baseline."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.checks import numbers, require, require_type
from domino_env.core.types import Floats
from domino_env.physics.ground import Ground
from domino_env.physics.layout import Layout, full_array
from domino_env.physics.physics import Physics, require_layout
from domino_env.physics.standard import DENSITY, HEIGHT, WIDTH
from domino_env.physics.wave import Outcome, Wave, WaveBatch, simulate
from domino_env.scenes import consistency, tables
from domino_env.scenes.design_space import DesignSpace, Part
from domino_env.scenes.layout_batch import LayoutBatch
from domino_env.scenes.limits import Limits
from domino_env.scenes.objectives import OBJECTIVES, Objective, Scores
from domino_env.scenes.objectives.tempo import Tempo
from domino_env.scenes.placement import Placement, add_errors
from domino_env.scenes.rules import Bounds, Stock, ground_violations
from domino_env.scenes.run_out import RunOut
from domino_env.scenes.scoring import Scoring
from domino_env.scenes.simulators import FixedPivots, FreeStanding, Simulator, Stop
from domino_env.scenes.uniform import UniformBaseline, stored_point, uniform_baseline

SCORE_RTOL = 1e-10  # relative tolerance of reported scores; that of searches may be larger
DERIVED: Any = None  # default of fields whose values then follow from other fields


@dataclass(frozen=True, kw_only=True)
class Scene:
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
    stock
        Stock from which all dominoes are taken, the first one included; None for no stock.
    growth
        Least and largest ratio of a height to the one before, both 1 or more; None if all heights
        are equal.
    in_heights
        True if `spacing` and `thickness` are given in heights of a domino.
    limits
        Smallest allowed stall margin; None for no limit.
    settings
        Table of the objective: a `Tempo` for "tempo"; None for others.
    floor_friction
        Coulomb coefficient of the floor of free-standing dominoes, 0 or more. Scores are then
        computed from the speeds of `domino_env.simulate_standing`, and a success needs all dominoes
        to topple. None for fixed pivots, as in the analytic model.
    ground
        Ground on which layouts stand, a slope or a curve; None for flat ground.
    placement
        Placement noise: normal errors of all designed gaps in every episode of an environment and,
        with draws, in scores; a gap with its error is at least 0.2 mm. None for no noise.
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

    name: str = "own"
    title: str = DERIVED
    objective: str = "mean_speed"
    physics: Physics = Physics()  # noqa: RUF009 - frozen
    count: int
    height: float = HEIGHT
    width: float = WIDTH
    density: float = DENSITY
    first_thickness: float = DERIVED
    length: float | None = None
    spacing: Bounds
    thickness: Bounds = DERIVED
    in_heights: bool = False
    stock: Stock | None = None
    growth: Bounds | None = None
    limits: Limits | None = None
    settings: Any = None
    floor_friction: float | None = None
    ground: Ground | None = None
    placement: Placement | None = None
    run_out: RunOut | None = None
    uniform_point: tuple[float, float] | None = field(
        default=None, init=False, compare=False, repr=False
    )
    """`best_point` of the scene, see `with_uniform`; None if it is not known."""

    def __post_init__(self) -> None:
        try:
            self._set(tables.check_types(self))
            self._complete()
        except ValueError as error:
            raise ValueError(f"scene '{self.name}': {error}") from None

    def _set(self, fields: dict[str, Any]) -> None:
        """Set fields while the scene is made."""
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    def _complete(self) -> None:
        """Check relations between fields, and set those that follow from others."""
        consistency.require_consistent(consistency.contradictions(self))
        unit = self.height if self.in_heights else 1.0
        first = self.first_thickness or unit * self.thickness[0]
        self._set({"title": self.title or self.name, "first_thickness": first})
        if self.stock is not None:
            pieces = self.stock.without(self.first_thickness).dominoes
            self._set({"thickness": (float(pieces.min()), float(pieces.max()))})
        consistency.require_consistent(consistency.violations(self))

    def replace(self, **changes: Any) -> Self:
        """Return another scene, with some fields changed.

        Parameters
        ----------
        **changes
            New values, by the names of fields.

        Returns
        -------
        Scene
            The other scene.

        Raises
        ------
        TypeError
            For a name that is no field, and as for `Scene`.
        ValueError
            For a value out of its range, and for fields that contradict each other; the message has
            key, value and accepted range.
        """
        return replace(self, **changes)

    @cached_property
    def criterion(self) -> Objective:
        """Objective of the scene, with its settings."""
        return OBJECTIVES[self.objective](self.settings)

    @property
    def simulator(self) -> Simulator:
        """Simulator of the layouts."""
        floor = self.floor_friction
        return FixedPivots() if floor is None else FreeStanding(floor)

    @cached_property
    def scoring(self) -> Scoring:
        """Line of the values from layouts to scores."""
        noise = self.placement if self.placement and self.placement.draws else None
        return Scoring(self.criterion, self.simulator, self.limits, noise, self.run_out)

    @cached_property
    def as_placed(self) -> Self:
        """Scene that scores a layout as it is placed, without draws of placement noise."""
        if self.scoring.placement is None:
            return self
        return self.replace(placement=self.scoring.placement.replace(draws=0, quantile=None))

    @property
    def on_pivots(self) -> Self:
        """Scene with fixed pivots, that of the analytic simulator."""
        return self.replace(floor_friction=None) if self.simulator.is_slow else self

    @property
    def tempo(self) -> Tempo | None:
        """Schedule of the hits; None for other objectives."""
        return self.settings if isinstance(self.settings, Tempo) else None

    @property
    def hand(self) -> int:
        """Number of pieces held while building, drawn in random order; 0 for no random order."""
        return 0 if self.stock is None else self.stock.hand or 0

    def orders(self, generators: Sequence[np.random.Generator]) -> Floats:
        """Draw random orders of the pieces of the stock without the first domino.

        Parameters
        ----------
        generators
            M sources of randomness, one for each order.

        Returns
        -------
        NDArray
            (M, N-1) thicknesses in the order in which the pieces are drawn [m].

        Raises
        ------
        TypeError
            For anything but generators.
        ValueError
            For a scene without a stock.
        """
        if self.space.pieces is None:
            raise ValueError(f"scene '{self.name}' has no stock: give a scene with [stock]")
        for generator in np.array([generators], object).flat:  # also a value that is no list
            require_type("generators", generator, np.random.Generator, "a list of Generators")
        pieces = self.space.pieces.dominoes
        drawn = [generator.permutation(pieces) for generator in generators]
        return np.array(drawn).reshape(-1, len(pieces))[:, : self.count - 1]

    @property
    def row_count(self) -> int:
        """Number of dominoes of the whole row, with those of the run-out."""
        return self.count + (0 if self.run_out is None else self.run_out.count)

    def row(self, layout: Layout) -> Layout:
        """Return the whole row of a layout: with the dominoes of the run-out, if it is complete."""
        if self.run_out is None or layout.count != self.count:
            return layout
        batch = LayoutBatch.of_one(layout, self.physics, 0.0, self.ground)
        return self.run_out.append_to(batch).layout(0)

    @cached_property
    def space(self) -> DesignSpace:
        """Free sizes of layouts, and the rules about them."""
        unit, growth = "heights" if self.in_heights else "m", self.growth or (1.0, 1.0)
        return DesignSpace(
            self.count - 1, self.height, self.first_thickness,
            Part("spacing", *self.spacing, unit), Part("thickness", *self.thickness, unit, 1),
            Part("growth", *growth, "", 1), self.length, self.stock,
        )  # fmt: skip

    @property
    def free_thickness(self) -> bool:
        """True if the thicknesses of all dominoes but the first are design variables."""
        return self.space.thickness.is_free

    @property
    def is_homogeneous(self) -> bool:
        """True if the rules are the same for all dominoes but the first."""
        is_even = self.ground is None or self.ground.is_even
        return is_even and (self.stock, self.growth, self.run_out) == (None, None, None)

    def layout(
        self,
        spacing: ArrayLike,
        thickness: ArrayLike | None = None,
        height: ArrayLike | None = None,
    ) -> Layout:
        """Return the layout with these free gaps, thicknesses and heights.

        The scene's rules are not checked, see `violations`.

        Parameters
        ----------
        spacing
            (N-1,) free gaps [m], or a single number for all.
        thickness
            (N-1,) thicknesses of dominoes 1 … N-1 [m], or a single number; None if the scene
            fixes it.
        height
            (N-1,) heights of dominoes 1 … N-1 [m], or a single number; None if all are equal.

        Returns
        -------
        Layout
            The layout, on the scene's ground.

        Raises
        ------
        ValueError
            If thicknesses or heights are missing, and for arrays of another shape and sizes that
            are not positive.
        """
        if thickness is None and self.free_thickness:
            raise ValueError(f"thickness is missing: give it, scene '{self.name}' leaves it free")
        pairs = self.count - 1
        gaps = full_array("spacing", spacing, pairs)[None]
        thicknesses, heights = (
            None if part is None else full_array(name, part, pairs)[None]
            for name, part in (("thickness", thickness), ("height", height))
        )
        return self.batch(gaps, thicknesses, heights).layout(0)

    def batch(
        self,
        spacing: Floats,
        thickness: Floats | None = None,
        height: Floats | None = None,
        rtol: float = 1e-6,
    ) -> LayoutBatch:
        """Return a batch of B layouts, without checking the scene's rules.

        Parameters
        ----------
        spacing
            (B, N-1) free gaps [m]. With fewer columns, the layouts are the first dominoes of
            complete ones.
        thickness
            (B, N-1) thicknesses of dominoes 1 … N-1 [m]; None for the smallest that the scene
            allows, the only one if it is fixed.
        height
            (B, N-1) heights of dominoes 1 … N-1 [m]; None if all are equal.
        rtol
            Relative tolerance of the arrival times.

        Returns
        -------
        LayoutBatch
            The layouts, to be simulated.

        Raises
        ------
        ValueError
            If the heights are missing, and for arrays of another shape.
        """
        if height is None and self.space.grows:
            raise ValueError(f"height is missing: give it, as heights grow in scene '{self.name}'")
        spacing = numbers("spacing", spacing, None, ("B", "N-1"))
        shape = (len(spacing), spacing.shape[1] + 1)
        heights = np.full((1, shape[1]) if height is None else shape, self.height)
        if height is not None:
            heights[:, 1:] = numbers("height", height, None, spacing.shape)
        fixed = self.thickness[0] * (heights[:, 1:] if self.in_heights else np.ones(1))
        thicknesses = np.full(shape, self.first_thickness)
        given = fixed if thickness is None else numbers("thickness", thickness, None, spacing.shape)
        thicknesses[:, 1:] = given
        sizes = spacing, thicknesses, heights, self.width, self.density
        return LayoutBatch(*sizes, self.physics, rtol, self.ground)

    def violations(self, layout: Layout, *, complete: bool = True) -> list[str]:
        """Return one sentence for each rule of the scene that a layout violates.

        Limits on the wave are not among these rules: they enter the score.

        Parameters
        ----------
        layout
            The layout.
        complete
            True for a layout of all dominoes; False for the first dominoes of a layout, whose
            number and total length are not checked.

        Returns
        -------
        list of str
            One sentence for each rule, with the place, the value and the accepted range; empty if
            there is no violation.

        Raises
        ------
        TypeError
            For anything but a layout.
        """
        require_layout(layout)
        if complete and layout.count != self.count:
            return [f"the layout has {layout.count} dominoes, and the scene {self.count}"]
        violations = ground_violations(layout, self.ground)
        heights = layout.height[:1] if self.space.grows else layout.height
        for name, values, size, unit in (
            ("thickness", layout.thickness[:1], self.first_thickness, "m"),
            ("height", heights, self.height, "m"),
            ("density", layout.density, self.density, "kg/m³"),
        ):
            # relative slack for sizes that other programs have rounded
            violations += Part(name, size, size, unit).violations(values, slack=1e-9)
        return violations + self.space.violations(layout, complete)

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
            scores between -1 and 0, higher the further it came. See `domino_env.scenes.objectives`.

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
            return float(self.evaluate_waves(layout.as_batch()).score[0])
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

    def evaluate_waves(self, waves: WaveBatch) -> Scores:
        """Score waves that have been simulated with fixed pivots.

        The waves of incomplete layouts can be scored if they stopped. Their reaches must then refer
        to all N dominoes of the whole row, not to those of the layouts. Complete layouts are
        simulated again, with all threads, if the scores need their draws of placement noise or
        free-standing dominoes.

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
            For anything but a batch of waves.
        ValueError
            For waves of more dominoes than the whole row has, or of fewer if one propagated.
        """
        require_type("waves", waves, WaveBatch, "a WaveBatch, as simulate_batch() returns")
        n, count = waves.count, self.row_count
        if n > count or (n < count and waves.propagated.any()):
            raise ValueError(f"waves of {n} dominoes: give {count}, or fewer if they stop")
        if self.scoring.objective.needs_arrivals and not waves.arrivals.shape[1]:
            raise ValueError("waves without arrivals: simulate with record=True, without gradient")
        if n < count:
            falls = np.ceil(waves.reach * count).astype(np.int64)
            return replace(self.scoring.score(waves), falls=falls)
        if self.scoring.follows_wave:
            return self.scoring.score(waves)
        arrays, part = waves.arrays, np.s_[:, 1 : self.count]  # without the run-out
        heights = np.broadcast_to(arrays.height, arrays.thickness.shape)
        sizes = arrays.spacing[:, : self.count - 1], arrays.thickness[part], heights[part]
        return self.scoring.evaluate(self.batch(*sizes, waves.rtol))

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
            return self.scoring.format_score(score)
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

    # file and uniform baseline --------------------------------------------------------------------

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> Self:
        """Return the scene of a file's document, which has a name.

        Parameters
        ----------
        document
            Tables of the file, as `tomllib` reads them.

        Returns
        -------
        Scene
            The scene.

        Raises
        ------
        ValueError
            For an invalid document; the message has key, value and accepted range.
        """
        scene, file = object.__new__(cls), tables.read_tables(document)
        scene._set({"uniform_point": None} | file.fields())
        scene._complete()
        if file.physics.push == tables.RELEASED:
            scene._set({"physics": tables.released(scene)})
        return scene

    def document(self) -> dict[str, Any]:
        """Return the tables of the file that is read as the same scene.

        Returns
        -------
        dict
            Values by table and key, in the units of scene files.
        """
        return tables.make_document(self)

    def to_toml(self) -> str:
        """Return the text of the scene's file.

        Returns
        -------
        str
            TOML that `load_scene` reads as the same scene.
        """
        return tables.format_toml(self.document())

    def uniform(self) -> UniformBaseline:
        """Return the best layout with equal gaps, computed once for equal scenes.

        Returns
        -------
        UniformBaseline
            The baseline, with its `layout`, `wave` and `score`.
        """
        return self._uniform

    @cached_property
    def _uniform(self) -> UniformBaseline:
        return uniform_baseline(self, self.uniform_point or stored_point(self.document()))

    def with_uniform(self, point: Floats | Sequence[float]) -> Self:
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
        scene = copy.copy(self)  # without the checks, which the fields have passed
        vars(scene).pop("_uniform", None)
        scene._set({"uniform_point": tuple(map(float, point))})
        return scene
