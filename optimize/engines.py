"""Engines: who does the work of many tasks, a `concurrent.futures.Executor` each.

None           this process, one task after the other, rows of a batch shared among its threads
WorkerPool     processes of this machine, one task each at a time
Cluster        Dask workers, of this machine or many

Results are the same to the bit whatever the engine: a task carries all that decides them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from importlib.util import find_spec

# A worker has one task at a time and its core for itself; threads beneath would only fight.
SURROUNDINGS = {
    "NUMBA_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
}
STRIKES = 3  # deaths of workers after which the task that they ran is given up
MOST_WORKERS = 1024  # on one machine
ADDRESS = re.compile(r"([a-z]+://)?[^/\s]+:[0-9]+/?")  # of a scheduler


class EngineLost(ConnectionError):  # noqa: N818  its name says it
    """The engine itself is gone (a scheduler, not a worker): what it had not finished is lost."""


class WorkerLost(RuntimeError):  # noqa: N818
    """A task whose worker died every time it was tried."""


@contextmanager
def engine(workers: int | None = None, dask: str | None = None) -> Iterator[Executor | None]:
    """An executor for as long as the context lasts; None where neither is given.

    workers: processes of this machine; with dask="local", so many Dask workers.
    dask: the address of a scheduler, such as "tcp://127.0.0.1:8786", or "local" for a cluster of
        this machine, bound to the loopback address.
    A context that ends by an exception ends its workers at once; otherwise they finish first.
    ValueError for a number that makes no sense, ImportError where the extra is missing, EngineLost
    where nobody answers at the address.
    """
    require_possible(workers, dask)
    if dask is not None:
        from optimize.cluster import Cluster

        with Cluster(dask, workers) as cluster:
            yield cluster
    elif workers is not None:
        from optimize.worker_pool import WorkerPool

        with WorkerPool(workers) as pool:
            yield pool
    else:
        yield None


def require_possible(workers: int | None = None, dask: str | None = None) -> None:
    """What can be said of an engine without starting it; raises as `engine` does."""
    if workers is not None and not 1 <= workers <= MOST_WORKERS:
        raise ValueError(f"--workers {workers}: give 1 to {MOST_WORKERS}")
    if dask is None:
        return
    if find_spec("distributed") is None:
        raise ImportError(
            'a Dask cluster needs dask and distributed: pip install "domino-chains[dist]" '
            "(in this folder: pip install -c constraints.txt -e .[dist])"
        )
    if dask != "local" and workers is not None:
        raise ValueError(
            "--workers and the --dask address of a scheduler: its workers are its own; "
            "give one or the other"
        )
    if dask != "local" and not ADDRESS.fullmatch(dask):
        raise ValueError(
            f"--dask {dask}: give the address of a scheduler, such as "
            "tcp://127.0.0.1:8786, or local"
        )
