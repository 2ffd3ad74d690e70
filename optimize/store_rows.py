"""A task's result as a row of a table and back, to the bit; rows from strangers are checked."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from optimize.task import TaskResult

MOST_DOMINOES = 1_000_000
LARGEST_INTEGER = 2**63 - 1

_TEXTS = ("key", "scene_name", "method", "outcome")
_WHOLE = ("seed", "evaluations", "falls")
_NUMBERS = ("score", "uniform_score", "mean_speed", "seconds")
_ARRAYS = ("spacing", "thickness", "height")


class Damaged(ValueError):  # noqa: N818
    """What stands in a row is nothing that a search has found."""


def row_of(result: TaskResult) -> dict[str, Any]:
    """The columns of a result, but for study and scene.  Damaged for what cannot be kept."""
    row: dict[str, Any] = {name: _text(getattr(result, name), name) for name in _TEXTS}
    row |= {name: _whole(getattr(result, name), name) for name in _WHOLE}
    row |= {name: _number(getattr(result, name), name) for name in _NUMBERS}
    row["gain"] = None if result.gain is None else _number(result.gain, "gain")
    arrays = {name: np.asarray(getattr(result, name), dtype=np.float64) for name in _ARRAYS}
    _require_row(**arrays)
    row |= {name: _json(array.tolist()) for name, array in arrays.items()}
    row["trace"] = _json([[int(n), int(f), float(t), float(s)] for n, f, t, s in result.trace])
    labels = dict(result.labels)
    if len(labels) < len(result.labels):
        raise Damaged("two labels have the same name")
    row["labels"], row["versions"] = _json(labels), _json(dict(result.versions))
    return row


def result_of(row: Mapping[Any, Any]) -> TaskResult:
    """The result in a row, with its scene's text as "toml".  Damaged for anything but one."""
    spacing, thickness, height = (_array(_parsed(row[name], name), name) for name in _ARRAYS)
    _require_row(spacing, thickness, height)
    labels = _parsed(row["labels"], "labels")
    versions = _parsed(row["versions"], "versions")
    plain = isinstance(labels, dict) and all(_is_label(v) for v in labels.values())
    if not plain or not isinstance(versions, dict):
        raise Damaged("its labels or versions are no names with values")
    gain = row["gain"]
    return TaskResult(
        key=_text(row["key"], "key"),
        scene_name=_text(row["scene_name"], "scene_name"),
        method=_text(row["method"], "method"),
        seed=_whole(row["seed"], "seed"),
        score=_number(row["score"], "score"),
        uniform_score=_number(row["uniform_score"], "uniform_score"),
        gain=None if gain is None else _number(gain, "gain"),
        outcome=_text(row["outcome"], "outcome"),
        mean_speed=_number(row["mean_speed"], "mean_speed"),
        spacing=spacing,
        thickness=thickness,
        height=height,
        evaluations=_whole(row["evaluations"], "evaluations"),
        falls=_whole(row["falls"], "falls"),
        seconds=_number(row["seconds"], "seconds"),
        trace=_trace(_parsed(row["trace"], "trace")),
        labels=tuple(labels.items()),
        versions={str(k): str(v) for k, v in versions.items()},
        scene=_text(row["toml"], "scene"),
    )


def parsed_settings(text: str) -> dict[str, Any]:
    """Settings of a study from their JSON."""
    found = _parsed(text, "settings")
    if not isinstance(found, dict):
        raise Damaged("its settings are no names with values")
    return found


def _json(value: object) -> str:
    try:
        return json.dumps(value, allow_nan=False, separators=(",", ":"))
    except (TypeError, ValueError):
        raise Damaged("it holds something that is no number or text") from None


def _parsed(text: object, name: str) -> Any:
    try:
        return json.loads(_text(text, name), parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise Damaged(f"its {name} cannot be read") from None


def _no_number(word: str) -> float:
    raise ValueError(word)


def _text(value: object, name: str) -> str:
    if not isinstance(value, str) or "\0" in value:
        raise Damaged(f"its {name} is no text")
    return value


def _whole(value: object, name: str) -> int:
    good = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not good or not 0 <= int(value) <= LARGEST_INTEGER:  # type: ignore[call-overload]
        raise Damaged(f"its {name} is no whole number from 0 to {LARGEST_INTEGER}")
    return int(value)  # type: ignore[call-overload, no-any-return]


def _number(value: object, name: str) -> float:
    good = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not good or not math.isfinite(value):  # type: ignore[arg-type]
        raise Damaged(f"its {name} is no finite number")
    return float(value)  # type: ignore[arg-type]


def _is_label(value: object) -> bool:
    return isinstance(value, str | int | float) and not isinstance(value, bool)


def _array(values: object, name: str) -> NDArray[np.float64]:
    if not isinstance(values, list) or len(values) > MOST_DOMINOES:
        raise Damaged(f"its {name} is no list of at most {MOST_DOMINOES} numbers")
    return np.array([_number(value, name) for value in values], dtype=np.float64)


def _require_row(
    spacing: NDArray[np.float64], thickness: NDArray[np.float64], height: NDArray[np.float64]
) -> None:
    count = thickness.size
    shapes = spacing.shape, thickness.shape, height.shape
    if shapes != ((count - 1,), (count,), (count,)):
        raise Damaged(f"spacing, thickness and height have shapes {shapes}: no row of dominoes")
    if not all(np.isfinite(a).all() and (a > 0.0).all() for a in (spacing, thickness, height)):
        raise Damaged("its row has sizes that are not positive and finite")


def _trace(steps: object) -> list[tuple[int, int, float, float]]:
    if not isinstance(steps, list) or not all(isinstance(s, list) and len(s) == 4 for s in steps):
        raise Damaged("its trace is no list of steps")
    return [
        (_whole(n, "trace"), _whole(f, "trace"), _number(t, "trace"), _number(s, "trace"))
        for n, f, t, s in steps
    ]
