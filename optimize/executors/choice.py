"""Which executor: by arguments, or by the options that commands share."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING

from optimize.executors.possible import require_possible

if TYPE_CHECKING:
    from optimize.executors.base import WorkersExecutor


@contextmanager
def open_executor(
    workers: int | None = None, dask: str | None = None
) -> Iterator[WorkersExecutor | None]:
    """Open an executor for as long as the context lasts; None where neither argument is given.

    A context that ends by an exception ends its workers at once; otherwise they finish first.

    Parameters
    ----------
    workers
        Processes of this machine; with dask="local", so many Dask workers.
    dask
        The address of a scheduler, such as "tcp://127.0.0.1:8786", or "local" for a cluster of this
        machine, bound to the loopback address.

    Raises
    ------
    ValueError
        For a number that makes no sense, an address that is none, and workers whose versions differ
        from ours.
    ImportError
        Where the extra is missing.
    ExecutorLost
        Where nobody answers at the address.
    """
    require_possible(workers, dask)
    if dask is not None:
        from optimize.executors.cluster import DaskExecutor

        with DaskExecutor(dask, workers) as cluster:
            yield cluster
    elif workers is not None:
        from optimize.executors.processes import ProcessExecutor

        with ProcessExecutor(workers) as pool:
            yield pool
    else:
        yield None


def add_executor_options(parser: argparse.ArgumentParser) -> None:
    """Add --workers and --dask."""
    group = parser.add_argument_group(
        "executor", "who does the work (this process); results are the same whoever does"
    )
    group.add_argument("--workers", type=int, metavar="N", help="processes of this machine")
    group.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="a Dask scheduler, tcp://HOST:PORT, or local: a cluster of this machine with N "
        'workers (extra "dist"; see docs/cluster.md)',
    )


def asked_executor(
    arguments: argparse.Namespace,
) -> AbstractContextManager[WorkersExecutor | None]:
    """Open the executor that the options ask for, as a context."""
    return open_executor(arguments.workers, arguments.dask)


def require_executor(arguments: argparse.Namespace) -> None:
    """Refuse options of which no executor can come before anything is begun for it."""
    require_possible(arguments.workers, arguments.dask)
