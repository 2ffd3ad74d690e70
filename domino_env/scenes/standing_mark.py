"""The best uniform row on a floor: the analytic model says where to look, standing rows decide."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from domino_env.scenes.uniform_rows import UniformRows

Floats = NDArray[np.float64]

LOOKS = 10  # standing rows of a first look at the whole range, and again at where it is fast
SLOWER, LEVEL = 0.05, 5e-4  # than the best: part that still counts as fast, and as level
TOGETHER, ROUNDS = 4, 8  # standing rows of a later look, and how many looks there are at most
NEAR = 2.0  # power of the squared distance by which what was learned nearer by counts more
CLOSEST, FLAT = 0.01, 1e-6  # of the range: distance that counts as none, and what tilts cost


def best_standing(rows: UniformRows, points: Floats) -> Floats:
    """Find the uniform row that is fastest on the scene's floor.

    The ratio of standing to analytic speed changes slowly with gap and thickness (from 0.9966 to
    0.9982 over gaps of 12 to 24 mm on a floor of friction 0.4). So it is measured at some rows,
    learned for those between them, and where the speed is then largest more rows are toppled,
    until none is promised to be faster than the best.

    The speed found is the largest there is to some 3e-4 of itself, which is what standing rows
    are known to; the gap, as the top is flat, to some 0.3 mm.

    Parameters
    ----------
    rows
        The uniform rows of a scene with a floor.
    points
        (P, 2) all of them that may be chosen, as of `UniformRows`.

    Returns
    -------
    NDArray
        (2,) the best of them.
    """
    hinged = UniformRows(rows.scene.replace(floor_friction=None)).scores(points)
    span = np.maximum(np.ptp(points, axis=0), 1e-12)
    places = (points - points.min(axis=0)) / span
    best = int(np.argmax(hinged))
    fast = _within(hinged, SLOWER)
    known = [best, *_spread(places, np.arange(len(points)), LOOKS), *_spread(places, fast, LOOKS)]
    known = list(dict.fromkeys(known))
    scores = rows.scores(points[known])
    for _ in range(ROUNDS):
        promised = _promised(places, hinged, known, scores)
        fresh = [int(i) for i in np.argsort(-promised, kind="stable")[:1] if int(i) not in known]
        if not fresh:
            break
        more = _spread(places, _within(promised, LEVEL), TOGETHER - 1)
        fresh += [i for i in dict.fromkeys(more) if i not in known and i not in fresh]
        scores = np.concatenate([scores, rows.scores(points[fresh])])
        known += fresh
    return np.asarray(points[known[int(np.argmax(scores))]])


def _promised(places: Floats, hinged: Floats, known: list[int], scores: Floats) -> Floats:
    """(P,) what all points are likely to score standing, by those that are known."""
    failed = np.minimum(scores.min(), 0.0) - 1.0
    ratio = np.where(scores > 0.0, scores, 0.0) / np.maximum(hinged[known], 1e-9)
    ratio = np.where(hinged[known] > 0.0, ratio, 0.0)
    # moving least squares: a plane for each point, in which what is near counts most
    away = places[known][None] - places[:, None, :]
    weight = (np.sum(away**2, axis=2) + CLOSEST**2) ** -NEAR
    terms = np.concatenate([np.ones((*away.shape[:2], 1)), away], axis=2)
    weighted = weight[:, :, None] * terms / weight.sum(axis=1)[:, None, None]
    normal = weighted.transpose(0, 2, 1) @ terms + np.diag([0.0, FLAT, FLAT])
    learned = np.linalg.solve(normal, weighted.transpose(0, 2, 1) @ ratio[:, None])[:, 0, 0]
    found = np.where((hinged > 0.0) & (learned > 0.0), hinged * learned, failed)
    found[known] = scores
    return np.asarray(found)


def _within(scores: Floats, part: float) -> NDArray[np.intp]:
    """Those that are the best to so small a part."""
    most = scores.max()
    return np.flatnonzero(scores >= most - part * abs(most))


def _spread(places: Floats, some: NDArray[np.intp], number: int) -> list[int]:
    """Choose `number` of some points that lie as far apart as can be, the ends first."""
    chosen = [int(some[0])]
    far = np.linalg.norm(places[some] - places[chosen[0]], axis=1)
    while len(chosen) < min(number, len(some)) and far.max() > 0.0:
        chosen.append(int(some[int(np.argmax(far))]))
        far = np.minimum(far, np.linalg.norm(places[some] - places[chosen[-1]], axis=1))
    return chosen
