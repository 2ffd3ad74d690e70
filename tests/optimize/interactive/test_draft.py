"""Drafts without a page: changes within the rules, words, searches."""

from typing import Any

import numpy as np
import pytest

import domino_env as de
from optimize.experiments.best_known import best_known
from optimize.interactive.draft import SPACING, THICKNESS, Draft
from optimize.interactive.jobs import Found, SearchProcess, run_search

SPRINT, COURSE = de.load_scene("sprint"), de.load_scene("course")
SCENES = {
    "bounds": SPRINT,
    "length": COURSE,
    "stock": de.load_scene("stock"),
    "thickness": de.load_scene("sprint-thickness"),
    "slope": de.load_scene("downhill"),
}


@pytest.mark.parametrize("kind", SCENES)
@pytest.mark.parametrize("wanted", [1e-9, 0.0101, 0.0263, 7.0])
def test_a_drag_anywhere_keeps_the_rules(kind: str, wanted: float) -> None:
    draft = Draft.uniform(SCENES[kind])
    for part in [SPACING, THICKNESS][: 1 + draft.scene.free_thickness]:
        draft = draft.with_size(part, 5, wanted)  # raises if it breaks a rule
        assert draft.score == draft.scene.score(draft.layout)
    if kind == "thickness":
        expected = min(max(wanted, 0.004), 0.012)
        assert draft.layout.thickness[6] == pytest.approx(expected)
    for following in (False, True):
        assert draft.with_shift(6, wanted - 0.01, following=following).layout.count
    if kind != "stock":  # which has as many pieces as dominoes
        assert draft.with_domino(5).layout.count == draft.layout.count + 1
    assert draft.without_domino(5).layout.count == draft.layout.count - 1


@pytest.mark.parametrize(("wanted", "expected"), [(0.0263, 0.0263), (7.0, 0.040)])
def test_a_drag_sets_the_nearest_gap_allowed(wanted: float, expected: float) -> None:
    dragged = Draft.uniform(SPRINT).with_size(SPACING, 5, wanted)
    assert dragged.layout.spacing[5] == pytest.approx(expected, rel=1e-12)


def test_a_drag_with_a_fixed_length_changes_the_neighbours() -> None:
    draft = Draft.uniform(COURSE)
    before = draft.layout.spacing
    changed = draft.with_size(SPACING, 20, before[20] + 0.001).layout.spacing
    assert np.flatnonzero(abs(changed - before) > 1e-9).tolist() == [19, 20]
    changed = draft.with_size(SPACING, 20, 0.040).layout.spacing  # more than one can give
    gaps = np.flatnonzero(abs(changed - before) > 1e-9)
    assert gaps.tolist() == list(range(gaps[0], gaps[-1] + 1))
    assert changed[20] == pytest.approx(0.040)


def test_a_domino_moves_between_its_neighbours() -> None:
    draft = Draft.uniform(SPRINT)
    before = draft.layout
    moved = draft.with_shift(7, 0.004).layout
    pivots = moved.pivots[:, 0] - before.pivots[:, 0]
    assert pivots == pytest.approx(0.004 * (np.arange(40) == 7))
    far = draft.with_shift(7, 1.0).layout  # as far as the bounds of both gaps
    assert far.spacing[7] == pytest.approx(0.002)
    assert far.length == pytest.approx(before.length)
    moved = draft.with_shift(7, 0.004, following=True).layout
    assert moved.pivots[:, 0] - before.pivots[:, 0] == pytest.approx(0.004 * (np.arange(40) >= 7))
    last = draft.with_shift(39, -0.004).layout
    assert np.flatnonzero(abs(last.spacing - before.spacing) > 1e-9).tolist() == [38]


def test_a_domino_that_is_inserted_or_removed_leaves_the_others() -> None:
    draft = Draft.uniform(SPRINT.replace(spacing=(0.002, 0.060)))
    inserted, removed = draft.with_domino(4).layout, draft.without_domino(4).layout
    pivots = draft.layout.pivots[:, 0]
    assert np.delete(inserted.pivots[:, 0], 5) == pytest.approx(pivots)
    assert inserted.spacing[4] == pytest.approx(inserted.spacing[5])
    assert removed.pivots[:, 0] == pytest.approx(np.delete(pivots, 4))
    end = draft.without_domino(39).layout
    assert end.pivots[:, 0] == pytest.approx(pivots[:-1])


@pytest.mark.parametrize("fields", [
    {"count": 57}, {"height": 0.060}, {"spacing": (0.015, 0.030)}, {"length": 1.1},
    {"ground": de.Ground(slope=2.0)}, {"physics": SPRINT.physics.replace(push=12.0)},
], ids=lambda fields: next(iter(fields)))  # fmt: skip
def test_another_scene_keeps_the_shape_or_the_best_equal_gaps(fields: dict[str, Any]) -> None:
    first = Draft.uniform(SPRINT)
    scene = SPRINT.replace(**fields)
    draft = first.with_size(SPACING, 0, 0.030).with_scene(scene)
    assert draft.layout.spacing[0] == pytest.approx(0.030, abs=0.003)
    uniform = first.with_scene(scene)
    assert uniform.score == pytest.approx(uniform.scene.uniform().score, rel=1e-8)


def test_an_impossible_change_is_an_error() -> None:
    draft = Draft.uniform(SPRINT)
    for wrong, message in (
        ((THICKNESS, 5, 0.01), "quantity = 'thickness': choose one of spacing"),
        ((SPACING, 39, 0.01), "index = 39: give a whole number from 0 to 38"),
        ((SPACING, 5, float("nan")), "value = nan m: give a finite number"),
    ):
        with pytest.raises(ValueError, match=message):
            draft.with_size(*wrong)
    with pytest.raises(ValueError, match="leaves nothing free"):
        draft.with_scene(SPRINT.replace(spacing=(0.02, 0.02)))
    with pytest.raises(ValueError, match="40 dominoes, and the scene 20"):
        Draft(SPRINT.replace(count=20), draft.layout)


def test_the_words_agree_with_the_command(output_of, tmp_path) -> None:
    draft, uniform = Draft.uniform(SPRINT).with_size(SPACING, 3, 0.012), SPRINT.uniform()
    path = tmp_path / "row.csv"
    draft.layout.to_csv(path)
    printed = output_of("simulate", path, "--scene", "sprint")
    speed, sentence = draft.headline(uniform)
    assert f"score {draft.score:.6f} m/s" in printed
    assert speed == f"{draft.score:.3f} m/s"
    loss = 1.0 - draft.score / uniform.score
    assert sentence == f"{loss:.2%} slower than the best equal gaps"
    assert f"{loss:.2%} below the uniform" in printed
    assert f"last hit after {draft.wave.arrival_times[-1]:.4f} s" in draft.details(uniform)
    best = Draft(SPRINT, best_known()["sprint"].layout)
    assert best.headline(uniform) == ("0.829 m/s", "3.18% faster than the best equal gaps")
    assert "100% of the gain of the best known row" in best.details(uniform)
    assert Draft.uniform(SPRINT).headline(uniform)[1] == "as fast as the best equal gaps"
    assert "computing" in best.headline(None)[1]


@pytest.mark.parametrize(("name", "words"), [
    ("tempo", "RMS error 18.7 ms"), ("magnify", "last domino 8.44 m high"),
])  # fmt: skip
def test_the_words_of_other_objectives(name: str, words: str) -> None:
    draft = Draft.uniform(de.load_scene(name))
    assert draft.headline(draft.scene.uniform()) == (words, f"best equal gaps: {words}")


def test_the_words_of_a_wave_that_stops_name_the_place() -> None:
    draft = Draft.uniform(SPRINT.replace(spacing=(0.002, 0.060)))
    assert draft.stop is None
    draft = draft.with_size(SPACING, 20, 0.050)  # more than the height
    assert draft.stop == 20
    assert draft.headline(None) == ("stops at domino 20", "21 of 40 are hit")
    assert draft.repaired().stop is None


def test_a_search_shows_better_layouts(monkeypatch) -> None:
    monkeypatch.setattr("optimize.interactive.jobs.SHOW_INTERVAL", 0.0)
    monkeypatch.setattr("optimize.interactive.jobs.PATIENCE", 0.2)
    shown = list[Found]()
    run_search(SPRINT, shown.append, thorough=False)
    scores = [found.score for found in shown]
    assert scores[:-1] == sorted(scores[:-1])
    assert scores[-1] >= scores[-2] * (1.0 - 1e-6)
    for layout, score, *_ in shown[:: len(shown) // 5]:
        assert SPRINT.score(layout) == pytest.approx(score, rel=1e-6)
    assert [found.is_done for found in shown] == [False] * (len(shown) - 1) + [True]
    assert "the last 0.2 s gained less than 0.01%" in shown[-1].text


def test_a_process_searches_until_it_is_closed() -> None:
    processes = SearchProcess(), SearchProcess()
    try:
        *_, last = processes[0].run(SPRINT, thorough=False)
        assert last.score > 1.03 * SPRINT.uniform().score
        search = processes[1].run(SPRINT, thorough=True)
        assert not next(search).is_done
        processes[1].close()
        *_, last = search
        assert last == (None, 0.0, "the process of the search has ended: try again", True)
    finally:
        for process in processes:
            process.close()
