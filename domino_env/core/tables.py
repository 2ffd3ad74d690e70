"""Tables as CSV for other programs, as Markdown for pages, as text for a terminal."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from domino_env.core.files import one_line, write_text

_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")  # how what a spreadsheet runs begins
_MARKED = re.compile(r"(<!-- (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
WIDEST = 60  # characters of a cell on a terminal


def csv_table(names: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Write a table as CSV.

    Parameters
    ----------
    names
        Of the columns.
    rows
        Cells in that order. Numbers are written by their shortest digits that are exact, None as
        an empty cell; text that a spreadsheet would take for a formula gets a ``'`` in front.

    Returns
    -------
    str
        Lines that end in a line feed.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in (names, *rows):
        writer.writerow([_harmless(cell) if isinstance(cell, str) else cell for cell in row])
    return text.getvalue()


def write_csv(path: Path, names: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a table to a file, whole or not at all; see `csv_table`."""
    write_text(path, csv_table(names, rows))


def markdown_table(names: Sequence[str], rows: Iterable[Iterable[object]]) -> list[str]:
    """Write a table as lines of Markdown; cells are Markdown too, but for ``|`` and line feeds."""
    lines = [_marked(names), "|" + " --- |" * len(names)]
    return lines + [_marked(row) for row in rows]


def text_table(
    names: Sequence[str], rows: Iterable[Sequence[str]], right: Collection[str] = ()
) -> list[str]:
    """Write a table as lines for a terminal, each column as wide as its widest cell.

    Parameters
    ----------
    names
        Of the columns.
    rows
        Cells in that order; those of more than 60 characters are cut, and what moves a cursor is
        shown, not sent.
    right
        Names of the columns that end at the same place, as numbers do.
    """
    table = [[one_line(cell, WIDEST) for cell in row] for row in (names, *rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    lines = []
    for row in table:
        cells = (
            cell.rjust(width) if name in right else cell.ljust(width)
            for name, cell, width in zip(names, row, widths, strict=True)
        )
        lines.append("  ".join(cells).rstrip())
    return lines


def fill(page: str, tables: dict[str, list[str]]) -> str:
    """Write tables into a page, each between its mark and the next ``<!-- end -->``.

    Raises
    ------
    ValueError
        For a table that the page has no mark for.
    """
    marks = {found[2] for found in _MARKED.finditer(page)}
    if missing := set(tables) - marks:
        raise ValueError(f"the page has no mark <!-- {min(missing)} --> with an <!-- end -->")

    def written(found: re.Match[str]) -> str:
        lines = tables.get(found[2])
        return found[0] if lines is None else f"{found[1]}\n" + "\n".join(lines) + f"\n\n{found[3]}"

    return _MARKED.sub(written, page)


def _harmless(text: str) -> str:
    if not text.startswith(_FORMULA):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text  # a negative number, formatted by hand


def _marked(cells: Iterable[object]) -> str:
    told = (str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells)
    return f"| {' | '.join(told)} |"
