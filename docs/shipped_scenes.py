"""Write the files that ship with scenes: ``python docs/shipped_scenes.py``.

Writes the JSON Schema of scene files, the uniform baselines of the shipped scenes and the revision
of the environments; with ``--schema`` the JSON Schema alone; with names of distributions, ``python
docs/shipped_scenes.py varied``, their pools, test and validation sets instead.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from domino_env import DominoChainVector
from domino_env.core import results
from domino_env.core.files import write_text
from domino_env.core.progress import progress_bar
from domino_env.scenes import tables
from domino_env.scenes.distribution import SceneDistribution, load_distribution
from domino_env.scenes.io.ranges import Range
from domino_env.scenes.io.reading import SCHEMA, load_scene, read_named, scene_names
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.pool import DIGITS, SEEDS, ScenePool, make_stamp
from domino_env.scenes.uniform import POINTS_FILE, best_point, stamp

SCENES = Path(tables.__file__).parent
SIZES = {"test": 200, "validation": 100}  # [scenes]; half as many if episodes are random
RANDOM_POOL = 512  # [scenes] if episodes are random
# scenes of the benchmark, and steps in each, on which the revision depends
BENCHMARK = (
    "sprint", "course", "sprint-thickness", "ideal", "draw", "tempo-noise", "varied",
    "varied-draw", "varied-tempo",
)  # fmt: skip
REVISION_STEPS = 160  # two of the longest episodes
POINT = ("uniform gap", "uniform thickness")  # columns of files: `best_point` [m]
# tables in which a number may be a range
RANGE_TABLES = "RowTable", "RangeTable", "PhysicsTable", "Tempo"
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
    kinds = definitions["Stock"]["properties"]["thickness"]
    kinds["items"] = _number_or_range(kinds["items"])
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


def write_schema() -> None:
    """Write the JSON Schema of scene files."""
    schema = json.dumps(scene_schema(), indent=1, ensure_ascii=False)
    write_text(SCENES / "shipped" / SCHEMA.name, schema + "\n")


def write_scenes() -> None:
    """Write the uniform baselines of the shipped scenes, and the revision."""
    scenes = {name: load_scene(name) for name in scene_names()}
    baselines = {
        name: {"stamp": stamp(scene.document()), "point": best_point(scene).tolist()}
        for name, scene in scenes.items()
    }
    write_text(SCENES / "shipped" / POINTS_FILE, json.dumps(baselines, indent=1) + "\n")
    write_text(Path(results.__file__).with_name("revision.txt"), compute_revision() + "\n")


def compute_revision() -> str:
    """Return a digest of the scenes of the benchmark, and of observations and rewards in them.

    Numbers are rounded to six digits, as the last bits depend on processor and compiler.
    """
    words: list[object] = []
    for name in BENCHMARK:
        document, _, _ = read_named(name)
        words.append({k: v for k, v in document.items() if k not in ("name", "title")})
        folder = SCENES / "distributions"
        words += [file.read_text("utf-8") for file in sorted(folder.glob(f"{name}.*.csv"))]
        env, rng = DominoChainVector(2, name), np.random.default_rng(0)
        totals = env.reset(seed=0)[0].astype(np.float64)
        returns = np.zeros(2)
        for _ in range(REVISION_STEPS):
            actions = rng.uniform(-0.3, 0.3, env.action_space.shape)
            observations, rewards, *_ = env.step(actions)
            totals, returns = totals + observations, returns + rewards
        words += [f"{x:.6g}" for x in (*totals.ravel().tolist(), *returns.tolist())]
    return hashlib.sha256(json.dumps(words, sort_keys=True).encode()).hexdigest()[:12]


def write_distribution(name: str) -> None:
    """Write the test and validation set, and the pool of a distribution that is trained on."""
    distribution = load_distribution(name)
    # the baseline of a scene with random episodes is slow to compute
    is_random = distribution.first.hand > 0 or distribution.first.placement is not None
    if name != "varied-beyond":
        pool = ScenePool(distribution, RANDOM_POOL if is_random else None)
        bar = progress_bar(None, iterable=range(len(pool)), total=len(pool), unit=" scenes")
        scores = [pool.scene(i).uniform().score for i in bar]
        table = np.column_stack([pool.numbers, pool.points, scores])
        _write_table(distribution, "pool", (*POINT, "score"), table.tolist())
    for kind, most in SIZES.items():
        scenes, number = list[list[float]](), most // 2 if is_random else most
        for i in progress_bar(None, iterable=range(number), total=number, unit=f" {kind} scenes"):
            numbers = distribution.sample_numbers(np.random.default_rng([SEEDS[kind], i]), DIGITS)
            point = best_point(distribution.scene(numbers), quick=is_random)
            scenes.append([*numbers, *point])
        _write_table(distribution, kind, POINT, scenes)


def _write_table(
    distribution: SceneDistribution, kind: str, columns: Sequence[str], table: list[list[float]]
) -> None:
    """Write the sampled numbers and other columns of the scenes of a distribution."""
    lines = [make_stamp(distribution), ",".join((*distribution.features, *columns))]
    lines += [",".join(f"{x:.16g}" for x in line) for line in table]
    file = SCENES / "distributions" / f"{distribution.name}.{kind}.csv"
    write_text(file, "\n".join(lines) + "\n")


if __name__ == "__main__":
    names = [name for name in sys.argv[1:] if name != "--schema"]
    for name in names:
        write_distribution(name)
    if not names:
        write_schema()
    if not sys.argv[1:]:
        write_scenes()
