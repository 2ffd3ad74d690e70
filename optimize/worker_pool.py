"""A pool of processes that outlives its workers: what one was doing when it died is done again.

`concurrent.futures.ProcessPoolExecutor` breaks as a whole when one process dies, and cannot say
which task was to blame; here each worker has a pipe of its own, and so its own fate.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager, suppress
from multiprocessing import connection, get_context, parent_process
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import Any

from optimize.engines import STRIKES, SURROUNDINGS, EngineLost, WorkerLost
from optimize.reports import Hear, listen

PATIENCE = 10.0  # [s] for an idle worker to end by itself

_READY, _DONE, _FAILED, _NEWS = range(4)


class WorkerPool(Executor):
    """So many processes, started when the first task comes, each with one task at a time.

    A task whose worker dies is run again by a new one; one that loses three fails with WorkerLost.
    hear: called with what running tasks `say`; may be set at any time.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self.hear: Hear | None = None
        self._jobs: SimpleQueue[_Job | None] = SimpleQueue()
        self._gate = threading.Lock()
        self._open = True
        self._killed = False
        self._processes: set[_Worker] = set()
        self._threads = [
            threading.Thread(target=self._serve, name=f"worker-{i}", daemon=True)
            for i in range(workers)
        ]
        with without_ctrl_c():
            for thread in self._threads:
                thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """See `concurrent.futures.Executor`; function and arguments are pickled at once."""
        job = _Job(pickle.dumps((fn, args, kwargs)))
        with self._gate:
            if not self._open:
                raise RuntimeError("this pool is closed: it takes no more tasks")
            self._jobs.put(job)
        return job.future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks, finish those there are (or cancel what has not begun), end."""
        with self._gate:
            closing, self._open = self._open, False
        if cancel_futures:
            self._cancel_waiting()
        if closing:
            for _ in self._threads:
                self._jobs.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def kill(self) -> None:
        """End all workers now; what they were doing fails with EngineLost."""
        with self._gate:
            self._killed = True
            for worker in self._processes:
                worker.kill()
        self.shutdown(wait=True, cancel_futures=True)

    def pids(self) -> list[int]:
        """Of the workers that run."""
        with self._gate:
            return [worker.pid for worker in self._processes]

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

    def _cancel_waiting(self) -> None:
        with suppress(Empty):
            while True:
                job = self._jobs.get_nowait()
                if job is not None:
                    job.future.cancel()
                    job.future.set_running_or_notify_cancel()

    def _serve(self) -> None:
        """One worker's thread: hand it a task, wait for the answer, replace it when it dies."""
        worker: _Worker | None = None
        while (job := self._jobs.get()) is not None:
            if job.future.set_running_or_notify_cancel():
                worker = self._do(job, worker)
        if worker is not None:
            self._end(worker)

    def _do(self, job: _Job, worker: _Worker | None) -> _Worker | None:
        """Run a job, again where its worker dies; returns the worker that is left."""
        how = ""
        for _ in range(STRIKES):
            try:
                worker = worker or self._start()
                kind, value = worker.ask(job.words, self._heard)
            except (EOFError, OSError):
                if worker is not None:
                    how = self._end(worker)
                worker = None
                if self._killed:
                    break
                continue
            except BaseException as error:  # an answer that cannot be read
                job.future.set_exception(error)
                return worker
            if kind == _DONE:
                job.future.set_result(value)
            else:
                job.future.set_exception(value)
            return worker
        if self._killed:
            job.future.set_exception(EngineLost("the pool was ended"))
        else:
            job.future.set_exception(
                WorkerLost(f"its worker died {STRIKES} times, the last time {how}")
            )
        return None

    def _heard(self, news: object) -> None:
        if self.hear is not None:
            self.hear(news)

    def _start(self) -> _Worker:
        with self._gate:
            if self._killed:
                raise EOFError
            worker = _Worker()
            self._processes.add(worker)
        return worker

    def _end(self, worker: _Worker) -> str:
        with self._gate:
            self._processes.discard(worker)
        return worker.end()


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Threads begun inside, and processes that they begin, never get Ctrl-C.

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


class _Job:
    """A call as bytes, and the future of its answer."""

    def __init__(self, words: bytes) -> None:
        self.words = words
        self.future: Future[Any] = Future()


class _Worker:
    """A process and the pipe to it."""

    def __init__(self) -> None:
        context = get_context("spawn")  # a fork would inherit locks that threads hold
        self._pipe, there = context.Pipe()
        self._process = context.Process(target=_work, args=(there,), daemon=True)
        self._process.start()
        there.close()
        self._ready = False

    @property
    def pid(self) -> int:
        return self._process.pid or 0

    def ask(self, words: bytes, heard: Hear) -> tuple[int, Any]:
        """The answer to a call.  EOFError or OSError where the worker is dead."""
        while not self._ready:
            self._ready = self._receive()[0] == _READY
        self._pipe.send_bytes(words)
        while True:
            kind, value = self._receive()
            if kind != _NEWS:
                return kind, value
            heard(value)

    def _receive(self) -> tuple[int, Any]:
        # not the pipe alone: a process forked elsewhere may hold its other end open
        connection.wait([self._pipe, self._process.sentinel])
        if not self._pipe.poll():
            raise EOFError
        answer: tuple[int, Any] = pickle.loads(self._pipe.recv_bytes())
        return answer

    def kill(self) -> None:
        self._process.kill()

    def end(self) -> str:
        """Let it go; how it went, in words."""
        self._pipe.close()
        self._process.join(PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        code = self._process.exitcode or 0
        if not self._ready:
            return "before it could begin (a script needs `if __name__ == '__main__':`)"
        if code >= 0:
            return f"with exit status {code}"
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = f"signal {-code}"
        return f"by {name}"


def _work(pipe: connection.Connection) -> None:
    """A worker's life: calls come in, answers go out, until the pipe closes."""
    os.environ.update(SURROUNDINGS)  # before Numba or NumPy is loaded
    threading.Thread(target=_die_with_parent, daemon=True).start()

    def send(kind: int, value: object) -> None:
        pipe.send_bytes(pickle.dumps((kind, value)))

    def news(value: object) -> None:
        with suppress(OSError):
            send(_NEWS, value)

    listen(news)
    with suppress(EOFError, OSError, KeyboardInterrupt):
        send(_READY, None)
        while True:
            words = pipe.recv_bytes()
            try:
                call, args, kwargs = pickle.loads(words)
                kind, value = _DONE, call(*args, **kwargs)
            except Exception as error:
                error.add_note(traceback.format_exc())
                kind, value = _FAILED, error
            try:
                send(kind, value)
            except (pickle.PicklingError, TypeError, AttributeError) as error:
                send(_FAILED, RuntimeError(f"what the task returned cannot be sent: {error}"))


def _die_with_parent() -> None:
    """A worker whose parent was killed must not compute on for nobody."""
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)
