"""Scenes written as TOML files that read back as the same scene."""

from __future__ import annotations

import json
from typing import Any

import msgspec

from domino_env.scenes.io.tables import Bounds, Values, steps
from domino_env.scenes.specification import Specification


def document_of(scene: Specification) -> dict[str, Any]:
    """Write the tables of the file that reads back as the same scene."""
    of = "height" if scene.in_heights else None
    change = scene.largest_change
    spacing = _range(scene.spacing, scene.spacing_values) | {"largest_change": change, "of": of}
    found: dict[str, Any] = {
        "name": scene.name,
        "title": scene.title,
        "objective": scene.objective,
        "row": {
            key: getattr(scene, key)
            for key in ("count", "height", "width", "density", "first_thickness", "length")
        },
        "spacing": spacing,
    }
    if scene.stock is None:
        found["thickness"] = _range(scene.thickness, scene.thickness_values) | {"of": of}
    if scene.growth is not None:
        found["growth"] = {"min": scene.growth[0], "max": scene.growth[1]}
    parts = {
        "stock": scene.stock, "ground": scene.ground, "physics": scene.physics,
        "limits": scene.limits, scene.objective: scene.settings,
    }  # fmt: skip
    for name, held in parts.items():
        if held is not None:
            found[name] = msgspec.to_builtins(held)
    found["physics"]["floor_friction"] = scene.floor_friction
    if scene.placement_deviation:
        found["placement"] = {"deviation": scene.placement_deviation}
    for key, table in found.items():
        if isinstance(table, dict):
            found[key] = {k: _as_lists(v) for k, v in table.items() if v is not None}
    return found


def to_toml(scene: Specification) -> str:
    """Write the text of a file that reads back as the same scene."""
    return text_of(document_of(scene))


def text_of(document: dict[str, Any]) -> str:
    """Write the text of a document: values before tables, and tables of tables in a line."""
    lines = []
    for key, value in sorted(document.items(), key=lambda item: isinstance(item[1], dict)):
        if isinstance(value, dict):
            lines += ["", f"[{key}]", *(f"{k} = {_toml(v)}" for k, v in value.items())]
        else:
            lines.append(f"{key} = {_toml(value)}")
    return "\n".join(lines) + "\n"


def _range(bounds: Bounds, values: Values | None) -> dict[str, Any]:
    low, high = bounds
    if low == high:
        return {"fixed": low}
    if values is None:
        return {"min": low, "max": high}
    step = round(values[1] - values[0], 12)
    if len(values) > 2 and steps(low, high, step) == values:
        return {"min": low, "max": high, "step": step}
    return {"values": values}


def _as_lists(value: Any) -> Any:
    return [_as_lists(one) for one in value] if isinstance(value, tuple) else value


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{k} = {_toml(v)}' for k, v in value.items())}}}"
    return repr(float(value) if isinstance(value, float) else int(value))
