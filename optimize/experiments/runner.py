"""Runner of experiments: finished tasks are not run again, and every result is kept at once."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, as_completed
from contextlib import closing

import msgspec
from tqdm import tqdm

from optimize.executors import ExecutorLost, loss_as_error
from optimize.experiments.experiment import (
    Experiment,
    Failure,
    best_of_problems,
    no_known_score,
)
from optimize.experiments.store import Study
from optimize.experiments.task import Task, TaskResult

LINE = "{desc}, {n} of {total} |{bar}| {elapsed}, about {remaining} left{postfix}"


def run_experiment(
    tasks: Sequence[Task],
    executor: Executor | None = None,
    study: Study | None = None,
    *,
    known_score: Callable[[TaskResult], float] = no_known_score,
    name: str = "tasks",
    progress: bool | None = False,
) -> Experiment:
    """Run tasks and gather their results.

    Ctrl-C ends the workers of the executor at once and returns the results so far; before the first
    result it is raised.

    Parameters
    ----------
    tasks
        Tasks, of which two may have the same key: they are run once.
    executor
        Runs the tasks; None: this process, one after the other.
    study
        Stores every result at once. Tasks that it has a result of are not run again.
    known_score
        Returns the best score known beforehand of the problem of a result; -inf for none.
    name
        Name of all tasks together in the progress line.
    progress
        True for a progress line on standard error; None for one on a terminal, and elsewhere a line
        for each finished task.

    Returns
    -------
    Experiment
        Results in the order of the tasks; a task that fails beside others is one of its `failures`.

    Raises
    ------
    ValueError
        No task has a result, or the study cannot be written.
    ExecutorLost
        The executor itself has ended.
    """
    results = {} if study is None else study.done()
    failures: list[Failure] = []
    keys = {task.key: task for task in tasks}
    missing = [task for key, task in keys.items() if key not in results]
    interrupted = False
    with tqdm(
        total=len(keys), initial=len(keys) - len(missing), desc=name, bar_format=LINE, leave=False,
        smoothing=0.0, dynamic_ncols=True, disable=None if progress is None else not progress,
    ) as line:  # fmt: skip
        each = progress is None and line.disable  # no terminal
        here = ((task, task.run) for task in missing)
        pairs = here if executor is None else _run_on(executor, missing)
        try:
            with closing(pairs):
                for task, outcome in pairs:
                    message = ""
                    try:
                        with loss_as_error():
                            result = results[task.key] = outcome()
                    except ExecutorLost:
                        raise
                    except Exception as error:
                        failures.append(Failure(task, _reason(error)))
                        message = f"failed: {failures[-1].reason}"
                    else:
                        if study is not None:
                            study.add(result)
                        gain = "" if result.gain is None else f", {result.gain:+.2%}"
                        message = f"{result.score:.6f}{gain}" if each else ""
                    line.n += 1
                    line.refresh()
                    if message:
                        line.write(f"{line.n}/{line.total} {task.name}: {message}", file=sys.stderr)
                        sys.stderr.flush()
        except KeyboardInterrupt:
            if executor is not None and hasattr(executor, "kill"):
                executor.kill()  # a running task cannot be cancelled
            if not any(key in results for key in keys):
                raise
            interrupted = True
    chosen = tuple(
        msgspec.structs.replace(results[task.key], labels=task.labels)
        for task in tasks
        if task.key in results
    )
    if not chosen:
        reason = f": {failures[0].task.name}: {failures[0].reason}" if failures else " yet"
        raise ValueError(f"no run has a result{reason}")
    best = best_of_problems(chosen, known_score)
    return Experiment(tuple(tasks), chosen, best, tuple(failures), interrupted)


def _run_on(
    executor: Executor, tasks: Sequence[Task]
) -> Generator[tuple[Task, Callable[[], TaskResult]], None, None]:
    """Yield tasks that an executor has finished, with functions that return or raise their end."""
    with loss_as_error():
        pending = {executor.submit(task.run): task for task in tasks}
    try:
        for future in as_completed(list(pending)):
            yield pending.pop(future), future.result
    finally:
        for future in pending:
            future.cancel()


def _reason(error: Exception) -> str:
    """Return the reason of an error in one line."""
    text = f"{error}" if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())
