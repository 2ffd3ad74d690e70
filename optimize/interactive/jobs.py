"""Searches whose layouts are shown while they run, and that can be stopped."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene
from optimize.evaluator import BudgetSpent, Evaluator
from optimize.methods.gradient.local_search import LocalSearch, run_local_searches
from optimize.searching import search

if TYPE_CHECKING:
    from optimize.methods.registry import Method

FRAME = 0.05  # [s] between two layouts that are shown
STEP = 0.01  # [s] of rest between two steps along the gradient, which are to be watched

Show = Callable[[Layout, float], None]
"""Function that shows a layout of a search and the part of the search that is done."""


def find(
    scene: Scene, method: str | Method, stopped: threading.Event, show: Show
) -> tuple[Layout, str]:
    """Search until the method is done or stopped, and return the best layout and a sentence.

    Parameters
    ----------
    scene, method
        See `search`.
    stopped
        Ends the search where it is set.
    show
        Called with the best layout so far, at most every `FRAME`.
    """
    last = 0.0

    def report(evaluator: Evaluator) -> None:
        nonlocal last
        if stopped.is_set():
            raise BudgetSpent("stopped; this is the best so far")
        if evaluator.finalists and time.perf_counter() > last + FRAME:
            last = time.perf_counter()
            show(evaluator.problem.layout(evaluator.best), evaluator.progress)

    result = search(scene, method, progress=False, callback=report)
    return result.layout, f"{result.evaluations} layouts in {result.seconds:.1f} s: {result.ended}"


def improvement(layout: Layout) -> Method:
    """Return the method that follows the gradient from a layout, slowly enough to be watched."""

    def improve(evaluator: Evaluator, _: np.random.Generator) -> None:
        problem = evaluator.problem
        project = problem.project if problem.coupled else None
        local = LocalSearch(problem.design(layout), project)
        while not local.done:
            run_local_searches(evaluator, [local], 1)
            time.sleep(STEP)
        hint = "; values of a list or a box do not follow the gradient: Search tries them"
        evaluator.status = "nothing nearby is better" + hint * problem.discrete

    return improve
