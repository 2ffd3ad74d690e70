"""Searches in a process of their own, so that the page stays responsive."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import NamedTuple

from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene
from optimize.evaluator import BudgetSpent, Evaluator
from optimize.executors import without_ctrl_c
from optimize.searching import search

SHOW_INTERVAL = 0.1  # [s] between two layouts that are shown
PATIENCE, LEAST_GAIN = 2.0, 1e-4  # a search ends after this time [s] with less relative gain
CONTEXT = get_context("spawn")


class Found(NamedTuple):
    """Best layout of a search so far.

    Attributes
    ----------
    layout
        The layout; None after an error.
    score
        Its score; 0 or less if no layout succeeds.
    text
        Number of layouts; at the end also time, and the reason why the search ended.
    is_done
        True at the end of the search.
    """

    layout: Layout | None
    score: float
    text: str
    is_done: bool = False


class SearchProcess:
    """Process for one search; it starts before the search, which then has no delay."""

    def __init__(self) -> None:
        self._pipe, pipe = CONTEXT.Pipe()
        self._process = CONTEXT.Process(target=_run, args=(pipe,), daemon=True)
        with without_ctrl_c():  # which ends the server, and that this process
            self._process.start()
        pipe.close()

    def run(self, scene: Scene, *, thorough: bool) -> Iterator[Found]:
        """Search, and yield the best layouts until the search or its process ends.

        Parameters
        ----------
        scene
            The scene.
        thorough
            True for a search until its method ends; otherwise it also ends when `PATIENCE` seconds
            have gained less than `LEAST_GAIN`.
        """
        try:
            self._pipe.send((scene, thorough))
            yield from iter(self._pipe.recv, None)
        except (EOFError, OSError):
            yield Found(None, 0.0, "the process of the search has ended: try again", is_done=True)

    def close(self) -> None:
        """End the process, and with it a search."""
        self._process.kill()


def run_search(scene: Scene, show: Callable[[Found], None], *, thorough: bool) -> None:
    """Search in this process, and call a function with the layouts of `SearchProcess.run`."""
    last_shown = last_gain = time.perf_counter()
    base, reason = 0.0, ""  # score after the last gain

    def report(evaluator: Evaluator) -> None:
        nonlocal last_shown, last_gain, base, reason
        now, score = time.perf_counter(), evaluator.best_score
        if not evaluator.finalists or now < last_shown + SHOW_INTERVAL:
            return
        last_shown = now
        if score <= 0.0 or score > base * (1.0 + LEAST_GAIN):
            last_gain, base = now, score
        elif not thorough and now > last_gain + PATIENCE:
            reason = f"the last {PATIENCE:g} s gained less than {LEAST_GAIN:.2%}"
            raise BudgetSpent(reason)
        layout = evaluator.problem.layout(evaluator.best)
        show(Found(layout, score, f"{evaluator.evaluations:,} layouts"))

    result = search(scene, progress=False, callback=report)
    text = f"best of {result.evaluations:,} layouts in {result.seconds:.1f} s: "
    show(Found(result.layout, result.score, text + (reason or result.stop_reason), is_done=True))


def _run(pipe: Connection) -> None:
    """Wait for a search, and send its layouts."""
    with suppress(EOFError, OSError):  # the server has ended
        scene, thorough = pipe.recv()
        try:
            run_search(scene, pipe.send, thorough=thorough)
        except Exception as error:  # the page waits for an answer
            pipe.send(Found(None, 0.0, str(error) or type(error).__name__, is_done=True))
        pipe.send(None)
