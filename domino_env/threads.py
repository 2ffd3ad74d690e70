"""Rows of a batch shared among threads; the kernel holds no lock while it runs."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numba

_POOLS: dict[int, ThreadPoolExecutor] = {}  # by their number of threads
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_POOLS.clear)  # a child has none of its parent's threads


def share_rows(task: Callable[..., object], rows: int, least: int, *arguments: object) -> None:
    """Call task(first, last, *arguments) for pieces of `rows` that together are all of them.

    The calling thread takes the first piece itself: waking another one costs some 20 µs, which
    pieces of at least `least` rows should be worth.  The number of threads is Numba's.
    """
    threads = min(numba.get_num_threads(), rows // max(least, 1))
    if threads <= 1:
        task(0, rows, *arguments)
        return
    if threads not in _POOLS:
        _POOLS[threads] = ThreadPoolExecutor(threads - 1, "domino-rows")
    edges = [rows * i // threads for i in range(threads + 1)]
    jobs = [
        _POOLS[threads].submit(task, edges[i], edges[i + 1], *arguments) for i in range(1, threads)
    ]
    try:
        task(0, edges[1], *arguments)
    finally:
        for job in jobs:
            job.result()
