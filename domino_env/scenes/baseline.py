"""The best uniform pitch of a scene: the mark that every search has to beat."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from domino_env.core.progress import notice
from domino_env.core.reading import one_line
from domino_env.core.results import brief
from domino_env.core.types import distinct_rows
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Wave
from domino_env.scenes.shipped_marks import shipped_point
from domino_env.scenes.specification import Specification
from domino_env.scenes.standing_mark import best_standing
from domino_env.scenes.uniform_rows import UniformRows

Floats = NDArray[np.float64]

GRID_1D, GRID_2D, GRID_LONG = 1024, 96, 48  # first look at the whole range, per axis
COARSE_1D, COARSE_2D = 128, 24  # where every look topples hundreds of rows
KEEP, KEEP_LONG = 6, 2  # places that are looked at again, each time more closely
FINEST = 1e-9  # [m] where looking closer ends
FINEST_DRAWN = 1e-7  # the same where rows are drawn at random: the draws are worth no more
LARGEST_LOOK = 1_100_000  # dominoes of a first look up to which all rows are toppled whole
COARSELY, FINELY = 1e-8, 1e-12  # how steady the waves of heads are to be
CLOSE = 1e-5  # [m] from where on finely
LONG = 1000  # dominoes from which on this takes long
SAME = 1e-9  # largest relative difference between a score by the head and that of the whole row


@dataclass(frozen=True, eq=False)
class UniformMark:
    """The best uniform row of a scene: the mark to beat.

    Attributes
    ----------
    layout
        The row.
    wave
        Its wave.
    score
        Its score.
    """

    layout: Layout
    wave: Wave
    score: float

    __repr__ = brief


def lead_in_words(lead: float, digits: int = 2) -> str:
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
    lists leave no such row either, the mark is the best row without the lists.

    Those of the scenes that ship come with the package.

    Parameters
    ----------
    scene
        Whose rules they are.
    known
        What `best_point` found before; None where it did not.

    Raises
    ------
    ValueError
        Where the rules leave no uniform row.
    """
    point = shipped_point(scene) if known is None else np.array(known)
    return _uniform_rows(scene).layout(best_point(scene) if point is None else point)


def best_point(scene: Specification) -> Floats:
    """Find the two numbers (2,) of the best uniform row, as of `UniformRows`.

    Raises
    ------
    ValueError
        Where the rules leave no uniform row.

    Notes
    -----
    A grid over all there is to choose, then finer grids around the best places: the speed has
    several peaks, and steps where a wave dies. Where no row is a success, the best of the others.
    Long rows are scored by their heads, and the best of them is toppled whole; should it score
    otherwise then, as on ground that is not the same everywhere, all are toppled whole.
    """
    if scene.count >= LONG:
        notice(f"finding the best uniform row of '{one_line(scene.name, 40)}' ...")
    rows = _uniform_rows(scene)
    axes = _axes(rows, COARSE_2D if rows.drawn else GRID_2D)
    if scene.floor_friction is not None:
        return best_standing(rows, _grid(axes))
    look = scene.count * len(axes[0]) * len(axes[1])
    if rows.steady and look > LARGEST_LOOK:
        # the speed of a long row has few peaks, how it keeps to a schedule has many
        fine = GRID_LONG if scene.criterion.rewards_speed else GRID_2D
        point = _search(rows, _axes(rows, fine), by_heads=True)
        by_head, whole = rows.scores_by_heads(point[None], FINELY)[0], rows.scores(point[None])[0]
        if abs(by_head - whole) <= SAME * abs(whole):
            return point
    return _search(rows, axes)


def _uniform_rows(scene: Specification) -> UniformRows:
    """Those that keep the rules; where none does, those that keep all but the lists."""
    try:
        return UniformRows(scene)
    except ValueError:
        if scene.stock or not (scene.spacing_values or scene.thickness_values):
            raise
        return UniformRows(scene.replace(spacing_values=None, thickness_values=None))


def _axes(rows: UniformRows, fine: int) -> list[Floats]:
    """For each of the two numbers, the values of the first look: `fine` where both are free."""
    if float(np.min(rows.high - rows.low)) == 0.0:
        fine = COARSE_1D if rows.drawn else GRID_1D
    return [
        np.linspace(a, b, 1 if a == b else fine) if some is None else np.array(some)
        for a, b, some in zip(rows.low, rows.high, rows.allowed, strict=True)
    ]


def _grid(axes: list[Floats]) -> Floats:
    """(P, 2) all points of the first look."""
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _search(rows: UniformRows, axes: list[Floats], *, by_heads: bool = False) -> Floats:
    """The point (2,) of the highest score; by_heads: whether heads are toppled for whole rows."""
    points = _grid(axes)
    scores = rows.scores_by_heads(points, COARSELY) if by_heads else rows.scores(points)
    first_points, first_scores = points, scores
    # no looking closer along an axis whose values are all on the list
    cell = np.array([
        a[1] - a[0] if len(a) > 1 and some is None else 0.0
        for a, some in zip(axes, rows.allowed, strict=True)
    ])  # fmt: skip
    keep = KEEP
    while cell.max() > (FINEST_DRAWN if rows.drawn else FINEST):
        best = points[apart(points, scores, 2.0 * cell, keep)]
        offsets = np.linspace(-1.0, 1.0, 9)
        steps = np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)
        if cell.min() == 0.0:
            steps = distinct_rows(steps * (cell > 0.0))
        fresh = (best[:, None, :] + steps[None] * cell).reshape(-1, 2)
        # the places themselves are among the fresh ones, so the best is never lost
        points = distinct_rows(np.clip(fresh, rows.low, rows.high))
        if by_heads:
            keep = KEEP_LONG
            scores = rows.scores_by_heads(points, COARSELY if cell.max() > CLOSE else FINELY)
        else:
            scores = rows.scores(points)
        cell = cell / 4.0
    equal = np.flatnonzero(first_scores >= scores.max())
    if len(equal):  # a plateau: its middle, not the edge where a hair more ends the wave
        return np.asarray(first_points[equal[len(equal) // 2]])
    return np.asarray(points[int(np.argmax(scores))])


def apart(points: Floats, scores: Floats, distance: Floats, keep: int) -> list[int]:
    """Indices of the `keep` best points that are no neighbours of a better one."""
    chosen: list[int] = []
    for i in np.argsort(-scores, kind="stable"):
        gap = np.abs(points[chosen] - points[i])
        if not np.any(np.all(gap <= distance, axis=1)):
            chosen.append(int(i))
        if len(chosen) == keep:
            break
    return chosen
