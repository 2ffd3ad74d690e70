"""Scenes drawn ahead with the marks of their best uniform rows, and sets of scenes for tests.

python -m domino_env.scenes.pool [NAME …]    draws those that ship anew
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env.core.files import write_text
from domino_env.core.progress import progress_bar
from domino_env.core.reading import refuse
from domino_env.scenes.baseline import apart, best_point
from domino_env.scenes.distribution import SceneDistribution, load_distribution
from domino_env.scenes.io.reading import DISTRIBUTIONS, distribution_names
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform_rows import UniformRows

Floats = NDArray[np.float64]

POOL, TESTED = 4096, 200  # scenes in a pool, in a set for tests
TRAINING, TEST = 0, 1  # what a scene is drawn for, beside its number the seed of its draw
DIGITS = 5  # of the numbers drawn: files that a reader can look at

LOOK, LOOK_BOTH = (96, 96), (24, 12)  # gaps, thicknesses of a first look: at one, at both
KEEP = 2  # places that are looked at again, each time more closely
POINT = ("best uniform row", "its thickness")  # [m]
FINEST, RTOL = 1e-6, 1e-7  # [m] where that ends: the score errs by the square


class ScenePool:
    """Scenes of a distribution, numbered, each with the mark of its best uniform row.

    A scene is drawn by its number, so that whoever asks for number 17 gets the same. It is drawn
    and its uniform rows searched when it is first asked for; the distributions that ship bring
    both along.

    Parameters
    ----------
    distribution
        What is drawn from.
    size
        How many scenes there are.
    """

    def __init__(self, distribution: SceneDistribution, size: int = POOL) -> None:
        self.distribution = distribution
        self.numbers = np.full((size, len(distribution.features)), np.nan)
        self.points = np.full((size, 2), np.nan)  # of the best uniform rows
        self.marks = np.full((size, 2), np.nan)  # their scores and mean speeds
        table = _table(distribution, "pool")
        if table is not None:
            n = min(size, len(table))
            self.numbers[:n], self.points[:n] = table[:n, :-3], table[:n, -3:-1]
            self.marks[:n] = table[:n, -1:]  # what ships counts the mean speed

        self.features = distribution.scaled(self.numbers)  # of those that are drawn

    def __len__(self) -> int:
        return len(self.numbers)

    def scene(self, i: int) -> Scene:
        """Make scene i, which knows its best uniform row."""
        if np.isnan(self.marks[i, 0]):
            self._draw(i)
        return self._scene(i)

    def _scene(self, i: int) -> Scene:
        name = f"{self.distribution.name}-{i}"
        return self.distribution.scene(self.numbers[i], name).knowing(self.points[i])

    def _draw(self, i: int) -> None:
        rng = np.random.default_rng([TRAINING, i])
        score = 0.0
        while not score > 0.0:
            self.numbers[i] = self.distribution.draw(rng, DIGITS)
            self.points[i] = quick_point(self.distribution.scene(self.numbers[i]))
            mark = self._scene(i).uniform()
            score = mark.score
        self.marks[i] = score, mark.wave.mean_speed
        self.features[i] = self.distribution.scaled(self.numbers[i])


def quick_point(scene: Scene) -> Floats:
    """Find the two numbers (2,) of a uniform row that is nearly the best, as of `UniformRows`.

    Some hundred rows are toppled where `Scene.uniform` topples thousands. The gap is met to a
    thousandth of a millimetre, and the score errs by the square of that; where a scene has two
    peaks of nearly the same height, the lower one may be taken.
    """
    rows = UniformRows(scene)
    both = bool((rows.low < rows.high).all())
    axes = [
        np.array(some) if some is not None else np.linspace(a, b, n if a < b else 1)
        for a, b, some, n in zip(
            rows.low, rows.high, rows.allowed, LOOK_BOTH if both else LOOK, strict=True
        )
    ]
    points = _grid(axes)
    cell = np.array([
        a[1] - a[0] if len(a) > 1 and some is None else 0.0
        for a, some in zip(axes, rows.allowed, strict=True)
    ])  # fmt: skip
    scores = _scores(scene, rows, points)
    while cell.max() > FINEST:
        best = points[apart(points, scores, 2.0 * cell, KEEP)]
        steps = _grid([np.linspace(-c, c, 5 if c > 0.0 else 1) for c in cell])
        points = np.clip((best[:, None] + steps).reshape(-1, 2), rows.low, rows.high)
        scores = _scores(scene, rows, points)
        cell = cell / 2.0
    return np.asarray(points[int(np.argmax(scores))])


def _grid(axes: list[Floats]) -> Floats:
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)


def _scores(scene: Scene, rows: UniformRows, points: Floats) -> Floats:
    spacing, thickness, height = rows.at(points)
    return scene.evaluate(scene.batch(spacing, thickness, height, RTOL)).score


# sets for tests -----------------------------------------------------------------------------------


def load_test_set(name: str) -> list[Scene]:
    """Load the scenes that ship to test policies on, drawn apart from those of the training.

    Parameters
    ----------
    name
        Of a distribution that ships: 200 scenes of each. Those of "varied-beyond" lie beyond the
        ranges of "varied" in every number.

    Returns
    -------
    list
        Scenes, whose best uniform rows are known from a whole search.

    Raises
    ------
    ValueError
        For a name of which there is no such set.
    """
    distribution = load_distribution(name)
    table = _table(distribution, "test")
    if table is None:
        refuse(distribution.file, "no set of test scenes ships with it")
    return [
        distribution.scene(row[:-2], f"{distribution.name}-test-{i}").knowing(row[-2:])
        for i, row in enumerate(table)
    ]


# files --------------------------------------------------------------------------------------------


def _table(distribution: SceneDistribution, kind: str) -> Floats | None:
    """What ships with a distribution, if it still is what that was made for."""
    file = DISTRIBUTIONS / f"{distribution.name}.{kind}.csv"
    if not file.is_file():
        return None
    first, _, *rows = file.read_text("utf-8").splitlines()
    if first != _stamp(distribution):
        return None
    return np.array([[float(x) for x in row.split(",")] for row in rows])


def _stamp(distribution: SceneDistribution) -> str:
    told = {k: v for k, v in distribution.document.items() if k not in ("name", "title")}
    return "# " + hashlib.sha256(repr(told).encode()).hexdigest()


def _make_test_set(distribution: SceneDistribution) -> None:
    table = []
    for i in _underway(TESTED, " test scenes"):
        numbers = distribution.draw(np.random.default_rng([TEST, i]), DIGITS)
        table.append([*numbers, *best_point(distribution.scene(numbers))])
    _write(distribution, "test", POINT, table)


def _make_pool(distribution: SceneDistribution) -> None:
    pool, table = ScenePool(distribution), []
    for i in _underway(len(pool), " scenes"):
        pool.scene(i)
        table.append([*pool.numbers[i], *pool.points[i], pool.marks[i, 0]])
    _write(distribution, "pool", (*POINT, "score"), table)


def _write(
    distribution: SceneDistribution, kind: str, columns: tuple[str, ...], table: list[list[float]]
) -> None:
    head = [_stamp(distribution), ",".join((*distribution.features, *columns))]
    rows = [",".join(f"{x:.16g}" for x in row) for row in table]
    path = Path(__file__).parent / "distributions" / f"{distribution.name}.{kind}.csv"
    write_text(path, "\n".join([*head, *rows]) + "\n")


def _underway(number: int, unit: str) -> Any:
    return progress_bar(None, iterable=range(number), total=number, unit=unit)


def main(names: list[str]) -> None:
    """Write the files that ship."""
    for name in names or distribution_names():
        distribution = load_distribution(name)
        _make_test_set(distribution)
        if name != "varied-beyond":
            _make_pool(distribution)


if __name__ == "__main__":
    main(sys.argv[1:])
