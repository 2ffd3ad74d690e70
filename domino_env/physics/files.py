"""Files of layouts: CSV as spreadsheets write it, and JSON.

Files hold the arguments of a `Layout`, which checks whether the dominoes can stand.
"""

from __future__ import annotations

import csv
import json
import math
import re
from array import array
from collections.abc import Iterator
from itertools import repeat
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import UNSET, UnsetType

from domino_env.core import tables
from domino_env.core.files import one_line, read_json, read_text, write_text
from domino_env.core.models import LARGEST, SMALLEST, Number, Size, Table, about, read_model
from domino_env.core.progress import notice
from domino_env.physics.standard import DENSITY, HEIGHT

UNIT: Literal["SI: m, kg/m3"] = "SI: m, kg/m3"
# cells are divided by these, not multiplied by 0.001: 18 mm is then exactly the number 0.018
_PER_UNIT = {
    **dict.fromkeys(("density", "density_kg/m3", "density_kg/m³", "tilt", "tilt_rad"), 1.0),
    **dict.fromkeys(("tilt_deg", "tilt_°"), 180.0 / math.pi),
} | {
    f"{name}{unit}": per_unit
    for name in ("spacing", "thickness", "height", "width", "rise")
    for unit, per_unit in (("", 1.0), ("_m", 1.0), ("_mm", 1000.0))
}
_SIGNED_COLUMNS = ("rise", "tilt")  # may be 0 or negative
_PAIR_COLUMNS = ("spacing", "rise")  # without a value for the last domino


Sizes = Size | list[Size]
Numbers = Number | list[Number]


class LayoutTable(Table):
    """Layout in a JSON file, in SI units; a single number holds for all dominoes."""

    spacing: Annotated[list[Size], about("free gaps, one fewer than dominoes [m]")]
    thickness: Annotated[Sizes, about("along the chain [m]")]
    height: Annotated[Sizes, about("[m]")] = HEIGHT
    width: Annotated[Size | UnsetType, about("across the chain [m]")] = UNSET
    density: Annotated[Sizes, about("[kg/m³]")] = DENSITY
    rise: Annotated[Numbers, about("height of the next pivot above this one [m]")] = 0.0
    tilt: Annotated[Numbers, about("slope of the ground under it, positive downhill [rad]")] = 0.0
    unit: Annotated[Literal["SI: m, kg/m3"], about("the only accepted value")] = UNIT

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of the `Layout`."""
        values = {name: getattr(self, name) for name in LayoutTable.__struct_fields__}
        return {k: v for k, v in values.items() if k != "unit" and v is not UNSET}


def write_csv(path: Path, parts: dict[str, Any]) -> None:
    """Write one line per domino in SI units; numbers read back bitwise equal.

    Parameters
    ----------
    path
        The file, which is replaced atomically.
    parts
        Arrays of a layout by name, and its width.
    """
    count = len(parts["thickness"])
    # None: the empty cell of the last domino in columns of pairs
    columns = [
        [*part.tolist(), None] if isinstance(part, np.ndarray) else repeat(part)
        for part in parts.values()
    ]
    tables.write_csv(path, ("number", *parts), zip(range(count), *columns, strict=False))


def write_json(path: Path, parts: dict[str, Any]) -> None:
    """Write every array in full in SI units; `parts` as for `write_csv`."""
    document = {name: np.asarray(part).tolist() for name, part in parts.items()}
    write_text(path, json.dumps({"unit": UNIT} | document, indent=1) + "\n")


def read_arguments(path: Path) -> dict[str, Any]:
    """Read the arguments of a `Layout` from a .csv or .json file.

    A table has one line per domino under a line of names:

    - spacing (or spacing_mm): the free gap in front of the domino; empty or 0 for the last one.
    - thickness (or thickness_mm).
    - height (height_mm) and density, if they differ from the standard domino's.
    - width (width_mm), the same in every line.
    - rise (rise_mm), the height of the next pivot above this one, and tilt (tilt_deg), the slope
      under the domino, positive downhill, if the ground is not flat. The last rise is not used.

    Cells are separated by commas, semicolons or tabs. Decimal commas are read where cells are not
    separated by commas. Other columns are not read; a notice names them. A JSON file holds a
    `LayoutTable`.

    Returns
    -------
    dict
        Values by name of the argument, in SI units.

    Raises
    ------
    ValueError
        For a missing file, a folder without a layout.csv, another suffix, and errors in the file
        (with line and column, or key).
    """
    if path.is_dir():
        path = path / "layout.csv"
        if not path.is_file():
            raise ValueError("it is a folder without a layout.csv: name a run folder or a file")
    suffix = path.suffix.lower()
    if not path.exists():
        raise ValueError("there is no such file: name a .csv or .json file of a layout")
    if suffix == ".csv":
        return _parse_table(path, read_text(path))
    if suffix == ".json":
        return read_model(LayoutTable, read_json(path)).arguments()
    raise ValueError("it is not a layout: name a .csv or .json file")


def _parse_table(path: Path, text: str) -> dict[str, Any]:
    """Return the arguments of a `Layout` from the text of a table."""
    separator, lines = _split_table(path, text)
    head, first = next(lines, (0, []))
    if not first:
        raise ValueError("the file is empty: give a line of names, such as spacing_mm,thickness_mm")
    names = [_column_name(cell) for cell in first]
    kinds = {known.partition("_")[0] for known in _PER_UNIT}
    for cell, name in zip(first, names, strict=True):
        if name not in _PER_UNIT and name.partition("_")[0] in kinds:
            raise ValueError(
                f"{path}, line {head}: column '{one_line(cell, 40)}' has a unit that is not read: "
                "convert it to metres, millimetres (_mm), kg/m3 or radians, or rename the column"
            )
    ignored = [name for name in names if name and name != "number" and name not in _PER_UNIT]
    if ignored:
        notice(f"{path}: columns that are not read: {one_line(', '.join(ignored))}")
    places: dict[str, int] = {}  # index of the column of each kind of value
    for place, name in enumerate(names):
        kind = name.partition("_")[0]
        if name in _PER_UNIT and places.setdefault(kind, place) != place:
            raise ValueError(f"{path}, line {head}: two columns give the {kind}; keep one")
    for kind in ("spacing", "thickness"):
        if kind not in places:
            given = ", ".join(one_line(n, 40) for n in names[:20] if n)
            raise ValueError(
                f"{path}, line {head}: no column for the {kind}; name one '{kind}' (metres) or "
                f"'{kind}_mm' (found: {given or 'nothing'})"
            )
    dominoes = list(lines)
    if not dominoes:
        raise ValueError("no dominoes below the line of names: give one line per domino")
    columns = {kind: array("d") for kind in places}

    def cell_error(line: int, kind: str, reason: object) -> ValueError:
        column = one_line(names[places[kind]])
        return ValueError(f"{path}, line {line}, column '{column}': {reason}")

    for line, cells in dominoes:
        if any(cell.strip() for cell in cells[len(names) :]):  # 18,5 is read as two cells
            raise ValueError(
                f"{path}, line {line}: more cells than the {len(names)} names: where commas "
                "separate cells, write 18.5 with a point, or separate them by semicolons"
            )
        cells += [""] * (len(names) - len(cells))
        for kind, place in places.items():
            cell = cells[place].strip()
            is_gap, is_last = cell.strip(" \t0.,") != "", line == dominoes[-1][0]
            if kind == "spacing" and is_gap == is_last:
                missing = "empty or 0: give the free gap in front of every domino but the last"
                excess = "leave it empty, as the last domino has no gap in front, or add dominoes"
                raise cell_error(line, kind, excess if is_last else missing)
            if kind in _PAIR_COLUMNS and is_last:
                continue
            try:
                columns[kind].append(_number(kind, cell, _PER_UNIT[names[place]], separator))
            except ValueError as error:
                raise cell_error(line, kind, error) from None
    values: dict[str, Any] = {kind: np.array(column) for kind, column in columns.items()}
    if "width" in values:
        low, high = values["width"].min(), values["width"].max()
        if low < high:
            reason = f"dominoes of {low:g} and {high:g} m: give one width for all"
            raise cell_error(head, "width", reason)
        values["width"] = float(low)
    return values


def _number(kind: str, cell: str, per_unit: float, separator: str) -> float:
    """Return a cell in SI units; raise a ValueError without file and line for other text."""
    if not cell:
        raise ValueError(f"empty; every domino needs a {kind}")
    quoted = one_line(cell, 60)
    try:
        text = cell if separator == "," else cell.replace(",", ".")
        value = float(text.replace("_", " ")) / per_unit  # float() would read 1_4 as 14
    except ValueError:
        hint = ""
        if re.fullmatch(r"[0-9]+,[0-9]+", cell):
            hint = f": where commas separate cells, write {cell.replace(',', '.')}"
        raise ValueError(f"'{quoted}' is not a number{hint}") from None
    if kind in _SIGNED_COLUMNS:
        if not abs(value) <= LARGEST:
            raise ValueError(f"{quoted}: give a finite number")
    elif not SMALLEST <= value <= LARGEST:
        raise ValueError(
            f"{quoted}: give a number more than 0, {SMALLEST:g} to {LARGEST:g} in SI units"
        )
    return value


def _split_table(path: Path, text: str) -> tuple[str, Iterator[tuple[int, list[str]]]]:
    """Return the separator of cells, and every line that is not blank with its number."""
    lines = text.splitlines(keepends=True)
    # the separator that gives most names; in a tie the first, as a name may contain a comma
    separator = max(";\t,", key=lambda sign: len(next(_cells(path, lines, sign), (0, []))[1]))
    return separator, _cells(path, lines, separator)


def _cells(path: Path, lines: list[str], separator: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the cells of every line that is not blank."""
    reader = csv.reader(lines, delimiter=separator)
    try:
        for cells in reader:
            if any(cell.strip() for cell in cells):
                yield reader.line_num, cells
    except csv.Error as error:
        raise ValueError(f"{path}, line {reader.line_num}: not a table: {error}") from None


def _column_name(cell: str) -> str:
    """Return the normalised name of a column: spacing_mm for `Spacing (mm)` and `spacing [mm]`."""
    return "_".join(re.sub(r"[\s_()\[\]]+", " ", cell.lower()).split())
