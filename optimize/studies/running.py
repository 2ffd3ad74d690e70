"""Run many tasks on an executor: what a study has is not run again, what comes is kept at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Executor, Future
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, Protocol

from optimize.evaluator import Budget
from optimize.executors.base import (
    ExecutorLost,
    WorkersExecutor,
    telling_loss,
    undisturbed,
)
from optimize.executors.reports import say
from optimize.studies.progress import TaskLines
from optimize.studies.task import Task, TaskResult, run_task

MOST_WAITING = 1000  # tasks handed to an executor at a time
PAUSE = 0.5  # [s] between two reports of a running task, and two looks at the clock

Told = Callable[[Task, TaskResult], None]


class Keeper(Protocol):
    """Where finished tasks are kept: a `Study` of `optimize.studies`, or what does the same."""

    def done(self) -> dict[str, TaskResult]:
        """Give the finished tasks by key."""

    def add(self, result: TaskResult) -> None:
        """Keep a result."""


@dataclass(frozen=True)
class Failure:
    """A task that has no result.

    Attributes
    ----------
    task
        The task.
    reason
        Why, in a sentence.
    """

    task: Task
    reason: str


def run_tasks(
    tasks: Sequence[Task],
    executor: Executor | None = None,
    study: Keeper | None = None,
    told: Told | None = None,
    lines: TaskLines | None = None,
) -> list[Failure]:
    """Run the tasks, in any order, and return those that failed.

    Ctrl-C ends the executor's workers at once, and is raised; what is finished has been kept.

    Parameters
    ----------
    tasks
        Each once.
    executor
        Who runs them; None: this process, one after the other.
    study
        Keeps every result as it comes; what it has already is reported first, and not run again.
    told
        Called in this thread with every task and its result.
    lines
        Shows how far they are.

    Returns
    -------
    list of Failure
        The tasks that raised an error, or took three workers along.

    Raises
    ------
    ExecutorLost
        Where the executor itself is gone; and what `study` and `told` raise.
    """
    lines = lines or TaskLines(len(tasks), "tasks", shown=False)
    known = {} if study is None else study.done()
    kept = [task for task in tasks if task.key in known]
    missing = [task for task in tasks if task.key not in known]
    failures: list[Failure] = []
    with lines:
        if told is not None:
            for task in kept:
                told(task, replace(known[task.key], labels=task.labels))
        lines.begin(len(kept))
        if executor is None:
            outcomes = _outcomes_here(missing, lines)
        else:
            outcomes = _outcomes_there(missing, executor, lines)
        with ending_workers(executor), closing(outcomes):
            for task, outcome in outcomes:
                try:
                    result = outcome()
                except ExecutorLost:
                    raise
                except Exception as error:
                    failures.append(Failure(task, _reason(error)))
                    lines.failed(task, failures[-1].reason)
                    continue
                if study is not None:
                    with undisturbed():
                        study.add(result)
                lines.finished(task, result)
                if told is not None:
                    with lines.aside():
                        told(task, result)
    return failures


@contextmanager
def ending_workers(executor: Executor | None) -> Iterator[None]:
    """Let Ctrl-C end the workers: a task that runs cannot be cancelled, and nobody wants it."""
    try:
        yield
    except KeyboardInterrupt:
        if isinstance(executor, WorkersExecutor):
            executor.kill()
        raise


def run_and_say(task: Task) -> TaskResult:
    """Do `run_task`, and say now and then how far it is: (key, part, best score)."""
    last = 0.0

    def watch(budget: Budget) -> None:
        nonlocal last
        if time.monotonic() - last > PAUSE:
            last = time.monotonic()
            say((task.key, float(budget.part), float(budget.best_score)))

    return run_task(task, watch)


# A task, and what returns its result or raises what it raised.
_Outcomes = Generator[tuple[Task, Callable[[], TaskResult]], None, None]


def _outcomes_here(tasks: list[Task], lines: TaskLines) -> _Outcomes:
    """Each task runs when its result is asked for."""
    for task in tasks:

        def watch(budget: Budget, task: Task = task) -> None:
            lines.running(task, budget.part, budget.best_score)

        yield task, partial(run_task, task, watch if lines.shown else None)


def _outcomes_there(tasks: list[Task], executor: Executor, lines: TaskLines) -> _Outcomes:
    """What an executor makes of the tasks, as it comes."""
    arrived: SimpleQueue[Any] = SimpleQueue()  # finished futures, and what running tasks say
    pending: dict[Future[TaskResult], Task] = {}
    running: dict[str, Task] = {}
    if lines.shown and isinstance(executor, WorkersExecutor):
        executor.hear = arrived.put
    ahead = iter(tasks)
    try:
        while True:
            while len(pending) < MOST_WAITING and (task := next(ahead, None)) is not None:
                future = executor.submit(run_and_say if lines.shown else run_task, task)
                pending[future], running[task.key] = task, task
                future.add_done_callback(arrived.put)
                del future  # Dask keeps a result for as long as its future is there
            if not pending:
                return
            try:
                news = arrived.get(timeout=PAUSE)
            except Empty:
                lines.tick()
                continue
            if isinstance(news, Future):
                task = pending.pop(news)
                del running[task.key]
                yield task, partial(_result, news, executor)
            else:
                key, part, score = news
                if key in running:  # some of it comes late
                    lines.running(running[key], part, score)
            del news
    finally:
        for future in pending:
            future.cancel()


def _result(future: Future[TaskResult], executor: Executor) -> TaskResult:
    with telling_loss(executor):
        return future.result()


def _reason(error: Exception) -> str:
    said = f"{error}" if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
    return " ".join(said.split())
