"""The options of all commands whose results go into a study, and the study that is asked for."""

from __future__ import annotations

import argparse
import hashlib
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from optimize.store import DEFAULT_STORE

if TYPE_CHECKING:
    from optimize.store import Store, Study
    from optimize.task import Task


def add_study_options(parser: argparse.ArgumentParser) -> None:
    """--store, --name, --resume."""
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
    """The study to keep these tasks in.

    kind: "comparison" or "sweep".  default: its name where none is given; a number is added where
    that is taken, and --resume goes on with the last of them that has the same tasks.
    settings: what was asked, for people to read.
    ValueError for a name that is taken without --resume, and with it where there is no such study,
    or one with other tasks.
    """
    from optimize.store import open_store

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
        return _last_with(store, kind, default, full)
    name, number = default, 1
    while name in known:
        number += 1
        name = f"{default}-{number}"
    return store.begin(name, kind, full)


def _last_with(store: Store, kind: str, default: str, settings: dict[str, Any]) -> Study:
    """The last study of a default name that has the same tasks."""
    ours = re.compile(re.escape(default) + r"(-[0-9]+)?")
    for one in reversed(store.studies()):
        same = one.kind == kind and one.settings.get("digest") == settings["digest"]
        if same and ours.fullmatch(one.name):
            return store.begin(one.name, kind, settings)
    raise ValueError(
        f"--resume: {store.where} has no study '{default}' of these tasks; `domino studies` lists "
        "what it has, and --name says which"
    )
