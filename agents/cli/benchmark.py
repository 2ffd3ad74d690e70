"""Benchmark learning algorithms over scenes and seeds.

Algorithms are trained, and compared with searches on a page. An algorithm is one of those of
`domino train`, a scripted policy (ramp), a search method (cma, auto) or a third-party algorithm:
`package.module:fit` with a function fit(make_env, steps, seed) that returns an object with
`predict`.

Every result is stored in the study when its run ends. Each training of an algorithm of `domino
train` has a folder in runs/benchmark. The same command executes missing runs, continues stopped
trainings and rewrites the page, which has all runs of the study, also those of earlier commands.
After Ctrl-C the page has all complete runs. Times are processor times.

The default scenes are varied-draw, varied-tempo, varied, draw, tempo-noise, sprint, course,
sprint-thickness and ideal. In those named varied every episode has a new scene, and scores are
median gains in the test set. In scenes named draw or tempo episodes are random: scores are means
over episodes, and the open-loop plan and the rule or the controller take the place of searches.

--check FILE checks the lines of a benchmark.csv (columns, scenes, seeds, ranges, revision) and
prints their tables; with --page it writes the page of these runs.
"""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from domino_env.cli.options import NATURAL, SECONDS, add_flags, add_options, add_out_option
from optimize.cli.options import add_study_options, exit_code, split_names
from optimize.executors import open_executor

DEFAULT_FOLDER = "runs/benchmark"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `domino benchmark`."""
    parser.add_argument("scenes", metavar="SCENE", nargs="*", help="name or .toml file (see above)")
    algorithms = "algorithms (all of domino train, and ramp, cma, auto)"
    add_options(
        parser,
        ("algorithms", split_names, "NAME,...", None, algorithms),
        ("seeds", NATURAL, "N", 10, "number of seeds, from 100 on"),
        ("steps", NATURAL, "N", None, "largest number of dominoes to place in a training"),
        ("seconds", SECONDS, "S", None, "processor time of a search [s]; varied: 0.04 S per scene"),
    )
    add_out_option(parser, DEFAULT_FOLDER)
    parser.add_argument(
        "--check", type=Path, metavar="FILE", help="check a benchmark.csv (see above)"
    )
    add_flags(parser, page="write the page of the study without running anything")
    add_study_options(parser, "benchmark")


def run(arguments: argparse.Namespace) -> int:
    """Execute missing runs, write the page, print its table; return 1 if a run failed, else 0."""
    from agents.algorithms import ALGORITHMS, require_learning
    from agents.benchmark import BASELINES, ENVIRONMENT, SCENES, benchmark_tasks
    from agents.benchmark_report import FILES, gather, read_runs, tables, write
    from domino_env.core.files import amount, require_writable
    from optimize.experiments.runner import run_experiment
    from optimize.experiments.store import open_store

    folder, experiment = arguments.out, None
    if arguments.check is not None:
        experiment = gather(read_runs(arguments.check))
        print(f"{arguments.check}: {amount(len(experiment.results), 'run')}, no error\n")
        print("\n".join(tables(experiment)))
        if arguments.page:
            write(experiment, folder, _command(arguments))
        return 0
    algorithms = arguments.algorithms or [*ALGORITHMS, *BASELINES]
    tasks = benchmark_tasks(
        arguments.scenes or SCENES, algorithms, arguments.seeds, arguments.steps, arguments.seconds
    )
    if {*algorithms} & {*ALGORITHMS} and not arguments.page:
        require_learning()
    with open_executor(arguments.workers, arguments.dask) as executor:
        require_writable(folder)
        settings = {"environment": ENVIRONMENT}
        study = open_store(arguments.store, create=not arguments.page).begin(
            arguments.name, "benchmark", settings
        )
        if not arguments.page:
            experiment = run_experiment(tasks, executor, study, name="benchmark", progress=None)
    experiment = gather(study.results().values(), experiment)
    write(experiment, folder, _command(arguments))
    print("\n".join(tables(experiment)))
    print(f"\nwritten to {folder}: {', '.join(FILES)}")
    return exit_code(experiment)


def _command(arguments: argparse.Namespace) -> str:
    """Return the command line of the page, with the options that the results depend on."""
    words = ["domino", "benchmark", *arguments.scenes]
    names = ("algorithms", "seeds", "steps", "seconds")  # of runs
    for name in (*(names if arguments.check is None else ("check",)), "out", "workers"):
        value = getattr(arguments, name)
        if value is not None and str(value) != DEFAULT_FOLDER:
            text = {list: ",".join, float: "{:g}".format}.get(type(value), str)
            words += [f"--{name}", text(value)]
    return shlex.join(words + ["--page"] * (arguments.check is not None))
