"""Laws that every row obeys, whatever the numbers."""

import numpy as np
import oracle
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


class TestLaterDominoes:
    """Nothing looks ahead: whatever stands later, what fell before is the same to the last bit."""

    @pytest.mark.parametrize("friction", [0.0, 0.25])
    @pytest.mark.parametrize("seed", range(4))
    def test_other_dominoes_later(self, seed, friction):
        s, d, h, rho = random_row(seed)
        wave = topple(s, d, h, rho, friction)
        s, d, rho = s.copy(), d.copy(), rho.copy()
        rng = np.random.default_rng(seed)
        s[15:] *= rng.uniform(0.8, 1.0, len(s[15:]))
        d[16:] *= rng.uniform(0.5, 1.5, len(d[16:]))
        rho[16:] *= rng.uniform(0.5, 1.5, len(rho[16:]))
        other = topple(s, d, h, rho, friction)
        assert wave.hit > 16
        np.testing.assert_array_equal(other.arrival_times[:16], wave.arrival_times[:16])
        np.testing.assert_array_equal(other.release_velocity[:15], wave.release_velocity[:15])
        np.testing.assert_array_equal(other.impact_velocity[:15], wave.impact_velocity[:15])
        np.testing.assert_array_equal(other.stall_margin[:15], wave.stall_margin[:15])
        assert other.arrival_times[17] != wave.arrival_times[17]

    def test_a_wave_that_dies_later(self):
        s, d, h, rho = random_row(0)
        wave = topple(s, d, h, rho)
        s = s.copy()
        s[12] = 1.5 * h[12]  # out of reach
        dead = topple(s, d, h, rho)
        assert dead.outcome is de.Outcome.OUT_OF_REACH
        np.testing.assert_array_equal(dead.arrival_times[:13], wave.arrival_times[:13])


class TestUnits:
    """A row told in other units of length, mass and time falls the same."""

    @pytest.mark.parametrize("friction", [0.0, 0.25])
    @pytest.mark.parametrize(
        ("metre", "kilogram", "second"),
        [(1e3, 1e3, 1e3), (1.0 / 0.0254, 2.2046, 1.0), (1.0 / 0.048, 7.0, 14.3)],
    )
    def test_other_units(self, metre, kilogram, second, friction):
        """The numbers of units in a metre, a kilogram and a second."""
        s, d, h, rho = random_row(11)
        wave = topple(s, d, h, rho, friction)
        other = topple(
            s * metre, d * metre, h * metre, rho * kilogram / metre**3, friction,
            9.81 * metre / second**2, 15.0 / second,
        )  # fmt: skip
        assert other.outcome is wave.outcome
        assert (other.flushes, other.releases) == (wave.flushes, wave.releases)
        np.testing.assert_allclose(other.arrival_times, wave.arrival_times * second, 2e-12)
        np.testing.assert_allclose(other.release_velocity * second, wave.release_velocity, 2e-12)


class Energies:
    """Energies of the stack under leader n, its contacts settled by geometry alone."""

    def __init__(self, layout, gravity=9.81):
        self.row = (layout.spacing, layout.thickness, layout.height, layout.density)
        self.gravity, self.pitch = gravity, layout.pitch

    def chain(self, n, lead, back):
        """A link is a corner where the lean of the next has passed acos(d/p)."""
        chain = oracle.Chain(*self.row, 0.0, self.gravity)
        for i in range(n - 1, back - 1, -1):
            chain.back = i + 1
            if chain.angles(n, lead)[0] > np.arccos(chain.d[i + 1] / self.pitch[i]):
                chain.state[i] = oracle.CORNER
        chain.back = back
        return chain

    def of(self, n, lead, speed, back=0):
        """(kinetic, potential)."""
        chain = self.chain(n, lead, back)
        theta = chain.angles(n, lead)
        omega = chain.ratios(chain.contacts(n, theta)) * speed
        stack = slice(back, n + 1)
        centre = np.hypot(chain.height, chain.d)[stack] * np.cos(theta - chain.tipping[stack]) / 2.0
        kinetic = 0.5 * (chain.inertia[stack] * omega**2).sum()
        return kinetic, (chain.mass[stack] * self.gravity * centre).sum()


def test_energy_is_kept_between_hits_without_friction():
    rng = np.random.default_rng(0)
    gaps = 0.022 - 0.002 * np.sort(rng.random(14))  # gaps that shrink do not go flush
    layout = de.Layout(gaps, 0.0075)
    wave = de.simulate(layout, de.Physics(0.0), rtol=1e-12)
    assert wave.flushes == 0
    energies = Energies(layout)
    for n in range(14):
        hit = np.arcsin(gaps[n] / 0.048)
        start = sum(energies.of(n, 0.0, wave.release_velocity[n]))
        end = sum(energies.of(n, hit, wave.impact_velocity[n]))
        assert end == pytest.approx(start, rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_flushes_take_energy_and_nothing_else_does_without_friction(seed):
    """Kept to rounding in falls in which no link goes flush, lost in those in which one does."""
    rng = np.random.default_rng(seed)
    gaps = rng.uniform(0.003, 0.03, 16)
    layout = de.Layout(gaps, 0.0075)
    wave = de.simulate(layout, de.Physics(0.0, push=12.0), rtol=1e-12)
    assert wave.outcome is de.Outcome.PROPAGATED
    assert wave.releases == 0
    energies, flushes, kept = Energies(layout), 0, 0
    for n in range(16):
        hit = np.arcsin(gaps[n] / 0.048)
        corners = [
            int((energies.chain(n, lead, 0).state == oracle.CORNER).sum()) for lead in (0.0, hit)
        ]
        start = sum(energies.of(n, 0.0, wave.release_velocity[n]))
        end = sum(energies.of(n, hit, wave.impact_velocity[n]))
        flushes += corners[1] - corners[0]
        if corners[1] == corners[0]:
            kept += 1
            assert end == pytest.approx(start, rel=1e-11)
        else:
            assert end < start * (1.0 - 1e-9)
    assert 0 < kept < 16
    last = energies.chain(16, np.arctan2(0.0075, 0.048), 0).state
    assert flushes > 0
    assert (last == oracle.CORNER).sum() == wave.flushes


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_friction_only_takes_energy(friction):
    layout = de.Layout(np.full(20, 0.02), 0.0075)
    wave = de.simulate(layout, de.Physics(friction), rtol=1e-12)
    energies = Energies(layout)
    for n in range(1, 20):
        start = sum(energies.of(n, 0.0, wave.release_velocity[n]))
        end = sum(energies.of(n, np.arcsin(0.02 / 0.048), wave.impact_velocity[n]))
        assert end < start


@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_hits_take_kinetic_energy(friction):
    layout = de.Layout(np.full(12, 0.02), 0.0075)
    wave = de.simulate(layout, de.Physics(friction), rtol=1e-12)
    energies = Energies(layout)
    for n in range(12):
        before, _ = energies.of(n, np.arcsin(0.02 / 0.048), wave.impact_velocity[n])
        after, _ = energies.of(n + 1, 0.0, wave.release_velocity[n + 1])
        assert 0.0 < after < before


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
