"""Datasets: scenes with the layouts that search found for them, and episodes that build these.

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
from importlib.util import find_spec
from pathlib import Path
from typing import Any
from unittest import mock

import gymnasium
import numpy as np

from domino_env import DominoChainVector, Layout, Scene, SceneDistribution
from domino_env.core.checks import require
from domino_env.core.files import require_unused, write_text
from domino_env.core.results import versions
from domino_env.core.tables import markdown_table
from domino_env.scenes.distribution import load_distribution
from optimize.experiments.runner import run_experiment
from optimize.experiments.store import export_study, open_store
from optimize.experiments.task import Task, TaskResult

STORE, ROWS, EPISODES, CARD = "rows.sqlite", "rows.parquet", "episodes", "README.md"
SCENES, EVALUATIONS = 5000, 600
QUALITIES = ("uniform", "noisy", "searched")
NOISE = 0.1  # standard deviation of the actions of "noisy" rows, of which each is from -1 to 1
STUDY = "rows"  # in the store of a dataset
CARD_TEXT = """# {number} scenes of `{name}`, with searched layouts and episodes

{title}. Sampled: {features}.

`rows.parquet` has one line per scene, in the order in which the searches ended: `scene` is its text
as a file of domino-chains, `spacing` and `thickness` the best layout that `auto` found in
{budget} evaluations [m], `score` its mean speed and `uniform_score` that of the best uniform
layout [m/s], `label.scene` the number of the scene. The layouts gain {median:.2%} over the best
uniform one in the median, {tenth:.2%} in the tenth percentile; longer searches find more.

`episodes/` holds the same scenes as episodes of `DominoChain-v0` in Minari's format, episode i
being that of scene i (`MINARI_DATASETS_PATH`). A return is a hundred times the gain over the best
uniform layout, to rounding of single precision.

{table}

Made by

    {command}

with {versions}.
"""


def make_dataset(
    folder: str | Path,
    distribution: str | Path = "varied",
    scenes: int = SCENES,
    seed: int = 0,
    budget: int = EVALUATIONS,
    executor: Executor | None = None,
    *,
    noise: float = NOISE,
    progress: bool | None = False,
) -> Path:
    """Draw scenes, search a row for each, build episodes of them, and write it all down.

    What was searched is kept at once: the same call goes on where one was stopped. Scene i does not
    depend on how many there are.

    Parameters
    ----------
    folder
        Where all of it is written.
    distribution
        What scenes are drawn from: the name of one that ships, or a file.
    scenes
        How many.
    seed
        Of the draws, the searches and the noise.
    budget
        Number of evaluations of each search.
    executor
        Who searches; None: this process.
    noise
        Of the actions of the noisy episodes, each from -1 to 1: a standard deviation.
    progress
        Whether to show how far it is; None: on a terminal.

    Returns
    -------
    Path
        The card.

    Raises
    ------
    ValueError
        For numbers that make no sense, and a folder that holds another dataset.
    ImportError
        Where the extra "minari" is missing, before anything is searched.
    """
    require("scenes", scenes, 1, whole=True)
    require("budget", budget, 1, whole=True)
    require("seed", seed, 0, whole=True)
    require("noise", noise, 0.0, 1.0)
    for package in ("pyarrow", "minari"):
        if find_spec(package) is None:
            raise ImportError(
                f"a dataset needs {package}, of the extra 'minari': pip install "
                '"domino-chains[minari]"'
            )
    home, drawn = Path(folder), load_distribution(distribution)
    require_unused(home, (CARD, EPISODES))
    home.mkdir(parents=True, exist_ok=True)
    chosen = [draw(drawn, seed, i) for i in range(scenes)]
    settings = {"distribution": drawn.name, "ranges": repr(drawn.ranges)}
    found = search_rows(chosen, budget, seed, home / STORE, settings, executor, progress=progress)
    export_study(open_store(home / STORE).study(STUDY), home / ROWS)
    rows = [row.layout for row in found]
    partial = home / f"{EPISODES}.partial"
    shutil.rmtree(partial, ignore_errors=True)
    returns = write_episodes(partial, drawn, chosen, rows, seed, noise)
    partial.rename(home / EPISODES)
    write_text(home / CARD, _card(drawn, found, returns, seed, budget, noise))
    return home / CARD


def draw(distribution: SceneDistribution, seed: int, number: int) -> Scene:
    """Draw the scene of a number in the dataset of a seed."""
    rng = np.random.default_rng([seed, number])
    return distribution.sample(rng, f"{distribution.name}-{number}")


def _card(
    drawn: SceneDistribution,
    found: Sequence[TaskResult],
    returns: dict[str, float],
    seed: int,
    budget: int,
    noise: float,
) -> str:
    """Describe the dataset in Markdown."""
    gains = np.array([row.score / row.uniform_score - 1.0 for row in found])
    built = (
        "the best uniform row",
        f"the searched row, normal noise of {noise:g} on each action (from -1 to 1)",
        "the searched row",
    )
    table = markdown_table(
        ("episodes", "how they are built", "mean return"),
        [
            (f"`{drawn.name}/{quality}-v0`", how, f"{returns[quality]:.2f}")
            for quality, how in zip(QUALITIES, built, strict=True)
        ],
    )
    command = (
        f"domino dataset FOLDER --distribution {drawn.name} --scenes {len(found)} --seed {seed} "
        f"--budget {budget} --noise {noise:g}"
    )
    return CARD_TEXT.format(
        number=len(found), name=drawn.name, title=drawn.title, features=", ".join(drawn.features),
        budget=budget, median=np.median(gains), tenth=np.quantile(gains, 0.1),
        table="\n".join(table), command=command,
        versions=", ".join(f"{name} {number}" for name, number in versions().items()),
    )  # fmt: skip


def search_rows(
    scenes: Sequence[Scene],
    budget: int,
    seed: int,
    store: Path,
    settings: dict[str, Any],
    executor: Executor | None = None,
    *,
    progress: bool | None = False,
) -> list[TaskResult]:
    """Search a row for each scene, with `auto`; what the store has is not searched again.

    Parameters
    ----------
    scenes
        All different; a store that was begun with fewer of them goes on with more.
    budget, seed
        Number of evaluations and seed of each search.
    store
        SQLite file, begun where there is none.
    settings
        What decides the scenes but for their number, as JSON can say it.
    executor
        Who searches; None: this process.
    progress
        Whether to show how far it is; None: on a terminal.

    Returns
    -------
    list of TaskResult
        One for each scene, in their order; the label "scene" is its number.

    Raises
    ------
    ValueError
        For a store with rows of other settings, and where a search failed.
    """
    asked = {**settings, "budget": budget, "seed": seed}
    study = open_store(store).begin(STUDY, "dataset", asked)
    tasks = [
        Task(scene.to_toml(), "auto", seed, budget, labels={"scene": i})
        for i, scene in enumerate(scenes)
    ]
    done = run_experiment(tasks, executor, study, name="layouts", progress=progress)
    if done.interrupted:
        raise KeyboardInterrupt
    if failed := done.failures:
        raise ValueError(f"{len(failed)} searches failed, the first: {failed[0].reason}")
    return list(done.results)


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
        home = str(folder.resolve())  # Minari repeats what is relative
        environment = mock.patch.dict(os.environ, MINARI_DATASETS_PATH=home)
        with environment, warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # no e-mail address is known
            create_dataset_from_buffers(
                f"{distribution.name}/{quality}-v0", buffers, env=made, data_format="arrow",
                algorithm_name=quality, author="domino-chains", description=distribution.title,
            )  # fmt: skip
    return returns
