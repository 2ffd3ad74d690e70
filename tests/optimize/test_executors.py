"""Executors: the same results as without one, and the loss of workers and schedulers."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from optimize import executors, search
from optimize.executors import ExecutorLost, ProcessExecutor, open_executor
from optimize.experiments.runner import run_experiment
from optimize.experiments.store import Study, open_store
from optimize.experiments.task import Task
from optimize.methods import registry

ROOT = Path(__file__).parents[2]


def repeatable(result):
    """Return the parts of a result that do not depend on the process that computes it."""
    trace = [result.trace[name] for name in ("evaluations", "falls", "score")]
    sizes = (result.spacing, result.thickness, result.height)
    return (result.key, result.score, result.uniform_score, sizes, result.work, trace)


def results_of(tasks, executor=None, study=None):
    done = run_experiment(tasks, executor, study)
    assert done.failures == ()
    return [repeatable(result) for result in done.results]


@pytest.fixture(scope="module")
def tasks(scenes):
    chosen = [("spacing", "auto"), ("both", "cma"), ("length", "random"), ("dying", "powell")]
    return [Task(scenes[s].to_toml(), m, seed, 60) for s, m in chosen for seed in range(2)]


@pytest.fixture(scope="module")
def expected(tasks):
    return results_of(tasks)


@pytest.fixture(scope="module")
def pool():
    with ProcessExecutor(2) as pool:
        yield pool


@pytest.fixture(scope="module")
def cluster():
    pytest.importorskip("distributed")
    with open_executor(workers=2, dask="local") as cluster:
        yield cluster


# tasks of workers -------------------------------------------------------------------------------


def kill_worker_once(marker):
    """Kill the process, unless there is a file, which is made."""
    if not Path(marker).exists():
        Path(marker).touch()
        os.kill(os.getpid(), signal.SIGKILL)


@dataclass(frozen=True)
class TaskOfDyingWorker(Task):
    """A task whose worker dies when it has the result, but has not returned it, once."""

    marker: str = ""

    def run(self):
        result = super().run()
        kill_worker_once(self.marker)
        return result


def thread_settings():
    """Return the threads that Numba and OpenMP may use."""
    import numba

    return numba.get_num_threads(), os.environ.get("OMP_NUM_THREADS")


def linger(path):
    Path(path).write_text(str(os.getpid()))
    time.sleep(60.0)


# the same results -------------------------------------------------------------------------------


def test_bulk_scoring_gives_the_same_results(bits, scenes, pool, monkeypatch):
    monkeypatch.setattr("optimize.evaluator.CHUNK_DOMINOES", 200)  # many chunks
    distributed = search(scenes["both"], "random", budget=2013, executor=pool)
    assert bits(distributed) == bits(search(scenes["both"], "random", budget=2013))


# faults -----------------------------------------------------------------------------------------


def test_dask_replaces_a_worker_that_dies(tasks, expected, cluster, tmp_path):
    study = open_store(tmp_path / "studies.sqlite").begin("one", "sweep", {})
    repeated = TaskOfDyingWorker(**vars(tasks[0]), marker=str(tmp_path / "killed"))
    assert results_of([repeated, *tasks[1:]], cluster, study) == expected
    assert (tmp_path / "killed").exists()
    assert sorted(map(repeatable, study.results().values())) == sorted(expected)
    assert cluster.submit(thread_settings).result() == (1, "1")


def test_a_process_that_dies_ends_its_executor(tasks, tmp_path):
    with ProcessExecutor(1) as executor:
        executor.submit(kill_worker_once, str(tmp_path / "killed"))
        with pytest.raises(ExecutorLost, match=r"terminated abruptly.*check the memory"):
            run_experiment(tasks, executor)


def test_an_error_of_a_task_fails_no_other_task(tasks, expected, pool):
    broken = Task(tasks[0].scene, "auto", 0, budget=0)
    done = run_experiment([broken, *tasks], pool)
    assert [repeatable(r) for r in done.results] == expected
    assert [failure.task for failure in done.failures] == [broken]
    assert "budget = 0" in done.failures[0].reason
    assert pool.submit(thread_settings).result() == (1, "1")


def test_a_context_that_ends_by_an_exception_ends_its_workers(tmp_path):
    pid = tmp_path / "pid"
    with suppress(KeyError), open_executor(workers=1) as executor:
        calls = [executor.submit(linger, str(pid)), executor.submit(os.getpid)]
        while not pid.exists() or not pid.read_text():
            time.sleep(0.01)
        raise KeyError
    for call in (*(call.result for call in calls), lambda: executor.submit(os.getpid)):
        with pytest.raises(BrokenExecutor):
            call()
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


def test_workers_end_with_a_killed_parent(tmp_path):
    pid = tmp_path / "pid"
    script = (
        "import sys; sys.path.insert(0, 'tests/optimize')\n"
        "from test_executors import linger, open_executor\n"
        "if __name__ == '__main__':\n"
        f"    with open_executor(workers=1) as pool: pool.submit(linger, {str(pid)!r}).result()\n"
    )
    (tmp_path / "script.py").write_text(script)
    with subprocess.Popen([sys.executable, tmp_path / "script.py"], cwd=ROOT) as process:
        while not pid.exists() or not pid.read_text():
            assert process.poll() is None
            time.sleep(0.05)
        process.kill()
    for _ in range(1200):
        if not Path(f"/proc/{pid.read_text()}").exists():
            return
        time.sleep(0.05)
    pytest.fail("the worker computes on")


def test_a_lost_scheduler_loses_no_result(tasks, expected, tmp_path, monkeypatch):
    monkeypatch.setattr(executors, "SCHEDULER_TIMEOUT", 3.0)
    distributed = pytest.importorskip("distributed")
    more = [Task(tasks[0].scene, "auto", seed, 1000) for seed in range(20)]
    study = open_store(tmp_path / "studies.sqlite").begin("one", "sweep", {})
    with distributed.LocalCluster(1, threads_per_worker=1, dashboard_address=None) as cluster:
        address = cluster.scheduler_address
        add = Study.add
        monkeypatch.setattr(Study, "add", lambda *args: (add(*args), cluster.close()))
        with (
            pytest.raises(ExecutorLost, match="the executor ended before its tasks"),
            open_executor(dask=address) as executor,
        ):
            run_experiment([*tasks, *more], executor, study)
    monkeypatch.setattr(Study, "add", add)
    assert len(study.results()) >= 1
    assert results_of(tasks, None, study) == expected  # computes the missing results


# errors -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("workers", "dask", "message"), [
    (0, None, "workers = 0: give a whole number, at least 1"),
    (2, "tcp://127.0.0.1:9", "has its own; leave it out"),
    (None, "nothing", "no Dask scheduler with a worker answers at nothing: missing port"),
])  # fmt: skip
def test_impossible_executors_are_rejected(workers, dask, message):
    if dask is not None:
        pytest.importorskip("distributed")
    with pytest.raises((ValueError, ExecutorLost), match=message), open_executor(workers, dask):
        pass


def test_the_message_names_the_missing_extra(monkeypatch):
    monkeypatch.setattr("domino_env.core.checks.find_spec", lambda name: None)
    with (
        pytest.raises(ImportError, match=r'pip install -e "\.\[dist\]"'),
        open_executor(dask="local"),
    ):
        pass
    with pytest.raises(ImportError, match=r'pip install -e "\.\[peers\]"'):
        registry.load("tpe")
