"""Scenes as the kernels take them: the arrays that B rows live in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from domino_env import kernels
from domino_env.envs.observation import closeness
from domino_env.envs.problems import Generators, Problems
from domino_env.scenes.scene import Scene

Floats = NDArray[np.float64]

LARGEST_RING = 1024  # dominoes remembered behind a front; the wave feels some thirty


def new_batch(problems: Problems, number: int, *, falls: bool) -> kernels.Batch | kernels.HillBatch:
    """Allocate the arrays of B rows.

    Parameters
    ----------
    problems
        What is built.
    number
        B.
    falls
        Whether the rows fall while they are built, which takes room.
    """
    scene, longest = problems.like, problems.longest
    kinds, stock = _kinds_to_choose(scene)
    drawn = problems.distribution
    unlike = scene.growth is not None or (drawn is not None and "height" in drawn.features)
    hills = falls and scene.ground is not None
    batch = kernels.Batch(
        rules=np.zeros(1 if drawn is None else number, kernels.RULES),
        features=np.zeros((number, problems.features.shape[1]), np.float32),
        closeness=closeness(longest),
        gap_values=np.array(scene.spacing_values or (), dtype=np.float64),
        kinds=kinds,
        stock=stock,
        left=np.tile(stock, (number, 1)),
        errors=np.zeros((number if scene.placement_deviation else 0, longest - 1)),
        rings=np.zeros(
            (number, _ring_size(longest) if falls else 0),
            kernels.HILL_LINK if hills else kernels.LINK,
        ),
        states=np.zeros(number if falls else 0, kernels.STATE),
        episodes=np.zeros(number if falls else 0, kernels.EPISODE),
        spacing=np.full((number, longest - 1), scene.spacing[0]),
        thickness=np.full((number, longest), scene.first_thickness),
        # where all are equally high, all rows share one array
        height=np.full((number if unlike else 1, longest), scene.height),
        density=np.full((1, longest), scene.density),
    )
    if not hills:
        return batch
    assert scene.ground is not None
    _, tilt = scene.ground.lay(np.empty(0), batch.thickness[0, :1])
    return kernels.HillBatch(
        *batch,
        rise=np.zeros((number, longest - 1)),
        tilt=np.full((number, longest), tilt[0]),
        places=np.zeros((number, longest)),
        curve=scene.ground.curve,
    )


def draw_errors(
    batch: kernels.Batch | kernels.HillBatch,
    rows: NDArray[np.intp],
    scene_of: Callable[[int], Scene],
    generators: Generators,
) -> None:
    """Draw by how much the gaps of some rows will come out wrong, where the hand is unsteady."""
    if not len(batch.errors):
        return
    for b in rows.tolist():
        scene = scene_of(b)
        batch.errors[b, : scene.count - 1] = scene.placement_errors(generators(b))


def _kinds_to_choose(scene: Scene) -> tuple[Floats, Floats]:
    """The thicknesses that dominoes may have [m], if only some, and how many of each."""
    if scene.stock is not None:
        box = scene.stock.without(scene.first_thickness)
        order = np.argsort(box.thickness)
        return np.array(box.thickness)[order], np.array(box.count, dtype=np.float64)[order]
    kinds = np.array(scene.thickness_values or (), dtype=np.float64)
    return kinds, np.full(len(kinds), np.inf)


def _ring_size(count: int) -> int:
    """A power of two that holds the row, or what is felt of it."""
    size = 2
    while size < count + 1 and size < LARGEST_RING:
        size *= 2
    return size
