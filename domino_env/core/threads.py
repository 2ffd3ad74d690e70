"""Threads that share the items of a batch.

Kernels hold no lock while they run.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numba

MOST = 1024  # threads


def allowed_threads() -> int:
    """Return Numba's number of threads, or the environment's where that is smaller.

    A worker process gets its environment after it has loaded the main script, and Numba with it,
    which reads the environment only once.
    """
    return min(numba.get_num_threads(), int(os.environ.get("NUMBA_NUM_THREADS", MOST)))


def share_evenly(task: Callable[..., object], items: int, least: int, *arguments: object) -> None:
    """Call task(first, last, *arguments) for as many equal pieces of a batch as there are threads.

    The calling thread takes the first piece itself: waking another one costs some 20 µs, so that
    pieces have at least `least` items.
    """
    most = items // max(least, 1)
    threads = min(allowed_threads(), most) if most > 1 else 1
    if threads <= 1:
        task(0, items, *arguments)
        return
    pool = _pool(threads - 1)
    edges = [items * i // threads for i in range(threads + 1)]
    jobs = [pool.submit(task, edges[i], edges[i + 1], *arguments) for i in range(1, threads)]
    try:
        task(0, edges[1], *arguments)
    finally:
        for job in jobs:
            job.result()


def share_pieces(task: Callable[..., object], items: int, count: int, *arguments: object) -> None:
    """Call task(first, last, *arguments) for small pieces of a batch of chains of `count` dominoes.

    Small pieces keep all cores busy where some waves stop early. Plain threads rather than a
    parallel Numba loop: they may be called from several threads at once and survive a fork.
    """
    threads = allowed_threads()
    piece = max(1, min(-(-items // (4 * threads)), 200_000 // max(count, 1)))
    if threads == 1 or items * count < 400:
        task(0, items, *arguments)
        return
    pool = _pool(threads)
    jobs = [pool.submit(task, i, min(i + piece, items), *arguments) for i in range(0, items, piece)]
    for job in jobs:
        job.result()


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    """Return the pool of so many threads, kept for the next call."""
    return ThreadPoolExecutor(workers, "domino")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # which has none of its parent's threads
