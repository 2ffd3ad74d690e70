"""Laws that every row obeys, whatever the numbers."""

import numpy as np
import pytest

import domino_env as de


def random_row(seed, count=25):
    """A row in which every domino differs, with flushes and a release now and then."""
    rng = np.random.default_rng(seed)
    height = 0.048 * np.cumprod(rng.uniform(1.0, 1.05, count))
    spacing = rng.uniform(0.05, 0.8, count - 1) * height[:-1]
    thickness = rng.uniform(0.08, 0.2, count) * height
    return spacing, thickness, height, rng.uniform(500.0, 2000.0, count)


def topple(spacing, thickness, height, density, friction=0.25, gravity=9.81, push=15.0):
    layout = de.Layout(spacing, thickness, height, density=density)
    return de.simulate(layout, de.Physics(friction, gravity, push), rtol=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.25])
@pytest.mark.parametrize("seed", range(6))
class TestLaws:
    def test_lengths(self, seed, friction):
        """Lengths × k and push/√k give times × √k."""
        s, d, h, rho = random_row(seed)
        wave = topple(s, d, h, rho, friction)
        for k in (1e-3, 0.37, 1e4):
            other = topple(k * s, k * d, k * h, rho, friction, push=15.0 / np.sqrt(k))
            assert other.outcome is wave.outcome
            np.testing.assert_allclose(other.arrival_times, np.sqrt(k) * wave.arrival_times, 2e-12)

    def test_gravity(self, seed, friction):
        """Gravity × c and push × √c give times/√c."""
        row = random_row(seed)
        wave = topple(*row, friction)
        for c in (1e-6, 2.0, 1e3):
            other = topple(*row, friction, 9.81 * c, 15.0 * np.sqrt(c))
            np.testing.assert_allclose(other.arrival_times, wave.arrival_times / np.sqrt(c), 2e-12)

    def test_density(self, seed, friction):
        """A common factor on all densities changes nothing."""
        s, d, h, rho = random_row(seed)
        wave, other = topple(s, d, h, rho, friction), topple(s, d, h, 4.0 * rho, friction)
        np.testing.assert_array_equal(other.arrival_times, wave.arrival_times)

    def test_what_stands_later_changes_nothing_earlier(self, seed, friction):
        """To the last bit."""
        s, d, h, rho = random_row(seed)
        wave = topple(s, d, h, rho, friction)
        for count in (2, 9, 24):
            part = topple(s[: count - 1], d[:count], h[:count], rho[:count], friction)
            np.testing.assert_array_equal(part.arrival_times, wave.arrival_times[:count])


def energy(layout, wave, n, lead, speed, gravity):
    """Kinetic and potential energy of a stack in tip contact, from eqs. 1-2 alone."""
    theta, ratio = lead, 1.0
    total = 0.0
    for i in range(n, -1, -1):
        d, length = layout.thickness[i], layout.height[i]
        mass = layout.density[i] * d * length * layout.width
        inertia = mass * (length**2 + d**2) / 3.0
        lift = 0.5 * (length * np.cos(theta) + d * np.sin(theta))
        total += 0.5 * inertia * (ratio * speed) ** 2 + mass * gravity * lift
        if i > 0:
            p, height = layout.pitch[i - 1], layout.height[i - 1]
            delta = np.arcsin((p * np.cos(theta) - d) / height)
            ratio *= 1.0 - p / height * np.sin(theta) / np.cos(delta)
            theta += delta
    return total


def test_energy_is_kept_between_hits_without_friction():
    rng = np.random.default_rng(0)
    gaps = 0.022 - 0.002 * np.sort(rng.random(14))  # gaps that shrink do not go flush
    layout = de.Layout(gaps, 0.0075)
    wave = de.simulate(layout, de.Physics(0.0), rtol=1e-12)
    assert wave.flushes == 0
    for n in range(14):
        hit = np.arcsin(gaps[n] / 0.048)
        start = energy(layout, wave, n, 0.0, wave.release_velocity[n], 9.81)
        end = energy(layout, wave, n, hit, wave.impact_velocity[n], 9.81)
        assert end == pytest.approx(start, rel=1e-12)


def test_friction_only_takes_energy():
    layout = de.Layout(np.full(20, 0.02), 0.0075)
    wave = de.simulate(layout, de.Physics(0.3), rtol=1e-12)
    for n in range(1, 20):
        start = energy(layout, wave, n, 0.0, wave.release_velocity[n], 9.81)
        end = energy(layout, wave, n, np.arcsin(0.02 / 0.048), wave.impact_velocity[n], 9.81)
        assert end < start


@pytest.mark.parametrize("friction", [0.0, 0.25])
@pytest.mark.parametrize("gap", [0.004, 0.0085, 0.025, 0.044])
def test_the_uniform_path_is_the_general_one(gap, friction):
    """A row that is uniform to all but the last bit takes the general path."""
    count = 60
    density = np.full(count, 1040.0)
    density[-1] = np.nextafter(1040.0, 2000.0)
    physics = de.Physics(friction, 9.81, 15.0)
    uniform = de.simulate(de.Layout(np.full(count - 1, gap), 0.0075), physics, rtol=1e-11)
    general = de.simulate(
        de.Layout(np.full(count - 1, gap), 0.0075, density=density), physics, rtol=1e-11
    )
    assert uniform.outcome is general.outcome
    np.testing.assert_allclose(uniform.arrival_times, general.arrival_times, rtol=2e-11)
    np.testing.assert_allclose(uniform.stall_margin, general.stall_margin, rtol=1e-8)
