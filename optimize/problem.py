"""Problem: a scene as numbers between 0 and 1."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from domino_env.layout import Layout
from domino_env.scene import Scene

Floats = NDArray[np.float64]


class Problem:
    """The design vector of a scene, how it becomes a layout, and what the layout scores.

    A design x has one entry in [0, 1] for each free gap, then one for each free thickness, running
    from its least to its largest value.  Where the scene asks for a length, a design is first moved
    to the nearest one (in metres) that meets it: no layout outside the rules is ever simulated.

    scene: the scene.  dimension: length of x.  rtol: how closely the waves are simulated.
    evaluations, falls: layouts and single falls simulated so far.
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

    def parts(self, designs: Floats) -> tuple[Floats, Floats | None]:
        """Free gaps and thicknesses of dominoes 1 … N-1, (B, N-1) each [m], of designs (B, n)."""
        values = self.low + np.clip(designs, 0.0, 1.0) * (self.high - self.low)
        np.clip(values, self.low, self.high, out=values)
        scene, pairs = self.scene, self.scene.count - 1
        if scene.length is not None:
            fixed = 0.0 if scene.free_thickness else pairs * scene.thickness[0]
            fixed += 0.0 if scene.free_spacing else pairs * scene.spacing[0]
            values = meet_sum(values, self.low, self.high, scene.length - fixed)
        if not scene.free_spacing:
            return np.full((len(values), pairs), scene.spacing[0]), values
        if not scene.free_thickness:
            return values, None
        return values[:, :pairs], values[:, pairs:]

    def layout(self, design: Floats) -> Layout:
        """The layout of one design (n,)."""
        spacing, thickness = self.parts(np.asarray(design)[None])
        return self.scene.layout(spacing[0], None if thickness is None else thickness[0])

    def design(self, layout: Layout) -> Floats:
        """The design of a layout of this scene."""
        values = [layout.spacing] * self.scene.free_spacing
        values += [layout.thickness[1:]] * self.scene.free_thickness
        design: Floats = (np.concatenate(values) - self.low) / (self.high - self.low)
        return np.clip(design, 0.0, 1.0)

    def score(self, designs: Floats) -> Floats:
        """(B,) scores of designs (B, n), higher is better; see `Scene.score`."""
        designs = np.asarray(designs, dtype=np.float64)
        if designs.ndim != 2 or designs.shape[1] != self.dimension:
            raise ValueError(
                f"designs have shape {designs.shape}: expected (any number, {self.dimension})"
            )
        if not np.isfinite(designs).all():
            b, i = np.argwhere(~np.isfinite(designs))[0]
            raise ValueError(
                f"design {b} has {designs[b, i]} at place {i}: every entry is in [0, 1]"
            )
        scores = self.scene.score_batch(*self.parts(designs), rtol=self.rtol)
        self.evaluations += len(designs)
        reach = np.where(scores < 0.0, scores + 1.0, 1.0)
        self.falls += int(np.ceil(reach * self.scene.count).sum())
        return scores


def meet_sum(values: Floats, low: Floats, high: Floats, total: float) -> Floats:
    """The point nearest to each row of `values` within the bounds whose entries add up to `total`.

    Shifting all entries alike and clipping is that projection; the shift is found by bisection and
    what rounding leaves is spread over the entries that can still move.
    """
    down = np.full(len(values), (low - high).min()) - np.abs(total)
    up = -down
    for _ in range(80):
        shift = 0.5 * (down + up)
        short = np.clip(values + shift[:, None], low, high).sum(axis=1) < total
        down, up = np.where(short, shift, down), np.where(short, up, shift)
    moved = np.clip(values + up[:, None], low, high)
    for _ in range(2):
        off = total - moved.sum(axis=1)
        free = (moved > low) & (moved < high)
        share = off / np.maximum(free.sum(axis=1), 1)
        moved = np.clip(moved + free * share[:, None], low, high)
    result: Floats = moved
    return result
