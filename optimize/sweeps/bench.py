"""How a sweep gets faster with Dask workers, and whether it survives their deaths.

python -m optimize.sweeps.bench [--scenes 1000] [--evaluations 500] [--workers 1,2] [--kill 10]

Sweeps `sprint` over friction with the method `auto` on local clusters of so many workers, checks
that all of them find the same bits, and prints for each: seconds, how many of them the workers
computed, what the coordinating process (scheduler and store included) computed, and the speed
against the first.  --kill: once more, while a worker is killed every so many seconds.

On a machine that has other things to do, seconds say little; `busy` says what the executor alone
does to them: with cores for all, n workers that are busy all the time are n times as fast as one.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import tempfile
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from domino_env.scenes.io.reading import load_scene
from optimize.executors.cluster import DaskExecutor
from optimize.studies import open_store
from optimize.sweeps.runner import run_sweep, sweep_tasks

if TYPE_CHECKING:
    from optimize.studies.task import Task, TaskResult

Bits = dict[str, tuple[float, bytes, int]]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="speed of a sweep over Dask workers")
    parser.add_argument("--scenes", type=int, default=1000)
    parser.add_argument("--evaluations", type=int, default=500)
    parser.add_argument("--workers", default="1,2")
    parser.add_argument("--kill", type=float, help="[s] between two deaths, in one more run")
    asked = parser.parse_args()
    scene = load_scene("sprint")
    axis = f"physics.friction=0.05:0.45:{asked.scenes}"
    tasks = sweep_tasks(scene, [axis], evaluations=asked.evaluations)
    print(f"{len(tasks)} tasks of {asked.evaluations} evaluations, {os.cpu_count()} cores")
    numbers = [int(word) for word in asked.workers.split(",")]
    runs: list[tuple[int, float | None]] = [(number, None) for number in numbers]
    if asked.kill is not None:
        runs.append((numbers[-1], asked.kill))
    first: tuple[float, Bits] | None = None
    for number, kill in runs:
        seconds, found = _measured(tasks, number, kill)
        first = first or (seconds, found)
        same = "the same bits" if found == first[1] else "OTHER BITS"
        print(f"    {first[0] / seconds:.2f} times as fast as the first, {same}", flush=True)


def _measured(tasks: list[Task], workers: int, kill: float | None) -> tuple[float, Bits]:
    """Seconds of one sweep into a store of its own, and what it found."""
    with tempfile.TemporaryDirectory() as folder, DaskExecutor("local", workers) as cluster:
        study = open_store(Path(folder) / "studies.sqlite").begin("bench", "sweep", {})
        # loading and compiling is paid once, whatever the number of tasks
        for one in [cluster.submit(_compile, tasks[0]) for _ in range(4 * workers)]:
            one.result()
        over, deaths = threading.Event(), [0]
        killer = threading.Thread(target=_kill, args=(cluster, kill or 0.0, over, deaths))
        if kill is not None:
            killer.start()
        before = _computed(cluster)
        own, began = time.process_time(), time.perf_counter()
        swept = run_sweep(load_scene("sprint"), tasks, executor=cluster, study=study)
        seconds, own = time.perf_counter() - began, time.process_time() - own
        over.set()
        if kill is not None:
            killer.join()
        after = _computed(cluster)
        computed = sum(s - before.get(pid, 0.0) for pid, s in after.items())
        print(
            f"{workers} workers: {seconds:.1f} s, computed {computed:.1f} s "
            f"(busy {computed / seconds / workers:.0%}), coordinator {own:.1f} s "
            f"({1e3 * own / len(tasks):.1f} ms a task), {deaths[0]} deaths, "
            f"{len(swept.failures)} failures"
        )
        return seconds, {key: _bits(result) for key, result in study.done().items()}


def _compile(task: Task) -> None:
    from optimize.searching.compiling import compile_for
    from optimize.studies.task import scene_of

    compile_for(scene_of(task.scene), gradients=True)


def _bits(result: TaskResult) -> tuple[float, bytes, int]:
    return result.score, result.spacing.tobytes(), result.falls


def _computed(cluster: DaskExecutor) -> dict[int, float]:
    """Processor time of each worker so far [s], by its process."""
    found = cluster._client.run(_clock)
    return dict(found.values())


def _clock() -> tuple[int, float]:
    return os.getpid(), time.process_time()


def _kill(cluster: DaskExecutor, pause: float, over: threading.Event, deaths: list[int]) -> None:
    rng = random.Random(0)
    while not over.wait(pause):
        with suppress(OSError, IndexError):
            os.kill(rng.choice(list(_computed(cluster))), signal.SIGKILL)
            deaths[0] += 1


if __name__ == "__main__":
    main()
