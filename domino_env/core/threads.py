"""Threads that share the items of a batch.

Kernels run without the global interpreter lock, so threads run them at the same time.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache

import numba

MAX_THREADS = 1024  # more than the cores of a computer, so that it is no limit
PIECES_PER_THREAD = 4  # so that threads whose waves stop early take another piece
MAX_PIECE = 200_000  # largest piece of a batch [dominoes], which takes about a second
MIN_SHARED = 400  # smallest batch that several threads share [dominoes]


def allowed_threads() -> int:
    """Return Numba's number of threads, or that of NUMBA_NUM_THREADS if it is smaller.

    Numba reads the variable only when it is imported. A worker process may import Numba with its
    main script, before the variable is set.
    """
    try:
        numba.threading_layer()  # type: ignore[attr-defined]
    except ValueError:  # Numba's threads are not started; to start them sets OpenMP's, also torch's
        threads = int(numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    else:
        threads = numba.get_num_threads()
    return min(threads, int(os.environ.get("NUMBA_NUM_THREADS", MAX_THREADS)))


def share_evenly(task: Callable[..., object], items: int, minimum: int, *arguments: object) -> None:
    """Call task(first, last, *arguments) for as many equal pieces of a batch as there are threads.

    Parameters
    ----------
    task
        Function of the range of items first … last - 1, which releases the global interpreter
        lock.
    items
        Number of items in the batch.
    minimum
        Smallest number of items in a piece, as waking another thread takes some 20 µs.
    arguments
        Further arguments of the task.

    Notes
    -----
    The calling thread takes the first piece itself.
    """
    max_threads = items // max(minimum, 1)
    threads = min(allowed_threads(), max_threads) if max_threads > 1 else 1
    if threads <= 1:
        task(0, items, *arguments)
        return
    pool = _pool(threads - 1)
    edges = [items * i // threads for i in range(threads + 1)]
    jobs = [pool.submit(task, edges[i], edges[i + 1], *arguments) for i in range(1, threads)]
    try:
        task(0, edges[1], *arguments)
    finally:  # the other threads write into the same arrays
        for job in jobs:
            job.result()


def share_pieces(task: Callable[..., object], items: int, count: int, *arguments: object) -> None:
    """Call task(first, last, *arguments) for small pieces of a batch of chains.

    Parameters
    ----------
    task
        Function of the range of chains first … last - 1, which releases the global interpreter
        lock.
    items
        Number of chains in the batch.
    count
        Number of dominoes in each chain.
    arguments
        Further arguments of the task.

    Notes
    -----
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
    wait(jobs)  # after an error too: the other threads write into the same arrays
    for job in jobs:
        job.result()


@cache
def _pool(workers: int) -> ThreadPoolExecutor:
    """Return a pool of this number of threads, which is kept for later calls."""
    return ThreadPoolExecutor(workers, "domino")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # a fork copies no threads
