"""How a store is reached: sessions on SQLite or PostgreSQL, and their errors in a sentence."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sql
from sqlalchemy.dialects.postgresql import insert as insert_into_server
from sqlalchemy.dialects.sqlite import insert as insert_into_file
from sqlalchemy.engine import URL, Connection, Engine, make_url
from sqlalchemy.orm import Session

from domino_env.core.files import require_room
from optimize.studies.models import SCHEMA, Base, Damaged, version

PATIENCE = 60.0  # [s] that a process waits for others to finish writing
LOCK = 0x646F6D696E6F  # "domino": whoever makes the tables of a server holds it

_KEPT = "what was to be written is not kept, all that was there before is"
_SENTENCES = (  # beginnings of SQLite's names of errors; a quota is told as an error of writing
    (("FULL", "IOERR"), f"cannot be written ({{}}): {_KEPT}; make room and go on"),
    (("BUSY", "LOCKED"), f"other programs have been writing it for {PATIENCE:g} s: {_KEPT}"),
    (("READONLY", "CANTOPEN", "PERM"), "cannot be opened ({}): name a file in a folder of yours"),
    (("CORRUPT",), "is damaged ({}): name another file, or bring back a copy"),
    (("NOTADB",), "is no store of studies: name another file"),
)


class Database:
    """Sessions on the tables of a store.

    Parameters
    ----------
    engine
        Without a pool: a connection lives for one session, so that forks, threads and servers that
        restart have nothing to inherit.
    where
        The file, or the URL without its password; for sentences.
    """

    def __init__(self, engine: Engine, where: str) -> None:
        self.where = where
        self._engine = engine
        self._writer = engine.execution_options(writes=True)

    @property
    def is_file(self) -> bool:
        """Whether it is an SQLite file."""
        return self._engine.dialect.name == "sqlite"

    @contextmanager
    def reading(self) -> Iterator[Session]:
        """Open a session that sees one state of everything.

        Raises
        ------
        ValueError
            Where it fails, in a sentence.
        """
        with self._in_words(), Session(self._engine) as session:
            yield session

    @contextmanager
    def writing(self) -> Iterator[Session]:
        """Open a session that is written whole, or not at all; it waits for other writers first.

        Raises
        ------
        ValueError
            Where it fails, in a sentence.
        """
        with self._in_words(), Session(self._writer) as session, session.begin():
            yield session

    def insert_if_new(self, session: Session, model: type[Base], **cells: Any) -> None:
        """Insert a row, unless one with the same key is there."""
        insert: Any = insert_into_file if self.is_file else insert_into_server
        session.execute(insert(model).values(**cells).on_conflict_do_nothing())

    @contextmanager
    def _in_words(self) -> Iterator[None]:
        try:
            yield
        except Damaged as error:
            raise ValueError(
                f"{self.where} is damaged ({error}): name another store, or bring back a copy"
            ) from None
        except sql.exc.DBAPIError as error:
            raise ValueError(f"{self.where}: {_sentence(error.orig)}") from None
        except (sql.exc.StatementError, OverflowError) as error:  # of our own column types
            cause = getattr(error, "orig", error)
            raise ValueError(f"{self.where}: a value cannot be kept: {cause}") from None
        except sql.exc.SQLAlchemyError as error:
            raise ValueError(f"{self.where}: {_first_line(error)}") from None


def connect(where: str | Path, *, create: bool) -> Database:
    """Reach a store and check its tables; see `optimize.studies.open_store`."""
    url = _url(where) if isinstance(where, str) and "://" in where else None
    if url is not None and url.get_backend_name() == "postgresql":
        database = _server(url)
    else:
        database = _file(Path(where if url is None else str(url.database)), create)
    with database.reading() as session:
        begun = _is_begun(database, session)
    if begun:
        return database
    if not create:
        raise ValueError(f"{database.where} holds no studies yet")
    with database.writing() as session:
        if not database.is_file:
            session.execute(sql.select(sql.func.pg_advisory_xact_lock(LOCK)))
        if not _is_begun(database, session):  # another process may have been faster
            Base.metadata.create_all(session.connection())
            session.execute(version.insert().values(schema=SCHEMA))
    return database


def _is_begun(database: Database, session: Session) -> bool:
    """Whether the tables are there, and ours; False for a database without any."""
    ours = set(Base.metadata.tables)
    there = set(sql.inspect(session.connection()).get_table_names())
    if not (there if database.is_file else there & ours):  # a server may hold other things too
        return False
    if missing := ours - there:
        raise ValueError(
            f"{database.where} is no store of studies, or a damaged one (there is no table "
            f"'{min(missing)}'): name another one"
        )
    schema = session.scalar(sql.select(version.c.schema))
    if not isinstance(schema, int) or schema < 1:
        raise ValueError(f"{database.where} is damaged: it does not say which schema it has")
    if schema > SCHEMA:
        raise ValueError(
            f"{database.where} has schema {schema}, written by a newer domino-chains; this one "
            f"reads schema {SCHEMA}: update it, or name another store"
        )
    if database.is_file:
        told = session.connection().exec_driver_sql("PRAGMA quick_check(1)").scalar()
        if told != "ok":
            raise Damaged(str(told).splitlines()[-1][:120])
    return True


def _file(path: Path, create: bool) -> Database:
    if path.is_dir():
        raise ValueError(f"{path} is a folder: name a file for the store")
    if not path.exists():
        if not create:
            raise ValueError(f"there is no store {path}: name the one that a study was kept in")
        require_room(path.parent)
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

    @sql.event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        writes = connection.get_execution_options().get("writes", False)
        # a transaction that reads first and then writes could find the file changed in between
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return Database(engine, str(path))


def _url(where: str) -> URL:
    try:
        url = make_url(where)
    except sql.exc.ArgumentError:
        raise ValueError(
            "the store's URL cannot be read: give a file or postgresql://USER@HOST/DATABASE"
        ) from None
    if url.get_backend_name() not in ("postgresql", "sqlite") or not url.database:
        raise ValueError(
            f"{url.render_as_string()} is no place for a store: give a file, or "
            "postgresql://USER@HOST/DATABASE"
        )
    return url


def _server(url: URL) -> Database:
    try:
        engine = sql.create_engine(
            url.set(drivername="postgresql+psycopg"),
            poolclass=sql.pool.NullPool,
            connect_args={"connect_timeout": 10},
        )
    except ImportError:
        raise ImportError(
            "a store on PostgreSQL needs the extra 'postgres': pip install psycopg[binary]"
        ) from None
    return Database(engine, url.render_as_string())


def _sentence(cause: BaseException | None) -> str:
    name = getattr(cause, "sqlite_errorname", "").removeprefix("SQLITE_")
    for beginnings, sentence in _SENTENCES:
        if name.startswith(beginnings):
            return sentence.format(cause)
    disk_full = getattr(cause, "sqlstate", None) == "53100"  # of a server
    return f"{_first_line(cause)}; {_KEPT}" if disk_full else _first_line(cause)


def _first_line(error: BaseException | None) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
