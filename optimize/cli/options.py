"""Options of the commands that search, and exit codes of those that store a study."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from domino_env.cli.options import NATURAL, SECONDS, add_flags, add_options
from domino_env.core.files import amount, require_unused, require_writable
from optimize.executors import open_executor

if TYPE_CHECKING:
    from optimize.experiments.experiment import Experiment
    from optimize.experiments.store import Study
    from optimize.experiments.task import Task

STORE = ("store", str, "FILE", "runs/studies.sqlite", "SQLite file")
SETTINGS = ("scene", "scenes", "set", "methods", "seeds", "budget", "seconds")
"""Options that determine the tasks of a study; `domino studies` shows them."""


def split_names(text: str) -> list[str]:
    """Split a text at its commas into names."""
    return [name.strip() for name in text.split(",")]


def add_limit_options(
    parser: argparse.ArgumentParser, run: str, budget: str = "none", seconds: str = "none"
) -> None:
    """Add --budget and --seconds, the limits of each run.

    Parameters
    ----------
    parser
        Parser of the command.
    run
        Name of a run in the help, such as "each search".
    budget, seconds
        Defaults in the help.
    """
    time = f"time of {run} at most [s], not reproducible ({seconds})"
    add_options(
        parser,
        ("budget", NATURAL, "N", None, f"evaluations of {run} at most ({budget})"),
        ("seconds", SECONDS, "S", None, time),
    )


def add_executor_options(parser: argparse.ArgumentParser) -> None:
    """Add the options --workers and --dask."""
    group = parser.add_argument_group(
        "executor", "processes that do the work (this one); the results are the same"
    )
    dask = "tcp://HOST:PORT of a Dask scheduler, or local: a cluster of N workers on this machine"
    add_options(
        group,
        ("workers", NATURAL, "N", None, "number of processes"),
        ("dask", str, "ADDRESS", None, f'{dask} (extra "dist", docs/studies.md)'),
    )


def add_study_options(parser: argparse.ArgumentParser, name: str | None = None) -> None:
    """Add --workers, --dask, --store, --name and, without a default name, --resume.

    Parameters
    ----------
    parser
        Parser of the command.
    name
        Default of --name; None if the command derives one from its scenes.
    """
    add_executor_options(parser)
    group = parser.add_argument_group("study", "where results are stored, see domino studies")
    text = f"name of the study{' (from that of the scene)' * (name is None)}"
    add_options(group, STORE, ("name", str, "NAME", name, text))
    if name is None:
        add_flags(group, resume="continue a study that was stopped, with the results it has")


def open_study(
    arguments: argparse.Namespace, kind: str, default: str, tasks: Sequence[Task]
) -> Study:
    """Create the study of a command, or open the one that ``--resume`` continues.

    Parameters
    ----------
    arguments
        Options of the command; those in `SETTINGS` are stored with the study.
    kind
        "comparison" or "sweep".
    default
        Name if none is given; a number is added if a study has it. ``--resume`` continues the last
        study of the same tasks and versions, if there is one.
    tasks
        All tasks of the experiment.

    Returns
    -------
    Study
        The study.

    Raises
    ------
    ValueError
        If the name is invalid, if a study has it and ``--resume`` is not given, if the output
        folder of a new study contains another report, or if the study has other tasks or versions.
    """
    from optimize.experiments.report import COMPARISON_FILES, SWEEP_FILES
    from optimize.experiments.store import open_store
    from optimize.experiments.task import digest, installed_versions

    store = open_store(arguments.store)
    settings = {name: value for name, value in vars(arguments).items() if name in SETTINGS}
    settings |= {"tasks": len(tasks), "digest": digest([task.key for task in tasks])}
    settings |= {"versions": installed_versions()}
    studies = {study.name: study for study in store.studies()}
    name = arguments.name
    if name in studies and not arguments.resume:
        results = amount(studies[name].result_count, "result")
        raise ValueError(
            f"{store.path} has a study '{name}' with {results} already: "
            "continue it by --resume, or give another --name"
        )
    if name is None:
        same = [s.name for s in studies.values() if (s.kind, s.settings) == (kind, settings)]
        names = [default, *(f"{default}-{n}" for n in range(2, len(studies) + 2))]
        unused_name = next(name for name in names if name not in studies)
        name = same[-1] if arguments.resume and same else unused_name
    if name not in studies:
        require_unused(Path(arguments.out or f"runs/{name}"), (*COMPARISON_FILES, *SWEEP_FILES))
    return store.begin(name, kind, settings)


def run_study(
    arguments: argparse.Namespace, kind: str, default: str, tasks: Sequence[Task], **options: Any
) -> int:
    """Run the tasks of a command in a study, write the report, and print tables of a comparison.

    Parameters
    ----------
    arguments, kind, default, tasks
        See `open_study`. Without ``--out`` the report is written to runs/STUDY.
    **options
        Further arguments of `run_experiment`.

    Returns
    -------
    int
        Exit code, as of `exit_code`.

    Raises
    ------
    ValueError
        For the reasons of `open_study`.
    OSError
        If a file cannot be written; the message names the study that has the results.
    KeyboardInterrupt
        See `exit_code`.
    """
    from optimize.experiments.report import table, write
    from optimize.experiments.runner import run_experiment

    # the executor is opened first: if it does not answer, no empty study is created
    with open_executor(arguments.workers, arguments.dask) as executor:
        require_writable(Path(arguments.out or "runs"))
        study = open_study(arguments, kind, default, tasks)
        folder = Path(arguments.out or f"runs/{study.name}")
        next_step = f"results are in study '{study.name}'; the same command with --resume continues"
        stored = f", {study.result_count} of them done before" if study.result_count else ""
        number = amount(len(tasks), "search")
        print(f"study '{study.name}' in {arguments.store}: {number}{stored}", flush=True)
        try:
            experiment = run_experiment(
                tasks, executor, study, name=study.name, progress=None, **options
            )
            if kind == "comparison":
                for problem in experiment.problems:
                    print("", problem, *table(experiment, [problem]), sep="\n")
                print()
            files = ", ".join(write(experiment, folder))
            print(f"{amount(len(experiment.results), 'result')}; written to {folder}: {files}")
            return exit_code(experiment, next_step)
        except BrokenPipeError:  # only the output is lost
            raise
        except OSError as error:
            raise OSError(f"{error}; {next_step}") from None
        except KeyboardInterrupt:
            raise KeyboardInterrupt(f"interrupted: {next_step}") from None


def exit_code(experiment: Experiment, next_step: str = "the same command continues") -> int:
    """Print the failures of an experiment, and return the exit code.

    Parameters
    ----------
    experiment
        The experiment.
    next_step
        How it is continued after an interruption.

    Returns
    -------
    int
        1 if there are failures, else 0.

    Raises
    ------
    KeyboardInterrupt
        If the experiment was interrupted.
    """
    for failure in experiment.failures:
        print(f"domino: {failure.task.name} failed: {failure.reason}", file=sys.stderr)
    if experiment.interrupted:
        raise KeyboardInterrupt(f"interrupted: {next_step}")
    return 1 if experiment.failures else 0
