"""Tables of a scene's file: keys, units, ranges and the relations of the keys of one table.

A scene made in Python is checked by the same tables, and editors check files by the schema that
`domino_env.scenes.io.schema` makes of them.
"""

from __future__ import annotations

import json
import math
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import msgspec
from msgspec import Meta

from domino_env.core.models import LARGEST, Part, Size, Table
from domino_env.physics.ground import Ground
from domino_env.physics.physics import Physics
from domino_env.physics.standard import DENSITY, HEIGHT, WIDTH
from domino_env.scenes.objectives import OBJECTIVES
from domino_env.scenes.objectives.base import Limits
from domino_env.scenes.rules import MOST_DOMINOES, Stock

Bounds = tuple[float, float]
Values = tuple[float, ...]

MOST_PAIRS = 100_000  # of listed gaps and thicknesses: each is tried for the best uniform row
ALIKE = 1e-8  # [m] values closer than this are the same

# begins with a letter or a digit of any language; what paths and shells give a meaning is left out
NAME = r'^[^\x00-/:-@\[-`{-~\s][^\x00-\x1f\x7f/\\<>:"|?*`$]*$(?!\n)'
LINE = r"^[^\x00-\x1f\x7f]*[^\x00-\x20\x7f][^\x00-\x1f\x7f]*$(?!\n)"

if TYPE_CHECKING:
    Objective = str
else:
    Objective = Literal[tuple(OBJECTIVES)]


class RowTable(Table):
    """What stands."""

    count: Annotated[int, Meta(ge=2, le=MOST_DOMINOES, description="number of dominoes")]
    height: Annotated[
        Size, Meta(description="of every domino, of the first where they grow [m]")
    ] = HEIGHT
    width: Annotated[Size, Meta(description="size across the fall; it changes no time [m]")] = WIDTH
    density: Annotated[Size, Meta(description="of every domino [kg/m³]")] = DENSITY
    first_thickness: Annotated[
        Size | None,
        Meta(description="of domino 0, which is the scene's [m]; needed where thickness is free"),
    ] = None
    length: Annotated[
        Size | None, Meta(description="first pivot to last, met exactly [m]; free without it")
    ] = None


class RangeTable(Table):
    """What may be chosen: one value, any from min to max, those in steps, or those of a list."""

    fixed: Annotated[Size | None, Meta(description="the only value [m]")] = None
    min: Annotated[Size | None, Meta(description="the least [m]")] = None
    max: Annotated[Size | None, Meta(description="the largest [m]")] = None
    step: Annotated[
        Annotated[float, Meta(ge=ALIKE, le=LARGEST)] | None,
        Meta(description="from min to max only in steps of this [m]"),
    ] = None
    values: Annotated[
        Annotated[list[Size], Meta(min_length=1)] | None,
        Meta(description="the only values allowed [m]"),
    ] = None
    of: Annotated[
        Literal["height"] | None,
        Meta(
            description="all of it counts in heights: of the domino, and for a gap of the shorter "
            "of the two dominoes at it; leave it out for metres"
        ),
    ] = None

    SCHEMA: ClassVar = {
        "oneOf": [{"required": ["fixed"]}, {"required": ["values"]}, {"required": ["min", "max"]}]
    }

    def __post_init__(self) -> None:
        ways = ("fixed", "values", "min", "max", "step")
        given = [key for key in ways if getattr(self, key) is not None]
        for one in ("fixed", "values"):
            if one in given and len(given) > 1:
                others = " or ".join(key for key in given if key != one)
                raise ValueError(f"{one} stands beside {others}: give one or the other")
        if self.values is not None:
            for a, b in pairwise(sorted(self.values)):
                if b - a < ALIKE:
                    raise ValueError(f"values holds {a} and {b}: they are the same")
        if self.fixed is not None or self.values is not None:
            return
        for key in ("min", "max"):
            if key not in given:
                raise ValueError(f"{key} is missing: give min and max, or fixed [m]")
        assert self.min is not None
        assert self.max is not None
        if self.min > self.max:
            raise ValueError(f"min = {self.min} m is more than max = {self.max} m")
        if self.step is not None and (self.max - self.min) / self.step >= MOST_PAIRS:
            raise ValueError(f"step = {self.step} m: too fine to count; leave it out for any value")

    @classmethod
    def of_bounds(cls, bounds: Bounds, values: Values | None, **more: Any) -> dict[str, Any]:
        """Return the table, as in a document, whose `allowed` are these bounds and values."""
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
        """The least and the largest value, and all between them where not any is allowed."""
        if self.fixed is not None:
            return (self.fixed, self.fixed), None
        if self.values is not None:
            values = tuple(sorted(self.values))
        else:
            assert self.min is not None
            assert self.max is not None
            if self.step is None:
                return (self.min, self.max), None
            values = steps(self.min, self.max, self.step)
        return (values[0], values[-1]), values if len(values) > 1 else None


class SpacingTable(RangeTable):
    """The free gaps."""

    largest_change: Annotated[
        Part | None, Meta(description="from one gap to the next, at most [m]")
    ] = None


class ThicknessTable(RangeTable):
    """The thickness of all dominoes but the first."""


class GrowthTable(Table, kw_only=True):
    """The height of a domino over that of the one before."""

    min: Annotated[float, Meta(ge=1, le=LARGEST, description="at least")] = 1.0
    max: Annotated[float, Meta(ge=1, le=LARGEST, description="at most")]

    def __post_init__(self) -> None:
        if self.min > self.max:
            raise ValueError(f"min = {self.min} is more than max = {self.max}")


class PhysicsTable(Physics, frozen=True):  # type: ignore[misc]
    """What makes the row fall."""

    floor_friction: Annotated[
        Part | None,
        Meta(
            description="coefficient of the floor on which the row stands free, to be scored so; "
            "without it every domino is held to the floor"
        ),
    ] = None


class PlacementTable(Table):
    """Placement noise of the environments."""

    deviation: Annotated[Part, Meta(description="standard deviation of each gap's error [m]")]


class SceneTables(Table, kw_only=True):
    """A design problem: what stands, what may be chosen, what counts."""

    name: Annotated[
        Annotated[str, Meta(pattern=NAME, max_length=100)] | None,
        Meta(
            description="of the scene and of its runs' folder: begins with a letter or a digit, "
            'none of / \\ < > : " | ? * ` $; without it, that of the file',
        ),
    ] = None  # fmt: skip
    title: Annotated[
        Annotated[str, Meta(pattern=LINE, max_length=300)] | None,
        Meta(description="what it is about, in a line"),
    ] = None
    objective: Annotated[Objective, Meta(description="what counts")] = "mean_speed"
    row: RowTable
    spacing: SpacingTable
    thickness: ThicknessTable | None = None
    stock: Annotated[Stock | None, Meta(description="instead of thickness")] = None
    growth: GrowthTable | None = None
    ground: Ground | None = None
    physics: PhysicsTable
    limits: Limits | None = None
    placement: PlacementTable | None = None

    SCHEMA: ClassVar = {"oneOf": [{"required": ["thickness"]}, {"required": ["stock"]}]}

    @property
    def in_heights(self) -> bool:
        """Whether gaps and thicknesses count in heights."""
        return self.spacing.of is not None

    def settings(self, objective: str) -> Any:
        """Give what the table of an objective says; None where it is not there."""
        return getattr(self, objective, None) if OBJECTIVES[objective].table else None

    def first_thickness(self) -> float:
        """Of domino 0 [m]: as thick as all the others, where it is not given."""
        if self.row.first_thickness is not None:
            return self.row.first_thickness
        assert self.thickness is not None
        (low, _), _ = self.thickness.allowed()
        return low * self.row.height if self.in_heights else low

    def thickness_allowed(self) -> tuple[Bounds, Values | None]:
        """Of dominoes 1 … N-1, as `RangeTable.allowed`."""
        if self.thickness is not None:
            return self.thickness.allowed()
        assert self.stock is not None
        rest = self.stock.without(self.first_thickness()).dominoes
        values = tuple(sorted({float(d) for d in rest}))
        return (values[0], values[-1]), values

    def fields(self) -> dict[str, Any]:
        """Return the fields of the scene that the tables describe."""
        spacing, spacing_values = self.spacing.allowed()
        thickness, thickness_values = self.thickness_allowed()
        row, physics = self.row, self.physics
        return msgspec.structs.asdict(row) | {
            "name": self.name,
            "title": self.title or self.name,
            "objective": self.objective,
            "physics": Physics(physics.friction, physics.gravity, physics.push),
            "first_thickness": self.first_thickness(),
            "spacing": spacing,
            "thickness": thickness,
            "spacing_values": spacing_values,
            "thickness_values": thickness_values,
            "largest_change": self.spacing.largest_change,
            "stock": self.stock,
            "growth": (self.growth.min, self.growth.max) if self.growth else None,
            "in_heights": self.in_heights,
            "limits": self.limits,
            "settings": self.settings(self.objective),
            "floor_friction": physics.floor_friction,
            "placement_deviation": self.placement.deviation if self.placement else 0.0,
            "ground": self.ground,
        }


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
"""All that a scene's file says: `SceneTables`, and the tables of objectives, named as they are."""


def text_of(document: dict[str, Any]) -> str:
    """Write the text of a document: values before tables, and tables of tables in a line."""
    lines = []
    for key, value in sorted(document.items(), key=lambda item: isinstance(item[1], dict)):
        if isinstance(value, dict):
            told = (f"{k} = {_toml(v)}" for k, v in value.items() if v is not None)
            lines += ["", f"[{key}]", *told]
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
