"""Executors: who runs the tasks of an experiment, or scores thousands of layouts.

None               this process, one task after the other
ProcessExecutor    processes of this machine
Dask               workers of this machine or many, behind a scheduler

Each is a `concurrent.futures.Executor`; any other executor serves too. Results are bitwise the same
with each of them, because a task carries all that decides its result.
"""

from __future__ import annotations

import argparse
import logging
import os
import re
import signal
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from concurrent.futures.process import BrokenProcessPool, ProcessPoolExecutor
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from importlib.util import find_spec
from multiprocessing import connection, get_context, parent_process
from queue import SimpleQueue
from types import TracebackType
from typing import Any

# A worker has one task at a time and one core; threads below it would only compete.
ONE_THREAD = dict.fromkeys(
    ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)
STRIKES = 3  # breaks of the pool during a task after which the task runs alone
MOST_WORKERS = 1024  # on one machine
ADDRESS = re.compile(r"([a-z]+://)?[^/\s]+:[0-9]+/?")  # of a scheduler
LOOPBACK = "127.0.0.1"
ANSWER = 10.0  # [s] for a scheduler to answer
FIRST_WORKER = 60.0  # [s] for the first worker to come
DASK_SETTINGS = {
    # Dask blames the death of a worker on every task that the worker holds: it holds one at a time.
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.scheduler.allowed-failures": STRIKES - 1,
    "distributed.worker.profile.enabled": False,  # it takes time from the tasks
}


class ExecutorLost(ConnectionError):  # noqa: N818 - the name says it
    """The executor itself has ended; the tasks that it had not finished have no result."""


class WorkerLost(RuntimeError):  # noqa: N818
    """A task that ends the worker process that runs it, every time."""


@contextmanager
def loss_as_error(executor: Executor) -> Iterator[None]:
    """Turn what executors raise when they have ended into ExecutorLost."""
    try:
        yield
    except (BrokenExecutor, CancelledError) as error:
        reason = getattr(executor, "gone", "the executor ended before its tasks")
        raise ExecutorLost(f"{reason}: {error}" if str(error) else reason) from None


class ProcessExecutor(Executor):
    """Worker processes that are replaced when one of them dies.

    `ProcessPoolExecutor` breaks as a whole when a process dies, and cannot tell which task caused
    it. Here the unfinished tasks then run again in a new pool. A task during which the pool broke
    three times runs alone, so that the task that ends its worker is found and the others finish.

    Parameters
    ----------
    workers
        Number of processes.
    """

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._news: SimpleQueue[_Call | Future[Any] | None] = SimpleQueue()
        self._closing = self._killed = False
        self._thread = threading.Thread(target=self._serve, daemon=True)
        with without_ctrl_c():
            self._thread.start()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have a worker call `fn`.

        Returns
        -------
        concurrent.futures.Future
            It fails with what the call raises, with WorkerLost where the call ends its worker, and
            with ExecutorLost where the executor is ended first.
        """
        if self._closing:
            raise RuntimeError("cannot schedule new futures after shutdown")
        call = _Call(partial(fn, *args, **kwargs))
        self._news.put(call)
        return call.future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more tasks and finish those there are; with `cancel_futures`, end the workers."""
        self._closing = True
        self._killed = self._killed or cancel_futures
        self._news.put(None)
        if wait:
            self._thread.join()

    def kill(self) -> None:
        """End the workers at once; unfinished tasks fail with ExecutorLost."""
        self.shutdown(cancel_futures=True)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.shutdown(cancel_futures=kind is not None)

    def _serve(self) -> None:
        """Give waiting calls to the pool and pass on their results, in a thread of its own."""
        waiting: deque[_Call] = deque()
        running: dict[Future[Any], _Call] = {}
        pool, closing = self._new_pool(), False
        while not (closing and not waiting and not running) and not self._killed:
            news = self._news.get()
            if news is None:  # behind all that was submitted
                closing = True
            elif isinstance(news, _Call):
                waiting.append(news)
            else:
                call = running.pop(news)
                if isinstance(error := news.exception(), BrokenProcessPool):
                    call.strikes += 1
                    if call.strikes <= STRIKES:
                        waiting.appendleft(call)
                    else:
                        call.future.set_exception(WorkerLost(_LOST))
                elif error is not None:
                    call.future.set_exception(error)
                else:
                    call.future.set_result(news.result())
            while waiting and not self._killed and _may_run(waiting[0], running, self.workers):
                call = waiting.popleft()
                if call.strikes == 0 and not call.future.set_running_or_notify_cancel():
                    continue
                try:
                    inner = pool.submit(call.work)
                except BrokenProcessPool:
                    pool.shutdown(wait=False)
                    pool = self._new_pool()
                    inner = pool.submit(call.work)
                running[inner] = call
                inner.add_done_callback(self._news.put)
        if self._killed:
            for process in list((pool._processes or {}).values()):
                process.kill()
        pool.shutdown(wait=True)
        while not self._news.empty():
            if isinstance(news := self._news.get(), _Call):
                waiting.append(news)
        for call in (*running.values(), *waiting):
            if not call.future.cancelled():
                call.future.set_exception(ExecutorLost("the executor was ended"))

    def _new_pool(self) -> ProcessPoolExecutor:
        # spawn: a fork would inherit locks that threads hold
        return ProcessPoolExecutor(self.workers, get_context("spawn"), begin_worker)


class _Call:
    """A submitted call, its future, and the number of times that the pool broke during it."""

    def __init__(self, work: Callable[[], Any]) -> None:
        self.work = work
        self.future: Future[Any] = Future()
        self.strikes = 0


_LOST = (
    f"its worker process died each of the {STRIKES + 1} times that it ran (killed, out of memory, "
    "or started by a script without `if __name__ == '__main__':`)"
)


def _may_run(call: _Call, running: dict[Future[Any], _Call], workers: int) -> bool:
    """Tell whether a call can begin: a suspect runs alone."""
    if any(one.strikes >= STRIKES for one in (call, *running.values())):
        return not running
    return len(running) < workers


def begin_worker() -> None:
    """Prepare a worker process, before NumPy and Numba are loaded in it."""
    os.environ.update(ONE_THREAD)
    from domino_env.core.progress import Advice

    warnings.simplefilter("ignore", Advice)  # the parent process gives it
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Block SIGINT in threads and processes begun inside.

    A terminal sends Ctrl-C to all of them; the first process decides what it means.
    """
    if sys.platform == "win32":
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # its own start would unblock the signal again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _dask_executor(address: str, workers: int | None) -> Iterator[Executor]:
    """Connect to Dask workers; a task whose worker dies is run again by another."""
    import dask
    from distributed import Client, LocalCluster

    with ExitStack() as stack:
        # what goes wrong reaches the caller as an exception
        for name in ("distributed", "distributed.client", "distributed.scheduler"):
            logger = logging.getLogger(name)
            stack.callback(logger.setLevel, logger.level)
            logger.setLevel(logging.CRITICAL)
        if address == "local":
            with dask.config.set(DASK_SETTINGS), without_ctrl_c():
                cluster = LocalCluster(
                    n_workers=workers or os.cpu_count() or 1,
                    threads_per_worker=1,
                    processes=True,
                    host=LOOPBACK,
                    dashboard_address=f"{LOOPBACK}:0",  # any port: the usual one may be taken
                    scheduler_kwargs={"dashboard": False},
                    silence_logs=logging.CRITICAL,
                    env=ONE_THREAD,
                    config=DASK_SETTINGS,  # of workers that are started later too
                )
            address = stack.enter_context(cluster).scheduler_address
        try:
            client = Client(address, timeout=ANSWER, set_as_default=False, name="domino")
            stack.enter_context(client)
        except OSError as error:
            raise ExecutorLost(f"no Dask scheduler answers at {address}: {error}") from None
        try:
            client.wait_for_workers(1, timeout=FIRST_WORKER)
        except OSError:
            raise ExecutorLost(
                f"the Dask scheduler at {address} has no workers: start one with "
                f"`dask worker {address} --nthreads 1`"
            ) from None
        require_same_versions(client, address)
        executor = client.get_executor(pure=False)
        executor.workers = sum(client.nthreads().values())
        executor.gone = f"the Dask scheduler at {address} has ended"
        yield executor


def require_same_versions(client: Any, address: str) -> None:
    """Check that Dask workers have the same versions; others may have other results."""
    from domino_env.core.results import versions

    try:
        found = client.run(versions)
    except ModuleNotFoundError as error:
        raise ValueError(
            f"the Dask workers at {address} cannot import {error.name}: install domino-chains "
            "there, and where the scheduler runs"
        ) from None
    for worker, theirs in found.items():
        for name, ours in versions().items():
            if name != "python" and theirs.get(name) != ours:
                raise ValueError(
                    f"the Dask worker {worker} has {name} {theirs.get(name)}, and here it is "
                    f"{ours}: results may differ; install the same versions"
                )


@contextmanager
def open_executor(workers: int | None = None, dask: str | None = None) -> Iterator[Executor | None]:
    """Open an executor for as long as the context lasts; None where neither argument is given.

    A context that ends by an exception ends its workers at once; otherwise they finish first.

    Parameters
    ----------
    workers
        Number of processes of this machine; with dask="local", of Dask workers.
    dask
        Address of a scheduler, such as "tcp://127.0.0.1:8786", or "local" for a cluster of this
        machine, bound to the loopback address.

    Raises
    ------
    ValueError
        For an impossible number or address, and for workers whose versions differ.
    ImportError
        Where the extra `dist` is missing.
    ExecutorLost
        Where no scheduler answers at the address, or no worker comes.
    """
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise ValueError(f"--workers {workers}: give 1 to {MOST_WORKERS}")
    if dask is not None and find_spec("distributed") is None:
        raise ImportError(
            'a Dask cluster needs dask and distributed: pip install "domino-chains[dist]" '
            "(in this folder: pip install -c constraints.txt -e .[dist])"
        )
    if dask not in (None, "local") and workers is not None:
        raise ValueError(
            "--workers and the --dask address of a scheduler: its workers are its own; "
            "give one or the other"
        )
    if dask not in (None, "local") and not ADDRESS.fullmatch(dask):
        raise ValueError(
            f"--dask {dask}: give the address of a scheduler, such as "
            "tcp://127.0.0.1:8786, or local"
        )
    if dask is not None:
        with _dask_executor(dask, workers) as executor:
            yield executor
    elif workers is not None:
        with ProcessExecutor(workers) as pool:
            yield pool
    else:
        yield None


def add_executor_options(parser: argparse.ArgumentParser) -> None:
    """Add --workers and --dask."""
    group = parser.add_argument_group(
        "executor", "processes that do the work (this one); the results are the same"
    )
    group.add_argument("--workers", type=int, metavar="N", help="number of processes")
    group.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="tcp://HOST:PORT of a Dask scheduler, or local: a cluster of N workers on this "
        'machine (extra "dist", docs/cluster.md)',
    )


def executor_from(arguments: argparse.Namespace) -> AbstractContextManager[Executor | None]:
    """Open the executor that the options ask for, as a context."""
    return open_executor(arguments.workers, arguments.dask)
