"""The uniform baseline of a scene: the best layout of one gap and one thickness."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import NamedTuple

import numpy as np

from domino_env.core.files import one_line
from domino_env.core.progress import notice
from domino_env.core.results import brief
from domino_env.core.types import Floats, unique_points
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.rigid.simulation import simulate_standing
from domino_env.scenes.specification import Specification
from domino_env.scenes.uniform_layouts import UniformLayouts

Scorer = Callable[[Floats, float], Floats]
"""Scores (P,) of points (P, 2), as finely as cells of a size [m] ask for."""

SHIPPED = "uniform.json"
LONG = 1000  # dominoes from which on this takes long
LARGEST_GRID = 1_100_000  # dominoes of a first grid up to which whole layouts are simulated
NARROWER, WIDER = 0.6, 1.6  # of the best gap with fixed pivots: bounds on a floor
COARSELY, FINELY = 1e-8, 1e-12  # how steady the waves of the first dominoes are to be
CLOSE = 1e-5  # [m] from where on finely
SAME = 1e-9  # largest relative difference of a score by the first dominoes and that of the whole


class Fineness(NamedTuple):
    """Numbers of a search by grids: `line` and `plane` points per axis where one or both are free.

    Then around the best `keep` places (first, later) `around` points per axis, in cells that shrink
    by a factor until they are at most `finest` [m].
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
DRAWN = Fineness(128, 24, (6, 6), 9, 4.0, 1e-7, 1e-8)  # the draws are worth no more
QUICK = Fineness(96, 17, (2, 2), 5, 2.0, 1e-6, 1e-7)  # the score errs by the square of the gap
STANDING = Fineness(10, 5, (1, 1), 3, 2.0, 3e-4, 1e-3)  # scores are known to some 3e-4


@dataclass(frozen=True, eq=False)
class UniformBaseline:
    """The best uniform layout of a scene, which every design is compared with.

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

    __repr__ = brief


def gain_in_words(lead: float, digits: int = 2) -> str:
    """Say a gain: "3.18% over", "0.29% below" where it is a loss, "level with" where it is none."""
    if abs(lead) < 0.5 * 0.1 ** (digits + 2):
        return "level with"
    return f"{abs(lead):.{digits}%} {'over' if lead >= 0.0 else 'below'}"


def gain(score: float, other: float) -> float | None:
    """Say how much better a score is than another, such as that of the best uniform row.

    Parameters
    ----------
    score, other
        Of two waves, judged alike.

    Returns
    -------
    float or None
        score / other - 1; None where one of the waves died, as its score is no speed.
    """
    return score / other - 1.0 if score > 0.0 and other > 0.0 else None


def best_uniform(scene: Specification, known: tuple[float, float] | None = None) -> Layout:
    """Find the best layout of one pitch and one thickness within the scene's rules.

    The first domino keeps the scene's thickness. With a stock, the dominoes stand in the order
    given at one pitch, pivot to pivot, or at one gap where the rules leave no such pitch. In a
    growing row, gaps have one ratio to the heights, and heights to those before. Where a length
    and a list of allowed gaps leave no equal pitch, those next to it take turns evenly; where the
    lists leave no such row either, the baseline is the best row without the lists.

    Those of the scenes that ship come with the package.

    Parameters
    ----------
    scene
        The scene.
    known
        What `best_point` found before; None where it did not.

    Raises
    ------
    ValueError
        Where the rules leave no uniform row.
    """
    point = known or _shipped_points().get(stamp(scene)) or best_point(scene)
    return _uniform_layouts(scene).layout(np.array(point))


def best_point(scene: Specification, *, quick: bool = False) -> Floats:
    """Find the two numbers (2,) of the best uniform layout, as of `UniformLayouts`.

    Parameters
    ----------
    scene
        The scene.
    quick
        Simulate some hundred layouts instead of thousands: the gap is met to a thousandth of a
        millimetre, and of two peaks of nearly the same height the lower one may be taken.

    Raises
    ------
    ValueError
        Where the rules leave no uniform layout.

    Notes
    -----
    A grid over all there is to choose, then finer grids around the best places: the speed has
    several peaks, and steps where a wave stops. Where no layout is a success, the best of the
    others. Long layouts are scored by their first dominoes, and the best of them is simulated
    whole; should it score otherwise then, as on uneven ground, all are simulated whole.

    Free-standing layouts take long to simulate: the first grid is that of the analytic model,
    whose best places, some distance apart, are the first that are simulated on the floor. The gap
    is then known to some 0.3 mm, the speed, as the maximum is flat, to some 3e-4 of itself.
    """
    if scene.count >= LONG and not quick:
        notice(f"finding the best uniform row of '{one_line(scene.name, 40)}' ...")
    layouts = _uniform_layouts(scene)
    if scene.floor_friction is not None:
        return _best_standing(layouts)
    fineness = QUICK if quick else DRAWN if scene.criterion.simulates_anew else FULL
    points = grid(_axes(layouts, fineness))
    if layouts.steady and not quick and scene.count * len(points) > LARGEST_GRID:

        def by_prefix(points: Floats, cell: float) -> Floats:
            return layouts.scores_by_prefix(points, COARSELY if cell > CLOSE else FINELY)

        point = _search(layouts, BY_PREFIX, by_prefix)
        found, whole = by_prefix(point[None], 0.0)[0], layouts.scores(point[None], FULL.rtol)[0]
        if abs(found - whole) <= SAME * abs(whole):
            return point
    return _search(layouts, fineness, lambda points, _: layouts.scores(points, fineness.rtol))


def _uniform_layouts(scene: Specification) -> UniformLayouts:
    """Return those that keep the rules; where none does, those that keep all but the lists."""
    try:
        return UniformLayouts(scene)
    except ValueError:
        return UniformLayouts(scene.replace(spacing_values=None, thickness_values=None))


def _best_standing(layouts: UniformLayouts) -> Floats:
    analytic = UniformLayouts(layouts.scene.replace(floor_friction=None))
    points = grid(_axes(analytic, FULL))
    cell = (layouts.high - layouts.low) / STANDING.line
    chosen = _apart(points, analytic.scores(points, FULL.rtol), cell, STANDING.line)
    return _search(
        layouts, STANDING, lambda points, _: layouts.scores(points, STANDING.rtol), points[chosen]
    )


def _axes(layouts: UniformLayouts, fineness: Fineness) -> list[Floats]:
    """For each of the two numbers, the values of the first grid."""
    one = float(np.min(layouts.high - layouts.low)) == 0.0
    number = fineness.line if one else fineness.plane
    return [
        np.linspace(low, high, 1 if low == high else number) if some is None else np.array(some)
        for low, high, some in zip(layouts.low, layouts.high, layouts.allowed, strict=True)
    ]


def grid(axes: list[Floats]) -> Floats:
    """(P, 2) all points of a grid."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _search(
    layouts: UniformLayouts, fineness: Fineness, score: Scorer, start: Floats | None = None
) -> Floats:
    """Find the point (2,) of the highest score, from the points `start` or a grid."""
    axes = _axes(layouts, fineness)
    # nothing is refined along an axis whose values are all on the list
    cell = np.array([
        a[1] - a[0] if len(a) > 1 and some is None else 0.0
        for a, some in zip(axes, layouts.allowed, strict=True)
    ])  # fmt: skip
    bounds = layouts.low, layouts.high
    return refined(grid(axes) if start is None else start, cell, bounds, fineness, score)


def refined(
    points: Floats, cell: Floats, bounds: tuple[Floats, Floats], fineness: Fineness, score: Scorer
) -> Floats:
    """Find the point (2,) of the highest score by ever finer grids around the best points.

    Parameters
    ----------
    points
        (P, 2) where the search starts.
    cell
        (2,) their distance along each axis; 0 for an axis along which nothing is refined.
    bounds
        Least and largest values, (2,) each.
    fineness
        How many points are taken how finely.
    score
        Returns the scores of points.
    """
    first, scores = points, score(points, np.inf)
    first_scores, keep = scores, fineness.keep[0]
    offsets = grid([np.linspace(-1.0, 1.0, fineness.around)] * 2)
    while cell.max() > fineness.finest:
        best = points[_apart(points, scores, 2.0 * cell, keep)]
        steps = unique_points(offsets * (cell > 0.0)) if cell.min() == 0.0 else offsets
        fresh = (best[:, None, :] + steps[None] * cell).reshape(-1, 2)
        # the places themselves are among the fresh ones, so the best is never lost
        points = unique_points(np.clip(fresh, *bounds))
        scores = score(points, float(cell.max()))
        cell, keep = cell / fineness.shrink, fineness.keep[1]
    equal = np.flatnonzero(first_scores >= scores.max())
    if len(equal):  # a plateau: its middle, not the edge where a hair more ends the wave
        return np.asarray(first[equal[len(equal) // 2]])
    return np.asarray(points[int(np.argmax(scores))])


def _apart(points: Floats, scores: Floats, distance: Floats, keep: int) -> list[int]:
    """Indices of the `keep` best points that are no neighbours of a better one."""
    chosen: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        gap = np.abs(points[chosen] - points[i])
        if not np.any(np.all(gap <= distance, axis=1)):
            chosen.append(int(i))
        if len(chosen) == keep:
            break
    return chosen


def best_uniform_on(
    scene: Specification, baseline: Layout, floor: float | None, rtol: float = 1e-3
) -> Layout:
    """Find the gap at which a uniform row is fastest on a floor.

    Parameters
    ----------
    scene
        Whose bounds the gaps keep.
    baseline
        Its best uniform layout with fixed pivots, or the first dominoes of it; thicknesses stay
        as they are.
    floor
        Friction of the floor; None for fixed pivots.
    rtol
        Of the simulations.

    Returns
    -------
    Layout
        The baseline itself with fixed pivots, if it is whole, and where the scene leaves no gap to
        choose (a length, a list, growing dominoes) or does not count speed.

    Notes
    -----
    All gaps grow by the same amount: a grid between 0.6 and 1.6 of the baseline's gap, then finer
    ones around the best, where the speed has one peak.
    """
    fixed = scene.length is not None or scene.spacing_values is not None or scene.growth is not None
    whole = baseline.count == scene.count
    if (floor is None and whole) or fixed or scene.criterion.unit != "m/s":
        return baseline
    gaps = baseline.spacing
    mean = float(gaps.mean())
    least = max(scene.spacing[0] - float(gaps.min()), (NARROWER - 1.0) * mean)
    most = min(scene.spacing[1] - float(gaps.max()), (WIDER - 1.0) * mean)

    def wider(by: float) -> Layout:
        moved = np.clip(gaps + by, *scene.spacing)
        row = moved, baseline.thickness, baseline.height, baseline.width, baseline.density
        return Layout(*row) if scene.ground is None else scene.ground.layout(*row)

    @cache
    def speed(by: float) -> float:
        row = wider(by)
        wave = simulate_standing(row, scene.physics, floor, rtol)
        return float(row.length / wave.arrival_times[-1])

    ways = np.unique(np.append(np.linspace(least, most, STANDING.line), 0.0))
    best, _ = refined(
        np.stack([ways, 0.0 * ways], axis=1),
        np.array([(most - least) / STANDING.line, 0.0]),
        (np.array([least, 0.0]), np.array([most, 0.0])),
        STANDING,
        lambda points, _: np.array([speed(by) for by in points[:, 0].tolist()]),
    )
    return wider(float(best)) if speed(float(best)) > 0.0 else baseline


def stamp(scene: Specification) -> str:
    """Return a digest of all that the best uniform row may depend on: all but the names."""
    tables = scene.document() | {"name": None, "title": None}
    return hashlib.sha256(json.dumps(tables, sort_keys=True).encode()).hexdigest()


@cache
def _shipped_points() -> dict[str, tuple[float, float]]:
    """The best points of the scenes that ship, by their digests."""
    file = resources.files("domino_env.scenes") / "shipped" / SHIPPED
    return {kept["stamp"]: kept["point"] for kept in json.loads(file.read_text("utf-8")).values()}
