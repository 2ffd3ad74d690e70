"""Datasets of scenes, of the best layouts of searches, and of episodes that build these layouts.

References
----------
Younis, O. G., et al. (2024). Minari. The Farama Foundation, doi:10.5281/zenodo.13767625.
"""

from __future__ import annotations

import os
import shutil
import warnings
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any
from unittest import mock

import gymnasium
import numpy as np

from domino_env import DominoChainVector, Layout, Scene, SceneDistribution
from domino_env.core.checks import as_path, require, require_extra
from domino_env.core.files import require_writable, write_text
from domino_env.core.results import versions
from domino_env.core.tables import markdown_table
from domino_env.envs import register
from domino_env.scenes.distribution import load_distribution
from optimize.executors import require_executor
from optimize.experiments.runner import run_experiment
from optimize.experiments.store import open_store, result_cells, write_table
from optimize.experiments.task import STOPPED_GAIN, Task, TaskResult

STORE, LAYOUTS, EPISODES, CARD = "layouts.sqlite", "layouts.parquet", "episodes", "README.md"
QUALITIES = ("uniform", "noisy", "searched")  # of the layouts that episodes build
CARD_PAGE = Path(__file__).with_name("dataset_card.md")  # template of the card


def make_dataset(
    folder: str | Path,
    distribution: str | Path = "varied",
    scenes: int = 5000,
    seed: int = 0,
    budget: int = 600,
    executor: Executor | None = None,
    *,
    noise: float = 0.1,
    progress: bool | None = False,
) -> Path:
    """Sample scenes, search for their best layouts, and write both with episodes that build them.

    Each result is stored when its search ends, so the same call continues a stopped one. Scene i
    does not depend on the number of scenes.

    Parameters
    ----------
    folder
        Folder of the dataset.
    distribution
        Name of a shipped scene distribution, or the path of its file.
    scenes
        Number of scenes.
    seed
        Seed of the sampled scenes, the searches and the noise.
    budget
        Number of evaluations in each search.
    executor
        Executor of the searches; None to run them in this process.
    noise
        Standard deviation of the noise on actions of the noisy episodes; actions are from -1 to 1.
    progress
        If True, a progress bar is shown; None for a bar on a terminal and lines elsewhere.

    Returns
    -------
    Path
        Path of the card, README.md.

    Raises
    ------
    ValueError
        If numbers are out of range, if the folder holds a finished dataset or the results of other
        settings, if a search fails, or for the reasons of `load_distribution`.
    TypeError
        If the folder is not a path, or `executor` no executor.
    KeyboardInterrupt
        If the searches were interrupted.
    ImportError
        If the extra "minari" is missing, before any search.
    """
    require("scenes", scenes, 1, whole=True)
    require("budget", budget, 1, whole=True)
    require("seed", seed, 0, whole=True)
    require("noise", noise, 0.0, 1.0)
    require_extra("a dataset", "minari", "pyarrow", "minari")
    require_executor(executor)
    root, source = as_path("folder", folder), load_distribution(distribution)
    require_writable(root)
    if (root / CARD).exists() or (root / EPISODES).exists():
        raise ValueError(f"{root} holds a dataset that is finished: name another folder")
    root.mkdir(parents=True, exist_ok=True)
    sampled_scenes = [
        source.sample(np.random.default_rng([seed, i]), f"{source.name}-{i}") for i in range(scenes)
    ]
    settings = {"distribution": source.to_toml(), "budget": budget, "seed": seed}
    study = open_store(root / STORE).begin("layouts", "dataset", settings)
    tasks = [
        Task(scene.to_toml(), "auto", seed, budget, labels={"scene": i})
        for i, scene in enumerate(sampled_scenes)
    ]
    experiment = run_experiment(tasks, executor, study, name="layouts", progress=progress)
    if experiment.interrupted:
        raise KeyboardInterrupt
    if failures := experiment.failures:
        raise ValueError(f"{len(failures)} of {scenes} searches failed: {failures[0].reason}")
    results = experiment.results
    # of these scenes in their order; a stopped call may have searched more
    write_table(root / LAYOUTS, [{"study": study.name} | result_cells(r) for r in results])
    partial = root / f"{EPISODES}.partial"
    shutil.rmtree(partial, ignore_errors=True)
    layouts = [result.layout for result in results]
    returns = write_episodes(partial, source, sampled_scenes, layouts, seed, noise)
    partial.rename(root / EPISODES)
    options = {"scenes": scenes, "seed": seed, "budget": budget, "noise": noise}
    write_text(root / CARD, _card(source, results, returns, options))
    return root / CARD


def _card(
    distribution: SceneDistribution,
    results: Sequence[TaskResult],
    returns: dict[str, float],
    options: dict[str, float],
) -> str:
    """Return the description of the dataset in Markdown."""
    gains = np.array([STOPPED_GAIN if result.gain is None else result.gain for result in results])
    layouts = {
        "uniform": "the uniform baseline",
        "noisy": "the searched layout, with normal noise of standard deviation "
        f"{options['noise']:g} on each action (from -1 to 1)",
        "searched": "the searched layout",
    }
    lines = [
        (f"`{distribution.name}/{quality}-v0`", layouts[quality], f"{mean:.2f}")
        for quality, mean in returns.items()
    ]
    words = (f" --{name} {value}" for name, value in options.items())
    command = f"domino dataset FOLDER --distribution {distribution.name}{''.join(words)}"
    return CARD_PAGE.read_text("utf-8").format(
        number=len(results), name=distribution.name, title=distribution.title,
        features=", ".join(distribution.features), budget=options["budget"], command=command,
        median=np.median(gains), tenth=np.quantile(gains, 0.1),
        table="\n".join(markdown_table(("episodes", "layout", "mean return"), lines)),
        versions=", ".join(f"{name} {number}" for name, number in versions().items()),
    )  # fmt: skip


def build_episode(
    env: DominoChainVector, scene: Scene, layout: Layout, noise: float, rng: np.random.Generator
) -> dict[str, list[Any]]:
    """Build a layout domino by domino with noise on each action, and record the episode.

    Parameters
    ----------
    env
        A vector environment with `num_envs=1`, for the distribution of the scene.
    scene
        The scene.
    layout
        The layout that the actions without noise build.
    noise
        Standard deviation of the noise on each action.
    rng
        Random number generator of the noise, and of what is random in the episode.

    Returns
    -------
    dict
        Lists "actions", "rewards", "terminations" and "truncations" with one entry per step, and
        "observations" with one more.
    """
    seed = int(rng.spawn(1)[0].integers(2**31))
    observation, _ = env.reset(seed=seed, options={"scene": scene})
    observations, records = [observation[0]], list[tuple[Any, ...]]()
    while not records or not records[-1][2]:  # terminated
        action = env.actions_towards(layout)[0]
        action = np.clip(action + noise * rng.standard_normal(action.shape), -1.0, 1.0)
        action = action.astype(np.float32)
        observation, *step, _ = env.step(action[None])
        observations.append(observation[0])
        records.append((action, *(values[0] for values in step)))
    names = ("actions", "rewards", "terminations", "truncations")
    steps = dict(zip(names, map(list, zip(*records, strict=True)), strict=True))
    return {"observations": observations, **steps}


def write_episodes(
    folder: Path,
    distribution: SceneDistribution,
    scenes: Sequence[Scene],
    layouts: Sequence[Layout],
    seed: int,
    noise: float,
) -> dict[str, float]:
    """Write a Minari dataset for each of `QUALITIES`; episode i builds a layout of scene i.

    The reference scores are the mean returns of the uniform baselines and of the searched layouts.

    Parameters
    ----------
    folder
        Value of `MINARI_DATASETS_PATH` for Minari; must not contain these datasets.
    distribution
        The scene distribution.
    scenes, layouts
        The scenes, and the best layout of a search in each.
    seed
        Seed of the noise.
    noise
        Standard deviation of the noise in the dataset "noisy", see `build_episode`.

    Returns
    -------
    dict
        Mean return of each quality.
    """
    from minari import create_dataset_from_buffers
    from minari.data_collector import EpisodeBuffer

    env = DominoChainVector(1, distribution)
    returns, episodes = dict[str, float](), dict[str, list[EpisodeBuffer]]()
    register()  # `domino dataset` does not register the environments otherwise
    single = gymnasium.make("DominoChain-v2", scene=distribution.name)
    for quality in QUALITIES:
        buffers = episodes[quality] = []
        for i, (scene, layout) in enumerate(zip(scenes, layouts, strict=True)):
            target = scene.uniform().layout if quality == "uniform" else layout
            deviation = noise if quality == "noisy" else 0.0
            rng = np.random.default_rng([seed, i])
            buffers.append(EpisodeBuffer(id=i, **build_episode(env, scene, target, deviation, rng)))
        returns[quality] = float(np.mean([np.sum(buffer.rewards) for buffer in buffers]))
    for quality, buffers in episodes.items():
        path = str(folder.resolve())  # Minari joins a relative path twice
        variables = mock.patch.dict(os.environ, MINARI_DATASETS_PATH=path)
        with variables, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about a missing URL
            create_dataset_from_buffers(
                f"{distribution.name}/{quality}-v0", buffers, env=single, data_format="arrow",
                algorithm_name=quality, author="domino-chains", description=distribution.title,
                eval_env=single, ref_min_score=returns["uniform"],
                ref_max_score=returns["searched"],
            )  # fmt: skip
    return returns
