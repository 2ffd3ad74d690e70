"""A scene as the kernels take it: its rules, and the arrays that B rows live in."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from domino_env import kernels
from domino_env.chain.wave import LOOSEST, TIGHTEST
from domino_env.envs.observation import progress_features
from domino_env.scenes.scene import Scene

Floats = NDArray[np.float64]

LARGEST_RING = 1024  # dominoes remembered behind a front; the wave feels some thirty


def new_batch(scene: Scene, number: int, rtol: float, window: int, *, falls: bool) -> kernels.Batch:
    """Allocate the arrays of B rows.

    Parameters
    ----------
    scene
        What is built.
    number
        B.
    rtol
        Relative error allowed in the arrival times.
    window
        Gaps (and thicknesses) observed behind the front.
    falls
        Whether the rows fall while they are built, which takes room.

    Raises
    ------
    ValueError
        Where the scene leaves nothing free or has rules that cannot be kept domino by domino, and
        for a tolerance that the simulator does not take.
    """
    _require_choice(scene)
    if not TIGHTEST <= rtol <= LOOSEST:
        raise ValueError(f"rtol = {rtol}: choose a tolerance between {TIGHTEST} and {LOOSEST}")
    kinds, stock = _kinds_to_choose(scene)
    return kernels.Batch(
        rules=_rules_of(scene, rtol, window),
        progress=progress_features(scene.count),
        gap_values=np.array(scene.spacing_values or (), dtype=np.float64),
        kinds=kinds,
        stock=stock,
        left=np.tile(stock, (number, 1)),
        rings=np.zeros((number, _ring_size(scene.count) if falls else 0), kernels.LINK),
        states=np.zeros(number if falls else 0, kernels.STATE),
        episodes=np.zeros(number if falls else 0, kernels.EPISODE),
        spacing=np.full((number, scene.count - 1), scene.spacing[0]),
        thickness=np.full((number, scene.count), scene.first_thickness),
        # where all are equally high, all rows share one array
        height=np.full((number if scene.growth is not None else 1, scene.count), scene.height),
        density=np.full((1, scene.count), scene.density),
    )


def choices(scene: Scene) -> int:
    """Count the free numbers of each domino that is placed."""
    return int(scene.free_spacing) + int(scene.free_thickness) + int(scene.free_height)


def _require_choice(scene: Scene) -> None:
    """Refuse a scene that leaves nothing free, or whose rules cannot be kept domino by domino."""
    if not choices(scene):
        raise ValueError(
            f"scene '{scene.name}' leaves nothing free: there is nothing to choose; give spacing "
            "or thickness a min and a max"
        )
    if scene.ground is not None:
        raise ValueError(
            f"scene '{scene.name}' has ground that is not flat, which the environments do not know "
            "yet: search such rows with `optimize`"
        )
    if scene.length is not None and not replace(scene, limits=None).plain:
        raise ValueError(
            f"scene '{scene.name}' asks for a length and for lists, a stock or a largest change "
            "too: what remains reachable of these is not known domino by domino; leave one out, or "
            "search such rows with `optimize`"
        )


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


def _rules_of(scene: Scene, rtol: float, window: int) -> NDArray[np.record]:
    """(1,) RULES of a scene."""
    array = np.zeros(1, kernels.RULES)
    rules = array[0]
    rules.friction, rules.gravity = scene.physics.friction, scene.physics.gravity
    rules.push, rules.rtol = scene.physics.push, rtol
    rules.length = scene.length or 0.0
    rules.gap_low, rules.gap_high = scene.spacing
    rules.thick_low, rules.thick_high = scene.thickness
    rules.largest_change = scene.largest_change or 0.0
    rules.grows = scene.growth is not None
    rules.growth_low, rules.growth_high = scene.growth or (1.0, 1.0)
    rules.unit, rules.in_heights = scene.height, scene.in_heights
    rules.has_stock = scene.stock is not None
    rules.pays = float(scene.criterion.rewards_speed)
    rules.score_is_speed = scene.criterion.is_mean_speed and scene.limits is None
    rules.window = window
    return array
