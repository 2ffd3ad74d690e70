"""Searches that show their best layouts while they run, and that can be stopped."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np

from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene
from optimize.evaluator import BudgetSpent, Evaluator
from optimize.methods.gradient.local_search import LocalSearch, run_local_searches
from optimize.methods.registry import Method
from optimize.searching import search

SHOW_INTERVAL = 0.05  # [s] between two layouts that are shown
STEP_PAUSE = 0.01  # [s] between two steps along the gradient, so that a user sees them

Show = Callable[[Layout, float], None]
"""Function that shows the best layout of a search and the completed fraction of the search."""


def run_search(
    scene: Scene, method: str | Method, stop: threading.Event, show: Show
) -> tuple[Layout, str]:
    """Search until the method ends or is stopped.

    Parameters
    ----------
    scene
        The scene.
    method
        Name of a search method, or a function, as for `search`.
    stop
        Event that ends the search when it is set.
    show
        Function that is called with the best layout so far, at most once per `SHOW_INTERVAL`.

    Returns
    -------
    layout : Layout
        Best layout.
    summary : str
        Number of layouts, time, and the reason why the search ended.
    """
    last_shown = 0.0

    def report(evaluator: Evaluator) -> None:
        nonlocal last_shown
        if stop.is_set():
            raise BudgetSpent("stopped; this is the best so far")
        if evaluator.finalists and time.perf_counter() > last_shown + SHOW_INTERVAL:
            last_shown = time.perf_counter()
            show(evaluator.problem.layout(evaluator.best), evaluator.progress)

    result = search(scene, method, progress=False, callback=report)
    effort = f"{result.evaluations} layouts in {result.seconds:.1f} s"
    return result.layout, f"{effort}: {result.stop_reason}"


def improvement_method(layout: Layout) -> Method:
    """Return a search method that follows the gradient from a layout, one step at a time."""

    def improve(evaluator: Evaluator, _: np.random.Generator) -> None:
        problem = evaluator.problem
        local = LocalSearch(problem.design(layout), problem.projection)
        while not local.done:
            run_local_searches(evaluator, [local], gradients=1)
            time.sleep(STEP_PAUSE)
        hint = "; values from a list or a stock have no gradient: use Search"
        evaluator.status = "nothing nearby is better" + hint * problem.discrete

    return improve
