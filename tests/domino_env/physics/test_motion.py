"""Where the dominoes of a falling row are: they touch, never overlap, and keep the wave's time."""

from __future__ import annotations

import numpy as np
import pytest

from domino_env.physics.layout import Layout
from domino_env.physics.motion import Motion, lean_behind, outlines
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome, simulate

ROWS = {
    "flushes": Layout(np.random.default_rng(2).uniform(0.002, 0.04, 20), 0.0075),
    "unequal": Layout(
        np.random.default_rng(3).uniform(0.006, 0.03, 12),
        np.random.default_rng(4).uniform(0.003, 0.012, 13),
        np.random.default_rng(5).uniform(0.0478, 0.0482, 13),
    ),
    "releases": Layout([0.044, 0.012, 0.045, 0.030, 0.045, 0.002, 0.046, 0.020], 0.0075),
}
rows = pytest.mark.parametrize("row", ROWS.values(), ids=ROWS)


def gap_of_contact(layout: Layout, leans: np.ndarray, i: int) -> float:
    """Distance between domino i and i+1 [m], negative where they overlap: the nearest of the tip
    of i from the rear face of i+1 and of the rear bottom edge of i+1 from the front face of i."""
    corners = outlines(layout, leans)
    behind, ahead = corners[i], corners[i + 1]

    def beyond(point: np.ndarray, foot: np.ndarray, top: np.ndarray) -> float:
        along = top - foot
        return float(np.cross(np.append(point - foot, 0), np.append(along, 0))[2]) / np.hypot(
            *along
        )

    return min(-beyond(behind[1], ahead[3], ahead[2]), beyond(ahead[3], behind[0], behind[1]))


@rows
@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_neighbours_touch_and_never_overlap(row: Layout, friction: float) -> None:
    wave = simulate(row, Physics(friction, push=24.0))
    motion = Motion(row, wave.physics)
    times = np.linspace(0.0, wave.arrival_times[wave.hit - 1], 60)
    leaders, _ = motion.leader(times)
    touching = apart = 0
    for leans, leader in zip(motion.angles(times), leaders, strict=True):
        assert not leans[leader + 1 :].any()
        for i in range(leader):
            gap = gap_of_contact(row, leans, i)
            if abs(gap) < 1e-9:
                touching += 1
            else:
                apart += 1
    assert touching > 80
    assert (apart > 0) == (wave.releases > 0)


@rows
def test_the_leader_keeps_the_time_of_the_wave(row: Layout) -> None:
    wave = simulate(row, Physics(0.25, push=24.0))
    motion = Motion(row, wave.physics)
    arrivals = wave.arrival_times[: wave.hit]
    leader, angle = motion.leader(arrivals * (1.0 + 1e-9))
    assert leader.tolist() == list(range(wave.hit))
    assert angle == pytest.approx(0.0, abs=1e-6)
    step = 1e-6
    _, later = motion.leader(arrivals + step)
    assert later / step == pytest.approx(wave.release_velocity[: wave.hit], rel=1e-3)


@rows
def test_leans_only_grow(row: Layout) -> None:
    motion = Motion(row, Physics(0.25, push=24.0))
    leans = motion.angles(np.linspace(-0.1, motion.end + 0.1, 2000))
    assert np.diff(leans, axis=0).min() > -1e-12
    assert not leans[0].any()
    assert np.isfinite(leans).all()


def test_many_looks_agree_with_few(monkeypatch: pytest.MonkeyPatch) -> None:
    row, physics = ROWS["flushes"], Physics(0.25, push=12.0)
    few = Motion(row, physics)
    monkeypatch.setattr("domino_env.physics.motion.PIECES", 512)
    many = Motion(row, physics)
    times = np.linspace(0.0, few.end, 1000)
    assert few.end == pytest.approx(many.end, rel=1e-3)  # the last lies down after the wave
    last = simulate(row, physics).arrival_times[-1]
    seen = times[times < last]
    assert few.angles(seen) == pytest.approx(many.angles(seen), abs=2e-4)


def test_a_wave_that_dies_stays_where_it_stopped() -> None:
    row = Layout.uniform(8, spacing=0.002)
    wave = simulate(row, Physics())
    assert wave.outcome == Outcome.STALLED
    motion = Motion(row, Physics())
    leader, angle = motion.leader(np.array([motion.end, motion.end + 1.0]))
    assert leader.tolist() == [wave.hit - 1] * 2
    assert 0.0 < angle[0] == angle[1] < np.arcsin(0.002 / 0.048)
    out = Layout([0.02, 0.06, 0.02], 0.0075)
    motion = Motion(out, Physics())
    assert motion.angles([motion.end])[0, 1] == pytest.approx(1.55)
    assert not motion.angles([motion.end])[0, 2:].any()


def test_corners_of_a_domino_that_stands_and_one_that_lies() -> None:
    row = Layout([0.02], [0.0075, 0.005])
    standing = outlines(row, np.zeros(2))
    assert standing[0] == pytest.approx(
        np.array([[0.0, 0.0], [0.0, 0.048], [-0.0075, 0.048], [-0.0075, 0.0]])
    )
    assert standing[1, 0] == pytest.approx([0.025, 0.0])
    lying = outlines(row, np.array([np.pi / 2, 0.0]))
    assert lying[0, 1] == pytest.approx([0.048, 0.0])
    assert lying[0, 3] == pytest.approx([0.0, 0.0075])


def test_leans_of_many_instants_are_those_of_each() -> None:
    row = ROWS["unequal"]
    leaders, angles = np.array([3, 0, 12, 7]), np.array([0.1, 0.4, 0.0, 0.2])
    together = lean_behind(row, leaders, angles)
    for k in range(4):
        alone = lean_behind(row, leaders[k : k + 1], angles[k : k + 1])[0]
        assert np.array_equal(together[k], alone)
