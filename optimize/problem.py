"""Problem: a scene as numbers between 0 and 1."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from domino_env.layout import Layout
from domino_env.scene import Scene
from optimize.projection import nearest_with_sum

Floats = NDArray[np.float64]

GRADIENT_RTOL = 1e-8
# A score's error is smooth but for jumps of its tolerance, where the simulator changes its rule:
# differences over this step need the closer tolerance, and then are good to about 1e-8.
STEP = 1e-5
STEP_RTOL = 1e-10


class Problem:
    """The design vector of a scene, how it becomes a layout, and what the layout scores.

    A design x has one entry in [0, 1] for each free gap, then one for each free thickness, running
    from its least to its largest value.  Where the scene asks for a length, a design stands for the
    nearest one (in metres) that meets it: no layout outside the rules is ever simulated.

    scene: the scene.  dimension: n, length of x.  rtol: how closely the waves are simulated.
    low, high: (n,) what 0 and 1 stand for [m].
    evaluations, falls: layouts and single falls simulated so far.

    Raises ValueError for a scene that leaves nothing free.
    """

    def __init__(self, scene: Scene, rtol: float = 1e-6) -> None:
        self.scene = scene
        self.rtol = rtol
        pairs = scene.count - 1
        bounds = [scene.spacing] * pairs * scene.free_spacing
        bounds += [scene.thickness] * pairs * scene.free_thickness
        if not bounds:
            raise ValueError(
                f"scene '{scene.name}' leaves nothing free: there is nothing to search"
            )
        self.low = np.array([b[0] for b in bounds])
        self.high = np.array([b[1] for b in bounds])
        self.dimension = len(bounds)
        self.evaluations = 0
        self.falls = 0

    @property
    def equality(self) -> tuple[Floats, float] | None:
        """Coefficients a (n,) and right side b of a·x = b [m]; None where no length is asked."""
        if self.scene.length is None:
            return None
        return self.high - self.low, self._total - float(self.low.sum())

    @property
    def _total(self) -> float:
        """What the free gaps and thicknesses add up to where a length is asked [m]."""
        scene = self.scene
        assert scene.length is not None
        fixed = scene.spacing[0] * (not scene.free_spacing)
        fixed += scene.thickness[0] * (not scene.free_thickness)
        return scene.length - (scene.count - 1) * fixed

    def values(self, designs: Floats) -> Floats:
        """The free gaps and thicknesses that designs (B, n) stand for, (B, n) [m]."""
        values: Floats = np.clip(self.low + designs * (self.high - self.low), self.low, self.high)
        if self.scene.length is None:
            return values
        return nearest_with_sum(values, self.low, self.high, self._total)

    def project(self, designs: Floats) -> Floats:
        """The nearest designs (in metres) within the box and of the right length, (B, n)."""
        return self._scaled(self.values(designs))

    def layout(self, design: Floats) -> Layout:
        """The layout of one design (n,)."""
        spacing, thickness = self._parts(np.asarray(design, dtype=np.float64)[None])
        return self.scene.layout(spacing[0], None if thickness is None else thickness[0])

    def design(self, layout: Layout) -> Floats:
        """The design of a layout of this scene, (n,)."""
        values = [layout.spacing] * self.scene.free_spacing
        values += [layout.thickness[1:]] * self.scene.free_thickness
        return self._scaled(np.concatenate(values))

    def scores(self, designs: Floats, rtol: float | None = None) -> Floats:
        """(B,) scores of designs (B, n), higher is better; see `Scene.score`.

        rtol: how closely to simulate, the problem's own where None.
        """
        designs = self._checked(designs)
        scores = self.scene.score_batch(*self._parts(designs), rtol=rtol or self.rtol)
        self.evaluations += len(designs)
        self.falls += self._falls(scores)
        return scores

    def score(self, design: Floats) -> float:
        """The score of one design (n,)."""
        return float(self.scores(np.asarray(design)[None])[0])

    def score_and_gradient(
        self, design: Floats, scores: Callable[[Floats, float], Floats] | None = None
    ) -> tuple[float, Floats]:
        """The score of one design (n,) and its gradient (n,); see `scores_and_gradients`."""
        designs = np.asarray(design, dtype=np.float64)[None]
        found, gradients = self.scores_and_gradients(designs, scores)
        return float(found[0]), gradients[0]

    def scores_and_gradients(
        self, designs: Floats, scores: Callable[[Floats, float], Floats] | None = None
    ) -> tuple[Floats, Floats]:
        """Scores (B,) of designs (B, n) and their gradients (B, n).

        Exact, at the cost of some four waves each, whatever n; an evaluation counts as one.  At an
        edge of the rules (a face of the box, the length that is asked for) it is that of the
        nearest layout within them.  Where a wave dies the score is how far it came, and its
        gradient is taken by differences.
        scores: takes designs and a tolerance, `self.scores` where None (a meter may stand between).
        """
        designs = np.clip(self._checked(designs), 0.0, 1.0)
        spacing, thickness = self._parts(designs)
        found, *slopes = self.scene.score_batch_gradient(spacing, thickness, GRADIENT_RTOL)
        self.evaluations += len(designs)
        self.falls += self._falls(found)
        free = [self.scene.free_spacing, self.scene.free_thickness]
        by_value = np.concatenate([s for s, f in zip(slopes, free, strict=True) if f], axis=1)
        if self.scene.length is not None:
            # The projection moves all values that are not at a bound alike.
            values = self.values(designs)
            inside = (values > self.low) & (values < self.high)
            mean = (by_value * inside).sum(1) / np.maximum(inside.sum(1), 1)
            # What stands at its bound may leave it; what was only projected there stays.
            stays = ~inside & (designs > 0.0) & (designs < 1.0)
            by_value = np.where(stays, 0.0, by_value - mean[:, None])
        gradients = by_value * (self.high - self.low)
        for b in np.flatnonzero(found < 0.0):
            gradients[b] = self._differences(designs[b], scores)
        return found, gradients

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

    def _parts(self, designs: Floats) -> tuple[Floats, Floats | None]:
        """Gaps and, where free, thicknesses of dominoes 1 … N-1, (B, N-1) each [m]."""
        values, pairs = self.values(designs), self.scene.count - 1
        if not self.scene.free_spacing:
            return np.full((len(values), pairs), self.scene.spacing[0]), values
        if not self.scene.free_thickness:
            return values, None
        return values[:, :pairs], values[:, pairs:]

    def _scaled(self, values: Floats) -> Floats:
        return np.asarray(np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0))

    def _falls(self, scores: Floats) -> int:
        """Falls simulated: all of them for a wave that ran through, else what its score tells."""
        reach = np.where(scores < 0.0, scores + 1.0, 1.0)
        return int(np.ceil(reach * self.scene.count).sum())

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
