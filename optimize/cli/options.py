"""Options and endings of all commands whose results go into a study."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from domino_env.cli.options import NATURAL, SECONDS
from domino_env.core.files import counted
from optimize.executors import add_executor_options, executor_from

if TYPE_CHECKING:
    from optimize.experiments.experiment import Experiment
    from optimize.experiments.store import Study
    from optimize.experiments.task import Task

DEFAULT_STORE = "runs/studies.sqlite"


def names_in(text: str) -> list[str]:
    """Return the names in a text with commas between them."""
    return [name.strip() for name in text.split(",")]


def add_methods_option(
    parser: argparse.ArgumentParser, shown: str, default: list[str] | None = None
) -> None:
    """Add --methods, a list of names."""
    parser.add_argument(
        "--methods", type=names_in, metavar="NAME,...", default=default, help=f"methods ({shown})"
    )


def add_limit_options(
    parser: argparse.ArgumentParser, of: str, budget: str = "none", seconds: str = "none"
) -> None:
    """Add --budget and --seconds, with their defaults in words."""
    parser.add_argument(
        "--budget", type=NATURAL, metavar="N", help=f"evaluations of {of} at most ({budget})"
    )
    parser.add_argument(
        "--seconds", type=SECONDS, metavar="S",
        help=f"time of {of} at most [s], not reproducible ({seconds})",
    )  # fmt: skip


def add_store_option(parser: Any) -> None:
    """Add --store."""
    parser.add_argument(
        "--store", metavar="FILE", default=DEFAULT_STORE, help="SQLite file (%(default)s)"
    )


def add_study_options(parser: argparse.ArgumentParser, name: str | None = None) -> None:
    """Add --workers, --dask, --store, --name and, without a default name, --resume."""
    add_executor_options(parser)
    group = parser.add_argument_group("study", "where results are stored, see domino studies")
    add_store_option(group)
    group.add_argument(
        "--name", default=name, help=f"name of the study ({name or 'from that of the scene'})"
    )
    if name is None:
        group.add_argument(
            "--resume", action="store_true",
            help="continue a study that was stopped, with the results it has",
        )  # fmt: skip


def study_from(
    arguments: argparse.Namespace,
    kind: str,
    default: str,
    tasks: Sequence[Task],
    settings: dict[str, Any],
) -> Study:
    """Begin the study of the options, or with ``--resume`` continue it where it exists.

    Parameters
    ----------
    arguments
        Options of `add_study_options`.
    kind
        "comparison" or "sweep".
    default
        Name where none is given; a number is added where that is taken, and ``--resume`` continues
        the last of these that has the same tasks.
    tasks
        All tasks of the experiment.
    settings
        Options that decide the tasks, which `domino studies` shows.

    Raises
    ------
    ValueError
        The name is taken and ``--resume`` is not given, or the study has other tasks.
    """
    from optimize.experiments.store import open_store
    from optimize.experiments.task import digest

    store = open_store(arguments.store)
    settings = {**settings, "tasks": len(tasks), "digest": digest([task.key for task in tasks])}
    studies = {study.name: study for study in store.studies()}
    name = arguments.name
    if name in studies and not arguments.resume:
        results = counted(studies[name].tasks, "result")
        raise ValueError(
            f"{store.path} has a study '{name}' with {results} already: "
            "continue it by --resume, or give another --name"
        )
    if name is None:
        pattern = re.compile(re.escape(default) + r"(-[0-9]+)?")
        named = [study for study in studies.values() if pattern.fullmatch(study.name)]
        if arguments.resume and named:
            same = [s.name for s in named if (s.kind, s.settings) == (kind, settings)]
            if not same:
                raise ValueError(
                    f"--resume: {store.path} has no study '{default}' of these tasks; `domino "
                    "studies` lists the others, one of which --name continues"
                )
            name = same[-1]
        else:
            names = [default, *(f"{default}-{n}" for n in range(2, len(studies) + 2))]
            name = next(one for one in names if one not in studies)
    return store.begin(name, kind, settings)


@contextmanager
def open_study(
    arguments: argparse.Namespace,
    kind: str,
    default: str,
    tasks: Sequence[Task],
    settings: dict[str, Any],
    folder: Path,
) -> Iterator[tuple[Study, dict[str, Any]]]:
    """Open the executor and the study of a command; an interruption says how to continue.

    Parameters
    ----------
    arguments, kind, default, tasks, settings
        As of `study_from`.
    folder
        Folder of the report, which must be writable.

    Yields
    ------
    study : Study
        The study.
    options : dict
        Arguments of `run_experiment`.
    """
    from domino_env.core.files import require_writable

    # the study comes last: an executor that does not answer leaves no empty one
    with executor_from(arguments) as executor:
        require_writable(folder)
        study = study_from(arguments, kind, default, tasks, settings)
        more = f"what is done is in study '{study.name}'; the same command with --resume continues"
        try:
            yield study, {
                "executor": executor, "study": study, "name": study.name, "progress": None,
            }  # fmt: skip
        except OSError as error:
            raise OSError(f"{error}; {more}") from None
        except KeyboardInterrupt:
            done = len(study.done())
            reason = (
                f": {done} of {len(tasks)} runs are complete; {more}"
                if done
                else " before any was complete"
            )
            raise KeyboardInterrupt(f"interrupted{reason}") from None


def exit_code(experiment: Experiment) -> int:
    """Print the failures of an experiment and return 1 if there are any, else 0.

    Raises
    ------
    KeyboardInterrupt
        The experiment was interrupted.
    """
    for failure in experiment.failures:
        print(f"domino: {failure.task.name} failed: {failure.reason}", file=sys.stderr)
    if experiment.interrupted:
        raise KeyboardInterrupt
    return 1 if experiment.failures else 0
