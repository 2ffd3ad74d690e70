"""How a store is reached: SQLite or PostgreSQL, and what goes wrong there, in a sentence."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import sqlalchemy as sql
from sqlalchemy.engine import URL, Connection, Engine, make_url

from domino_env.files import require_room

PATIENCE = 60.0  # [s] that a process waits for others to finish writing
LARGEST_CELL = 64 * 2**20  # [bytes] of one value in an SQLite file: a row of a million dominoes
MAGIC = b"SQLite format 3\0"

_NOT_WRITTEN = "what was to be written is not kept, all that was there before is"


class Access:
    """Transactions on a database.

    engine: SQLAlchemy's, without a pool: a connection lives for one transaction, so that forks,
        threads and servers that restart have nothing to inherit.
    where: the file, or the URL without its password; for sentences.
    """

    def __init__(self, engine: Engine, where: str) -> None:
        self.engine, self.where = engine, where
        self._writer = engine.execution_options(writes=True)

    @property
    def is_file(self) -> bool:
        """Whether it is an SQLite file."""
        return self.engine.dialect.name == "sqlite"

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """A transaction that sees one state of everything."""
        with self._in_words(), self.engine.begin() as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """A transaction that is written whole, or not at all; waits for other writers first."""
        with self._in_words(), self._writer.begin() as connection:
            yield connection

    @contextmanager
    def _in_words(self) -> Iterator[None]:
        try:
            yield
        except sql.exc.DBAPIError as error:
            raise ValueError(f"{self.where}: {self._sentence(error)}") from None
        except sql.exc.SQLAlchemyError as error:
            raise ValueError(f"{self.where}: {_first_line(error)}") from None

    def _sentence(self, error: sql.exc.DBAPIError) -> str:
        cause = error.orig
        if not isinstance(cause, sqlite3.Error):
            full = getattr(cause, "sqlstate", None) == "53100"
            return f"{_first_line(cause)}; {_NOT_WRITTEN}" if full else _first_line(cause)
        name = getattr(cause, "sqlite_errorname", "") or ""
        # a file size limit, a quota and a failing disk are all told as an error of writing
        if name == "SQLITE_FULL" or name.startswith("SQLITE_IOERR"):
            return f"cannot be written ({cause}): {_NOT_WRITTEN}; make room and go on"
        if name.startswith(("SQLITE_BUSY", "SQLITE_LOCKED")):
            return f"other programs have been writing it for {PATIENCE:g} s: {_NOT_WRITTEN}"
        if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM")):
            return f"cannot be opened for writing ({cause}): name a file in a folder of yours"
        if name.startswith(("SQLITE_CORRUPT", "SQLITE_NOTADB")):
            return f"is damaged ({cause}): name another file, or bring back a copy"
        return _first_line(cause)


def access(where: str | Path, *, create: bool) -> Access:
    """See `optimize.store.open_store`."""
    if isinstance(where, str) and "://" in where:
        try:
            url = make_url(where)
        except sql.exc.ArgumentError:
            raise ValueError(
                "the store's URL cannot be read: give a file or postgresql://USER@HOST/DATABASE"
            ) from None
        if url.get_backend_name() in ("postgresql", "postgres"):
            return Access(_server(url.set(drivername="postgresql+psycopg")), url.render_as_string())
        if url.get_backend_name() != "sqlite" or not url.database:
            raise ValueError(
                f"{url.render_as_string()} is no place for a store: give a file, sqlite:///FILE or postgresql://…"
            )
        where = url.database
    path = Path(where)
    _require_file(path, create)
    return Access(_file(path), str(path))


def _require_file(path: Path, create: bool) -> None:
    """Refuse what cannot be a store before SQLite touches it."""
    try:
        if path.is_dir():
            raise ValueError(f"{path} is a folder: name a file for the store")
        if not path.exists():
            if not create:
                raise ValueError(f"there is no store {path}: name the one that a study was kept in")
            require_room(path.parent)
            return
        if not path.is_file():
            raise ValueError(f"{path} is no plain file: name one for the store")
        with path.open("rb") as file:
            start = file.read(len(MAGIC))
    except OSError as error:
        raise ValueError(f"{path} cannot be opened: {error.strerror}") from None
    if start not in (MAGIC, b""):  # an empty file is a store that nobody has begun
        raise ValueError(f"{path} is no store of studies: name another file")


def _file(path: Path) -> Engine:
    # A rollback journal, not WAL: the store stays one file that can be copied, on any file system
    # that locks.  A transaction that was killed half way is undone by the next that opens the file.
    engine = sql.create_engine(
        URL.create("sqlite", database=str(path)),
        poolclass=sql.pool.NullPool,
        connect_args={"timeout": PATIENCE},
    )

    @sql.event.listens_for(engine, "connect")
    def prepare(connection: sqlite3.Connection, record: object) -> None:
        connection.isolation_level = None  # transactions begin below, not where sqlite3 thinks so
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_CELL)
        connection.execute("PRAGMA trusted_schema = OFF")  # the file may be a stranger's
        connection.execute("PRAGMA cell_size_check = ON")
        connection.execute("PRAGMA synchronous = FULL")

    @sql.event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        writes = connection.get_execution_options().get("writes", False)
        # a transaction that reads first and then writes could find the file changed in between
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def _server(url: URL) -> Engine:
    try:
        return sql.create_engine(
            url, poolclass=sql.pool.NullPool, connect_args={"connect_timeout": 10}
        )
    except ImportError:
        raise ImportError(
            "a store on PostgreSQL needs the extra 'postgres': pip install psycopg[binary]"
        ) from None


def _first_line(error: BaseException | None) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
