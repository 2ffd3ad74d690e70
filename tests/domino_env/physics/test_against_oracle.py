"""Waves compared with the independent Newton-Euler solution."""

import numpy as np
import oracle
import pytest
from uneven_layouts import uneven_layout

import domino_env as de

AGREE = 1e-11  # relative, of times and velocities
D, H = 0.0075, 0.048


def compare(layout, physics, *, rtol=AGREE, reach=1e-9, slow=None):
    """Simulate with both, compare all results; return that of `simulate`."""
    if slow is None:
        slow = oracle.topple(
            layout.spacing, layout.thickness, physics.friction, physics.gravity, physics.push,
            layout.height, layout.density, rise=layout.rise, tilt=layout.tilt,
        )  # fmt: skip
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
    if slow.outcome == "PROPAGATED" and came > 1:
        assert wave.mean_speed == layout.length / wave.arrival_times[-1]
        assert wave.error_estimate > 0.0
        assert wave.converged == (wave.error_estimate <= wave.rtol)
    # dominoes that the wave did not reach
    assert np.isinf(wave.arrival_times[came:]).all()
    assert np.isnan(wave.release_velocity[falls:]).all()
    assert np.isnan(wave.impact_velocity[came - 1 :]).all()
    return wave


# random layouts ----------------------------------------------------------------------------------


def gaps_alone(rng):
    return de.Layout(rng.uniform(0.002, 0.034, 9), D), 11.0


def all_different(rng):
    """Heights such that every tip strikes a face."""
    height = H * np.cumprod(rng.uniform(1.0, 1.15, 10))
    gaps, thick = rng.uniform(0.1, 0.8, 9) * height[:-1], rng.uniform(0.08, 0.25, 10) * height
    return de.Layout(gaps, thick, height, density=rng.uniform(400.0, 2500.0, 10)), 14.0


def up_and_down(rng):
    """A shorter domino follows wherever the gap lets the tip strike below its top."""
    height = H * rng.uniform(0.9, 1.1, 9)
    room = np.sqrt(np.maximum(height[:-1] ** 2 - height[1:] ** 2, 0.0))
    gaps = np.maximum(room * 1.001, rng.uniform(0.005, 0.03, 8))
    return de.Layout(gaps, rng.uniform(0.005, 0.01, 9), height), 16.0


def equal_stretches(rng):
    """Several contacts close at once, and again later."""
    gaps = np.repeat(rng.choice([0.004, 0.006, 0.012, 0.022], 6), rng.integers(1, 4, 6))
    return de.Layout(gaps, D), 13.0


def equal_gaps(rng):
    """Uniform chains take a path of their own through the kernels."""
    return de.Layout.uniform(10, spacing=rng.choice([0.0085, 0.025])), 13.0


def uneven_ground(rng):
    """Crests, hollows and steps; thin dominoes, which slip off, among them."""
    return uneven_layout(int(rng.integers(1, 6)), 9), 16.0


@pytest.mark.parametrize("friction", [0.0, 0.25, 0.5])
@pytest.mark.parametrize(
    "draw", [gaps_alone, all_different, up_and_down, equal_stretches, equal_gaps, uneven_ground]
)
def test_random_layouts_agree_with_the_oracle(draw, friction):
    layout, push = draw(np.random.default_rng([0, round(100 * friction)]))
    compare(layout, de.Physics(friction, push=push))


@pytest.mark.parametrize("slope", [-0.12, 0.14])
def test_a_slope_is_level_ground_under_turned_gravity(slope):
    """On the uphill slope the wave stops."""
    rng = np.random.default_rng(7)
    gaps, thick = rng.uniform(0.006, 0.034, 11), rng.uniform(0.007, 0.01, 12)
    layout = de.Layout(gaps, thick, rise=-(gaps + thick[1:]) * np.sin(slope), tilt=slope)
    compare(layout, de.Physics(push=7.0), slow=oracle.topple(gaps, thick, push=7.0, turned=slope))
    np.testing.assert_allclose(layout.positions, de.Layout(gaps, thick).positions, rtol=1e-12)


# events ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("gaps", "thickness", "push", "frictions", "flushes", "releases"), [
    pytest.param([*[0.005] * 8, *[0.020] * 5], D, 15.0, (0.25,), 8, 0, id="eight at once"),
    # contact 0 closes at θ_1 = acos(d/p), where domino 1 strikes if s_1 = √(p² - d²) L/p
    pytest.param([0.005, H * 0.8, 0.02], D, 18.0, (0.0, 0.25), 1, 0, id="at a hit"),
    pytest.param(
        [0.044, 0.012, 0.045, 0.030, 0.045, 0.002, 0.046, 0.020], D, 24.0, (0.0, 0.3),
        0, 2, id="separation from tip and from corner",
    ),
    pytest.param(
        [0.03, 0.002, 0.03, 0.002, 0.03, 0.03], 0.006, 20.0, (0.6,), 1, 0, id="large losses"
    ),
])  # fmt: skip
def test_face_impacts_and_separations(gaps, thickness, push, frictions, flushes, releases):
    for friction in frictions:
        wave = compare(de.Layout(gaps, thickness), de.Physics(friction, push=push))
        assert wave.flushes >= flushes
        assert wave.releases >= releases
        if friction == 0.6:
            assert wave.largest_flush_loss > 0.05


@pytest.mark.parametrize("seed", [1203, 1354])
def test_contacts_behind_a_separation_are_not_counted_as_face_contacts(seed):
    """They keep their state as they leave: once a face contact was counted too soon."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(4, 13))
    friction = rng.choice([0, 0.25, rng.uniform(0, 0.8)])
    kinds, wide = [0.002, 0.005, 0.01, 0.02, 0.03], rng.random() < 0.6
    spacing = rng.uniform(0.001, 0.047, count - 1) if wide else rng.choice(kinds, count - 1)
    thickness = rng.uniform(0.003, 0.02, count) if rng.random() < 0.5 else np.full(count, D)
    push = rng.uniform(4, 40)
    density = rng.uniform(200, 4000, count) if rng.random() < 0.5 else np.full(count, 1040.0)
    layout = de.Layout(spacing, thickness, density=density)
    assert compare(layout, de.Physics(friction, push=push)).releases > 0


# how waves end -----------------------------------------------------------------------------------


@pytest.mark.parametrize("excess", [1e-2, 1e-4, -1e-4])
@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_waves_close_to_a_stall_agree_with_the_oracle(excess, friction):
    """A push a little above the smallest that topples the chain, and one a little below."""
    layout = de.Layout([0.012, 0.016, 0.009, 0.02, 0.011], D)
    push = de.smallest_push(layout, de.Physics(friction)) * (1.0 + excess)
    wave = compare(layout, de.Physics(friction, push=push), rtol=1e-10)
    assert (wave.outcome is de.Outcome.PROPAGATED) is (excess > 0.0)


@pytest.mark.parametrize(("outcome", "layout", "physics", "hit"), [
    (  # the hit does not move the third domino
        "JAMMED", de.Layout(np.full(6, 0.02), [D, D, 0.05, 0.05, D, D, D]), de.Physics(1.0), 3,
    ),
    (  # a face impact that would reverse the leader
        "JAMMED", de.Layout([0.005, 0.035, 0.03], [0.044, 0.025, 0.0115, 0.045]),
        de.Physics(0.5, push=25.0), 2,
    ),
    ("STALLED", de.Layout(np.full(12, 0.005), D), de.Physics(0.5, push=4.0), 2),
    ("STALLED", de.Layout(np.full(12, 0.003), D), de.Physics(0.5, push=6.0), 3),
    ("STALLED", de.Layout(np.full(12, 0.009), D), de.Physics(0.5, push=2.69), 1),
    ("OUT_OF_REACH", de.Layout([0.02, 0.02, H, 0.02], D), de.Physics(), 3),
    (  # a heavy, thick domino behind a thick one: the effective inertia falls to nothing
        "NO_RIGID_ANSWER",
        de.Layout([0.008, 0.021], [0.068, 0.045, D], density=[2600.0, 1000.0, 1000.0]),
        de.Physics(1.0, push=40.0), 2,
    ),
])  # fmt: skip
def test_other_outcomes_agree_with_the_oracle(outcome, layout, physics, hit):
    wave = compare(layout, physics, reach=1e-5 if outcome == "NO_RIGID_ANSWER" else 1e-9)
    assert (wave.outcome.name, wave.hit, wave.mean_speed) == (outcome, hit, 0.0)
    assert wave.explanation
