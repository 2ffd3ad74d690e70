"""Work in the background of a page, and the newest of many values."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene
from optimize.evaluator import BudgetSpent, Evaluator
from optimize.methods.gradient.local_search import LocalSearch
from optimize.problem import Problem
from optimize.searching import search

AT_ONCE = 0.1  # [s] that a page waits for a result before it goes on without
FRAME = 0.05  # [s] between two layouts that are shown
NONE = object()

Schedule = Callable[[Callable[[], None]], object]
"""Function that runs another one in the thread of the page, soon."""
Show = Callable[[tuple[Layout, float]], None]
"""Function that shows a layout of a search and the part of the search that is done."""
Work = Callable[[Scene, Layout, threading.Event, Show], tuple[Layout, str]]
"""Search from a layout, as `improve` and `find`."""


class Latest:
    """Calls a function with the newest value; values that were overtaken are dropped.

    Parameters
    ----------
    schedule
        Function that runs another one in the thread of the page, soon.
    use
        Function of a value, called in that thread.
    """

    def __init__(self, schedule: Schedule, use: Callable[[Any], None]) -> None:
        self._schedule, self._use = schedule, use
        self._lock = threading.Lock()
        self._value: Any = NONE

    def __call__(self, value: Any) -> None:
        """Replace the value that waits, if there is one."""
        with self._lock:
            waits, self._value = self._value is not NONE, value
        if not waits:
            self._schedule(self.flush)

    def flush(self) -> None:
        """Use the value that waits, if there is one, now."""
        with self._lock:
            value, self._value = self._value, NONE
        if value is not NONE:
            self._use(value)


def run_later(work: Callable[[], Any], use: Callable[[Any], None], schedule: Schedule) -> None:
    """Call `use` with the result of work, at once or, where it takes longer, in the background.

    An error is passed on as a result.
    """
    done, found = threading.Event(), [None]

    def run() -> None:
        try:
            found[0] = work()
        except (ValueError, ArithmeticError) as error:
            found[0] = error  # type: ignore[call-overload]
        done.set()
        if late.is_set():
            schedule(lambda: use(found[0]))

    late = threading.Event()
    threading.Thread(target=run, daemon=True).start()
    if done.wait(AT_ONCE):
        use(found[0])
        return
    late.set()


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
    start = problem.design(layout)
    local = LocalSearch(start, problem.project if problem.coupled else None)
    best = -float("inf")
    while not local.done and not stopped.is_set():
        answer = problem.evaluate(local.wanted, gradient=True)
        local.update(answer.score, answer.gradient)
        if local.score > best:
            best = local.score
            show((problem.layout(local.design), 0.0))
            time.sleep(FRAME)
    words = "nothing nearby is better" if local.done else "stopped"
    if problem.discrete:
        words += "; values of a list or a box do not follow the gradient: Search tries them"
    return problem.layout(local.design), f"improved {local.evaluations} times: {words}"


def find(scene: Scene, layout: Layout, stopped: threading.Event, show: Show) -> tuple[Layout, str]:
    """Search by `auto` until it is done or stopped; arguments and result as of `improve`."""
    shown = [0.0]

    def report(evaluator: Evaluator) -> None:
        if stopped.is_set():
            raise BudgetSpent("stopped; this is the best so far")
        if evaluator.finalists and time.perf_counter() > shown[0] + FRAME:
            shown[0] = time.perf_counter()
            show((evaluator.problem.layout(evaluator.best), evaluator.progress))

    result = search(scene, progress=False, callback=report)
    return result.layout, f"{result.evaluations} layouts in {result.seconds:.1f} s: {result.ended}"
