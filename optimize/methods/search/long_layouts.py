"""Long layouts from short ones: two ends and a plateau.

Far from both ends a good layout is the same for thousands of dominoes, and its ends are those of a
layout of some hundred. So a short layout of the same scene is searched, and its middle is stretched
step by step to the count of the scene. At each step a local search refines the ends, the plateau
and the transitions between them.

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

from domino_env.core.types import Floats, Ints, unique_points
from domino_env.physics.steady import steady_wave
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import grid
from optimize.evaluator import Evaluator
from optimize.methods.gradient.local_search import CoarseToFine, run_local_searches
from optimize.methods.registry import Method
from optimize.methods.starts import interpolation
from optimize.problem import Problem

LONG_COUNT = 512  # dominoes from which on a layout is long
# dominoes of the layout that is searched; ratio of each count to the one before
SHORT_COUNT, RATIO = 160, 4
LAST_RATIO = 1.5  # least ratio of the count of the scene to that of the last shorter layout
SHORT_EVALUATIONS = 600  # evaluations of the shortest layout
# gradients of the first stretched layout, and of far longer ones
MAX_GRADIENTS, MIN_GRADIENTS = 60, 12
WHOLE_GRADIENTS = 200  # gradients of the layout of the scene
BEAM = 2  # layouts that are stretched further
PERIODS = (1, 4, 16)  # places of the middle that the plateau may repeat
ENDS = tuple(product((0, 20, 40), (0, 40)))  # places of both ends that a steady plateau keeps
TRANSITION = 40  # places of the transition to the steady plateau
VERSIONS = BEAM * len(PERIODS) + len(ENDS)  # largest number of stretched layouts of these kinds
# numbers of gaps and thicknesses in the grids of steady waves, each closer around the best
GRIDS = ((64, 12), (9, 5), (9, 5), (9, 5))
# places of each end with one variable each; then the distance from the end grows by the ratio
END_PLACES, DISTANCE_RATIO = 60, 1.5


def is_long(scene: Scene) -> bool:
    """Return True if a scene has many dominoes and its layouts resemble shorter ones.

    They do if the score rewards speed and the rules are the same for every domino and any count: no
    stock, no growing heights, no uneven ground, no length with values from a list.
    """
    has_list = scene.spacing_values is not None or scene.thickness_values is not None
    is_homogeneous = scene.is_homogeneous and not (has_list and scene.length is not None)
    return scene.count >= LONG_COUNT and scene.criterion.rewards_speed and is_homogeneous


def search_stretched(
    evaluator: Evaluator, rng: np.random.Generator, search: Method
) -> tuple[float, Floats]:
    """Search a short layout of the scene, and stretch and refine it step by step.

    Parameters
    ----------
    evaluator
        Evaluator of the scene; it counts shorter layouts in proportion to their dominoes.
    rng
        Random generator of the search.
    search
        Method that searches the short layout within limits.

    Returns
    -------
    score : float
        Best score.
    design : ndarray
        (n,) design vector of the best layout.

    Raises
    ------
    BudgetSpent
        If a limit is reached.
    """
    scene = evaluator.problem.scene
    plateau = fastest_steady(scene)
    shorter = Problem(_shorten(scene, SHORT_COUNT))
    with evaluator.borrow(shorter, SHORT_EVALUATIONS) as short_evaluator:
        search(short_evaluator, rng)
    designs = [short_evaluator.best]
    _score_stretched(evaluator, short_evaluator.best)  # a result if a limit ends the search below
    count = RATIO * SHORT_COUNT
    while LAST_RATIO * count < scene.count:
        shorter = Problem(_shorten(scene, count))
        gradients = max(MIN_GRADIENTS, MAX_GRADIENTS * RATIO * SHORT_COUNT // count)
        searches: list[StretchedSearch] = []  # remains empty if a limit ends the context at once
        with evaluator.borrow(shorter, BEAM * gradients + VERSIONS) as short_evaluator:
            searches = _stretch(short_evaluator, designs, plateau)
            run_local_searches(short_evaluator, searches, gradients)
        designs = [local.design for local in searches] or [short_evaluator.best]
        count *= RATIO
    searches = _stretch(evaluator, designs, plateau)
    run_local_searches(evaluator, searches, MIN_GRADIENTS)
    best = max(searches, key=lambda local: local.score)
    run_local_searches(evaluator, [best], WHOLE_GRADIENTS)
    return best.score, best.design


def fastest_steady(scene: Scene) -> tuple[float, float] | None:
    """Find the uniform layout with the fastest steady wave.

    Returns
    -------
    tuple or None
        Gap and thickness [m]; None if the scene has a length, which decides them, or if no uniform
        layout has a steady wave.

    Notes
    -----
    The push has no effect on a steady wave, which may be faster than any that the push can start.
    """
    if scene.length is not None:
        return None
    scale = scene.height if scene.in_heights else 1.0
    low, high = np.array([scene.spacing, scene.thickness]).T * scale
    slope = 0.0 if scene.ground is None else math.radians(scene.ground.slope or 0.0)
    best, centre, room = 0.0, 0.5 * (low + high), 0.5 * (high - low)
    for sizes in GRIDS:
        axes = [c + np.linspace(-r, r, n) for c, r, n in zip(centre, room, sizes, strict=True)]
        points = unique_points(np.clip(grid(axes), low, high))
        gaps, thickness = points.T
        speeds = steady_wave(
            gaps + thickness, thickness, scene.height, scene.physics,
            density=scene.density, slope=slope, rtol=1e-8,
        ).speed  # fmt: skip
        if speeds.max() > best:
            best, centre = speeds.max(), points[speeds.argmax()]
        room = 2.0 * room / sizes
    return (float(centre[0]), float(centre[1])) if best > 0.0 else None


def _score_stretched(evaluator: Evaluator, short_design: Floats) -> None:
    """Evaluate a shorter layout that is stretched to the count of the scene."""
    problem = evaluator.problem
    pairs = problem.scene.count - 1
    longer = repeat_middle(short_design.reshape(problem.dimension // pairs, -1), pairs, 1)
    evaluator.evaluate(problem.project(longer.reshape(1, -1)))


def _shorten(scene: Scene, count: int) -> Scene:
    """Return the scene with `count` dominoes, and with its length in proportion."""
    length = None if scene.length is None else scene.length * ((count - 1) / (scene.count - 1))
    return scene.replace(name=f"{scene.name[:80]}, {count} dominoes", count=count, length=length)


def _stretch(
    evaluator: Evaluator, short_designs: Sequence[Floats], plateau: tuple[float, float] | None
) -> list[StretchedSearch]:
    """Return local searches that begin at the best stretched versions of shorter layouts."""
    problem = evaluator.problem
    pairs = problem.scene.count - 1
    parts = problem.dimension // pairs
    starts = []
    for short_design in short_designs:
        design = short_design.reshape(parts, -1)
        starts.append([repeat_middle(design, pairs, period) for period in PERIODS])
    if len(short_designs) < BEAM and plateau is not None:  # the first stretch
        flat = problem.design(problem.scene.layout(*plateau)).reshape(parts, -1)
        starts.append([insert_plateau(starts[0][0], flat, head, tail) for head, tail in ENDS])
    searches = []
    for versions in starts:
        designs = problem.project(np.array([version.ravel() for version in versions]))
        scores = evaluator.evaluate(designs).score
        i = int(np.argmax(scores))
        local = StretchedSearch(designs[i], parts, problem.projection)
        local.score = float(scores[i])
        searches.append(local)
    return searches


def repeat_middle(design: Floats, pairs: int, period: int) -> Floats:
    """Stretch a layout by repeating some places of its middle.

    Parameters
    ----------
    design
        (parts, m) design, see `perturbations`; m is at least `period`.
    pairs
        Number of places of the stretched layout.
    period
        Number of places that are repeated.

    Returns
    -------
    ndarray
        (parts, pairs) stretched design.
    """
    middle = (design.shape[1] + period) // 2
    tail = design.shape[1] - middle
    places = np.arange(pairs)
    source = middle - period + (places - middle) % period
    source = np.where(places < middle, places, source)
    source[pairs - tail :] = np.arange(middle, design.shape[1])
    return design[:, source]


def insert_plateau(design: Floats, flat: Floats, head: int, tail: int) -> Floats:
    """Replace the middle of a layout by a plateau, with linear transitions.

    Parameters
    ----------
    design
        (parts, pairs) design, see `perturbations`.
    flat
        (parts, pairs) design of the plateau.
    head, tail
        Numbers of places at the start and at the end that stay as they are; with a tail of 0, the
        plateau extends to the end.

    Returns
    -------
    ndarray
        (parts, pairs) design with the plateau.
    """
    places = np.arange(design.shape[1])
    weight = np.clip((places - head) / TRANSITION, 0.0, 1.0)
    if tail:
        weight = np.minimum(weight, np.clip((places[::-1] - tail) / TRANSITION, 0.0, 1.0))
    return design + weight * (flat - design)


class StretchedSearch(CoarseToFine):
    """Local search of the ends, the plateau and the transitions, then of the whole design vector.

    Parameters
    ----------
    start
        (n,) design vector to begin at.
    parts
        Number of free quantities among gaps, thicknesses and growths.
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

    def _coarsen(self, matrix: Floats, design: Floats) -> Floats:
        return np.asarray(design[self._knots])


def _places(pairs: int) -> Ints:
    """Return every place near the ends, and ever fewer places towards the middle."""
    offsets = list(range(min(END_PLACES, pairs // 2)))
    while DISTANCE_RATIO * offsets[-1] < 0.5 * pairs:
        offsets.append(int(DISTANCE_RATIO * offsets[-1]))
    return np.unique([*offsets, *(pairs - 1 - offset for offset in offsets)])
