"""Pools of sampled scenes with their uniform baselines, and test sets of scenes.

`python docs/shipped_scenes.py NAME …` computes the shipped pools and test sets.
"""

from __future__ import annotations

import hashlib
import logging
import time
import zlib
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np

from domino_env.core.checks import require_choice
from domino_env.core.files import one_line, raise_with_path
from domino_env.core.progress import UNNOTICED, notice
from domino_env.core.types import Bools, Floats, Ints
from domino_env.kernels.jit.plain import STAMP, cache_folder
from domino_env.scenes.distribution import SceneDistribution, load_distribution
from domino_env.scenes.io.reading import DISTRIBUTIONS
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import best_point

POOL_SIZE = 4096  # [scenes] of distributions whose pool is not stored
TRAINING_SEED = 0  # scene i of a pool has the seed [TRAINING_SEED, i]
SEEDS = {"test": 1, "validation": 2}  # scene i of these sets has the seed [seed, i]
DIGITS = 5  # significant digits of sampled numbers, for legible files


class ScenePool:
    """Scenes 0, 1, … of a distribution, each with its uniform baseline.

    Scene i is sampled with the seed [0, i]. Scenes and baselines are computed at their first use.
    Those of the shipped distributions are stored; others are kept in the folder of compiled code,
    in a file for each set of ranges and each version of the simulator.

    Parameters
    ----------
    distribution
        Distribution from which the scenes are sampled.
    size
        Number of scenes; None for the stored ones, or else `POOL_SIZE`.

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

    def __init__(self, distribution: SceneDistribution, size: int | None = None) -> None:
        self.distribution = distribution
        table = _load_table(distribution, "pool")
        size = size or (POOL_SIZE if table is None else len(table))
        self.numbers = np.full((size, len(distribution.features)), np.nan)
        self.points = np.full((size, 2), np.nan)
        if table is not None:
            n = min(size, len(table))
            # the last three columns are the point and the score
            self.numbers[:n], self.points[:n] = table[:n, :-3], table[:n, -3:-1]
        self._file = None if table is not None else _cache_file(distribution)
        self._seconds, self._told = 0.0, False  # of computing baselines
        self._scenes: dict[int, Scene] = {}
        if self._file is not None:
            for line in _read_lines(self._file, 3 + self.numbers.shape[1]):
                if line[0] < size:
                    self.numbers[int(line[0])], self.points[int(line[0])] = line[1:-2], line[-2:]
        self.features = distribution.scale(self.numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    def is_known(self, indices: Ints) -> Bools:
        """Return True for each scene of some indices (K,) whose baseline need not be computed."""
        return np.asarray(~np.isnan(self.points[indices, 0]))

    def scene(self, i: int) -> Scene:
        """Return the scene with index i and its uniform baseline."""
        return self.scenes([i])[0]

    def scenes(self, indices: Sequence[int]) -> list[Scene]:
        """Return the scenes with some indices and their uniform baselines.

        Those that are not known are computed; once they have taken two seconds, the user is told.
        """
        unknown = [i for i in indices if not self.is_known(np.array([i]))[0]]
        for number, i in enumerate(unknown, 1):
            start = time.perf_counter()
            self._sample(i)
            self._keep(i)
            self._seconds += time.perf_counter() - start
            if self._seconds > UNNOTICED and not self._told:
                self._told = True
                done = np.count_nonzero(self.is_known(np.arange(len(self))))
                notice(
                    f"computing the uniform baseline of each scene that is sampled from "
                    f"'{one_line(self.distribution.name, 40)}', once: {done} are known, "
                    f"{len(unknown) - number} more are needed now ...",
                    logging.WARNING,  # visible without any configuration of logging
                )
        return [self._scene(i) for i in indices]

    def _scene(self, i: int) -> Scene:
        """Return scene i, the same object every time, which keeps its uniform baseline."""
        if i not in self._scenes:
            scene = self.distribution.scene(self.numbers[i], f"{self.distribution.name}-{i}")
            self._scenes[i] = scene.with_uniform(self.points[i])
        return self._scenes[i]

    def _sample(self, i: int) -> None:
        rng, score = np.random.default_rng([TRAINING_SEED, i]), 0.0
        while not score > 0.0:  # scenes whose baseline scores 0 or less are skipped
            self.numbers[i] = self.distribution.sample_numbers(rng, DIGITS)
            self.points[i] = best_point(self.distribution.scene(self.numbers[i]), quick=True)
            self._scenes.pop(i, None)
            score = self._scene(i).uniform().score
        self.features[i] = self.distribution.scale(self.numbers[i])

    def _keep(self, i: int) -> None:
        """Append numbers and point of scene i to the file, if there is one that can be written."""
        if self._file is None:
            return
        line = ",".join(map(repr, [float(i), *self.numbers[i].tolist(), *self.points[i].tolist()]))
        with suppress(OSError):
            self._file.parent.mkdir(parents=True, exist_ok=True)
            with self._file.open("a", encoding="ascii") as file:
                file.write(f"{line},{zlib.crc32(line.encode())}\n")


def _cache_file(distribution: SceneDistribution) -> Path:
    """Return the file for the baselines of a distribution, as this version computes them."""
    digest = hashlib.sha256(_code_stamp() + make_stamp(distribution).encode()).hexdigest()
    return cache_folder() / "baselines" / f"{digest[:32]}.csv"


@cache
def _code_stamp() -> bytes:
    """Return a digest of the files that determine the baseline of a scene."""
    files = sorted(Path(__file__).parent.rglob("*.py"))
    return STAMP + hashlib.sha256(b"\0".join(file.read_bytes() for file in files)).digest()


def _read_lines(file: Path, columns: int) -> list[Floats]:
    """Return the lines of a file of baselines; incomplete and damaged ones are left out."""
    lines: list[Floats] = []
    with suppress(OSError):  # there is no such file yet, or it cannot be read
        for text in file.read_bytes().splitlines():
            line, _, check = text.rpartition(b",")
            if check == str(zlib.crc32(line)).encode():
                lines.append(np.array(line.split(b","), np.float64))
    return [line for line in lines if len(line) == columns]


def load_test_set(name: str, kind: str = "test") -> list[Scene]:
    """Load a test or validation set: scenes sampled independently of those of the training.

    Parameters
    ----------
    name
        Name of a shipped distribution. All numbers of the scenes of "varied-beyond" are out of the
        ranges of "varied".
    kind
        "test", or "validation" for the scenes on which hyperparameters are chosen.

    Returns
    -------
    list of Scene
        200 scenes, 100 for validation, with their uniform baselines; half as many if episodes in
        one scene are random.

    Raises
    ------
    ValueError
        For another kind, and for a distribution without such a set.
    """
    require_choice("kind", kind, SEEDS)
    distribution = load_distribution(name)
    table = _load_table(distribution, kind)
    if table is None:
        raise_with_path(
            distribution.file, f"no {kind} set ships with it: name another, as 'varied'"
        )
    # the last two columns are the point
    return [
        distribution.scene(line[:-2], f"{distribution.name}-{kind}-{i}").with_uniform(line[-2:])
        for i, line in enumerate(table)
    ]


def _load_table(distribution: SceneDistribution, kind: str) -> Floats | None:
    """Load the shipped table "pool", "test" or "validation"; None if this distribution has none."""
    file = DISTRIBUTIONS / f"{distribution.name}.{kind}.csv"
    lines = file.read_text("utf-8").splitlines() if file.is_file() else [""]
    if lines[0] != make_stamp(distribution):
        return None
    return np.loadtxt(lines[2:], delimiter=",", ndmin=2)


def make_stamp(distribution: SceneDistribution) -> str:
    """Return the first line of the tables of a distribution, which identifies its ranges."""
    document = {k: v for k, v in distribution.document.items() if k not in ("name", "title")}
    return "# " + hashlib.sha256(repr(document).encode()).hexdigest()
