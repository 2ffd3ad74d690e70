"""Scene files: read, written back, and rejected with file, key, value and what is allowed."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import domino_env as de
from domino_env.core.progress import Advice
from domino_env.scenes.io.reading import parse_scene
from domino_env.scenes.objectives.tempo import Tempo
from domino_env.scenes.rules import Stock

BASE = """
[row]
count = 8
first_thickness = 0.0075
[spacing]
min = 0.004
max = 0.03
[thickness]
min = 0.005
max = 0.01
[physics]
push = 8.0
"""


def read(**replaced: str) -> de.Scene:
    return parse_scene(changed(**replaced), "asked", "asked.toml")


def changed(**tables: str) -> str:
    """BASE with whole tables replaced or added: spacing="min = …"; top: lines before them."""
    top = tables.pop("top", "")
    parts = {}
    for block in BASE.strip().split("\n["):
        name, lines = block.strip("[").split("]\n", 1)
        parts[name] = lines.strip()
    parts |= tables
    return top + "\n" + "\n".join(f"[{n}]\n{t}\n" for n, t in parts.items() if t is not None)


def test_a_step_is_a_list_of_values() -> None:
    scene = read(spacing="min = 0.004\nmax = 0.0061\nstep = 0.0005")
    assert scene.spacing_values == (0.004, 0.0045, 0.005, 0.0055, 0.006)
    assert scene.spacing == (0.004, 0.006)
    assert "step = 0.0005" in scene.to_toml()
    listed = read(thickness="values = [0.01, 0.005, 0.0075]")
    assert listed.thickness_values == (0.005, 0.0075, 0.01)
    assert read(thickness="values = [0.005]").thickness_values is None  # that is fixed


GROWING = {
    "spacing": 'min = 0.05\nmax = 0.9\nof = "height"',
    "thickness": 'fixed = 0.15\nof = "height"',
    "growth": "max = 1.6",
}
BOX = {"thickness": None, "stock": "thickness = [0.005, 0.0075]\ncount = [4, 4]"}
BAD = [
    ({"spacing": "min = 0.004\nmax = 0.03\nstep = 0"}, "spacing.step = 0: give a finite number"),
    ({"spacing": "min = 0.004\nmax = 0.03\nstep = 1e-10"}, "spacing.step = 1e-10: give a fin"),
    ({"spacing": "values = [0.01]\nmin = 0.002"}, "spacing.values stands beside min: give one"),
    ({"spacing": "values = 0.01"}, "spacing.values = 0.01: give a list: a finite number"),
    ({"spacing": "values = [0.01, 'x']"}, "spacing.values[1] = 'x': give a finite number"),
    ({"spacing": "values = [0.01, 0.01]"}, "spacing.values holds 0.01 and 0.01"),
    ({"spacing": "min = 0.004\nmax = 0.03\nlargest_change = -1"}, "spacing.largest_change = -1: g"),
    ({"thickness": "min = 0.004\nmax = 0.01\nlargest_change = 1"},
     "unknown key 'thickness.largest_change': allowed: fixed,"),
    ({"spacing": 'min = 0.05\nmax = 0.9\nof = "width"'}, "spacing.of = 'width': choose height (al"),
    ({"spacing": 'min = 0.05\nmax = 0.9\nof = "height"'}, 'spacing.of = "height" but thickness'),
    (GROWING | {"growth": "min = 0.5\nmax = 2"}, "growth.min = 0.5: give a finite number from 1"),
    (GROWING | {"growth": ""}, "growth.max is missing"),
    ({"growth": "max = 1.6"}, "[growth] needs spacing and thickness in heights"),
    (GROWING | {"row": "count = 8\nlength = 1.0\nfirst_thickness = 0.0075"},
     'row.length is in metres: not with of = "height"'),
    (GROWING | {"spacing": GROWING["spacing"] + "\nstep = 0.1"}, "spacing.step or values is in me"),
    (BOX | {"thickness": "fixed = 0.005"}, "[thickness] stands beside [stock]"),
    (BOX | {"stock": "thickness = [0.005]\ncount = [3]"}, "stock.count adds up to 3 dominoes"),
    (BOX | {"stock": "thickness = [0.005]\ncount = [9]"},
     "row.first_thickness = 0.0075: no domino of 0.0075 m is in the stock: 9 of 0.005 m"),
    (BOX | {"stock": "thickness = [0.005]\ncount = 9"}, "stock.count = 9: give a list"),
    (BOX | {"stock": "thickness = [0.005]\ncount = [1.5]"}, "stock.count[0] = 1.5: give a whole"),
    (BOX | {"stock": "thickness = [0.005, 0.005]\ncount = [1, 2]"}, "stock.thickness[1] = 0.005"),
    (BOX | {"row": "count = 7\nlength = 0.1\nfirst_thickness = 0.0075"},
     "stock.count adds up to 8: with row.length, give exactly row.count = 7"),
    ({"limits": ""}, "limits: the table is empty; it holds stall_margin, flush_loss"),
    ({"limits": "stall_margin = 1.5"}, "limits.stall_margin = 1.5: give a finite number, at le"),
    ({"limits": "stall_margin = 0.1", "top": "objective = 'toppled'"}, "[limits] judge waves that"),
    ({"top": "objective = 'tempo'"}, "the table [tempo] is missing and objective = 'tempo'"),
    ({"tempo": "from = 1\nto = 2"}, "the table [tempo] stands there and objective = 'mean_speed'"),
    ({"top": "objective = 'tempo'", "tempo": "from = 0\nto = 2"}, "tempo.from = 0: give a finite"),
    ({"top": "objective = 'tempo'", "tempo": "times = [0.1, 0.2]"},
     "tempo.times has 2 entries: a row of 8 dominoes needs one for each but the first, 7"),
    ({"top": "objective = 'tempo'", "tempo": "from = 1"}, "tempo.to is missing"),
    ({"top": "objective = 'robust'"}, "the table [robust] is missing"),
    ({"top": "objective = 'robust'", "robust": "draws = 9"}, "robust.deviation is missing"),
    ({"top": "objective = 'robust'", "robust": "deviation = 1e-3\ndraws = 0"},
     "robust.draws = 0: give a whole number from 1 to"),
    ({"top": "objective = 'robust'", "robust": "deviation = 1e-3\nquantile = 2"},
     "robust.quantile = 2: give a finite number, more than 0, at most 1"),
    ({"top": "objective = 'time'"}, "row.length is missing: objective = 'time' needs a course"),
    ({"top": "objective = 'magnify'"}, "the table [growth] is missing: objective = 'magnify'"),
    ({"top": "stock = 3"}, "stock = 3: give a table of thickness, count"),
    ({"row": "cuont = 8"}, "unknown key 'row.cuont': did you mean 'count'? allowed: count,"),
    ({"rwo": "count = 8"}, "unknown key 'rwo': did you mean 'row'?"),
    ({"row": ""}, "row.count is missing: give a whole number from 2 to"),
    ({"row": "count = 1"}, "row.count = 1: give a whole number from 2 to"),
    ({"row": "count = 8.5"}, "row.count = 8.5: give a whole number"),
    ({"row": "count = true"}, "row.count = True: give a whole number"),
    ({"row": "count = 8"}, "row.first_thickness is missing"),
    ({"row": "count = 8\nheight = 'tall'"}, "row.height = 'tall': give a finite number"),
    ({"row": "count = 8\nheight = nan"}, "row.height = nan: give a finite number"),
    ({"row": "count = 8\nheight = 1" + "0" * 400}, "row.height = 1000"),
    ({"row": "count = 8\nheight = 1" + "0" * 5000}, "not TOML"),
    ({"row": "count = 8\nlength = 9.0\nfirst_thickness = 0.0075"}, "row.length = 9.0 m cannot be"),
    ({"spacing": "max = 0.03"}, "spacing.min is missing: give min and max, or fixed [m]"),
    ({"spacing": "min = 0.05\nmax = 0.03"}, "spacing.min = 0.05 m is more than max = 0.03 m"),
    ({"spacing": "fixed = 0.01\nmax = 0.03"}, "spacing.fixed stands beside max: give one"),
    ({"spacing": "min = 4\nmax = 30"}, "spacing: no gap may be smaller than 4 m, and no domino"),
    ({"thickness": None}, "thickness is missing: give a table of fixed, min, max"),
    ({"thickness": "fixed = 7.5"}, "thickness: no domino may be thinner than 7.5 m, with a height"),
    ({"physics": "friction = -0.25"}, "physics.friction = -0.25: give a finite number from"),
    ({"physics": "push = inf"}, "physics.push = inf: give a finite number"),
    ({"physics": "floor_friction = -0.1"}, "physics.floor_friction = -0.1: give a finite number"),
    ({"physics": "x"}, "not TOML: "),
    ({"physics": "floor_friction = 0.4", "top": "objective = 'toppled'"},
     "physics.floor_friction and objective = 'toppled': a row that stands is scored by its speed"),
    ({"physics": "floor_friction = 0.4", "limits": "stall_margin = 0.1"},
     "physics.floor_friction stands beside [limits]"),
    ({"ground": "slope = 50"}, "ground.slope = 50: give a finite number from -45 to 45"),
    ({"ground": "profile = [[0, 0]]"}, "ground.profile = [[0, 0]]: give a list"),
    ({"ground": "profile = [[0, 0], [0, 1]]"}, "ground.profile[1] lies at x = 0 m"),
    ({"ground": "slope = 3\nprofile = [[0, 0], [1, 0]]"}, "ground: give either slope"),
    ({"ground": ""}, "ground: give either slope"),
    ({"ground": "slope = 8.5"}, "the ground slopes by 8.5°, where a domino 5 mm thick and 48 mm"),
    ({"ground": "profile = [[0, 0], [0.02, 0.0015], [0.04, 0]]", "thickness": "fixed = 0.012"},
     "the ground bulges by"),
    ({"top": "objective = 'height'"}, "objective = 'height': choose magnify, mean_speed, robust"),
    ({"top": "title = 3"}, "title = 3: give a line of text"),
    ({"top": "name = ''"}, "name = '': give a line of text"),
]  # fmt: skip


@pytest.mark.parametrize(("tables", "words"), BAD, ids=[words[:40] for _, words in BAD])
def test_a_bad_scene_names_the_place(tables: dict[str, str], words: str) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
        read(**tables)
    assert str(refused.value).startswith(f"asked.toml: {words}")


def test_a_title_may_hold_anything_in_one_line() -> None:
    scene = read().replace(title='Wörter, "quotes", \\, $x$ and <b>')
    assert parse_scene(scene.to_toml(), "x", "x.toml").title == scene.title


def test_a_file_beside_does_not_hide_a_scene_that_ships(tmp_path: Path, monkeypatch) -> None:
    (tmp_path / "sprint").write_text("not a scene")
    monkeypatch.chdir(tmp_path)
    assert de.load_scene("sprint").count == 40


@pytest.mark.parametrize(("name", "words"), [
    ("sprnit", "there is no scene 'sprnit': did you mean 'sprint'?"),
    ("zzz", "there is no scene 'zzz': scenes that ship: course, downhill"),
    ("missing.toml", "missing.toml: there is no such scene file"),
])  # fmt: skip
def test_a_scene_that_is_not_there(name: str, words: str) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
        de.load_scene(name)
    assert str(refused.value).startswith(words)


def test_a_scene_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xff\x00\xff")
    with pytest.raises(ValueError, match="not UTF-8 text"):
        de.load_scene(path)


# scenes made in Python -------------------------------------------------------------------------


def test_a_scene_is_a_value() -> None:
    for name in de.scene_names():
        scene, again = de.load_scene(name), de.load_scene(name)
        assert scene == again == scene.replace()
        assert hash(scene) == hash(again) == hash(scene.replace())
        assert scene != scene.replace(width=0.1)
        assert parse_scene(scene.to_toml(), "x", "x.toml") == scene


def test_a_scene_made_in_python_has_the_defaults_of_a_file() -> None:
    own = de.Scene(count=np.int64(9), spacing=np.array([0.002, 0.04]), thickness=(0.0075, 0.0075))
    text = """
    name = "own"
    [row]
    count = 9
    [spacing]
    min = 0.002
    max = 0.04
    [thickness]
    fixed = 0.0075
    [physics]
    """
    assert own == parse_scene(text, "own", "own.toml")
    assert (own.title, own.first_thickness, own.height) == ("own", 0.0075, 0.048)


@pytest.mark.parametrize(("changes", "words"), [
    ({"count": 1}, "row.count = 1: give a whole number from 2 to"),
    ({"width": 0.0}, "row.width = 0.0: give a finite number"),
    ({"name": "a/b"}, "name = 'a/b': give a line of text"),
    ({"spacing": (0.04, 0.002)}, "spacing.min = 0.04 m is more than max = 0.002 m"),
    ({"length": 9.0}, "row.length = 9.0 m cannot be met"),
    ({"objective": "speed"}, "objective = 'speed': choose magnify, mean_speed"),
    ({"objective": "robust"}, r"the table \[robust\] is missing"),
    ({"settings": Tempo(30.0, 45.0)}, r"the table \[tempo\] stands there"),
    ({"stock": Stock((0.005,), (3,))}, "stock.count adds up to 3 dominoes"),
])  # fmt: skip
def test_a_scene_made_in_python_is_checked_as_its_file(changes, words: str) -> None:
    with pytest.raises(ValueError, match=f"^scene '.*': {words}"):
        de.load_scene("sprint").replace(**changes)


# random scene files -----------------------------------------------------------------------------

metres = st.floats(1e-4, 0.1)


@st.composite
def ranges(draw: st.DrawFn, most: float = 0.1) -> str:
    low, high = sorted(draw(st.lists(st.floats(1e-3, most), min_size=2, max_size=2)))
    kind = draw(st.sampled_from(["range", "fixed", "step", "values"]))
    if kind == "fixed":
        return f"fixed = {low!r}"
    if kind == "values":
        values = draw(st.lists(st.integers(1, 99), min_size=1, max_size=6, unique=True))
        return f"values = {[v * 1e-3 for v in values]!r}"
    step = f"\nstep = {draw(st.floats(5e-4, 0.01))!r}" if kind == "step" else ""
    return f"min = {low!r}\nmax = {high!r}{step}"


@st.composite
def files(draw: st.DrawFn) -> str:
    count = draw(st.integers(2, 12))
    objective = draw(st.sampled_from(["mean_speed", "tempo", "robust", "toppled", "magnify"]))
    first = 0.0075
    tables = {
        "top": f"objective = '{objective}'",
        "row": f"count = {count}\nfirst_thickness = {first}",
        "spacing": draw(ranges()),
        "thickness": draw(ranges()),
        "physics": f"friction = {draw(st.floats(0.0, 1.0))!r}",
    }
    if draw(st.booleans()):
        tables["spacing"] += f"\nlargest_change = {draw(metres)!r}"
    if objective == "magnify":
        tables |= GROWING
    elif draw(st.booleans()):
        tables["thickness"] = None
        more = draw(st.lists(st.integers(0, 9), min_size=2, max_size=2))
        tables["stock"] = f"thickness = [0.005, {first}]\ncount = [{more[0]}, {count + more[1]}]"
    if objective == "tempo":
        tables["tempo"] = f"from = {draw(st.floats(1.0, 99.0))!r}\nto = 40"
    if objective == "robust":
        tables["robust"] = f"deviation = {draw(metres)!r}\ndraws = {draw(st.integers(1, 20))}"
    if objective != "toppled" and draw(st.booleans()):
        tables["limits"] = f"flush_loss = {draw(st.floats(0.0, 1.0))!r}"
    return changed(**tables)


@settings(max_examples=80, deadline=None)
@given(files(), st.integers(0, 2**32 - 1))
def test_any_scene_reads_back_the_same_and_scores_its_rows(text: str, seed: int) -> None:
    try:
        scene = parse_scene(text, "random", "random.toml")
    except ValueError as error:
        assume("no gap may be smaller" not in str(error))  # than the height
        raise
    again = parse_scene(scene.to_toml(), "x", "x.toml")
    for field in dataclasses.fields(scene):
        assert getattr(again, field.name) == getattr(scene, field.name), field.name
    if scene.growth is not None:
        return
    random = np.random.default_rng(seed)
    gaps = random.uniform(*scene.spacing, (3, scene.count - 1))
    thick = random.uniform(*scene.thickness, (3, scene.count - 1))
    scores = scene.evaluate(scene.batch(gaps, thick, rtol=1e-10)).score
    assert np.all(np.isfinite(scores) & (scores >= -1.0))
    one = scene.score(scene.simulate(scene.layout(gaps[0], thick[0])))
    assert one == pytest.approx(scores[0], rel=1e-9)


@settings(max_examples=200, deadline=None)
@given(
    st.text(alphabet=st.sampled_from(list(" \n=[]{}'\"0123456789.-eminaxfgthrows")), max_size=200)
)
def test_whatever_stands_in_a_file_the_answer_is_a_sentence(text: str) -> None:
    for document in (text, BASE + text, BASE.replace("0.03", text or "0")):
        try:
            parse_scene(document, "noise", "noise.toml")
        except ValueError as error:
            assert str(error).startswith("noise.toml: ")  # noqa: PT017


def test_a_scene_of_metres_for_millimetres_is_warned_of() -> None:
    with pytest.warns(
        Advice, match="asked.toml: the dominoes are 48 m tall: lengths are in metres"
    ):
        read(row="count = 8\nheight = 48.0\nfirst_thickness = 7.5", spacing="min = 4\nmax = 30")
