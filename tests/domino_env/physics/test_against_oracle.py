"""simulate against the independent Newton-Euler solution in time."""

import numpy as np
import oracle
import pytest
from hilly_rows import hilly_row

import domino_env as de

AGREE = 1e-11  # relative, of times and velocities


def compare(spacing, thickness, *, rtol=AGREE, reach=1e-9, **given):
    """Topple both, hold all they say against each other; returns what simulate says."""
    slow = oracle.topple(spacing, thickness, **given)
    ground = {name: given[name] for name in ("rise", "tilt") if name in given}
    height, density = given.get("height", 0.048), given.get("density", 1040.0)
    layout = de.Layout(spacing, thickness, height, density=density, **ground)
    physics = de.Physics(
        given.get("friction", 0.25), given.get("gravity", 9.81), given.get("push", 8.0)
    )
    wave = de.simulate(layout, physics, rtol=1e-12)
    assert wave.outcome.name == slow.outcome
    assert (wave.hit, wave.toppled) == (slow.hit, slow.toppled)
    assert (wave.flushes, wave.releases) == (slow.flushes, slow.releases)
    assert wave.reach == pytest.approx(slow.reach, abs=reach)
    came, falls = len(slow.arrival), len(slow.release_velocity)
    np.testing.assert_allclose(wave.arrival_times[:came], slow.arrival, rtol=rtol, atol=0)
    np.testing.assert_allclose(wave.release_velocity[:falls], slow.release_velocity, rtol=rtol)
    np.testing.assert_allclose(wave.impact_velocity[: came - 1], slow.impact_velocity, rtol=rtol)
    np.testing.assert_allclose(wave.stall_margin[: len(slow.margin)], slow.margin, atol=1e-8)
    assert wave.largest_flush_loss == pytest.approx(slow.largest_flush_loss, abs=1e-10)
    # where the wave did not come
    assert np.isinf(wave.arrival_times[came:]).all()
    assert np.isnan(wave.release_velocity[falls:]).all()
    assert np.isnan(wave.impact_velocity[came - 1 :]).all()
    return wave


# rows drawn by chance ----------------------------------------------------------------------------


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


@pytest.mark.parametrize("seed", range(4))
def test_heights_up_and_down(seed):
    """A shorter domino follows wherever the gap lets the tip strike below its top."""
    rng = np.random.default_rng(200 + seed)
    height = 0.048 * rng.uniform(0.9, 1.1, 9)
    room = np.sqrt(np.maximum(height[:-1] ** 2 - height[1:] ** 2, 0.0))
    spacing = np.maximum(room * 1.001, rng.uniform(0.005, 0.03, 8))
    thickness = rng.uniform(0.005, 0.01, 9)
    compare(spacing, thickness, height=height, friction=0.3 * (seed % 2), push=16.0)


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("seed", [1, 2, 3, 5])
def test_over_hills(seed, friction):
    """Crests, hollows and steps; thin dominoes, which slip off, among them."""
    layout = hilly_row(seed, 9)
    row = layout.spacing, layout.thickness
    compare(*row, friction=friction, push=16.0, rise=layout.rise, tilt=layout.tilt)


@pytest.mark.parametrize("slope", [-0.12, 0.14])
def test_on_an_even_slope(slope):
    """Uphill this one dies."""
    rng = np.random.default_rng(7)
    spacing, thickness = rng.uniform(0.006, 0.034, 11), rng.uniform(0.007, 0.01, 12)
    rise = -(spacing + thickness[1:]) * np.sin(slope)
    compare(spacing, thickness, push=7.0, rise=rise, tilt=slope)


@pytest.mark.parametrize("name", ["sprint", "sprint-thickness", "ideal", "gentle"])
@pytest.mark.parametrize("seed", range(2))
def test_rows_within_the_bounds_of_a_scene(name, seed):
    """The first fourteen dominoes of a random layout, under the scene's physics."""
    scene = de.load_scene(name)
    rng = np.random.default_rng(300 + seed)
    thickness = np.full(14, scene.first_thickness)
    if scene.free_thickness:
        thickness[1:] = rng.uniform(*scene.thickness, 13)
    physics = scene.physics
    compare(
        rng.uniform(*scene.spacing, 13),
        thickness,
        height=scene.height,
        density=scene.density,
        friction=physics.friction,
        gravity=physics.gravity,
        push=physics.push,
    )


def test_a_longer_row():
    rng = np.random.default_rng(0)
    wave = compare(rng.uniform(0.004, 0.034, 24), np.full(25, 0.0075))
    assert wave.outcome is de.Outcome.PROPAGATED
    assert wave.flushes > 5


# switches ----------------------------------------------------------------------------------------


def test_a_run_of_equal_gaps_goes_flush_as_one():
    wave = compare(np.r_[np.full(8, 0.005), np.full(5, 0.020)], np.full(14, 0.0075), push=15.0)
    assert wave.flushes == 8


@pytest.mark.parametrize("friction", [0.0, 0.25])
@pytest.mark.parametrize("seed", range(3))
def test_gaps_on_a_grid(friction, seed):
    """Stretches of equal gaps, several of them flush at once, and again later."""
    rng = np.random.default_rng(400 + seed)
    gaps = np.repeat(rng.choice([0.004, 0.006, 0.012, 0.022], 6), rng.integers(1, 4, 6))
    wave = compare(gaps, np.full(len(gaps) + 1, 0.0075), friction=friction, push=13.0)
    assert wave.flushes > 2


@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_a_flush_at_the_very_angle_of_a_hit(friction):
    """Link 0 goes flush at θ_1 = acos(d/p), where domino 1 strikes if s_1 = √(p² - d²) L/p."""
    spacing = [0.005, 0.048 * 0.8, 0.02]
    wave = compare(spacing, np.full(4, 0.0075), friction=friction, push=18.0)
    assert wave.flushes >= 1


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3])
def test_releases_from_tip_and_from_corner(friction):
    spacing = [0.044, 0.012, 0.045, 0.030, 0.045, 0.002, 0.046, 0.020]
    wave = compare(spacing, np.full(9, 0.0075), friction=friction, push=24.0)
    assert wave.releases >= 2


def test_high_friction_and_large_flush_losses():
    spacing = [0.03, 0.002, 0.03, 0.002, 0.03, 0.03]
    wave = compare(spacing, np.full(7, 0.006), friction=0.6, push=20.0)
    assert wave.largest_flush_loss > 0.05


@pytest.mark.parametrize("factor", [1.2, 1.5])
def test_growing_dominoes(factor):
    scale = 0.048 * factor ** np.arange(8)
    compare(0.3 * scale[:-1], 0.15625 * scale, height=scale, push=9.0)


# how waves end -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("gap", "push", "leader"), [(0.005, 4.0, 1), (0.003, 6.0, 2), (0.009, 2.69, 0)]
)
def test_stalls_happen_under_the_same_leader(gap, push, leader):
    wave = compare(np.full(12, gap), np.full(13, 0.0075), friction=0.5, push=push)
    assert wave.outcome is de.Outcome.STALLED
    assert int(wave.reach * 13) == leader
    assert wave.hit == leader + 1
    assert wave.stall_margin[leader] == 0.0
    assert wave.mean_speed == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_stalls_of_random_rows(seed):
    """Narrow gaps wear a wave out somewhere; both see it die there."""
    rng = np.random.default_rng(500 + seed)
    gaps = np.r_[rng.uniform(0.01, 0.02, 4), rng.uniform(0.0005, 0.004, 8)]
    thickness = rng.uniform(0.009, 0.013, 13)
    wave = compare(gaps, thickness, friction=0.4, push=9.0)
    assert wave.outcome is de.Outcome.STALLED
    assert wave.hit > 4


@pytest.mark.parametrize("excess", [1e-2, 1e-4, -1e-4])
@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_on_either_side_of_a_stall(excess, friction):
    """A push a little above the smallest that topples the row, and one a little below."""
    gaps, thickness = np.array([0.012, 0.016, 0.009, 0.02, 0.011]), np.full(6, 0.0075)
    least = de.smallest_push(de.Layout(gaps, thickness), de.Physics(friction))
    wave = compare(gaps, thickness, friction=friction, push=least * (1.0 + excess), rtol=1e-10)
    assert (wave.outcome is de.Outcome.PROPAGATED) is (excess > 0.0)


def test_jamming_at_a_hit():
    thickness = [0.0075, 0.0075, 0.05, 0.05, 0.0075, 0.0075, 0.0075]
    wave = compare(np.full(6, 0.02), thickness, friction=1.0)
    assert wave.outcome is de.Outcome.JAMMED
    assert wave.hit == 3  # the third was struck in vain
    assert np.isfinite(wave.arrival_times[2])
    assert np.isnan(wave.release_velocity[2])


def test_jamming_at_a_flush():
    """A flush that would throw the leader back."""
    spacing, thickness = [0.005, 0.035, 0.03], [0.044, 0.025, 0.0115, 0.045]
    wave = compare(spacing, thickness, friction=0.5, push=25.0)
    assert wave.outcome is de.Outcome.JAMMED
    assert (wave.hit, wave.flushes) == (2, 1)
    assert 0.1 < wave.reach < 0.5


def test_out_of_reach():
    wave = compare([0.02, 0.02, 0.048, 0.02], np.full(5, 0.0075))
    assert wave.outcome is de.Outcome.OUT_OF_REACH
    assert (wave.hit, wave.toppled) == (3, 3)


def test_no_rigid_answer():
    """A heavy, thick domino wedged behind a thick one: the effective inertia falls to nothing."""
    wave = compare(
        [0.008, 0.021], [0.068, 0.045, 0.0075], density=[2600.0, 1000.0, 1000.0],
        friction=1.0, push=40.0, reach=1e-5,
    )  # fmt: skip
    assert wave.outcome is de.Outcome.NO_RIGID_ANSWER
    assert wave.mean_speed == 0.0


@pytest.mark.parametrize("seed", [1203, 1354])
def test_links_behind_a_release_are_not_counted_flush(seed):
    """What slips off takes the links behind it along as they are: once counted flush too soon."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 13))
    friction = rng.choice([0, 0.25, rng.uniform(0, 0.8)])
    wide = rng.random() < 0.6
    spacing = (
        rng.uniform(0.001, 0.047, count - 1)
        if wide
        else rng.choice([0.002, 0.005, 0.01, 0.02, 0.03], count - 1)
    )
    thick = rng.random() < 0.5
    thickness = rng.uniform(0.003, 0.02, count) if thick else np.full(count, 0.0075)
    push = rng.uniform(4, 40)
    density = rng.uniform(200, 4000, count) if rng.random() < 0.5 else np.full(count, 1040.0)
    wave = compare(spacing, thickness, friction=friction, push=push, density=density)
    assert wave.releases > 0
