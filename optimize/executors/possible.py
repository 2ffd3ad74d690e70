"""Which executors there can be, without starting one."""

from __future__ import annotations

import re
from importlib.util import find_spec

MOST_WORKERS = 1024  # on one machine
ADDRESS = re.compile(r"([a-z]+://)?[^/\s]+:[0-9]+/?")  # of a scheduler


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
