"""Computation of the shipped files of scenes and distributions.

python -m domino_env.scenes.shipping            JSON Schema and uniform baselines of the scenes
python -m domino_env.scenes.shipping NAME …     pool and test set of distributions
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from domino_env.core.files import write_text
from domino_env.core.progress import progress_bar
from domino_env.scenes.distribution import SceneDistribution, load_distribution
from domino_env.scenes.io.ranges import Place
from domino_env.scenes.io.reading import load_scene, scene_names
from domino_env.scenes.io.schema import scene_schema
from domino_env.scenes.pool import BEYOND, DIGITS, POINT, ScenePool, stamp_of
from domino_env.scenes.uniform import SHIPPED, best_point, stamp

HERE = Path(__file__).parent
SCHEMA = HERE / "shipped" / "scene.schema.json"
TEST, TESTED = 1, 200  # seed and number of the scenes of a test set


def write_scenes() -> None:
    """Write the JSON Schema and the uniform baselines of scenes."""
    write_text(SCHEMA, json.dumps(scene_schema(), indent=1, ensure_ascii=False) + "\n")
    scenes = {name: load_scene(name) for name in scene_names()}
    found = {
        name: {"stamp": stamp(scene), "point": best_point(scene).tolist()}
        for name, scene in scenes.items()
    }
    write_text(HERE / "shipped" / SHIPPED, json.dumps(found, indent=1) + "\n")


def write_distribution(name: str) -> None:
    """Write the test set of a distribution, and its pool if policies are trained on it."""
    distribution = load_distribution(name)
    columns, pool = (*distribution.features, *POINT), ScenePool(distribution)
    tables = {"test": (columns, _test_scenes(distribution, TESTED))}
    if name == "varied":
        beyond = [_beyond(distribution, place) for place in distribution.ranges]
        tables["beyond"] = (columns, [x for one in beyond for x in _test_scenes(one, BEYOND)])
    if name != "varied-beyond":
        for i in progress_bar(None, iterable=range(len(pool)), total=len(pool), unit=" scenes"):
            pool.scene(i)
        table = np.hstack([pool.numbers, pool.points, pool.uniform_scores[:, :1]])
        tables["pool"] = ((*distribution.features, *POINT, "score"), table.tolist())
    for kind, (columns, entries) in tables.items():
        lines = [stamp_of(distribution), ",".join(columns)]
        lines += [",".join(f"{x:.16g}" for x in line) for line in entries]
        write_text(HERE / "distributions" / f"{name}.{kind}.csv", "\n".join(lines) + "\n")


def _test_scenes(distribution: SceneDistribution, number: int) -> list[list[float]]:
    """Sample scenes of a test set: their numbers and the points of their uniform baselines."""
    scenes = []
    for i in progress_bar(None, iterable=range(number), total=number, unit=" test scenes"):
        numbers = distribution.sample_numbers(np.random.default_rng([TEST, i]), DIGITS)
        scenes.append([*numbers, *best_point(distribution.scene(numbers))])
    return scenes


def _beyond(distribution: SceneDistribution, place: Place) -> SceneDistribution:
    """Return the distribution with one range taken from "varied-beyond"."""
    table, key = place
    wider = load_distribution("varied-beyond").document[table][key]
    changed = distribution.document[table] | {key: wider}
    return SceneDistribution(distribution.document | {table: changed}, distribution.name)


if __name__ == "__main__":
    for asked in sys.argv[1:]:
        write_distribution(asked)
    if not sys.argv[1:]:
        write_scenes()
