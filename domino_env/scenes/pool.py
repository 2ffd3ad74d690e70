"""Pools of sampled scenes with their uniform baselines, and test sets of scenes.

`python -m domino_env.scenes.shipping NAME …` samples the shipped ones anew.
"""

from __future__ import annotations

import hashlib

import numpy as np

from domino_env.core.checks import require_choice
from domino_env.core.files import raise_with_path
from domino_env.core.types import Floats
from domino_env.scenes.distribution import SceneDistribution, load_distribution
from domino_env.scenes.io.reading import DISTRIBUTIONS
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import best_point

POOL_SIZE = 4096  # scenes
TRAINING_SEED = 0  # of the scenes, with the number of each
BEYOND_TESTS = 100  # scenes beyond the range of each number
DIGITS = 5  # of the sampled numbers, for legible files

POINT = ("uniform gap", "uniform thickness")  # [m]


class ScenePool:
    """Numbered scenes of a distribution, each with its uniform baseline.

    The number is the seed of the scene. Scene and baseline are made at their first use; those of
    the shipped distributions are stored.

    Parameters
    ----------
    distribution
        Source of the scenes.
    size
        Number of scenes.
    """

    def __init__(self, distribution: SceneDistribution, size: int = POOL_SIZE) -> None:
        self.distribution = distribution
        self.numbers = np.full((size, len(distribution.features)), np.nan)
        self.points = np.full((size, 2), np.nan)  # of the uniform baselines
        table = _table(distribution, "pool")
        if table is not None:
            n = min(size, len(table))
            self.numbers[:n], self.points[:n] = table[:n, :-3], table[:n, -3:-1]
        self.features = distribution.scale(self.numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    def scene(self, i: int) -> Scene:
        """Return scene i with its uniform baseline."""
        if np.isnan(self.points[i, 0]):
            self._sample(i)
        return self._scene(i)

    def _scene(self, i: int) -> Scene:
        name = f"{self.distribution.name}-{i}"
        return self.distribution.scene(self.numbers[i], name).with_uniform(self.points[i])

    def _sample(self, i: int) -> None:
        rng, score = np.random.default_rng([TRAINING_SEED, i]), 0.0
        while not score > 0.0:
            self.numbers[i] = self.distribution.sample_numbers(rng, DIGITS)
            self.points[i] = best_point(self.distribution.scene(self.numbers[i]), quick=True)
            score = self._scene(i).uniform().score
        self.features[i] = self.distribution.scale(self.numbers[i])


def load_test_set(name: str, beyond: str | None = None) -> list[Scene]:
    """Load a test set: scenes sampled independently of those of the training.

    Parameters
    ----------
    name
        Name of a shipped distribution. Every number of the scenes of "varied-beyond" is out of
        the ranges of "varied".
    beyond
        One of the numbers that "varied" samples (`distribution.features`): only this number is out
        of its range, and in that of "varied-beyond". None for all numbers in their ranges.

    Returns
    -------
    list of Scene
        200 scenes, or 100 beyond a range, with their uniform baselines.

    Raises
    ------
    ValueError
        For a distribution without a test set, and for a number that it does not sample.
    """
    distribution, kind = load_distribution(name), "test"
    table = _table(distribution, "test" if beyond is None else "beyond")
    if table is None:
        kind = "no test set" if beyond is None else "no test set beyond its ranges"
        raise_with_path(distribution.file, f"{kind} ships with it: name a shipped distribution")
    if beyond is not None:
        require_choice("beyond", beyond, distribution.features)
        first = BEYOND_TESTS * distribution.features.index(beyond)
        table, kind = table[first : first + BEYOND_TESTS], f"beyond-{beyond.replace(' ', '-')}"
    prefix = f"{distribution.name}-{kind}"
    return [
        distribution.scene(numbers[:-2], f"{prefix}-{i}").with_uniform(numbers[-2:])
        for i, numbers in enumerate(table)
    ]


def _table(distribution: SceneDistribution, kind: str) -> Floats | None:
    """Return the shipped table of a distribution; None if it was made for another one."""
    file = DISTRIBUTIONS / f"{distribution.name}.{kind}.csv"
    if not file.is_file():
        return None
    lines = file.read_text("utf-8").splitlines()
    if lines[0] != make_stamp(distribution):
        return None
    return np.loadtxt(lines[2:], delimiter=",", ndmin=2)


def make_stamp(distribution: SceneDistribution) -> str:
    """Return the first line of files made for a distribution as it is now."""
    document = {k: v for k, v in distribution.document.items() if k not in ("name", "title")}
    return "# " + hashlib.sha256(repr(document).encode()).hexdigest()
