"""Pools of sampled scenes with their uniform baselines, and test sets of scenes.

`python docs/shipped_scenes.py NAME …` computes the shipped pools and test sets.
"""

from __future__ import annotations

import hashlib

import numpy as np

from domino_env.core.files import raise_with_path
from domino_env.core.types import Floats
from domino_env.scenes.distribution import SceneDistribution, load_distribution
from domino_env.scenes.io.reading import DISTRIBUTIONS
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import best_point

POOL_SIZE = 4096  # [scenes]
TRAINING_SEED = 0  # scene i of a pool has the seed [TRAINING_SEED, i]
DIGITS = 5  # significant digits of sampled numbers, for legible files


class ScenePool:
    """Scenes 0, 1, … of a distribution, each with its uniform baseline.

    Scene i is sampled with the seed [0, i]. Scenes and baselines are computed at their first use;
    those of the shipped distributions are stored.

    Parameters
    ----------
    distribution
        Distribution from which the scenes are sampled.
    size
        Number of scenes.

    Attributes
    ----------
    numbers
        (size, V) sampled numbers of the scenes, in the units of their ranges; NaN before the first
        use.
    points
        (size, 2) `best_point` of the scenes; NaN before the first use.
    features
        (size, V) numbers scaled by `SceneDistribution.scale`.
    """

    def __init__(self, distribution: SceneDistribution, size: int = POOL_SIZE) -> None:
        self.distribution = distribution
        self.numbers = np.full((size, len(distribution.features)), np.nan)
        self.points = np.full((size, 2), np.nan)
        table = _load_table(distribution, "pool")
        if table is not None:
            n = min(size, len(table))
            # the last three columns are the point and the score
            self.numbers[:n], self.points[:n] = table[:n, :-3], table[:n, -3:-1]
        self.features = distribution.scale(self.numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    def scene(self, i: int) -> Scene:
        """Return the scene with index i and its uniform baseline."""
        if np.isnan(self.points[i, 0]):
            self._sample(i)
        return self._scene(i)

    def _scene(self, i: int) -> Scene:
        name = f"{self.distribution.name}-{i}"
        return self.distribution.scene(self.numbers[i], name).with_uniform(self.points[i])

    def _sample(self, i: int) -> None:
        rng, score = np.random.default_rng([TRAINING_SEED, i]), 0.0
        while not score > 0.0:  # scenes whose baseline scores 0 or less are skipped
            self.numbers[i] = self.distribution.sample_numbers(rng, DIGITS)
            self.points[i] = best_point(self.distribution.scene(self.numbers[i]), quick=True)
            score = self._scene(i).uniform().score
        self.features[i] = self.distribution.scale(self.numbers[i])


def load_test_set(name: str) -> list[Scene]:
    """Load a test set: scenes sampled independently of those of the training.

    Parameters
    ----------
    name
        Name of a shipped distribution. All numbers of the scenes of "varied-beyond" are out of the
        ranges of "varied".

    Returns
    -------
    list of Scene
        200 scenes with their uniform baselines.

    Raises
    ------
    ValueError
        For a distribution without a test set.
    """
    distribution = load_distribution(name)
    table = _load_table(distribution, "test")
    if table is None:
        raise_with_path(distribution.file, "no test set ships with it: name another, as 'varied'")
    # the last two columns are the point
    return [
        distribution.scene(line[:-2], f"{distribution.name}-test-{i}").with_uniform(line[-2:])
        for i, line in enumerate(table)
    ]


def _load_table(distribution: SceneDistribution, kind: str) -> Floats | None:
    """Load the shipped table "pool" or "test"; None if this distribution has none."""
    file = DISTRIBUTIONS / f"{distribution.name}.{kind}.csv"
    lines = file.read_text("utf-8").splitlines() if file.is_file() else [""]
    if lines[0] != make_stamp(distribution):
        return None
    return np.loadtxt(lines[2:], delimiter=",", ndmin=2)


def make_stamp(distribution: SceneDistribution) -> str:
    """Return the first line of the tables of a distribution, which identifies its ranges."""
    document = {k: v for k, v in distribution.document.items() if k not in ("name", "title")}
    return "# " + hashlib.sha256(repr(document).encode()).hexdigest()
