"""Scenes sampled ahead with their uniform baselines, and sets of scenes for tests.

`python -m domino_env.scenes.shipping NAME …` samples those that ship anew.
"""

from __future__ import annotations

import hashlib

import numpy as np

from domino_env.core.files import refuse
from domino_env.core.types import Floats
from domino_env.scenes.distribution import SceneDistribution, load_distribution
from domino_env.scenes.io.reading import DISTRIBUTIONS
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import best_point

POOL = 4096  # scenes
TRAINING = 0  # beside its number the seed of a scene
DIGITS = 5  # of the numbers drawn: files that a reader can look at

POINT = ("uniform gap", "uniform thickness")  # [m]


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
        self.uniform_scores = np.full((size, 2), np.nan)  # their scores and mean speeds
        table = _table(distribution, "pool")
        if table is not None:
            n = min(size, len(table))
            self.numbers[:n], self.points[:n] = table[:n, :-3], table[:n, -3:-1]
            self.uniform_scores[:n] = table[:n, -1:]  # what ships counts the mean speed

        self.features = distribution.scaled(self.numbers)  # of those that are drawn

    def __len__(self) -> int:
        return len(self.numbers)

    def scene(self, i: int) -> Scene:
        """Make scene i, which knows its best uniform row."""
        if np.isnan(self.uniform_scores[i, 0]):
            self._draw(i)
        return self._scene(i)

    def _scene(self, i: int) -> Scene:
        name = f"{self.distribution.name}-{i}"
        return self.distribution.scene(self.numbers[i], name).with_uniform(self.points[i])

    def _draw(self, i: int) -> None:
        rng = np.random.default_rng([TRAINING, i])
        score = 0.0
        while not score > 0.0:
            self.numbers[i] = self.distribution.sample_numbers(rng, DIGITS)
            self.points[i] = best_point(self.distribution.scene(self.numbers[i]), quick=True)
            mark = self._scene(i).uniform()
            score = mark.score
        self.uniform_scores[i] = score, mark.wave.mean_speed
        self.features[i] = self.distribution.scaled(self.numbers[i])


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
        distribution.scene(row[:-2], f"{distribution.name}-test-{i}").with_uniform(row[-2:])
        for i, row in enumerate(table)
    ]


# files --------------------------------------------------------------------------------------------


def _table(distribution: SceneDistribution, kind: str) -> Floats | None:
    """What ships with a distribution, if it still is what that was made for."""
    file = DISTRIBUTIONS / f"{distribution.name}.{kind}.csv"
    if not file.is_file():
        return None
    first, _, *rows = file.read_text("utf-8").splitlines()
    if first != stamp_of(distribution):
        return None
    return np.array([[float(x) for x in row.split(",")] for row in rows])


def stamp_of(distribution: SceneDistribution) -> str:
    """Return the first line of files made for a distribution as it is now."""
    told = {k: v for k, v in distribution.document.items() if k not in ("name", "title")}
    return "# " + hashlib.sha256(repr(told).encode()).hexdigest()
