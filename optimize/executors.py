"""Executors, which run the tasks of an experiment or score thousands of layouts.

`open_executor` opens a `ProcessExecutor`, with processes of this machine, or an executor of Dask,
with workers of one machine or many behind a scheduler. Any other `concurrent.futures.Executor` can
be used too. Without an executor, tasks run in this process, one after the other. Results are
bitwise the same in all cases, because a task contains everything that determines its result.
"""

from __future__ import annotations

import logging
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from concurrent import futures
from contextlib import ExitStack, contextmanager
from multiprocessing import connection, get_context, parent_process
from typing import Any

# A worker has one task at a time and one core: more threads would only wait for each other.
ONE_THREAD = dict.fromkeys(
    ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"
)
SCHEDULER_TIMEOUT = 10.0  # [s] for a scheduler to answer
WORKER_TIMEOUT = 60.0  # [s] for the first worker to connect
DASK_SETTINGS = {
    # Dask counts the loss of a worker as a failure of every task that it holds: each holds one.
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.scheduler.allowed-failures": 2,  # of a task, whose worker may die by chance
    "distributed.worker.profile.enabled": False,  # it would slow the tasks down
}


class ExecutorLost(ConnectionError):  # noqa: N818 - a state, not a mistake
    """Error of an executor that has ended; its unfinished tasks have no result."""


def require_executor(executor: object) -> None:
    """Raise a TypeError for anything but an executor or None."""
    from domino_env.core.checks import require_type

    expected = "a concurrent.futures.Executor, as open_executor(2) yields, or None"
    require_type("executor", executor, futures.Executor | None, expected)


@contextmanager
def loss_as_error(errors: Any = (futures.BrokenExecutor, futures.CancelledError)) -> Iterator[None]:
    """Turn errors, by default those of calls whose executor has ended, into ExecutorLost."""
    try:
        yield
    except errors as error:
        raise ExecutorLost(
            f"the executor ended before its tasks ({error}): check the memory, and that a script "
            "opens its executor after `if __name__ == '__main__':`"
        ) from None


class ProcessExecutor(futures.ProcessPoolExecutor):
    """Worker processes of one thread each, which Ctrl-C does not reach and an exception ends.

    Parameters
    ----------
    workers
        Number of processes.
    """

    def __init__(self, workers: int) -> None:
        spawn = get_context("spawn")  # a fork would inherit locks that threads hold
        super().__init__(workers, spawn, begin_worker)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> futures.Future[Any]:
        """Call `fn(*args, **kwargs)` in a worker, which may start here; return the future."""
        with without_ctrl_c():
            return super().submit(fn, *args, **kwargs)

    def kill(self) -> None:
        """End the workers at once; unfinished tasks fail with BrokenProcessPool."""
        for process in list((self._processes or {}).values()):
            process.kill()
        self.shutdown()

    def __exit__(self, kind: object, *_: object) -> None:
        end = self.shutdown if kind is None else self.kill
        end()


def begin_worker() -> None:
    """Prepare a worker process, before NumPy and Numba are imported in it."""
    os.environ.update(ONE_THREAD)
    from domino_env.core.progress import Advice

    warnings.simplefilter("ignore", Advice)  # the parent process prints it
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process when its parent has ended."""
    if parent := parent_process():
        connection.wait([parent.sentinel])
        os._exit(1)


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Block SIGINT in processes started inside.

    A terminal sends Ctrl-C to all processes; the parent process ends its workers itself.
    """
    if sys.platform == "win32":
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # if it started inside, it would unblock the signal
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


@contextmanager
def _dask_executor(address: str, workers: int | None) -> Iterator[futures.Executor]:
    """Yield an executor of Dask workers; another worker repeats a task whose worker dies."""
    import dask
    from distributed import Client, LocalCluster
    from distributed.comm import parse_host_port

    with ExitStack() as stack:
        # errors reach the caller as exceptions and need no log
        for name in ("distributed", "distributed.client", "distributed.scheduler"):
            logger = logging.getLogger(name)
            stack.callback(logger.setLevel, logger.level)
            logger.setLevel(logging.CRITICAL)
        if address == "local":
            with dask.config.set(DASK_SETTINGS), without_ctrl_c():
                cluster = LocalCluster(
                    n_workers=workers or os.cpu_count() or 1,
                    threads_per_worker=1,
                    dashboard_address="127.0.0.1:0",  # any port: the usual one may be taken
                    scheduler_kwargs={"dashboard": False},
                    silence_logs=logging.CRITICAL,
                    env=ONE_THREAD,
                    config=DASK_SETTINGS,  # for workers that are started later too
                )
            address = stack.enter_context(cluster).scheduler_address
        try:
            parse_host_port(address.rpartition("/")[2])  # an invalid address would block the client
            client = Client(address, timeout=SCHEDULER_TIMEOUT, set_as_default=False, name="domino")
            stack.enter_context(client)
            client.wait_for_workers(1, timeout=WORKER_TIMEOUT)
        except (OSError, ValueError) as error:
            raise ExecutorLost(
                f"no Dask scheduler with a worker answers at {address}: {error}; start "
                f"`dask scheduler`, and `dask worker {address} --nthreads 1`"
            ) from None
        require_same_versions(client, address)
        yield client.get_executor(pure=False)


def require_same_versions(client: Any, address: str) -> None:
    """Check that Dask workers have the versions of this process, without which results may differ.

    Raises
    ------
    ValueError
        If a worker has other versions, or cannot import this package.
    """
    from domino_env.core.results import versions

    try:
        remote = client.run(versions)
    except ModuleNotFoundError as error:
        raise ValueError(
            f"the Dask workers at {address} cannot import {error.name}: install domino-chains "
            "there, and where the scheduler runs"
        ) from None
    for worker, version in remote.items():
        if version != versions():
            raise ValueError(
                f"the Dask worker {worker} has {version}, and this process {versions()}: results "
                "may differ; install the same versions"
            )


@contextmanager
def open_executor(
    workers: int | None = None, dask: str | None = None
) -> Iterator[futures.Executor | None]:
    """Open a context with an executor.

    An exception inside the context ends the workers at once; otherwise they finish first.

    Parameters
    ----------
    workers
        Number of processes of this machine; with dask="local", of Dask workers, by default one per
        core.
    dask
        Address of a scheduler, such as "tcp://127.0.0.1:8786", or "local" for a cluster on this
        machine, bound to the loopback address.

    Yields
    ------
    concurrent.futures.Executor or None
        The executor; None if neither argument is given.

    Raises
    ------
    ValueError
        If `workers` is no whole number of at least 1 or is given with an address, or if the Dask
        workers have other versions.
    ImportError
        If the extra `dist` is missing.
    ExecutorLost
        If no scheduler answers at the address, or if no worker connects to it.
    """
    from domino_env.core.checks import require, require_extra

    require("workers", workers, 1, whole=True, optional=True)
    if dask is not None:
        require_extra("a Dask cluster", "dist", "dask", "distributed")
        if dask != "local" and workers is not None:
            raise ValueError(f"workers = {workers}: Dask at {dask} has its own; leave it out")
        with _dask_executor(dask, workers) as executor:
            yield executor
    elif workers is not None:
        with ProcessExecutor(workers) as pool:
            yield pool
    else:
        yield None
