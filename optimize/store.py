"""The study store: results of comparisons and sweeps in one place, which several processes write.

store = open_store("runs/studies.sqlite")       # or "postgresql://user@host/studies"
study = store.begin("friction", "sweep", {"evaluations": 5000})
study.add(run_task(task))                       # safe from several processes; the first stays
study.done()                                    # finished tasks by key: these need not run again

SQLite by default, one file that any tool for SQLite can query; PostgreSQL (extra "postgres") where
machines share it.  Tables: `studies`, `results`, `scenes`, and `domino_store` with the version of
the schema; see `optimize.store_tables`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from optimize.store_tables import Tables
    from optimize.task import TaskResult

DEFAULT_STORE = "runs/studies.sqlite"
LONGEST_NAME = 200  # characters of a study's name


@dataclass(frozen=True)
class StudyInfo:
    """A study in one line.

    name, kind: as it was begun, kind for instance "comparison" or "sweep".
    begun: UTC, ISO 8601.  tasks: how many are finished.  settings: what decides its tasks.
    """

    name: str
    kind: str
    begun: str
    tasks: int
    settings: dict[str, Any]


class Store:
    """Studies by name.  It holds no connection, so it may be used after a fork, and by threads."""

    def __init__(self, tables: Tables) -> None:
        self._tables = tables

    @property
    def where(self) -> str:
        """The file, or the URL without its password."""
        return self._tables.where

    def begin(self, name: str, kind: str, settings: Mapping[str, Any]) -> Study:
        """A new study, or the one of that name to go on with.

        settings: all that decides its tasks, as JSON can say it.
        ValueError where the study of that name has another kind or other settings, for a name that
        is empty, too long or not printable, and where the store cannot be written.
        """
        _require_name(name)
        text = _settings_text(settings)
        number, known_kind, known_text = self._tables.begin(name, kind, text)
        if (known_kind, known_text) != (kind, text):
            differs = _difference(known_kind, known_text, kind, text)
            raise ValueError(
                f"study '{name}' in {self.where} was begun with {differs}: go on with what it was "
                "begun with, or name another study"
            )
        return Study(self._tables, number, name, kind)

    def studies(self) -> list[StudyInfo]:
        """All studies, in the order in which they were begun."""
        return [
            StudyInfo(name, kind, begun, tasks, self._tables.settings(name, text))
            for name, kind, begun, text, tasks in self._tables.studies()
        ]

    def study(self, name: str) -> Study:
        """A study that is there.  ValueError with the names of the others where it is not."""
        found = {row[0]: row[1] for row in self._tables.studies()}
        if name not in found:
            known = ", ".join(f"'{n}'" for n in list(found)[-10:]) or "none yet"
            raise ValueError(f"{self.where} has no study '{name}' (there: {known})")
        return Study(self._tables, self._tables.number(name), name, found[name])


class Study:
    """The results of one study; `name` and `kind` as it was begun."""

    def __init__(self, tables: Tables, number: int, name: str, kind: str) -> None:
        self._tables, self._number = tables, number
        self.name, self.kind = name, kind

    def done(self) -> dict[str, TaskResult]:
        """The finished tasks by key, in the order in which they were added.

        ValueError for a result that no program of ours has written.
        """
        return self._tables.results(self._number)

    def add(self, result: TaskResult) -> None:
        """Keep a result; where there is one of the same key already, that one stays.

        It is on the disk when this returns.  ValueError where that cannot be: a full disk, a store
        that has become read-only, another process that writes without end; all that was kept
        before is intact then.
        """
        self._tables.add(self._number, result)


def open_store(where: str | Path = DEFAULT_STORE, *, create: bool = True) -> Store:
    """The store in a file, or at an SQLAlchemy URL (sqlite:///…, postgresql://…).

    create: begin an empty one where there is none.
    ValueError, and nothing changed, for a file that is no store or is damaged, a store that a newer
    version of this program has written, a place that cannot be written, a server that does not
    answer; ImportError where the extra "postgres" is missing.
    """
    from optimize.store_access import access
    from optimize.store_tables import Tables

    return Store(Tables(access(where, create=create), create=create))


def _require_name(name: str) -> None:
    if not name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
        raise ValueError(
            f"a study cannot be called {name[:LONGEST_NAME]!r}: give 1 to {LONGEST_NAME} "
            "printable characters"
        )


def _settings_text(settings: Mapping[str, Any]) -> str:
    try:
        return json.dumps(dict(settings), sort_keys=True, allow_nan=False)
    except (TypeError, ValueError, RecursionError) as error:
        raise ValueError(f"settings of a study must be plain JSON: {error}") from None


def _difference(known_kind: str, known_text: str, kind: str, text: str) -> str:
    """The first thing in which two studies differ, in words."""
    if known_kind != kind:
        return f"kind = {known_kind[:80]!r}, not {kind!r}"
    try:
        known = json.loads(known_text)
    except (ValueError, RecursionError):
        known = None
    if not isinstance(known, dict):
        return "settings that cannot be read"
    asked = json.loads(text)
    for key in sorted({*known, *asked}):
        if key not in known or key not in asked or known[key] != asked[key]:
            told = [_short(of[key]) if key in of else "nothing" for of in (known, asked)]
            return f"{key[:80]!r} = {told[0]}, not {told[1]}"
    return "other settings"


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else text[:79] + "…"
