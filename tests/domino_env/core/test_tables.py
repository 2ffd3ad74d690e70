"""Tables: numbers read back exactly, and no text leaves its cell."""

import csv

import numpy as np

from domino_env.core.tables import csv_table, markdown_table, text_table


def read_back(text: str) -> list[list[str]]:
    return list(csv.reader(text.splitlines(keepends=True)))


def test_numbers_read_back_bitwise():
    values = [0.1, -1e-300, 5e-324, np.nextafter(0.8, 1.0), 1e16, 3, -7, np.float64(2) / 3]
    names, line = read_back(csv_table("abcdefgh", [values]))
    assert names == list("abcdefgh")
    assert [float(cell) for cell in line] == values
    assert read_back(csv_table("ab", [[None, 1]]))[1] == ["", "1"]


def test_text_in_markdown_cells_is_escaped():
    assert markdown_table(("a", "b"), [("x|y", 1), ("two\nlines", None)]) == [
        "| a | b |", "| --- | --- |", "| x\\|y | 1 |", "| two lines | None |",
    ]  # fmt: skip


def test_text_tables_have_columns_and_no_control_characters():
    lines = text_table(("name", "n"), [("a\x1b[2J", "7"), ("b" * 70, "1,000")], right={"n"})
    assert lines[0] == f"{'name':60}      n"
    assert lines[1].startswith("a\\x1b[2J ")
    assert lines[2] == "b" * 59 + "…  1,000"
    assert all(line.isprintable() for line in lines)
