"""What is seen of many tasks: how many are done, how long the rest may take, a line a search."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from optimize.task import Task, TaskResult

ALL = "{desc} {percentage:3.0f}%|{bar}| {elapsed}, about {remaining} left"
ONE = "  {desc} {percentage:3.0f}%|{bar:20}|{postfix}"
MOST_LINES = 16  # searches shown at a time


class TaskLines:
    """Progress of many tasks on standard error, for use as a context.

    total: how many there are.  name: what they are called together.
    shown: whether lines move on a terminal; None: where standard error is one.
    plain: where they do not, whether each finished task leaves a line.
    """

    def __init__(
        self, total: int, name: str, *, shown: bool | None = None, plain: bool = False
    ) -> None:
        self.total, self.name = total, name
        self.shown = sys.stderr.isatty() if shown is None else shown
        self._plain = plain and not self.shown
        self._done = self._kept = 0
        self._parts: dict[str, float] = {}  # of running tasks, by key
        self._over: set[str] = set()  # what they may still say comes late
        self._slots: dict[str, int] = {}
        self._bars: dict[int, Any] = {}
        self._gate = threading.RLock()  # tasks elsewhere are heard in threads of their engine
        self._all: Any = None
        self._began = time.monotonic()

    def __enter__(self) -> TaskLines:
        return self

    def __exit__(self, *_: object) -> None:
        with self._gate:
            for bar in self._bars.values():
                bar.close()
            if self._all is not None:
                self._all.close()
            self._all = None  # who speaks later is not heard

    def begin(self, kept: int) -> None:
        """The tasks begin, of which so many are done already."""
        self._done = self._kept = kept
        self._began = time.monotonic()
        if self.shown:
            from tqdm import tqdm

            self._all = tqdm(
                total=self.total, initial=kept, bar_format=ALL, smoothing=0.0, leave=False,
                dynamic_ncols=True, desc=self._counted(),
            )  # fmt: skip

    @property
    def seconds_left(self) -> float | None:
        """What the rest may take at the pace so far [s]; None before anything is known."""
        done = self._done - self._kept + sum(self._parts.values())
        if done <= 0.0:
            return None
        rest = self.total - self._kept - done
        return (time.monotonic() - self._began) * rest / done

    def heard(self, news: object) -> None:
        """What a task elsewhere says of itself: (key, name, part, best score)."""
        if isinstance(news, tuple | list) and len(news) == 4:
            key, name, part, score = news
            self.running(str(key), str(name), float(part), float(score))

    def running(self, key: str, name: str, part: float, score: float) -> None:
        """A task has come so far, 0 to 1."""
        with self._gate:
            if self._all is None or key in self._over:
                return
            self._parts[key] = part
            bar = self._bar(key)
            if bar is not None:
                bar.set_description_str(name, refresh=False)
                bar.set_postfix_str(f" best {score:.5f}" if score > 0.0 else "", refresh=False)
                bar.n = part
                bar.refresh()
            self.tick()

    def finished(self, task: Task, result: TaskResult) -> None:
        """A task is done."""
        self._end(task.key)
        gain = "" if result.gain is None else f", {result.gain:+.2%}"
        self._tell(f"{task.name}: {result.score:.6f}{gain}")

    def failed(self, task: Task, reason: str) -> None:
        """A task has no result."""
        self._end(task.key)
        self._tell(f"{task.name}: failed: {reason}", always=True)

    def tick(self) -> None:
        """Show the time that has passed."""
        with self._gate:
            if self._all is None:
                return
            self._all.n = self._done + sum(self._parts.values())
            self._all.set_description_str(self._counted(), refresh=False)
            self._all.refresh()

    @contextmanager
    def aside(self) -> Iterator[None]:
        """While something else is printed, the lines make room."""
        if self._all is None:
            yield
        else:
            with self._all.external_write_mode():
                yield

    def _counted(self) -> str:
        return f"{self.name}, {self._done} of {self.total}"

    def _end(self, key: str) -> None:
        with self._gate:
            self._done += 1
            self._over.add(key)
            self._parts.pop(key, None)
            slot = self._slots.pop(key, None)
            if slot is not None:
                self._bars.pop(slot).close()
            self.tick()

    def _bar(self, key: str) -> Any:
        """The line of a task; None where there are too many."""
        from tqdm import tqdm

        if key not in self._slots:
            free = [i for i in range(1, MOST_LINES + 1) if i not in self._bars]
            if not free:
                return None
            self._slots[key] = free[0]
            self._bars[free[0]] = tqdm(
                total=1.0, bar_format=ONE, leave=False, position=free[0], dynamic_ncols=True
            )
        return self._bars[self._slots[key]]

    def _tell(self, text: str, *, always: bool = False) -> None:
        if not (self._plain or always):
            return
        left = self.seconds_left
        rest = "" if not self._plain or left is None else f" (about {in_words(left)} left)"
        with self.aside():
            print(f"{self._done}/{self.total} {text}{rest}", file=sys.stderr, flush=True)


def in_words(seconds: float) -> str:
    """A time in its best unit."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    if seconds < 90.0 * 60.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"
