"""Waves compared with numbers that were computed independently, measured, or published."""

import numpy as np
import pytest

import domino_env as de

# pitch [m], friction, frequency [1/s], speed [m/s], ω after and before a hit, time of the 100th
UNIFORM = [
    (0.016, 0.00, 86.25528, 1.38008, 13.63153, 17.24773, 1.267629),
    (0.024, 0.00, 51.41199, 1.23389, 14.82572, 21.74023, 2.008020),
    (0.032, 0.00, 36.18886, 1.15804, 14.79539, 24.80159, 2.795324),
    (0.016, 0.25, 59.87259, 0.957961, 9.21285, 12.30576, 1.746404),
    (0.024, 0.25, 37.22842, 0.893482, 10.32537, 16.38651, 2.715589),
    (0.032, 0.25, 26.25904, 0.840289, 10.18480, 19.00991, 3.802060),
]


@pytest.mark.parametrize("known", UNIFORM)
def test_uniform_chains_have_the_independently_computed_speeds(known):
    pitch, friction, frequency, speed, after, before, last = known
    physics = de.Physics(friction, gravity=9.8, push=5.0 * np.pi)
    wave = de.simulate(de.Layout.uniform(100, pitch=pitch), physics, rtol=1e-11)
    between = wave.arrival_times[99] - wave.arrival_times[98]
    assert 1.0 / between == pytest.approx(frequency, abs=6e-6)
    assert pitch / between == pytest.approx(speed, abs=6e-6)
    assert wave.release_velocity[98] == pytest.approx(after, abs=6e-6)
    assert wave.impact_velocity[98] == pytest.approx(before, abs=6e-6)
    assert wave.arrival_times[99] == pytest.approx(last, abs=6e-7)


@pytest.mark.parametrize(
    ("rise", "friction", "ratio", "error"), [(0.0, 0.0, 0.5, 1e-13), (0.01, 0.25, 0.4344, 5e-5)]
)
def test_the_first_hit_has_the_known_velocity_ratio(rise, friction, ratio, error):
    """Equal dominoes lose half the energy; a tread 10 mm higher has a known ratio of velocities."""
    layout = de.Layout([0.0165], 0.0075) if rise == 0.0 else de.Layout([0.02], 0.0075, rise=rise)
    wave = de.simulate(layout, de.Physics(friction), rtol=1e-12)
    kept = wave.release_velocity[1] / wave.impact_velocity[0]
    kept = kept if rise else 2.0 * kept**2
    assert kept == pytest.approx(ratio, abs=error)


# the gap, over the height, at which the largest factor is carried
@pytest.mark.parametrize(("friction", "limit", "gap"), [(0.0, 1.775, 0.963), (0.25, 1.541, 0.82)])
def test_dominoes_can_grow_up_to_a_known_factor(friction, limit, gap):
    """No gap carries a growth by the limit, thickness/height 0.15625; a gap carries a little less.

    Widths grow too, so masses grow as the cube; layouts have one width, so densities grow instead.
    """

    def outcome(factor, gap):
        scale = 0.048 * factor ** np.arange(14)
        density = 1040.0 * scale / 0.048
        layout = de.Layout(gap * scale[:-1], 0.15625 * scale, scale, density=density)
        return de.simulate(layout, de.Physics(friction, 9.81, 300.0)).outcome

    assert outcome(limit - 0.002, gap) is de.Outcome.PROPAGATED
    for any_gap in np.linspace(0.05, 0.9995, 400):
        assert outcome(limit, any_gap) is not de.Outcome.PROPAGATED


@pytest.mark.parametrize("slender", [0.05, 0.15625, 0.25, 0.35])
def test_the_steady_wave_without_friction_exists_up_to_a_pitch(slender):
    """van Leeuwen 2004, eq. 79: d/λ < (1-a²)/(1+a²), within 0.2 %; equivalent to Δh > 0."""
    limit = (1.0 - slender**2) / (1.0 + slender**2)
    assert de.existence_limit(slender, 1.0) == pytest.approx(limit, rel=2e-3)
    for ratio, exists in ((0.997 * limit, True), (1.003 * limit, False)):
        assert de.steady_wave(slender / ratio, slender, 1.0, de.Physics(0.0)).exists is exists


@pytest.mark.parametrize(
    ("gap", "speed"), [(0.1, 2.261), (0.2, 1.968), (0.4, 1.757), (0.6, 1.641), (0.833, 1.540)]
)
def test_steady_speeds_match_van_leeuwens_program(gap, speed):
    """v/√(gL) without friction, thickness/height 0.15625."""
    steady = de.steady_wave(gap + 0.15625, 0.15625, 1.0, de.Physics(0.0, 1.0))
    assert steady.speed == pytest.approx(speed, abs=0.0016)


@pytest.mark.parametrize(("slender", "ratio"), [(0.01, 1.4999), (0.15625, 1.4767)])
def test_the_second_domino_topples_from_a_known_gap_on(slender, ratio):
    """USA Physics Olympiad 2017, B1: with the least push, s ≥ 1.5 d for thin dominoes."""

    def second_topples(gap):
        layout = de.Layout([gap], [slender, slender], 1.0)
        least = np.sqrt(3.0 * 9.81 * (np.hypot(1.0, slender) - 1.0) / (1.0 + slender**2))
        push = least * (1.0 + 1e-9)
        return de.simulate(layout, de.Physics(0.0, 9.81, push)).outcome is de.Outcome.PROPAGATED

    low, high = slender, 3.0 * slender
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if second_topples(middle) else (middle, high)
    assert high / slender == pytest.approx(ratio, abs=2e-3)
