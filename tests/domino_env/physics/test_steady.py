"""Steady waves, the smallest push and closed forms against whole chains."""

import math

import numpy as np
import pytest

import domino_env as de


@pytest.mark.parametrize("friction", [0.0, 0.25, 0.5])
@pytest.mark.parametrize("pitch", [0.016, 0.024, 0.04])
def test_a_uniform_chain_tends_to_the_steady_wave(friction, pitch):
    physics = de.Physics(friction, 9.81, 15.0)
    steady = de.steady_wave(pitch, 0.0075, physics=physics)
    wave = de.simulate(de.Layout.uniform(250, pitch=pitch), physics, rtol=1e-12)
    assert steady.exists
    assert steady.omega_release == pytest.approx(wave.release_velocity[-2], rel=1e-9)
    assert steady.omega_impact == pytest.approx(wave.impact_velocity[-1], rel=1e-9)
    between = wave.arrival_times[-1] - wave.arrival_times[-2]
    assert steady.frequency == pytest.approx(1.0 / between, rel=1e-9)
    assert steady.speed == pytest.approx(pitch / between, rel=1e-9)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(5))
def test_a_patterned_chain_tends_to_the_steady_wave(friction, seed):
    """With flushes, and now and then releases, in every period."""
    rng = np.random.default_rng(seed)
    period, repeats = int(rng.integers(2, 5)), 90
    gaps, thickness = rng.uniform(0.008, 0.034, period), rng.uniform(0.005, 0.010, period)
    physics = de.Physics(friction, 9.81, 15.0)
    steady = de.steady_wave(gaps + np.roll(thickness, -1), thickness, physics=physics)
    layout = de.Layout(np.tile(gaps, repeats)[:-1], np.tile(thickness, repeats))
    wave = de.simulate(layout, physics, rtol=1e-12)
    assert steady.exists
    last = slice((repeats - 2) * period, (repeats - 1) * period)
    np.testing.assert_allclose(steady.omega_release, wave.release_velocity[last], rtol=1e-8)
    np.testing.assert_allclose(steady.omega_impact, wave.impact_velocity[last], rtol=1e-8)
    np.testing.assert_allclose(steady.fall_times, np.diff(wave.arrival_times)[last], rtol=1e-8)


def test_a_pattern_of_equal_dominoes_is_the_uniform_row():
    one = de.steady_wave(0.024, 0.0075)
    three = de.steady_wave(np.full(3, 0.024), 0.0075)
    assert three.speed == pytest.approx(one.speed, rel=1e-10)
    assert three.omega_release.shape == (3,)


def test_where_there_is_no_steady_wave():
    tight = de.steady_wave(0.0078, 0.0075)
    assert not tight.exists
    assert tight.speed == 0.0
    assert math.isnan(tight.omega_release)
    assert "energy" in tight.explanation
    assert "out of reach" in de.steady_wave(0.06, 0.0075).explanation
    with pytest.raises(ValueError, match="overlap"):
        de.steady_wave(0.007, 0.0075)


@pytest.mark.parametrize("slender", [0.05, 0.15625, 0.35])
def test_existence_without_friction(slender):
    """Equivalent to Δh > 0, within 0.2 % up to thickness/height 0.35 (van Leeuwen, eq. 79)."""
    limit = de.existence_limit(slender, 1.0)
    for lean, exists in ((0.99 * limit, True), (1.001 * limit, False)):
        steady = de.steady_wave(slender / lean, slender, 1.0, de.Physics(0.0))
        assert steady.exists is exists


def test_the_seeds_estimate_is_near_for_thin_dominoes():
    for pitch in (0.008, 0.012):
        steady = de.steady_wave(pitch, 0.001, physics=de.Physics(0.0))
        assert de.terminal_speed_estimate(pitch, 0.001) == pytest.approx(steady.speed, rel=0.05)
    with pytest.raises(ValueError, match="releases no energy"):
        de.terminal_speed_estimate(0.0077, 0.0075)


@pytest.mark.parametrize("friction", [0.0, 0.25, 0.5])
@pytest.mark.parametrize("seed", range(6))
def test_the_smallest_push_divides_life_from_death(friction, seed):
    rng = np.random.default_rng(seed)
    layout = de.Layout(rng.uniform(0.002, 0.02, 30), rng.uniform(0.005, 0.012, 31))
    least = de.smallest_push(layout, de.Physics(friction))
    if math.isinf(least):
        dies = de.simulate(layout, de.Physics(friction, 9.81, 1e4)).outcome
        assert dies not in (de.Outcome.PROPAGATED, de.Outcome.STALLED)
        return
    for factor, outcome in ((1 - 1e-9, de.Outcome.STALLED), (1 + 1e-9, de.Outcome.PROPAGATED)):
        assert de.simulate(layout, de.Physics(friction, 9.81, factor * least)).outcome is outcome


def test_no_push_helps_where_a_gap_is_out_of_reach():
    assert de.smallest_push(de.Layout([0.02, 0.05], 0.0075), de.Physics()) == math.inf


def test_a_hair_above_a_stall_the_estimate_stays_honest():
    """One unit in the last place of the push moves the time by far more than rtol."""
    layout = de.Layout(np.random.default_rng(5).uniform(0.004, 0.02, 15), 0.0075)
    for friction in (0.0, 0.25):
        least = de.smallest_push(layout, de.Physics(friction))
        push = least * (1.0 + 1e-12)
        waves = [
            de.simulate(layout, de.Physics(friction, 9.81, p), rtol=1e-10)
            for p in (push, np.nextafter(push, 10.0))
        ]
        moved = np.max(np.abs(waves[1].arrival_times[1:] / waves[0].arrival_times[1:] - 1.0))
        assert moved > 1e-8
        assert not waves[0].converged
        assert moved < waves[0].error_estimate < 1e-2
