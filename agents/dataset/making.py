"""A whole dataset in a folder: searched rows as Parquet, episodes, and a card."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from concurrent.futures import Executor
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from agents.dataset.episodes import NOISE, QUALITIES, write_episodes
from agents.dataset.rows import STUDY, search_rows
from domino_env import Scene
from domino_env.core.files import require_none, write_text
from domino_env.core.results import versions
from domino_env.core.tables import markdown_table
from domino_env.scenes.distribution import SceneDistribution, load_distribution
from optimize.studies import open_store
from optimize.studies.export import export_study
from optimize.studies.task import TaskResult, layout_of

STORE, ROWS, EPISODES, CARD = "rows.sqlite", "rows.parquet", "episodes", "README.md"
SCENES, EVALUATIONS = 5000, 600


def make_dataset(
    folder: str | Path,
    distribution: str | Path = "varied",
    scenes: int = SCENES,
    seed: int = 0,
    evaluations: int = EVALUATIONS,
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
    evaluations
        Of each search.
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
    if scenes < 1 or evaluations < 1 or seed < 0 or not 0.0 <= noise <= 1.0:
        raise ValueError(
            f"scenes = {scenes}, evaluations = {evaluations}, seed = {seed}, noise = {noise}: give "
            "1 or more scenes and evaluations, a seed of 0 or more, and noise from 0 to 1"
        )
    for package in ("pyarrow", "minari"):
        if find_spec(package) is None:
            raise ImportError(
                f"a dataset needs {package}, of the extra 'minari': pip install "
                '"domino-chains[minari]"'
            )
    home, drawn = Path(folder), load_distribution(distribution)
    require_none(home, (CARD, EPISODES))
    home.mkdir(parents=True, exist_ok=True)
    chosen = [draw(drawn, seed, i) for i in range(scenes)]
    settings = {"distribution": drawn.name, "ranges": repr(drawn.ranges)}
    found = search_rows(
        chosen, evaluations, seed, home / STORE, settings, executor, progress=progress
    )
    export_study(open_store(home / STORE).study(STUDY), home / ROWS)
    rows = [layout_of(scene, row) for scene, row in zip(chosen, found, strict=True)]
    partial = home / f"{EPISODES}.partial"
    shutil.rmtree(partial, ignore_errors=True)
    returns = write_episodes(partial, drawn, chosen, rows, seed, noise)
    partial.rename(home / EPISODES)
    write_text(home / CARD, _card(drawn, found, returns, seed, evaluations, noise))
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
    evaluations: int,
    noise: float,
) -> str:
    """Say what the dataset is, with what stands in it."""
    gains = np.array([row.score / row.uniform_score - 1.0 for row in found])
    table = markdown_table(
        ("episodes", "how they are built", "mean return"),
        [
            (f"`{drawn.name}/{quality}-v0`", how, f"{returns[quality]:.2f}")
            for quality, how in zip(
                QUALITIES,
                (
                    "the best uniform row",
                    f"the searched row, normal noise of {noise:g} on each action (from -1 to 1)",
                    "the searched row",
                ),
                strict=True,
            )
        ],
    )
    lines = [
        f"# {len(found)} scenes of `{drawn.name}`, with searched rows and episodes",
        "",
        f"{drawn.title}. Drawn: {', '.join(drawn.features)}.",
        "",
        f"`{ROWS}` has a line for each scene: `scene` is its text as a file of domino-chains, "
        "`spacing` and `thickness` the best row that `auto` found in "
        f"{evaluations} evaluations [m], `score` its mean speed and `uniform_score` that of the "
        "best uniform row [m/s]. The column `label.scene` numbers the scenes; the lines stand in "
        "the order in which the searches ended.",
        "",
        f"The rows gain {np.median(gains):.2%} over the best uniform one in the median, "
        f"{np.quantile(gains, 0.1):.2%} in the tenth percentile. They are what a short search "
        "finds, not the best there is.",
        "",
        f"`{EPISODES}/` holds the same scenes as episodes of `DominoChain-v0` in Minari's format, "
        "episode i being that of scene i (`MINARI_DATASETS_PATH`). A return is a hundred times "
        "the gain over the best uniform row, to rounding of single precision.",
        "",
        *table,
        "",
        "Made by",
        "",
        f"    domino dataset FOLDER --of {drawn.name} --scenes {len(found)} --seed {seed} "
        f"--search {evaluations} --noise {noise:g}",
        "",
        "with " + ", ".join(f"{name} {number}" for name, number in versions().items()) + ".",
    ]
    return "\n".join(lines) + "\n"
