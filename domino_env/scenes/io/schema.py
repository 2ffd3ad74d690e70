"""The JSON Schema of scene files, by which editors complete and check them.

It ships beside the scenes as scene.schema.json; `python -m domino_env.scenes.shipping` writes it.
"""

from __future__ import annotations

from typing import Any

import msgspec

from domino_env.scenes import tables
from domino_env.scenes.io.ranges import Range
from domino_env.scenes.objectives import OBJECTIVES

SAMPLED = "ChainTable", "SpacingTable", "RangeTable", "PhysicsTable"
"""Tables in which a number may be a range."""


def scene_schema() -> dict[str, Any]:
    """Return the schema of a scene's file, draft 2020-12."""
    found = msgspec.json.schema(tables.SceneFile)
    classes = vars(tables) | {o.table.__name__: o.table for o in OBJECTIVES.values() if o.table}
    definitions: dict[str, dict[str, Any]] = {
        name: _without_null(schema) | getattr(classes[name], "SCHEMA", {})
        for name, schema in found["$defs"].items()
    }
    for schema in definitions.values():  # the first paragraph of the docstring
        schema["description"] = schema["description"].partition("\n\n")[0]
    for name in SAMPLED:
        for key, field in definitions[name]["properties"].items():
            if field.get("type") in ("number", "integer"):
                definitions[name]["properties"][key] = _or_range(field)
    definitions["Range"] = _without_null(msgspec.json.schema(Range)["$defs"]["Range"])
    scene = definitions.pop("SceneFile") | {"title": "a scene of domino-chains"}
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return head | scene | {"$defs": definitions}


def _or_range(field: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a number, or of the range from which it is sampled."""
    about = {key: field[key] for key in ("description", "default") if key in field}
    number = {key: value for key, value in field.items() if key not in about}
    return {"anyOf": [number, {"$ref": "#/$defs/Range"}]} | about


def _without_null(schema: Any) -> Any:
    """Return a schema without null, which TOML does not have: keys may be left out instead."""
    if isinstance(schema, list):
        return [_without_null(one) for one in schema if one != {"type": "null"}]
    if not isinstance(schema, dict):
        return schema
    kept = {key: _without_null(value) for key, value in schema.items() if value is not None}
    if len(kept.get("anyOf", ())) == 1:
        kept = kept.pop("anyOf")[0] | kept
    return kept
