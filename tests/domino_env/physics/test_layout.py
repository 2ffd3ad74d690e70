"""Layouts: attributes, rejected arguments, and files."""

import copy
import dataclasses
import pickle
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from uneven_layouts import uneven_layout

from domino_env.core.progress import Advice
from domino_env.physics.layout import Layout
from domino_env.physics.standard import DENSITY, HEIGHT, WIDTH

UNEQUAL = Layout(
    spacing=[0.018, 0.0213, 0.012],
    thickness=[0.0075, 0.006, 0.0081, 0.007],
    height=[0.048, 0.05, 0.049, 0.048],
    width=0.02,
    density=[1040.0, 900.0, 1100.0, 1040.0],
)


def test_pitch_is_measured_from_pivot_to_pivot():
    # the front bottom edges are the pivots: the gap, then the next domino's thickness
    assert UNEQUAL.pitch == pytest.approx([0.024, 0.0294, 0.019])
    assert UNEQUAL.positions == pytest.approx([0.0, 0.024, 0.0534, 0.0724])
    assert UNEQUAL.length == pytest.approx(0.0724)
    assert UNEQUAL.count == 4


def test_one_number_applies_to_all_dominoes():
    gaps = np.array([0.01, 0.02])
    layout = Layout(gaps, 0.0075)
    gaps[0] = 9.0  # a layout keeps its own numbers
    assert layout.spacing.tolist() == [0.01, 0.02]
    for name, value in (("thickness", 0.0075), ("height", HEIGHT), ("density", DENSITY)):
        assert getattr(layout, name).tolist() == [value] * 3
    assert layout.width == WIDTH
    alone = Layout([], 0.0075)
    assert (alone.count, alone.length) == (1, 0.0)


@pytest.mark.parametrize(
    "duplicate",
    [lambda x: x, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x)), dataclasses.replace],
)
@pytest.mark.parametrize("original", [UNEQUAL, uneven_layout(1, 7)], ids=["flat", "uneven"])
def test_copies_are_equal_and_read_only(original, duplicate):
    layout = duplicate(original)
    assert layout == original
    assert hash(layout) == hash(original)
    names = "spacing", "thickness", "height", "density", "width", "rise", "tilt"
    for name in names[: 5 if layout.is_flat else 7]:
        changed = getattr(layout, name) * (1.0 - 1e-12)
        assert layout != dataclasses.replace(layout, **{name: changed})
    for name in ("spacing", "thickness", "height", "density", "pitch", "positions"):
        assert not getattr(layout, name).flags.writeable
    with pytest.raises(AttributeError):
        layout.spacing = layout.spacing  # type: ignore[misc]


@pytest.mark.parametrize(("change", "sentence"), [
    ({"spacing": [0.01, -0.0004]},
     "spacing[1] = -0.0004 m: give a finite number, more than 0"),
    ({"spacing": "near"}, "spacing = 'near': give numbers"),
    ({"thickness": [[0.01], [0.01, 0.02]]}, "thickness = [[0.01], [0.01, 0.02]]: give numbers"),
    ({"spacing": 0.01}, "spacing has shape (): give (N-1,), one gap per pair"),
    ({"density": [1040.0, float("nan"), 1040.0]},
     "density[1] = nan kg/m³: give a finite number, more than 0"),
    ({"width": "wide"}, "width = 'wide' m: give a finite number, more than 0"),
    ({"tilt": 0.16}, "domino 0 does not stand: tilt[0] is 9.167°, and it tips over by itself ..."),
    ({"rise": [0.0, 0.021]},
     "... stands 0.021 m above domino 1, normal to its own ground: the ..."),
    ({"rise": -0.01}, "domino 0 (height 0.048 m) would strike 0.0536 ..."),
    ({"tilt": [0.15, -0.15, 0.0], "spacing": [0.01, 0.02]},
     "... lean against each other before ..."),
    ({"rise": [np.nan, 0.0]}, "rise[0] = nan m: give a finite ..."),
    ({"height": [48, 50, 48]}, "the dominoes are 50 m tall: ...; domino 1 (height 50.0 m) ..."),
    ({"rise": [0.0, 0.0, 0.0]}, "rise has shape (3,): give (2,), or one number for all"),
])  # fmt: skip
def test_invalid_layouts_are_rejected(change, sentence):
    good = {"spacing": [0.02, 0.02], "thickness": [0.0075] * 3}
    words = ".*".join(re.escape(part.strip()) for part in sentence.split("..."))
    with pytest.raises(ValueError, match=f"^{words}$"):
        Layout(**(good | change))


def test_a_tip_above_the_next_top_is_rejected():
    with pytest.raises(ValueError, match=r"domino 0 \(height 0.05 m\) would strike"):
        Layout([0.02, 0.02], 0.0075, [0.05, 0.04, 0.05])
    Layout([0.030001, 0.02], 0.0075, [0.05, 0.04, 0.04])
    Layout([0.02, 0.02], 0.0075, [0.05, 0.045826, 0.05])
    Layout([0.05], 0.0075, [0.048, 0.01])  # the tip never arrives, so it cannot arrive too high


# files ------------------------------------------------------------------------------------------


def written(layout, path):
    (layout.to_csv if path.suffix == ".csv" else layout.to_json)(path)
    return path


@pytest.mark.parametrize("ending", ["csv", "json"])
@given(
    dominoes=st.lists(
        st.tuples(*[st.floats(1e-4, 0.047), st.floats(1e-4, 0.1), st.floats(1.0, 2e4)]),
        min_size=1, max_size=8,
    ),
)  # fmt: skip
def test_files_read_back_bitwise(tmp_path_factory, dominoes, ending):
    gaps, thickness, density = (list(column) for column in zip(*dominoes, strict=True))
    path = tmp_path_factory.getbasetemp() / f"any.{ending}"
    for layout in (Layout(gaps[:-1], thickness, density=density), UNEQUAL, uneven_layout(1, 7)):
        assert Layout.read(written(layout, path)) == layout


def test_files_may_have_optional_columns(tmp_path):
    path = tmp_path / "layout.csv"
    path.write_text("spacing_mm,thickness_mm,height_mm,density [kg/m3]\n20,7,48,1000\n,7,50,900\n")
    layout = Layout.read(path)
    assert layout.height.tolist() == [0.048, 0.05]
    assert layout.density.tolist() == [1000.0, 900.0]
    path.write_text(
        "spacing_mm,thickness_mm,rise_mm,tilt_deg\n12,7.5,-0.5,2\n15,7.5,0,1.5\n,7.5,,1"
    )
    layout = Layout.read(path)
    np.testing.assert_allclose(layout.rise, [-0.0005, 0.0])
    np.testing.assert_allclose(layout.tilt, np.radians([2.0, 1.5, 1.0]))
    assert "rise" not in written(UNEQUAL, path).read_text()


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
    "names in two lines": '"spacing\n(mm)",thickness_mm\n18,7.5\n20.5,7\n,7.5\n',
}


@pytest.mark.parametrize("text", SPREADSHEETS.values(), ids=SPREADSHEETS.keys())
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_tables_of_spreadsheets_are_read(tmp_path, text, encoding):
    path = tmp_path / "layout.csv"
    path.write_bytes(text.removeprefix("\ufeff" if encoding == "utf-16" else "").encode(encoding))
    assert Layout.read(path) == Layout([0.018, 0.0205], [0.0075, 0.007, 0.0075])


@pytest.mark.parametrize(("text", "words"), [
    ("spacing,thickness\n", "no dominoes below the line of names"),
    ("gap,thickness\n1,2\n", "line 1: no column for the spacing; name one 'spacing' (metres) or "
     "'spacing_mm' (found: gap, thickness)"),
    ("spacing_mm,thickness_mm,height (cm)\n18,7.5,5\n,7.5,5\n",
     "line 1: column 'height (cm)' has a unit that is not read: convert it"),
    ("spacing_mm,thickness_mm\n18,7.5\nabc,7.5\n,7.5\n",
     "line 3, column 'spacing_mm': 'abc' is not a number"),
    ("spacing_mm,thickness_mm\n18,7.5\n18,\n,7.5\n", "line 3, column 'thickness_mm': empty"),
    ("spacing_mm,thickness_mm\n18,7.5\n0,7.5\n,7.5\n",
     "line 3, column 'spacing_mm': empty or 0: give the free gap in front of every"),
    ("spacing_mm,thickness_mm\n18,7.5\n20.5,7\n", "line 3, column 'spacing_mm': leave it empty"),
    ("spacing_mm,thickness_mm\n1_4,7.5\n,7\n", "'1_4' is not a number"),
    ("spacing_mm,thickness_mm,height_mm\n20,7,50\n,7,40\n", "would strike"),
    ('spacing_mm,thickness_mm\n"18,5",7\n,7\n',
     "'18,5' is not a number: where commas separate cells, write 18.5"),
    ("spacing_mm,thickness_mm\n18,5,7,5\n,7\n", "line 2: more cells than the 2 names: where"),
    ("spacing_mm,thickness_mm,width_mm\n20,7,24\n,7,40\n",
     "column 'width_mm': dominoes of 0.024 and 0.04 m: give one width"),
    ('spacing,thickness\n"' + "x" * 200_000, "not a table: field larger than field limit"),
    ("{", "not JSON"),
    ("[1, 2]", "this is [1, 2]: give a table of spacing, thickness, height"),
    ('{"spacing": [0.01], "thickness": "x"}', "thickness = 'x': give a finite number from 1e-09 to "
     "1e+09 or a list, each a finite number from 1e-09 to 1e+09"),
    ('{"spacing": [0.01], "thickness": 0.0075, "heigth": 0.05}', "did you mean 'height'?"),
    ('{"spacing": [0.01], "thickness": 0.0075, "unit": "mm"}', "unit = 'mm'"),
])  # fmt: skip
def test_invalid_files_are_rejected(tmp_path, text, words):
    """The message has file, line and column or key, the value, and what to give."""
    path = tmp_path / ("layout.json" if text[:1] in tuple("{[") else "layout.csv")
    path.write_text(text)
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - compared below
        Layout.read(path)
    assert str(caught.value).startswith(str(path))
    assert words in str(caught.value)


@pytest.mark.parametrize(("table", "words"), [
    ("spacing,thickness\n18,0.0075\n18,0.0075\n,0.0075\n", "no gap is smaller than 18 m, and"),
    ("spacing,thickness\n18,7.5\n18,7.5\n,7.5\n", "a domino is 7.5 m thick, and the dominoes are"),
    ("spacing_mm,thickness_mm\n0.018,7.5\n0.018,7.5\n,7.5\n", "no gap is larger than 1.8e-05 m"),
    ("spacing_mm,thickness_mm\n18,0.0075\n,0.0075\n", "no domino is thicker than 7.5e-06 m"),
    ("spacing,thickness,height\n18,7.5,48\n,7.5,48\n", "the dominoes are 48 m tall"),
])  # fmt: skip
def test_lengths_of_another_unit_get_a_warning(tmp_path, table, words):
    (tmp_path / "layout.csv").write_text(table)
    with pytest.warns(Advice, match=rf"layout\.csv: {words}.*: lengths are in metres"):
        Layout.read(tmp_path / "layout.csv")
