"""Stored verifications of the shipped layouts."""

import pytest

import domino_env as de
from domino_env.core.models import plain
from domino_env.core.tables import fill_tables
from domino_env.rigid import known
from domino_env.scenes import uniform
from optimize.experiments.best_known import best_known

STORED = known.read_verified()
AGAIN = "run: python docs/verified.py --best"


@pytest.fixture(scope="module")
def page_script(script):
    return script("docs/verified.py")


@pytest.mark.parametrize("name", best_known())
def test_every_shipped_layout_has_a_current_verification(name):
    layout, verified = best_known()[name].layout, STORED.get(name)
    assert verified is not None, AGAIN
    assert verified.digest == known.digest(layout, de.load_scene(name).physics), AGAIN
    assert verified.count == de.load_scene(name).row_count
    assert [check.floor for check in verified.floors] == [None, 0.3, 0.5, 1.0]
    assert verified.verdict.startswith("AGREES") or "Why: " in verified.verdict
    assert "UNDECIDED" not in verified.verdict
    (uniform,) = (c for c in verified.checks if (c.floor, c.layout) == (None, "uniform"))
    assert uniform.largest < 1e-3


def test_the_table_shows_the_stored_verifications(page_script):
    assert page_script.known_table(STORED) == page_script.KNOWN.read_text("utf-8"), AGAIN
    with pytest.raises(ValueError, match="no comment <!-- else -->"):
        fill_tables("a page", {"else": []})


def test_a_verification_applies_to_its_own_physics_only():
    scene, layout = de.load_scene("sprint"), best_known()["sprint"].layout
    assert known.known_verification(layout, scene.physics) == STORED["sprint"]
    assert known.known_verification(layout, de.Physics(friction=0.3, push=8.0)) is None
    assert known.known_verification(scene.uniform().layout, scene.physics) is None


class LaterPhysics(de.Physics, frozen=True):
    """Physics with fields that a later version adds."""

    drag: float = 0.0
    damping: float = 0.0


def test_a_new_field_of_the_physics_changes_digests_unless_it_has_its_default(monkeypatch):
    scene, layout = de.load_scene("sprint"), best_known()["sprint"].layout
    changes = {}, {"drag": 0.1}, {"damping": 0.1}, {"drag": 0.1, "damping": 0.1}
    digests = [known.digest(layout, LaterPhysics(**change)) for change in changes]
    assert digests[0] == known.digest(layout, de.Physics()) == STORED["sprint"].digest
    assert len(set(digests)) == 4
    document = scene.document()
    before = uniform.stamp(document)
    monkeypatch.setattr(uniform, "Physics", LaterPhysics)
    tables = [plain(LaterPhysics(**change)) for change in changes]
    stamps = [uniform.stamp(document | {"physics": table}) for table in tables]
    assert stamps[0] == before
    assert len(set(stamps)) == 4


def test_a_repeated_verification_agrees_with_the_stored_one(page_script, tmp_path, monkeypatch):
    name = "tempo"  # needs no uniform layouts on floors
    monkeypatch.setattr(page_script, "FLOORS", (0.5,))
    repeated = page_script.verify_best_known([name])
    assert [check.floor for check in repeated[name].floors] == [None, 0.5]
    for check in repeated[name].floors:
        (stored,) = (other for other in STORED[name].floors if other.floor == check.floor)
        assert check.last == pytest.approx(stored.last, abs=4e-4)  # of both uncertainties
        assert check.score == stored.score
    monkeypatch.setattr(known, "PATH", tmp_path / "known.json")
    known.PATH.write_text("{}")
    page_script.store(repeated)
    assert known.read_verified() == repeated
