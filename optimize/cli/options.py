"""Options and endings of all commands whose results go into a study."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from optimize.executors import add_executor_options, asked_executor

if TYPE_CHECKING:
    from domino_env.physics.layout import Layout
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
        "--budget", type=int, metavar="N", help=f"evaluations of {of} at most ({budget})"
    )
    parser.add_argument(
        "--seconds", type=float, metavar="S",
        help=f"time of {of} at most [s], not reproducible ({seconds})",
    )  # fmt: skip


def add_store_option(parser: Any) -> None:
    """Add --store."""
    parser.add_argument(
        "--store", metavar="FILE", default=DEFAULT_STORE, help="SQLite file (%(default)s)"
    )


def add_study_options(
    parser: argparse.ArgumentParser, name: str | None = None, *, resume: bool = True
) -> None:
    """Add --workers, --dask, --store, --name and --resume."""
    add_executor_options(parser)
    group = parser.add_argument_group("study", "where results are stored, see domino studies")
    add_store_option(group)
    group.add_argument(
        "--name", default=name, help=f"name of the study ({name or 'from that of the scene'})"
    )
    if resume:
        group.add_argument(
            "--resume", action="store_true",
            help="continue a study that was stopped, with the results it has",
        )  # fmt: skip


def asked_study(
    arguments: argparse.Namespace,
    kind: str,
    default: str,
    tasks: Sequence[Task],
    settings: dict[str, Any],
) -> Study:
    """Find or begin the study to keep tasks in.

    Parameters
    ----------
    arguments
        The options of `add_study_options`.
    kind
        "comparison" or "sweep".
    default
        Its name where none is given; a number is added where that is taken, and ``--resume``
        continues the last of them that has the same tasks.
    tasks
        All that are to be done.
    settings
        The options, for people to read.

    Raises
    ------
    ValueError
        For a name that is taken without ``--resume``; with it where there is no such study, or one
        with other tasks.
    """
    from optimize.experiments.store import open_store
    from optimize.experiments.task import digest

    store = open_store(arguments.store)
    full = {**settings, "tasks": len(tasks), "digest": digest([task.key for task in tasks])}
    known = {one.name: one for one in store.studies()}
    name = arguments.name
    if name is not None:
        if name in known and not arguments.resume:
            raise ValueError(
                f"{store.path} has a study '{name}' with {known[name].tasks} results already: "
                "continue it by --resume, or give another --name"
            )
        if name not in known and arguments.resume:
            raise ValueError(f"--resume: {store.path} has no study '{name}' to continue")
        return store.begin(name, kind, full)
    ours = re.compile(re.escape(default) + r"(-[0-9]+)?")
    if arguments.resume:
        for one in reversed(known.values()):
            if ours.fullmatch(one.name) and (one.kind, one.settings) == (kind, full):
                return one
        raise ValueError(
            f"--resume: {store.path} has no study '{default}' of these tasks; `domino studies` "
            "lists what it has, and --name says which"
        )
    names = (
        default if number == 1 else f"{default}-{number}" for number in range(1, len(known) + 2)
    )
    return store.begin(next(name for name in names if name not in known), kind, full)


@contextmanager
def opened_study(
    arguments: argparse.Namespace,
    kind: str,
    default: str,
    tasks: Sequence[Task],
    settings: dict[str, Any],
    folder: Path | None,
) -> Iterator[tuple[Study, dict[str, Any]]]:
    """Open the executor and the study of a command; whatever ends it says how to continue.

    Parameters
    ----------
    arguments, kind, default, tasks, settings
        As of `asked_study`.
    folder
        Folder of the report, which must have room; None for one in ``runs``.

    Yields
    ------
    study : Study
        The study.
    how : dict
        Arguments of `run_experiment`: executor, study and progress.
    """
    from domino_env.core.files import require_writable
    from optimize.experiments.runner import Progress

    # the study comes last: an executor that does not answer leaves no empty one
    with asked_executor(arguments) as executor:
        require_writable(folder or Path("runs"))
        study = asked_study(arguments, kind, default, tasks, settings)
        try:
            yield study, {"executor": executor, "study": study, "progress": Progress(study.name)}
        except (KeyboardInterrupt, OSError) as end:
            more = f"what is done is in study '{study.name}'; the same command with --resume"
            if isinstance(end, OSError):
                raise OSError(f"{end}; {more} continues") from None
            done = len(study.done())
            told = f": {done} runs are complete; {more} continues"
            raise KeyboardInterrupt(
                f"interrupted{told if done else ' before any run was complete'}"
            ) from None


def write_layout(layout: Layout, file: str) -> None:
    """Write a layout to a .csv or .json file; ValueError for another one, or where that fails."""
    path = Path(file)
    write = {".csv": layout.to_csv, ".json": layout.to_json}.get(path.suffix.lower())
    if write is None:
        raise ValueError(f"{path}: a layout is written to a .csv or .json file")
    try:
        write(path)
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {error.strerror}") from None


def exit_code(experiment: Experiment) -> int:
    """Print the failures of an experiment; 1 if there are any. Raise KeyboardInterrupt again."""
    for failure in experiment.failures:
        print(f"domino: {failure.task.name} failed: {failure.reason}", file=sys.stderr)
    if experiment.interrupted:
        raise KeyboardInterrupt
    return 1 if experiment.failures else 0
