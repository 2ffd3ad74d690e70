"""Scene files that ask for more: read, written back, and refused with the place named."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import domino_env as de
from domino_env.core.progress import Advice
from domino_env.scenes.io.reading import parse_scene

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


def test_the_scenes_that_ask_more() -> None:
    stock, tempo, jitter, magnify = map(de.load_scene, ("stock", "tempo", "jitter", "magnify"))
    assert (stock.stock.thickness, stock.stock.count) == ((0.005, 0.0075, 0.010), (16, 14, 10))
    assert (stock.count, stock.first_thickness, stock.spacing) == (40, 0.0075, (0.002, 0.04))
    assert (tempo.count, tempo.spacing, tempo.thickness) == (40, (0.002, 0.04), (0.004, 0.012))
    errors = jitter.placement
    assert (errors.deviation, errors.quantile, errors.draws) == (0.0005, 0.05, 256)
    sprint = de.load_scene("sprint")
    for other in (stock, tempo, jitter):
        assert (other.physics, other.height) == (sprint.physics, sprint.height)
    assert (magnify.count, magnify.height, magnify.growth[1]) == (12, 0.048, 1.6)
    assert magnify.in_heights
    assert (magnify.spacing, magnify.thickness) == ((0.05, 0.9), (0.15, 0.15))
    assert magnify.physics == de.Physics(0.25, 9.81, 8.0)


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
]  # fmt: skip


@pytest.mark.parametrize(("tables", "words"), BAD, ids=[words[:40] for _, words in BAD])
def test_a_bad_scene_names_the_place(tables: dict[str, str], words: str) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
        read(**tables)
    assert str(refused.value).startswith(f"asked.toml: {words}")


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


@pytest.mark.parametrize(("tables", "words"), [
    ({"spacing": "min = 4\nmax = 30"}, "spacing: no gap may be smaller than 4 m, and no domino"),
    ({"spacing": "fixed = 0.05"}, "spacing: no gap may be smaller than 0.05 m"),
    ({"thickness": "fixed = 7.5"}, "thickness: no domino may be thinner than 7.5 m, with a height"),
    (GROWING | {"growth": None, "spacing": 'fixed = 20\nof = "height"'}, "smaller than 20 heights"),
])  # fmt: skip
def test_a_scene_of_another_unit_is_refused_before_time_is_spent(tables, words: str) -> None:
    with pytest.raises(ValueError, match=f"{words}.*: lengths are in metres, 18 mm is 0.018"):
        read(**tables)


def test_a_scene_of_metres_for_millimetres_is_warned_of() -> None:
    with pytest.warns(
        Advice, match="asked.toml: the dominoes are 48 m tall: lengths are in metres"
    ):
        read(row="count = 8\nheight = 48.0\nfirst_thickness = 7.5", spacing="min = 4\nmax = 30")
