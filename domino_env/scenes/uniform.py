"""The uniform baseline of a scene: the best layout with equal gaps and thicknesses."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from domino_env.core.checks import require
from domino_env.core.files import one_line
from domino_env.core.progress import notice
from domino_env.core.results import dataclass_repr
from domino_env.core.threads import allowed_threads
from domino_env.core.types import Floats, unique_points
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Wave
from domino_env.rigid.simulation import StoppedError
from domino_env.scenes.uniform_layouts import UniformLayouts

Scorer = Callable[[Floats, float], Floats]
"""Function from points (P, 2) and the size of their cells [m] to scores (P,)."""

POINTS_FILE = "uniform.json"
LONG_COUNT = 1000  # [dominoes] from this number on, a search takes seconds and is announced
MAX_GRID = 1_100_000  # [dominoes] in a first grid; of a larger one, prefixes are simulated
# `change` of `UniformLayouts.scores_by_prefix`, for cells above and up to `FINE_CELL`
COARSE_CHANGE, FINE_CHANGE = 1e-8, 1e-12
FINE_CELL = 1e-5  # [m]
SAME_SCORE = 1e-9  # largest relative difference of the score by a prefix from that of the layout


class Fineness(NamedTuple):
    """Settings of a search by finer and finer grids."""

    line: int  # points of the first grid if one number is free
    plane: int  # points of the first grid per axis if both numbers are free
    keep: tuple[int, int]  # best points of the first and of each later grid that are refined
    around: int  # points per axis of a finer grid about one of these
    shrink: float  # ratio of the cells of two successive grids
    finest: float  # largest cell of the last grid [m]
    rtol: float  # relative tolerance of the arrival times


FULL = Fineness(1024, 96, (6, 6), 9, 4.0, 1e-9, 1e-11)
BY_PREFIX = FULL._replace(plane=48, keep=(6, 2))  # for long layouts, scored by prefixes
# scores over random draws are noisy, so that finer grids gain nothing
RANDOM = Fineness(128, 24, (6, 6), 9, 4.0, 1e-7, 1e-8)
# the error of the score is of second order in that of the gap
QUICK = Fineness(96, 17, (2, 2), 5, 2.0, 1e-6, 1e-7)
QUICK_RANDOM = Fineness(48, 12, (2, 2), 5, 3.0, 3e-5, 1e-6)
# scores on a floor have errors of about 3e-4
FREE_STANDING = Fineness(10, 5, (1, 1), 3, 2.0, 3e-4, 1e-3)


@dataclass(frozen=True, eq=False)
class UniformBaseline:
    """Best uniform layout of a scene, with which every layout is compared.

    Attributes
    ----------
    layout
        The uniform layout.
    wave
        Wave of the layout with fixed pivots.
    score
        Score of the layout in the scene.
    """

    layout: Layout
    wave: Wave
    score: float

    __repr__ = dataclass_repr


@lru_cache(maxsize=32)  # baselines
def uniform_baseline(scene: Any, point: tuple[float, float] | None) -> UniformBaseline:
    """Return the best layout with one gap and one thickness within the scene's rules.

    The first domino has the thickness that the scene gives it. The dominoes of a stock stand in the
    order of its kinds, at one pitch, or at one gap if the rules allow no such pitch. If they are
    drawn in random order, they stand at one gap in that order, and the score is the mean over the
    orders of the seeds 0 to 63; the layout has the first of these orders. If heights grow, all gaps
    have the same ratio to the height of the domino before them, and all heights the same ratio to
    the height before.

    Parameters
    ----------
    scene
        The scene.
    point
        Result of `best_point`; None to search for it.

    Returns
    -------
    UniformBaseline
        The baseline; equal arguments have the same one.
    """
    layouts, score = UniformLayouts(scene), None
    if point is None and scene.count >= LONG_COUNT:
        notice(f"searching for the uniform baseline of '{one_line(scene.name, 40)}' ...")
    if point is None and scene.simulator.is_slow:
        best, score = _best_free_standing(layouts, math.inf)
    else:
        best = best_point(scene) if point is None else np.array(point)
    if scene.hand:
        score = float(layouts.scores(best[None], FULL.rtol)[0])
    layout = layouts.layout(best)
    wave = scene.simulate(layout)
    return UniformBaseline(layout, wave, scene.score(wave) if score is None else score)


def best_point(scene: Any, *, quick: bool = False, seconds: float | None = None) -> Floats:
    """Return the two numbers (2,) of the uniform baseline, a point of `UniformLayouts`.

    Parameters
    ----------
    scene
        The scene.
    quick
        Simulate some hundred layouts instead of thousands. The gap then has an error of 1 µm, and
        of two local maxima of nearly the same score the lower one may be returned.
    seconds
        Time limit of the search on a floor [s], which ends with the best layout so far; at least
        one layout is simulated. None for no limit.

    Returns
    -------
    NDArray
        (2,) gap and thickness of the best layout [m], or the numbers that replace them.

    Raises
    ------
    ValueError
        For a negative time limit.

    Notes
    -----
    The score has several local maxima, and it jumps where waves begin to stop. Therefore a grid
    over both numbers is followed by finer grids around the best points. If no layout is a success,
    the best of the failures is returned. Long layouts are scored by their first dominoes, and the
    best of them is simulated whole; if its score then differs, all are simulated whole.

    Free-standing layouts take long to simulate. Therefore the first grid is simulated with fixed
    pivots, and only its best points, some distance apart, are simulated on the floor. The error of
    the gap is then about 0.3 mm. The relative error of the speed is about 3e-4, as the maximum is
    flat.
    """
    require("seconds", seconds, 0.0, unit="s", optional=True)
    layouts = UniformLayouts(scene)
    if scene.simulator.is_slow:
        return _best_free_standing(layouts, math.inf if seconds is None else seconds)[0]
    is_random = scene.scoring.placement is not None or scene.hand > 0
    fineness = FULL if not is_random else RANDOM
    if quick:
        fineness = QUICK if not is_random else QUICK_RANDOM
    points = grid(_axes(layouts, fineness))
    if layouts.extendable and not quick and scene.count * len(points) > MAX_GRID:

        def by_prefix(points: Floats, cell: float) -> Floats:
            change = COARSE_CHANGE if cell > FINE_CELL else FINE_CHANGE
            return layouts.scores_by_prefix(points, change)

        point = _search(layouts, BY_PREFIX, by_prefix)
        extended = by_prefix(point[None], 0.0)[0]
        whole = layouts.scores(point[None], FULL.rtol)[0]
        if abs(extended - whole) <= SAME_SCORE * abs(whole):
            return point
    return _search(layouts, fineness, lambda points, _: layouts.scores(points, fineness.rtol))


def _best_free_standing(layouts: UniformLayouts, seconds: float) -> tuple[Floats, float]:
    """Return the best point (2,) on a floor and its score; after `seconds`, the best so far."""
    start, evaluated = time.perf_counter(), list[tuple[float, Floats]]()

    def is_late() -> bool:
        return bool(evaluated) and time.perf_counter() > start + seconds

    def score(points: Floats, _: float) -> Floats:
        # one layout for each thread at a time
        for piece in np.array_split(points, -(-len(points) // allowed_threads())):
            scores = layouts.scores(piece, FREE_STANDING.rtol, is_late)
            evaluated.extend(zip(scores.tolist(), piece, strict=True))
        return np.array([value for value, _ in evaluated[-len(points) :]])

    analytic = UniformLayouts(layouts.scene.on_pivots)
    points = grid(_axes(analytic, FULL))
    cell = (layouts.high - layouts.low) / FREE_STANDING.line
    chosen = _separate_points(points, analytic.scores(points, FULL.rtol), cell, FREE_STANDING.line)
    try:
        point = _search(layouts, FREE_STANDING, score, points[chosen])
        return point, next(value for value, other in evaluated if np.array_equal(other, point))
    except StoppedError:
        notice(f"the uniform baseline is approximate: its search ended after {seconds:g} s")
        best_score, point = max(evaluated, key=lambda entry: entry[0])
        return point, best_score


def _axes(layouts: UniformLayouts, fineness: Fineness) -> list[Floats]:
    """Return the values of the first grid for each of the two numbers."""
    one_is_fixed = float(np.min(layouts.high - layouts.low)) <= 0.0
    return layouts.axes((fineness.line if one_is_fixed else fineness.plane,) * 2)


def grid(axes: list[Floats]) -> Floats:
    """Return all points (P, 2) of a grid."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _search(
    layouts: UniformLayouts, fineness: Fineness, score: Scorer, start: Floats | None = None
) -> Floats:
    """Find the point (2,) with the highest score by finer and finer grids around the best points.

    The first points are `start` (P, 2); None for a grid.
    """
    axes = _axes(layouts, fineness)
    # distances of the first points on each axis; 0 for an axis that is fixed
    cell = np.array([axis[1] - axis[0] if len(axis) > 1 else 0.0 for axis in axes])
    first = points = grid(axes) if start is None else start
    first_scores = scores = score(points, np.inf)
    keep = fineness.keep[0]
    offsets = grid([np.linspace(-1.0, 1.0, fineness.around)] * 2)
    while cell.max() > fineness.finest:
        best = points[_separate_points(points, scores, 2.0 * cell, keep)]
        steps = unique_points(offsets * (cell > 0.0)) if cell.min() == 0.0 else offsets
        new_points = (best[:, None, :] + steps[None] * cell).reshape(-1, 2)
        # the best points are among the new ones, so they are not lost
        points = unique_points(np.clip(new_points, layouts.low, layouts.high))
        scores = score(points, float(cell.max()))
        cell, keep = cell / fineness.shrink, fineness.keep[1]
    equal = np.flatnonzero(first_scores >= scores.max())
    if len(equal):  # of equal scores the middle one, far from points at which waves stop
        return np.asarray(first[equal[len(equal) // 2]])
    return np.asarray(points[int(np.argmax(scores))])


def _separate_points(points: Floats, scores: Floats, distance: Floats, keep: int) -> list[int]:
    """Return the indices of the best points, at most `keep`.

    Points within `distance` (2,) of a better one are left out.
    """
    chosen: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        is_near = np.abs(points[chosen] - points[i]) <= distance
        if not np.any(np.all(is_near, axis=1)):
            chosen.append(int(i))
        if len(chosen) == keep:
            break
    return chosen


def best_uniform_on(scene: Any, baseline: Layout, floor: float | None) -> Layout:
    """Return the fastest uniform layout on a floor.

    Parameters
    ----------
    scene
        Scene whose rules the layout satisfies.
    baseline
        Uniform baseline of the scene, or its first dominoes.
    floor
        Coefficient of friction of the floor; None for fixed pivots.

    Returns
    -------
    Layout
        Layout of as many dominoes as the baseline has. It is the baseline itself for fixed
        pivots if no dominoes are missing, if the score is not a speed, if pieces are drawn in
        random order, and if the baseline is the first dominoes of a layout with a given length.
    """
    is_whole = baseline.count == scene.count
    keeps_baseline = scene.hand or not scene.criterion.is_mean_speed
    if keeps_baseline or (scene.length and not is_whole) or (floor is None and is_whole):
        return baseline
    return uniform_baseline(scene.replace(
        count=baseline.count, floor_friction=floor, objective="mean_speed", settings=None,
        limits=None, placement=None,
    ), None).layout  # fmt: skip


def stamp(document: dict[str, Any]) -> str:
    """Return a digest of the tables on which the baseline depends: all but name and title."""
    values = document["physics"]
    fields = {key: values[key] for key in values.keys() & set(Physics.__struct_fields__)}
    others = {key: values[key] for key in values.keys() - fields.keys()}  # the floor
    physics = Physics(**fields).distinctive | others
    tables = document | {"name": None, "title": None, "physics": physics}
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()


def stored_point(document: dict[str, Any]) -> tuple[float, float] | None:
    """Return `best_point` of a scene with the tables of a shipped one; None for another scene."""
    return _shipped_points().get(stamp(document))


@cache
def _shipped_points() -> dict[str, tuple[float, float]]:
    """Return the best points of the shipped scenes, by their digests."""
    file = resources.files("domino_env.scenes") / "shipped" / POINTS_FILE
    entries = json.loads(file.read_text("utf-8")).values()
    return {entry["stamp"]: tuple(entry["point"]) for entry in entries}
