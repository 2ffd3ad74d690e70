"""Layouts as files: CSV as spreadsheets write it, and JSON."""

from __future__ import annotations

import csv
import difflib
import io
import json
import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from domino_env.files import write_text
from domino_env.layout import DENSITY, HEIGHT, WIDTH, Layout

LARGEST_FILE = 256 * 1024 * 1024  # [bytes]; a million dominoes take about 80 MB
UNIT = "SI: m, kg/m3"
_COLUMNS = ("spacing", "thickness", "height", "density")
# divided by, not multiplied with 0.001: 18 mm then reads as the very number 0.018
_PER_UNIT = {"spacing": 1.0, "thickness": 1.0, "height": 1.0, "density": 1.0}
for _name in ("spacing", "thickness", "height"):
    _PER_UNIT[f"{_name}_mm"] = 1000.0
    _PER_UNIT[f"{_name}_m"] = 1.0


def write_csv(layout: Layout, path: Path) -> None:
    """One row a domino, SI units, shortest digits that read back to the same bits."""
    lines = ["number,spacing,thickness,height,density"]
    gaps = [repr(float(s)) for s in layout.spacing] + [""]
    for i in range(layout.count):
        rest = (layout.thickness[i], layout.height[i], layout.density[i])
        lines.append(",".join([str(i), gaps[i], *(repr(float(x)) for x in rest)]))
    write_text(path, "\n".join(lines) + "\n")


def write_json(layout: Layout, path: Path) -> None:
    """Every array in full, SI units."""
    document = {
        "unit": UNIT,
        "spacing": layout.spacing.tolist(),
        "thickness": layout.thickness.tolist(),
        "height": layout.height.tolist(),
        "width": layout.width,
        "density": layout.density.tolist(),
    }
    write_text(path, json.dumps(document, indent=1) + "\n")


def read_csv(path: Path) -> Layout:
    """Read a row measured by hand or written by `write_csv`.

    One line a domino under a line of names: spacing (or spacing_mm) is the free gap in front of it,
    thickness (or thickness_mm), and if they differ height (height_mm) and density.  The last
    spacing leads nowhere: it may be empty or missing, and is not used.  Comma, semicolon or tab
    between the cells, decimal commas where the cells are not divided by commas.  Other columns are
    left alone.
    Raises ValueError with file, line and column.
    """
    divider, table = _table(path)
    head, first = table[0]
    names = [_column_name(cell) for cell in first]
    places: dict[str, tuple[int, float]] = {}
    for place, name in enumerate(names):
        if name in _PER_UNIT:
            kind = name.removesuffix("_mm").removesuffix("_m")
            if kind in places:
                raise ValueError(f"{path}, line {head}: two columns give the {kind}; keep one")
            places[kind] = (place, _PER_UNIT[name])
    for kind in ("spacing", "thickness"):
        if kind not in places:
            raise ValueError(
                f"{path}, line {head}: no column for the {kind}; name one '{kind}' (metres) or "
                f"'{kind}_mm' (found: {', '.join(n for n in names if n) or 'nothing'})"
            )
    columns: dict[str, list[float]] = {kind: [] for kind in places}
    rows = table[1:]
    if not rows:
        raise ValueError(f"{path}: no dominoes below the line of names")
    for order, (line, row) in enumerate(rows):
        for kind, (place, per_unit) in places.items():
            cell = row[place].strip() if place < len(row) else ""
            if kind == "spacing" and order == len(rows) - 1:
                continue
            where = f"{path}, line {line}, column '{names[place]}'"
            if not cell and kind == "spacing":
                raise ValueError(
                    f"{where}: empty; give the free gap in front of every domino but the last"
                )
            if not cell:
                raise ValueError(f"{where}: empty; every domino needs a {kind}")
            value = _number(cell, divider, where) / per_unit
            if not 0.0 < value < math.inf:
                raise ValueError(f"{where}: {cell} must be more than 0 and finite")
            columns[kind].append(value)
    try:
        return Layout(
            np.array(columns["spacing"]),
            np.array(columns["thickness"]),
            np.array(columns["height"]) if "height" in columns else HEIGHT,
            WIDTH,
            np.array(columns["density"]) if "density" in columns else DENSITY,
        )
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def read_json(path: Path) -> Layout:
    """Read what `write_json` wrote.  Raises ValueError naming file and key."""
    try:
        document = json.loads(_text(path))
    except (json.JSONDecodeError, RecursionError) as error:
        raise ValueError(f"{path}: not JSON: {error}") from None
    if not isinstance(document, dict):
        raise ValueError(f"{path}: expected an object with the keys spacing and thickness")
    for key in ("spacing", "thickness"):
        if key not in document:
            raise ValueError(f"{path}: the key '{key}' is missing")
    allowed = (*_COLUMNS, "width", "unit")
    for key in document:
        if key not in allowed:
            near = difflib.get_close_matches(key, allowed, n=1)
            hint = f"did you mean '{near[0]}'? " if near else ""
            raise ValueError(f"{path}: unknown key '{key}': {hint}allowed: {', '.join(allowed)}")
    if document.get("unit", UNIT) != UNIT:
        raise ValueError(f"{path}: unit = {document['unit']!r}: a layout is read in '{UNIT}'")
    try:
        return Layout(**{key: value for key, value in document.items() if key != "unit"})
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path}: {error}") from None


def _text(path: Path) -> str:
    """The file as text: UTF-8 with or without a mark, UTF-16 with one, else Latin-1."""
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise ValueError(f"{path}: {size / 1e6:.0f} MB; a layout file has at most 268 MB")
    data = path.read_bytes()
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        try:
            return data.decode("utf-16")
        except UnicodeDecodeError as error:
            raise ValueError(f"{path}: starts like UTF-16 text but is not: {error}") from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _table(path: Path) -> tuple[str, list[tuple[int, list[str]]]]:
    """The sign between the cells, and every line that is not blank with its number."""
    text = _text(path)
    start = text.lstrip()
    # some spreadsheets say on a line of its own what stands between the cells
    told = start[4:5] if re.match(r"sep=[;,\t]\s", start, re.IGNORECASE) else ""
    # otherwise what finds most names; of equals the first, as a comma may be part of a name
    divider = told or max(";\t,", key=lambda sign: len(next(_lines(path, start, sign), (0, []))[1]))
    table = list(_lines(path, text, divider))[1 if told else 0 :]
    if not table:
        raise ValueError(f"{path}: the file is empty; the first line names the columns")
    return divider, table


def _lines(path: Path, text: str, divider: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=divider)
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


def _number(cell: str, divider: str, where: str) -> float:
    text = cell.replace(",", ".") if divider != "," else cell
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{where}: '{cell}' is not a number") from None
