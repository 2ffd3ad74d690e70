"""A source: what somebody measured of uniform rows, how, how well, and what is not known.

One TOML file each in `sources/`, found by itself.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

from domino_env.core.files import decoded, naming, read_bytes
from domino_env.core.models import Number, Size, Table, model_of
from domino_env.physics.standard import HEIGHT, WIDTH

Line = Annotated[str, Meta(min_length=1)]
Lines = tuple[Line, ...]
Quantity = Literal["frequency", "speed", "time"]
Abscissa = Literal["gap", "pitch"]
Unit = Literal["m", "thickness", "height", "width"]
Measured = Literal["steady", "row"]
UNITS = {"m": "mm", "thickness": "thicknesses", "height": "heights", "width": "widths"}  # shown


class Setting(Table):
    """What the comparison takes the experiment to be.

    Attributes
    ----------
    height, thickness, width
        Of the dominoes [m].
    gravity
        [m/s²]
    measured
        The wave far down the row (`steady`), or from the push to the last hit (`row`).
    count
        Dominoes in the row.
    push
        Angular velocity of the first [rad/s]; plays a part in a whole row only.
    x_is, x_unit
        Whether x of the rows is the free gap or pivot to pivot, and its unit.
    x_uncertainty, x_shift
        One standard uncertainty of x, and what is added to every x [x_unit].
    floor
        The rows on this floor alone; all without.
    """

    thickness: Size
    height: Size = HEIGHT
    width: Size = WIDTH
    gravity: Size = 9.81
    measured: Measured = "steady"
    count: Annotated[int, Meta(ge=3, le=10_000)] = 100
    push: Size = 8.0
    x_is: Abscissa = "gap"
    x_unit: Unit = "m"
    x_uncertainty: Annotated[float, Meta(ge=0.0)] = 0.0
    x_shift: Number = 0.0
    floor: str | None = None

    @property
    def x_length(self) -> float:
        """The unit of x [m]."""
        return 1.0 if self.x_unit == "m" else float(getattr(self, self.x_unit))

    def words(self, x: float) -> str:
        """An x of the rows as it is shown."""
        return f"{1e3 * x if self.x_unit == 'm' else x:.4g} {UNITS[self.x_unit]}"

    def pitch(self, x: float) -> float:
        """Pivot to pivot at an x of the rows [m]."""
        length = (x + self.x_shift) * self.x_length
        return length if self.x_is == "pitch" else length + self.thickness


class Row(Table):
    """One spacing: what was measured at it, with one standard uncertainty."""

    x: Size
    value: Size
    uncertainty: Size
    floor: str | None = None


class Friction(Table):
    """Friction between dominoes, where somebody measured it by itself."""

    value: Annotated[float, Meta(ge=0.0)]
    uncertainty: Size


class Source(Table):
    """What somebody measured.

    Attributes
    ----------
    title, reference
        What it is, and where it is published: page, table or figure.
    read
        What of that was read for this file.
    method, errors
        How it was measured, and where the uncertainties come from.
    unknown
        What nobody told and the comparison has to take.
    quantity, unit
        Of the values, and the unit as it is shown.
    setting, instead
        What the experiment is taken to be, and what differs in other readings that are tried.
    rows
        What was measured.
    friction
        Between dominoes, where it was measured by itself.
    name
        Of the file.
    """

    title: Line
    reference: Line
    read: Line
    method: Line
    errors: Line
    unknown: Lines
    quantity: Quantity
    unit: Line
    setting: Setting
    rows: Annotated[tuple[Row, ...], Meta(min_length=1)]
    instead: tuple[dict[str, Any], ...] = ()
    friction: Friction | None = None
    name: str = ""

    def __post_init__(self) -> None:
        """Every row can stand and be reached, in every reading."""
        if not all(isinstance(one.get("what"), str) for one in self.instead):
            raise ValueError("instead: a reading has no what: say in words what differs")
        for setting in (self.setting, *self.readings.values()):
            rows = self.kept(setting)
            if not rows:
                raise ValueError(f"rows: none stands on the floor '{setting.floor}'")
            for row in rows:
                gap = setting.pitch(row.x) - setting.thickness
                if not 0.0 < gap < setting.height:
                    raise ValueError(
                        f"rows: x = {row.x} is a gap of {gap:.6g} m: must be more than 0 and less "
                        f"than the height, {setting.height} m"
                    )

    @property
    def readings(self) -> dict[str, Setting]:
        """The other readings, by their words (`what`): the setting with what differs in them."""
        own = msgspec.to_builtins(self.setting)
        return {
            str(one.get("what")): model_of(
                Setting, own | {k: v for k, v in one.items() if k != "what"}, "instead"
            )
            for one in self.instead
        }

    def kept(self, setting: Setting) -> tuple[Row, ...]:
        """Return the rows that a setting speaks of."""
        return tuple(r for r in self.rows if setting.floor in (None, r.floor))


def read_source(path: Path) -> Source:
    """Read a source's file.

    Raises
    ------
    ValueError
        With the file, the key, its value and what is allowed.
    OSError
        It cannot be read.
    """
    with naming(path):
        document = tomllib.loads(decoded(read_bytes(path)))
        return model_of(Source, {**document, "name": path.stem})


def source_of_frequencies(
    pitches: Sequence[float],
    frequencies: Sequence[float],
    thickness: float = 0.0075,
    height: float = HEIGHT,
    gravity: float = 9.81,
    uncertainty: float = 0.02,
) -> Source:
    """Make a source of hits per second [1/s] at pitches [m], each with a relative uncertainty.

    Raises
    ------
    ValueError
        For pitches that no row can have, frequencies that are not positive, or no pairs of them.
    """
    if len(pitches) != len(frequencies):
        raise ValueError(f"{len(pitches)} pitches and {len(frequencies)} frequencies: give pairs")
    sizes = {"thickness": thickness, "height": height, "gravity": gravity}
    rows = [
        {"x": float(pitch), "value": float(told), "uncertainty": uncertainty * float(told)}
        for pitch, told in zip(pitches, frequencies, strict=True)
    ]
    words = {
        "title": "rows that were given", "reference": "given", "read": "all of it",
        "method": "as you know", "errors": f"{uncertainty:.3g} of each", "unknown": [],
    }  # fmt: skip
    numbers = {"quantity": "frequency", "unit": "1/s", "setting": {**sizes, "x_is": "pitch"}}
    return model_of(Source, {"name": "rows", **words, **numbers, "rows": rows})


def shipped_sources() -> dict[str, Source]:
    """Read all sources that ship, by name."""
    folder = Path(str(files("domino_env.validation") / "sources"))
    return {path.stem: read_source(path) for path in sorted(folder.glob("*.toml"))}
