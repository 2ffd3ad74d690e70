"""Tables of a scene's file: keys, units, ranges and the relations of the keys of one table.

A scene made in Python is checked by the same tables, and editors check files by the schema that
`domino_env.scenes.shipping` makes of them.
"""

from __future__ import annotations

import json
import math
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import msgspec
from msgspec import Meta

from domino_env.core.files import shown
from domino_env.core.models import LARGEST, Part, Size, Table, about, plain
from domino_env.physics.ground import Ground
from domino_env.physics.physics import Physics, require_physics
from domino_env.physics.standard import DENSITY, HEIGHT, WIDTH
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.objectives.base import Limits
from domino_env.scenes.objectives.robust import LARGEST_DRAWS
from domino_env.scenes.rules import MOST_DOMINOES, Bounds, Stock, Values

MOST_PAIRS = 100_000  # of listed gaps and thicknesses: each is tried for the uniform baseline
ALIKE = 1e-8  # [m] values closer than this are the same
SAME = ("name", "objective", "stock", "ground", "limits")  # in a file as in a scene

# begins with a letter or a digit of any language; without characters special to paths and shells
NAME = r'^[^\x00-/:-@\[-`{-~\s][^\x00-\x1f\x7f/\\<>:"|?*`$]*$(?!\n)'
LINE = r"^[^\x00-\x1f\x7f]*[^\x00-\x20\x7f][^\x00-\x1f\x7f]*$(?!\n)"

if TYPE_CHECKING:
    Objective = str
else:
    Objective = Literal[tuple(OBJECTIVES)]


class ChainTable(Table):
    """The dominoes."""

    count: Annotated[int, Meta(ge=2, le=MOST_DOMINOES, description="number of dominoes")]
    height: Annotated[Size, about("of every domino, or of the first [m]")] = HEIGHT
    width: Annotated[Size, about("size across the fall; it changes no time [m]")] = WIDTH
    density: Annotated[Size, about("of every domino [kg/m³]")] = DENSITY
    first_thickness: Annotated[
        Size | None, about("of domino 0 [m]; needed where thickness is free")
    ] = None
    length: Annotated[Size | None, about("first to last pivot, met exactly [m]")] = None


Step = Annotated[float, Meta(ge=ALIKE, le=LARGEST)]
Listed = Annotated[list[Size], Meta(min_length=1)]


class RangeTable(Table):
    """Allowed values: one, any from min to max, those in steps, or those of a list."""

    fixed: Annotated[Size | None, about("the only value [m]")] = None
    min: Annotated[Size | None, about("the least [m]")] = None
    max: Annotated[Size | None, about("the largest [m]")] = None
    step: Annotated[Step | None, about("from min to max only in steps of this [m]")] = None
    values: Annotated[Listed | None, about("all values allowed [m]")] = None
    of: Annotated[
        Literal["height"] | None,
        about("in heights of the domino, at a gap of the shorter one; else in metres"),
    ] = None

    SCHEMA: ClassVar = {
        "oneOf": [{"required": ["fixed"]}, {"required": ["values"]}, {"required": ["min", "max"]}]
    }

    def __post_init__(self) -> None:
        keys = ("fixed", "values", "min", "max", "step")
        given = [key for key in keys if getattr(self, key) is not None]
        if given not in (["fixed"], ["values"], ["min", "max"], ["min", "max", "step"]):
            raise ValueError(
                f"it has {' and '.join(given) or 'no value'}: give either fixed, or values, or min "
                "and max, and step if only steps are allowed [m]"
            )
        for a, b in pairwise(sorted(self.values or ())):
            if b - a < ALIKE:
                raise ValueError(f"values holds {a} and {b}: they are the same")
        low, high = self.min or 0.0, self.max or 0.0
        if low > high:
            raise ValueError(f"min = {low} m is more than max = {high} m")
        if self.step is not None and (high - low) / self.step >= MOST_PAIRS:
            raise ValueError(f"step = {self.step} m: too fine to count; leave it out for any value")

    @classmethod
    def of_bounds(
        cls, name: str, bounds: Bounds, values: Values | None, **more: Any
    ) -> dict[str, Any]:
        """Return the table, as in a document, whose `allowed` are these bounds and values."""
        if not hasattr(bounds, "__len__") or len(bounds) != 2:
            raise ValueError(f"{name} = {shown(bounds)}: give two bounds, such as (0.002, 0.04)")
        low, high = bounds
        if low == high:
            return {"fixed": low, **more}
        if values is None:
            return {"min": low, "max": high, **more}
        step = round(values[1] - values[0], 12)
        if len(values) > 2 and steps(low, high, step) == tuple(values):
            return {"min": low, "max": high, "step": step, **more}
        return {"values": values, **more}

    def allowed(self) -> tuple[Bounds, Values | None]:
        """Return the least and the largest value, and all values where not every one is allowed."""
        if self.fixed is not None:
            return (self.fixed, self.fixed), None
        low, high = self.min or 0.0, self.max or 0.0
        values = tuple(sorted(self.values or ()))
        if self.step is not None:
            values = steps(low, high, self.step)
        elif not values:
            return (low, high), None
        return (values[0], values[-1]), values if len(values) > 1 else None


class SpacingTable(RangeTable):
    """The free gaps."""

    largest_change: Annotated[Part | None, about("from gap to gap, at most [m]")] = None


class GrowthTable(Table, kw_only=True):
    """The height of a domino over that of the one before."""

    min: Annotated[float, Meta(ge=1, le=LARGEST, description="at least")] = 1.0
    max: Annotated[float, Meta(ge=1, le=LARGEST, description="at most")]

    def __post_init__(self) -> None:
        if self.min > self.max:
            raise ValueError(f"min = {self.min} is more than max = {self.max}")


class PhysicsTable(Physics, frozen=True):  # type: ignore[misc]
    """Friction, gravity, push and floor."""

    floor_friction: Annotated[
        Part | None, about("of the floor of free-standing dominoes; without it pivots are fixed")
    ] = None


class PlacementTable(Table):
    """Placement noise of the environments."""

    deviation: Annotated[Part, about("standard deviation of each gap's error [m]")]
    draws: Annotated[
        Annotated[int, Meta(ge=0, le=LARGEST_DRAWS)],
        about("layouts are scored by the mean over as many draws; 0: without errors"),
    ] = 0


Title = Annotated[str, Meta(pattern=LINE, max_length=300)]


class SceneTables(Table, kw_only=True):
    """A design problem: dominoes, allowed values, objective."""

    name: Annotated[
        Annotated[str, Meta(pattern=NAME, max_length=100)] | None,
        about(
            "of the scene and of its runs' folder: begins with a letter or a digit, "
            'none of / \\ < > : " | ? * ` $; without it, that of the file',
        ),
    ] = None  # fmt: skip
    title: Annotated[Title | None, about("subject of the scene in one line")] = None
    objective: Annotated[Objective, about("rule by which layouts are scored")] = "mean_speed"
    row: ChainTable
    spacing: SpacingTable
    thickness: RangeTable | None = None
    stock: Annotated[Stock | None, about("instead of thickness")] = None
    growth: GrowthTable | None = None
    ground: Ground | None = None
    physics: PhysicsTable
    limits: Limits | None = None
    placement: PlacementTable | None = None

    SCHEMA: ClassVar = {"oneOf": [{"required": ["thickness"]}, {"required": ["stock"]}]}

    @property
    def in_heights(self) -> bool:
        """True where gaps and thicknesses count in heights."""
        return self.spacing.of is not None

    def value_at(self, place: str) -> Any:
        """Return the value of a table or key, as [stock] or row.length; None where it is absent."""
        value: Any = self
        for name in place.strip("[]").split("."):
            value = getattr(value, name, None)
        return value

    def first_thickness(self) -> float:
        """Return the thickness of domino 0 [m]: that of all others, where it is not given."""
        if self.row.first_thickness is not None:
            return self.row.first_thickness
        assert self.thickness is not None
        (low, _), _ = self.thickness.allowed()
        return low * self.row.height if self.in_heights else low

    def thickness_allowed(self) -> tuple[Bounds, Values | None]:
        """Return the thicknesses allowed of dominoes 1 … N-1, as `RangeTable.allowed`."""
        if self.thickness is not None:
            return self.thickness.allowed()
        assert self.stock is not None
        rest = self.stock.without(self.first_thickness()).dominoes
        values = tuple(sorted({float(d) for d in rest}))
        return (values[0], values[-1]), values

    def fields(self) -> dict[str, Any]:
        """Return the fields of the scene that the tables describe; inverse of `document_of`."""
        spacing, spacing_values = self.spacing.allowed()
        thickness, thickness_values = self.thickness_allowed()
        same = {name: getattr(self, name) for name in SAME}
        return msgspec.structs.asdict(self.row) | same | {
            "title": self.title or self.name,
            "physics": Physics(*(getattr(self.physics, n) for n in Physics.__struct_fields__)),
            "floor_friction": self.physics.floor_friction,
            "first_thickness": self.first_thickness(),
            "spacing": spacing, "spacing_values": spacing_values,
            "thickness": thickness, "thickness_values": thickness_values,
            "largest_change": self.spacing.largest_change,
            "growth": (self.growth.min, self.growth.max) if self.growth else None,
            "in_heights": self.in_heights,
            "settings": self.value_at(self.objective),
            "placement_deviation": self.placement.deviation if self.placement else 0.0,
            "placement_draws": self.placement.draws if self.placement else 0,
        }  # fmt: skip


def document_of(scene: Any) -> dict[str, Any]:
    """Return the tables of the file that describes a scene; inverse of `SceneTables.fields`."""
    require_physics(scene.physics)
    of = "height" if scene.in_heights else None
    tables: dict[str, Any] = {
        name: getattr(scene, name) for name in ("name", "title", *SAME[1:])
    } | {
        "row": {name: getattr(scene, name) for name in ChainTable.__struct_fields__},
        "spacing": RangeTable.of_bounds(
            "spacing",
            scene.spacing,
            scene.spacing_values,
            largest_change=scene.largest_change,
            of=of,
        ),
        "physics": plain(scene.physics) | {"floor_friction": scene.floor_friction},
    }
    if scene.stock is None and scene.thickness is not None:
        bounds, values = scene.thickness, scene.thickness_values
        tables["thickness"] = RangeTable.of_bounds("thickness", bounds, values, of=of)
    if scene.growth is not None:
        tables["growth"] = {"min": scene.growth[0], "max": scene.growth[1]}
    if scene.placement_deviation:
        noise = {"deviation": scene.placement_deviation, "draws": scene.placement_draws}
        tables["placement"] = noise
    if scene.settings is not None:
        kinds = (name for name, kind in OBJECTIVES.items() if kind.table is type(scene.settings))
        tables[next(kinds, "settings")] = scene.settings
    return dict(_of_file(plain(tables)))


def _of_file(value: Any) -> Any:
    """Return a value without entries that are None, and with lists for tuples."""
    if isinstance(value, dict):
        return {key: _of_file(one) for key, one in value.items() if one is not None}
    return [_of_file(one) for one in value] if isinstance(value, tuple | list) else value


def steps(low: float, high: float, step: float) -> Values:
    """Return low, low + step, … up to high [m], to the picometre."""
    number = math.floor((high - low) / step + 1e-9) + 1
    return tuple(round(low + k * step, 12) for k in range(number))


if TYPE_CHECKING:
    SceneFile = SceneTables
else:
    SceneFile = msgspec.defstruct(
        "SceneFile",
        [(name, kind.table | None, None) for name, kind in OBJECTIVES.items() if kind.table],
        bases=(SceneTables,),
        namespace={"__doc__": SceneTables.__doc__},
        module=__name__,
        kw_only=True,
    )
"""Tables of a scene's file: `SceneTables`, and the tables of objectives by their names."""


def text_of(document: dict[str, Any]) -> str:
    """Return a document as TOML: values before tables, and inner tables in one line."""
    lines = []
    for key, value in sorted(document.items(), key=lambda item: isinstance(item[1], dict)):
        if isinstance(value, dict):
            entries = (f"{k} = {_toml(v)}" for k, v in value.items() if v is not None)
            lines += ["", f"[{key}]", *entries]
        else:
            lines.append(f"{key} = {_toml(value)}")
    return "\n".join(lines) + "\n"


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{k} = {_toml(v)}' for k, v in value.items())}}}"
    return repr(float(value) if isinstance(value, float) else int(value))
