"""Studies by name, and the results in them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sql

from optimize.studies import models
from optimize.studies.database import Database
from optimize.studies.task import TaskResult

LONGEST_NAME = 200  # characters of a study's name


@dataclass(frozen=True)
class Study:
    """The results of a comparison or a sweep.

    Attributes
    ----------
    name
        As it was begun.
    kind
        For instance ``"comparison"`` or ``"sweep"``.
    begun
        When [UTC, ISO 8601].
    settings
        What decides its tasks.
    tasks
        How many were finished when it was asked for.
    """

    name: str
    kind: str
    begun: str
    settings: dict[str, Any]
    tasks: int
    _number: int = field(repr=False)
    _database: Database = field(repr=False)

    def done(self) -> dict[str, TaskResult]:
        """Finished tasks by key, in the order in which they were added.

        Raises
        ------
        ValueError
            Where the store is damaged.
        """
        rows = (
            sql.select(models.Result, models.Scene.toml)
            .outerjoin(models.Scene)
            .where(models.Result.study == self._number)
            .order_by(models.Result.number)
        )
        with self._database.reading() as session:
            found = [models.result_of(row, scene) for row, scene in session.execute(rows)]
        return {result.key: result for result in found}

    def add(self, result: TaskResult) -> None:
        """Keep a result; where there is one of the same key already, that one stays.

        It is on the disk when this returns, and safe from other processes that do the same.

        Raises
        ------
        ValueError
            Where it cannot be kept: a full disk, a store that has become read-only, another process
            that writes without end, a score that is no number. All that was kept before is intact
            then.
        """
        cells = models.cells_of(result)
        with self._database.writing() as session:
            self._database.insert_if_new(
                session, models.Scene, digest=cells["scene"], toml=result.scene
            )
            self._database.insert_if_new(session, models.Result, study=self._number, **cells)


class Store:
    """Studies by name; `optimize.studies.open_store` opens one."""

    def __init__(self, database: Database) -> None:
        self._database = database

    @property
    def where(self) -> str:
        """The file, or the URL without its password."""
        return self._database.where

    def begin(self, name: str, kind: str, settings: Mapping[str, Any]) -> Study:
        """Begin a study, or go on with the one of that name.

        Parameters
        ----------
        name
            1 to 200 printable characters.
        kind
            What sort of study it is, such as ``"sweep"``.
        settings
            All that decides its tasks, as JSON can say it.

        Raises
        ------
        ValueError
            Where the study of that name has another kind or other settings, for a name or settings
            that cannot be kept, and where the store cannot be written.
        """
        if not name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
            raise ValueError(
                f"a study cannot be called {name[:LONGEST_NAME]!r}: give 1 to {LONGEST_NAME} "
                "printable characters"
            )
        asked = _plain(settings)
        found = self._named(name)  # before anything is written: the store may be read-only
        if not found:
            now = datetime.now(UTC).isoformat(timespec="seconds")
            with self._database.writing() as session:
                self._database.insert_if_new(
                    session, models.Study, name=name, kind=kind, settings=asked, begun=now
                )
            found = self._named(name)
        study = found[0]
        if difference := _difference(study, kind, asked):
            raise ValueError(
                f"study '{name}' in {self.where} was begun with {difference}: go on with what it "
                "was begun with, or name another study"
            )
        return study

    def studies(self) -> list[Study]:
        """All studies, in the order in which they were begun."""
        return self._studies(sql.true())

    def study(self, name: str) -> Study:
        """Find a study.

        Raises
        ------
        ValueError
            Where there is none of that name; it names others.
        """
        found = self._named(name)
        if not found:
            known = ", ".join(f"'{one.name}'" for one in self.studies()[-10:]) or "none yet"
            raise ValueError(f"{self.where} has no study '{name}' (there: {known})")
        return found[0]

    def _named(self, name: str) -> list[Study]:
        return self._studies(models.Study.name == name)

    def _studies(self, which: sql.ColumnElement[bool]) -> list[Study]:
        tasks = (
            sql.select(sql.func.count())
            .where(models.Result.study == models.Study.number)
            .scalar_subquery()
        )
        rows = sql.select(models.Study, tasks).where(which).order_by(models.Study.number)
        with self._database.reading() as session:
            return [
                Study(s.name, s.kind, s.begun, s.settings, n, s.number, self._database)
                for s, n in session.execute(rows)
            ]


def _plain(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Settings as they will come back."""
    try:
        return dict(json.loads(json.dumps(dict(settings), sort_keys=True, allow_nan=False)))
    except (TypeError, ValueError) as error:
        raise ValueError(f"settings of a study must be plain JSON: {error}") from None


def _difference(study: Study, kind: str, asked: dict[str, Any]) -> str:
    """The first thing that was begun otherwise, in words; nothing where there is none."""
    if study.kind != kind:
        return f"kind = {study.kind!r}, not {kind!r}"
    for key in sorted({*study.settings, *asked}):
        was, now = (_short(of[key]) if key in of else "nothing" for of in (study.settings, asked))
        if was != now or study.settings.get(key) != asked.get(key):
            return f"{key!r} = {was}, not {now}"
    return ""


def _short(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else text[:79] + "…"
