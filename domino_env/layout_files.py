"""Layouts as files: CSV as spreadsheets write it, and JSON."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np

from domino_env.files import write_text
from domino_env.layout import DENSITY, HEIGHT, WIDTH, Layout

LARGEST_FILE = 256 * 1024 * 1024  # [bytes]; a million dominoes take about 80 MB
_COLUMNS = ("spacing", "thickness", "height", "density")
_FACTOR = {"spacing": 1.0, "thickness": 1.0, "height": 1.0, "density": 1.0}
for _name in ("spacing", "thickness", "height"):
    _FACTOR[f"{_name}_mm"] = 1e-3
    _FACTOR[f"{_name}_m"] = 1.0


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
        "unit": "SI: m, kg/m3",
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
    spacing may be empty or missing.  Comma, semicolon or tab between the cells, decimal commas
    where the cells are not divided by commas.  Other columns are left alone.
    Raises ValueError with file, line and column.
    """
    text = _text(path)
    lines = [line for line in text.splitlines()]
    if not lines:
        raise ValueError(f"{path}: the file is empty; the first line names the columns")
    divider = max(";\t,", key=lambda c: (lines[0].count(c), ";\t,".index(c) == 0))
    table = list(csv.reader(lines, delimiter=divider))
    names = [cell.strip().lower().replace(" ", "_") for cell in table[0]]
    names = [n.replace("(mm)", "mm").replace("[mm]", "mm").replace("(m)", "m") for n in names]
    places: dict[str, tuple[int, float]] = {}
    for place, name in enumerate(names):
        if name in _FACTOR:
            kind = name.removesuffix("_mm").removesuffix("_m")
            if kind in places:
                raise ValueError(f"{path}, line 1: two columns give the {kind}; keep one")
            places[kind] = (place, _FACTOR[name])
    for kind in ("spacing", "thickness"):
        if kind not in places:
            raise ValueError(
                f"{path}, line 1: no column for the {kind}; name one '{kind}' (metres) or "
                f"'{kind}_mm' (found: {', '.join(n for n in names if n) or 'nothing'})"
            )
    columns: dict[str, list[float]] = {kind: [] for kind in places}
    rows = [(i + 1, row) for i, row in enumerate(table) if i > 0 and any(c.strip() for c in row)]
    if not rows:
        raise ValueError(f"{path}: no dominoes below the line of names")
    for order, (line, row) in enumerate(rows):
        for kind, (place, factor) in places.items():
            cell = row[place].strip() if place < len(row) else ""
            if not cell and kind == "spacing" and order == len(rows) - 1:
                continue
            where = f"{path}, line {line}, column '{names[place]}'"
            if not cell:
                raise ValueError(f"{where}: empty; every domino needs a {kind}")
            columns[kind].append(_number(cell, divider, where) * factor)
    count = len(rows)
    spacing = np.array(columns["spacing"][: count - 1])
    try:
        return Layout(
            spacing,
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
    given = {key: document[key] for key in (*_COLUMNS, "width") if key in document}
    try:
        return Layout(**given)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path}: {error}") from None


def _text(path: Path) -> str:
    """The file as text: UTF-8 with or without a mark, UTF-16 with one, else Latin-1."""
    size = path.stat().st_size
    if size > LARGEST_FILE:
        raise ValueError(f"{path}: {size / 1e6:.0f} MB; a layout file has at most 268 MB")
    data = path.read_bytes()
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return data.decode("utf-16")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _number(cell: str, divider: str, where: str) -> float:
    text = cell.replace(",", ".") if divider != "," else cell
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{where}: '{cell}' is not a number") from None
