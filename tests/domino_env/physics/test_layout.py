"""Layouts: what is kept, what follows from it, what is refused, and files."""

from __future__ import annotations

import copy
import dataclasses
import json
import pickle
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from domino_env.core.progress import Advice
from domino_env.physics.layout import Layout
from domino_env.physics.standard import DENSITY, HEIGHT, WIDTH


def same(one: Layout, other: Layout) -> bool:
    """Equal to the last bit."""
    names = ("spacing", "thickness", "height", "density")
    arrays = all(np.array_equal(getattr(one, n), getattr(other, n)) for n in names)
    return arrays and one.width == other.width


def uneven() -> Layout:
    return Layout(
        spacing=[0.018, 0.0213, 0.012],
        thickness=[0.0075, 0.006, 0.0081, 0.007],
        height=[0.048, 0.05, 0.049, 0.048],
        width=0.02,
        density=[1040.0, 900.0, 1100.0, 1040.0],
    )


def test_pitch_is_measured_from_pivot_to_pivot() -> None:
    layout = uneven()
    # the front bottom edges are the pivots: the gap, then the next domino's thickness
    assert layout.pitch == pytest.approx([0.024, 0.0294, 0.019])
    assert layout.positions == pytest.approx([0.0, 0.024, 0.0534, 0.0724])
    assert layout.length == pytest.approx(0.0724)
    assert layout.count == 4


def test_one_number_serves_all_dominoes() -> None:
    layout = Layout([0.01, 0.02], 0.0075)
    for name, value in (("thickness", 0.0075), ("height", HEIGHT), ("density", DENSITY)):
        assert getattr(layout, name).tolist() == [value] * 3
    assert layout.width == WIDTH


def test_a_single_domino_is_a_row() -> None:
    layout = Layout([], 0.0075)
    assert (layout.count, layout.length) == (1, 0.0)


def test_uniform_by_pitch_and_by_gap() -> None:
    by_pitch = Layout.uniform(5, pitch=0.024, thickness=0.0075)
    by_gap = Layout.uniform(5, spacing=0.0165, thickness=0.0075)
    assert by_pitch.spacing == pytest.approx(by_gap.spacing)
    assert by_pitch.is_uniform
    assert not Layout([0.01, 0.01], [0.0075, 0.007, 0.0075]).is_uniform
    assert Layout.uniform(1, spacing=0.01).is_uniform
    assert not uneven().is_uniform


def test_a_layout_owns_read_only_arrays() -> None:
    gaps = np.array([0.01, 0.02])
    layout = Layout(gaps, 0.0075)
    gaps[0] = 9.0
    assert layout.spacing[0] == 0.01
    for name in ("spacing", "thickness", "height", "density", "pitch", "positions"):
        assert not getattr(layout, name).flags.writeable
    with pytest.raises(AttributeError):
        layout.spacing = gaps  # type: ignore[misc]


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_are_read_only_too(duplicate) -> None:
    layout = duplicate(uneven())
    assert same(layout, uneven())
    assert not layout.spacing.flags.writeable


@pytest.mark.parametrize(("arguments", "sentence"), [
    ({"spacing": [0.01, -0.0004]},
     "spacing[1] = -0.0004 m: dominoes 1 and 2 overlap; widen the gap"),
    ({"spacing": [0.0, 0.01]},
     "spacing[0] = 0.0 m: dominoes 0 and 1 touch; widen the gap"),
    ({"spacing": [0.01, float("nan")]},
     "spacing[1] = nan m: give a finite number, more than 0"),
    ({"spacing": [0.01, float("inf")]},
     "spacing[1] = inf m: give a finite number, more than 0"),
    ({"spacing": 0.01},
     "spacing has shape (): give one gap a pair, shape (N-1,)"),
    ({"spacing": [[0.01, 0.02]]},
     "spacing has shape (1, 2): give one gap a pair, shape (N-1,)"),
    ({"thickness": [0.0075, 0.0, 0.0075]},
     "thickness[1] = 0.0 m: give a finite number, more than 0"),
    ({"thickness": [0.0075, 0.0075]},
     "thickness has shape (2,), but 2 spacings stand between 3 dominoes: give one number or 3"),
    ({"height": [0.048, 0.048, -0.048]},
     "height[2] = -0.048 m: give a finite number, more than 0"),
    ({"height": [0.048]},
     "height has shape (1,), but 2 spacings stand between 3 dominoes: give one number or 3"),
    ({"density": [1040.0, float("nan"), 1040.0]},
     "density[1] = nan kg/m³: give a finite number, more than 0"),
    ({"width": 0.0},
     "width = 0.0 m: give a finite number, more than 0"),
    ({"width": "wide"},
     "width = 'wide' m: give a finite number, more than 0"),
])  # fmt: skip
def test_what_cannot_stand_is_refused_with_element_and_value(arguments, sentence) -> None:
    good = {"spacing": [0.01, 0.02], "thickness": 0.0075}
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - the whole sentence is compared
        Layout(**(good | arguments))
    assert str(refused.value) == sentence


def test_a_tip_above_the_next_top_is_refused_and_both_remedies_work() -> None:
    with pytest.raises(ValueError, match=r"domino 0 \(height 0.05 m\) would strike") as refused:
        Layout([0.02, 0.02], 0.0075, [0.05, 0.04, 0.05])
    gap, height = (float(x) for x in re.findall(r"at least (\S+)", str(refused.value)))
    assert (gap, height) == pytest.approx((0.03, 0.0458258), abs=2e-6)
    Layout([gap, 0.02], 0.0075, [0.05, 0.04, 0.04])
    Layout([0.02, 0.02], 0.0075, [0.05, height, 0.05])


def test_a_gap_out_of_reach_may_stand_before_any_height() -> None:
    # the tip never arrives, so it cannot arrive too high
    Layout([0.05], 0.0075, [0.048, 0.01])


@pytest.mark.parametrize(("arguments", "words"), [
    ({"count": 0, "pitch": 0.02}, "count = 0"),
    ({"count": 3}, "give either pitch"),
    ({"count": 3, "pitch": 0.02, "spacing": 0.01}, "give either pitch"),
    ({"count": 3, "pitch": 0.0075}, "pitch = 0.0075 m is not more than thickness"),
    ({"count": 3, "spacing": -0.01}, "spacing[0] = -0.01 m"),
])  # fmt: skip
def test_uniform_refuses_what_cannot_stand(arguments, words) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
        Layout.uniform(**arguments)
    assert words in str(refused.value)


# files ------------------------------------------------------------------------------------------


@given(
    rows=st.lists(
        st.tuples(*[st.floats(1e-4, 0.047), st.floats(1e-4, 0.1), st.floats(1.0, 2e4)]),
        min_size=1, max_size=8,
    ),
    ending=st.sampled_from([".csv", ".json"]),
)  # fmt: skip
def test_files_bring_back_every_bit(tmp_path_factory, rows, ending) -> None:
    gaps, thickness, density = (list(column) for column in zip(*rows, strict=True))
    layout = Layout(gaps[:-1], thickness, density=density)
    path = tmp_path_factory.getbasetemp() / f"any{ending}"
    (layout.to_csv if ending == ".csv" else layout.to_json)(path)
    assert same(Layout.read(path), layout)


def test_files_keep_the_width_and_heights(tmp_path: Path) -> None:
    uneven().to_json(tmp_path / "row.json")
    uneven().to_csv(tmp_path / "row.csv")
    assert same(Layout.from_json(tmp_path / "row.json"), uneven())
    assert same(Layout.from_csv(tmp_path / "row.csv"), uneven())


def test_where_a_file_does_not_say_the_width_its_reader_may(tmp_path: Path) -> None:
    (tmp_path / "row.csv").write_text("spacing,thickness\n0.018,0.0075\n,0.0075\n")
    (tmp_path / "row.json").write_text('{"spacing": [0.018], "thickness": 0.0075}')
    for name in ("row.csv", "row.json"):
        assert Layout.read(tmp_path / name).width == 0.024
        assert Layout.read(tmp_path / name, width=0.04).width == 0.04


SPREADSHEETS = {
    "millimetres": "spacing_mm,thickness_mm\n18,7.5\n20.5,7\n,7.5\n",
    "metres": "spacing,thickness\n0.018,0.0075\n0.0205,0.007\n,0.0075\n",
    "last gap given": "spacing_mm,thickness_mm\n18,7.5\n20.5,7\n0,7.5\n",
    "last cell missing": "thickness_mm,spacing_mm\n7.5,18\n7,20.5\n7.5\n",
    "decimal commas": "spacing_mm;thickness_mm\n18,0;7,5\n20,5;7\n;7,5\n",
    "tabs": "spacing_mm\tthickness_mm\n18\t7.5\n20.5\t7\n\t7.5\n",
    "byte order mark": "\ufeffspacing_mm,thickness_mm\n18,7.5\n20.5,7\n,7.5\n",
    "windows lines": "spacing_mm,thickness_mm\r\n18,7.5\r\n20.5,7\r\n,7.5\r\n",
    "blank lines": "\n\nspacing_mm,thickness_mm\n18,7.5\n\n20.5,7\n,7.5\n,,\n\n",
    "quoted, with notes": '"Spacing (mm)","Thickness [mm]",note\n18,7.5,"a, b"\n20.5,7,\n,7.5,',
    "separator line": "sep=;\nspacing_mm;thickness_mm\n18;7,5\n20,5;7\n;7,5\n",
    "names in two lines": '"spacing\n(mm)",thickness_mm\n18,7.5\n20.5,7\n,7.5\n',
}


@pytest.mark.parametrize("text", SPREADSHEETS.values(), ids=SPREADSHEETS.keys())
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_tables_as_spreadsheets_write_them(tmp_path: Path, text: str, encoding: str) -> None:
    path = tmp_path / "row.csv"
    path.write_bytes(text.removeprefix("\ufeff" if encoding == "utf-16" else "").encode(encoding))
    assert same(Layout.from_csv(path), Layout([0.018, 0.0205], [0.0075, 0.007, 0.0075]))


def test_heights_and_densities_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "row.csv"
    path.write_text("spacing_mm,thickness_mm,height_mm,density\n20,7,48,1000\n,7,50,900\n")
    layout = Layout.from_csv(path)
    assert layout.height.tolist() == [0.048, 0.05]
    assert layout.density.tolist() == [1000.0, 900.0]


@pytest.mark.parametrize(("text", "words"), [
    ("", "the file is empty"),
    ("\n  \n", "the file is empty"),
    ("spacing,thickness\n", "no dominoes below the line of names"),
    ("gap,thickness\n1,2\n", "line 1: no column for the spacing; name one 'spacing' (metres) or "
     "'spacing_mm' (found: gap, thickness)"),
    ("spacing,spacing_mm,thickness\n1,2,3\n", "line 1: two columns give the spacing"),
    ("spacing_mm,thickness_mm\n18,7.5\nabc,7.5\n,7.5\n",
     "line 3, column 'spacing_mm': 'abc' is not a number"),
    ("spacing_mm,thickness_mm\n18,7.5\n18,\n,7.5\n", "line 3, column 'thickness_mm': empty"),
    ("spacing_mm,thickness_mm\n,7.5\n18,7.5\n18,7.5\n",
     "line 2, column 'spacing_mm': empty; give the free gap in front of every domino but the last"),
    ("spacing_mm,thickness_mm\n18,7.5\n\n-2,7.5\n,7.5\n", "line 4, column 'spacing_mm': -2"),
    ("spacing_mm,thickness_mm\n18,7.5\n,nan\n", "line 3, column 'thickness_mm': nan must be"),
    ("spacing_mm,thickness_mm,height_mm\n20,7,50\n,7,40\n", "would strike"),
    ('spacing_mm,thickness_mm\n"18,5",7\n,7\n',
     "'18,5' is not a number: where commas divide the cells, write 18.5"),
    ("spacing_mm,thickness_mm\n18,5,7,5\n,7\n", "line 2: more cells than the 2 names: where"),
    ("spacing_mm,thickness_mm,width_mm\n20,7,24\n,7,40\n",
     "column 'width_mm': dominoes of 0.024 and 0.04 m; a row has one width"),
    ('spacing,thickness\n"' + "x" * 200_000, "not a table: field larger than field limit"),
])  # fmt: skip
def test_a_bad_table_is_refused_with_file_line_and_column(tmp_path: Path, text, words) -> None:
    path = tmp_path / "row.csv"
    path.write_text(text)
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
        Layout.from_csv(path)
    assert str(refused.value).startswith(str(path))
    assert words in str(refused.value)


@pytest.mark.parametrize(("text", "words"), [
    ("{", "not JSON"),
    ("[" * 100_000, "not JSON"),
    ("[1, 2]", "this is [1, 2]: give a table of spacing, thickness, height"),
    ('{"thickness": [1]}', "spacing is missing: give a list"),
    ('{"spacing": [0.01], "thickness": 0.0075, "heigth": 0.05}', "did you mean 'height'?"),
    ('{"spacing": [0.01], "thickness": 0.0075, "unit": "mm"}', "unit = 'mm'"),
    ('{"spacing": [-0.01], "thickness": 0.0075}', "spacing[0] = -0.01: give a finite"),
    ('{"spacing": [0.01], "thickness": [0.0075, NaN]}', "thickness[1] = nan: give a finite number"),
    ('{"spacing": ["wide"], "thickness": 0.0075}', "spacing[0] = 'wide': give a finite number"),
    ('{"spacing": {"a": 1}, "thickness": 0.0075}', "row.json: "),
    ('{"spacing": [0.01], "thickness": 0.0075, "width": null}', "width = None: give a finite"),
])  # fmt: skip
def test_bad_json_is_refused_with_file_and_key(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "row.json"
    path.write_text(text)
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
        Layout.from_json(path)
    assert str(refused.value).startswith(str(path))
    assert words in str(refused.value)


@pytest.mark.parametrize(("table", "words"), [
    ("spacing,thickness\n18,0.0075\n18,0.0075\n,0.0075\n", "no gap is smaller than 18 m, and"),
    ("spacing,thickness\n18,7.5\n18,7.5\n,7.5\n", "a domino is 7.5 m thick, and the dominoes are"),
    ("spacing_mm,thickness_mm\n0.018,7.5\n0.018,7.5\n,7.5\n", "no gap is larger than 1.8e-05 m"),
    ("spacing_mm,thickness_mm\n18,0.0075\n,0.0075\n", "no domino is thicker than 7.5e-06 m"),
    ("spacing,thickness,height\n18,7.5,48\n,7.5,48\n", "the dominoes are 48 m tall"),
])  # fmt: skip
def test_lengths_of_another_unit_are_warned_of(tmp_path: Path, table: str, words: str) -> None:
    (tmp_path / "row.csv").write_text(table)
    with pytest.warns(Advice, match=rf"row\.csv: {words}.*: lengths are in metres"):
        Layout.read(tmp_path / "row.csv")


def test_only_csv_and_json_are_read(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"row\.xlsx: a layout is a \.csv or \.json file"):
        Layout.read(tmp_path / "row.xlsx")


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "row.json"
    Layout([0.01], 0.0075).to_json(path)
    before = path.read_text()

    def full_disk(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr("os.fsync", full_disk)
    with pytest.raises(OSError, match="no space left"):
        uneven().to_json(path)
    assert path.read_text() == before
    assert json.loads(before)["spacing"] == [0.01]
    assert [p.name for p in tmp_path.iterdir()] == ["row.json"]


def test_a_layout_with_other_gaps_is_made_by_replace() -> None:
    layout = Layout.uniform(3, spacing=0.02)
    assert dataclasses.replace(layout, spacing=[0.01, 0.03]).spacing.tolist() == [0.01, 0.03]
