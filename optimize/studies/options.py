"""The options of all commands whose results go into a study, and the study that is asked for."""

from __future__ import annotations

import argparse
import hashlib
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from optimize.studies import DEFAULT_STORE, open_store

if TYPE_CHECKING:
    from optimize.studies import Store, Study
    from optimize.studies.task import Task


def add_study_options(parser: argparse.ArgumentParser) -> None:
    """Add --store, --name and --resume."""
    group = parser.add_argument_group("study", "where results are kept as they come")
    group.add_argument(
        "--store",
        metavar="FILE",
        default=DEFAULT_STORE,
        help="an SQLite file or a postgresql:// URL (%(default)s); see domino studies",
    )
    group.add_argument("--name", metavar="NAME", help="of the study (from the scene's name)")
    group.add_argument(
        "--resume",
        action="store_true",
        help="go on with a study that was stopped: what it has is not run again",
    )


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
        What `add_study_options` has read.
    kind
        ``"comparison"`` or ``"sweep"``.
    default
        Its name where none is given; a number is added where that is taken, and ``--resume`` goes
        on with the last of them that has the same tasks.
    tasks
        All that are to be done.
    settings
        What was asked, for people to read.

    Raises
    ------
    ValueError
        For a name that is taken without ``--resume``; with it where there is no such study, or one
        with other tasks.
    """
    store = open_store(arguments.store)
    keys = hashlib.sha256(" ".join(task.key for task in tasks).encode()).hexdigest()[:32]
    full = {**settings, "tasks": len(tasks), "digest": keys}
    known = {one.name: one for one in store.studies()}
    if arguments.name is not None:
        name = arguments.name
        if name in known and not arguments.resume:
            raise ValueError(
                f"{store.where} has a study '{name}' with {known[name].tasks} results already: "
                "go on with it by --resume, or give another --name"
            )
        if name not in known and arguments.resume:
            raise ValueError(f"--resume: {store.where} has no study '{name}' to go on with")
        return store.begin(name, kind, full)
    if arguments.resume:
        return _last_with(store, known.values(), kind, default, keys)
    name, number = default, 1
    while name in known:
        number += 1
        name = f"{default}-{number}"
    return store.begin(name, kind, full)


@contextmanager
def going_on(study: Study) -> Iterator[None]:
    """Have whatever ends a command say what is done, and how to go on."""
    try:
        yield
    except (KeyboardInterrupt, OSError) as end:
        go_on = f"what is done is in study '{study.name}'; the same command with --resume goes on"
        if isinstance(end, OSError):
            raise OSError(f"{end}; {go_on}") from None
        done = len(study.done())
        said = f": {done} runs are complete; {go_on}" if done else " before any run was complete"
        raise KeyboardInterrupt(f"interrupted{said}") from None


def _last_with(store: Store, known: Iterable[Study], kind: str, default: str, digest: str) -> Study:
    """The last study of a default name that has the same tasks."""
    ours = re.compile(re.escape(default) + r"(-[0-9]+)?")
    for one in reversed(list(known)):
        same = one.kind == kind and one.settings.get("digest") == digest
        if same and ours.fullmatch(one.name):
            return one
    raise ValueError(
        f"--resume: {store.where} has no study '{default}' of these tasks; `domino studies` lists "
        "what it has, and --name says which"
    )
