"""The JSON Schema of scene files, by which editors complete and check them.

It ships beside the scenes as scene.schema.json; `python -m domino_env.scenes.shipping` writes it.
"""

from __future__ import annotations

from typing import Any

import msgspec

from domino_env.scenes import tables
from domino_env.scenes.io.ranges import UNFELT, Range
from domino_env.scenes.objectives import OBJECTIVES

DRAWN = {
    "row": "RowTable", "spacing": "SpacingTable", "thickness": "ThicknessTable",
    "physics": "PhysicsTable",
}  # fmt: skip
"""Tables in which a number may be a range."""


def scene_schema() -> dict[str, Any]:
    """Write the schema of a scene's file, draft 2020-12."""
    found = msgspec.json.schema(tables.SceneFile)
    classes = vars(tables) | {o.table.__name__: o.table for o in OBJECTIVES.values() if o.table}
    definitions: dict[str, dict[str, Any]] = {
        name: _without_null(told) | getattr(classes[name], "SCHEMA", {})
        for name, told in found["$defs"].items()
    }
    for table, name in DRAWN.items():
        for key, told in definitions[name]["properties"].items():
            if told.get("type") in ("number", "integer") and (table, key) not in UNFELT:
                definitions[name]["properties"][key] = _or_range(told)
    definitions["Range"] = _without_null(msgspec.json.schema(Range)["$defs"]["Range"])
    scene = definitions.pop("SceneFile") | {"title": "a scene of domino-chains"}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return head | scene | {"$defs": definitions}


def _or_range(told: dict[str, Any]) -> dict[str, Any]:
    """A number, or the range that it is drawn from: the file of a distribution."""
    said = {key: told[key] for key in ("description", "default") if key in told}
    number = {key: value for key, value in told.items() if key not in said}
    return {"anyOf": [number, {"$ref": "#/$defs/Range"}]} | said


def _without_null(told: Any) -> Any:
    """TOML knows no null: what may be null here may be left out there."""
    if isinstance(told, list):
        return [_without_null(one) for one in told if one != {"type": "null"}]
    if not isinstance(told, dict):
        return told
    kept = {key: _without_null(value) for key, value in told.items() if value is not None}
    if len(kept.get("anyOf", ())) == 1:
        kept = kept.pop("anyOf")[0] | kept
    return kept
