"""Problem: a scene as numbers between 0 and 1."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from domino_env.chain.layout import Layout
from domino_env.chain.wave import Outcome, simulate
from domino_env.scenes.scene import Scene
from optimize.projection.allowed import Allowed
from optimize.projection.feasible import require_feasible

if TYPE_CHECKING:
    from optimize.evaluation.journal import Journal

Floats = NDArray[np.float64]

GRADIENT_RTOL = 1e-8
# A score's error is smooth but for jumps of its tolerance, where the simulator changes its rule:
# differences over this step need the closer tolerance, and then are good to about 1e-8.
STEP = 1e-5
STEP_RTOL = 1e-10


class Problem:
    """The design vector of a scene, how it becomes a layout, and what the layout scores.

    A design x has one entry in [0, 1] for each free gap, then one for each free thickness, then one
    for each free height (over that of the domino before), running from its least to its largest
    value. Any design stands for the nearest one (in metres) that keeps the scene's rules: length,
    largest change, lists of allowed values, stock; no layout outside them is ever simulated.

    Parameters
    ----------
    scene
        What is searched.
    rtol
        How closely the waves are simulated.

    Attributes
    ----------
    dimension
        n, length of a design.
    low, high
        (n,) what 0 and 1 stand for [m], or what the scene gives in heights.
    discrete
        Whether some values come from a list or the stock, so that scores have steps.
    evaluations, falls
        Layouts and single falls simulated so far; an evaluation of a "robust" scene topples
        hundreds of rows.
    journal
        Remembers what was found, and answers from what is remembered; None for neither.

    Raises
    ------
    ValueError
        For a scene that leaves nothing free, and for one whose rules clash, with their names.
    """

    def __init__(self, scene: Scene, rtol: float = 1e-6) -> None:
        self.scene = scene
        self.rtol = rtol
        pairs = scene.count - 1
        bounds = [scene.spacing] * pairs * scene.free_spacing
        bounds += [scene.thickness] * pairs * scene.free_thickness
        if scene.growth is not None:
            bounds += [scene.growth] * pairs * scene.free_height
        if not bounds:
            raise ValueError(
                f"scene '{scene.name}' leaves nothing free: there is nothing to search"
            )
        require_feasible(scene)
        self.low = np.array([b[0] for b in bounds])
        self.high = np.array([b[1] for b in bounds])
        self.dimension = len(bounds)
        gaps = pairs * scene.free_spacing
        total = None if scene.length is None else self._total
        self._allowed = Allowed(scene, self.low, self.high, gaps, total)
        self.discrete = self._allowed.discrete
        self.evaluations = 0
        self.falls = 0
        self.journal: Journal | None = None

    @property
    def equality(self) -> tuple[Floats, float] | None:
        """Coefficients a (n,) and right side b of a·x = b [m]; None where no length is asked."""
        if self.scene.length is None:
            return None
        return self.high - self.low, self._total - float(self.low.sum())

    @property
    def linear(self) -> tuple[Floats, Floats] | None:
        """A (m, n) and b (m,) of A x ≤ b [m]: the largest change of the gaps; None where any is."""
        rules = self._allowed.linear()
        if rules is None:
            return None
        return rules[0] * (self.high - self.low), rules[1] - rules[0] @ self.low

    @property
    def coupled(self) -> bool:
        """Whether some designs of the box stand for others: see `project`."""
        return self.scene.length is not None or self.discrete or self._allowed.coupled

    @property
    def _total(self) -> float:
        """What the free gaps and thicknesses add up to where a length is asked [m]."""
        scene = self.scene
        assert scene.length is not None
        fixed = scene.spacing[0] * (not scene.free_spacing)
        fixed += scene.thickness[0] * (not scene.free_thickness)
        return scene.length - (scene.count - 1) * fixed

    def values(self, designs: Floats) -> Floats:
        """Find the free gaps, thicknesses and growths (B, n) [m] that designs (B, n) stand for."""
        return self._allowed.nearest(self._wanted(designs))

    def project(self, designs: Floats) -> Floats:
        """Find the nearest designs (in metres) that keep the scene's rules, (B, n)."""
        return self._scaled(self.values(designs))

    def layout(self, design: Floats) -> Layout:
        """Give the layout of one design (n,)."""
        spacing, thickness, height = self._parts(np.asarray(design, dtype=np.float64)[None])
        return self.scene.layout(
            spacing[0],
            None if thickness is None else thickness[0],
            None if height is None else height[0],
        )

    def design(self, layout: Layout) -> Floats:
        """Give the design (n,) of a layout of this scene."""
        scene = self.scene
        gaps, thick, tall = layout.spacing, layout.thickness[1:], layout.height
        if scene.in_heights:
            gaps, thick = gaps / np.minimum(tall[:-1], tall[1:]), thick / tall[1:]
        values = [gaps] * scene.free_spacing
        values += [thick] * scene.free_thickness
        values += [tall[1:] / tall[:-1]] * scene.free_height
        return self._scaled(np.concatenate(values))

    def scores(self, designs: Floats, rtol: float | None = None) -> Floats:
        """Simulate designs and score them, higher is better; see `Scene.score`.

        Parameters
        ----------
        designs
            (B, n) designs.
        rtol
            How closely to simulate; the problem's own where None.

        Returns
        -------
        ndarray
            (B,) scores.

        Raises
        ------
        ValueError
            For designs of another shape, or with entries that are not finite.
        """
        designs, rtol = self._checked(designs), rtol or self.rtol

        def simulated() -> tuple[Floats, ...]:
            spacing, thickness, height = self._parts(designs)
            more = {} if height is None else {"height": height}
            return (self.scene.score_batch(spacing, thickness, rtol, **more),)

        (scores,) = self._found((rtol, designs), simulated, (len(designs),))
        self.count(scores)
        return scores

    def remember_scores(self, designs: Floats, rtol: float | None, scores: Floats) -> None:
        """Count scores (B,) of designs (B, n) that were found elsewhere, as `scores` would."""
        if self.journal is not None:
            self.journal.keep((rtol or self.rtol, self._checked(designs)), (scores,))
        self.count(scores)

    def count(self, scores: Floats) -> None:
        """Note what it took to find these scores (B,)."""
        self.evaluations += len(scores)
        self.falls += self.scene.falls(scores)

    def score(self, design: Floats) -> float:
        """Score one design (n,)."""
        return float(self.scores(np.asarray(design)[None])[0])

    def score_and_gradient(self, design: Floats) -> tuple[float, Floats]:
        """Score one design (n,), with its gradient (n,); see `scores_and_gradients`."""
        designs = np.asarray(design, dtype=np.float64)[None]
        found, gradients = self.scores_and_gradients(designs)
        return float(found[0]), gradients[0]

    def scores_and_gradients(
        self,
        designs: Floats,
        scores: Callable[[Floats, float], Floats] | None = None,
        *,
        at_will: bool = False,
    ) -> tuple[Floats, Floats]:
        """Score designs, with the exact gradient of each.

        The cost is some four waves for each design, whatever n; an evaluation counts as one. At an
        edge of the rules (a face of the box, the length that is asked for) the gradient is that of
        the nearest layout within them. Where a row is no success the score is how far the wave came
        or how much a limit is broken, and its gradient is taken by differences.

        Parameters
        ----------
        designs
            (B, n) designs.
        scores
            Takes designs and a tolerance, for the differences; `self.scores` where None (a budget
            may stand between).
        at_will
            Give values from a list or the stock the gradient that they would have if they could
            move; otherwise it is 0, since they stay where they are when a design changes a little.

        Returns
        -------
        scores : ndarray
            (B,) scores.
        gradients : ndarray
            (B, n) gradients by the designs.

        Raises
        ------
        ValueError
            For designs of another shape, or with entries that are not finite.
        """
        designs = np.clip(self._checked(designs), 0.0, 1.0)

        def simulated() -> tuple[Floats, ...]:
            values = self.values(designs)
            spacing, thickness, height = self._split(values)
            more = {} if height is None else {"height": height}
            found, *slopes = self.scene.score_batch_gradient(
                spacing, thickness, GRADIENT_RTOL, **more
            )
            by_value = self._by_value(values, *slopes)
            by_value = self._allowed.tangent(by_value, self._wanted(designs), values, at_will)
            return found, by_value * (self.high - self.low)

        shapes = (len(designs),), designs.shape
        found, gradients = self._found((f"gradient {at_will}", designs), simulated, *shapes)
        self.count(found)
        for b in np.flatnonzero(self._without_slope(found)):
            gradients[b] = self._differences(designs[b], scores) * ~self._allowed.stepped
        return found, gradients

    def lateness(self, design: Floats) -> tuple[float, Floats, Floats]:
        """Find how late each domino of one design is hit, with its gradient: for least squares.

        It counts as one evaluation, at the cost of N gradients.

        Parameters
        ----------
        design
            (n,) a design.

        Returns
        -------
        score : float
            As of `score`.
        late : ndarray
            (N-1,) arrival minus schedule of dominoes 1 … N-1 [s]; empty for a wave that dies.
        gradient : ndarray
            (N-1, n) its derivative by the design [s]; empty for a wave that dies.

        Raises
        ------
        ValueError
            Where the scene has no schedule.
        """
        tempo, pairs = self.scene.tempo, self.scene.count - 1
        if tempo is None:
            raise ValueError(f"scene '{self.scene.name}' has no schedule: there is no lateness")
        designs = np.clip(self._checked(np.asarray(design)[None]), 0.0, 1.0)

        def simulated() -> tuple[Floats, ...]:
            values = self.values(designs)
            layout, physics = self.layout(designs[0]), self.scene.physics
            wave = simulate(layout, physics, rtol=STEP_RTOL, gradient=True)
            score = np.array([self.scene.score_wave(wave)])
            if wave.outcome != Outcome.PROPAGATED:
                return score, np.empty(0), np.empty((0, self.dimension))
            pulled = [wave.pullback(bar) for bar in np.eye(pairs + 1)[1:]]
            slopes = self._by_value(
                np.repeat(values, pairs, axis=0),
                np.array([one.spacing for one in pulled]),
                np.array([one.thickness[1:] for one in pulled]),
                np.array([one.height[1:] for one in pulled]),
            )
            wanted = np.repeat(self._wanted(designs), pairs, axis=0)
            slopes = self._allowed.tangent(slopes, wanted, np.repeat(values, pairs, axis=0))
            late = wave.arrival_times[1:] - tempo.schedule(self.scene.count)
            return score, late, slopes * (self.high - self.low)

        shapes = (1,), (-1,), (-1, self.dimension)
        score, late, slopes = self._found(("lateness", designs), simulated, *shapes)
        self.count(score)
        return float(score[0]), late, slopes

    def _found(
        self,
        question: tuple[object, Floats],
        simulated: Callable[[], tuple[Floats, ...]],
        *shapes: tuple[int, ...],
    ) -> tuple[Floats, ...]:
        if self.journal is None:
            return simulated()
        return self.journal.answer(question, simulated, shapes)

    def _without_slope(self, found: Floats) -> NDArray[np.bool_]:
        """Whose scores have no exact gradient."""
        if self.scene.objective == "toppled":
            return np.asarray(found < self.scene.count)
        return np.asarray(found < 0.0)

    def _by_value(
        self, values: Floats, by_gap: Floats, by_thickness: Floats, by_height: Floats
    ) -> Floats:
        """Slopes by the free values, from those by gaps, thicknesses and heights [m]."""
        scene = self.scene
        free = [scene.free_spacing, scene.free_thickness, scene.free_height]
        if scene.in_heights:
            by_gap, by_thickness, by_height = self._in_heights(
                values, by_gap, by_thickness, by_height
            )
        slopes = (by_gap, by_thickness, by_height)
        return np.concatenate([s for s, f in zip(slopes, free, strict=True) if f], axis=1)

    def _in_heights(
        self, values: Floats, by_gap: Floats, by_thickness: Floats, by_height: Floats
    ) -> tuple[Floats, Floats, Floats]:
        """Slopes by gaps over heights, thicknesses over heights, and growths."""
        gaps, thick, tall = self._split(values)
        scene, pairs = self.scene, self.scene.count - 1
        if tall is None:
            return scene.height * by_gap, scene.height * by_thickness, by_height
        before = np.concatenate([np.full((len(tall), 1), scene.height), tall[:, :-1]], axis=1)
        thick = scene.thickness[0] * tall if thick is None else thick
        # a height carries its domino's thickness along, and the gap behind it
        whole = by_height * tall + by_thickness * thick
        whole[:, :-1] += by_gap[:, 1:] * gaps[:, 1:]
        growth = values[:, -pairs:] if scene.free_height else np.ones_like(tall)
        # and a growth all heights from there on
        later = np.cumsum(whole[:, ::-1], axis=1)[:, ::-1] / growth
        return by_gap * before, by_thickness * tall, later

    def _differences(
        self, design: Floats, scores: Callable[[Floats, float], Floats] | None
    ) -> Floats:
        """The gradient (n,) by differences in one batch, one-sided at the faces of the box."""
        n = self.dimension
        ahead, behind = np.minimum(design + STEP, 1.0), np.maximum(design - STEP, 0.0)
        points = np.repeat(design[None], 2 * n, axis=0)
        i = np.arange(n)
        points[i, i], points[n + i, i] = ahead, behind
        found = (scores or self.scores)(points, STEP_RTOL)
        return np.asarray((found[:n] - found[n:]) / (ahead - behind))

    def _wanted(self, designs: Floats) -> Floats:
        """Values (B, n) before the rules are applied."""
        return np.asarray(np.clip(self.low + designs * (self.high - self.low), self.low, self.high))

    def _parts(self, designs: Floats) -> tuple[Floats, Floats | None, Floats | None]:
        """Gaps and, where free, thicknesses and heights of dominoes 1 … N-1, (B, N-1) each [m]."""
        return self._split(self.values(designs))

    def _split(self, values: Floats) -> tuple[Floats, Floats | None, Floats | None]:
        scene, pairs = self.scene, self.scene.count - 1
        at = 0
        gaps: Floats = np.full((len(values), pairs), scene.spacing[0])
        thick: Floats | None = None
        tall: Floats | None = None
        if scene.free_spacing:
            gaps, at = values[:, :pairs], pairs
        if scene.free_thickness:
            thick, at = values[:, at : at + pairs], at + pairs
        if scene.growth is not None:
            growth = values[:, at:] if scene.free_height else np.full_like(gaps, scene.growth[0])
            tall = np.asarray(scene.height * np.cumprod(growth, axis=1))
        if scene.in_heights:
            own = np.full_like(gaps, scene.height) if tall is None else tall
            before = np.concatenate([np.full((len(own), 1), scene.height), own[:, :-1]], axis=1)
            gaps = gaps * before
            thick = None if thick is None else thick * own
        return gaps, thick, tall

    def _scaled(self, values: Floats) -> Floats:
        return np.asarray(np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0))

    def _checked(self, designs: Floats) -> Floats:
        designs = np.asarray(designs, dtype=np.float64)
        if designs.ndim != 2 or designs.shape[1] != self.dimension:
            raise ValueError(
                f"designs have shape {designs.shape}: expected (any number, {self.dimension})"
            )
        good = np.isfinite(designs)
        if not good.all():
            b, i = np.argwhere(~good)[0]
            raise ValueError(
                f"design {b} has {designs[b, i]} at place {i}: every entry is in [0, 1]"
            )
        return designs
