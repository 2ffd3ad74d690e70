"""Tables as CSV for other programs, as Markdown for pages, as text for a terminal."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

from domino_env.core.files import one_line, write_text

# a table of a page: the comment before it with its name, its text, the comment after it
_PLACE = re.compile(r"(<!-- (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
MAX_CELL_WIDTH = 60  # of a cell on a terminal [characters]


def csv_table(names: Iterable[str], lines: Iterable[Iterable[object]]) -> str:
    """Return a table as CSV.

    Parameters
    ----------
    names
        Names of the columns.
    lines
        Cells in that order. Numbers have the fewest digits that identify them, None is an empty
        cell.

    Returns
    -------
    str
        Lines that end in a line feed.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerows([names, *lines])
    return text.getvalue()


def write_csv(path: Path, names: Iterable[str], lines: Iterable[Iterable[object]]) -> None:
    """Write a table to a file; see `csv_table`."""
    write_text(path, csv_table(names, lines))


def markdown_table(names: Sequence[str], lines: Iterable[Iterable[object]]) -> list[str]:
    """Return a table as lines of Markdown; in cells, ``|`` is escaped, a line feed is a space."""
    head = [_markdown_line(names), "|" + " --- |" * len(names)]
    return head + [_markdown_line(line) for line in lines]


def text_table(
    names: Sequence[str], lines: Iterable[Sequence[str]], right: Collection[str] = ()
) -> list[str]:
    """Return a table as lines for a terminal, each column as wide as its widest cell.

    Parameters
    ----------
    names
        Names of the columns.
    lines
        Cells in that order; those longer than `MAX_CELL_WIDTH` are cut, control characters
        are escaped.
    right
        Names of the columns that are aligned on the right, such as columns of numbers.

    Returns
    -------
    list of str
        The lines, the names first.
    """
    columns = []
    for column in zip(names, *lines, strict=True):
        cells = [one_line(cell, MAX_CELL_WIDTH) for cell in column]
        align, width = str.rjust if column[0] in right else str.ljust, max(map(len, cells))
        columns.append([align(cell, width) for cell in cells])
    return ["  ".join(cells).rstrip() for cells in zip(*columns, strict=True)]


def fill_tables(page: str, tables: dict[str, list[str]]) -> str:
    """Return a page with tables, each between its comment ``<!-- name -->`` and ``<!-- end -->``.

    Parameters
    ----------
    page
        Text of the page.
    tables
        Lines of each table by name.

    Returns
    -------
    str
        The page, in which the lines replace all text between the comments.

    Raises
    ------
    ValueError
        If the page does not have both comments for a table.
    """
    if missing := set(tables) - {match[2] for match in _PLACE.finditer(page)}:
        raise ValueError(f"no comment <!-- {min(missing)} --> or no <!-- end --> after it: add it")

    def fill(match: re.Match[str]) -> str:
        lines = tables.get(match[2])
        return match[0] if lines is None else f"{match[1]}\n" + "\n".join(lines) + f"\n\n{match[3]}"

    return _PLACE.sub(fill, page)


def _markdown_line(cells: Iterable[object]) -> str:
    escaped = (str(cell).replace("|", "\\|").replace("\n", " ") for cell in cells)
    return f"| {' | '.join(escaped)} |"
