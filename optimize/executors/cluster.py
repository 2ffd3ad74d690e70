"""Dask workers as an executor: a cluster of this machine, or one that runs at an address."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import threading
import time
from collections.abc import Callable
from concurrent import futures
from concurrent.futures import CancelledError, Future, InvalidStateError
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any

import dask
from distributed import Client, LocalCluster

from domino_env.core.results import versions
from optimize.executors.base import (
    ONE_THREAD,
    STRIKES,
    ExecutorLost,
    WorkersExecutor,
    undisturbed,
    without_ctrl_c,
)
from optimize.executors.possible import require_possible
from optimize.executors.reports import TOPIC

LOOPBACK = "127.0.0.1"
ANSWER = 10.0  # [s] for a scheduler to answer
FIRST_WORKER = 60.0  # [s] for the first worker to come
LOOK = 2.0  # [s] between two looks for workers
ABANDONED = 120.0  # [s] without any, until they are given up
CLOSING = 30.0  # [s] for a cluster of ours to end; what has not by then ends with this process
SETTINGS = {
    # A worker that dies is blamed on every task it holds: it must hold none but the one it runs.
    "distributed.scheduler.worker-saturation": 1.0,
    "distributed.scheduler.allowed-failures": STRIKES - 1,
    # Dask watches itself, on the cores that the tasks could have: here nobody looks at it.
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.monitor-interval": "1s",
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
}


class DaskExecutor(WorkersExecutor):
    """Dask workers behind their scheduler; a task whose worker dies is run again by another.

    Parameters
    ----------
    address
        Of a scheduler, or "local" to start one here, bound to the loopback address.
    workers
        Of a local cluster; one a core where None.

    Raises
    ------
    ImportError
        Without the extra.
    ExecutorLost
        Where no scheduler answers or no worker comes.
    ValueError
        For workers whose versions differ from ours, for their results may.
    """

    def __init__(self, address: str, workers: int | None = None) -> None:
        require_possible(workers, address)
        self._stack = ExitStack()
        self._local: Any = None
        self._waiting: set[Future[Any]] = set()
        self._number = workers or os.cpu_count() or 1  # of workers of a local cluster
        self._over = threading.Event()
        self._patience = ABANDONED
        try:
            self._open(address)
        except BaseException:
            self._stack.close()
            raise

    def _open(self, address: str) -> None:
        # what goes wrong reaches the caller as an exception, in a sentence
        for name in ("distributed", "distributed.client", "distributed.scheduler"):
            logger = logging.getLogger(name)
            self._stack.callback(logger.setLevel, logger.level)
            logger.setLevel(logging.CRITICAL)
        if address == "local":
            with dask.config.set(SETTINGS), without_ctrl_c():
                self._local = LocalCluster(
                    n_workers=self._number,
                    threads_per_worker=1,
                    processes=True,
                    host=LOOPBACK,
                    dashboard_address=f"{LOOPBACK}:0",  # any port: the usual one may be taken
                    scheduler_kwargs={"dashboard": False},
                    silence_logs=logging.CRITICAL,
                    env=ONE_THREAD,
                    config=SETTINGS,  # of workers that are started later too
                )
            self._at_the_end(self._local.close, CLOSING)
            address = self._local.scheduler_address
        self.address = address
        self.gone = f"the Dask scheduler at {address} is gone, or has no workers any more"
        try:
            self._client = Client(address, timeout=ANSWER, set_as_default=False, name="domino")
        except OSError as error:
            raise ExecutorLost(f"no Dask scheduler answers at {address}: {error}") from None
        self._at_the_end(self._client.close, ANSWER)
        try:
            self._client.wait_for_workers(1, timeout=FIRST_WORKER)
        except OSError:
            raise ExecutorLost(
                f"the Dask scheduler at {address} has no workers: start one with "
                f"`dask worker {address} --nthreads 1`"
            ) from None
        self._require_same_versions()
        self._client.subscribe_topic(TOPIC, lambda event: self._heard(event[1]))
        watch = threading.Thread(target=self._watch, name="workers-of-dask", daemon=True)
        watch.start()
        self._stack.callback(watch.join)
        self._stack.callback(self._over.set)

    @property
    def workers(self) -> int:
        """How many tasks run at a time."""
        return max(1, int(sum(self._client.nthreads().values())))

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have a worker call `fn`.

        Returns
        -------
        concurrent.futures.Future
            Of what it returns.  It fails with what the call raises, with Dask's KilledWorker where
            three workers died of it, and with ExecutorLost where the scheduler is gone or has been
            without workers for two minutes.

        Raises
        ------
        ExecutorLost
            Where the scheduler is gone already.
        """
        if self._client.status != "running":  # what is submitted now would never be sent
            raise ExecutorLost(self.gone)
        inner = self._client.submit(partial(fn, **kwargs) if kwargs else fn, *args, pure=False)
        outer: Future[Any] = Future()
        self._waiting.add(outer)
        outer.add_done_callback(self._waiting.discard)
        outer.add_done_callback(partial(_cancel_too, inner))
        self._client.loop.add_callback(self._pass_on, inner, outer)
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Finish what was submitted, or not, and close; a cluster of ours ends."""
        if wait and not cancel_futures:
            futures.wait(list(self._waiting))
        self._stack.close()

    def kill(self) -> None:
        """Close without waiting for tasks; workers of other machines finish theirs for nobody."""
        with undisturbed():
            if self._local is not None:  # asked to end, they would first finish what they do
                for nanny in self._local.workers.values():
                    nanny.auto_restart = False
                    with suppress(AttributeError, TypeError, ProcessLookupError):  # none there yet
                        os.kill(nanny.process.pid, signal.SIGKILL)
            self.shutdown(wait=False)

    async def _pass_on(self, inner: Any, outer: Future[Any]) -> None:
        """Fetch an answer as soon as it is there, in the thread of the client's loop.

        What is known here need not be kept anywhere else: a result that a future of Dask still asks
        for is computed again where the worker that has it dies.  (Its own executor lets go of them
        when Python next looks for cycles.)
        """
        error: Exception | None = None
        value: Any = None
        try:
            value = await inner
        except (asyncio.CancelledError, CancelledError):
            error = ExecutorLost(self.gone)
        except Exception as raised:
            error = raised
        inner.release()
        with suppress(InvalidStateError):  # it was cancelled meanwhile
            if error is None:
                outer.set_result(value)
            else:
                outer.set_exception(error)

    def _at_the_end(self, close: Callable[..., object], timeout: float) -> None:
        """Close what may be gone already, or too slow: nothing that anyone waits for is in it."""

        def at_rest() -> None:
            with suppress(Exception):
                close(timeout=timeout)

        self._stack.callback(at_rest)

    def _watch(self) -> None:
        """Replace workers that Dask has given up; end it all where none come back."""
        last = time.monotonic()
        while not self._over.wait(LOOK):
            with suppress(Exception):  # a scheduler that is gone is noticed elsewhere
                if self._client.nthreads():
                    last = time.monotonic()
                if self._local is not None:  # one that died while it started is not started again
                    self._local.scale(self._number)
            if time.monotonic() - last > self._patience:
                with suppress(Exception):
                    self._client.close(timeout=ANSWER)  # cancels what waits
                return

    def _require_same_versions(self) -> None:
        try:
            found = self._client.run(versions)
        except ModuleNotFoundError as error:
            raise ValueError(
                f"the Dask workers at {self.address} cannot import {error.name}: install "
                "domino-chains there, and where the scheduler runs"
            ) from None
        for worker, theirs in found.items():
            for name, ours in versions().items():
                if name != "python" and theirs.get(name) != ours:
                    raise ValueError(
                        f"the Dask worker {worker} has {name} {theirs.get(name)}, and here it is "
                        f"{ours}: results may differ; install the same versions"
                    )


def _cancel_too(inner: Any, outer: Future[Any]) -> None:
    """What nobody waits for any more need not run."""
    if outer.cancelled():
        with suppress(Exception):  # of a client that is closing: it lets go of everything anyway
            inner.cancel()
