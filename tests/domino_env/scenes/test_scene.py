"""Scenes: what ships, the score, the mark to beat, and the files."""

from __future__ import annotations

import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.scenes.io.reading import parse_scene

NAMES = de.scene_names()
SMALL = """
[row]
count = 8
[spacing]
min = 0.004
max = 0.03
[thickness]
fixed = 0.0075
[physics]
friction = 0.25
push = 8.0
"""


def small(**changes: object) -> de.Scene:
    return dataclasses.replace(parse_scene(SMALL, "small", "small.toml"), **changes)


def rows(scene: de.Scene, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Random gaps and thicknesses of dominoes 1 … N-1 within the bounds."""
    random = np.random.default_rng(seed)
    shape = (count, scene.count - 1)
    return random.uniform(*scene.spacing, shape), random.uniform(*scene.thickness, shape)


# what ships -------------------------------------------------------------------------------------


def test_the_scenes_that_ship() -> None:
    assert NAMES == [
        "course", "downhill", "gentle", "hills", "ideal", "jitter", "magnify", "marathon", "sprint",
        "sprint-thickness", "stock", "table", "tempo", "uphill",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "count", "friction", "push", "spacing", "thickness", "length"),
    [
        ("sprint", 40, 0.25, 8.0, (0.002, 0.04), (0.0075, 0.0075), None),
        ("sprint-thickness", 40, 0.25, 8.0, (0.002, 0.04), (0.004, 0.012), None),
        ("ideal", 40, 0.0, 8.0, (0.002, 0.04), (0.004, 0.012), None),
        ("gentle", 30, 0.5, 3.0, (0.002, 0.025), (0.005, 0.014), None),
        ("course", 60, 0.25, 8.0, (0.002, 0.04), (0.0075, 0.0075), 1.2),
        ("marathon", 1000, 0.25, 8.0, (0.002, 0.04), (0.0075, 0.0075), None),
    ],
)
def test_a_scene_is_what_it_is_said_to_be(
    name, count, friction, push, spacing, thickness, length
) -> None:
    scene = de.load_scene(name)
    assert (scene.name, scene.objective, scene.count) == (name, "mean_speed", count)
    assert scene.physics == de.Physics(friction, 9.81, push)
    assert (scene.spacing, scene.thickness, scene.length) == (spacing, thickness, length)
    assert (scene.height, scene.width, scene.density) == (0.048, 0.024, 1040.0)
    assert scene.first_thickness == 0.0075
    assert scene.free_spacing
    assert scene.free_thickness == (thickness[0] < thickness[1])


def test_two_of_three_random_gentle_rows_die() -> None:
    scene = de.load_scene("gentle")
    scores = scene.evaluate(scene.batch(*rows(scene, 1500, seed=1))).score
    assert (scores > 0.0).mean() == pytest.approx(1.0 / 3.0, abs=0.05)


# the mark: values of two independent programs, to the digits that were noted down ---------------


@pytest.mark.parametrize(
    ("name", "speed", "digits", "gap", "thickness"),
    [
        ("sprint", 0.8030, 5e-5, 0.018, 0.0075),
        ("sprint-thickness", 0.8528, 5e-5, None, 0.004),
        ("ideal", 1.0698, 6e-5, None, 0.004),
        ("course", 0.8318, 5e-5, 1.2 / 59 - 0.0075, 0.0075),
        ("marathon", 0.988, 5e-4, 0.004, 0.0075),
    ],
)
def test_the_best_uniform_row(name, speed, digits, gap, thickness) -> None:
    scene = de.load_scene(name)
    mark = scene.uniform()
    assert mark.score == pytest.approx(speed, abs=digits)
    assert mark.layout.thickness[1] == pytest.approx(thickness, abs=1e-6)
    if gap is not None:  # noted to half a millimetre
        assert mark.layout.spacing[0] == pytest.approx(gap, abs=2.5e-4)
    assert np.ptp(mark.layout.spacing) == 0.0
    assert np.ptp(mark.layout.thickness[1:]) == 0.0
    assert scene.violations(mark.layout) == []
    assert mark.wave.outcome == de.Outcome.PROPAGATED
    assert scene.score(mark.layout) == mark.score
    assert scene.uniform() is mark


@pytest.mark.parametrize("name", ["sprint", "gentle", "sprint-thickness", "ideal"])
def test_no_uniform_row_beats_the_mark(name: str) -> None:
    scene = de.load_scene(name)
    mark = scene.uniform()
    random = np.random.default_rng(5)
    gap = random.uniform(*scene.spacing, 1500)
    thickness = random.uniform(*scene.thickness, 1500)
    # neighbours a micrometre away, too: the place is found to that
    gap[:500] = mark.layout.spacing[0] + random.uniform(-1e-6, 1e-6, 500)
    thickness[:500] = mark.layout.thickness[1] + random.uniform(-1e-6, 1e-6, 500)
    gap, thickness = np.clip(gap, *scene.spacing), np.clip(thickness, *scene.thickness)
    ones = np.ones(scene.count - 1)
    scores = scene.evaluate(
        scene.batch(gap[:, None] * ones, thickness[:, None] * ones, rtol=1e-11)
    ).score
    assert scores.max() <= mark.score * (1.0 + 1e-10)


def test_the_mark_is_where_the_slope_changes_sign() -> None:
    scene = de.load_scene("sprint")
    best = scene.uniform().layout.spacing[0]
    gaps = best + np.array([-1e-6, 0.0, 1e-6])
    below, at, above = scene.evaluate(scene.batch(gaps[:, None] * np.ones(39), rtol=1e-12)).score
    # a parabola through the three has its top within a micrometre of the middle
    assert at > below
    assert at > above
    assert abs(0.5 * (above - below) / (2.0 * at - below - above)) <= 1.0


def test_where_no_uniform_row_propagates_the_mark_says_so() -> None:
    mark = small(physics=de.Physics(push=0.01)).uniform()
    assert mark.wave.outcome == de.Outcome.STALLED
    assert -1.0 <= mark.score < 0.0
    assert "stalled" in mark.wave.explanation


def test_nothing_to_choose_is_a_row_too() -> None:
    scene = small(spacing=(0.016, 0.016))
    assert not scene.free_spacing
    assert scene.uniform().layout.spacing.tolist() == [0.016] * 7


def test_a_length_fixes_the_gap_and_may_leave_the_thickness() -> None:
    scene = small(length=0.14, thickness=(0.005, 0.01))
    layout = scene.uniform().layout
    assert layout.length == pytest.approx(0.14, abs=1e-12)
    assert scene.violations(layout) == []
    with pytest.raises(ValueError, match=r"row\.length = 0\.5 m cannot be met: 8 dominoes"):
        small(length=0.5).uniform()


# the score --------------------------------------------------------------------------------------


def test_a_success_scores_its_speed_and_a_failure_how_far_it_came() -> None:
    scene = de.load_scene("gentle")
    spacing, thickness = rows(scene, 300, seed=2)
    scores = scene.evaluate(scene.batch(spacing, thickness, rtol=1e-10)).score
    for i in (*np.flatnonzero(scores > 0.0)[:5], *np.flatnonzero(scores < 0.0)[:15]):
        layout = scene.layout(spacing[i], thickness[i])
        wave = scene.simulate(layout)
        propagated = wave.outcome == de.Outcome.PROPAGATED
        assert scores[i] == pytest.approx(wave.mean_speed if propagated else wave.reach - 1.0)
        assert scene.score(layout) == pytest.approx(scores[i], rel=1e-9)
    assert np.all((scores > 0.0) | ((scores >= -1.0) & (scores < 0.0)))


def test_a_wave_that_comes_further_scores_higher() -> None:
    scene = small(count=20, spacing=(0.01, 0.05))
    gaps = np.full((12, 19), 0.016)
    for k in range(12):
        gaps[k, k + 3] = 0.049  # out of reach, each later than the last
    scores = scene.evaluate(scene.batch(gaps)).score
    assert np.all(np.diff(scores) > 0.0)
    assert scores[-1] < 0.0 < scene.score(scene.layout(0.016))


def test_the_score_of_a_layout_that_breaks_the_rules_is_refused() -> None:
    scene = small()
    with pytest.raises(ValueError, match=r"scene 'small': spacing\[0\] = 0\.035 m"):
        scene.score(scene.layout(0.035))


def test_every_broken_rule_gets_its_sentence() -> None:
    scene = small(length=0.14, thickness=(0.006, 0.008))
    assert scene.violations(de.Layout([0.01], 0.0075)) == [
        "2 dominoes stand where the scene asks for 8"
    ]
    gaps = np.array([0.003, 0.01, 0.01, 0.01, 0.01, 0.01, 0.031])
    thickness = np.array([0.007, 0.0075, 0.0075, 0.0075, 0.0075, 0.0075, 0.0075, 0.009])
    words = scene.violations(de.Layout(gaps, thickness, 0.05, density=1000.0))
    assert [w.split(" ")[0] for w in words] == [
        "thickness[0]", "height[0]", "density[0]", "spacing[0]", "thickness[7]", "the",
    ]  # fmt: skip
    assert words[3] == "spacing[0] = 0.003 m (and 1 more): the scene allows 0.004 to 0.03 m"
    assert words[5].startswith("the row is 0.138000000 m long, not 0.14 m: -0.002 m")


def test_a_layout_is_filled_in_from_the_scene() -> None:
    scene = small(first_thickness=0.009)
    layout = scene.layout(0.016)
    assert layout.thickness.tolist() == [0.009] + [0.0075] * 7
    with pytest.raises(ValueError, match="leaves the thickness free"):
        small(thickness=(0.005, 0.01)).layout(0.016)


def test_a_scene_travels_to_another_process_with_its_mark() -> None:
    scene = small()
    mark = scene.uniform()
    other = pickle.loads(pickle.dumps(scene))
    assert other.uniform().score == mark.score
    assert not other.uniform().layout.spacing.flags.writeable


# files ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_written_down_reads_back_the_same(name: str, tmp_path: Path) -> None:
    scene = de.load_scene(name)
    path = tmp_path / "scene.toml"
    path.write_text(scene.to_toml(), encoding="utf-8")
    other = de.load_scene(path)
    for field in dataclasses.fields(scene):
        assert getattr(other, field.name) == getattr(scene, field.name)


def test_a_title_may_hold_anything_in_one_line(tmp_path: Path) -> None:
    scene = small(title='Wörter, "quotes", \\, $x$ and <b>')
    assert parse_scene(scene.to_toml(), "x", "x.toml").title == scene.title


def test_a_name_that_is_not_given_is_the_file_s(tmp_path: Path) -> None:
    path = tmp_path / "garden.toml"
    path.write_text(SMALL)
    scene = de.load_scene(path)
    assert (scene.name, scene.title) == ("garden", "garden")
    assert scene.first_thickness == 0.0075  # as thick as the others, where all are the same


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


BAD = [
    ("count = 8", "cuont = 8", "unknown key 'row.cuont': did you mean 'count'? allowed: count,"),
    ("[row]", "[rwo]", "unknown key 'rwo': did you mean 'row'?"),
    ("push = 8.0", "wind = 8.0", "unknown key 'physics.wind': allowed: friction, gravity, push"),
    ("max = 0.03", "mex = 0.03", "unknown key 'spacing.mex': did you mean 'max'?"),
    ("count = 8", "", "row.count is missing: give a whole number from 2 to"),
    ("count = 8", "count = 1", "row.count = 1: give a whole number from 2 to"),
    ("count = 8", "count = 8.5", "row.count = 8.5: give a whole number"),
    ("count = 8", "count = true", "row.count = True: give a whole number"),
    ("count = 8", "count = 8\nlength = 9.0", "row.length = 9.0 m cannot be met: 8 dominoes"),
    ("count = 8", "count = 8\nlength = -1", "row.length = -1: give a finite number from 1e-09"),
    ("count = 8", "count = 8\nheight = 'tall'", "row.height = 'tall': give a finite number"),
    ("count = 8", "count = 8\nheight = nan", "row.height = nan: give a finite number"),
    ("count = 8", "count = 8\nheight = 1" + "0" * 400, "row.height = 1000"),
    ("count = 8", "count = 8\nheight = 1" + "0" * 5000, "not TOML"),
    ("min = 0.004", "", "spacing.min is missing: give min and max, or fixed [m]"),
    (
        "min = 0.004",
        "min = 0.0",
        "spacing.min = 0.0: give a finite number from 1e-09 to",
    ),
    ("min = 0.004", "min = 0.05", "spacing.min = 0.05 m is more than max = 0.03 m"),
    ("min = 0.004", "fixed = 0.01", "spacing.fixed stands beside max: give one"),
    ("fixed = 0.0075", "min = 0.004\nmax = 0.01", "row.first_thickness is missing"),
    (
        "friction = 0.25",
        "friction = -0.25",
        "physics.friction = -0.25: give a finite number from",
    ),
    ("push = 8.0", "push = 0", "physics.push = 0: give a finite number from 1e-09"),
    ("push = 8.0", "push = inf", "physics.push = inf: give a finite number"),
    ("[physics]", "[physics]\nx", "not TOML: "),
    ("[thickness]\nfixed = 0.0075", "", "thickness is missing: give a table of fixed, min, max"),
    (
        "[row]",
        "objective = 'height'\n[row]",
        "objective = 'height': choose magnify, mean_speed, robust, tempo",
    ),
    ("[row]", "title = 3\n[row]", "title = 3: give a line of text"),
    ("[row]", "name = ''\n[row]", "name = '': give a line of text"),
]


@pytest.mark.parametrize(("old", "new", "words"), BAD, ids=[f"{b[2][:40]}" for b in BAD])
def test_a_bad_scene_names_file_key_value_and_what_is_allowed(old, new, words) -> None:
    assert old in SMALL
    with pytest.raises(ValueError) as refused:  # noqa: PT011 - compared below
        parse_scene(SMALL.replace(old, new, 1), "bad", "bad.toml")
    assert str(refused.value).startswith(f"bad.toml: {words}")


def test_a_scene_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_bytes(b"\xff\x00\xff")
    with pytest.raises(ValueError, match="not UTF-8 text"):
        de.load_scene(path)
