"""The best uniform pitch of a scene: the mark that every search has to beat."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from domino_env.layout import Layout
    from domino_env.scene import Scene

Floats = NDArray[np.float64]

GRID_1D, GRID_2D = 1024, 96  # first look at the whole range, per axis
KEEP = 6  # places that are looked at again, each time more closely
FINEST = 1e-9  # [m] where looking closer ends
LARGEST_BATCH = 4_000_000  # dominoes at once, some 200 MB


def best_uniform(scene: Scene) -> Layout:
    """The fastest layout of one gap and one thickness within the scene's rules.

    The first domino keeps the scene's thickness.  A grid over all there is to choose, then finer
    grids around the best places: the speed has several peaks, and steps where a wave dies.
    Where none propagates, the one that came furthest.
    """
    low, high = _box(scene)
    axes = [
        np.linspace(a, b, 1 if a == b else (GRID_1D if min(high - low) == 0.0 else GRID_2D))
        for a, b in zip(low, high, strict=True)
    ]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    scores = _scores(scene, points)
    cell = np.array([a[1] - a[0] if len(a) > 1 else 0.0 for a in axes])
    while cell.max() > FINEST:
        best = points[_apart(points, scores, 2.0 * cell)]
        offsets = np.linspace(-1.0, 1.0, 9)
        steps = np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)
        if cell.min() == 0.0:
            steps = np.unique(steps * (cell > 0.0), axis=0)
        fresh = (best[:, None, :] + steps[None] * cell).reshape(-1, 2)
        fresh = np.unique(np.clip(fresh, low, high), axis=0)
        # the places themselves are among the fresh ones, so the best is never lost
        points, scores = fresh, _scores(scene, fresh)
        cell = cell / 4.0
    gap, thickness = points[int(np.argmax(scores))]
    if scene.length is not None:
        gap = _gap_for(scene, thickness)
    return scene.layout(gap, thickness)


def _gap_for(scene: Scene, thickness: float) -> float:
    """The one gap that meets the length."""
    assert scene.length is not None
    return float(scene.length / (scene.count - 1) - thickness)


def _box(scene: Scene) -> tuple[Floats, Floats]:
    """Least and largest (gap, thickness); where a length is to be met, the gap follows."""
    low = np.array([scene.spacing[0], scene.thickness[0]])
    high = np.array([scene.spacing[1], scene.thickness[1]])
    if scene.length is not None:
        pitch = scene.length / (scene.count - 1)
        low[1] = max(low[1], pitch - scene.spacing[1])
        high[1] = min(high[1], pitch - scene.spacing[0])
        if low[1] > high[1] + 1e-12:
            raise ValueError(
                f"scene '{scene.name}': no uniform row of {scene.count} dominoes is {scene.length} "
                f"m long within spacing {scene.spacing} m and thickness {scene.thickness} m"
            )
        low[0] = high[0] = pitch - low[1]
    return low, high


def _scores(scene: Scene, points: Floats) -> Floats:
    gap = points[:, 0]
    if scene.length is not None:
        gap = np.array([_gap_for(scene, d) for d in points[:, 1]])
    ones = np.ones(scene.count - 1)
    scores = np.empty(len(points))
    piece = max(1, LARGEST_BATCH // scene.count)
    for i in range(0, len(points), piece):
        part = slice(i, i + piece)
        spacing, thickness = gap[part, None] * ones, points[part, 1, None] * ones
        scores[part] = scene.score_batch(spacing, thickness, rtol=1e-11)
    return scores


def _apart(points: Floats, scores: Floats, distance: Floats) -> list[int]:
    """Indices of the best points that are no neighbours of a better one."""
    chosen: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        gap = np.abs(points[chosen] - points[i])
        if not np.any(np.all(gap <= distance, axis=1)):
            chosen.append(int(i))
        if len(chosen) == KEEP:
            break
    return chosen
