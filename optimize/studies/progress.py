"""Lines on the terminal about many tasks: how many are done, how long the rest may take."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from optimize.studies.task import Task, TaskResult

FORMAT = "{desc} {percentage:3.0f}%|{bar}| {elapsed}, about {remaining} left{postfix}"


class TaskLines:
    """Progress of many tasks on standard error, for use as a context.

    Parameters
    ----------
    total
        How many there are.
    name
        What they are called together.
    shown
        Whether a line moves on a terminal; None: where standard error is one.
    plain
        Where none does, whether each finished task leaves a line.
    """

    def __init__(
        self, total: int, name: str, *, shown: bool | None = None, plain: bool = False
    ) -> None:
        self.total, self.name = total, name
        self.shown = sys.stderr.isatty() if shown is None else shown
        self._plain = plain and not self.shown
        self._done = self._kept = 0
        self._parts: dict[str, float] = {}  # of running tasks, by key
        self._line: Any = None
        self._began = time.monotonic()

    def __enter__(self) -> TaskLines:
        return self

    def __exit__(self, *_: object) -> None:
        if self._line is not None:
            self._line.close()

    def begin(self, kept: int) -> None:
        """Begin, with so many tasks done already."""
        self._done = self._kept = kept
        self._began = time.monotonic()
        if self.shown:
            from tqdm import tqdm

            self._line = tqdm(
                total=self.total, initial=kept, bar_format=FORMAT, smoothing=0.0, leave=False,
                dynamic_ncols=True, desc=self._counted(),
            )  # fmt: skip

    @property
    def seconds_left(self) -> float | None:
        """Time that the rest may take at the pace so far [s]; None before anything is known."""
        done = self._done - self._kept + sum(self._parts.values())
        if done <= 0.0:
            return None
        rest = self.total - self._kept - done
        return (time.monotonic() - self._began) * rest / done

    def running(self, task: Task, part: float, score: float) -> None:
        """Show that a task has come so far, 0 to 1, with this best score."""
        self._parts[task.key] = part
        best = f": best {score:.5f}" if score > 0.0 else ""
        self._show(f"; {task.name}{best}")

    def finished(self, task: Task, result: TaskResult) -> None:
        """Show that a task is done."""
        self._end(task)
        gain = "" if result.gain is None else f", {result.gain:+.2%}"
        if self._plain:
            self._print(f"{task.name}: {result.score:.6f}{gain}")

    def failed(self, task: Task, reason: str) -> None:
        """Show that a task has no result."""
        self._end(task)
        self._print(f"{task.name}: failed: {reason}")

    def tick(self) -> None:
        """Show the time that has passed."""
        self._show()

    @contextmanager
    def aside(self) -> Iterator[None]:
        """Make room while something else is printed."""
        if self._line is None:
            yield
        else:
            with self._line.external_write_mode():
                yield

    def _show(self, of_one: str | None = None) -> None:
        if self._line is None:
            return
        self._line.n = self._done + sum(self._parts.values())
        self._line.set_description_str(self._counted(), refresh=False)
        if of_one is not None:
            self._line.set_postfix_str(of_one, refresh=False)
        self._line.refresh()

    def _counted(self) -> str:
        return f"{self.name}, {self._done} of {self.total}"

    def _end(self, task: Task) -> None:
        self._done += 1
        self._parts.pop(task.key, None)
        self._show()

    def _print(self, text: str) -> None:
        left = self.seconds_left
        rest = "" if not self._plain or left is None else f" (about {in_words(left)} left)"
        with self.aside():
            print(f"{self._done}/{self.total} {text}{rest}", file=sys.stderr, flush=True)


def in_words(seconds: float) -> str:
    """Say a time in its best unit."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if seconds < 90.0 * 60.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"
