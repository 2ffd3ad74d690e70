"""Tables of a scene's file, made from the fields of `SceneBase`.

The tables check scenes made in Python too. Editors check files by the JSON Schema that
`docs/shipped_scenes.py` makes from the tables; it adds the relations between keys.
"""

from __future__ import annotations

import dataclasses
import json
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_type_hints

import msgspec
from msgspec import Meta

from domino_env.core.checks import numbers, require_type
from domino_env.core.models import LARGEST, Size, Table, about, plain
from domino_env.physics.physics import Physics, released_push, require_physics
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.rules import Bounds
from domino_env.scenes.scene_base import SceneBase

HINTS = get_type_hints(SceneBase, include_extras=True)
DEFAULTS = {field.name: field.default for field in dataclasses.fields(SceneBase)}
DEFAULTS["name"] = None  # that of the file
# fields that are keys of [row], keys of no table, and tables
ROW = ("count", "height", "width", "density", "first_thickness", "length")
TOP = ("name", "title", "objective")
TABLES = ("stock", "ground", "limits", "placement", "run_out")


def _with_fields(base: type[msgspec.Struct], *names: str) -> Any:
    """Return a table of a file with the keys of `base`, and fields of `SceneBase` as keys."""
    keys: list[Any] = []
    for name in names:
        hint, default = HINTS[name], DEFAULTS[name]
        is_required = default is dataclasses.MISSING
        hint = hint | None if default is None else hint
        keys.append((name, hint) if is_required else (name, hint, default))
    frozen = base.__struct_config__.frozen
    return msgspec.defstruct("Table", keys, bases=(base,), kw_only=True, frozen=frozen)


class RowTable(_with_fields(Table, *ROW)):  # type: ignore[misc]
    """Dominoes of the chain."""


BOUNDS_HINT = "a pair of bounds, such as (0.002, 0.04)"


class RangeTable(Table):
    """Allowed values: one value or an interval."""

    fixed: Annotated[Size | None, about("the only value allowed [m]")] = None
    min: Annotated[Size | None, about("smallest value [m]")] = None
    max: Annotated[Size | None, about("largest value [m]")] = None
    of: Annotated[
        Literal["height"] | None,
        about("unit of the values: height of the domino, of the shorter one at a gap; default: m"),
    ] = None

    def __post_init__(self) -> None:
        given = [key for key in ("fixed", "min", "max") if getattr(self, key) is not None]
        if given not in (["fixed"], ["min", "max"]):
            has = " and ".join(given) or "no value"
            raise ValueError(f"it has {has}: give either fixed, or min and max [m]")
        low, high = self.bounds()
        if low > high:
            raise ValueError(f"min = {low} is more than max = {high}: give min <= max")

    def bounds(self) -> Bounds:
        """Return the smallest and the largest value; inverse of `_range_document`."""
        if self.fixed is not None:
            return self.fixed, self.fixed
        return self.min or 0.0, self.max or 0.0  # both are given


class GrowthTable(Table, kw_only=True):
    """Bounds of the height of a domino over that of the one before."""

    min: Annotated[float, Meta(ge=1, le=LARGEST, description="smallest ratio")] = 1.0
    max: Annotated[float, Meta(ge=1, le=LARGEST, description="largest ratio")]

    def __post_init__(self) -> None:
        if self.min > self.max:
            raise ValueError(f"min = {self.min} is more than max = {self.max}: give min <= max")


class PhysicsTable(_with_fields(Physics, "floor_friction")):  # type: ignore[misc]
    """Friction, gravity, push and floor."""

    push: Annotated[
        Size | Literal["released"],
        about('angular velocity of domino 0 at t = 0 [rad/s]; "released": tipped past balance'),
    ] = Physics().push


class SceneTables(_with_fields(Table, *TOP), kw_only=True):  # type: ignore[call-arg, misc]
    """Design problem: dominoes, allowed values, objective."""

    row: RowTable
    spacing: RangeTable
    thickness: RangeTable | None = None
    growth: GrowthTable | None = None
    physics: PhysicsTable = msgspec.field(default_factory=PhysicsTable)

    @property
    def in_heights(self) -> bool:
        """True if gaps and thicknesses are given in heights of a domino."""
        return self.spacing.of is not None

    def value_at(self, place: str) -> Any:
        """Return the value at a place such as "[stock]" or "row.length"; None if there is none."""
        value: Any = self
        for name in place.strip("[]").split("."):
            value = getattr(value, name, None)
        return value

    def first_thickness(self) -> float:
        """Return the thickness of domino 0 [m], by default the fixed one of the others."""
        if self.row.first_thickness is not None:
            return float(self.row.first_thickness)
        assert self.thickness is not None
        low, _ = self.thickness.bounds()
        return low * self.row.height if self.in_heights else low

    def thickness_bounds(self) -> Bounds:
        """Return the smallest and the largest thickness of dominoes 1 … N-1."""
        if self.thickness is not None:
            return self.thickness.bounds()
        assert self.stock is not None
        remaining = self.stock.without(self.first_thickness()).dominoes
        return float(remaining.min()), float(remaining.max())

    def _physics(self) -> Physics:
        """Return the physics, with the push of a released domino as a number."""
        values = {name: getattr(self.physics, name) for name in Physics.__struct_fields__}
        if values["push"] == "released":
            thickness, ground, tilt = self.first_thickness(), self.value_at("ground"), 0.0
            if ground is not None:
                tilt = float(ground.rise_and_tilt([thickness], [thickness] * 2)[1][0])
            values["push"] = released_push(self.row.height, thickness, values["gravity"], tilt)
        return Physics(**values)

    def fields(self) -> dict[str, Any]:
        """Return the fields of the scene that the tables describe; inverse of `make_document`."""
        shared = {name: getattr(self, name) for name in TOP + TABLES}
        return msgspec.structs.asdict(self.row) | shared | {
            "title": self.title or self.name,
            "physics": self._physics(),
            "floor_friction": self.physics.floor_friction,
            "first_thickness": self.first_thickness(),
            "spacing": self.spacing.bounds(),
            "thickness": self.thickness_bounds(),
            "growth": (self.growth.min, self.growth.max) if self.growth else None,
            "in_heights": self.in_heights,
            "settings": self.value_at(self.objective),
        }  # fmt: skip


def make_document(scene: Any) -> dict[str, Any]:
    """Return the tables of the file that describes a scene; inverse of `SceneTables.fields`."""
    require_physics(scene.physics)
    require_type("in_heights", scene.in_heights, bool, "True or False")
    of = "height" if scene.in_heights else None
    tables: dict[str, Any] = {name: getattr(scene, name) for name in TOP + TABLES} | {
        "row": {name: getattr(scene, name) for name in ROW},
        "spacing": _range_document("spacing", scene.spacing, of),
        "physics": plain(scene.physics) | {"floor_friction": scene.floor_friction},
    }
    if scene.stock is None and scene.thickness is not None:
        tables["thickness"] = _range_document("thickness", scene.thickness, of)
    if scene.growth is not None:
        low, high = numbers("growth", scene.growth, None, (2,), BOUNDS_HINT).tolist()
        tables["growth"] = {"min": low, "max": high}
    if scene.settings is not None:
        names = (name for name, kind in OBJECTIVES.items() if kind.table is type(scene.settings))
        # a value of another type is rejected as the unknown key "settings"
        tables[next(names, "settings")] = scene.settings
    return dict(_drop_none(plain(tables)))


def _range_document(name: str, bounds: Bounds, of: str | None) -> dict[str, Any]:
    """Return the document of a `RangeTable`; messages of errors begin with `name`."""
    low, high = numbers(name, bounds, None, (2,), BOUNDS_HINT).tolist()
    return ({"fixed": low} if low == high else {"min": low, "max": high}) | {"of": of}


def _drop_none(value: Any) -> Any:
    """Return a value without entries that are None, and with lists for tuples."""
    if isinstance(value, dict):
        return {key: _drop_none(entry) for key, entry in value.items() if entry is not None}
    return [_drop_none(entry) for entry in value] if isinstance(value, tuple | list) else value


if TYPE_CHECKING:
    SceneFile = SceneTables
else:
    SceneFile = msgspec.defstruct(
        "SceneFile",
        [(name, kind.table | None, None) for name, kind in OBJECTIVES.items() if kind.table],
        bases=(_with_fields(SceneTables, *TABLES),),
        namespace={"__doc__": SceneTables.__doc__},
        module=__name__,
        kw_only=True,
    )
"""Tables of a scene's file: `SceneTables`, with the tables of objectives by their names."""


def format_toml(document: dict[str, Any]) -> str:
    """Return a document as TOML: values before tables, and inner tables in one line."""
    lines = []
    for key, value in sorted(document.items(), key=lambda item: isinstance(item[1], dict)):
        if isinstance(value, dict):
            entries = (f"{k} = {_format_value(v)}" for k, v in value.items() if v is not None)
            lines += ["", f"[{key}]", *entries]
        else:
            lines.append(f"{key} = {_format_value(value)}")
    return "\n".join(lines) + "\n"


def _format_value(value: Any) -> str:
    if isinstance(value, dict):
        return f"{{{', '.join(f'{k} = {_format_value(v)}' for k, v in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_format_value, value))}]"
    # strings of JSON are valid TOML, except for the character DEL
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
