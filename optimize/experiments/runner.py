"""The loop of every experiment: what a study has is not run again, what comes is kept at once."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, Future
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, Protocol

import msgspec

from optimize.evaluator import Budget
from optimize.executors import ExecutorLost, telling_loss
from optimize.experiments.task import Task, TaskResult

MOST_WAITING = 1000  # tasks handed to an executor at a time
PAUSE = 0.5  # [s] between two updates of the line
LINE = "{desc} {percentage:3.0f}%|{bar}| {elapsed}, about {remaining} left{postfix}"

Callback = Callable[[Task, TaskResult], object]


class Keeper(Protocol):
    """Where results are kept: a `Study`, or what does the same."""

    def done(self) -> dict[str, TaskResult]:
        """Return the results by key."""

    def add(self, result: TaskResult) -> None:
        """Keep a result."""


@dataclass(frozen=True)
class Failure:
    """A task that has no result, and the reason in a sentence."""

    task: Task
    reason: str


@dataclass
class Progress:
    """Progress of many tasks on standard error.

    Attributes
    ----------
    name
        Name of all tasks together.
    shown
        Whether a line moves on a terminal; None: where standard error is one.
    plain
        Whether each finished task leaves a line where none moves.
    """

    name: str
    shown: bool | None = False
    plain: bool = False
    done: int = 0
    total: int = 0
    _line: Any = None

    def begin(self, total: int, done: int) -> None:
        """Begin, with some tasks done already."""
        self.total, self.done = total, done
        if sys.stderr.isatty() if self.shown is None else self.shown:
            from tqdm import tqdm

            self._line = tqdm(
                total=total, initial=done, bar_format=LINE, smoothing=0.0, leave=False,
                dynamic_ncols=True, desc=f"{self.name}, {done} of {total}",
            )  # fmt: skip

    def close(self) -> None:
        """Remove the line."""
        if self._line is not None:
            self._line.close()

    def watch(self, task: Task) -> Callable[[Budget], None] | None:
        """Return the callback that shows how far a task of this process is."""
        if self._line is None:
            return None

        def show(budget: Budget) -> None:
            self._line.n = self.done + budget.part
            self._line.set_postfix_str(f"{task.name}: best {budget.best_score:.5f}")

        return show

    def tick(self) -> None:
        """Show the time that has passed."""
        if self._line is not None:
            self._line.refresh()

    def finish(self, task: Task, outcome: TaskResult | Failure) -> None:
        """Show that a task has ended."""
        self.done += 1
        if isinstance(outcome, Failure):
            said = f"failed: {outcome.reason}"
        else:
            gain = "" if outcome.gain is None else f", {outcome.gain:+.2%}"
            said = f"{outcome.score:.6f}{gain}" if self.plain and self._line is None else ""
        if said:
            if self._line is not None:
                self._line.clear()
            line = f"{self.done}/{self.total} {task.name}: {said}"
            print(line, file=sys.stderr, flush=True)
        if self._line is not None:
            self._line.n = self.done
            self._line.set_description_str(f"{self.name}, {self.done} of {self.total}")


def run_tasks(
    tasks: Sequence[Task],
    executor: Executor | None = None,
    study: Keeper | None = None,
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
    progress = progress or Progress("tasks")
    known = {} if study is None else study.done()
    missing = [task for task in tasks if task.key not in known]
    failures: list[Failure] = []
    progress.begin(len(tasks), len(tasks) - len(missing))
    with closing(progress):
        for task in tasks:
            if task.key in known and callback is not None:
                callback(task, msgspec.structs.replace(known[task.key], labels=task.labels))
        outcomes = (
            _here(missing, progress) if executor is None else _there(missing, executor, progress)
        )
        try:
            with closing(outcomes):
                for task, outcome in outcomes:
                    try:
                        result = outcome()
                    except ExecutorLost:
                        raise
                    except Exception as error:
                        failures.append(Failure(task, _reason(error)))
                        progress.finish(task, failures[-1])
                        continue
                    if study is not None:
                        study.add(result)
                    progress.finish(task, result)
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


def _here(tasks: list[Task], progress: Progress) -> _Outcomes:
    """Run each task when its result is asked for."""
    for task in tasks:
        yield task, partial(task.run, progress.watch(task))


def _there(tasks: list[Task], executor: Executor, progress: Progress) -> _Outcomes:
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
                progress.tick()
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
