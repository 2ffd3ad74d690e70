"""Laws that every chain obeys, whatever the numbers."""

from dataclasses import replace

import numpy as np
import pytest
from uneven_layouts import uneven_layout

import domino_env as de
from domino_env.physics.motion import stack_sums

frictions = pytest.mark.parametrize("friction", [0.0, 0.25])
grounds = pytest.mark.parametrize("uneven", [False, True], ids=["flat", "uneven"])


def random_layout(seed, uneven, count=25):
    """Return a layout of unequal dominoes, with face impacts and sometimes a separation."""
    if uneven:
        return uneven_layout(seed, count, unequal=True)
    rng = np.random.default_rng(seed)
    height = 0.048 * np.cumprod(rng.uniform(1.0, 1.05, count))
    spacing = rng.uniform(0.05, 0.8, count - 1) * height[:-1]
    thickness = rng.uniform(0.08, 0.2, count) * height
    return de.Layout(spacing, thickness, height, density=rng.uniform(500.0, 2000.0, count))


def topple(layout, friction, gravity=9.81, push=16.0):
    return de.simulate(layout, de.Physics(friction, gravity, push), rtol=1e-12)


@grounds
@frictions
@pytest.mark.parametrize("seed", range(4))
def test_results_scale_with_the_units(seed, friction, uneven):
    """Numbers of other units in a metre, a kilogram and a second; scaling laws among them."""
    layout = random_layout(seed, uneven)
    wave = topple(layout, friction)
    for metre, kilogram, second in (
        (1e3, 1e9, np.sqrt(1e3)),  # lengths × k and push/√k: times × √k
        (1e-4, 1e-12, 1e-2),
        (1.0, 1.0, 1e3),  # gravity × c and push × √c: times/√c
        (1.0, 1.0, 0.03),
        (1.0 / 0.0254, 2.2046, 1.0),
        (1.0 / 0.048, 7.0, 14.3),
    ):
        names = "spacing", "thickness", "height", "rise"
        lengths = {name: getattr(layout, name) * metre for name in names}
        scaled = topple(
            replace(layout, **lengths, density=layout.density * kilogram / metre**3),
            friction, 9.81 * metre / second**2, 16.0 / second,
        )  # fmt: skip
        assert scaled.outcome is wave.outcome
        assert (scaled.flushes, scaled.releases) == (wave.flushes, wave.releases)
        np.testing.assert_allclose(scaled.arrival_times, wave.arrival_times * second, 2e-12)
        np.testing.assert_allclose(scaled.release_velocity * second, wave.release_velocity, 2e-12)
    scaled = topple(replace(layout, density=4.0 * layout.density), friction)
    np.testing.assert_array_equal(scaled.arrival_times, wave.arrival_times)


@grounds
@frictions
@pytest.mark.parametrize("seed", range(4))
def test_later_dominoes_change_nothing_earlier(seed, friction, uneven):
    """To the last bit, whether they differ, are missing or out of reach."""
    layout, rng = random_layout(seed, uneven), np.random.default_rng(seed)
    wave = topple(layout, friction)
    assert wave.hit > 8
    last = min(16, wave.hit - 2)
    for n in (2, 7, last):
        sizes = {name: getattr(layout, name)[:n] for name in ("thickness", "height", "density")}
        pairs = {name: getattr(layout, name)[: n - 1] for name in ("spacing", "rise")}
        first = topple(de.Layout(**sizes, **pairs, tilt=layout.tilt[:n]), friction)
        np.testing.assert_array_equal(first.arrival_times, wave.arrival_times[:n])
    names = "thickness", "density", "spacing"
    thickness, density, spacing = (getattr(layout, name).copy() for name in names)
    density[last:] *= rng.uniform(0.5, 1.5, len(density[last:]))
    thickness[last:] *= rng.uniform(0.5, 1.5, len(thickness[last:])) if not uneven else 1.0
    spacing[last - 1] = 1.5 * layout.height[last - 1]
    different = replace(layout, thickness=thickness, density=density)
    for changed in (different, replace(layout, spacing=spacing)):
        changed_wave = topple(changed, friction)
        np.testing.assert_array_equal(changed_wave.arrival_times[:last], wave.arrival_times[:last])
        for name in ("release_velocity", "impact_velocity", "stall_margin"):
            values = [getattr(one, name)[: last - 1] for one in (changed_wave, wave)]
            np.testing.assert_array_equal(*values)
        assert changed_wave.arrival_times[last + 1] != wave.arrival_times[last + 1]
    assert changed_wave.outcome is de.Outcome.OUT_OF_REACH


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("seed", range(3))
def test_impacts_and_friction_take_energy(seed, friction):
    """Without friction only impacts take energy; friction takes it in every fall."""
    gaps = np.random.default_rng(seed).uniform(0.003, 0.03, 16)
    layout = de.Layout(gaps, 0.0075)
    wave = de.simulate(layout, de.Physics(friction, push=20.0), rtol=1e-12)
    assert wave.outcome is de.Outcome.PROPAGATED
    assert wave.releases == 0

    def energies(first, angle, speed):
        """Return kinetic and total energy of the stacks of 16 leaders."""
        released, inertia = stack_sums(layout, first + np.arange(16), angle, 1e-5, 1e-5)
        kinetic = 0.5 * inertia * speed**2
        return kinetic, kinetic - 9.81 * released

    _, start = energies(0, np.zeros(16), wave.release_velocity[:16])
    kinetic, end = energies(0, np.arcsin(gaps / 0.048), wave.impact_velocity)
    struck, _ = energies(1, np.zeros(16), wave.release_velocity[1:])
    assert ((struck > 0.0) & (struck < kinetic)).all()
    loss = (start - end) / kinetic
    conserved = np.abs(loss) < 1e-8
    if friction:
        assert (loss[1:] > 1e-8).all()  # no stack is behind the first domino
    else:
        assert 0 < conserved.sum() < 16
        assert (loss[~conserved] > 0.0).all()
        assert (~conserved).sum() <= wave.flushes
