"""Scenes as TOML text, which reads back as the same scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

from domino_env.scene_tables import LIMITS, PHYSICS, ROBUST, steps

if TYPE_CHECKING:
    from domino_env.scene import Bounds, Scene


def to_toml(scene: Scene) -> str:
    """The text of a file that reads back as the same scene."""
    lines = [f"name = {_quoted(scene.name)}", f"title = {_quoted(scene.title)}"]
    lines += [f"objective = {_quoted(scene.objective)}"]
    lines += ["", "[row]", f"count = {scene.count}"]
    for key in ("height", "width", "density", "first_thickness"):
        lines.append(f"{key} = {getattr(scene, key)!r}")
    if scene.length is not None:
        lines.append(f"length = {scene.length!r}")
    lines += ["", "[spacing]", *_range_lines(scene.spacing, scene.spacing_values)]
    if scene.largest_change is not None:
        lines.append(f"largest_change = {scene.largest_change!r}")
    if scene.in_heights:
        lines.append('of = "height"')
    if scene.stock is None:
        lines += ["", "[thickness]", *_range_lines(scene.thickness, scene.thickness_values)]
        if scene.in_heights:
            lines.append('of = "height"')
    else:
        lines += ["", "[stock]", f"thickness = {list(scene.stock.thickness)!r}"]
        lines += [f"count = {list(scene.stock.count)!r}"]
    if scene.growth is not None:
        lines += ["", "[growth]", f"min = {scene.growth[0]!r}", f"max = {scene.growth[1]!r}"]
    lines += ["", "[physics]"]
    lines += [f"{key} = {getattr(scene.physics, key)!r}" for key in PHYSICS]
    if scene.limits is not None:
        lines += ["", "[limits]"]
        told = [(key, getattr(scene.limits, key)) for key in LIMITS]
        lines += [f"{key} = {value!r}" for key, value in told if value is not None]
    if scene.tempo is not None:
        lines += ["", "[tempo]"]
        if scene.tempo.times is None:
            lines += [f"from = {scene.tempo.first!r}", f"to = {scene.tempo.last!r}"]
        else:
            lines.append(f"times = {list(scene.tempo.times)!r}")
        lines.append(f"tolerance = {scene.tempo.tolerance!r}")
    if scene.placement is not None:
        lines += ["", "[robust]"]
        lines += [f"{key} = {getattr(scene.placement, key)!r}" for key in ROBUST]
    return "\n".join(lines) + "\n"


def _range_lines(bounds: Bounds, values: tuple[float, ...] | None) -> list[str]:
    low, high = bounds
    if low == high:
        return [f"fixed = {low!r}"]
    if values is None:
        return [f"min = {low!r}", f"max = {high!r}"]
    step = round(values[1] - values[0], 12)
    if len(values) > 2 and steps(low, high, step) == values:
        return [f"min = {low!r}", f"max = {high!r}", f"step = {step!r}"]
    return [f"values = {[float(v) for v in values]!r}"]


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return (
        '"' + "".join(c if c >= " " and c != "\x7f" else f"\\u{ord(c):04x}" for c in escaped) + '"'
    )
