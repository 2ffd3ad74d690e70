"""The options of all commands that spread their work: who does it."""

from __future__ import annotations

import argparse
from concurrent.futures import Executor
from contextlib import AbstractContextManager


def add_engine_options(parser: argparse.ArgumentParser) -> None:
    """--workers, --dask."""
    group = parser.add_argument_group(
        "engine", "who does the work (this process); results are the same whoever does"
    )
    group.add_argument("--workers", type=int, metavar="N", help="processes of this machine")
    group.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="a Dask scheduler, tcp://HOST:PORT, or local: a cluster of this machine with N "
        'workers (extra "dist"; see docs/cluster.md)',
    )


def asked_engine(arguments: argparse.Namespace) -> AbstractContextManager[Executor | None]:
    """The engine that was asked for, as a context."""
    from optimize.engines import engine

    return engine(arguments.workers, arguments.dask)


def require_engine(arguments: argparse.Namespace) -> None:
    """Refuse what cannot be an engine before anything is begun for it."""
    from optimize.engines import require_possible

    require_possible(arguments.workers, arguments.dask)
