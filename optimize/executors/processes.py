"""Processes of this machine as an executor that outlives its workers.

`concurrent.futures.ProcessPoolExecutor` breaks as a whole when one of its processes dies, and
cannot say which task was to blame.  Here the standard pool of threads keeps the queue, and each
thread has a process behind a pipe of its own: one that dies is started anew and does its task
again.
"""

from __future__ import annotations

import os
import pickle
import signal
import threading
import traceback
import warnings
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import connection, get_context, parent_process
from queue import LifoQueue
from typing import Any

from domino_env.core.progress import Advice
from optimize.executors.base import (
    ONE_THREAD,
    STRIKES,
    ExecutorLost,
    WorkerLost,
    WorkersExecutor,
    undisturbed,
    without_ctrl_c,
)
from optimize.executors.reports import listen

PATIENCE = 10.0  # [s] for an idle worker to end by itself

_RETURNED, _RAISED, _SAID = range(3)


class ProcessExecutor(WorkersExecutor, ThreadPoolExecutor):
    """So many processes, each started when it is first needed, with one task at a time.

    Parameters
    ----------
    workers
        How many.
    """

    def __init__(self, workers: int) -> None:
        super().__init__(workers, thread_name_prefix="worker")
        self._killed = False
        self._gate = threading.Lock()  # none starts once all are being killed
        self._processes: set[_Worker] = set()
        self._idle: LifoQueue[_Worker | None] = LifoQueue()  # None: yet to be started
        for _ in range(workers):
            self._idle.put(None)

    @property
    def workers(self) -> int:
        """How many tasks run at a time."""
        return self._max_workers

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have a worker call `fn`; function and arguments are pickled at once.

        Returns
        -------
        concurrent.futures.Future
            Of what it returns.  It fails with what the call raises, with WorkerLost where three
            workers died of it, and with ExecutorLost where the executor was ended meanwhile.
        """
        call = pickle.dumps((fn, args, kwargs))
        with without_ctrl_c():
            return super().submit(self._run, call)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks, finish those there are (or cancel what has not begun), end."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            for worker in self._processes:
                worker.dismiss()
            for worker in self._processes:
                worker.end()
            self._processes.clear()

    def kill(self) -> None:
        """End all workers at once; what they were doing fails with ExecutorLost."""
        with undisturbed():
            super().shutdown(wait=False, cancel_futures=True)
            with self._gate:
                self._killed = True
                for worker in self._processes:
                    worker.kill()
            self.shutdown()

    def _run(self, call: bytes) -> Any:
        """In a thread: have a call done by an idle worker, again where it dies."""
        worker, how = self._idle.get(), ""
        try:
            for _ in range(STRIKES):
                worker = worker or self._start()
                try:
                    kind, value = worker.ask(call, self._heard)
                except (EOFError, OSError):
                    how, worker = self._bury(worker), None
                    continue
                if kind == _RAISED:
                    raise value
                return value
        finally:
            self._idle.put(worker)
        raise WorkerLost(f"its worker died {STRIKES} times, the last time {how}")

    def _start(self) -> _Worker:
        with self._gate:
            if self._killed:
                raise ExecutorLost("the executor was ended")
            worker = _Worker()
            self._processes.add(worker)
            return worker

    def _bury(self, worker: _Worker) -> str:
        with self._gate:
            self._processes.discard(worker)
        worker.dismiss()
        how = worker.end()
        if self._killed:
            raise ExecutorLost("the executor was ended")
        return how


class _Worker:
    """A process and the pipe to it."""

    def __init__(self) -> None:
        context = get_context("spawn")  # a fork would inherit locks that threads hold
        self._pipe, there = context.Pipe()
        self._process = context.Process(target=_work, args=(there,), daemon=True)
        self._process.start()
        there.close()

    def ask(self, call: bytes, heard: Callable[[object], None]) -> tuple[int, Any]:
        """What a call returned or raised.  EOFError or OSError where the worker is dead."""
        self._pipe.send_bytes(call)
        while True:
            # not the pipe alone: a process forked elsewhere may hold its other end open
            connection.wait([self._pipe, self._process.sentinel])
            if not self._pipe.poll():
                raise EOFError
            kind, value = pickle.loads(self._pipe.recv_bytes())
            if kind != _SAID:
                return kind, value
            heard(value)

    def kill(self) -> None:
        self._process.kill()

    def dismiss(self) -> None:
        """It ends when it has nothing to do."""
        self._pipe.close()

    def end(self) -> str:
        """Wait for its end; how it went, in words."""
        self._process.join(PATIENCE)
        self._process.kill()
        self._process.join()
        code = self._process.exitcode or 0
        if code >= 0:
            return f"with exit status {code} (a script needs `if __name__ == '__main__':`)"
        try:
            return f"by {signal.Signals(-code).name}"
        except ValueError:  # SIGRTMIN + n has no name
            return f"by signal {-code}"


def _work(pipe: connection.Connection) -> None:
    """A worker's life: calls come in, answers go out, until the pipe closes."""
    os.environ.update(ONE_THREAD)  # before Numba or NumPy is loaded
    warnings.simplefilter("ignore", Advice)  # which the first process gives
    threading.Thread(target=_die_with_parent, daemon=True).start()
    listen(lambda news: pipe.send_bytes(pickle.dumps((_SAID, news))))
    with suppress(EOFError, OSError):
        while True:
            pipe.send_bytes(_answer(pipe.recv_bytes()))


def _answer(call: bytes) -> bytes:
    try:
        fn, args, kwargs = pickle.loads(call)
        return pickle.dumps((_RETURNED, fn(*args, **kwargs)))
    except Exception as error:  # of the task, or of what it returned
        error.add_note(traceback.format_exc())
        try:
            return pickle.dumps((_RAISED, error))
        except Exception:  # it holds what no other process can have
            return pickle.dumps((_RAISED, RuntimeError(f"{type(error).__name__}: {error}")))


def _die_with_parent() -> None:
    """A worker whose parent was killed must not compute on for nobody."""
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)
