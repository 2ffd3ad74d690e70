"""The best layouts known of the scenes that ship, and who found them.

`best_known.json` beside this file: under a scene's name the layout (spacing and thickness [m], and
heights where they are free), its score, and method, seed, seconds and version that found it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from domino_env import __version__
from domino_env.core.files import naming, read_json, write_text
from domino_env.core.models import LARGEST, Number, model_of
from domino_env.core.types import Floats
from domino_env.physics.files import LayoutTable
from domino_env.physics.layout import Layout
from domino_env.scenes.scene import Scene
from optimize.experiments.task import TaskResult
from optimize.result import SearchResult

PATH = Path(__file__).with_name("best_known.json")
CLOSEST = 1e-12  # relative error at which a record is simulated
NOTICED = 1e-9  # relative gain that makes a new record


class BestKnown(LayoutTable, kw_only=True):
    """The best known layout of a scene, and what found it.

    Attributes
    ----------
    score
        Score of the layout at a relative error of 1e-12.
    method, seed, seconds, version
        The search that found it.
    """

    score: Annotated[Number, Meta(description="that the scene gives it")]
    method: str
    seed: int
    seconds: Annotated[float, Meta(ge=0, le=LARGEST, description="that the search took")]
    version: str

    @property
    def layout(self) -> Layout:
        """The layout."""
        return Layout(**self.arguments())


def best_known(path: Path | None = None) -> dict[str, BestKnown]:
    """Read all records, by the name of their scene.

    Parameters
    ----------
    path
        The file; None for the one that ships. Where it is missing there are no records.

    Raises
    ------
    ValueError
        For a file that is damaged, with what is wrong and where.
    """
    path = path or PATH
    if not path.exists():
        return {}
    document = read_json(path)
    with naming(path):
        found = model_of(dict[str, Any], document)
        return {name: model_of(BestKnown, one, name) for name, one in found.items()}


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
    best = {name: record.score for name, record in best_known(path).items()}
    document = read_json(path) if path.exists() else {}
    improved: list[str] = []
    for scene, result in results:
        layout, name = result.layout, scene.name
        if scene.violations(layout):
            continue
        score = closest_score(scene, layout)
        if name in best and score <= best[name] + NOTICED * abs(best[name]):
            continue
        best[name] = score
        document[name] = {
            "score": score,
            "method": result.method,
            "seed": result.seed,
            "seconds": round(result.seconds, 1),
            "version": __version__,
            "spacing": layout.spacing.tolist(),
            "thickness": layout.thickness.tolist(),
            "height": _one_or_all(layout.height),
            "width": layout.width,
            "density": _one_or_all(layout.density),
        }
        if not layout.is_flat:
            ground = {"rise": _one_or_all(layout.rise), "tilt": _one_or_all(layout.tilt)}
            document[name] |= ground
        improved.append(name)
    if improved:
        write_text(path, json.dumps(dict(sorted(document.items())), indent=1) + "\n")
    return sorted(set(improved))


def closest_score(scene: Scene, layout: Layout) -> float:
    """Score a layout, simulated as closely as can be."""
    return scene.score(scene.simulate(layout, rtol=CLOSEST))


def _one_or_all(values: Floats) -> float | list[float]:
    """Return the one value of all dominoes, or all values."""
    return float(values[0]) if np.all(values == values[0]) else values.tolist()
