"""Searched rows: the best that search finds for each of many scenes, kept as they come."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

from domino_env import Scene
from optimize.studies import open_store
from optimize.studies.progress import TaskLines
from optimize.studies.running import run_tasks
from optimize.studies.task import Task, TaskResult

STUDY = "rows"  # in the store of a dataset


def search_rows(
    scenes: Sequence[Scene],
    evaluations: int,
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
    evaluations, seed
        Of each search.
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
    asked = {**settings, "evaluations": evaluations, "seed": seed}
    study = open_store(store).begin(STUDY, "dataset", asked)
    tasks = [
        Task.of(scene, "auto", seed, evaluations, labels=(("scene", i),))
        for i, scene in enumerate(scenes)
    ]
    lines = TaskLines(len(tasks), "rows", shown=progress)
    found: dict[str, TaskResult] = {}
    failures = run_tasks(
        tasks, executor, study, lambda task, row: found.update({task.key: row}), lines
    )
    if failures:
        raise ValueError(f"{len(failures)} searches failed, the first: {failures[0].reason}")
    return [found[task.key] for task in tasks]
