"""Many designs evaluated, here or by an executor."""

from __future__ import annotations

import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from functools import lru_cache

from domino_env.scenes.objectives import Evaluation
from optimize.executors import telling_loss
from optimize.problem import Problem
from optimize.variables import Floats

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


def evaluations(
    problem: Problem, pieces: Sequence[Floats], rtol: float | None, executor: Executor | None
) -> Iterator[Evaluation]:
    """Evaluate pieces of designs, here or, where they are worth sending, elsewhere.

    Every piece is evaluated as a whole, so that no bit depends on who does it.

    Parameters
    ----------
    problem
        Whose designs they are.
    pieces
        (B, n) designs each.
    rtol
        As of `Problem.evaluate`.
    executor
        Who scores; None: this process.

    Yields
    ------
    Evaluation
        Of the next piece.

    Raises
    ------
    ExecutorLost
        Where the executor is gone.
    """
    tasks = [] if executor is None else tasks_of(pieces, problem.dominoes)
    if executor is None or len(tasks) < 2:
        for piece in pieces:
            yield problem.evaluate(piece, rtol)
        return
    words = pickle.dumps(problem)
    futures = [executor.submit(evaluate_task, words, task, rtol) for task in tasks]
    try:
        for future in futures:
            with telling_loss(executor):
                parts = future.result()
            yield from parts
    finally:
        for future in futures:
            future.cancel()


def evaluate_task(words: bytes, pieces: Sequence[Floats], rtol: float | None) -> list[Evaluation]:
    """Evaluate pieces of designs of a pickled problem: the task of a worker."""
    problem = _problem(words)
    return [problem.evaluate(piece, rtol) for piece in pieces]


@lru_cache(8)
def _problem(words: bytes) -> Problem:
    problem: Problem = pickle.loads(words)
    return problem
