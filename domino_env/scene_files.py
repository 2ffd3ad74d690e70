"""Scenes as TOML files: read with care, written back."""

from __future__ import annotations

import difflib
import sys
import tomllib
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from domino_env.layout import DENSITY, HEIGHT, WIDTH
from domino_env.physics import Physics

if TYPE_CHECKING:
    from domino_env.scene import Bounds, Scene

LARGEST_FILE = 1_000_000  # [bytes]
LARGEST_COUNT = 10_000_000
OBJECTIVES = ("mean_speed",)

_TOP = ("name", "title", "objective", "row", "spacing", "thickness", "physics")
_ROW = ("count", "height", "width", "density", "first_thickness", "length")
_RANGE = ("min", "max", "fixed")
_PHYSICS = ("friction", "gravity", "push")


def read_scene(name: str | Path) -> Scene:
    """A scene by name or by the path of its file; see `domino_env.scene.load_scene`."""
    from domino_env.scene import scene_names

    path = Path(name)
    known = scene_names()
    if str(name) not in known and (path.suffix == ".toml" or path.is_file()):
        if not path.is_file():
            raise ValueError(f"{path}: there is no such scene file")
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"{path}: a scene file has at most {LARGEST_FILE} bytes")
        try:
            text = path.read_text(encoding="utf-8-sig")
        except UnicodeDecodeError:
            raise ValueError(f"{path}: not UTF-8 text; save the file as UTF-8") from None
        return parse_scene(text, path.stem, str(path))
    if str(name) not in known:
        near = difflib.get_close_matches(str(name), known, n=1)
        hint = f"did you mean '{near[0]}'? " if near else ""
        raise ValueError(
            f"there is no scene '{name}': {hint}scenes that ship: {', '.join(known)}; "
            "or give the path of a .toml file"
        )
    text = (resources.files("domino_env") / "scenes" / f"{name}.toml").read_text("utf-8")
    return parse_scene(text, str(name), f"{name}.toml")


def parse_scene(text: str, name: str, file: str) -> Scene:
    """A scene from the text of its file.

    name: what the scene is called unless the text says it; file: what errors call the text.
    """
    from domino_env.scene import Scene

    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{file}: not TOML: {error}") from None
    _known(document, _TOP, file, "")
    row = _table(document, "row", _ROW, file)
    forces = _table(document, "physics", _PHYSICS, file)
    objective = document.get("objective", OBJECTIVES[0])
    if objective not in OBJECTIVES:
        raise ValueError(f"{file}: objective = {objective!r}: choose {', '.join(OBJECTIVES)}")
    name, title = _line(document, "name", file, name), _line(document, "title", file, name)
    count = row.get("count")
    if not isinstance(count, int) or isinstance(count, bool) or not 2 <= count <= LARGEST_COUNT:
        what = "row.count is missing" if count is None else f"row.count = {count!r}"
        raise ValueError(f"{file}: {what}: give a whole number from 2 to {LARGEST_COUNT}")
    thickness = _range(document, "thickness", file)
    same = thickness[0] if thickness[0] == thickness[1] else None  # as thick as all the others
    defaults = Physics()
    values = [_finite(forces, "physics", key, file, getattr(defaults, key)) for key in _PHYSICS]
    try:
        physics = Physics(*values)
    except ValueError as error:
        raise ValueError(f"{file}: physics.{error}") from None
    length = row.get("length")
    scene = Scene(
        name=name,
        title=title,
        objective=objective,
        physics=physics,
        count=count,
        height=_positive(row, "row", "height", file, HEIGHT),
        width=_positive(row, "row", "width", file, WIDTH),
        density=_positive(row, "row", "density", file, DENSITY),
        first_thickness=_positive(row, "row", "first_thickness", file, same),
        spacing=_range(document, "spacing", file),
        thickness=thickness,
        length=None if length is None else _positive(row, "row", "length", file, None),
    )
    _feasible(scene, file)
    return scene


def to_toml(scene: Scene) -> str:
    """The text of a file that reads back as the same scene."""
    lines = [f"name = {_quoted(scene.name)}", f"title = {_quoted(scene.title)}"]
    lines += [f"objective = {_quoted(scene.objective)}"]
    lines += ["", "[row]", f"count = {scene.count}"]
    for key in ("height", "width", "density", "first_thickness"):
        lines.append(f"{key} = {getattr(scene, key)!r}")
    if scene.length is not None:
        lines.append(f"length = {scene.length!r}")
    for key in ("spacing", "thickness"):
        low, high = getattr(scene, key)
        lines += ["", f"[{key}]"]
        lines += [f"fixed = {low!r}"] if low == high else [f"min = {low!r}", f"max = {high!r}"]
    lines += ["", "[physics]"]
    lines += [f"{key} = {getattr(scene.physics, key)!r}" for key in _PHYSICS]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return (
        '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped) + '"'
    )


def _known(table: dict[str, Any], allowed: tuple[str, ...], file: str, where: str) -> None:
    for key in table:
        if key not in allowed:
            near = difflib.get_close_matches(key, allowed, n=1)
            hint = f"did you mean '{near[0]}'? " if near else ""
            raise ValueError(
                f"{file}: unknown key '{where}{key}': {hint}allowed: {', '.join(allowed)}"
            )


def _table(
    document: dict[str, Any], name: str, allowed: tuple[str, ...], file: str
) -> dict[str, Any]:
    table = document.get(name)
    if not isinstance(table, dict):
        raise ValueError(f"{file}: the table [{name}] is missing; it holds {', '.join(allowed)}")
    _known(table, allowed, file, f"{name}.")
    return table


def _line(document: dict[str, Any], key: str, file: str, default: str) -> str:
    value = document.get(key, default)
    if not isinstance(value, str) or not value.strip():
        raise ValueError(f"{file}: {key} = {value!r}: give a line of text")
    return value


def _finite(table: dict[str, Any], where: str, key: str, file: str, default: float | None) -> float:
    value = table.get(key, default)
    if value is None:
        raise ValueError(f"{file}: {where}.{key} is missing: give a number, SI units")
    # compared, not converted: TOML's whole numbers may be larger than any float
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and -sys.float_info.max <= value <= sys.float_info.max):
        raise ValueError(f"{file}: {where}.{key} = {value!r}: give a finite number, SI units")
    return float(value)


def _positive(
    table: dict[str, Any], where: str, key: str, file: str, default: float | None
) -> float:
    value = _finite(table, where, key, file, default)
    if value <= 0.0:
        raise ValueError(f"{file}: {where}.{key} = {value}: must be more than 0, SI units")
    return value


def _range(document: dict[str, Any], name: str, file: str) -> Bounds:
    table = _table(document, name, _RANGE, file)
    if "fixed" in table:
        if len(table) > 1:
            raise ValueError(
                f"{file}: {name}.fixed stands beside min or max: give one or the other"
            )
        value = _positive(table, name, "fixed", file, None)
        return value, value
    for key in ("min", "max"):
        if key not in table:
            raise ValueError(f"{file}: {name}.{key} is missing: give min and max, or fixed [m]")
    low = _positive(table, name, "min", file, None)
    high = _positive(table, name, "max", file, None)
    if low > high:
        raise ValueError(f"{file}: {name}.min = {low} m is more than {name}.max = {high} m")
    return low, high


def _feasible(scene: Scene, file: str) -> None:
    """Whether any row at all meets the length."""
    if scene.length is None:
        return
    pairs = scene.count - 1
    least = pairs * (scene.spacing[0] + scene.thickness[0])
    most = pairs * (scene.spacing[1] + scene.thickness[1])
    if not least <= scene.length <= most:
        raise ValueError(
            f"{file}: row.length = {scene.length} m cannot be met: {scene.count} dominoes within "
            f"the bounds cover {least:.6g} to {most:.6g} m"
        )
