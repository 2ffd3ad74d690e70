"""Layouts as files: CSV as spreadsheets write it, and JSON.

Files hold the arguments of a `Layout`; whether it can stand, `Layout` says.
"""

from __future__ import annotations

import csv
import io
import json
import math
import re
from array import array
from collections.abc import Iterator
from itertools import repeat
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from msgspec import UNSET, Meta, UnsetType

from domino_env.core import tables
from domino_env.core.files import detect_encoding, naming, one_line, read_bytes, write_text
from domino_env.core.files import read_json as read_document
from domino_env.core.models import LARGEST, SMALLEST, Number, Size, Table, model_of
from domino_env.physics.standard import DENSITY, HEIGHT

MOST_DOMINOES = 1_000_000  # in a file: read in some seconds, within 1 GB of memory
UNIT: Literal["SI: m, kg/m3"] = "SI: m, kg/m3"
_POSITIVE = f"more than 0 and finite, {SMALLEST:g} to {LARGEST:g} in SI units"
# divided by, not multiplied with 0.001: 18 mm then reads as the very number 0.018
_PER_UNIT = {"density": 1.0, "tilt": 1.0, "tilt_rad": 1.0, "tilt_deg": 180.0 / math.pi}
_GROUND = ("rise", "tilt")
_OF_PAIRS = {"spacing": "the free gap in front", "rise": "the rise in front"}
for _name in ("spacing", "thickness", "height", "width", "rise"):
    _PER_UNIT[_name] = 1.0
    _PER_UNIT[f"{_name}_mm"] = 1000.0
    _PER_UNIT[f"{_name}_m"] = 1.0


class LayoutTable(Table):
    """A layout as JSON, SI units; one number serves all dominoes."""

    spacing: Annotated[list[Size], Meta(description="free gaps, one fewer than dominoes [m]")]
    thickness: Annotated[Size | list[Size], Meta(description="along the row [m]")]
    height: Annotated[Size | list[Size], Meta(description="[m]")] = HEIGHT
    width: Annotated[Size | UnsetType, Meta(description="across the row [m]")] = UNSET
    density: Annotated[Size | list[Size], Meta(description="[kg/m³]")] = DENSITY
    rise: Annotated[
        Number | list[Number], Meta(description="how much higher the next pivot lies [m]")
    ] = 0.0  # fmt: skip
    tilt: Annotated[
        Number | list[Number], Meta(description="slope under a domino, positive downhill [rad]")
    ] = 0.0  # fmt: skip
    unit: Annotated[
        Literal["SI: m, kg/m3"], Meta(description="the only one that is read")
    ] = UNIT  # fmt: skip

    def arguments(self) -> dict[str, Any]:
        """Return the arguments of the `Layout`.

        Raises
        ------
        ValueError
            It has more than `MOST_DOMINOES`.
        """
        _require_few(len(self.spacing) + 1)
        values = {name: getattr(self, name) for name in LayoutTable.__struct_fields__}
        return {k: v for k, v in values.items() if k != "unit" and v is not UNSET}


def write_csv(path: Path, parts: dict[str, Any]) -> None:
    """Write one row a domino, SI units, shortest digits that read back to the same bits.

    parts: arrays of a layout by name, and its width.
    """
    count = len(parts["thickness"])
    columns = [
        [*part.tolist(), None] if isinstance(part, np.ndarray) else repeat(part)
        for part in parts.values()
    ]
    tables.write_csv(path, ("number", *parts), zip(range(count), *columns, strict=False))


def write_json(path: Path, parts: dict[str, Any]) -> None:
    """Write every array in full, SI units; parts: as of `write_csv`."""
    document = {name: np.asarray(part).tolist() for name, part in parts.items()}
    write_text(path, json.dumps({"unit": UNIT} | document, indent=1) + "\n")


def read_csv(path: Path) -> dict[str, Any]:
    """Read a row measured by hand or written by `write_csv`.

    One line a domino under a line of names:

    - spacing (or spacing_mm): the free gap in front of it. The last one leads nowhere: it may be
      empty or missing, and is not used.
    - thickness (or thickness_mm).
    - height (height_mm) and density, if they differ from the standard domino's.
    - width (width_mm), the same in every line.
    - rise (rise_mm), how much higher the next pivot lies, and tilt (tilt_deg), the slope under it,
      positive downhill, where the ground is not flat. The last rise is not used.

    Comma, semicolon or tab between the cells, decimal commas where the cells are not divided by
    commas. Other columns are left alone.

    Raises
    ------
    ValueError
        With file, line and column, and for more than `MOST_DOMINOES`.
    """
    with naming(path):
        return _arguments_of_table(path, read_bytes(path))


def read_json(path: Path) -> dict[str, Any]:
    """Read what `write_json` wrote; height, width and density may be missing.

    Raises
    ------
    ValueError
        With file and key, and for more than `MOST_DOMINOES`.
    """
    with naming(path):
        return model_of(LayoutTable, read_document(path)).arguments()


def _arguments_of_table(path: Path, data: bytes) -> dict[str, Any]:
    divider, rows = _table(path, data)
    head, first = next(rows, (0, []))
    if not first:
        raise ValueError("the file is empty; the first line names the columns")
    names = [_column_name(cell) for cell in first]
    places: dict[str, tuple[int, float]] = {}
    for place, name in enumerate(names):
        if name in _PER_UNIT:
            kind = re.sub("_(mm|m|deg|rad)$", "", name)
            if kind in places:
                raise ValueError(f"{path}, line {head}: two columns give the {kind}; keep one")
            places[kind] = (place, _PER_UNIT[name])
    for kind in ("spacing", "thickness"):
        if kind not in places:
            found = ", ".join(one_line(n, 40) for n in names[:20] if n)
            raise ValueError(
                f"{path}, line {head}: no column for the {kind}; name one '{kind}' (metres) or "
                f"'{kind}_mm' (found: {found or 'nothing'})"
            )
    columns = {kind: array("d") for kind in places}

    def keep(kind: str, line: int, row: list[str]) -> None:
        place, per_unit = places[kind]
        cell = row[place].strip() if place < len(row) else ""
        if cell:
            try:
                value = float(cell.replace(",", ".") if divider != "," else cell) / per_unit
            except ValueError:
                value, wrong = 0.0, f"'{one_line(cell, 60)}' is not a number"
                if re.fullmatch(r"[0-9]+,[0-9]+", cell):
                    wrong += f": where commas divide the cells, write {cell.replace(',', '.')}"
            else:
                wrong = f"{one_line(cell, 60)} must be {_POSITIVE}"
                if kind in _GROUND:
                    wrong = f"{one_line(cell, 60)} must be finite"
            if SMALLEST <= value <= LARGEST or (kind in _GROUND and abs(value) <= LARGEST):
                columns[kind].append(value)
                return
        elif kind in _OF_PAIRS:
            wrong = f"empty; give {_OF_PAIRS[kind]} of every domino but the last"
        else:
            wrong = f"empty; every domino needs a {kind}"
        raise ValueError(f"{path}, line {line}, column '{one_line(names[place], 60)}': {wrong}")

    others = [kind for kind in places if kind not in _OF_PAIRS]
    pairs = [kind for kind in places if kind in _OF_PAIRS]
    before: tuple[int, list[str]] | None = None
    for line, row in rows:
        if any(cell.strip() for cell in row[len(names) :]):  # 18,5 in two cells, say
            raise ValueError(
                f"{path}, line {line}: more cells than the {len(names)} names: where commas divide "
                "the cells, write 18.5 with a point, or divide them by semicolons"
            )
        # only now is it known that the one before is not the last, whose gap leads nowhere
        if before is not None:
            for kind in pairs:
                keep(kind, *before)
        before = line, row
        for kind in others:
            keep(kind, line, row)
    if before is None:
        raise ValueError("no dominoes below the line of names")
    _require_few(len(columns["thickness"]))
    values: dict[str, Any] = {
        kind: np.frombuffer(column) if column else [] for kind, column in columns.items()
    }
    if "width" in values:
        widths = values.pop("width")
        if widths.min() < widths.max():
            raise ValueError(
                f"{path}, column '{one_line(names[places['width'][0]], 60)}': dominoes of "
                f"{widths.min():g} and {widths.max():g} m; a row has one width"
            )
        values["width"] = float(widths[0])
    return values


def _table(path: Path, data: bytes) -> tuple[str, Iterator[tuple[int, list[str]]]]:
    """The sign between the cells, and every line that is not blank with its number."""
    encoding = detect_encoding(data)
    first = next((line for line in _text(data, encoding) if line.strip()), "").lstrip()
    # some spreadsheets say on a line of its own what stands between the cells
    told = first[4:5] if re.match(r"sep=[;,\t]\s*$", first, re.IGNORECASE) else ""
    # otherwise what finds most names; of equals the first, as a comma may be part of a name
    divider = told or max(
        ";\t,", key=lambda sign: len(next(_lines(path, data, encoding, sign), (0, []))[1])
    )
    rows = _lines(path, data, encoding, divider)
    if told:
        next(rows, None)
    return divider, rows


def _text(data: bytes, encoding: str) -> Iterator[str]:
    """The lines of the text with their ends."""
    return io.TextIOWrapper(io.BytesIO(data), encoding, newline="")


def _require_few(count: int) -> None:
    if count > MOST_DOMINOES:
        raise ValueError(f"it has {count:,} dominoes, where at most {MOST_DOMINOES:,} are read")


def _lines(path: Path, data: bytes, encoding: str, divider: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(_text(data, encoding), delimiter=divider)
    try:
        for row in reader:
            if any(cell.strip() for cell in row):
                yield reader.line_num, row
    except csv.Error as error:
        raise ValueError(f"{path}, line {reader.line_num}: not a table: {error}") from None


def _column_name(cell: str) -> str:
    """`Spacing (mm)`, `spacing [mm]` and `spacing_mm` are one name."""
    words = re.sub(r"[\s_()\[\]]+", " ", cell.lower()).split()
    return "_".join(words)
