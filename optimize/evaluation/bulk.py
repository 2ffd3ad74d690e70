"""Scores of very many designs, found by an executor."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from functools import lru_cache

from optimize.executors.base import telling_loss
from optimize.problem import Floats, Problem

# Dominoes in a task: some 0.1 s of one core; sending takes some 1 ms to a pool, 10 ms with Dask.
TASK = 60_000


def tasks_of(pieces: Sequence[Floats], dominoes: int) -> list[list[Floats]]:
    """Group pieces of designs, so many dominoes a design, into tasks that are worth sending."""
    groups: list[list[Floats]] = []
    full = True
    for piece in pieces:
        if full:
            groups.append([])
        groups[-1].append(piece)
        full = sum(map(len, groups[-1])) * dominoes >= TASK
    if not full and len(groups) > 1:  # the last one is too small to be sent
        last = groups.pop()
        groups[-1] += last
    return groups


def scores_elsewhere(
    executor: Executor, problem: Problem, tasks: Sequence[Sequence[Floats]], rtol: float | None
) -> Iterator[Floats]:
    """Yield the scores of each piece of designs of all tasks, in order.

    Every piece is scored as a whole, as `problem` itself would do it, so that no bit depends on who
    does it.

    Parameters
    ----------
    executor
        Who scores.
    problem
        Whose designs they are; it counts none of these evaluations.
    tasks
        Pieces (B, n) of designs, those of a task together.
    rtol
        As of `Problem.scores`.

    Raises
    ------
    ExecutorLost
        Where the executor is gone.
    """
    blank = copy.copy(problem)
    blank.journal = None
    blank.evaluations = blank.falls = 0  # equal problems are equal bytes
    words = pickle.dumps(blank)
    futures = [executor.submit(score_pieces, words, task, rtol) for task in tasks]
    try:
        for future in futures:
            with telling_loss(executor):
                parts = future.result()
            yield from parts
    finally:
        for future in futures:
            future.cancel()


def score_pieces(words: bytes, pieces: Sequence[Floats], rtol: float | None) -> list[Floats]:
    """Score pieces of designs of a pickled problem: the task of a worker."""
    problem = _problem(words)
    return [problem.scores(piece, rtol) for piece in pieces]


@lru_cache(8)
def _problem(words: bytes) -> Problem:
    problem: Problem = pickle.loads(words)
    return problem
