"""simulate against the independent Newton-Euler solution in time."""

import numpy as np
import oracle
import pytest

import domino_env as de


def compare(spacing, thickness, *, rtol=3e-11, **given):
    """Topple both and compare all they have in common."""
    slow = oracle.topple(spacing, thickness, **given)
    layout = de.Layout(
        spacing, thickness, given.get("height", 0.048), density=given.get("density", 1040.0)
    )
    physics = de.Physics(
        given.get("friction", 0.25), given.get("gravity", 9.81), given.get("push", 8.0)
    )
    wave = de.simulate(layout, physics, rtol=1e-12)
    assert wave.outcome.name == slow.outcome
    came = len(slow.arrival)
    np.testing.assert_allclose(wave.arrival_times[:came], slow.arrival, rtol=rtol, atol=0)
    falls = len(slow.release_velocity)
    np.testing.assert_allclose(wave.release_velocity[:falls], slow.release_velocity, rtol=rtol)
    np.testing.assert_allclose(wave.impact_velocity[: came - 1], slow.impact_velocity, rtol=rtol)
    np.testing.assert_allclose(wave.stall_margin[: len(slow.margin)], slow.margin, atol=1e-5)
    assert (wave.flushes, wave.releases) == (slow.flushes, slow.releases)
    assert wave.largest_flush_loss == pytest.approx(slow.largest_flush_loss, abs=1e-9)
    assert np.isnan(wave.release_velocity[wave.hit :]).all()
    assert np.isinf(wave.arrival_times[wave.hit :]).all()
    return wave


@pytest.mark.parametrize("friction", [0.0, 0.25, 0.6])
@pytest.mark.parametrize("seed", range(4))
def test_random_gaps(friction, seed):
    rng = np.random.default_rng(seed)
    compare(rng.uniform(0.002, 0.034, 9), np.full(10, 0.0075), friction=friction, push=11.0)


@pytest.mark.parametrize("seed", range(5))
def test_every_domino_different(seed):
    """Gaps, thickness, height and density all vary; heights so that every tip strikes a face."""
    rng = np.random.default_rng(100 + seed)
    height = 0.048 * np.cumprod(rng.uniform(1.0, 1.15, 10))
    compare(
        rng.uniform(0.1, 0.8, 9) * height[:-1],
        rng.uniform(0.08, 0.25, 10) * height,
        height=height,
        density=rng.uniform(400.0, 2500.0, 10),
        friction=rng.uniform(0.0, 0.4),
        push=14.0,
    )


@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_a_shorter_next_domino(friction):
    """Height may fall where the gap is wide enough for the tip to strike below the next top."""
    height = np.array([0.05, 0.048, 0.047, 0.05, 0.045])
    spacing = np.array([0.02, 0.015, 0.02, 0.026])
    compare(spacing, np.full(5, 0.008), height=height, friction=friction, push=12.0)


def test_a_run_of_equal_gaps_goes_flush_as_one():
    wave = compare(np.r_[np.full(8, 0.005), np.full(5, 0.020)], np.full(14, 0.0075), push=15.0)
    assert wave.flushes == 8


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3])
def test_releases_from_tip_and_from_corner(friction):
    spacing = [0.044, 0.012, 0.045, 0.030, 0.045, 0.002, 0.046, 0.020]
    wave = compare(spacing, np.full(9, 0.0075), friction=friction, push=24.0)
    assert wave.releases >= 2


def test_high_friction_and_large_flush_losses():
    wave = compare([0.03, 0.002, 0.03, 0.002, 0.03, 0.03], np.full(7, 0.006), friction=0.6, push=20)
    assert wave.largest_flush_loss > 0.05


@pytest.mark.parametrize("factor", [1.2, 1.5])
def test_growing_dominoes(factor):
    scale = 0.048 * factor ** np.arange(8)
    compare(0.3 * scale[:-1], 0.15625 * scale, height=scale, push=9.0)


@pytest.mark.parametrize(("gap", "push"), [(0.005, 4.0), (0.003, 6.0), (0.009, 2.69)])
def test_stalls_happen_under_the_same_leader(gap, push):
    wave = compare(np.full(12, gap), np.full(13, 0.0075), friction=0.5, push=push)
    assert wave.outcome is de.Outcome.STALLED
    assert wave.mean_speed == 0.0
    assert "stalled" in wave.explanation


def test_jamming():
    thickness = [0.0075, 0.0075, 0.05, 0.05, 0.0075, 0.0075, 0.0075]
    wave = compare(np.full(6, 0.02), thickness, friction=1.0)
    assert wave.outcome is de.Outcome.JAMMED
    assert wave.hit == 3  # the third was struck in vain
    assert np.isfinite(wave.arrival_times[2])
    assert np.isnan(wave.release_velocity[2])


def test_out_of_reach():
    wave = compare([0.02, 0.02, 0.048, 0.02], np.full(5, 0.0075))
    assert wave.outcome is de.Outcome.OUT_OF_REACH
    assert (wave.hit, wave.toppled) == (3, 3)
