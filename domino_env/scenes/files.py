"""Scenes as TOML files: read by `domino_env.scenes.tables`, and written so that they read back."""

from __future__ import annotations

import difflib
import json
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any

from domino_env.scene import Scene, scene_names
from domino_env.scenes.clashes import first_clash
from domino_env.scenes.tables import Bounds, SceneFile, Values, steps
from domino_env.support.models import model_of
from domino_env.support.reading import naming, one_line, read_bytes, refuse


def read_scene(name: str | Path) -> Scene:
    """A scene by name or by the path of its file; see `domino_env.load_scene`."""
    path = Path(name)
    known = scene_names()
    if str(name) not in known and (path.suffix == ".toml" or path.is_file()):
        if not path.is_file():
            refuse(path, "there is no such scene file")
        try:
            text = read_bytes(path).decode("utf-8-sig")
        except UnicodeDecodeError:
            refuse(path, "not UTF-8 text; save the file as UTF-8")
        return parse_scene(text, path.stem, str(path))
    if str(name) not in known:
        near = difflib.get_close_matches(str(name)[:300], known, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise ValueError(
            f"there is no scene '{one_line(str(name), 100)}': {hint}scenes that ship: "
            f"{', '.join(known)}; or give the path of a .toml file"
        )
    text = (resources.files("domino_env") / "scenes" / f"{name}.toml").read_text("utf-8")
    return parse_scene(text, str(name), f"{name}.toml")


def parse_scene(text: str, name: str, file: str) -> Scene:
    """A scene from the text of its file.

    Parameters
    ----------
    text
        TOML.
    name
        What the scene is called unless the text says it.
    file
        What errors call the text.

    Raises
    ------
    ValueError
        With file, key, value and what is allowed.
    """
    with naming(file):
        try:
            document = tomllib.loads(text)
        except RecursionError:
            raise ValueError("not TOML: nested too deep") from None
        except ValueError as error:
            raise ValueError(f"not TOML: {error}") from None
    return scene_of_document(document, name, file)


def scene_of_document(document: dict[str, Any], name: str, file: str) -> Scene:
    """A scene from what `tomllib` makes of the text of its file; see `parse_scene`."""
    with naming(file):
        asked = model_of(SceneFile, {"name": name} | document)
        clash = first_clash(asked)
        if clash is not None:
            raise ValueError(clash)
        spacing, spacing_values = asked.spacing.allowed()
        thickness, thickness_values = asked.thickness_allowed()
        return Scene(
            name=asked.name or name,
            title=asked.title or asked.name or name,
            objective=asked.objective,
            physics=asked.physics_asked(),
            count=asked.row.count,
            height=asked.row.height,
            width=asked.row.width,
            density=asked.row.density,
            first_thickness=asked.first_thickness(),
            spacing=spacing,
            thickness=thickness,
            length=asked.row.length,
            spacing_values=spacing_values,
            thickness_values=thickness_values,
            largest_change=asked.spacing.largest_change,
            stock=asked.stock.stock() if asked.stock else None,
            growth=(asked.growth.min, asked.growth.max) if asked.growth else None,
            in_heights=asked.in_heights,
            limits=asked.limits_asked(),
            tempo=asked.tempo.tempo() if asked.tempo else None,
            placement=asked.robust.placement() if asked.robust else None,
        )


def document_of(scene: Scene) -> dict[str, Any]:
    """The tables of the file that reads back as the same scene."""
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
    else:
        found["stock"] = {"thickness": scene.stock.thickness, "count": scene.stock.count}
    if scene.growth is not None:
        found["growth"] = {"min": scene.growth[0], "max": scene.growth[1]}
    for table, held, keys in (
        ("physics", scene.physics, ("friction", "gravity", "push")),
        ("limits", scene.limits, ("stall_margin", "flush_loss")),
        ("tempo", scene.tempo, ("first", "last", "times", "tolerance")),
        ("robust", scene.placement, ("deviation", "quantile", "draws", "seed")),
    ):
        if held is not None:
            named = {"first": "from", "last": "to"}
            found[table] = {named.get(key, key): getattr(held, key) for key in keys}
    for key, table in found.items():
        if isinstance(table, dict):
            found[key] = {
                k: list(v) if isinstance(v, tuple) else v for k, v in table.items() if v is not None
            }
    return found


def to_toml(scene: Scene) -> str:
    """The text of a file that reads back as the same scene."""
    lines = []
    for key, value in document_of(scene).items():
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


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    return repr(float(value) if isinstance(value, float) else int(value))
