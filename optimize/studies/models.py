"""The tables of a store as classes, and column types that give back every bit.

================  =================================================================================
``domino_store``  ``schema``: the version of these tables
``studies``       a study
``scenes``        the text of a scene, once, by its digest
``results``       a `TaskResult`; lengths [m], speed [m/s], ``seconds`` [s]; what is no number or
                  text is JSON, so that any tool for the database can ask for it
================  =================================================================================

They are those of version 0.1.0. A change that older programs would misread raises `SCHEMA`.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import fields
from typing import Any

import numpy as np
import sqlalchemy as sql
from numpy.typing import NDArray
from sqlalchemy.engine import Dialect
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from domino_env.core.reading import shown
from optimize.studies.task import TaskResult

SCHEMA = 1

Floats = NDArray[np.float64]
Named = dict[str, Any]
Labels = tuple[tuple[str, float | int | str], ...]
Trace = list[tuple[int, int, float, float]]


class Damaged(ValueError):  # noqa: N818 - a state of the file
    """What stands in a cell is nothing that this program writes there."""


class Exact(sql.TypeDecorator[Any]):
    """A column whose values `to_cell` and `of_cell` turn into a cell's and back, to the bit."""

    impl: Any = sql.Text
    cache_ok = True

    def to_cell(self, value: Any) -> Any:
        """Give what is written; ValueError for what cannot be kept."""
        return _json(value)

    def of_cell(self, cell: Any) -> Any:
        """Give what was written; any error for what was not."""
        return json.loads(cell)

    def process_bind_param(self, value: Any, dialect: Dialect) -> Any:
        return None if value is None else self.to_cell(value)

    def process_result_value(self, value: Any, dialect: Dialect) -> Any:
        if value is None:
            return None
        try:
            return self.of_cell(value)
        except (ValueError, TypeError, AttributeError):
            raise Damaged(f"a cell holds {shown(value)}") from None


class Finite(Exact):
    """A number; SQLite and PostgreSQL make different things of NaN, and none is a score."""

    impl = sql.Double
    cache_ok = True

    def to_cell(self, value: Any) -> float:
        return _finite(value)

    def of_cell(self, cell: Any) -> float:
        return _finite(cell)


class SizesColumn(Exact):
    """Lengths of the dominoes of a row."""

    cache_ok = True

    def to_cell(self, value: Any) -> str:
        return _json(np.asarray(value, dtype=np.float64).tolist())

    def of_cell(self, cell: Any) -> Floats:
        return np.array([_finite(x) for x in super().of_cell(cell)], dtype=np.float64)


class ObjectColumn(Exact):
    """Names with values, as a JSON object that can be asked for one of them."""

    cache_ok = True

    def of_cell(self, cell: Any) -> Any:
        return dict(super().of_cell(cell).items())


class LabelsColumn(ObjectColumn):
    """The same, from pairs."""

    cache_ok = True

    def to_cell(self, value: Any) -> str:
        if len(dict(value)) < len(value):
            raise ValueError("two labels have the same name")
        return _json(dict(value))

    def of_cell(self, cell: Any) -> Labels:
        return tuple(super().of_cell(cell).items())


class TraceColumn(Exact):
    """Steps of a search."""

    cache_ok = True

    def of_cell(self, cell: Any) -> Trace:
        return [(int(n), int(f), _finite(t), _finite(s)) for n, f, t, s in super().of_cell(cell)]


Number = sql.BigInteger().with_variant(sql.Integer, "sqlite")  # only INTEGER numbers itself there


class Base(DeclarativeBase):
    """What the annotations of the tables mean."""

    type_annotation_map = {  # noqa: RUF012 - as SQLAlchemy asks for it
        str: sql.Text,
        int: sql.BigInteger,
        float: Finite,
        Floats: SizesColumn,
        Labels: LabelsColumn,
        Trace: TraceColumn,
        Named: ObjectColumn,
    }


version = sql.Table(
    "domino_store", Base.metadata, sql.Column("schema", sql.Integer, nullable=False)
)


class Study(Base):
    """A study; `begun` in UTC, ISO 8601; `settings` are what decides its tasks."""

    __tablename__ = "studies"

    number: Mapped[int] = mapped_column(Number, primary_key=True)
    name: Mapped[str] = mapped_column(unique=True)
    kind: Mapped[str]
    settings: Mapped[Named]
    begun: Mapped[str]


class Scene(Base):
    """The text of a scene that results belong to."""

    __tablename__ = "scenes"

    digest: Mapped[str] = mapped_column(primary_key=True)
    toml: Mapped[str]


class Result(Base):
    """A task's result: fields of `TaskResult`, `scene` being the digest of its text."""

    __tablename__ = "results"
    __table_args__ = (sql.UniqueConstraint("study", "key"),)

    number: Mapped[int] = mapped_column(Number, primary_key=True)
    study: Mapped[int] = mapped_column(Number, sql.ForeignKey("studies.number"))
    key: Mapped[str]
    scene: Mapped[str] = mapped_column(sql.ForeignKey("scenes.digest"))
    scene_name: Mapped[str]
    method: Mapped[str]
    seed: Mapped[int]
    labels: Mapped[Labels]
    score: Mapped[float]
    uniform_score: Mapped[float]
    gain: Mapped[float | None]
    outcome: Mapped[str]
    mean_speed: Mapped[float]
    spacing: Mapped[Floats]
    thickness: Mapped[Floats]
    height: Mapped[Floats]
    evaluations: Mapped[int]
    falls: Mapped[int]
    seconds: Mapped[float]
    trace: Mapped[Trace]
    versions: Mapped[Named]


_SHARED = [field.name for field in fields(TaskResult) if field.name != "scene"]


def digest(scene: str) -> str:
    """Name a scene's text."""
    return hashlib.sha256(scene.encode()).hexdigest()[:32]


def cells_of(result: TaskResult) -> dict[str, Any]:
    """Give the columns of a result, but for its study."""
    return {name: getattr(result, name) for name in _SHARED} | {"scene": digest(result.scene)}


def result_of(row: Result, scene: str | None) -> TaskResult:
    """Make the result in a row, with the text of its scene."""
    return TaskResult(**{name: getattr(row, name) for name in _SHARED}, scene=scene or "")


def _json(value: object) -> str:
    return json.dumps(value, allow_nan=False, separators=(",", ":"))


def _finite(value: Any) -> float:
    if not math.isfinite(value):
        raise ValueError(f"{value} is no finite number")
    return float(value)
