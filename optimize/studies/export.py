"""A study as a table for other programs, and its best rows as layouts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from domino_env.core.files import write_bytes
from domino_env.core.tables import write_csv
from domino_env.physics.layout import Layout
from optimize.studies.ioh_logs import write_ioh
from optimize.studies.store import Study
from optimize.studies.task import TaskResult, layout_of, scene_of

COLUMNS = (
    "study", "key", "scene_name", "method", "seed", "score", "uniform_score", "gain", "outcome",
    "mean_speed", "evaluations", "falls", "seconds", "spacing", "thickness", "height", "trace",
    "versions", "scene",
)  # fmt: skip
STEP = ("evaluations", "falls", "seconds", "score")  # of a trace


def export_study(study: Study, path: Path) -> int:
    """Write all results of a study to a ``.csv`` or ``.parquet`` file, a line each.

    A ``.zip`` file gets logs for IOHanalyzer instead, see `optimize.studies.ioh_logs`. The columns
    are `COLUMNS`, in SI units, then one for each label (``label.NAME`` where a column has that
    name). CSV keeps lists as JSON.

    Returns
    -------
    int
        How many results there are.

    Raises
    ------
    ValueError
        For another kind of file, and where it cannot be written.
    ImportError
        Where the extra ``parquet`` is missing.
    """
    kinds = {".csv": _write_csv, ".parquet": _write_parquet, ".zip": _write_logs}
    write = kinds.get(path.suffix.lower())
    if write is None:
        raise ValueError(f"{path}: a study is exported to a .csv, .parquet or .zip file")
    try:
        write(study, path)
    except OSError as error:
        raise ValueError(f"{path} cannot be written: {error.strerror or error}") from None
    return len(study.done())


def best_layout(study: Study, which: str | None) -> tuple[TaskResult, Layout]:
    """Find the best result of a scene, and its row.

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
        Where nothing or several scenes are meant.
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
    return best, layout_of(scene_of(best.scene), best)


def _write_logs(study: Study, path: Path) -> None:
    results = list(study.done().values())
    if not results:
        raise ValueError(f"study '{study.name}' has no results yet")
    write_bytes(path, lambda file: write_ioh(results, file))


def _table(study: Study) -> dict[str, list[Any]]:
    """The cells of all results by column."""
    rows = [_row(study.name, result) for result in study.done().values()]
    names = dict.fromkeys([*COLUMNS, *(name for row in rows for name in row)])
    return {name: [row.get(name) for row in rows] for name in names}


def _row(study: str, result: TaskResult) -> dict[str, Any]:
    """The cells of a result by column."""
    row: dict[str, Any] = {"study": study} | {name: getattr(result, name) for name in COLUMNS[1:]}
    row |= {name: row[name].tolist() for name in ("spacing", "thickness", "height")}
    row["versions"] = json.dumps(result.versions, sort_keys=True)
    return row | {f"label.{k}" if k in COLUMNS else k: value for k, value in result.labels}


def _write_csv(study: Study, path: Path) -> None:
    table = _table(study)

    def cell(value: object) -> object:
        return json.dumps(value, separators=(",", ":")) if isinstance(value, list) else value

    rows = zip(*table.values(), strict=True)
    write_csv(path, table, ([cell(value) for value in row] for row in rows))


def _write_parquet(study: Study, path: Path) -> None:
    try:
        import pyarrow as arrow
        from pyarrow import parquet
    except ImportError:
        raise ImportError(
            "Parquet needs the extra 'parquet': pip install pyarrow, or export to .csv"
        ) from None
    number, whole = arrow.float64(), arrow.int64()
    kinds = dict.fromkeys(("score", "uniform_score", "gain", "mean_speed", "seconds"), number)
    kinds |= dict.fromkeys(("seed", "evaluations", "falls"), whole)
    kinds |= dict.fromkeys(("spacing", "thickness", "height"), arrow.list_(number))
    step = zip(STEP, (whole, whole, number, number), strict=True)
    kinds["trace"] = arrow.list_(arrow.struct(list(step)))
    arrays = {}
    for name, values in _table(study).items():
        if name == "trace":
            values = [[dict(zip(STEP, step, strict=True)) for step in trace] for trace in values]
        if name in COLUMNS:
            arrays[name] = arrow.array(values, kinds.get(name, arrow.string()))
            continue
        try:  # a label: numbers where all its values are, without loss
            arrays[name] = arrow.array(values)
        except (arrow.ArrowInvalid, arrow.ArrowTypeError):
            arrays[name] = arrow.array([None if v is None else str(v) for v in values])
    write_bytes(path, lambda file: parquet.write_table(arrow.table(arrays), file))
