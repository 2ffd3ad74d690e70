"""Episodes of several qualities in the format of Minari, for learning from data alone.

References
----------
Younis, O. G., et al. (2024). Minari. The Farama Foundation, doi:10.5281/zenodo.13767625.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from domino_env import Layout, Scene
from domino_env.envs.chain import DominoChainVector
from domino_env.scenes.distribution import SceneDistribution

QUALITIES = ("uniform", "noisy", "searched")
NOISE = 0.1  # standard deviation of the actions of "noisy" rows, of which each is from -1 to 1


def build_episode(
    env: DominoChainVector, scene: Scene, layout: Layout, noise: float, rng: np.random.Generator
) -> dict[str, list[Any]]:
    """Build a row domino by domino, and record it.

    Parameters
    ----------
    env
        Of one row, of the distribution that the scene is from.
    scene
        What is built.
    layout
        The row that is built but for the noise.
    noise
        Standard deviation of what is added to each action.
    rng
        Draws it.

    Returns
    -------
    dict
        "observations", one more than "actions", "rewards", "terminations", "truncations".
    """
    observation, _ = env.reset(options={"scene": scene})
    names = ("actions", "rewards", "terminations", "truncations")
    found: dict[str, list[Any]] = {"observations": [observation[0]], **{name: [] for name in names}}
    while not any(found["terminations"][-1:]):
        action = env.actions_towards(layout)[0]
        action = np.clip(action + noise * rng.standard_normal(action.shape), -1.0, 1.0)
        placed = action.astype(np.float32)
        after, reward, ended, cut, _ = env.step(placed[None])
        found["observations"].append(after[0])
        for name, value in zip(names, (placed, reward[0], ended[0], cut[0]), strict=True):
            found[name].append(value)
    return found


def write_episodes(
    folder: Path,
    distribution: SceneDistribution,
    scenes: Sequence[Scene],
    rows: Sequence[Layout],
    seed: int,
    noise: float = NOISE,
) -> dict[str, float]:
    """Write a Minari dataset of each quality, an episode for each scene in the order of these.

    Parameters
    ----------
    folder
        To be given to Minari as `MINARI_DATASETS_PATH`; must hold none of these datasets yet.
    distribution
        What the scenes were drawn from.
    scenes, rows
        The scenes and the rows that search found for them.
    seed
        Of the noise.
    noise
        Of the actions of "noisy", see `build_episode`.

    Returns
    -------
    dict
        Mean return of each quality.
    """
    from minari import create_dataset_from_buffers
    from minari.data_collector import EpisodeBuffer

    env = DominoChainVector(1, distribution)
    returns = {}
    made = gymnasium.make("DominoChain-v0", scene=distribution.name)
    for quality in QUALITIES:
        buffers = []
        for i, (scene, row) in enumerate(zip(scenes, rows, strict=True)):
            target = scene.uniform().layout if quality == "uniform" else row
            error = noise if quality == "noisy" else 0.0
            rng = np.random.default_rng([seed, i])
            buffers.append(EpisodeBuffer(id=i, **build_episode(env, scene, target, error, rng)))
        returns[quality] = float(np.mean([np.sum(buffer.rewards) for buffer in buffers]))
        with minari_folder(folder), warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # no e-mail address is known
            create_dataset_from_buffers(
                f"{distribution.name}/{quality}-v0", buffers, env=made, data_format="arrow",
                algorithm_name=quality, author="domino-chains", description=distribution.title,
            )  # fmt: skip
    return returns


@contextmanager
def minari_folder(folder: Path) -> Iterator[None]:
    """Let Minari find its datasets in a folder."""
    name, before = "MINARI_DATASETS_PATH", os.environ.get("MINARI_DATASETS_PATH")
    os.environ[name] = str(folder.resolve())  # Minari repeats what is relative
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before
