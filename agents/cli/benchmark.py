"""Train algorithms on scenes over many seeds, hold them against searches, and write a page.

An ALGORITHM is one of `domino train`, a scripted policy (ramp) or a method of a search (cma, auto).
Every run goes into the study store as it comes and a training keeps a folder of its own: the same
command runs what is missing, continues trainings that were stopped, and writes the page anew.
Ctrl-C ends it with the page of what is complete.  Times are processor time.

Scenes: sprint, course, sprint-thickness, ideal and varied where none is named; in varied every
episode is a new scene, and scores are of the scenes of its test set.
"""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from optimize.cli.options import DEFAULT_STORE, exit_code
from optimize.executors import add_executor_options, asked_executor

SUMMARY = "benchmark algorithms that learn, over scenes and seeds"
DEFAULT_HOME = "runs/benchmark"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino benchmark`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="names or .toml files")
    parser.add_argument("--algorithms", metavar="NAMES", help="with commas between")
    parser.add_argument(
        "--seeds", type=int, default=10, help="how many, from 0 (10); five of what takes longer"
    )
    parser.add_argument("--steps", type=int, help="dominoes that a training places at most")
    parser.add_argument("--seconds", type=float, help="processor time of a search at most")
    parser.add_argument("--out", metavar="FOLDER", default=DEFAULT_HOME, help="%(default)s")
    parser.add_argument(
        "--trainings", metavar="FOLDER", default=DEFAULT_HOME, help="their folders (%(default)s)"
    )
    parser.add_argument("--page", action="store_true", help="write it of what is done, run nothing")
    add_executor_options(parser)
    group = parser.add_argument_group("study", "where results are kept as they come")
    group.add_argument(
        "--store",
        metavar="FILE",
        default=DEFAULT_STORE,
        help="an SQLite file (%(default)s); see domino studies",
    )
    group.add_argument("--name", default="benchmark", help="of the study (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Run what is missing, write the page, print its summary."""
    from agents.algorithms import ALGORITHMS
    from agents.benchmark import BASELINES, SCENES, benchmark_tasks, known_in, run_benchmark
    from agents.benchmark_report import FILES, overview, write
    from domino_env.core.files import require_writable
    from optimize.experiments.experiment import gathered
    from optimize.experiments.store import open_store

    chosen = [*ALGORITHMS, *BASELINES]
    if arguments.algorithms is not None:
        chosen = [name.strip() for name in arguments.algorithms.split(",")]
    tasks = benchmark_tasks(
        arguments.scenes or SCENES, chosen, arguments.seeds, arguments.steps, arguments.seconds,
        arguments.trainings,
    )  # fmt: skip
    folder = Path(arguments.out)
    if arguments.page:
        found = open_store(arguments.store, create=False).study(arguments.name).done()
        done = gathered(tasks, found, known=known_in)
    else:
        with asked_executor(arguments) as executor:
            require_writable(folder)
            study = open_store(arguments.store).begin(arguments.name, "benchmark", {})
            done = run_benchmark(tasks, executor, study, progress=None)
    write(done, folder, _command(arguments))
    print("\n".join(overview(done)))
    print(f"\nwritten to {folder}: {', '.join(FILES)}")
    return exit_code(done)


def _command(arguments: argparse.Namespace) -> str:
    """What decides the page, as it is typed."""
    words = ["domino", "benchmark", *arguments.scenes]
    for name in ("algorithms", "seeds", "steps", "seconds", "out", "workers"):
        value = getattr(arguments, name)
        if value is not None and not (name == "out" and value == DEFAULT_HOME):
            words += [f"--{name}", f"{value:g}" if name == "seconds" else str(value)]
    return shlex.join(words)
