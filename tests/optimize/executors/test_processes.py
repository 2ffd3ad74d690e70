"""Processes as an executor: the same bits as from one, and what becomes of workers that die."""

from __future__ import annotations

import os
import random
import signal
import time
from concurrent.futures import CancelledError, Executor, Future, ProcessPoolExecutor
from contextlib import suppress
from multiprocessing import active_children, get_context
from pathlib import Path

import numpy as np
import pytest

from optimize import search
from optimize.comparison.runner import compare
from optimize.executors import ExecutorLost, WorkerLost, open_executor
from optimize.executors.base import undisturbed
from optimize.executors.processes import ProcessExecutor
from optimize.executors.reports import say
from optimize.studies.running import run_tasks
from optimize.studies.task import Task, TaskResult, run_task


class Shuffled(Executor):
    """Answers in an order of its own, from this process."""

    def __init__(self, seed: int, least: int) -> None:
        self.rng, self.least = random.Random(seed), least
        self.asked: list = []

    def submit(self, fn, /, *args, **kwargs) -> Future:
        future: Future = Future()
        self.asked.append((future, fn, args, kwargs))
        if len(self.asked) >= self.least:
            self.rng.shuffle(self.asked)
            while self.asked:
                answer, call, words, more = self.asked.pop()
                if answer.set_running_or_notify_cancel():
                    answer.set_result(call(*words, **more))
        return future


class Memory:
    """A study in memory."""

    def __init__(self) -> None:
        self.kept: dict[str, TaskResult] = {}

    def done(self) -> dict[str, TaskResult]:
        return dict(self.kept)

    def add(self, result: TaskResult) -> None:
        self.kept.setdefault(result.key, result)


def bits(result: TaskResult) -> tuple:
    """All of a result that must be the same wherever it was found."""
    trace = [(n, falls, score) for n, falls, _, score in result.trace]
    row = [a.tobytes() for a in (result.spacing, result.thickness, result.height)]
    numbers = (result.score, result.uniform_score, result.gain, result.outcome, result.mean_speed)
    return (result.key, result.method, result.seed, *numbers, *row, result.evaluations, trace)


def results_of(tasks, executor=None, study=None) -> list[TaskResult]:
    found: dict[str, TaskResult] = {}
    failures = run_tasks(tasks, executor, study, lambda t, r: found.__setitem__(t.key, r))
    assert failures == []
    return [found[task.key] for task in tasks]


@pytest.fixture(scope="module")
def tasks(scenes) -> list[Task]:
    chosen = [("spacing", "auto"), ("both", "cma"), ("length", "random"), ("dying", "powell")]
    return [Task.of(scenes[s], m, seed, 60) for s, m in chosen for seed in range(2)]


@pytest.fixture(scope="module")
def expected(tasks) -> list[tuple]:
    return [bits(result) for result in results_of(tasks)]


@pytest.fixture(scope="module")
def pool():
    with ProcessExecutor(2) as pool:
        yield pool


# what a task may be: each is run by a worker ----------------------------------------------------


def kill_worker() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def kill_once(mark: Path) -> str:
    """Takes its worker along the first time."""
    if not mark.exists():
        mark.touch()
        kill_worker()
    return "done"


def linger(mark: Path, seconds: float) -> int:
    mark.write_text(str(os.getpid()))
    time.sleep(seconds)
    return os.getpid()


def refuse(what: str) -> None:
    raise ValueError(f"no {what}")


def unsendable() -> object:
    return lambda: None


class Unsendable(Exception):  # noqa: N818
    """Holds what no other process can have."""

    def __init__(self) -> None:
        super().__init__("held")
        self.held = lambda: None


def raise_unsendable() -> None:
    raise Unsendable


def surroundings() -> tuple[int, str | None]:
    import numba

    return numba.get_num_threads(), os.environ.get("OMP_NUM_THREADS")


# the same bits ----------------------------------------------------------------------------------


def test_a_pool_of_two_gives_the_same_bits(tasks, expected, pool) -> None:
    assert [bits(r) for r in results_of(tasks, pool)] == expected


def test_a_pool_of_one_gives_the_same_bits(tasks, expected) -> None:
    with open_executor(workers=1) as executor:
        assert [bits(r) for r in results_of(tasks[::3], executor)] == expected[::3]


def test_the_order_of_arrival_does_not_matter(tasks, expected) -> None:
    for seed in (1, 2):
        assert [bits(r) for r in results_of(tasks, Shuffled(seed, len(tasks)))] == expected


def test_what_a_study_has_is_not_run_again(tasks, expected, monkeypatch) -> None:
    study = Memory()
    assert [bits(r) for r in results_of(tasks[:3], None, study)] == expected[:3]
    ran: list[Task] = []

    def noted(task: Task, watch: object = None) -> TaskResult:
        ran.append(task)
        return run_task(task)

    monkeypatch.setattr("optimize.studies.running.run_task", noted)
    assert [bits(r) for r in results_of(tasks, None, study)] == expected
    assert ran == tasks[3:]
    assert sorted(map(bits, study.kept.values())) == sorted(expected)


@pytest.mark.parametrize("kind", ["spacing", "both"])
def test_bulk_scoring_gives_the_same_bits(scenes, kind: str, pool, monkeypatch) -> None:
    monkeypatch.setattr("optimize.evaluator.PIECE", 200)  # so that little work is many pieces
    monkeypatch.setattr("optimize.bulk.TASK", 300)
    alone = search(scenes[kind], "random", budget=2013)
    sent = []
    counted = ProcessExecutor.submit
    monkeypatch.setattr(
        ProcessExecutor, "submit", lambda self, *words: sent.append(words) or counted(self, *words)
    )
    for executor in (pool, Shuffled(3, 1)):
        spread = search(scenes[kind], "random", budget=2013, executor=executor)
        assert spread.score == alone.score
        assert np.array_equal(spread.layout.spacing, alone.layout.spacing)
        assert spread.evaluations == alone.evaluations == 2013
        steps = [[(n, f, s) for n, f, _, s in one.trace] for one in (spread, alone)]
        assert steps[0] == steps[1]
    assert len(sent) > 10


def test_little_work_stays_in_the_process(scenes) -> None:
    alone = search(scenes["spacing"], "cma", budget=100)
    spread = search(scenes["spacing"], "cma", budget=100, executor=Shuffled(0, 10**9))
    assert spread.score == alone.score


def test_a_comparison_by_evaluations_is_the_same_on_a_pool(scenes, pool) -> None:
    words = ([scenes["spacing"], scenes["length"]], ["auto", "random"], range(2))
    alone = compare(*words, evaluations=50)
    spread = compare(*words, evaluations=50, executor=pool)
    assert spread.unit == "rows"
    assert spread.best == alone.best
    for one, other in zip(alone.results, spread.results, strict=True):
        assert (one.method, one.seed, one.score) == (other.method, other.seed, other.score)
        assert one.wave.mean_speed == other.wave.mean_speed
        assert alone.time_to(one, 0.01) == spread.time_to(other, 0.01)
    for seconds, evaluations in ((None, None), (1.0, 1)):
        with pytest.raises(ValueError, match="give each run seconds or evaluations"):
            compare(*words, seconds, evaluations=evaluations)


# faults -----------------------------------------------------------------------------------------


def test_workers_have_one_thread_each(pool) -> None:
    assert pool.submit(surroundings).result() == (1, "1")


def test_a_worker_that_dies_is_replaced_and_its_task_done_again(pool, tmp_path: Path) -> None:
    others = [pool.submit(os.getpid) for _ in range(3)]
    assert pool.submit(kill_once, tmp_path / "mark").result() == "done"
    assert all(future.result() for future in others)


def test_a_worker_killed_in_the_middle_of_searches_changes_nothing(tasks, expected, pool) -> None:
    killed: list[int] = []
    found: dict[str, tuple] = {}

    def told(task: Task, result: TaskResult) -> None:
        found[task.key] = bits(result)
        if not killed:
            killed.append(active_children()[0].pid)
            os.kill(killed[0], signal.SIGKILL)

    assert run_tasks(tasks, pool, None, told) == []
    assert [found[task.key] for task in tasks] == expected
    assert killed
    assert killed[0] not in [child.pid for child in active_children()]


def test_a_task_that_kills_its_workers_fails_and_the_others_do_not(pool) -> None:
    bad, good = pool.submit(kill_worker), pool.submit(os.getpid)
    with pytest.raises(WorkerLost, match="its worker died 3 times, the last time by SIGKILL"):
        bad.result()
    assert good.result() > 0


def test_an_error_of_a_task_is_the_tasks_alone(scenes, tasks, pool) -> None:
    with pytest.raises(ValueError, match="no luck") as caught:
        pool.submit(refuse, "luck").result()
    assert "refuse" in caught.value.__notes__[0]  # where it happened over there
    broken = Task(tasks[0].scene, "auto", 0, evaluations=0)
    told: list[Task] = []
    failures = run_tasks([broken, tasks[0]], pool, None, lambda t, r: told.append(t))
    assert told == [tasks[0]]
    assert [f.task for f in failures] == [broken]
    assert failures[0].reason == "budget = 0: give at least one evaluation"


def test_what_cannot_be_sent_back_is_an_error_and_costs_no_worker(pool) -> None:
    workers = {child.pid for child in active_children()}
    with pytest.raises(Exception, match="pickle"):
        pool.submit(unsendable).result()
    with pytest.raises(RuntimeError, match="Unsendable: held"):
        pool.submit(raise_unsendable).result()
    assert workers <= {child.pid for child in active_children()}


def test_what_a_task_says_is_heard(pool) -> None:
    heard: list[object] = []
    pool.hear = heard.append
    pool.submit(say, ("words", 1)).result()
    pool.hear = None
    assert heard == [("words", 1)]


def test_a_context_that_ends_by_an_exception_ends_its_workers(tmp_path: Path) -> None:
    began = time.monotonic()
    with suppress(KeyError), open_executor(workers=1) as executor:
        running = executor.submit(linger, tmp_path / "pid", 60.0)
        waiting = executor.submit(os.getpid)
        while not (tmp_path / "pid").exists() or not (tmp_path / "pid").read_text():
            time.sleep(0.01)
        raise KeyError
    assert time.monotonic() - began < 30.0
    with pytest.raises(ExecutorLost, match="the executor was ended"):
        running.result()
    with pytest.raises(CancelledError):
        waiting.result()
    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "pid").read_text()), 0)
    with pytest.raises(RuntimeError, match="after shutdown"):
        executor.submit(os.getpid)


class Fragile(ProcessPoolExecutor):
    """The pool of the standard library, which breaks as a whole, in the middle of its tasks."""

    asked = 0

    def submit(self, fn, /, *args, **kwargs) -> Future:
        self.asked += 1
        if self.asked == 4:
            super().submit(kill_worker)
        return super().submit(fn, *args, **kwargs)


def test_an_executor_that_breaks_is_told_and_what_is_done_stays(tasks, expected) -> None:
    study = Memory()
    with (
        Fragile(1, mp_context=get_context("spawn")) as executor,
        pytest.raises(ExecutorLost, match="the executor ended before its tasks"),
    ):
        run_tasks(tasks, executor, study)
    assert [bits(r) for r in study.kept.values()] == expected[: len(study.kept)]
    assert len(study.kept) <= 3
    assert [bits(r) for r in results_of(tasks, None, study)] == expected


@pytest.mark.parametrize("workers", [0, -1, 5000])
def test_a_number_of_workers_that_makes_no_sense(workers: int) -> None:
    with pytest.raises(ValueError, match=f"--workers {workers}: give 1 to"), open_executor(workers):
        pass


def test_what_must_not_stop_half_way_comes_to_its_end() -> None:
    before, done = signal.signal(signal.SIGINT, signal.default_int_handler), []

    def keep() -> None:
        with undisturbed():
            signal.raise_signal(signal.SIGINT)
            done.append("the result")

    try:
        with pytest.raises(KeyboardInterrupt):
            keep()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)  # heard again
    finally:
        signal.signal(signal.SIGINT, before)
    assert done
