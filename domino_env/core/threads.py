"""Threads that share the items of a batch.

Kernels hold no lock while they run.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache

import numba

MAX_THREADS = 1024
PIECES_PER_THREAD = 4  # so that threads whose waves stop early take another piece
MAX_PIECE = 200_000  # [dominoes]
MIN_SHARED = 400  # [dominoes] of a batch that several threads share


def allowed_threads() -> int:
    """Return Numba's number of threads, or that of NUMBA_NUM_THREADS if it is smaller.

    A worker process gets its environment after it has loaded the main script, and Numba with it,
    which reads the environment only once.
    """
    return min(numba.get_num_threads(), int(os.environ.get("NUMBA_NUM_THREADS", MAX_THREADS)))


def share_evenly(task: Callable[..., object], items: int, least: int, *arguments: object) -> None:
    """Call task(first, last, *arguments) for as many equal pieces of a batch as there are threads.

    The calling thread takes the first piece itself. Waking another thread takes some 20 µs, so a
    piece has at least `least` items.
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

    Small pieces keep all cores busy if some waves stop early. Plain threads are used rather than a
    parallel Numba loop, as they work in several calling threads at once and after a fork.
    """
    threads = allowed_threads()
    piece = max(1, min(-(-items // (PIECES_PER_THREAD * threads)), MAX_PIECE // max(count, 1)))
    if threads == 1 or items * count < MIN_SHARED:
        task(0, items, *arguments)
        return
    pool = _pool(threads)
    jobs = [pool.submit(task, i, min(i + piece, items), *arguments) for i in range(0, items, piece)]
    for job in jobs:
        job.result()


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    """Return the pool of a number of threads; it is kept for the next call."""
    return ThreadPoolExecutor(workers, "domino")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a child has no threads of its parent
