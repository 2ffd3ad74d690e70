"""search(): one method on one scene under one budget."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from domino_env.scene import Scene, load_scene
from optimize import methods
from optimize.budget import Budget, BudgetSpent
from optimize.problem import Problem
from optimize.result import SearchResult

DEFAULT_BUDGET = 20_000  # evaluations, where nothing is said


def search(
    scene: Scene | str | Path,
    method: str = "cma",
    budget: int | None = None,
    seed: int = 0,
    *,
    seconds: float | None = None,
    watch: Callable[[Budget], None] | None = None,
) -> SearchResult:
    """Search a layout of a scene that beats the best uniform pitch.

    scene: a scene, its name, or the path of its file.
    method: one of `METHODS`.
    budget: layouts that may be simulated; 20 000 where neither budget nor seconds is given.
    seed: of all randomness; the same seed and budget of evaluations give the same result to the
        bit (a budget of seconds cannot).
    seconds: time that may be spent, not counting the search of the uniform pitch.
    watch: called with the Budget after every batch.

    Ctrl-C ends the search with the best so far.  Raises ValueError for an unknown method or scene,
    a budget that is not positive, or a scene that leaves nothing free.
    """
    if not isinstance(scene, Scene):
        scene = load_scene(scene)
    run = methods.load(method)
    if budget is None and seconds is None:
        budget = DEFAULT_BUDGET
    if budget is not None and budget < 1:
        raise ValueError(f"budget = {budget}: give at least one evaluation")
    if seconds is not None and not seconds > 0.0:
        raise ValueError(f"seconds = {seconds}: give a time of more than 0 s")
    problem = Problem(scene)
    uniform = scene.uniform()
    problem.score(problem.design(uniform.layout)[None])  # compiles what is not compiled yet
    problem.evaluations = problem.falls = 0
    meter = Budget(problem, budget, seconds, watch)
    interrupted = False
    try:
        run(meter, np.random.default_rng(seed))
    except BudgetSpent:
        pass
    except KeyboardInterrupt:
        interrupted = True
    spent = meter.elapsed
    layout = uniform.layout if meter.best is None else problem.layout(meter.best)
    wave = scene.simulate(layout)
    return SearchResult(
        scene=scene,
        method=method,
        seed=seed,
        layout=layout,
        wave=wave,
        score=scene.score_wave(wave),
        uniform=uniform,
        trace=tuple(meter.trace),
        evaluations=problem.evaluations,
        falls=problem.falls,
        seconds=spent,
        interrupted=interrupted,
    )
