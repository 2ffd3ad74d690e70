"""A Dask cluster as an executor: one of this machine, or one that runs at an address."""

from __future__ import annotations

import asyncio
import logging
import os
import threading
import time
from collections.abc import Callable
from concurrent import futures
from concurrent.futures import CancelledError, Executor, Future, InvalidStateError
from contextlib import ExitStack, suppress
from functools import partial
from types import TracebackType
from typing import TYPE_CHECKING, Any

from optimize.engines import (
    STRIKES,
    SURROUNDINGS,
    EngineLost,
    WorkerLost,
    require_possible,
)
from optimize.reports import TOPIC, Hear
from optimize.worker_pool import without_ctrl_c

if TYPE_CHECKING:
    from distributed import Future as Inner

LOOPBACK = "127.0.0.1"
ANSWER = 10.0  # [s] for a scheduler to answer
FIRST_WORKER = 60.0  # [s] for the first worker to come
LOOK, ABANDONED = 2.0, 120.0  # [s] between two looks for workers; without any, until it is given up
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
DECISIVE = ("domino-chains", "numpy", "scipy", "numba", "cma")  # versions that must be the same


class Cluster(Executor):
    """Dask workers behind their scheduler; a task whose worker dies is run again by another.

    address: of a scheduler, or "local" to start one here with `workers` workers (None: one a
        core), all bound to the loopback address, without a dashboard.
    hear: called with what running tasks `say`; may be set at any time.

    ImportError without the extra.  EngineLost where no scheduler answers or no worker comes, and as
    the exception of every unfinished task once the scheduler is gone.  ValueError for workers whose
    versions differ from ours, for their results may.
    """

    def __init__(self, address: str, workers: int | None = None) -> None:
        require_possible(workers, address)
        self.hear: Hear | None = None
        self._stack = ExitStack()
        self._waiting: set[Future[Any]] = set()
        self._local: Any = None  # the cluster, where it is ours, and how many workers it is to have
        self._number = 0
        self._over = threading.Event()
        try:
            self._open(address, workers)
        except BaseException:
            self._stack.close()
            raise

    def _open(self, address: str, workers: int | None) -> None:
        import dask
        from distributed import Client, LocalCluster

        # what goes wrong reaches the caller as an exception, in a sentence
        for name in ("distributed", "distributed.client", "distributed.scheduler"):
            self._stack.callback(_quieten(logging.getLogger(name)))
        if address == "local":
            with dask.config.set(SETTINGS), without_ctrl_c():
                local = LocalCluster(
                    n_workers=workers or os.cpu_count() or 1,
                    threads_per_worker=1,
                    processes=True,
                    host=LOOPBACK,
                    dashboard_address=f"{LOOPBACK}:0",  # any port: the usual one may be taken
                    scheduler_kwargs={"dashboard": False},
                    silence_logs=logging.CRITICAL,
                    env=SURROUNDINGS,
                    config=SETTINGS,  # of workers that are started later too
                )
            self._stack.callback(_at_rest, partial(local.close, timeout=CLOSING))
            address = local.scheduler_address
            self._local, self._number = local, len(local.workers)
        self.address = address
        try:
            self._client = Client(address, timeout=ANSWER, set_as_default=False, name="domino")
        except OSError as error:
            raise EngineLost(f"no Dask scheduler answers at {address}: {error}") from None
        self._stack.callback(_at_rest, partial(self._client.close, timeout=ANSWER))
        try:
            self._client.wait_for_workers(1, timeout=FIRST_WORKER)
        except OSError:
            raise EngineLost(
                f"the Dask scheduler at {address} has no workers: start one with "
                f"`dask worker {address} --nthreads 1`"
            ) from None
        self._require_same_versions()
        self._client.subscribe_topic(TOPIC, self._heard)
        watch = threading.Thread(target=self._watch, name="workers-of-dask", daemon=True)
        watch.start()
        self._stack.callback(watch.join)
        self._stack.callback(self._over.set)

    @property
    def workers(self) -> int:
        """How many tasks run at a time."""
        return max(1, int(sum(self._client.nthreads().values())))

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """See `concurrent.futures.Executor`."""
        outer: Future[Any] = Future()
        if self._client.status != "running":  # what is submitted now would never be sent
            raise self._lost()
        try:
            inner = self._client.submit(partial(fn, **kwargs) if kwargs else fn, *args, pure=False)
        except Exception:
            if self._client.status == "running":
                raise
            raise self._lost() from None
        self._waiting.add(outer)
        outer.add_done_callback(self._waiting.discard)
        outer.add_done_callback(partial(_cancel_too, inner))
        self._client.loop.add_callback(self._pass_on, inner, outer)
        return outer

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Close; a cluster that was started here ends with its workers."""
        if cancel_futures:
            for outer in list(self._waiting):
                outer.cancel()
        elif wait:
            futures.wait(list(self._waiting))
        self._stack.close()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.shutdown(cancel_futures=kind is not None)

    async def _pass_on(self, inner: Inner, outer: Future[Any]) -> None:
        """Fetch an answer as soon as it is there, in the thread of the client's loop.

        The worker that has it may die; and what is known here need not be kept anywhere else: a
        result that a future still asks for would be computed again.
        """
        from distributed import KilledWorker

        error: BaseException | None = None
        value: Any = None
        try:
            value = await inner
        except KilledWorker as killed:
            error = WorkerLost(f"its worker died {killed.allowed_failures + 1} times")
        except (asyncio.CancelledError, CancelledError):
            error = self._lost()
        except Exception as raised:
            error = raised
        inner.release()
        with suppress(InvalidStateError):  # it was cancelled meanwhile
            if error is None:
                outer.set_result(value)
            else:
                outer.set_exception(error)

    def _watch(self) -> None:
        """Nobody waits for ever for workers that do not come back."""
        last = time.monotonic()
        while not self._over.wait(LOOK):
            with suppress(Exception):  # a scheduler that is gone is noticed elsewhere
                if not self._waiting or self._client.nthreads():
                    last = time.monotonic()
                if self._local is not None:  # one that died while it started is not started again
                    self._local.scale(self._number)
            if time.monotonic() - last > ABANDONED and self._client.status == "running":
                lost = EngineLost(f"the Dask scheduler at {self.address} has no workers any more")
                for outer in list(self._waiting):
                    with suppress(InvalidStateError):
                        outer.set_exception(lost)

    def _lost(self) -> EngineLost:
        return EngineLost(f"the Dask scheduler at {self.address} is gone, or ended our work")

    def _heard(self, event: Any) -> None:
        if self.hear is not None:
            self.hear(event[1])

    def _require_same_versions(self) -> None:
        from optimize.runs import versions

        ours = versions()
        try:
            theirs = self._client.run(versions, on_error="return")
        except Exception as error:
            raise EngineLost(f"the Dask workers at {self.address} do not answer: {error}") from None
        for worker, found in theirs.items():
            if isinstance(found, ModuleNotFoundError):
                raise ValueError(
                    f"the Dask worker {worker} cannot import {found.name}: install domino-chains "
                    "there, and where the scheduler runs"
                )
            if isinstance(found, BaseException):
                raise EngineLost(f"the Dask worker {worker} does not answer: {found}")
            for name in DECISIVE:
                if found.get(name) != ours.get(name):
                    raise ValueError(
                        f"the Dask worker {worker} has {name} {found.get(name)}, and here it is "
                        f"{ours.get(name)}: results may differ; install the same versions"
                    )


def _cancel_too(inner: Inner, outer: Future[Any]) -> None:
    """What nobody waits for any more need not run."""
    if outer.cancelled():
        with suppress(Exception):  # of a client that is closing: it lets go of everything anyway
            inner.cancel()


def _at_rest(close: Callable[[], object]) -> None:
    """Close what may be gone already, or too slow: nothing that anyone waits for is in it."""
    with suppress(Exception):
        close()


def _quieten(logger: logging.Logger) -> Callable[[], None]:
    """Silence a logger; returns what undoes it."""
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    return lambda: logger.setLevel(before)
