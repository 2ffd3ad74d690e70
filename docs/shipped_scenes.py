"""Write the files that ship with scenes: ``python docs/shipped_scenes.py``.

Writes the JSON Schema of scene files and the uniform baselines of the shipped scenes; with names of
distributions, ``python docs/shipped_scenes.py varied``, their pools and test sets instead.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from domino_env.core.files import write_text
from domino_env.core.progress import progress_bar
from domino_env.scenes import tables
from domino_env.scenes.distribution import SceneDistribution, load_distribution
from domino_env.scenes.io.ranges import Range
from domino_env.scenes.io.reading import SCHEMA, load_scene, scene_names
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.pool import DIGITS, ScenePool, make_stamp
from domino_env.scenes.uniform import POINTS_FILE, best_point, stamp

SCENES = Path(tables.__file__).parent
TEST_SEED, TEST_SIZE = 1, 200  # scene i of a test set has the seed [TEST_SEED, i]
POINT = ("uniform gap", "uniform thickness")  # columns of files: `best_point` [m]
# tables in which a number may be a range
RANGE_TABLES = "RowTable", "RangeTable", "PhysicsTable"
# relations between the keys of a table, which its class checks
RELATIONS: dict[str, dict[str, Any]] = {
    "SceneFile": {"oneOf": [{"required": ["thickness"]}, {"required": ["stock"]}]},
    "RangeTable": {"oneOf": [{"required": ["fixed"]}, {"required": ["min", "max"]}]},
    "Ground": {"oneOf": [{"required": ["slope"]}, {"required": ["profile"]}]},
    "Tempo": {"oneOf": [{"required": ["from", "to"]}, {"required": ["times"]}]},
}


def scene_schema() -> dict[str, Any]:
    """Return the JSON Schema of scene files, draft 2020-12."""
    schema_of_file = msgspec.json.schema(tables.SceneFile)
    definitions: dict[str, dict[str, Any]] = {
        name: _without_null(schema) | RELATIONS.get(name, {})
        for name, schema in schema_of_file["$defs"].items()
    }
    for schema in definitions.values():  # only the first paragraph of the docstring
        schema["description"] = schema["description"].partition("\n\n")[0]
    for name in RANGE_TABLES:
        for key, field in definitions[name]["properties"].items():
            kinds = [kind.get("type") for kind in field.get("anyOf", [field])]
            if "number" in kinds or "integer" in kinds:
                definitions[name]["properties"][key] = _number_or_range(field)
    definitions["Range"] = _without_null(msgspec.json.schema(Range)["$defs"]["Range"])
    scene = definitions.pop("SceneFile") | {"title": "a scene of domino-chains"}
    scene["properties"]["objective"]["enum"] = [*OBJECTIVES]
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return head | scene | {"$defs": definitions}


def _number_or_range(field: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a number, or of the range from which it is sampled."""
    shared = {key: field[key] for key in ("description", "default") if key in field}
    number = {key: value for key, value in field.items() if key not in shared}
    return {"anyOf": [*number.get("anyOf", [number]), {"$ref": "#/$defs/Range"}]} | shared


def _without_null(schema: Any) -> Any:
    """Return a schema without null, which TOML does not have: a key is left out instead."""
    if isinstance(schema, list):
        return [_without_null(entry) for entry in schema if entry != {"type": "null"}]
    if not isinstance(schema, dict):
        return schema
    clean = {key: _without_null(value) for key, value in schema.items() if value is not None}
    if len(clean.get("anyOf", ())) == 1:
        clean = clean.pop("anyOf")[0] | clean
    return clean


def write_scenes() -> None:
    """Write the JSON Schema and the uniform baselines of the shipped scenes."""
    schema = json.dumps(scene_schema(), indent=1, ensure_ascii=False)
    write_text(SCENES / "shipped" / SCHEMA.name, schema + "\n")
    scenes = {name: load_scene(name) for name in scene_names()}
    baselines = {
        name: {"stamp": stamp(scene.document()), "point": best_point(scene).tolist()}
        for name, scene in scenes.items()
    }
    write_text(SCENES / "shipped" / POINTS_FILE, json.dumps(baselines, indent=1) + "\n")


def write_distribution(name: str) -> None:
    """Write the test set of a distribution, and its pool if policies are trained on it."""
    distribution = load_distribution(name)
    columns, pool = (*distribution.features, *POINT), ScenePool(distribution)
    entries_of = {"test": (columns, _test_scenes(distribution, TEST_SIZE))}
    if name != "varied-beyond":
        bar = progress_bar(None, iterable=range(len(pool)), total=len(pool), unit=" scenes")
        scores = [pool.scene(i).uniform().score for i in bar]
        table = np.column_stack([pool.numbers, pool.points, scores])
        entries_of["pool"] = ((*distribution.features, *POINT, "score"), table.tolist())
    for kind, (columns, entries) in entries_of.items():
        lines = [make_stamp(distribution), ",".join(columns)]
        lines += [",".join(f"{x:.16g}" for x in line) for line in entries]
        write_text(SCENES / "distributions" / f"{name}.{kind}.csv", "\n".join(lines) + "\n")


def _test_scenes(distribution: SceneDistribution, number: int) -> list[list[float]]:
    """Return the sampled numbers of test scenes, each with `best_point` of the scene."""
    scenes = []
    for i in progress_bar(None, iterable=range(number), total=number, unit=" test scenes"):
        numbers = distribution.sample_numbers(np.random.default_rng([TEST_SEED, i]), DIGITS)
        scenes.append([*numbers, *best_point(distribution.scene(numbers))])
    return scenes


if __name__ == "__main__":
    for name in sys.argv[1:]:
        write_distribution(name)
    if not sys.argv[1:]:
        write_scenes()
