"""Positions of the dominoes of a falling chain: they touch, at the arrival times of the wave."""

import numpy as np
import oracle
import pytest
from uneven_layouts import uneven_layout

import domino_env as de
from domino_env.physics.motion import outlines, stack_leans, stack_sums

LAYOUTS = {
    "flushes": de.Layout(np.random.default_rng(2).uniform(0.002, 0.04, 20), 0.0075),
    "unequal": de.Layout(
        np.random.default_rng(3).uniform(0.006, 0.03, 12),
        np.random.default_rng(4).uniform(0.003, 0.012, 13),
        np.random.default_rng(5).uniform(0.0478, 0.0482, 13),
    ),
    "releases": de.Layout([0.044, 0.012, 0.045, 0.030, 0.045, 0.002, 0.046, 0.020], 0.0075),
    "uneven ground": uneven_layout(3, 10),
}
layouts = pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)


@layouts
@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_neighbours_touch_and_never_overlap(layout, friction):
    """Behind the leader a tip lies on a rear face or an edge on a front."""
    wave = de.simulate(layout, de.Physics(friction, push=24.0))
    motion = de.Motion(layout, wave.physics)
    times = np.linspace(0.0, wave.arrival_times[wave.hit - 1], 60)
    leaders, _ = motion.leader(times)
    touching = separate = 0
    for leans, leader in zip(motion.angles(times), leaders, strict=True):
        assert np.array_equal(leans[leader + 1 :], layout.tilt[leader + 1 :])
        foot, top, _, edge = outlines(layout, leans).swapaxes(0, 1)
        tips = oracle.dot(edge[1:] - top[:-1], oracle.ahead(leans[1:]))  # short of the rear face
        edges = oracle.dot(edge[1:] - foot[:-1], oracle.ahead(leans[:-1]))
        distance = np.minimum(tips, edges)
        assert wave.releases > 0 or distance.min() > -1e-12  # else a tip may be past the edge
        assert (distance[leader + 1 :] > 0.0).all()
        touching += int((np.abs(distance[:leader]) < 1e-12).sum())
        separate += int((np.abs(distance[:leader]) >= 1e-12).sum())
    assert touching > 80
    assert (separate > 0) == (wave.releases > 0)


@layouts
def test_the_leader_follows_the_arrival_times_and_leans_only_grow(layout):
    wave = de.simulate(layout, de.Physics(0.25, push=24.0))
    motion = de.Motion(layout, wave.physics)
    arrivals = wave.arrival_times[: wave.hit]
    leader, angle = motion.leader(arrivals * (1.0 + 1e-9))
    assert leader.tolist() == list(range(wave.hit))
    stand = layout.tilt[: wave.hit]
    assert angle == pytest.approx(stand, abs=1e-6)
    _, later = motion.leader(arrivals + 1e-6)
    assert (later - stand) / 1e-6 == pytest.approx(wave.release_velocity[: wave.hit], rel=1e-3)
    leans = motion.angles(np.linspace(-0.1, motion.end + 0.1, 2000))
    assert np.diff(leans, axis=0).min() > -1e-12
    assert np.array_equal(leans[0], layout.tilt)
    assert np.isfinite(leans).all()


def test_many_pieces_agree_with_few(monkeypatch):
    layout, physics = LAYOUTS["flushes"], de.Physics(0.25, push=12.0)
    few = de.Motion(layout, physics)
    monkeypatch.setattr("domino_env.physics.motion.PIECES", 512)
    many = de.Motion(layout, physics)
    assert few.end == pytest.approx(many.end, rel=1e-3)  # the last lies down after the wave
    times = np.linspace(0.0, de.simulate(layout, physics).arrival_times[-1], 500)
    assert few.angles(times) == pytest.approx(many.angles(times), abs=2e-4)


def test_a_wave_that_stops_stays_where_it_stopped():
    layout = de.Layout.uniform(8, spacing=0.002)
    wave, motion = de.simulate(layout, de.Physics()), de.Motion(layout, de.Physics())
    assert wave.outcome == de.Outcome.STALLED
    leader, angle = motion.leader(np.array([motion.end, motion.end + 1.0]))
    assert leader.tolist() == [wave.hit - 1] * 2
    assert 0.0 < angle[0] == angle[1] < np.arcsin(0.002 / 0.048)
    motion = de.Motion(de.Layout([0.02, 0.06, 0.02], 0.0075), de.Physics())
    assert motion.angles([motion.end])[0, 1] == pytest.approx(1.55)
    assert not motion.angles([motion.end])[0, 2:].any()


@pytest.mark.parametrize(("leader", "angle", "words"), [
    ([0, 21], [0.0, 0.0], r"leader\[1\] = 21: give a whole number from 0 to 20"),
    ([-1], [0.0], r"leader\[0\] = -1: give a whole number from 0 to 20"),
    ([1.5], [0.0], r"leader.*give a whole number"),
    ([3, 4], [0.0], r"angle has shape \(1,\): give \(2,\)"),
    ([[3]], [[0.0]], r"leader has shape \(1, 1\): give \(T,\)"),
])  # fmt: skip
def test_a_leader_that_no_domino_is_rejected(leader, angle, words):
    layout = LAYOUTS["flushes"]
    with pytest.raises(ValueError, match=words):
        stack_leans(layout, leader, angle)
    with pytest.raises(ValueError, match=words):
        stack_sums(layout, leader, angle, 1e-5, 1e-5)
