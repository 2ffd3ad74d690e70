"""What is kept of the engine's word on the rows that ship."""

from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.rigid.comparison import EXPLAINED, verify
from domino_env.rigid.known import (
    digest,
    known_verification,
    markdown,
    read_verified,
    summary,
    write_verified,
)
from optimize.records.shipped import best_known

KEPT = read_verified()


@pytest.mark.parametrize("name", best_known())
def test_every_row_that_ships_is_verified_as_it_is(name: str) -> None:
    row = best_known()[name].layout
    again = "run: domino best-known --verify --update"
    assert name in KEPT, again
    assert KEPT[name].digest == digest(row, de.load_scene(name).physics), again
    assert KEPT[name].count == row.count
    assert len(KEPT[name].steps) >= 2


def test_rows_that_differ_say_why() -> None:
    for one in KEPT.values():
        assert one.verdict.startswith("AGREES") or "Likely why" in one.verdict
        assert one.verdict.startswith("DIFFERS") or (one.largest <= EXPLAINED and one.toppled)


def test_a_row_is_known_under_its_own_physics_only() -> None:
    scene, row = de.load_scene("sprint"), best_known()["sprint"].layout
    assert known_verification(row, scene.physics) == KEPT["sprint"]
    assert known_verification(row, de.Physics(friction=0.3, push=8.0)) is None
    assert known_verification(scene.uniform().layout, scene.physics) is None


def test_an_engine_anew_says_what_is_kept(tmp_path: Path) -> None:
    pytest.importorskip("pymunk")
    scene, row = de.load_scene("ideal"), best_known()["ideal"].layout
    found = summary(verify(row, scene.physics, (2e-4, 1e-4)))
    assert found.hinged == pytest.approx(KEPT["ideal"].hinged, abs=1e-3)
    assert found.free == pytest.approx(KEPT["ideal"].free, abs=3e-3)
    write_verified({"ideal": found}, tmp_path / "v.json")
    assert read_verified(tmp_path / "v.json") == {"ideal": found}
    assert f"{found.hinged:+.3%}" in markdown({"ideal": found})[-1]


def test_dominoes_far_behind_may_lie_still() -> None:
    pytest.importorskip("pymunk")
    from domino_env.rigid.engine import topple

    row, physics = de.Layout.uniform(40, pitch=0.02), de.Physics(push=8.0)
    whole, near, far = (topple(row, physics, 1e-4, window=w).arrivals for w in (None, 30, 8))
    np.testing.assert_allclose(near, whole, rtol=1e-4)
    assert np.abs(far[1:] / whole[1:] - 1.0).max() > 1e-3
    with pytest.raises(ValueError, match="window = 0"):
        topple(row, physics, 1e-4, window=0)
