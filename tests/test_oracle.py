"""The oracle by itself: published and twice-computed numbers, and the seed's Lagrangian form."""

import numpy as np
import oracle
import pytest


def test_the_first_falls_of_the_classic_row():
    result = oracle.topple(np.full(6, 0.0085), np.full(7, 0.0075), 0.25, 9.8, 5 * np.pi)
    expected = [0.011453522, 0.023813754, 0.033659993, 0.035582197, 0.032064033]
    np.testing.assert_allclose(np.diff(result.arrival)[:5], expected, atol=6e-10)


def test_the_first_hit_of_equal_dominoes_loses_half_the_energy():
    result = oracle.topple([0.02, 0.02], [0.0075] * 3, 0.0)
    before, after = result.impact_velocity[0], result.release_velocity[1]
    assert 2.0 * after**2 / before**2 == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize("leader", [1, 4])
@pytest.mark.parametrize("lead", [0.02, 0.12])
def test_newton_is_lagrange_without_friction(leader, lead):
    """Eq. 5: α_0 I K = Σ torque_k J_k - ½ I ω_0² K′, K′ by differences of K."""
    rng = np.random.default_rng(leader)
    count = leader + 1
    spacing, thickness = rng.uniform(0.01, 0.03, leader), rng.uniform(0.005, 0.01, count)
    chain = oracle.Chain(spacing, thickness, 0.048, 1040.0, 0.0, 9.81)
    speed = 7.0

    def inertia_seen(angle):
        theta = chain.angles(leader, angle)
        ratio = chain.ratios(chain.contacts(leader, theta))
        return float((chain.inertia[:count] * ratio**2).sum())

    h = 1e-4
    slope = (
        8.0 * (inertia_seen(lead + h) - inertia_seen(lead - h))
        - (inertia_seen(lead + 2 * h) - inertia_seen(lead - 2 * h))
    ) / (12.0 * h)
    theta = chain.angles(leader, lead)
    ratio = chain.ratios(chain.contacts(leader, theta))
    r = 0.5 * np.hypot(chain.height, chain.d)
    lean = theta - np.arctan2(chain.d, chain.height)
    force = chain.mass * 9.81 * r * np.sin(lean)
    lagrange = (force @ ratio - 0.5 * speed**2 * slope) / inertia_seen(lead)
    newton = chain.motion(leader, lead, speed)[0][-1]
    assert newton == pytest.approx(lagrange, rel=1e-9)
