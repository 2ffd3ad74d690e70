"""Compare methods with each other and with the best uniform pitch, over seeds, with equal budgets.

SCENE is the name of a scene that ships, a .toml file, or `all`.  The folder gets a page of Markdown
(a table a scene: score, gain over uniform, gap to the best known, time to 1 % and 0.1 % of it), the
runs and their traces as CSV, and two pictures: the gap against run time, and the part of a ladder
of targets that was reached.  Ctrl-C ends it with the runs that are complete.

Every run goes into the study store as it comes; --resume goes on with a comparison that was
stopped.  Runs are independent: --workers or --dask spread them.  With --evaluations the results
can be repeated to the bit; equal --seconds are equal chances only where there are no more workers
than cores and nothing else to do.

Learners (apg, ppo, ars), trained agents (agent:RUN, whose clock began with its training)
and methods of your own (package.module:function, in this folder or installed) run where they are
named in --methods.  `domino studies export` writes what was found for other programs, IOHanalyzer
among them.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from optimize.executors.choice import add_executor_options, asked_executor, require_executor
from optimize.studies.options import add_study_options, asked_study, going_on

if TYPE_CHECKING:
    from collections.abc import Iterator
    from concurrent.futures import Executor

    from optimize.comparison.runner import Comparison
    from optimize.result import SearchResult
    from optimize.studies.task import Task

SUMMARY = "compare search methods over seeds, with equal budgets"
DEFAULT_SECONDS = 4.0
WORTH_A_TRIAL = 10  # times a trial's rows in a run: then a trial of every method is a small part


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino compare`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="+", help="names, .toml files, or all")
    parser.add_argument(
        "--methods", help="names with commas between (all, and the peers that are installed)"
    )
    parser.add_argument("--seeds", type=int, default=5, help="how many, from 0 (5)")
    parser.add_argument(
        "--seconds", type=float, help=f"for each run ({DEFAULT_SECONDS:g}), or instead:"
    )
    parser.add_argument("--evaluations", type=int, help="rows that each run may simulate")
    parser.add_argument("--out", metavar="FOLDER", default="runs/comparison", help="%(default)s")
    add_executor_options(parser)
    add_study_options(parser)
    parser.add_argument(
        "--update-best",
        action="store_true",
        help="write new records of scenes that ship into optimize/records/best_known.json",
    )


def run(arguments: argparse.Namespace) -> int:
    """Compare, write the folder, print the tables."""
    from domino_env.core.files import require_room
    from domino_env.scenes.io.reading import load_scene, scene_names
    from optimize.comparison.runner import compare, comparison_tasks
    from optimize.methods import registry

    names = scene_names() if arguments.scenes == ["all"] else arguments.scenes
    scenes = [load_scene(name) for name in names]
    if arguments.methods is None:
        chosen = [*registry.METHODS, *registry.installed_peers()]
    else:
        chosen = [name.strip() for name in arguments.methods.split(",")]
    for name in chosen:
        registry.load(name)
    if arguments.seeds < 1:
        raise ValueError(f"--seeds {arguments.seeds}: give at least one")
    seconds, evaluations = arguments.seconds, arguments.evaluations
    if seconds is None and evaluations is None:
        seconds = DEFAULT_SECONDS
    seeds = range(arguments.seeds)
    tasks = comparison_tasks(scenes, chosen, seeds, seconds, evaluations)
    names = [scene.name for scene in scenes]
    settings = {
        "scenes": names, "methods": chosen, "seeds": arguments.seeds, "seconds": seconds,
        "evaluations": evaluations,
    }  # fmt: skip
    default = f"compare-{names[0]}" if len(names) == 1 else f"compare-{len(names)}-scenes"
    require_executor(arguments)
    folder = Path(arguments.out)
    require_room(folder)
    # before the study: of an executor that does not answer no empty one is left
    with asked_executor(arguments) as executor:
        study = asked_study(arguments, "comparison", default, tasks, settings)
        with going_on(study):
            left = len(tasks) - study.tasks
            for line in _announced(tasks, left, executor):
                print(line, flush=True)
            comparison = compare(
                scenes, chosen, seeds, seconds, _tell, evaluations=evaluations, executor=executor,
                study=study, progress=None,
            )  # fmt: skip
    with going_on(study):
        return _written(comparison, folder, update_best=arguments.update_best)


def _written(comparison: Comparison, folder: Path, *, update_best: bool) -> int:
    """Write and print what came of it."""
    from domino_env.scenes.io.reading import scene_names
    from optimize.comparison.page import FILES, table, write
    from optimize.records.shipped import update

    write(comparison, folder)
    for name in comparison.scenes:
        print(f"\n{name}\n" + "\n".join(table(comparison, name)))
    print(f"\nwritten to {folder}: {', '.join(FILES)}")
    if update_best:
        shipped = [r for r in comparison.results if r.scene.name in scene_names()]
        improved = update(shipped)
        print(f"new records: {', '.join(improved) or 'none'}")
    for failure in comparison.failures:
        print(f"domino: {failure.task.name} failed: {failure.reason}", file=sys.stderr)
    if comparison.interrupted:
        raise KeyboardInterrupt
    return 1 if comparison.failures else 0


def _announced(tasks: list[Task], left: int, executor: Executor | None) -> Iterator[str]:
    """What is about to be run, and how long it takes at most."""
    from optimize.comparison.runner import TRIAL, seconds_expected
    from optimize.studies.progress import in_words

    if not left:
        yield "all runs are done"
        return
    workers, cores = getattr(executor, "workers", 1), os.cpu_count() or 1
    share = left / len(tasks) / min(workers, left)  # of the seconds that all take, one by one
    first = tasks[0]
    if first.seconds is not None:
        whole = in_words(len(tasks) * first.seconds * share)
        yield f"{left} runs of {first.seconds:g} s: at most {whole}"
        if workers > cores:
            yield f"{workers} workers on {cores} cores: equal seconds are no equal chances so"
        return
    yield f"{left} runs of {first.evaluations} rows"
    if (first.evaluations or 0) >= WORTH_A_TRIAL * TRIAL:
        whole = in_words(seconds_expected(tasks) * share)
        yield f"about {whole}, judged by {TRIAL} rows of each method that comes with this"


def _tell(result: SearchResult) -> None:
    gain = "" if result.gain is None else f", {result.gain:+.2%}"
    print(
        f"{result.scene.name}, {result.method}, seed {result.seed}: {result.score:.6f}{gain} "
        f"({result.evaluations} rows)",
        flush=True,
    )
