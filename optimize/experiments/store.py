"""Store of studies: one SQLite file with the results of experiments, kept as they come.

    store = open_store("runs/studies.sqlite")
    study = store.begin("friction", "sweep", {"budget": 5000})
    study.add(task.run())                # on the disk when it returns
    study.done()                         # by key: these tasks need not run again

Table ``studies`` has a line per study, ``results`` one per task: the columns that are asked for
most, and beside them the whole `TaskResult` as JSON in ``data``. Several processes of one machine
may write one store; Dask workers answer to the process that does.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import msgspec

from domino_env.core.files import require_writable, write_bytes
from domino_env.core.tables import write_csv
from optimize.experiments.task import TaskResult

PATIENCE = 60.0  # [s] that a process waits for others to finish writing
LONGEST_NAME = 200  # characters of a study's name
TABLES = (
    "CREATE TABLE IF NOT EXISTS studies (number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, "
    "kind TEXT NOT NULL, settings TEXT NOT NULL, begun TEXT NOT NULL)",
    "CREATE TABLE IF NOT EXISTS results (number INTEGER PRIMARY KEY, "
    "study INTEGER NOT NULL REFERENCES studies (number), key TEXT NOT NULL, "
    "scene_name TEXT NOT NULL, method TEXT NOT NULL, seed INTEGER NOT NULL, score REAL NOT NULL, "
    "data TEXT NOT NULL, UNIQUE (study, key))",
)
_KEPT = "this result is not kept, all earlier ones are"
_REASONS = {  # beginnings of SQLite's names of errors
    ("FULL", "IOERR"): f"cannot be written ({{}}): {_KEPT}; make room and continue with --resume",
    ("BUSY", "LOCKED"): f"other programs have been writing it for {PATIENCE:g} s: {_KEPT}",
    ("READONLY", "CANTOPEN", "PERM"): "cannot be opened ({}): name a file in a folder of yours",
    ("CORRUPT",): "is damaged ({}): name another file, or restore a copy",
    ("ERROR", "NOTADB"): "is no store of studies of this version ({}): name another file",
}


@dataclass(frozen=True)
class Study:
    """Results of one experiment.

    Attributes
    ----------
    name
        Name with which it was begun.
    kind
        For instance "comparison" or "sweep".
    begun
        Time of the beginning [UTC, ISO 8601].
    settings
        All that decides its tasks.
    tasks
        Number of results when the study was read.
    """

    name: str
    kind: str
    begun: str
    settings: dict[str, Any]
    tasks: int
    _number: int = field(repr=False)
    _store: Store = field(repr=False)

    def done(self) -> dict[str, TaskResult]:
        """Return the results by key, in the order in which they were added."""
        with self._store.connected() as connection:
            found = connection.execute(
                "SELECT data FROM results WHERE study = ? ORDER BY number", (self._number,)
            ).fetchall()
        try:
            results = [msgspec.json.decode(data, type=TaskResult) for (data,) in found]
        except (msgspec.DecodeError, TypeError) as error:
            raise ValueError(
                f"{self._store.path} is damaged ({error}): name another file, or restore a copy"
            ) from None
        return {result.key: result for result in results}

    def add(self, result: TaskResult) -> None:
        """Keep a result; where there is one of the same key already, that one stays.

        Raises
        ------
        ValueError
            Where it cannot be kept: a full disk, another process that writes without end, a number
            that is not finite. All earlier results are intact.
        """
        data = msgspec.json.encode(result)
        try:
            same = msgspec.json.decode(data, type=TaskResult) == result
        except msgspec.DecodeError as error:  # JSON has no NaN
            raise ValueError(f"task {result.key}: its result cannot be kept: {error}") from None
        if not same:
            raise ValueError(f"task {result.key}: its result is not the same after reading it back")
        with self._store.connected() as connection:
            connection.execute(
                "INSERT OR IGNORE INTO results (study, key, scene_name, method, seed, score, data) "
                "VALUES (?, ?, ?, ?, ?, ?, ?)",
                (
                    self._number, result.key, result.scene_name, result.method, result.seed,
                    result.score, data.decode(),
                ),
            )  # fmt: skip


class Store:
    """Studies by name; `open_store` opens one. It holds no connection between two calls."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, name: str, kind: str, settings: Mapping[str, Any]) -> Study:
        """Begin a study, or continue the one of that name.

        Parameters
        ----------
        name
            1 to 200 printable characters.
        kind
            For instance "sweep".
        settings
            All that decides its tasks, as JSON can hold it.

        Raises
        ------
        ValueError
            Where the study of that name has another kind or other settings, for an impossible name
            or settings, and where the store cannot be written.
        """
        if not name.strip() or len(name) > LONGEST_NAME or not name.isprintable():
            raise ValueError(
                f"a study cannot be called {name[:LONGEST_NAME]!r}: give 1 to {LONGEST_NAME} "
                "printable characters"
            )
        asked = json.loads(json.dumps(dict(settings), allow_nan=False))
        if name not in {one.name for one in self.studies()}:  # else nothing is written
            now = datetime.now(UTC).isoformat(timespec="seconds")
            with self.connected() as connection:
                connection.execute(
                    "INSERT OR IGNORE INTO studies (name, kind, settings, begun) "
                    "VALUES (?, ?, ?, ?)",
                    (name, kind, json.dumps(asked), now),
                )
        study = self.study(name)
        was, now_asked = {"kind": study.kind} | study.settings, {"kind": kind} | asked
        for key in [*was, *now_asked]:
            if was.get(key) != now_asked.get(key):
                raise ValueError(
                    f"study '{name}' in {self.path} was begun with {key!r} = {was.get(key)!r}, not "
                    f"{now_asked.get(key)!r}: give what it was begun with, or name another study"
                )
        return study

    def studies(self) -> list[Study]:
        """Return all studies, in the order in which they were begun."""
        with self.connected() as connection:
            found = connection.execute(
                "SELECT name, kind, begun, settings, number, "
                "(SELECT count(*) FROM results WHERE study = studies.number) "
                "FROM studies ORDER BY number"
            ).fetchall()
        return [
            Study(name, kind, begun, json.loads(settings), tasks, number, self)
            for name, kind, begun, settings, number, tasks in found
        ]

    def study(self, name: str) -> Study:
        """Find a study; ValueError with the names of others where there is none of that name."""
        found = [one for one in self.studies() if one.name == name]
        if not found:
            known = ", ".join(f"'{one.name}'" for one in self.studies()[-10:]) or "none yet"
            raise ValueError(f"{self.path} has no study '{name}' (there: {known})")
        return found[0]

    @contextmanager
    def connected(self) -> Iterator[sqlite3.Connection]:
        """Open a transaction that is written whole or not at all, after those of other processes.

        Raises
        ------
        ValueError
            Where SQLite fails, with the file, the reason and the next action.
        """
        try:
            with closing(sqlite3.connect(self.path, PATIENCE)) as connection, connection:
                yield connection
        except sqlite3.Error as error:
            name = getattr(error, "sqlite_errorname", "").removeprefix("SQLITE_")
            for beginnings, reason in _REASONS.items():
                if name.startswith(beginnings):
                    raise ValueError(f"{self.path}: {reason.format(error)}") from None
            raise ValueError(f"{self.path}: {error}") from None
        except OverflowError as error:
            raise ValueError(f"{self.path}: a value cannot be kept: {error}") from None


def open_store(path: str | Path, *, create: bool = True) -> Store:
    """Open a store of studies.

    Parameters
    ----------
    path
        SQLite file.
    create
        Whether to begin an empty store where there is none.

    Returns
    -------
    Store
        Threads and forked processes may share it.

    Raises
    ------
    ValueError
        For a file that is damaged or no store, and a place that cannot be written. Nothing has
        changed then.
    """
    path = Path(path)
    if not path.exists():
        if not create:
            raise ValueError(f"there is no store {path}: name the one that a study was kept in")
        require_writable(path.parent)
    store = Store(path)
    with store.connected() as connection:
        if not connection.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            connection.execute("BEGIN IMMEDIATE")  # another process may be doing the same
            for table in TABLES:
                connection.execute(table)
        connection.execute("SELECT data, settings FROM results, studies LIMIT 0")
    return store


def export_study(study: Study, path: Path) -> int:
    """Write all results of a study to a ``.csv`` or ``.parquet`` file, and return their number.

    The columns are the fields of `TaskResult`, in SI units, then one for each label
    (``label.NAME`` where a field has that name). CSV has lists as JSON.

    Raises
    ------
    ValueError
        For another kind of file, and where it cannot be written.
    ImportError
        Where the extra ``parquet`` is missing.
    """
    kind = path.suffix.lower()
    if kind not in (".csv", ".parquet"):
        raise ValueError(f"{path}: a study is exported to a .csv or .parquet file")
    lines = [_line(study.name, result) for result in study.done().values()]
    names = list(dict.fromkeys(name for line in lines for name in line))
    columns = {name: [line.get(name) for line in lines] for name in names}
    try:
        if kind == ".csv":
            cells = [[_cell(value) for value in column] for column in columns.values()]
            write_csv(path, names, zip(*cells, strict=True))
        else:
            import pyarrow
            from pyarrow import parquet

            table = pyarrow.table({name: _same_kind(column) for name, column in columns.items()})
            write_bytes(path, lambda file: parquet.write_table(table, file))
    except ImportError:
        raise ImportError(
            "Parquet needs the extra 'parquet': pip install pyarrow, or export to .csv"
        ) from None
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {error.strerror or error}") from None
    return len(lines)


def best_result(study: Study, which: str | None) -> TaskResult:
    """Find the best result of a scene.

    Parameters
    ----------
    study
        Where to look.
    which
        The scene's name, or how the key of a result begins (four characters or more); None for the
        scene of a study that has only one.

    Raises
    ------
    ValueError
        Where nothing or several scenes match.
    """
    results = list(study.done().values())
    found = [
        r for r in results
        if which in (None, r.scene_name) or (len(which) >= 4 and r.key.startswith(which))
    ]  # fmt: skip
    number = len({r.scene for r in found})
    if number != 1:
        names = ", ".join(sorted({r.scene_name for r in results})[:8]) or "no results yet"
        what = f"called '{which}'" if which is not None else "in it"
        raise ValueError(
            f"study '{study.name}' has {number or 'no'} scenes {what}: name one of {names}, or one "
            "result by the first eight characters of its key, which 'domino studies show' gives"
        )
    return max(found, key=lambda r: r.score)


def _line(study: str, result: TaskResult) -> dict[str, Any]:
    """Return the cells of a result by column."""
    line = {"study": study} | msgspec.structs.asdict(result)
    labels = line.pop("labels")
    line["versions"] = json.dumps(result.versions)
    return line | {f"label.{k}" if k in line else k: value for k, value in labels.items()}


def _cell(value: Any) -> Any:
    return json.dumps(value) if isinstance(value, list | tuple) else value


def _same_kind(values: list[Any]) -> list[Any]:
    """Return values that one column of Parquet can hold: words where some are words."""
    words = any(isinstance(value, str) for value in values)
    return [str(v) if words and v is not None else v for v in values]
