"""A Dask cluster as an executor, with real processes on the loopback address, and its faults."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from domino_env.cli.main import main
from domino_env.core.results import versions
from optimize import search
from optimize.executors import ExecutorLost, open_executor
from optimize.executors.cluster import DaskExecutor
from optimize.executors.reports import say
from optimize.studies import open_store
from optimize.studies.running import run_tasks
from optimize.studies.task import Task, TaskResult

ROOT = Path(__file__).parents[3]


def bits(result: TaskResult) -> tuple:
    """All of a result that must be the same wherever it was found."""
    trace = [(n, falls, score) for n, falls, _, score in result.trace]
    row = [a.tobytes() for a in (result.spacing, result.thickness, result.height)]
    return (result.key, result.score, result.uniform_score, *row, result.evaluations, trace)


def results_of(tasks, executor=None, study=None) -> dict[str, tuple]:
    found: dict[str, tuple] = {}
    assert run_tasks(tasks, executor, study, lambda t, r: found.__setitem__(t.key, bits(r))) == []
    return found


@pytest.fixture(scope="module")
def tasks(scenes) -> list[Task]:
    chosen = [("spacing", "auto"), ("both", "cma"), ("length", "random"), ("dying", "powell")]
    return [Task.of(scenes[s], m, seed, 60) for s, m in chosen for seed in range(3)]


@pytest.fixture(scope="module")
def expected(tasks) -> dict[str, tuple]:
    return results_of(tasks)


@pytest.fixture(scope="module")
def cluster() -> Iterator[DaskExecutor]:
    """Two workers on this machine."""
    with open_executor(workers=2, dask="local") as cluster:
        yield cluster


def kill_worker() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def kill_once(mark: str) -> str:
    """Takes its worker along the first time."""
    if not Path(mark).exists():
        Path(mark).touch()
        kill_worker()
    return "done"


def surroundings() -> tuple[int, str | None]:
    import numba

    return numba.get_num_threads(), os.environ.get("OMP_NUM_THREADS")


def refuse(what: str) -> None:
    raise ValueError(f"no {what}")


def test_two_workers_give_the_same_bits(tasks, expected, cluster: DaskExecutor) -> None:
    assert cluster.workers == 2
    assert cluster.address.startswith("tcp://127.0.0.1:")
    assert results_of(tasks, cluster) == expected


def test_bulk_scoring_gives_the_same_bits(scenes, cluster: DaskExecutor, monkeypatch) -> None:
    alone = search(scenes["spacing"], "random", budget=1000)
    monkeypatch.setattr("optimize.bulk.TASK", 2000)
    spread = search(scenes["spacing"], "random", budget=1000, executor=cluster)
    steps = [[(n, f, s) for n, f, _, s in one.trace] for one in (spread, alone)]
    assert steps[0] == steps[1]
    assert spread.score == alone.score


def test_workers_have_one_thread_each_and_are_heard(cluster: DaskExecutor) -> None:
    assert cluster.submit(surroundings).result() == (1, "1")
    heard: list[object] = []
    cluster.hear = heard.append
    cluster.submit(say, ("words", 1)).result()
    for _ in range(100):
        if heard:
            break
        time.sleep(0.05)
    cluster.hear = None
    assert [tuple(news) for news in heard] == [("words", 1)]


def test_an_error_of_a_task_is_the_tasks_alone(cluster: DaskExecutor) -> None:
    with pytest.raises(ValueError, match="no luck"):
        cluster.submit(refuse, "luck").result()


def test_a_worker_killed_in_the_middle_changes_nothing(
    tasks, expected, cluster: DaskExecutor, tmp_path: Path
) -> None:
    mark = cluster.submit(kill_once, str(tmp_path / "mark"))
    assert results_of(tasks, cluster) == expected
    assert mark.result() == "done"


def test_a_task_that_kills_its_workers_fails_and_the_others_do_not(cluster: DaskExecutor) -> None:
    bad, good = cluster.submit(kill_worker), cluster.submit(os.getpid)
    with pytest.raises(Exception, match="on 3 different workers, but all those workers died"):
        bad.result()
    assert good.result() > 0


def tasks_in_memory(dask_scheduler) -> int:
    return sum(task.state == "memory" for task in dask_scheduler.tasks.values())


def test_what_is_known_here_is_kept_by_no_worker(cluster: DaskExecutor) -> None:
    """A result that a worker still keeps is computed again when that worker dies."""
    before = cluster._client.run_on_scheduler(tasks_in_memory)
    assert [cluster.submit(abs, -n).result() for n in range(20)] == list(range(20))
    for _ in range(100):
        if (kept := cluster._client.run_on_scheduler(tasks_in_memory)) <= before:
            break
        time.sleep(0.05)
    assert kept <= before


def test_a_worker_that_dies_for_good_is_replaced(cluster: DaskExecutor) -> None:
    """As happens to one that is killed while it starts: its nanny gives up."""
    local = cluster._local
    assert local is not None
    name = next(iter(local.workers))
    local.sync(local.workers.pop(name).close)
    for _ in range(300):
        if cluster.workers == 2:
            break
        time.sleep(0.1)
    assert cluster.workers == 2


def test_workers_that_do_not_come_back_are_not_waited_for(
    cluster: DaskExecutor, monkeypatch
) -> None:
    with DaskExecutor(cluster.address) as second:
        second._patience = 0.0
        monkeypatch.setattr(second._client, "nthreads", dict)
        with pytest.raises(ExecutorLost, match="has no workers any more"):
            second.submit(time.sleep, 6.0).result()


# a scheduler and a worker of their own ----------------------------------------------------------


@contextmanager
def started(*words: str) -> Iterator[subprocess.Popen[bytes]]:
    """A process of Dask's command line."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "NUMBA_NUM_THREADS": "1"}
    with subprocess.Popen(
        [sys.executable, "-m", "dask", *words],
        env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            process.kill()


def test_a_scheduler_killed_loses_nothing_that_is_done(
    tasks, expected, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.setattr("optimize.executors.cluster.FIRST_WORKER", 60.0)
    file = tmp_path / "scheduler.json"
    more = [Task(t.scene, t.method, seed, 1000) for t in tasks[:1] for seed in range(20)]
    study = open_store(tmp_path / "studies.sqlite").begin("mine", "sweep", {})
    with ExitStack() as stack:
        scheduler = stack.enter_context(
            started("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
                    "--scheduler-file", str(file))
        )  # fmt: skip
        words = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"]
        stack.enter_context(started("worker", "--scheduler-file", str(file), *words))
        for _ in range(1000):
            if file.exists() and file.read_text():
                break
            time.sleep(0.05)
        address = json.loads(file.read_text())["address"]
        told: list[str] = []

        def kill_after_three(task: Task, result: TaskResult) -> None:
            told.append(task.key)
            if len(told) == 3:
                scheduler.kill()

        with pytest.raises(ValueError, match="its workers are its own"):
            DaskExecutor(address, workers=2)
        with (
            pytest.raises(ExecutorLost, match=f"the Dask scheduler at {address} is gone"),
            open_executor(dask=address) as cluster,
        ):
            run_tasks([*tasks, *more], cluster, study, kill_after_three)
    kept = study.done()
    assert list(kept) == told
    assert 3 <= len(kept) < len(tasks)
    assert {key: bits(result) for key, result in kept.items()}.items() <= expected.items()
    assert results_of(tasks, None, study) == expected  # what is missing, and only that
    assert {key: bits(result) for key, result in study.done().items()} == expected
    # and nobody answers there any more
    monkeypatch.setattr("optimize.executors.cluster.ANSWER", 0.5)
    with pytest.raises(ExecutorLost, match=f"no Dask scheduler answers at {address}"):
        DaskExecutor(address)


@pytest.mark.parametrize("address", ["nonsense", "tcp://", "localhost", "tcp://a b:1"])
def test_an_address_that_is_none(address: str) -> None:
    with pytest.raises(ValueError, match=f"--dask {address}: give the address of a scheduler"):
        DaskExecutor(address)


def test_without_the_extra_it_says_what_installs_it(monkeypatch) -> None:
    monkeypatch.setattr("optimize.executors.possible.find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r'pip install "domino-chains\[dist\]"'):
        DaskExecutor("local")


def test_workers_with_other_versions_are_refused(cluster: DaskExecutor, monkeypatch) -> None:
    ours = versions()
    monkeypatch.setattr("optimize.executors.cluster.versions", lambda: {**ours, "numba": "0.1"})
    monkeypatch.setattr(
        cluster._client, "run", lambda call: {"tcp://worker": {**ours, "numba": "0.2"}}
    )
    with pytest.raises(ValueError, match=r"tcp://worker has numba 0\.2, and here it is 0\.1"):
        cluster._require_same_versions()

    def lacking(call: object) -> None:
        raise ModuleNotFoundError("none", name="optimize")

    monkeypatch.setattr(cluster._client, "run", lacking)
    with pytest.raises(ValueError, match="cannot import optimize: install domino-chains there"):
        cluster._require_same_versions()


def test_a_scheduler_that_does_not_answer_leaves_no_study(
    scenes, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.setattr("optimize.executors.cluster.ANSWER", 0.2)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").write_text(scenes["spacing"].to_toml())
    for words in (["compare", "mine.toml"], ["sweep", "mine.toml", "--set", "physics.push=8"]):
        assert main([*words, "--dask", "tcp://127.0.0.1:9", "--evaluations", "9"]) == 2
    assert not (tmp_path / "runs" / "studies.sqlite").exists()
