"""The loop of every experiment: what a study has is not run again, what comes is kept at once."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, Future
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any

import msgspec

from optimize.evaluator import Evaluator
from optimize.executors import ExecutorLost, telling_loss
from optimize.experiments.store import Study
from optimize.experiments.task import Task, TaskResult

MOST_WAITING = 1000  # tasks handed to an executor at a time
PAUSE = 0.5  # [s] between two updates of the line
LINE = "{desc}, {n} of {total} |{bar}| {elapsed}, about {remaining} left{postfix}"

Callback = Callable[[Task, TaskResult], object]


@dataclass(frozen=True)
class Failure:
    """A task that has no result, and the reason in a sentence."""

    task: Task
    reason: str


@dataclass(frozen=True)
class Progress:
    """Progress of many tasks on standard error.

    Attributes
    ----------
    name
        Name of all tasks together.
    shown
        Whether a line moves; None: where standard error is a terminal, and elsewhere each finished
        task leaves a line.
    """

    name: str = "tasks"
    shown: bool | None = None

    def line(self, total: int, done: int) -> Any:
        """Begin the line, with some tasks done already."""
        from tqdm import tqdm

        return tqdm(
            total=total, initial=done, desc=self.name, bar_format=LINE, smoothing=0.0, leave=False,
            dynamic_ncols=True, disable=None if self.shown is None else not self.shown,
        )  # fmt: skip

    def finish(self, line: Any, task: Task, outcome: TaskResult | Failure) -> None:
        """Show that a task has ended."""
        line.n += 1
        line.refresh()
        if isinstance(outcome, Failure):
            said = f"failed: {outcome.reason}"
        elif self.shown is None and line.disable:
            gain = "" if outcome.gain is None else f", {outcome.gain:+.2%}"
            said = f"{outcome.score:.6f}{gain}"
        else:
            return
        line.write(f"{line.n}/{line.total} {task.name}: {said}", file=sys.stderr)
        sys.stderr.flush()


def run_tasks(
    tasks: Sequence[Task],
    executor: Executor | None = None,
    study: Study | None = None,
    callback: Callback | None = None,
    progress: Progress | None = None,
) -> list[Failure]:
    """Run tasks, in any order, and return those that failed.

    Ctrl-C ends the workers of the executor at once, and is raised; what is finished has been kept.

    Parameters
    ----------
    tasks
        All different.
    executor
        Who runs them; None: this process, one after the other.
    study
        Keeps every result as it comes; what it has is passed to the callback first, and not run
        again.
    callback
        Called in this thread with every task and its result.
    progress
        Shows how far they are.

    Raises
    ------
    ExecutorLost
        Where the executor itself has ended; and what `study` and `callback` raise.
    """
    progress = progress or Progress(shown=False)
    known = {} if study is None else study.done()
    missing = [task for task in tasks if task.key not in known]
    failures: list[Failure] = []
    with closing(progress.line(len(tasks), len(tasks) - len(missing))) as line:
        for task in tasks:
            if task.key in known and callback is not None:
                callback(task, msgspec.structs.replace(known[task.key], labels=task.labels))
        outcomes = _here(missing, line) if executor is None else _there(missing, executor, line)
        try:
            with closing(outcomes):
                for task, outcome in outcomes:
                    try:
                        result = outcome()
                    except ExecutorLost:
                        raise
                    except Exception as error:
                        failures.append(Failure(task, _reason(error)))
                        progress.finish(line, task, failures[-1])
                        continue
                    if study is not None:
                        study.add(result)
                    progress.finish(line, task, result)
                    if callback is not None:
                        callback(task, result)
        except KeyboardInterrupt:  # a task that runs cannot be cancelled
            if executor is not None and hasattr(executor, "kill"):
                executor.kill()
            raise
    return failures


def run_task(task: Task) -> TaskResult:
    """Run a task, in a worker."""
    return task.run()


# A task, and the function that returns its result or raises what it raised.
_Outcomes = Generator[tuple[Task, Callable[[], TaskResult]], None, None]


def _here(tasks: list[Task], line: Any) -> _Outcomes:
    """Run each task when its result is asked for."""
    for task in tasks:

        def show(budget: Evaluator, task: Task = task) -> None:
            line.set_postfix_str(f"{task.name}: best {budget.best_score:.5f}", refresh=False)
            line.update(0)

        yield task, partial(task.run, None if line.disable else show)


def _there(tasks: list[Task], executor: Executor, line: Any) -> _Outcomes:
    """Yield the results of an executor as they come."""
    arrived: SimpleQueue[Future[TaskResult]] = SimpleQueue()
    pending: dict[Future[TaskResult], Task] = {}
    ahead = iter(tasks)
    try:
        while True:
            while len(pending) < MOST_WAITING and (task := next(ahead, None)) is not None:
                with telling_loss(executor):
                    future = executor.submit(run_task, task)
                pending[future] = task
                future.add_done_callback(arrived.put)
                del future  # Dask keeps a result for as long as its future is there
            if not pending:
                return
            try:
                done = arrived.get(timeout=PAUSE)
            except Empty:
                line.refresh()
                continue
            yield pending.pop(done), partial(_result, done, executor)
            del done
    finally:
        for future in pending:
            future.cancel()


def _result(future: Future[TaskResult], executor: Executor) -> TaskResult:
    with telling_loss(executor):
        return future.result()


def _reason(error: Exception) -> str:
    text = f"{error}" if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())
