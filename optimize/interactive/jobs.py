"""Searches in a process of their own, so that the page stays responsive.

``python -m optimize.interactive.jobs`` is that process: it reads pickled tasks from standard input,
and writes pickled layouts and messages to standard output.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
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
    """Process that searches; it is started before the first search, which then has no delay."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> subprocess.Popen[bytes]:
        """Return the process, a new one if there is none or if the last one has ended."""
        if self._process is None or self._process.poll() is not None:
            self._process = subprocess.Popen(
                # not from the working directory, which may contain modules of these names
                [sys.executable, "-P", "-m", "optimize.interactive.jobs"],
                env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            )  # fmt: skip
        return self._process

    def run(self, scene: Scene, *, thorough: bool, show: Show) -> Result:
        """Search until the method ends, until it gains no more, or until the process ends.

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
        process = self.start()
        assert process.stdin
        assert process.stdout
        try:
            pickle.dump((scene, thorough), process.stdin)
            process.stdin.flush()
            while True:
                layout, score, message, is_done = pickle.load(process.stdout)
                if is_done:
                    return layout, score, message
                show(layout, score, message)
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):
            return None, 0.0, "the process of the search ended: try again"

    def close(self) -> None:
        """End the process, and with it a search."""
        if self._process is not None:
            process, self._process = self._process, None
            with suppress(OSError), process:  # which also closes its pipes
                process.kill()


def run_search(scene: Scene, show: Show, *, thorough: bool) -> Result:
    """Search in this process; see `SearchProcess.run`."""
    last_shown, reason = 0.0, ""
    scores: list[tuple[float, float]] = []  # time [s], best score

    def report(evaluator: Evaluator) -> None:
        nonlocal last_shown, reason
        now = time.perf_counter()
        if not evaluator.finalists or now < last_shown + SHOW_INTERVAL:
            return
        last_shown, best = now, evaluator.finalists[-1][0]
        scores.append((now, best))
        while len(scores) > 1 and scores[1][0] <= now - PATIENCE:
            del scores[0]
        time_before, before = scores[0]
        is_late = time_before <= now - PATIENCE
        if not thorough and is_late and best > 0.0 and best - before < LEAST_GAIN * best:
            reason = f"the last {PATIENCE:g} s gained less than {LEAST_GAIN:.2%}"
            raise BudgetSpent(reason)
        show(evaluator.problem.layout(evaluator.best), best, f"{evaluator.evaluations:,} layouts")

    result = search(scene, progress=False, callback=report)
    effort = f"best of {result.evaluations:,} layouts in {result.seconds:.1f} s"
    message = f"{effort}: {reason or result.stop_reason}"
    return result.layout, result.score, message


def main() -> None:
    """Run the tasks from standard input, and write their results to standard output."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the server, which ends this process
    output, sys.stdout = sys.stdout.buffer, sys.stderr

    def write(*values: Any, is_done: bool = False) -> None:
        pickle.dump((*values, is_done), output)
        output.flush()

    with suppress(EOFError):
        while True:
            scene, thorough = pickle.load(sys.stdin.buffer)
            try:
                result: Result = run_search(scene, write, thorough=thorough)
            except Exception as error:  # the page waits for an answer
                result = None, 0.0, str(error) or type(error).__name__
            write(*result, is_done=True)


if __name__ == "__main__":
    main()
