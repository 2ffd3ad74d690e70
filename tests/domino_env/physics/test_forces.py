"""Contact forces, impulses and floor reactions against the oracle's dense solves."""

import numpy as np
import oracle
import pytest
from uneven_layouts import uneven_layout

import domino_env as de
from domino_env import kernels
from domino_env.kernels import contact, diagnosis
from domino_env.kernels.jit import entry_point

COUNT, GRAVITY = 7, 9.81


@entry_point
def place_all(ring, arrays):
    for i in range(len(arrays.thickness)):
        contact.place_domino(ring, len(ring) - 1, i, arrays, i)
    for i in range(len(arrays.spacing)):
        contact.place_contact(ring, len(ring) - 1, i, arrays, i, i + 1)


@entry_point
def loads_at(arrays, ring, states, n, angle, geometry, loads):
    diagnosis.stack_geometry(arrays, ring, states[0], n, 0, angle, geometry, False)
    diagnosis.contact_forces(arrays, ring, states[0], n, 0, geometry, loads)


@entry_point
def impulses_at(arrays, ring, states, n, before, after, geometry, least):
    diagnosis.stack_geometry(arrays, ring, states[0], n, 0, 0.0, geometry, False)
    diagnosis.contact_impulses(ring, states[0], n, 0, geometry, before, after, least)


def stacks(seed, friction, uneven):
    """Return the same chain in the kernels' ring and as the oracle's chain."""
    rng = np.random.default_rng(seed)
    spacing, thickness = rng.uniform(0.01, 0.03, COUNT - 1), rng.uniform(0.005, 0.01, COUNT)
    density = rng.uniform(500.0, 2000.0, COUNT)
    rise, tilt = rng.uniform(-0.001, 0.002, COUNT - 1), rng.uniform(-0.05, 0.05, COUNT)
    arrays = spacing, thickness, np.full(COUNT, 0.048), density
    ground = (uneven * rise, uneven * tilt)
    arrays = kernels.Arrays(*arrays, *ground) if uneven else kernels.Arrays(*arrays)
    ring = np.zeros(8, kernels.UNEVEN_CONTACT if uneven else kernels.CONTACT)
    place_all(ring, arrays)
    chain = oracle.Chain(
        spacing, thickness, 0.048, density, friction, GRAVITY, 1.0, ground[0], ground[1]
    )
    return arrays, ring, chain


@pytest.mark.parametrize("uneven", [False, True])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(2))
def test_forces_at_one_instant_and_impulses_of_a_hit(seed, friction, uneven):
    arrays, ring, chain = stacks(seed, friction, uneven)
    n, angle, speed = COUNT - 1, 0.05, 6.0
    geometry, loads = np.zeros(COUNT, diagnosis.GEOMETRY), np.full(COUNT, np.inf, diagnosis.LOADS)
    loads["floor_friction"] = -np.inf
    states = np.zeros(1, kernels.STATE)
    states[["mask", "mu", "gravity", "u"]] = len(ring) - 1, friction, GRAVITY, speed**2
    loads_at(arrays, ring, states, n, angle, geometry, loads)
    angle += chain.stand[n]
    alpha, normals, _ = chain.motion(n, angle, speed)
    np.testing.assert_allclose(loads["contact_force"][:-1], normals, rtol=1e-9)

    # the floor: Newton's second law of each centre of mass
    theta = chain.angles(n, angle)
    contacts = chain.contacts(n, theta)
    omega = chain.ratios(contacts) * speed
    up, ahead = oracle.up(theta), oracle.ahead(theta)
    arm = 0.5 * (arrays.height[:, None] * up - arrays.thickness[:, None] * ahead)
    turned = np.stack([arm[:, 1], -arm[:, 0]], -1)
    floor = chain.mass[:, None] * (alpha[:, None] * turned - omega[:, None] ** 2 * arm)
    floor[:, 1] += chain.mass * GRAVITY
    onward = normals[:, None] * (contacts.normal - friction * contacts.along)  # tips slide down
    floor[:-1] += onward
    floor[1:] -= onward
    along = oracle.dot(floor, oracle.ahead(chain.stand))
    upright = oracle.dot(floor, oracle.up(chain.stand))
    load = upright / (chain.mass * GRAVITY)
    np.testing.assert_allclose(loads["load"], load, rtol=1e-8, atol=1e-9)
    pressed = load > 0.0
    need = np.abs(along) / upright
    np.testing.assert_allclose(loads["floor_friction"][pressed], need[pressed], rtol=1e-8)
    assert np.isinf(loads["floor_friction"][~pressed]).all()

    # the hit of domino n
    theta = chain.angles(n, chain.stand[n])
    omega = chain.ratios(chain.contacts(n, theta)) * 9.0
    omega[-1] = 0.0
    after, impulses = chain.impact(n, theta, omega, chain.state)
    least = np.full(COUNT, np.inf)
    impulses_at(arrays, ring, states, n, 9.0, after[-1], geometry, least)
    np.testing.assert_allclose(least[:-1], impulses, rtol=1e-9)


@pytest.mark.parametrize("friction", [0.0, 0.25])
@pytest.mark.parametrize(
    "layout",
    [de.Layout(np.random.default_rng(0).uniform(0.002, 0.04, 29), 0.0075), uneven_layout(3, 12)],
    ids=["flat", "uneven"],
)
def test_a_diagnosis_agrees_with_the_wave(layout, friction):
    physics = de.Physics(friction, push=8.0 if layout.count > 12 else 14.0)
    wave, found = de.simulate(layout, physics, rtol=1e-10), de.diagnose(layout, physics)
    assert found.outcome is wave.outcome
    np.testing.assert_allclose(found.stall_margin, wave.stall_margin, rtol=1e-6)
    assert found.flush_loss.max() == pytest.approx(wave.largest_flush_loss, rel=1e-6, abs=1e-12)
    assert found.least_contact_force.shape == (layout.count - 1,)
    assert found.floor_friction.shape == (layout.count,)
    if friction > 0.0 and layout.count > 12:  # nearly every face impact would open a contact
        assert len(found.opened) > 0


def test_a_uniform_layout_keeps_its_contacts_closed_and_what_was_not_reached_is_nan():
    found = de.diagnose(de.Layout.uniform(40, pitch=0.024), de.Physics())
    assert len(found.opened) == 0
    assert len(found.lifted) == 0
    assert np.nanmax(found.floor_friction) < 1.0
    assert np.isnan(found.least_flush_impulse).all()
    found = de.diagnose(de.Layout.uniform(20, spacing=0.004), de.Physics(push=3.0))
    assert found.outcome is de.Outcome.STALLED
    assert np.isnan(found.least_load[-1])
    assert np.isnan(found.least_contact_force[-1])
