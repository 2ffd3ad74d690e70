"""Searches from a layout that show how they climb and can be stopped."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene
from optimize.evaluator import BudgetSpent, Evaluator
from optimize.methods.gradient.local_search import LocalSearch
from optimize.problem import Problem
from optimize.searching import search

FRAME = 0.05  # [s] between two layouts that are shown

Show = Callable[[Layout, float], None]
"""Function that shows a layout of a search and the part of the search that is done."""
Work = Callable[[Scene, Layout, threading.Event, Show], tuple[Layout, str]]
"""Search from a layout, as `improve` and `find`."""


def improve(
    scene: Scene, layout: Layout, stopped: threading.Event, show: Show
) -> tuple[Layout, str]:
    """Search locally along the gradient, and return the best layout and a sentence.

    Parameters
    ----------
    scene, layout
        The scene, and the layout to begin at.
    stopped
        Ends the search where it is set.
    show
        Called with every better layout.
    """
    problem = Problem(scene)
    local = LocalSearch(problem.design(layout), problem.project if problem.coupled else None)
    best = -float("inf")
    while not local.done and not stopped.is_set():
        answer = problem.evaluate(local.wanted, gradient=True)
        local.update(answer.score, answer.gradient)
        if local.score > best:
            best = local.score
            show(problem.layout(local.design), 0.0)
            time.sleep(FRAME)
    words = "nothing nearby is better" if local.done else "stopped"
    if problem.discrete:
        words += "; values of a list or a box do not follow the gradient: Search tries them"
    return problem.layout(local.design), f"improved {local.evaluations} times: {words}"


def find(scene: Scene, layout: Layout, stopped: threading.Event, show: Show) -> tuple[Layout, str]:
    """Search by `auto` until it is done or stopped; arguments and result as of `improve`."""
    shown = 0.0

    def report(evaluator: Evaluator) -> None:
        nonlocal shown
        if stopped.is_set():
            raise BudgetSpent("stopped; this is the best so far")
        if evaluator.finalists and time.perf_counter() > shown + FRAME:
            shown = time.perf_counter()
            show(evaluator.problem.layout(evaluator.best), evaluator.progress)

    result = search(scene, progress=False, callback=report)
    return result.layout, f"{result.evaluations} layouts in {result.seconds:.1f} s: {result.ended}"
