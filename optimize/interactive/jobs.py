"""Searches in a process of their own, so that the page answers meanwhile.

``python -m optimize.interactive.jobs`` is that process: it reads pickled tasks from standard input,
and writes pickled layouts and messages to standard output.
"""

from __future__ import annotations

import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene
from optimize.evaluator import BudgetSpent, Evaluator
from optimize.searching import search

SHOW_INTERVAL = 0.1  # [s] between two layouts that are shown
PATIENCE, LEAST_GAIN = 2.0, 1e-4  # a search ends after this time [s] with less relative gain

Show = Callable[[Layout, float, str], None]
"""Function that shows the best layout of a search so far, its score and a message."""


Result = tuple[Layout | None, float, str]
"""Best layout of a search, its score and a message; see `SearchProcess.run`."""


class SearchProcess:
    """Process that searches, started at once so that the first search begins without delay."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "optimize.interactive.jobs"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip

    def run(self, scene: Scene, *, thorough: bool, show: Show) -> Result:
        """Search until the method ends, until it gains no more, or until `stop`.

        Parameters
        ----------
        scene
            The scene.
        thorough
            True for a search until its method ends; otherwise it also ends when `PATIENCE` seconds
            have gained less than `LEAST_GAIN`.
        show
            Function that is called with the best layout so far, at most once per `SHOW_INTERVAL`.

        Returns
        -------
        layout : Layout or None
            Best layout; None after an error.
        score : float
            Its score; 0 or less if no layout succeeds.
        message : str
            Number of layouts, time, and the reason why the search ended.
        """
        self._send((scene, thorough))
        while True:
            layout, score, message, is_done = self._receive()
            if is_done:
                return layout, score, message
            show(layout, score, message)

    def stop(self) -> None:
        """End the search with its best layout so far."""
        self._send(None)

    def close(self) -> None:
        """End the process."""
        with self._process:  # which also closes its pipes
            self._process.kill()

    def _send(self, message: Any) -> None:
        assert self._process.stdin
        with _errors_of_the_process():
            pickle.dump(message, self._process.stdin)
            self._process.stdin.flush()

    def _receive(self) -> tuple[Layout, float, str, bool]:
        assert self._process.stdout
        with _errors_of_the_process():
            received: tuple[Layout, float, str, bool] = pickle.load(self._process.stdout)
        return received


@contextmanager
def _errors_of_the_process() -> Iterator[None]:
    try:
        yield
    except (EOFError, OSError, ValueError):
        raise ValueError("the process of the search ended: reload the page") from None


def run_search(scene: Scene, stop: threading.Event, show: Show, *, thorough: bool) -> Result:
    """Search in this process; see `SearchProcess.run`."""
    last_shown, first, reason = 0.0, time.perf_counter(), ""
    scores: list[tuple[float, float]] = []  # time [s], best score

    def report(evaluator: Evaluator) -> None:
        nonlocal last_shown, reason
        now = time.perf_counter()
        if stop.is_set():
            raise BudgetSpent("stopped; this is the best so far")
        if not evaluator.finalists or now < last_shown + SHOW_INTERVAL:
            return
        last_shown, best = now, evaluator.finalists[-1][0]
        scores.append((now, best))
        while scores[0][0] < now - PATIENCE and len(scores) > 1:
            del scores[0]
        is_late = now > first + PATIENCE and scores[0][0] < now - 0.9 * PATIENCE
        if not thorough and is_late and best > 0.0 and best - scores[0][1] < LEAST_GAIN * best:
            reason = f"the last {PATIENCE:g} s gained less than {LEAST_GAIN:.2%}"
            raise BudgetSpent(reason)
        show(
            evaluator.problem.layout(evaluator.best),
            best,
            f"{evaluator.evaluations:,} layouts tried",
        )

    result = search(scene, progress=False, callback=report)
    effort = f"best of {result.evaluations:,} layouts in {result.seconds:.1f} s"
    message = f"{effort}: {reason or result.stop_reason}"
    return result.layout, result.score, message


def main() -> None:
    """Run the tasks from standard input, and write their results to standard output."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the server, which ends this process
    output, sys.stdout = sys.stdout.buffer, sys.stderr
    stop = threading.Event()

    def write(*values: Any, is_done: bool = False) -> None:
        pickle.dump((*values, is_done), output)
        output.flush()

    def run(scene: Scene, thorough: bool) -> None:
        try:
            result = run_search(scene, stop, write, thorough=thorough)
        except (ValueError, ArithmeticError) as error:
            result = None, 0.0, str(error)
        write(*result, is_done=True)

    with suppress(EOFError):
        while True:
            task = pickle.load(sys.stdin.buffer)
            if task is None:
                stop.set()
            else:
                stop.clear()
                threading.Thread(target=run, args=task, daemon=True).start()


if __name__ == "__main__":
    main()
