"""The best layouts known of the scenes that ship, and who found them.

`best_known.json` beside this file: under a scene's name the layout (spacing and thickness [m], and
heights where they are free), its score, and method, seed, seconds and version that found it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from domino_env import __version__
from domino_env.core.files import write_text
from domino_env.core.models import LARGEST, Number, model_of
from domino_env.core.reading import naming, read_json
from domino_env.core.results import brief
from domino_env.physics.files import LayoutTable
from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene
from optimize.experiments.task import TaskResult
from optimize.result import SearchResult

PATH = Path(__file__).with_name("best_known.json")
CLOSEST = 1e-12  # relative error at which a record is simulated
NOTICED = 1e-9  # relative gain that makes a new record


class RecordTable(LayoutTable, kw_only=True):
    """A record as the file holds it: a layout, and who found it."""

    score: Annotated[Number, Meta(description="that the scene gives it")]
    method: str
    seed: int
    seconds: Annotated[float, Meta(ge=0, le=LARGEST, description="that the search took")]
    version: str


@dataclass(frozen=True, eq=False)
class BestKnown:
    """One record.

    Attributes
    ----------
    layout
        The row.
    score
        What the scene gives it at a relative error of 1e-12.
    method, seed, seconds, version
        Who found it, and after how long.
    """

    layout: Layout
    score: float
    method: str
    seed: int
    seconds: float
    version: str

    __repr__ = brief


def best_known(path: Path | None = None) -> dict[str, BestKnown]:
    """Read all records, by the name of their scene.

    Parameters
    ----------
    path
        The file; None for the one that ships. Where it is missing there are no records.

    Raises
    ------
    ValueError
        For a file that is damaged, with what is wrong and where, and for a name.
    """
    if isinstance(path, str):
        raise ValueError(
            f"best_known({path!r}): it gives all records, by the name of their scene: say "
            f"best_known()[{path!r}], or give the Path of a file of your own"
        )
    path = path or PATH
    if not path.exists():
        return {}
    document = read_json(path)
    with naming(path):
        found = model_of(dict[str, Any], document)
        return {name: _record(model_of(RecordTable, one, name)) for name, one in found.items()}


def update(
    results: Iterable[tuple[Scene, SearchResult | TaskResult]], path: Path | None = None
) -> list[str]:
    """Write the layouts that beat the record of their scene.

    A layout that breaks a rule, or whose wave stops at the smallest tolerance, is no record.

    Parameters
    ----------
    results
        Scenes and what was found for them.
    path
        As of `best_known`.

    Returns
    -------
    list of str
        Names of the scenes that have a new record.
    """
    path = path or PATH
    records = best_known(path)
    improved: list[str] = []
    for scene, result in results:
        layout = result.layout
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
    """Score a layout, simulated as closely as can be."""
    return scene.score(scene.simulate(layout, rtol=CLOSEST))


def _record(told: RecordTable) -> BestKnown:
    return BestKnown(
        Layout(**told.arguments()), told.score, told.method, told.seed, told.seconds, told.version
    )  # fmt: skip


def _written(record: BestKnown) -> dict[str, Any]:
    layout = record.layout
    ground = {} if layout.is_flat else {"rise": layout.rise, "tilt": layout.tilt}
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
    } | {name: _one_or_all(values) for name, values in ground.items()}


def _one_or_all(values: Any) -> float | list[float]:
    values = np.asarray(values, dtype=np.float64)
    same = bool(np.all(values == values.flat[0]))
    return float(values.flat[0]) if same else values.tolist()
