"""The tables of a store, and what may stand in them.

domino_store   schema: the version of these tables
studies        number, name, kind, settings (JSON), begun (UTC)
scenes         digest, toml: the text of a scene, once
results        number, study, key, scene, scene_name, method, seed, labels (JSON), score,
               uniform_score, gain, outcome, mean_speed [m/s], spacing, thickness, height [m] (JSON
               arrays), evaluations, falls, seconds [s], trace (JSON: [evaluations, falls, seconds,
               score] each), versions (JSON)

Floats are kept to the bit: as 64-bit numbers, and in JSON by their shortest digits.
"""

from __future__ import annotations

import hashlib
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sql
from sqlalchemy.dialects.postgresql import insert as insert_into_server
from sqlalchemy.dialects.sqlite import insert as insert_into_file
from sqlalchemy.engine import Connection

from optimize.store_access import Access
from optimize.store_rows import Damaged, parsed_settings, result_of, row_of
from optimize.task import TaskResult

SCHEMA = 1
LOCK = 0x646F6D696E6F  # "domino": whoever creates the tables of a server holds it

_metadata = sql.MetaData()
_number = sql.BigInteger().with_variant(sql.Integer, "sqlite")  # only INTEGER numbers itself there

about = sql.Table("domino_store", _metadata, sql.Column("schema", sql.Integer, nullable=False))
studies = sql.Table(
    "studies",
    _metadata,
    sql.Column("number", _number, primary_key=True),
    sql.Column("name", sql.Text, nullable=False, unique=True),
    sql.Column("kind", sql.Text, nullable=False),
    sql.Column("settings", sql.Text, nullable=False),
    sql.Column("begun", sql.Text, nullable=False),
)
scenes = sql.Table(
    "scenes",
    _metadata,
    sql.Column("digest", sql.Text, primary_key=True),
    sql.Column("toml", sql.Text, nullable=False),
)
results = sql.Table(
    "results",
    _metadata,
    sql.Column("number", _number, primary_key=True),
    sql.Column("study", _number, sql.ForeignKey("studies.number"), nullable=False),
    sql.Column("key", sql.Text, nullable=False),
    sql.Column("scene", sql.Text, sql.ForeignKey("scenes.digest"), nullable=False),
    sql.Column("scene_name", sql.Text, nullable=False),
    sql.Column("method", sql.Text, nullable=False),
    sql.Column("seed", sql.BigInteger, nullable=False),
    sql.Column("labels", sql.Text, nullable=False),
    sql.Column("score", sql.Double, nullable=False),
    sql.Column("uniform_score", sql.Double, nullable=False),
    sql.Column("gain", sql.Double),
    sql.Column("outcome", sql.Text, nullable=False),
    sql.Column("mean_speed", sql.Double, nullable=False),
    sql.Column("spacing", sql.Text, nullable=False),
    sql.Column("thickness", sql.Text, nullable=False),
    sql.Column("height", sql.Text, nullable=False),
    sql.Column("evaluations", sql.BigInteger, nullable=False),
    sql.Column("falls", sql.BigInteger, nullable=False),
    sql.Column("seconds", sql.Double, nullable=False),
    sql.Column("trace", sql.Text, nullable=False),
    sql.Column("versions", sql.Text, nullable=False),
    sql.UniqueConstraint("study", "key"),
)


class Tables:
    """The statements of a store; opening it checks that it is one."""

    def __init__(self, access: Access, *, create: bool) -> None:
        self._access = access
        self.where = access.where
        self._insert: Any = insert_into_file if access.is_file else insert_into_server
        with access.reading() as connection:
            begun = self._require_ours(connection)
        if begun:
            return
        if not create:
            raise ValueError(f"{self.where} holds no studies yet")
        with access.writing() as connection:
            if not access.is_file:
                connection.execute(sql.text("SELECT pg_advisory_xact_lock(:lock)"), {"lock": LOCK})
            if not self._require_ours(connection):  # another process may have been faster
                _metadata.create_all(connection)
                connection.execute(about.insert().values(schema=SCHEMA))

    def _require_ours(self, connection: Connection) -> bool:
        """Whether the tables are there; False for an empty database."""
        names = set(sql.inspect(connection).get_table_names())
        if about.name not in names:
            ours = sorted(names & set(_metadata.tables)) if not self._access.is_file else names
            if ours:
                raise ValueError(
                    f"{self.where} is a database of something else (it holds the table "
                    f"{min(ours)[:80]!r}): name another one"
                )
            return False
        versions = connection.execute(sql.select(about.c.schema).limit(2)).scalars().all()
        if len(versions) != 1 or not isinstance(versions[0], int) or versions[0] < 1:
            raise ValueError(f"{self.where} is damaged: it does not say which schema it has")
        if versions[0] > SCHEMA:
            raise ValueError(
                f"{self.where} has schema {versions[0]}, written by a newer domino-chains; this "
                f"one reads schema {SCHEMA}: update it, or name another store"
            )
        if missing := set(_metadata.tables) - names:
            raise ValueError(f"{self.where} is damaged: its table '{min(missing)}' is missing")
        if self._access.is_file:
            self._require_sound(connection)
        return True

    def _require_sound(self, connection: Connection) -> None:
        """Refuse a file whose pages do not fit together, or that acts by itself."""
        triggers = connection.exec_driver_sql(
            "SELECT count(*) FROM sqlite_master WHERE type = 'trigger'"
        ).scalar()
        if triggers:
            raise ValueError(f"{self.where} has triggers, which no store has: name another file")
        told = connection.exec_driver_sql("PRAGMA quick_check(1)").scalar()
        if told != "ok":
            raise ValueError(
                f"{self.where} is damaged ({str(told).splitlines()[0][:120]}): name another file, "
                "or bring back a copy"
            )

    def begin(self, name: str, kind: str, settings: str) -> tuple[int, str, str]:
        """Number, kind and settings of the study of that name, which is made where it is not."""
        now = datetime.now(UTC).isoformat(timespec="seconds")
        new = self._insert(studies).values(name=name, kind=kind, settings=settings, begun=now)
        known = sql.select(studies.c.number, studies.c.kind, studies.c.settings).where(
            studies.c.name == name
        )
        with self._access.reading() as connection:  # a study to go on with may be read-only
            found = connection.execute(known).first()
        if found is None:
            with self._access.writing() as connection:
                connection.execute(new.on_conflict_do_nothing(index_elements=["name"]))
                found = connection.execute(known).one()
        return int(found[0]), str(found[1]), str(found[2])

    def studies(self) -> list[tuple[str, str, str, str, int]]:
        """Name, kind, begun, settings and number of finished tasks of each."""
        tasks = (
            sql.select(sql.func.count())
            .where(results.c.study == studies.c.number)
            .scalar_subquery()
        )
        what = studies.c.name, studies.c.kind, studies.c.begun, studies.c.settings, tasks
        with self._access.reading() as connection:
            rows = connection.execute(sql.select(*what).order_by(studies.c.number)).all()
        return [(str(n), str(k), str(b), str(s), int(t)) for n, k, b, s, t in rows]

    def settings(self, name: str, text: str) -> dict[str, Any]:
        """Settings that were kept as JSON."""
        try:
            return parsed_settings(text)
        except Damaged as error:
            raise ValueError(f"{self.where}, study '{name}': {error}") from None

    def number(self, name: str) -> int:
        """The number of a study that is there."""
        with self._access.reading() as connection:
            found = connection.execute(
                sql.select(studies.c.number).where(studies.c.name == name)
            ).scalar_one()
        return int(found)

    def results(self, study: int) -> dict[str, TaskResult]:
        """All results of a study, by key."""
        what = sql.select(results, scenes.c.toml).join(
            scenes, scenes.c.digest == results.c.scene, isouter=True
        )
        what = what.where(results.c.study == study).order_by(results.c.number)
        found: dict[str, TaskResult] = {}
        with self._access.reading() as connection:
            for row in connection.execute(what).mappings():
                try:
                    found[str(row["key"])] = result_of(row)
                except Damaged as error:
                    key = str(row["key"])[:40]
                    raise ValueError(f"{self.where} is damaged: result {key!r}: {error}") from None
        return found

    def add(self, study: int, result: TaskResult) -> None:
        """Keep a result, unless there is one of its key."""
        digest = hashlib.sha256(result.scene.encode()).hexdigest()[:32]
        try:
            row = row_of(result)
        except Damaged as error:
            raise ValueError(f"result {result.key!r} cannot be kept: {error}") from None
        text = self._insert(scenes).values(digest=digest, toml=result.scene)
        new = self._insert(results).values(study=study, scene=digest, **row)
        with self._access.writing() as connection:
            connection.execute(text.on_conflict_do_nothing(index_elements=["digest"]))
            connection.execute(new.on_conflict_do_nothing(index_elements=["study", "key"]))
