"""A study as a table for other programs (CSV, Parquet), and its best rows as layouts."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from domino_env.files import write_bytes, write_text
from domino_env.layout import Layout
from optimize.store import Study
from optimize.task import TaskResult, scene_of

COLUMNS = (
    "study", "key", "scene_name", "method", "seed", "score", "uniform_score", "gain", "outcome",
    "mean_speed", "evaluations", "falls", "seconds", "spacing", "thickness", "height", "trace",
    "versions", "scene",
)  # fmt: skip
_LISTS = ("spacing", "thickness", "height", "trace")
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")  # how what a spreadsheet runs begins


def export(study: Study, path: Path) -> int:
    """Write all results of a study to a .csv or .parquet file, a line each; how many there are.

    Columns: `COLUMNS`, in SI units, then one for each label ("label.NAME" where a column has that
    name).  CSV keeps lists as JSON; text that a spreadsheet would run begins with ' there.
    ValueError for another kind of file, and where it cannot be written; ImportError where the extra
    "parquet" is missing.
    """
    write = {".csv": _write_csv, ".parquet": _write_parquet}.get(path.suffix.lower())
    if write is None:
        raise ValueError(f"{path}: a study is exported to a .csv or .parquet file")
    results = list(study.done().values())
    table = _table(study.name, results)
    try:
        write(table, path)
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {error.strerror or error}") from None
    return len(results)


def best_layout(study: Study, which: str | None) -> tuple[TaskResult, Layout]:
    """The best result of a scene, by name, or the one whose key begins so; and its row.

    None for the scene of a study that has only one.  ValueError where nothing or several scenes
    are meant.
    """
    results = list(study.done().values())
    if not results:
        raise ValueError(f"study '{study.name}' has no results yet")
    if which is not None:
        by_key = [r for r in results if len(which) >= 4 and r.key.startswith(which)]
        named = [r for r in results if r.scene_name == which]
        if not named and len(by_key) != 1:
            names = sorted({r.scene_name for r in results})
            raise ValueError(
                f"study '{study.name}' has no scene and no single result '{which}': name one of "
                f"{', '.join(names[:8])}, or a key that 'domino studies show' gives"
            )
        results = named or by_key
    if len({r.scene for r in results}) > 1:
        what = f"called '{which}'" if which is not None else "in it"
        raise ValueError(
            f"study '{study.name}' has several scenes {what}: name one result by the first eight "
            "characters of its key, which 'domino studies show' gives"
        )
    best = max(results, key=lambda r: r.score)
    if not best.scene:
        raise ValueError(f"result {best.key!r} was kept without its scene")
    scene = scene_of(best.scene)
    if scene.count != len(best.thickness):
        raise ValueError(f"result {best.key!r} has {len(best.thickness)} dominoes, its scene not")
    tall = None if scene.growth is None else best.height[1:]
    return best, scene.layout(best.spacing, best.thickness[1:], tall)


def _table(name: str, results: Sequence[TaskResult]) -> dict[str, list[Any]]:
    """Columns by name."""
    table: dict[str, list[Any]] = {column: [] for column in COLUMNS}
    for result in results:
        for column in COLUMNS:
            value = name if column == "study" else getattr(result, column)
            if column == "versions":
                value = json.dumps(value, sort_keys=True)
            elif column in _LISTS:
                value = [list(v) if isinstance(v, tuple) else float(v) for v in value]
            table[column].append(value)
    labels = list(dict.fromkeys(key for r in results for key, _ in r.labels))
    for label in labels:
        column = f"label.{label}" if label in COLUMNS else label
        table[column] = [dict(r.labels).get(label) for r in results]
    return table


def _write_csv(table: dict[str, list[Any]], path: Path) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([harmless(name) for name in table])
    for cells in zip(*table.values(), strict=True):
        writer.writerow([_cell(cell) for cell in cells])
    write_text(path, text.getvalue())


def _cell(value: object) -> object:
    if isinstance(value, str):
        return harmless(value)
    if isinstance(value, list):
        return json.dumps(value, separators=(",", ":"))
    return value  # csv writes floats by repr, which is exact, and None as nothing


def harmless(text: str) -> str:
    """Text that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(_FORMULA) else text


def _write_parquet(table: dict[str, list[Any]], path: Path) -> None:
    try:
        import pyarrow as arrow
        from pyarrow import parquet
    except ImportError:
        raise ImportError(
            "Parquet needs the extra 'parquet': pip install pyarrow, or export to .csv"
        ) from None
    number, text, whole = arrow.float64(), arrow.string(), arrow.int64()
    step = arrow.struct(
        [("evaluations", whole), ("falls", whole), ("seconds", number), ("score", number)]
    )
    kinds = dict.fromkeys(("score", "uniform_score", "gain", "mean_speed", "seconds"), number)
    kinds |= dict.fromkeys(("seed", "evaluations", "falls"), whole)
    kinds |= {name: arrow.list_(number) for name in ("spacing", "thickness", "height")}
    kinds["trace"] = arrow.list_(step)
    arrays = {}
    for name, values in table.items():
        if name == "trace":
            values = [[dict(zip(step.names, one, strict=True)) for one in row] for row in values]
        if name not in COLUMNS:
            kinds[name] = {int: whole, float: number, str: text}[_common(values)]
            values = [None if v is None else _common(values)(v) for v in values]
        arrays[name] = arrow.array(values, kinds.get(name, text))
    write_bytes(path, lambda file: parquet.write_table(arrow.table(arrays), file))


def _common(values: Iterable[object]) -> type[int] | type[float] | type[str]:
    """What all values of a label can be without loss: whole numbers, numbers, or text."""
    found = {type(v) for v in values if v is not None}
    if found <= {int}:
        return int
    exact = all(float(v) == v for v in values if isinstance(v, int))
    return float if found <= {int, float} and exact else str
