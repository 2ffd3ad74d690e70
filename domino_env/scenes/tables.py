"""Tables of a scene's file: names, types, ranges and descriptions of their keys.

Fields of scenes made in Python have the same types. Editors check files by the JSON Schema that
`docs/shipped_scenes.py` makes from the tables; it adds the relations between keys.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from domino_env.core.checks import numbers, require_choice, require_type
from domino_env.core.models import LARGEST, Amount, Size, Table, about, plain, read_model
from domino_env.physics.ground import Ground
from domino_env.physics.physics import Physics, released_push, require_physics
from domino_env.physics.standard import DENSITY, HEIGHT, WIDTH
from domino_env.scenes.limits import Limits
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.placement import Placement
from domino_env.scenes.rules import MAX_DOMINOES, Bounds, Stock
from domino_env.scenes.run_out import RunOut

# begins with a letter or a digit of any language; has no character special to paths or shells
NAME_PATTERN = r'^[^\x00-/:-@\[-`{-~\s][^\x00-\x1f\x7f/\\<>:"|?*`$]*$(?!\n)'
# one line of text that is not blank
LINE_PATTERN = r"^[^\x00-\x1f\x7f]*[^\x00-\x20\x7f][^\x00-\x1f\x7f]*$(?!\n)"

RELEASED = "released"  # push of a first domino that is tipped past its balance

Name = Annotated[str, Meta(pattern=NAME_PATTERN, max_length=100)]
Title = Annotated[str, Meta(pattern=LINE_PATTERN, max_length=300)]


class RowTable(Table, kw_only=True):
    """Dominoes of the chain."""

    count: Annotated[int, Meta(ge=2, le=MAX_DOMINOES, description="number of dominoes")]
    height: Annotated[Size, about("height of every domino, or of the first [m]")] = HEIGHT
    width: Annotated[Size, about("size across the chain; times do not depend on it [m]")] = WIDTH
    density: Annotated[Size, about("density of every domino [kg/m³]")] = DENSITY
    first_thickness: Annotated[
        Size | None, about("thickness of domino 0 [m]; required if thickness is free")
    ] = None
    length: Annotated[Size | None, about("exact distance from first to last pivot [m]")] = None


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

    @property
    def bounds(self) -> Any:
        """Smallest and largest value."""
        return self.fixed or self.min, self.fixed or self.max


Ratio = Annotated[float, Meta(ge=1, le=LARGEST)]


class GrowthTable(Table, kw_only=True):
    """Bounds of the height of a domino over that of the one before."""

    min: Annotated[Ratio, about("smallest ratio")] = 1.0
    max: Annotated[Ratio, about("largest ratio")]


class PhysicsTable(Physics, kw_only=True, frozen=True):  # type: ignore[misc]
    """Friction, gravity, push and floor."""

    push: Annotated[
        Size | Literal["released"],
        about('angular velocity of domino 0 at t = 0 [rad/s]; "released": tipped past balance'),
    ] = Physics().push  # type: ignore[assignment]
    floor_friction: Annotated[
        Amount | None, about("friction coefficient of the floor; without it pivots are fixed")
    ] = None


class SceneTables(Table, kw_only=True):
    """Design problem: dominoes, allowed values, objective."""

    name: Annotated[
        Name,
        about(
            "name of the scene and of its run folders: begins with a letter or a digit, "
            'none of / \\ < > : " | ? * ` $; default: name of the file',
        ),
    ] | None = None  # fmt: skip
    title: Annotated[Title, about("subject of the scene in one line")] | None = None
    objective: Annotated[str, about("rule by which layouts are scored")] = "mean_speed"
    row: RowTable
    spacing: RangeTable
    thickness: RangeTable | None = None
    growth: GrowthTable | None = None
    physics: PhysicsTable = msgspec.field(default_factory=PhysicsTable)
    stock: Annotated[Stock | None, about("dominoes to use, instead of thickness")] = None
    ground: Ground | None = None
    limits: Limits | None = None
    placement: Placement | None = None
    run_out: RunOut | None = None

    def __post_init__(self) -> None:
        if self.thickness is None:
            return
        if self.stock is not None:
            raise ValueError(
                "[thickness] and [stock] exclude each other: both give the thicknesses; leave one "
                "of them out"
            )
        if self.spacing.of != self.thickness.of:
            here, there = "spacing", "thickness"
            here, there = (here, there) if self.spacing.of else (there, here)
            raise ValueError(f'{here}.of = "height" but {there} is in metres: give both in heights')

    def fields(self) -> dict[str, Any]:
        """Return the fields of the scene that the tables describe; inverse of `make_document`."""
        physics = {name: getattr(self.physics, name) for name in Physics.__struct_fields__}
        if physics["push"] == RELEASED:  # see `released`
            del physics["push"]
        settings = (getattr(self, name, None) for name in OBJECTIVES)
        return msgspec.structs.asdict(self.row) | {
            **{name: getattr(self, name) for name in TOP + TABLES},
            "physics": Physics(**physics),
            "floor_friction": self.physics.floor_friction,
            "spacing": self.spacing.bounds,
            "thickness": self.thickness and self.thickness.bounds,
            "growth": self.growth and (self.growth.min, self.growth.max),
            "in_heights": self.spacing.of is not None,
            "settings": next((table for table in settings if table is not None), None),
        }


SceneFile: type[SceneTables] = msgspec.defstruct(  # type: ignore[assignment]
    "SceneFile",
    [(name, kind.table | None, None) for name, kind in OBJECTIVES.items() if kind.table],
    bases=(SceneTables,),
    namespace={"__doc__": SceneTables.__doc__},
    kw_only=True,
)
"""Tables of a scene's file: `SceneTables`, with the tables of objectives by their names."""

# fields of scenes that are keys of no table, keys of [row], and tables
TOP, ROW = ("name", "title", "objective"), RowTable.__struct_fields__
TABLES = ("stock", "ground", "limits", "placement", "run_out")
KEYS = {
    key.name: key
    for table in (RowTable, SceneTables, PhysicsTable)
    for key in msgspec.structs.fields(table)
}
# types of bounds
PAIRS: dict[str, Any] = dict.fromkeys(("spacing", "thickness"), tuple[Size, Size])
PAIRS["growth"] = tuple[Ratio, Ratio]


def read_tables(document: Any) -> SceneTables:
    """Read the document of a scene; raise a ValueError for a wrong key or value."""
    if isinstance(document, dict) and "objective" in document:
        require_choice("objective", document["objective"], OBJECTIVES)
    return read_model(SceneFile, document)


def check_types(scene: Any) -> dict[str, Any]:
    """Check the types and ranges of the fields of a scene, and return them."""
    require_physics(scene.physics)
    require_type("in_heights", scene.in_heights, bool, "True or False")
    tables = *(kind.table for kind in OBJECTIVES.values() if kind.table), type(None)
    require_choice("objective", scene.objective, OBJECTIVES)
    require_type("settings", scene.settings, tables, "the table of an objective, or None")
    fields = {
        name: read_model(KEYS[name].type, plain(getattr(scene, name)), name)
        for name in (*TOP, *ROW, *TABLES, "floor_friction")
    }
    for name, kind in PAIRS.items():
        bounds = getattr(scene, name)
        if bounds is not None or name == "spacing":
            pair = numbers(name, bounds, None, (2,), "a pair of bounds, such as (0.002, 0.04)")
            fields[name] = read_model(kind, pair.tolist(), name)
    return fields


def released(scene: Any) -> Physics:
    """Return the physics of a scene with the push of a released domino."""
    thickness, tilt = scene.first_thickness, 0.0
    if scene.ground is not None:
        tilt = float(scene.ground.rise_and_tilt([thickness], [thickness] * 2)[1][0])
    physics: Physics = scene.physics
    return physics.replace(push=released_push(scene.height, thickness, physics.gravity, tilt))


def make_document(scene: Any) -> dict[str, Any]:
    """Return the tables of the file that describes a scene; inverse of `SceneTables.fields`."""
    of = "height" if scene.in_heights else None
    tables: dict[str, Any] = {name: getattr(scene, name) for name in TOP + TABLES} | {
        "row": {name: getattr(scene, name) for name in ROW},
        "spacing": _range_document(scene.spacing, of),
        "physics": plain(scene.physics) | {"floor_friction": scene.floor_friction},
        "thickness": None if scene.stock else _range_document(scene.thickness, of),
        "growth": scene.growth and dict(zip(("min", "max"), scene.growth, strict=True)),
    }
    names = (name for name, kind in OBJECTIVES.items() if kind.table is type(scene.settings))
    tables |= dict.fromkeys(names, scene.settings)
    return dict(_drop_none(plain(tables)))


def _range_document(bounds: Bounds, of: str | None) -> dict[str, Any]:
    """Return the document of a `RangeTable`."""
    low, high = bounds
    return ({"fixed": low} if low == high else {"min": low, "max": high}) | {"of": of}


def _drop_none(value: Any) -> Any:
    """Return a value without entries that are None, and with lists for tuples."""
    if isinstance(value, dict):
        return {key: _drop_none(entry) for key, entry in value.items() if entry is not None}
    return [_drop_none(entry) for entry in value] if isinstance(value, tuple | list) else value


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
