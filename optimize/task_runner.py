"""Run many tasks on an engine: what a study has is not run again, what comes is kept at once."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from dataclasses import dataclass, replace
from queue import Empty, SimpleQueue
from typing import Protocol

from optimize.budget import Budget
from optimize.engines import EngineLost
from optimize.reports import say
from optimize.task import Task, TaskResult, run_task
from optimize.task_lines import TaskLines

MOST_WAITING = 1000  # tasks handed to an engine at a time
PAUSE = 0.5  # [s] between two reports of a running task, and two looks at the clock

Told = Callable[[Task, TaskResult], None]


class Keeper(Protocol):
    """Where finished tasks are kept: a `Study` of `optimize.studies`, or what does the same."""

    def done(self) -> dict[str, TaskResult]:
        """The finished tasks by key."""

    def add(self, result: TaskResult) -> None:
        """Keep a result."""


@dataclass(frozen=True)
class Failure:
    """A task that has no result, and why, in a sentence."""

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

    executor: who runs them; None: this process, one after the other.
    study: keeps every result as it comes; what it has already is told first, and not run again.
    told: called in this thread with every task and its result.
    lines: what shows how far they are.
    Ctrl-C is raised once nothing waits any more; what is finished has been kept and told.  Raises
    EngineLost where the engine itself is gone, and what `study` and `told` raise.
    """
    lines = lines or TaskLines(len(tasks), "tasks", shown=False)
    done = {} if study is None else study.done()
    waiting: list[Task] = []
    with lines:
        for task in tasks:
            kept = done.get(task.key)
            if kept is None:
                waiting.append(task)
            elif told is not None:
                told(task, replace(kept, labels=task.labels))
        lines.begin(len(tasks) - len(waiting))

        def keep(task: Task, result: TaskResult) -> None:
            if study is not None:
                study.add(result)
            lines.finished(task, result)
            if told is not None:
                with lines.aside():
                    told(task, result)

        if executor is None:
            return _run_here(waiting, keep, lines)
        return _run_there(waiting, executor, keep, lines)


def run_and_say(task: Task) -> TaskResult:
    """`run_task` that says now and then how far it is."""
    last = 0.0

    def watch(budget: Budget) -> None:
        nonlocal last
        if time.monotonic() - last > PAUSE:
            last = time.monotonic()
            say((task.key, task.name, float(budget.part), float(budget.best_score)))

    return run_task(task, watch)


def _run_here(tasks: list[Task], keep: Told, lines: TaskLines) -> list[Failure]:
    failures = []
    for task in tasks:

        def watch(budget: Budget, task: Task = task) -> None:
            lines.running(task.key, task.name, budget.part, budget.best_score)

        try:
            result = run_task(task, watch if lines.shown else None)
        except Exception as error:
            failures.append(_failure(task, error, lines))
        else:
            keep(task, result)
    return failures


def _run_there(
    tasks: list[Task], executor: Executor, keep: Told, lines: TaskLines
) -> list[Failure]:
    failures: list[Failure] = []
    arrived: SimpleQueue[Future[TaskResult]] = SimpleQueue()
    pending: dict[Future[TaskResult], Task] = {}
    ahead = iter(tasks)
    if lines.shown and hasattr(executor, "hear"):
        executor.hear = lines.heard
    try:
        while True:
            while len(pending) < MOST_WAITING and (task := next(ahead, None)) is not None:
                future = executor.submit(run_and_say if lines.shown else run_task, task)
                pending[future] = task
                future.add_done_callback(arrived.put)
            if not pending:
                return failures
            try:
                future = arrived.get(timeout=PAUSE)
            except Empty:
                lines.tick()
                continue
            task = pending.pop(future)
            try:
                result = future.result()
            except EngineLost:
                raise
            except (BrokenExecutor, CancelledError) as error:
                raise EngineLost(f"the engine ended before its tasks: {error!r}") from None
            except Exception as error:
                failures.append(_failure(task, error, lines))
            else:
                keep(task, result)
    finally:
        for future in pending:
            future.cancel()


def _failure(task: Task, error: Exception, lines: TaskLines) -> Failure:
    reason = f"{error}" if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
    failure = Failure(task, " ".join(reason.split()))
    lines.failed(task, failure.reason)
    return failure
