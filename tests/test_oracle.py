"""The oracle by itself: derivatives of its contact conditions, and the balance of power."""

import numpy as np
import oracle
import pytest


@pytest.mark.parametrize("state", [oracle.TIP, oracle.CORNER])
def test_derivatives_of_contact_conditions(state):
    """Compare with central differences of the angle of the domino behind."""
    chain = oracle.Chain([0.015, 0.02], [0.007, 0.008, 0.009], 0.048, 1040.0, 0.3, 9.81)
    chain.state[1] = state  # a corner before face contact
    lead, h = 1.25 if state == oracle.CORNER else 0.3, 1e-4
    rear = [chain.angles(2, lead + k * h)[1] for k in (-2, -1, 0, 1, 2)]
    first = (rear[0] - 8 * rear[1] + 8 * rear[3] - rear[4]) / (12 * h)
    second = (-rear[0] + 16 * rear[1] - 30 * rear[2] + 16 * rear[3] - rear[4]) / (12 * h * h)
    contacts = chain.contacts(2, chain.angles(2, lead))
    (fa, fb), (faa, fab, fbb) = contacts.first[1], contacts.second[1]
    assert -fb / fa == pytest.approx(first, rel=1e-8)
    bend = -(faa * first**2 + 2 * fab * first + fbb) / fa
    assert bend == pytest.approx(second, rel=1e-6)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_forces_and_power_balance(friction):
    """The power of gravity less that of friction is the rate of kinetic energy."""
    rng = np.random.default_rng(3)
    chain = oracle.Chain(
        rng.uniform(0.01, 0.03, 4), rng.uniform(0.005, 0.01, 5), 0.048, 1040.0, friction, 9.81
    )
    lead, speed = 0.15, 6.0
    theta = chain.angles(4, lead)
    contacts = chain.contacts(4, theta)
    omega = chain.ratios(contacts) * speed
    alpha, normal, inertia = chain.motion(4, lead, speed)
    weight = 0.5 * chain.mass * 9.81 * np.hypot(chain.height, chain.d)
    gravity = (weight * np.sin(theta - chain.tipping)) @ omega
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    slip = oracle.dot(
        omega[:-1, None] * (contacts.arm_behind @ turn)
        - omega[1:, None] * (contacts.arm_ahead @ turn),
        contacts.along,
    )
    gain = (chain.inertia * alpha) @ omega
    assert gain == pytest.approx(gravity - friction * normal @ np.abs(slip), rel=1e-11)
    assert inertia > chain.inertia[4]
