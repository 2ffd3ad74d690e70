"""Scene files: read, written back, and rejected with file, key, value and what is allowed."""

import numpy as np
import pytest
from env_scenes import SCENES

import domino_env as de
from domino_env.core.progress import Advice
from domino_env.scenes.io.reading import parse_scene

BASE = {
    "row": "count = 8\nfirst_thickness = 0.0075",
    "spacing": "min = 0.004\nmax = 0.03",
    "thickness": "min = 0.005\nmax = 0.01",
    "physics": "push = 8.0",
}


def read(top: str = "", **tables: str | None) -> de.Scene:
    """Read the scene with tables replaced, added or left out (None), and lines before them."""
    parts = [f"[{name}]\n{lines}" for name, lines in (BASE | tables).items() if lines is not None]
    return parse_scene("\n".join([top, *parts]), "asked", "asked.toml")


GROWING = {
    "spacing": 'min = 0.05\nmax = 0.9\nof = "height"',
    "thickness": 'fixed = 0.15\nof = "height"',
    "growth": "max = 1.6",
}
BOX = {"thickness": None, "stock": "thickness = [0.005, 0.0075]\ncount = [4, 4]"}
BAD = [
    ({"spacing": "fixed = 0.01\nmax = 0.02"}, "spacing: it has fixed and max: give either"),
    ({"spacing": "min = 0.01"}, "spacing: it has min: give either fixed, or min and max [m]"),
    ({"spacing": 'min = 0.05\nmax = 0.9\nof = "height"'}, 'spacing.of = "height" but thickness'),
    ({"growth": "max = 1.6"}, "[growth] needs spacing and thickness in heights"),
    (GROWING | {"row": "count = 8\nlength = 1.0\nfirst_thickness = 0.0075"},
     'row.length is in metres: leave it out, or'),
    (BOX | {"thickness": "fixed = 0.005"}, "[thickness] and [stock] exclude each other: both give"),
    (BOX | {"stock": "thickness = [0.005]\ncount = [9]"},
     "row.first_thickness = 0.0075: no domino of 0.0075 m is in the stock: 9 of 0.005 m"),
    (BOX | {"stock": "thickness = [0.005, 0.005]\ncount = [1, 2]"}, "stock.thickness[1] = 0.005"),
    (BOX | {"row": "count = 7\nlength = 0.1\nfirst_thickness = 0.0075"},
     "stock.count adds up to 8 dominoes: row.count = 7 and row.length need exactly as many"),
    ({"top": "objective = 'tempo'"}, "the table [tempo] is missing and objective = 'tempo'"),
    ({"top": "objective = 'tempo'", "tempo": "times = [0.1, 0.2]"},
     "tempo.times has 2 entries: 8 dominoes need one for each but the first, 7"),
    ({"top": "objective = 'magnify'"}, "the table [growth] is missing: objective = 'magnify'"),
    ({"row": "count = 8"}, "row.first_thickness is missing"),
    ({"row": "height = 0.05"}, "row.count is missing: give a whole number from 2 to 100000"),
    ({"row": "count = 8\nheight = 1" + "0" * 5000}, "not TOML"),
    ({"spacing": "fixed = 0.01\nmax = 0.03"}, "spacing: it has fixed and max: give either fixed"),
    ({"spacing": "min = 4\nmax = 30"},
     "within the bounds of spacing and thickness no domino falls on the next: no gap is smaller"),
    ({"thickness": None}, "thickness is missing: give a table of fixed, min, max"),
    ({"thickness": "fixed = 7.5"},
     "within the bounds of spacing and thickness no domino falls on the next: a domino is 7.5 m"),
    (GROWING | {"physics": "floor_friction = 0.4", "top": "objective = 'magnify'"},
     "physics.floor_friction and objective = 'magnify': free-standing layouts are scored by their "
     "speed; choose objective = 'mean_speed'"),
    ({"ground": "profile = [[0, 0], [0, 1]]"}, "ground.profile[1] lies at x = 0 m"),
    ({"ground": "profile = [[0, 0], [1]]"}, "ground.profile[1] = [1]: give a list of 2 entries"),
    ({"placement": "deviation = 0.001\nquantile = 2"},
     "placement.quantile = 2: give a finite number, more than 0, at most 1 (share of the draws"),
    ({"ground": "slope = 3\nprofile = [[0, 0], [1, 0]]"}, "ground: give either slope"),
    ({"ground": "slope = 8.5"}, "the ground slopes by 8.5°, where a domino 5 mm thick and 48 mm"),
    ({"ground": "profile = [[0, 0], [0.02, 0.0015], [0.04, 0]]", "thickness": "fixed = 0.012"},
     "the ground bulges by"),
]  # fmt: skip


@pytest.mark.parametrize(("tables", "words"), BAD, ids=[words[:40] for _, words in BAD])
def test_the_error_of_an_invalid_scene_names_file_and_key(tables, words):
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - compared below
        read(**tables)
    assert str(caught.value).startswith(f"asked.toml: {words}")


def test_a_file_of_the_same_name_does_not_hide_a_shipped_scene(tmp_path, monkeypatch):
    (tmp_path / "sprint").write_text("not a scene")
    monkeypatch.chdir(tmp_path)
    assert de.load_scene("sprint").count == 40


# scenes made in Python -------------------------------------------------------------------------


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
def test_a_scene_reads_back_equal(scene):
    again = parse_scene(scene.to_toml(), "x", "x.toml")
    assert scene == again == scene.replace()
    assert hash(scene) == hash(again)
    assert scene != scene.replace(width=0.1)


@pytest.mark.parametrize("title", ['Wörter, "quotes", \\, $x$ and <b>', "雨"])
def test_names_and_titles_hold_any_language(title):
    scene = read().replace(title=title, name="étude (2), 雨")
    assert parse_scene(scene.to_toml(), "x", "x.toml") == scene


def test_a_scene_made_in_python_has_the_defaults_of_a_file():
    own = de.Scene(count=np.int64(9), spacing=np.array([0.002, 0.04]), thickness=(0.0075, 0.0075))
    tables = {"row": "count = 9", "spacing": "min = 0.002\nmax = 0.04", "physics": None}
    assert own == read('name = "own"', thickness="fixed = 0.0075", **tables)
    assert (own.title, own.first_thickness, own.height) == ("own", 0.0075, 0.048)


@pytest.mark.parametrize(("tables", "words"), [
    ({"row": "count = 8\nheight = 48.0\nfirst_thickness = 7.5", "spacing": "min = 4\nmax = 30"},
     "the dominoes are 48 m tall"),
    ({"spacing": "min = 0.002\nmax = 30"}, "a gap is 30 m wide, and the dominoes are 0.048 m tall"),
])  # fmt: skip
def test_a_scene_in_millimetres_gives_a_warning(tables, words):
    with pytest.warns(Advice, match=f"asked.toml: {words}: lengths are in metres"):
        read(**tables)
