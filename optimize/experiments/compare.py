"""compare(): methods against the uniform baseline and each other, with equal budgets."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from optimize.experiments.best_known import best_known
from optimize.experiments.experiment import Experiment, run_experiment
from optimize.experiments.task import Task, TaskResult, scene_of
from optimize.methods.registry import importable_name

if TYPE_CHECKING:
    from optimize.methods.registry import Method


def compare(
    scenes: Sequence[Scene | str],
    methods: Sequence[str | Method],
    seeds: Iterable[int],
    seconds: float | None = None,
    *,
    budget: int | None = None,
    **how: Any,
) -> Experiment:
    """Run every method on every scene with every seed, each with the same budget.

    Ctrl-C ends the comparison with the runs that are complete; before the first of them it is
    raised.

    Parameters
    ----------
    scenes
        Scenes, or their names.
    methods
        Names of methods, also "package.module:function", or functions `run(evaluator, rng)` that
        other processes can import.
    seeds
        Each method runs on each scene with each of them.
    seconds
        Budget of each run, unless `budget` is given. Equal seconds are equal chances only
        where every run has a core for itself: an executor must have no more workers than its
        machines have cores.
    budget
        Number of evaluations of each run, which makes the comparison bitwise reproducible.
    how
        `executor`, `study`, `callback`, `progress`: as of `run_tasks`.

    Raises
    ------
    ValueError
        For what is given twice or not at all, and where no run has a result; a run that fails
        beside others is one of the `failures`.
    """
    tasks = comparison_tasks(scenes, methods, seeds, seconds, budget)
    return run_experiment(tasks, known=known_score, **how)


def comparison_tasks(
    scenes: Sequence[Scene | str],
    methods: Sequence[str | Method],
    seeds: Iterable[int],
    seconds: float | None,
    budget: int | None,
) -> list[Task]:
    """Return the runs of a comparison, in order; see `compare`."""
    if (seconds is None) == (budget is None):
        raise ValueError("give each run seconds or a budget, one of the two")
    seeds, chosen = list(seeds), [importable_name(method) for method in methods]
    require_each_once(scenes=scenes, methods=chosen, seeds=seeds)
    loaded = [scene if isinstance(scene, Scene) else load_scene(scene) for scene in scenes]
    # seeds outermost: what else the machine does then affects all methods alike
    return [
        Task.of(scene, method, seed, budget, seconds)
        for scene in loaded
        for seed in seeds
        for method in chosen
    ]


def require_each_once(**lists: Sequence[object]) -> None:
    """Check that lists are not empty and have each entry once."""
    for name, values in lists.items():
        if not values:
            raise ValueError(f"{name} is empty: give at least one")
        if len(set(values)) < len(values):
            raise ValueError(f"{name} = {', '.join(map(str, values))}: give each once")


def known_score(result: TaskResult) -> float:
    """Return the score of the best known layout of a result's scene; -inf where there is none."""
    scene, known = scene_of(result.scene), best_known().get(result.scene_name)
    # a scene of the same name may be another one: the layout must be within its rules
    if known is None or scene.violations(known.layout):
        return -np.inf
    return float(scene.score(known.layout))
