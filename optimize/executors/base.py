"""What executors whose workers may die have in common."""

from __future__ import annotations

import signal
import sys
import threading
from abc import abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor
from contextlib import contextmanager
from types import TracebackType

# A worker has one task at a time and its core for itself; threads beneath would only fight.
ONE_THREAD = {
    "NUMBA_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}
STRIKES = 3  # deaths of workers after which the task that they ran is given up


class ExecutorLost(ConnectionError):  # noqa: N818  its name says it
    """The executor itself is gone (a scheduler, not a worker): what it had not finished is lost."""


class WorkerLost(RuntimeError):  # noqa: N818
    """A task whose worker died every time it was tried."""


class WorkersExecutor(Executor):
    """An executor with workers that can be ended, and that report while they work.

    Attributes
    ----------
    hear
        Called, in a thread of the executor, with everything that running tasks `say`; or None.
    gone
        What to say where it is gone with tasks unfinished.
    """

    gone: str = "the executor ended before its tasks"

    hear: Callable[[object], None] | None = None

    @property
    @abstractmethod
    def workers(self) -> int:
        """How many tasks run at a time."""

    @abstractmethod
    def kill(self) -> None:
        """End the workers; what they were doing fails, what waits is cancelled or fails."""

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if kind is None:
            self.shutdown(wait=True)
        else:
            self.kill()

    def _heard(self, news: object) -> None:
        if self.hear is not None:
            self.hear(news)


@contextmanager
def telling_loss(executor: Executor) -> Iterator[None]:
    """Turn what executors raise when they are gone into ExecutorLost."""
    try:
        yield
    except (BrokenExecutor, CancelledError) as error:
        said = getattr(executor, "gone", WorkersExecutor.gone)
        raise ExecutorLost(f"{said}: {error}" if str(error) else said) from None


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let what is inside come to its end before Ctrl-C or SIGTERM is heard.

    For what is short, and must not stop half way: keeping a result, ending workers.
    """
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are heard in the main thread alone
        return
    came: list[int] = []
    before = {}
    for number in (signal.SIGINT, signal.SIGTERM):
        if callable(signal.getsignal(number)):  # not what ends the process, nor what is ignored
            before[number] = signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[-1])


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Keep Ctrl-C from threads begun inside, and from processes that they begin.

    A terminal sends it to all of them; it is the first process that decides what it means.
    """
    if sys.platform == "win32":
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # its own start would let signals through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
