"""Store of studies: one SQLite file with the results of experiments.

Every result is stored when its task is finished.

    store = open_store("runs/studies.sqlite")
    study = store.begin("friction", "sweep", {"budget": 5000})
    study.add(task.run())                # on the disk when it returns
    study.results()                      # by key: these tasks need not run again

Table ``studies`` has a line per study, ``results`` one per task: columns for common queries, and
the whole `TaskResult` as JSON in ``data``. Several processes of one machine may write to a store;
Dask workers return their results to the process that writes.
"""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from domino_env.core.checks import as_path, require_extra
from domino_env.core.files import as_text, one_line, require_locks, require_writable, write_bytes
from domino_env.core.tables import write_csv
from optimize.experiments.task import TaskResult

STUDY_NAME = re.compile(r"(?!\.+$)[^/\\]{1,200}")  # it may name a folder
LOCK_TIMEOUT = 60.0  # [s] that a process waits for others to finish writing
TABLES = (
    "CREATE TABLE IF NOT EXISTS studies (number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, "
    "kind TEXT NOT NULL, settings TEXT NOT NULL, begun TEXT NOT NULL)",
    "CREATE TABLE IF NOT EXISTS results (number INTEGER PRIMARY KEY, "
    "study INTEGER NOT NULL REFERENCES studies (number), key TEXT NOT NULL, "
    "scene_name TEXT NOT NULL, method TEXT NOT NULL, seed INTEGER NOT NULL, score REAL NOT NULL, "
    "data TEXT NOT NULL, UNIQUE (study, key))",
)


@dataclass(frozen=True)
class Study:
    """Results of one experiment.

    Attributes
    ----------
    name
        Name of the study.
    kind
        Kind of experiment, such as "comparison" or "sweep".
    begun
        Time at which it was begun, in UTC and ISO 8601.
    settings
        Settings that determine its tasks.
    result_count
        Number of results when the study was read.
    """

    name: str
    kind: str
    begun: str
    settings: dict[str, Any]
    result_count: int
    _number: int = field(repr=False)
    _store: Store = field(repr=False)

    def results(self) -> dict[str, TaskResult]:
        """Return the results by key, in the order in which they were added.

        Raises
        ------
        ValueError
            If the store is damaged.
        """
        query = "SELECT data FROM results WHERE study = ? ORDER BY number"
        with self._store.transaction() as connection:
            lines = connection.execute(query, (self._number,)).fetchall()
            results = [msgspec.json.decode(data, type=TaskResult) for (data,) in lines]
        return {result.key: result for result in results}

    def add(self, result: TaskResult) -> None:
        """Store a result, unless there is one with the same key.

        Raises
        ------
        ValueError
            If the result cannot be stored: the disk is full, the store is locked for more than a
            minute, or a number is not finite. All earlier results are intact.
        """
        data = json.dumps(msgspec.to_builtins(result), allow_nan=False)
        task = result.key, result.scene_name, result.method, result.seed
        with self._store.transaction() as connection:
            connection.execute(
                "INSERT OR IGNORE INTO results (study, key, scene_name, method, seed, score, data) "
                "VALUES (?, ?, ?, ?, ?, ?, ?)",
                (self._number, *task, result.score, data),
            )


@dataclass(frozen=True)
class Store:
    """Studies by name, in a file that `open_store` opened; no connection outlives a call."""

    path: Path

    def begin(self, name: str, kind: str, settings: Mapping[str, Any]) -> Study:
        """Begin a study, or continue the one of that name.

        Parameters
        ----------
        name
            1 to 200 printable characters, no slash or backslash.
        kind
            Kind of experiment, such as "sweep".
        settings
            Settings that determine its tasks, of types that JSON has.

        Returns
        -------
        Study
            The study, with the results so far.

        Raises
        ------
        ValueError
            If the study of that name has another kind or other settings, if the name is invalid or
            a number in the settings is not finite, or if the store cannot be written.
        """
        if not name.isprintable() or not STUDY_NAME.fullmatch(name):
            expected = "1 to 200 printable characters without / and \\"
            raise ValueError(f"study name = {as_text(name)}: give {expected}")
        text = json.dumps(dict(settings), allow_nan=False)
        begun = datetime.now(UTC).isoformat(timespec="seconds")
        with self.transaction() as connection:
            connection.execute(
                "INSERT OR IGNORE INTO studies (name, kind, settings, begun) VALUES (?, ?, ?, ?)",
                (name, kind, text, begun),
            )
        study = self.study(name)
        own, given = study.settings, json.loads(text)
        if (study.kind, own) != (kind, given):
            differing = {key: value for key, value in own.items() if value != given.get(key)}
            raise ValueError(
                f"study '{name}' in {self.path} was begun as {study.kind} with "
                f"{one_line(str(differing), 200)}: give the same, or name another study or folder"
            )
        return study

    def studies(self) -> list[Study]:
        """Return all studies, in the order in which they were begun."""
        with self.transaction() as connection:
            lines = connection.execute(
                "SELECT name, kind, begun, settings, number, "
                "(SELECT count(*) FROM results WHERE study = studies.number) "
                "FROM studies ORDER BY number"
            ).fetchall()
            return [
                Study(name, kind, begun, json.loads(settings), result_count, number, self)
                for name, kind, begun, settings, number, result_count in lines
            ]

    def study(self, name: str) -> Study:
        """Return the study of a name.

        Raises
        ------
        ValueError
            If there is none; the message has the last ten names.
        """
        studies = {study.name: study for study in self.studies()}
        if name not in studies:
            names = ", ".join(f"'{study}'" for study in list(studies)[-10:])
            known = f"choose one of {names}" if names else "it has no studies yet"
            raise ValueError(f"{self.path} has no study '{name}': {known}")
        return studies[name]

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Open a transaction, which is written completely or not at all, after those already open.

        Raises
        ------
        ValueError
            If SQLite fails; the message has the file, the reason and the next action.
        """
        try:
            with closing(sqlite3.connect(self.path, LOCK_TIMEOUT)) as connection, connection:
                yield connection
        except (sqlite3.Error, msgspec.MsgspecError, json.JSONDecodeError) as error:
            raise ValueError(
                f"{self.path}: {error}: if the disk is full or another program locks the file, end "
                "that and continue with --resume, stored results are kept; if it is damaged or no "
                "store of studies, name another file"
            ) from None


def open_store(path: str | Path, *, create: bool = True) -> Store:
    """Open a store of studies.

    Parameters
    ----------
    path
        SQLite file.
    create
        If True, an empty store is created if there is none.

    Returns
    -------
    Store
        The store, which threads and forked processes may share.

    Raises
    ------
    ValueError
        If the file is a folder, is damaged, is not a store, or cannot be written or locked; it is
        not changed. Without `create`, also if there is no file.
    """
    path = as_path("path", path)
    if path.is_dir():
        raise ValueError(f"{path} is a folder: name the file of a store, such as studies.sqlite")
    if not path.exists() or not (create or path.stat().st_size):  # an empty file is not a store
        if not create:
            raise ValueError(f"{path} holds no store: give the file of one (--store)")
        require_writable(path.parent)
        path.parent.mkdir(parents=True, exist_ok=True)
    require_locks(path.parent)
    store = Store(path)
    with store.transaction() as connection:
        if not connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            # all tables or none, whatever ends this process, and once if others do the same
            connection.execute("BEGIN IMMEDIATE")
            for table in TABLES:
                connection.execute(table)
        # fails if the file is not a store
        connection.execute("SELECT data, settings FROM results, studies LIMIT 0")
    return store


def export_study(study: Study, path: Path) -> int:
    """Write all results of a study to a ``.csv`` or ``.parquet`` file, and return their number.

    The columns are the name of the study, and those of `result_cells`; see `write_table`.
    """
    lines = [{"study": study.name} | result_cells(r) for r in study.results().values()]
    write_table(path, lines)
    return len(lines)


def write_table(path: Path, lines: list[dict[str, Any]]) -> None:
    """Write lines, each a dictionary by column, to a ``.csv`` or ``.parquet`` file.

    A CSV file has lists as JSON.

    Raises
    ------
    ValueError
        If the name of the file has another ending.
    OSError
        If the file cannot be written.
    ImportError
        If the extra ``parquet`` is missing.
    """
    kind = path.suffix.lower()
    if kind not in (".csv", ".parquet"):
        raise ValueError(f"{path}: name a .csv or .parquet file")
    names = list(dict.fromkeys(name for line in lines for name in line))
    if kind == ".csv":
        for line in lines:
            line.update({k: json.dumps(v) for k, v in line.items() if isinstance(v, tuple | list)})
        write_csv(path, names, (map(line.get, names) for line in lines))
    else:
        require_extra("Parquet", "parquet", "pyarrow")
        import pyarrow
        from pyarrow import parquet

        columns = {name: [line.get(name) for line in lines] for name in names}
        for values in columns.values():  # of a sweep, such as 4.0 and "released"
            if any(isinstance(v, str) for v in values):
                values[:] = [
                    v if v is None or isinstance(v, str) else json.dumps(v) for v in values
                ]
        write_bytes(path, lambda file: parquet.write_table(pyarrow.table(columns), file))


def result_cells(result: TaskResult) -> dict[str, Any]:
    """Return the cells of a result by column.

    The columns are the fields of `TaskResult`, in SI units, each count of its ``work``, each column
    of its trace (``trace.NAME``), and each label (``label.NAME`` if another column has that name).
    """
    cells = msgspec.structs.asdict(result)
    labels, work, trace = (cells.pop(name) for name in ("labels", "work", "trace"))
    cells |= work | {"versions": json.dumps(result.versions)}
    cells |= {f"trace.{name}": column for name, column in trace.items()}
    return cells | {f"label.{k}" if k in cells else k: value for k, value in labels.items()}


def best_result(study: Study, name: str) -> TaskResult:
    """Return the best result of a scene, or of a point of a sweep.

    Parameters
    ----------
    study
        The study.
    name
        Name of a scene, or point of a sweep as `TaskResult.problem` has it.

    Raises
    ------
    ValueError
        If no result, or results of more than one scene, match.
    """
    results = list(study.results().values())
    matching = [r for r in results if name in (r.scene_name, r.problem)]
    number = len({r.scene for r in matching})
    if number != 1:
        names = list(dict.fromkeys(f"'{r.problem}'" for r in results))[:8]  # enough for a message
        raise ValueError(
            f"study '{study.name}' has {number or 'no'} scenes called '{name}': name one of "
            f"{', '.join(names) or 'no results yet'}"
        )
    return max(matching, key=lambda r: r.score)
