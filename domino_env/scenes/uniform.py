"""The uniform baseline of a scene: the best layout of one gap and one thickness."""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import NamedTuple

import numpy as np

from domino_env.core.files import one_line
from domino_env.core.progress import notice
from domino_env.core.results import dataclass_repr
from domino_env.core.threads import allowed_threads
from domino_env.core.types import Floats, unique_points
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.rigid.simulation import StoppedError
from domino_env.scenes.specification import Specification
from domino_env.scenes.uniform_layouts import UniformLayouts

Scorer = Callable[[Floats, float], Floats]
"""Function from points (P, 2) and the size of their cells [m] to scores (P,)."""

SHIPPED = "uniform.json"
LONG_COUNT = 1000  # dominoes from which on the search takes seconds, and is announced
MAX_GRID = 1_100_000  # dominoes of a first grid up to which whole layouts are simulated
COARSE_CHANGE, FINE_CHANGE = 1e-8, 1e-12  # relative change of the velocity that counts as steady
FINE_CELL = 1e-5  # [m] cells from which on `FINE_CHANGE` is used
SAME_SCORE = 1e-9  # relative difference of scores by the first dominoes and by all


class Fineness(NamedTuple):
    """Settings of a search by grids: `line` and `plane` points per axis if one or both are free.

    Later grids have `around` points per axis about each of the best `keep` points (first, later
    grids), in cells that shrink by the factor `shrink` until they are at most `finest` [m].
    """

    line: int
    plane: int
    keep: tuple[int, int]
    around: int
    shrink: float
    finest: float
    rtol: float


FULL = Fineness(1024, 96, (6, 6), 9, 4.0, 1e-9, 1e-11)
BY_PREFIX = FULL._replace(plane=48, keep=(6, 2))
RANDOM = Fineness(128, 24, (6, 6), 9, 4.0, 1e-7, 1e-8)  # as a mean over draws is noisy
QUICK = Fineness(96, 17, (2, 2), 5, 2.0, 1e-6, 1e-7)  # the score errs by the square of the gap
FREE_STANDING = Fineness(10, 5, (1, 1), 3, 2.0, 3e-4, 1e-3)  # scores are known to some 3e-4


@dataclass(frozen=True, eq=False)
class UniformBaseline:
    """Best uniform layout of a scene, with which every design is compared.

    Attributes
    ----------
    layout
        The layout.
    wave
        Its wave.
    score
        Its score.
    """

    layout: Layout
    wave: Wave
    score: float

    __repr__ = dataclass_repr


def format_gain(value: float, digits: int = 2) -> str:
    """Format a gain as "3.18% over", "0.29% below" or "level with"."""
    if abs(value) < 0.5 * 0.1 ** (digits + 2):
        return "level with"
    return f"{abs(value):.{digits}%} {'over' if value >= 0.0 else 'below'}"


def gain(score: float, reference: float) -> float | None:
    """Return the gain of a score over a reference, such as that of the uniform baseline.

    Parameters
    ----------
    score, reference
        Scores of two layouts in one scene.

    Returns
    -------
    float or None
        score / reference - 1; None if one of the waves stops, as its score is no speed.
    """
    return score / reference - 1.0 if score > 0.0 and reference > 0.0 else None


def best_uniform(
    scene: Specification, known: tuple[float, float] | None = None, seconds: float | None = None
) -> tuple[Layout, float | None]:
    """Return the best layout of one pitch and one thickness within the scene's rules.

    The first domino has the scene's thickness. The dominoes of a stock stand in the order given at
    one pitch, or at one gap if the rules allow no such pitch. If they are drawn in random order,
    they stand at one gap in the order of drawing, and the score is the mean over the orders of
    seeds 0 to 63; the layout has the first of these orders. If heights grow, gaps have one ratio to
    the heights, and heights to those before. If lists of allowed values do not meet a length, the
    baseline is that without the lists.

    Baselines of the shipped scenes come with the package.

    Parameters
    ----------
    scene
        The scene.
    known
        Result of `best_point`; None to find it.
    seconds
        Time after which the search on a floor ends, with the best so far [s]; at least one layout
        is simulated. None for no limit.

    Returns
    -------
    layout : Layout
        The layout.
    score : float or None
        Its score if it is a mean over orders, or known from the search on a floor; None if it has
        to be computed.

    Raises
    ------
    ValueError
        If the rules allow no uniform layout.
    """
    layouts, score = uniform_layouts(scene), None
    point = known or _shipped_points().get(stamp(scene))
    if point is None and scene.count >= LONG_COUNT:
        notice(f"finding the uniform baseline of '{one_line(scene.name, 40)}' ...")
    if point is not None or scene.floor_friction is None:
        best = best_point(scene) if point is None else np.array(point)
        if scene.hand:
            score = float(layouts.scores(best[None], FULL.rtol)[0])
    else:
        best, score = _best_free_standing(layouts, math.inf if seconds is None else seconds)
    return layouts.layout(best), score


def best_point(scene: Specification, *, quick: bool = False) -> Floats:
    """Return the two numbers (2,) of the uniform baseline, as of `UniformLayouts`.

    Parameters
    ----------
    scene
        The scene.
    quick
        Simulate some hundred layouts instead of thousands: the gap has an error of 1 µm, and the
        lower of two peaks of nearly the same height may be returned.

    Raises
    ------
    ValueError
        If the rules allow no uniform layout.

    Notes
    -----
    The speed has several peaks, and steps at the edge of stopping waves. Therefore a grid over both
    numbers is followed by finer grids around the best points. If no layout is a success, the result
    is the best of the failures. Long layouts are scored by their first dominoes, and the
    best of them is simulated whole; if its score then differs, all are simulated whole.

    Free-standing layouts take long to simulate: the first grid is that of the analytic model, and
    its best places, some distance apart, are the first that are simulated on the floor. The gap
    then has an error of about 0.3 mm, the speed, as the maximum is flat, of about 3e-4.
    """
    layouts = uniform_layouts(scene)
    if scene.floor_friction is not None:
        return _best_free_standing(layouts, math.inf)[0]
    is_random = scene.criterion.simulates_anew or scene.hand > 0
    fineness = QUICK if quick else RANDOM if is_random else FULL
    points = grid(_axes(layouts, fineness))
    if layouts.steady and not quick and scene.count * len(points) > MAX_GRID:

        def by_prefix(points: Floats, cell: float) -> Floats:
            change = COARSE_CHANGE if cell > FINE_CELL else FINE_CHANGE
            return layouts.scores_by_prefix(points, change)

        point = _search(layouts, BY_PREFIX, by_prefix)
        extended = by_prefix(point[None], 0.0)[0]
        whole = layouts.scores(point[None], FULL.rtol)[0]
        if abs(extended - whole) <= SAME_SCORE * abs(whole):
            return point
    return _search(layouts, fineness, lambda points, _: layouts.scores(points, fineness.rtol))


def uniform_layouts(scene: Specification) -> UniformLayouts:
    """Return the uniform layouts within the rules; if there are none, those without the lists."""
    try:
        return UniformLayouts(scene)
    except ValueError:
        return UniformLayouts(scene.replace(spacing_values=None, thickness_values=None))


def _best_free_standing(layouts: UniformLayouts, seconds: float) -> tuple[Floats, float]:
    """Return the best point (2,) on a floor and its score; after `seconds`, the best so far."""
    began, evaluated = time.perf_counter(), list[tuple[float, Floats]]()

    def is_late() -> bool:
        return bool(evaluated) and time.perf_counter() > began + seconds

    def score(points: Floats, _: float) -> Floats:
        for piece in np.array_split(points, -(-len(points) // allowed_threads())):
            scores = layouts.scores(piece, FREE_STANDING.rtol, is_late)
            evaluated.extend(zip(scores.tolist(), piece, strict=True))
        return np.array([value for value, _ in evaluated[-len(points) :]])

    analytic = UniformLayouts(layouts.scene.replace(floor_friction=None))
    points = grid(_axes(analytic, FULL))
    cell = (layouts.high - layouts.low) / FREE_STANDING.line
    chosen = _separate_points(points, analytic.scores(points, FULL.rtol), cell, FREE_STANDING.line)
    try:
        point = _search(layouts, FREE_STANDING, score, points[chosen])
        return point, next(value for value, at in evaluated if np.array_equal(at, point))
    except StoppedError:
        notice("the uniform baseline on the floor is approximate: its search reached its limit")
        best, point = max(evaluated, key=lambda entry: entry[0])
        return point, best


def _axes(layouts: UniformLayouts, fineness: Fineness) -> list[Floats]:
    """Return the values of the first grid for each of the two numbers."""
    one_is_fixed = float(np.min(layouts.high - layouts.low)) == 0.0
    return layouts.axes((fineness.line if one_is_fixed else fineness.plane,) * 2)


def grid(axes: list[Floats]) -> Floats:
    """Return all points (P, 2) of a grid."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _search(
    layouts: UniformLayouts, fineness: Fineness, score: Scorer, start: Floats | None = None
) -> Floats:
    """Find the point (2,) of the highest score by finer and finer grids around the best points.

    The first points are `start` (P, 2), or a grid.
    """
    axes = _axes(layouts, fineness)
    # distance of the first points; an axis whose values are on a list is not refined
    cell = np.array([
        axis[1] - axis[0] if len(axis) > 1 and values is None else 0.0
        for axis, values in zip(axes, layouts.allowed, strict=True)
    ])  # fmt: skip
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
    if len(equal):  # the middle of a plateau, as beyond its edge the wave stops
        return np.asarray(first[equal[len(equal) // 2]])
    return np.asarray(points[int(np.argmax(scores))])


def _separate_points(points: Floats, scores: Floats, distance: Floats, keep: int) -> list[int]:
    """Return the indices of the `keep` best points that are not within `distance` of a better."""
    chosen: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        gap = np.abs(points[chosen] - points[i])
        if not np.any(np.all(gap <= distance, axis=1)):
            chosen.append(int(i))
        if len(chosen) == keep:
            break
    return chosen


def best_uniform_on(scene: Specification, baseline: Layout, floor: float | None) -> Layout:
    """Return the fastest uniform layout on a floor.

    Parameters
    ----------
    scene
        Scene whose rules the layout keeps.
    baseline
        Its uniform baseline with fixed pivots, or the first dominoes of it.
    floor
        Friction of the floor; None for fixed pivots.

    Returns
    -------
    Layout
        As many dominoes as the baseline has; the baseline itself if the scene scores no speed, if
        it has a length that fewer dominoes do not meet, and if pieces are drawn in random order.
    """
    whole = baseline.count == scene.count
    no_other = scene.hand or scene.criterion.unit != "m/s" or (scene.length and not whole)
    if no_other or (floor is None and whole):
        return baseline
    return best_uniform(scene.replace(
        count=baseline.count, floor_friction=floor, objective="mean_speed", settings=None,
        limits=None, placement_deviation=0.0, placement_draws=0,
    ))[0]  # fmt: skip


def stamp(scene: Specification) -> str:
    """Return a digest of all fields on which the baseline may depend: all but name and title."""
    tables = scene.document() | {"name": None, "title": None}
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()


@cache
def _shipped_points() -> dict[str, tuple[float, float]]:
    """Return the best points of the shipped scenes, by their digests."""
    file = resources.files("domino_env.scenes") / "shipped" / SHIPPED
    entries = json.loads(file.read_text("utf-8")).values()
    return {entry["stamp"]: entry["point"] for entry in entries}
