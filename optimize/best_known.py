"""The best layouts known of the scenes that ship, and who found them.

`best_known.json` beside this file: under a scene's name the layout (spacing and thickness [m], and
heights where they are free), its score, and method, seed, seconds and version that found it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from domino_env import __version__
from domino_env.files import write_text
from domino_env.layout import Layout
from domino_env.layout_files import layout_of_document
from domino_env.scene import Scene
from domino_env.support.reading import naming, read_json, shown
from optimize.result import SearchResult

PATH = Path(__file__).with_name("best_known.json")
CLOSEST = 1e-12  # relative error at which a record is simulated
NOTICED = 1e-9  # relative gain that makes a new record


@dataclass(frozen=True, eq=False)
class BestKnown:
    """One record.

    layout, score: the row, and what the scene gives it at a relative error of 1e-12.
    method, seed, seconds, version: who found it, and after how long.
    """

    layout: Layout
    score: float
    method: str
    seed: int
    seconds: float
    version: str


def best_known(path: Path | None = None) -> dict[str, BestKnown]:
    """All records, by the name of their scene; none where there is no such file (None: PATH)."""
    path = path or PATH
    if not path.exists():
        return {}
    document = read_json(path)
    with naming(path):
        if not isinstance(document, dict):
            raise ValueError("expected an object with a record under each scene's name")
        return {name: _read(name, record) for name, record in document.items()}


def update(results: list[SearchResult], path: Path | None = None) -> list[str]:
    """Write down what beats the record of its scene; returns the names of these scenes.

    A layout that breaks a rule, or whose wave dies at the closest look, is no record.
    """
    path = path or PATH
    records = best_known(path)
    improved: list[str] = []
    for result in results:
        scene, layout = result.scene, result.layout
        if scene.violations(layout):
            continue
        score = closest_score(scene, layout)
        old = records.get(scene.name)
        if old is not None and score <= old.score + NOTICED * abs(old.score):
            continue
        records[scene.name] = BestKnown(
            layout, score, result.method, result.seed, result.seconds, __version__
        )
        improved.append(scene.name)
    if improved:
        document = {name: _written(records[name]) for name in sorted(records)}
        write_text(path, json.dumps(document, indent=1) + "\n")
    return sorted(set(improved))


def closest_score(scene: Scene, layout: Layout) -> float:
    """The scene's score of a layout that is simulated as closely as can be."""
    return float(scene.score_wave(scene.simulate(layout, rtol=CLOSEST)))


_FOUND: dict[str, type | tuple[type, ...]] = {
    "score": (int, float), "method": str, "seed": int, "seconds": (int, float), "version": str,
}  # fmt: skip


def _read(name: str, record: Any) -> BestKnown:
    if not isinstance(record, dict):
        raise ValueError(f"{shown(name)} is {shown(record)}: expected an object")
    for key, kind in _FOUND.items():
        value = record.get(key)
        good = isinstance(value, kind) and not isinstance(value, bool)
        if not (good and (isinstance(value, str) or -1e9 <= value <= 1e9)):  # type: ignore[operator]
            what = "a line of text" if kind is str else "a finite number"
            raise ValueError(f"{shown(name)}: {key} = {shown(value)}: expected {what}")
    layout = layout_of_document({key: record[key] for key in record if key not in _FOUND})
    return BestKnown(layout, **{key: record[key] for key in _FOUND})


def _written(record: BestKnown) -> dict[str, Any]:
    layout = record.layout
    return {
        "score": record.score,
        "method": record.method,
        "seed": record.seed,
        "seconds": round(record.seconds, 1),
        "version": record.version,
        "spacing": layout.spacing.tolist(),
        "thickness": layout.thickness.tolist(),
        "height": _one_or_all(layout.height),
        "width": layout.width,
        "density": _one_or_all(layout.density),
    }


def _one_or_all(values: Any) -> float | list[float]:
    values = np.asarray(values, dtype=np.float64)
    same = bool(np.all(values == values.flat[0]))
    return float(values.flat[0]) if same else values.tolist()
