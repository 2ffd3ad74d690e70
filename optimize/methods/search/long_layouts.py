"""Long layouts from short ones: head, plateau, tail.

Far from both ends a good layout is the same for thousands of dominoes, and its ends are those of a
layout of some hundred. So a short layout of the same scene is searched and stretched in its middle,
step by step to the count of the scene. At each step a local search refines the ends, the plateau
and what lies between.

References
----------
McKenzie, L. W. (1976). Turnpike theory. Econometrica 44, 841-865: why the best path over a long
time stays at the best steady one, but for its ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from scipy.sparse import csr_array

from domino_env.core.types import Floats, Ints
from domino_env.physics.steady import steady_wave
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import grid
from optimize.evaluator import Evaluator
from optimize.methods.gradient.local_search import CoarseToFine, run_local_searches
from optimize.methods.starts import interpolation
from optimize.problem import Problem

LONG = 512  # dominoes from which on a layout is long
SHORTEST, TIMES = 160, 4  # dominoes of the layout that is searched; ratio of the next count to it
WELL_BELOW = 1.5  # least ratio of the count of the scene to that of the layout stretched last
SEARCHED = 600  # evaluations of the shortest
MOST, LEAST = 60, 12  # gradients of a layout four times as long, and of far longer ones
WHOLE = 200  # gradients of the whole layout
KEPT = 2  # layouts that are stretched further
PERIODS = (1, 4, 16)  # places of the middle that the plateau may repeat
KEEPS = tuple(product((0, 20, 40), (0, 40)))  # places of both ends that another plateau leaves
RAMP = 40  # places of the transition to it
STRETCHED = KEPT * len(PERIODS) + len(KEEPS)  # layouts that are stretched in all these ways
GRIDS = ((64, 12), (9, 5), (9, 5), (9, 5))  # gaps and thicknesses of steady waves, ever closer
ENDS, GROWTH = 60, 1.5  # places of each end that are free one by one; then their distance grows

Search = Callable[[Evaluator, np.random.Generator], None]


def is_long(scene: Scene) -> bool:
    """Return whether long layouts of the scene resemble shorter ones.

    They do where speed counts and the rules are the same for every domino, whatever their number:
    no stock, no growing heights, no uneven ground, no length with gaps from a list.
    """
    listed = scene.spacing_values is not None or scene.thickness_values is not None
    same = scene.is_homogeneous and not (listed and scene.length is not None)
    return scene.count >= LONG and scene.criterion.rewards_speed and same


def best_stretched(
    evaluator: Evaluator, rng: np.random.Generator, search: Search
) -> tuple[float, Floats]:
    """Search a short layout of the scene, stretch it, and refine it on the way.

    Parameters
    ----------
    evaluator
        Evaluator of the scene; shorter layouts cost less.
    rng
        Random generator of the search.
    search
        Method that searches the short layout within limits.

    Returns
    -------
    score : float
        Best score.
    design : ndarray
        (n,) its design vector.

    Raises
    ------
    BudgetSpent
        Where fewer evaluations remain.
    """
    scene = evaluator.problem.scene
    plateau = best_steady(scene)
    shorter = Problem(_shortened(scene, SHORTEST))
    with evaluator.borrow(shorter, SEARCHED) as borrowed:
        search(borrowed, rng)
    designs = [borrowed.best]
    _score_stretched(evaluator, borrowed.best)  # a result, should time run out on the way
    for count in _counts(scene.count):
        shorter = Problem(_shortened(scene, count))
        gradients = max(LEAST, MOST * TIMES * SHORTEST // count)
        arms: list[Stretched] = []
        with evaluator.borrow(shorter, KEPT * gradients + STRETCHED) as borrowed:
            arms = _stretched(borrowed, designs, plateau)
            run_local_searches(borrowed, arms, gradients)
        designs = [arm.design for arm in arms] or [borrowed.best]
    arms = _stretched(evaluator, designs, plateau)
    run_local_searches(evaluator, arms, LEAST)
    best = max(arms, key=lambda arm: arm.score)
    run_local_searches(evaluator, [best], WHOLE)
    return best.score, best.design


def best_steady(scene: Scene) -> tuple[float, float] | None:
    """Find the uniform layout with the fastest steady wave, whatever its start.

    Returns
    -------
    tuple or None
        Gap and thickness [m]; None where a length leaves no choice, or no uniform layout has a
        steady wave.

    Notes
    -----
    The push has no effect on a steady wave, which may be faster than any that the push can start.
    """
    if scene.length is not None:
        return None
    scale = scene.height if scene.in_heights else 1.0
    low, high = np.array([scene.spacing, scene.thickness]).T * scale
    slope = 0.0 if scene.ground is None else math.radians(scene.ground.slope or 0.0)
    best, place, room = 0.0, 0.5 * (low + high), 0.5 * (high - low)
    for sizes in GRIDS:
        axes = [
            np.unique(np.clip(middle + np.linspace(-half, half, number), least, largest))
            for middle, half, number, least, largest in zip(
                place, room, sizes, low, high, strict=True
            )
        ]
        points = grid(axes)
        gaps, thickness = points.T
        speeds = steady_wave(
            gaps + thickness, thickness, scene.height, scene.physics,
            density=scene.density, slope=slope, rtol=1e-8,
        ).speed  # fmt: skip
        if speeds.max() > best:
            best, place = speeds.max(), points[speeds.argmax()]
        room = 2.0 * room / sizes
    return (float(place[0]), float(place[1])) if best > 0.0 else None


def _score_stretched(evaluator: Evaluator, short: Floats) -> None:
    """Evaluate a shorter layout that is stretched to the count of the scene."""
    problem = evaluator.problem
    pairs = problem.scene.count - 1
    longer = repeated(short.reshape(problem.dimension // pairs, -1), pairs, 1)
    evaluator.evaluate(problem.project(longer.reshape(1, -1)))


def _counts(count: int) -> list[int]:
    """Return the numbers of dominoes on the way to `count`, the last of them well below it."""
    counts = [TIMES * SHORTEST]
    while WELL_BELOW * counts[-1] < count:
        counts.append(TIMES * counts[-1])
    return counts[:-1]


def _shortened(scene: Scene, count: int) -> Scene:
    """Return the scene with fewer dominoes, and a length in proportion."""
    length = scene.length
    if length is not None:
        length *= (count - 1) / (scene.count - 1)
    return scene.replace(name=f"{scene.name[:80]}, {count} dominoes", count=count, length=length)


def _stretched(
    evaluator: Evaluator, shorts: Sequence[Floats], plateau: tuple[float, float] | None
) -> list[Stretched]:
    """Begin local searches at the best stretched versions of layouts of fewer dominoes."""
    problem = evaluator.problem
    pairs = problem.scene.count - 1
    parts = problem.dimension // pairs
    begins = []
    for short in shorts:
        columns = short.reshape(parts, -1)
        begins.append([repeated(columns, pairs, period) for period in PERIODS])
    if len(shorts) < KEPT and plateau is not None:
        flat = problem.design(problem.scene.layout(*plateau)).reshape(parts, -1)
        begins.append([with_plateau(begins[0][0], flat, head, tail) for head, tail in KEEPS])
    arms = []
    for versions in begins:
        designs = problem.project(np.array([version.ravel() for version in versions]))
        scores = evaluator.evaluate(designs).score
        i = int(np.argmax(scores))
        arm = Stretched(designs[i], parts, problem.project if problem.coupled else None)
        arm.score = float(scores[i])
        arms.append(arm)
    return arms


def repeated(columns: Floats, pairs: int, period: int) -> Floats:
    """Stretch a layout by repeating some places of its middle.

    Parameters
    ----------
    columns
        (parts, m) design, m at least `period`.
    pairs
        Number of places of the stretched layout.
    period
        Number of places that are repeated.

    Returns
    -------
    ndarray
        (parts, pairs) design.
    """
    middle = (columns.shape[1] + period) // 2
    tail = columns.shape[1] - middle
    places = np.arange(pairs)
    source = middle - period + (places - middle) % period
    source = np.where(places < middle, places, source)
    source[pairs - tail :] = np.arange(middle, columns.shape[1])
    return columns[:, source]


def with_plateau(columns: Floats, flat: Floats, head: int, tail: int) -> Floats:
    """Replace the middle of a design by a plateau, with linear transitions.

    Parameters
    ----------
    columns
        (parts, pairs) design.
    flat
        (parts, pairs) design of the plateau.
    head, tail
        Numbers of places at both ends that stay as they are.

    Returns
    -------
    ndarray
        (parts, pairs) design.
    """
    places = np.arange(columns.shape[1])
    weight = np.clip((places - head) / RAMP, 0.0, 1.0)
    if tail:
        weight = np.minimum(weight, np.clip((places[::-1] - tail) / RAMP, 0.0, 1.0))
    return columns + weight * (flat - columns)


class Stretched(CoarseToFine):
    """A local search of the ends, the plateau and the transitions, then of the whole design.

    Parameters
    ----------
    start
        (n,) design vector to begin at.
    parts
        Number of free quantities among gaps, thicknesses and heights.
    project
        See `CoarseToFine`.
    """

    def __init__(
        self, start: Floats, parts: int, project: Callable[[Floats], Floats] | None
    ) -> None:
        pairs = len(start) // parts
        places = _places(pairs)
        self._knots = (np.arange(parts)[:, None] * pairs + places).ravel()
        super().__init__(start, [csr_array(interpolation(places, pairs, parts))], project)

    def _coarse(self, matrix: Floats, design: Floats) -> Floats:
        return np.asarray(design[self._knots])


def _places(pairs: int) -> Ints:
    """Return every place of the ends, and ever fewer towards the middle."""
    offsets = list(range(min(ENDS, pairs // 2)))
    while GROWTH * offsets[-1] < 0.5 * pairs:
        offsets.append(int(GROWTH * offsets[-1]))
    return np.unique([*offsets, *(pairs - 1 - offset for offset in offsets)])
