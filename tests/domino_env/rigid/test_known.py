"""Verifications that are kept of the shipped layouts."""

from pathlib import Path

import pytest

import domino_env as de
from domino_env.core.tables import fill
from domino_env.rigid.known import (
    digest,
    known_table,
    known_verification,
    read_verified,
    write_verified,
)
from optimize.experiments.best_known import best_known
from optimize.experiments.verification import verify_records

KEPT = read_verified()
AGAIN = "run: domino best-known --verify --update && python docs/verified.py --stored"
PAGE = Path(__file__).parents[3] / "docs" / "verified.md"


@pytest.mark.parametrize("name", best_known())
def test_every_layout_that_ships_is_verified_as_it_is(name):
    layout, one = best_known()[name].layout, KEPT.get(name)
    assert one is not None, AGAIN
    assert one.digest == digest(layout, de.load_scene(name).physics), AGAIN
    assert one.count == layout.count
    assert [check.floor for check in one.floors] == [None, 0.3, 0.5, 1.0]
    assert one.verdict.startswith("AGREES") or "Why: " in one.verdict
    assert "UNDECIDED" not in one.verdict
    (uniform,) = (c for c in one.checks if (c.floor, c.layout) == (None, "uniform"))
    assert uniform.largest < 1e-3


def test_scores_are_those_of_the_simulated_wave():
    assert len({check.score for check in KEPT["tempo-noise"].floors}) == 4


def test_the_page_shows_what_is_kept():
    page = PAGE.read_text("utf-8")
    assert fill(page, {"known": known_table(KEPT)}) == page, AGAIN
    with pytest.raises(ValueError, match="no comment <!-- else -->"):
        fill(page, {"else": []})


def test_a_layout_is_known_under_its_own_physics_only():
    scene, layout = de.load_scene("sprint"), best_known()["sprint"].layout
    assert known_verification(layout, scene.physics) == KEPT["sprint"]
    assert known_verification(layout, de.Physics(friction=0.3, push=8.0)) is None
    assert known_verification(scene.uniform().layout, scene.physics) is None


def test_a_verification_repeated_agrees_with_the_kept_one(tmp_path):
    name, lines = "tempo", []  # needs no uniform layouts on floors
    record, scene = best_known()[name], de.load_scene(name)
    found = verify_records({name: record}, {name: scene}, [0.5], report=lines.append)[name]
    kept = KEPT[name].floors
    for one, other in ((found.floors[0], kept[0]), (found.floors[1], kept[2])):
        assert one.floor == other.floor
        assert one.last == pytest.approx(other.last, abs=4e-4)  # of both uncertainties
        assert one.score == other.score
    assert lines == [f"{name}: {found.verdict}"]
    write_verified({name: found}, tmp_path / "v.json")
    assert read_verified(tmp_path / "v.json") == {name: found}
