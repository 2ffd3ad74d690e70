"""Which executor: by arguments, or by the options that commands share."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from optimize.executors.base import WorkersExecutor

MOST_WORKERS = 1024  # on one machine
ADDRESS = re.compile(r"([a-z]+://)?[^/\s]+:[0-9]+/?")  # of a scheduler


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


def require_possible(workers: int | None = None, dask: str | None = None) -> None:
    """Refuse what cannot be an executor without starting it; raises as `open_executor` does."""
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
