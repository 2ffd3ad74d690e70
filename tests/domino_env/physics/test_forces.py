"""Contact forces, impulses and floor reactions against the oracle's dense solves."""

import numpy as np
import oracle
import pytest
from uneven_layouts import uneven_layout

import domino_env as de

COUNT, GRAVITY = 5, 9.81


def reactions(chain, n, lead, speed):
    """Return normal forces of the contacts, loads of the floor over the weight, friction needed."""
    alpha, normals, _ = chain.motion(n, lead, speed)
    theta, stand, mass = chain.angles(n, lead), chain.stand[: n + 1], chain.mass[: n + 1]
    contacts = chain.contacts(n, theta)
    omega = chain.ratios(contacts) * speed
    height, thickness = chain.height[: n + 1, None], chain.d[: n + 1, None]
    arm = 0.5 * (height * oracle.up(theta) - thickness * oracle.ahead(theta))
    turned = np.stack([arm[:, 1], -arm[:, 0]], -1)
    # Newton's second law of each centre of mass
    floor = mass[:, None] * (alpha[:, None] * turned - omega[:, None] ** 2 * arm)
    floor[:, 1] += mass * GRAVITY
    onward = normals[:, None] * (contacts.normal - chain.friction * contacts.along)
    floor[:-1] += onward  # tips slide down
    floor[1:] -= onward
    along, upright = (oracle.dot(floor, way(stand)) for way in (oracle.ahead, oracle.up))
    needed = np.where(upright > 0.0, np.abs(along) / np.abs(upright), np.inf)
    return normals, upright / (mass * GRAVITY), needed


@pytest.mark.parametrize(("friction", "uneven"), [(0.0, False), (0.3, True)])
def test_forces_and_impulses_agree_with_the_oracle(friction, uneven):
    """At 17 angles of each interval between hits, and in the hits."""
    rng = np.random.default_rng(0)
    gaps, thickness = rng.uniform(0.018, 0.028, COUNT - 1), rng.uniform(0.006, 0.01, COUNT)
    density = rng.uniform(500.0, 2000.0, COUNT)
    rise = uneven * rng.uniform(-0.001, 0.002, COUNT - 1)
    tilt = uneven * rng.uniform(-0.05, 0.05, COUNT)
    layout = de.Layout(gaps, thickness, density=density, rise=rise, tilt=tilt)
    physics = de.Physics(friction, GRAVITY, push=14.0)
    wave = de.simulate(layout, physics, rtol=1e-12)
    diagnosis = de.diagnose(layout, physics, rtol=1e-12)
    assert (wave.outcome.name, wave.flushes, wave.releases) == ("PROPAGATED", 0, 0)
    sizes = gaps, thickness, layout.height, density
    chain = oracle.Chain(*sizes, friction, GRAVITY, layout.width, rise, tilt)
    ends = np.append(tilt[1:] + np.arcsin(gaps / layout.height[:-1]), chain.tipping[-1])
    force, impulse = np.full((2, COUNT - 1), np.inf)
    load, needed = np.full(COUNT, np.inf), np.zeros(COUNT)
    for n in range(COUNT):
        lead, speed = tilt[n], wave.release_velocity[n]
        for goal in np.linspace(lead, ends[n], 17):
            if goal > lead:
                lead, speed, *_ = oracle.advance(chain, n, lead, speed, goal, 1e-10)
            forces, loads, frictions = reactions(chain, n, lead, speed)
            force[:n] = np.minimum(force[:n], forces)
            load[: n + 1] = np.minimum(load[: n + 1], loads)
            needed[: n + 1] = np.maximum(needed[: n + 1], frictions)
        if n + 1 < COUNT:
            theta = chain.angles(n, lead)
            omega = chain.ratios(chain.contacts(n, theta)) * speed
            struck = np.append(theta, tilt[n + 1]), np.append(omega, 0.0)
            _, impulses = chain.impact(n + 1, *struck, chain.state)
            impulse[: n + 1] = np.minimum(impulse[: n + 1], impulses)
    np.testing.assert_allclose(diagnosis.least_contact_force, force, rtol=1e-7)
    np.testing.assert_allclose(diagnosis.least_hit_impulse, impulse, rtol=1e-7)
    np.testing.assert_allclose(diagnosis.least_load, load, rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(diagnosis.floor_friction, needed, rtol=1e-7)


@pytest.mark.parametrize("friction", [0.0, 0.25])
@pytest.mark.parametrize(
    "layout",
    [de.Layout(np.random.default_rng(0).uniform(0.002, 0.04, 29), 0.0075), uneven_layout(3, 12)],
    ids=["flat", "uneven"],
)
def test_a_diagnosis_agrees_with_the_wave(layout, friction):
    physics = de.Physics(friction, push=8.0 if layout.count > 12 else 14.0)
    wave, diagnosis = de.simulate(layout, physics, rtol=1e-10), de.diagnose(layout, physics)
    assert diagnosis.outcome is wave.outcome
    np.testing.assert_allclose(diagnosis.stall_margin, wave.stall_margin, rtol=1e-6)
    assert diagnosis.flush_loss.max() == pytest.approx(wave.largest_flush_loss, rel=1e-6, abs=1e-12)
    assert diagnosis.least_contact_force.shape == (layout.count - 1,)
    assert diagnosis.floor_friction.shape == (layout.count,)
    if friction > 0.0 and layout.count > 12:  # nearly every face impact would open a contact
        assert np.nanmin(diagnosis.least_flush_impulse) < 0.0


def test_a_uniform_layout_keeps_its_contacts_closed_and_unreached_dominoes_have_nan():
    diagnosis = de.diagnose(de.Layout.uniform(40, pitch=0.024), de.Physics())
    assert np.nanmin(diagnosis.least_hit_impulse) >= 0.0
    assert np.nanmin(diagnosis.least_load) >= 0.0
    assert np.nanmax(diagnosis.floor_friction) < 1.0
    assert np.isnan(diagnosis.least_flush_impulse).all()
    diagnosis = de.diagnose(de.Layout.uniform(20, spacing=0.004), de.Physics(push=3.0))
    assert diagnosis.outcome is de.Outcome.STALLED
    assert np.isnan(diagnosis.least_load[-1])
    assert np.isnan(diagnosis.least_contact_force[-1])
