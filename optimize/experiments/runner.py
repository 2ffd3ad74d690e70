"""Runner of experiments: finished tasks are not run again, and every result is stored at once."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Executor, as_completed
from contextlib import closing

import msgspec
import numpy as np

from domino_env.core.progress import progress_bar
from optimize.executors import ExecutorLost, loss_as_error, require_executor
from optimize.experiments.experiment import Experiment, Failure, KnownScore, best_of_problems
from optimize.experiments.store import Study
from optimize.experiments.task import Task, TaskResult

BAR_FORMAT = "{desc}, {n} of {total} |{bar}| {elapsed}, about {remaining} left{postfix}"
PLAIN_FORMAT = BAR_FORMAT.replace("|{bar}| ", "in ")  # where there is no terminal


def run_experiment(
    tasks: Sequence[Task],
    executor: Executor | None = None,
    study: Study | None = None,
    *,
    known_score: KnownScore = lambda _: -np.inf,
    name: str = "tasks",
    progress: bool | None = False,
) -> Experiment:
    """Run tasks and gather their results.

    Ctrl-C ends the workers at once, if the executor has a method `kill`, and the results so far are
    returned.

    Parameters
    ----------
    tasks
        Tasks; those with equal keys are run once.
    executor
        Executor of the tasks; None for this process, one task after the other.
    study
        Study that stores every result at once; tasks with a result in it are not run again.
    known_score
        Function that returns the best score known beforehand; see `KnownScore`. By default none is
        known.
    name
        Name of the experiment in the progress line.
    progress
        True for a progress line on standard error; None for one on a terminal, and elsewhere a new
        line from time to time.

    Returns
    -------
    Experiment
        Results in the order of the tasks; a task that fails beside others is one of its `failures`.

    Raises
    ------
    ValueError
        If no task has a result, or if the study cannot be written.
    TypeError
        If `executor` is no executor.
    ExecutorLost
        If the executor itself has ended.
    KeyboardInterrupt
        On Ctrl-C before the first result.
    """
    require_executor(executor)
    results = {} if study is None else study.results()
    failures: list[Failure] = []
    distinct = {task.key: task for task in tasks}
    missing = [task for key, task in distinct.items() if key not in results]
    interrupted = False
    # no smoothing: the remaining time follows from the mean time of a task
    with progress_bar(
        progress, line=PLAIN_FORMAT, bar_format=BAR_FORMAT, desc=name, dynamic_ncols=True,
        total=len(distinct), initial=len(distinct) - len(missing), leave=False, smoothing=0.0,
    ) as line:  # fmt: skip
        local = ((task, task.run) for task in missing)
        pairs = local if executor is None else _submit(executor, missing)
        try:
            with closing(pairs):
                for task, get_result in pairs:
                    try:
                        with loss_as_error():
                            result = results[task.key] = get_result()
                    except ExecutorLost:
                        raise
                    except Exception as error:
                        failures.append(Failure(task, _reason(error)))
                        line.set_postfix_str(f"{len(failures)} failed", refresh=False)
                    else:
                        if study is not None:
                            study.add(result)
                    line.update()
        except KeyboardInterrupt:
            if executor is not None and hasattr(executor, "kill"):
                executor.kill()  # a running task cannot be cancelled
            if not any(key in results for key in distinct):
                raise
            interrupted = True
    available_results = tuple(
        msgspec.structs.replace(results[task.key], labels=task.labels)
        for task in tasks
        if task.key in results
    )
    if not available_results:
        reason = f": {failures[0].task.name}: {failures[0].reason}" if failures else ": give a task"
        raise ValueError(f"no run has a result{reason}")
    best = best_of_problems(available_results, known_score)
    return Experiment(tuple(tasks), available_results, best, tuple(failures), interrupted)


def _submit(
    executor: Executor, tasks: Sequence[Task]
) -> Generator[tuple[Task, Callable[[], TaskResult]], None, None]:
    """Yield finished tasks, each with a function that returns its result or raises its error."""
    with loss_as_error(RuntimeError):
        pending = {executor.submit(task.run): task for task in tasks}
    try:
        for future in as_completed(list(pending)):
            yield pending.pop(future), future.result
    finally:
        for future in pending:
            future.cancel()


def _reason(error: BaseException) -> str:
    """Return the reason of an error in one line."""
    text = f"{error}" if isinstance(error, ValueError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())
