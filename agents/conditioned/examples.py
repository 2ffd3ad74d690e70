"""Examples: scenes with good rows that search found; what imitation learns from."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from agents.base.arrays import read_arrays
from agents.conditioned.distribution import FEATURES, SceneDistribution, features_of, scene_with
from domino_env import Scene
from domino_env.support.files import write_bytes
from domino_env.support.progress import progress_bar

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Examples:
    """E scenes and a good row of each.

    Attributes
    ----------
    scenes
        (E, 6) features.
    gaps
        (E, longest - 1) over the height, nan beyond each row.
    score, uniform
        (E,) of the row, and of the best uniform one [m/s at the standard height].
    """

    scenes: Floats
    gaps: Floats
    score: Floats
    uniform: Floats

    def __len__(self) -> int:
        return len(self.scenes)

    def scene(self, i: int) -> Scene:
        """Make the scene of one example."""
        return scene_with(self.scenes[i])

    def save(self, path: Path) -> None:
        """Write them as plain arrays."""
        arrays = {
            "scenes": self.scenes, "gaps": self.gaps, "score": self.score, "uniform": self.uniform,
        }  # fmt: skip
        write_bytes(path, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))


def make_examples(
    distribution: SceneDistribution,
    number: int,
    seed: int,
    evaluations: int,
    file: Path | None = None,
    progress: bool | None = False,
) -> Examples:
    """Draw scenes and search a row for each.

    Parameters
    ----------
    distribution
        What the scenes are drawn from.
    number
        Of examples.
    seed
        Of the draws and searches.
    evaluations
        Budget of each search.
    file
        Where the examples are kept; those that are there already are not searched again, so that an
        interrupted call goes on.
    progress
        Whether to show a progress bar; None: on a terminal, elsewhere a line now and then.

    Raises
    ------
    ValueError
        Where the file holds other examples.
    """
    from optimize import search

    rng = np.random.default_rng(seed)
    drawn = [distribution.sample(rng) for _ in range(number)]
    scenes = np.array([features_of(scene) for scene in drawn]).reshape(number, len(FEATURES))
    gaps = np.full((number, int(scenes[:, 2].max(initial=2)) - 1), np.nan)
    found = Examples(scenes, gaps, np.full(number, np.nan), np.full(number, np.nan))
    begun = 0
    if file is not None and file.exists():
        old = load_examples(file)
        begun = int(np.isfinite(old.score).sum())
        if len(old) != number or not np.array_equal(old.scenes, scenes):
            raise ValueError(f"{file} holds examples of other scenes: name another file")
        found = old
    for i in progress_bar(
        progress, iterable=range(begun, number), unit=" scenes", initial=begun, total=number
    ):
        result = search(drawn[i], budget=evaluations, seed=seed, progress=False)
        found.gaps[i, : drawn[i].count - 1] = result.layout.spacing / drawn[i].height
        found.score[i], found.uniform[i] = result.score, result.uniform.score
        if file is not None and (i + 1 == number or (i + 1) % 50 == 0):
            found.save(file)
    return found


def load_examples(file: Path) -> Examples:
    """Read what `Examples.save` wrote; ValueError for anything else."""
    try:
        arrays = read_arrays(file)
        found = Examples(*(arrays[n] for n in ("scenes", "gaps", "score", "uniform")))
        if found.scenes.shape != (len(found.score), len(FEATURES)):
            raise ValueError("shapes that do not fit")
    except (ValueError, KeyError) as error:
        raise ValueError(f"{file} holds no examples: {error}") from None
    return found
