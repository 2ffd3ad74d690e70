"""Long layouts from short ones: two ends and a plateau.

Far from both ends a good layout is the same for thousands of dominoes, and its ends are those of a
layout of some hundred. So a short layout of the same scene is searched, and its middle is repeated
step by step up to the count of the scene. At each step a local search refines the ends, the plateau
and the transitions between them.

References
----------
McKenzie, L. W. (1976). Turnpike theory. Econometrica 44, 841-865: why the best path over a long
time stays at the best steady one, but for its ends.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from domino_env.core.types import Floats, Ints
from domino_env.scenes.scene import Scene
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
MAX_GRADIENTS, MIN_GRADIENTS = 160, 12
# gradients of the layout of the scene; it is done when so many in a row gain relatively less
WHOLE_GRADIENTS, ROUND_GRADIENTS, LEAST_GAIN = 212, 8, 1e-6
PERIODS = (1, 4, 16)  # places of the middle that the plateau may repeat
# places of each end with one variable each; then the distance from the end grows by the ratio
END_PLACES, DISTANCE_RATIO = 60, 1.5


def is_long(scene: Scene) -> bool:
    """Return True if a scene has many dominoes and its layouts resemble shorter ones.

    They do if a faster wave scores more, and the rules are the same for every domino and any count:
    no stock, no growing heights, no uneven ground.
    """
    is_faster_better = scene.criterion.rewards_steps and not scene.criterion.needs_arrivals
    return scene.count >= LONG_COUNT and scene.is_homogeneous and is_faster_better


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
    shorter = Problem(_shorten(scene, SHORT_COUNT))
    with evaluator.borrow(shorter, SHORT_EVALUATIONS) as short_evaluator:
        search(short_evaluator, rng)
    design = short_evaluator.best
    _score_stretched(evaluator, design)  # a result if a limit ends the search below
    count = RATIO * SHORT_COUNT
    while LAST_RATIO * count < scene.count:
        shorter = Problem(_shorten(scene, count))
        gradients = max(MIN_GRADIENTS, MAX_GRADIENTS * RATIO * SHORT_COUNT // count)
        with evaluator.borrow(shorter, len(PERIODS) + gradients) as short_evaluator:
            run_local_searches(short_evaluator, [_stretch(short_evaluator, design)], gradients)
        design = short_evaluator.best
        count *= RATIO
    local = _stretch(evaluator, design)
    for _ in range(0, WHOLE_GRADIENTS, ROUND_GRADIENTS):
        before = local.score
        run_local_searches(evaluator, [local], ROUND_GRADIENTS)
        if local.done or local.score - before <= LEAST_GAIN * abs(local.score):
            break
    return local.score, local.design


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


def _stretch(evaluator: Evaluator, short_design: Floats) -> StretchedSearch:
    """Return a local search that begins at the best stretched version of a shorter layout."""
    problem = evaluator.problem
    pairs = problem.scene.count - 1
    parts = problem.dimension // pairs
    versions = [repeat_middle(short_design.reshape(parts, -1), pairs, n).ravel() for n in PERIODS]
    designs = problem.project(np.array(versions))
    scores = evaluator.evaluate(designs).score
    i = int(np.argmax(scores))
    local = StretchedSearch(designs[i], parts, problem.projection)
    local.score = float(scores[i])
    return local


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
