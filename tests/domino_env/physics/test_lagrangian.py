"""The seed's Lagrangian form (eqs. 4 and 5, without friction) against the Newtonian one.

K(θ_0) = Σ_k I_k/I_0 J_k² and its slope K′ are written from eqs. 1-3 in angles, for dominoes that
may differ: α_0 = (Σ_k m_k g r_k sin(θ_k - φ_k) J_k - ½ I_0 ω_0² K′)/(I_0 K).
"""

import numpy as np
import oracle
import pytest

import domino_env as de

GRAVITY = 9.81


class Lagrangian:
    """A stack in tip contact under leader n, by its leader's angle alone."""

    def __init__(self, layout, n):
        self.n, self.pitch = n, layout.pitch
        self.d, self.height = layout.thickness, layout.height
        self.mass = layout.density * self.d * self.height * layout.width
        self.radius = 0.5 * np.hypot(self.height, self.d)
        self.tipping = np.arctan2(self.d, self.height)
        self.inertia = 4.0 / 3.0 * self.mass * self.radius**2

    def angles(self, lead):
        """θ_k and J_k = dθ_k/dθ_0 and dJ_k/dθ_0 of leader, next behind, …"""
        theta, ratio, bend = [lead], [1.0], [0.0]
        for i in range(self.n - 1, -1, -1):
            b, per = theta[-1], self.pitch[i] / self.height[i]
            delta = np.arcsin(per * np.cos(b) - self.d[i + 1] / self.height[i])
            omega = 1.0 - per * np.sin(b) / np.cos(delta)
            # eq. 3, with the denominator cos²
            curve = -per * np.cos(b + delta) - per * np.sin(b) * np.sin(delta) * omega
            curve /= np.cos(delta) ** 2
            theta.append(b + delta)
            bend.append(omega * bend[-1] + curve * ratio[-1] ** 2)
            ratio.append(omega * ratio[-1])
        return np.array(theta), np.array(ratio), np.array(bend)

    def potential(self, lead):
        theta, _, _ = self.angles(lead)
        k = self.n - np.arange(self.n + 1)
        return float(
            (self.mass[k] * GRAVITY * self.radius[k] * np.cos(theta - self.tipping[k])).sum()
        )

    def inertia_seen(self, lead):
        """I_0 K: twice the kinetic energy at unit speed of the leader."""
        _, ratio, _ = self.angles(lead)
        return float((self.inertia[self.n - np.arange(self.n + 1)] * ratio**2).sum())

    def acceleration(self, lead, speed):
        """Eq. 5."""
        theta, ratio, bend = self.angles(lead)
        k = self.n - np.arange(self.n + 1)
        force = self.mass[k] * GRAVITY * self.radius[k] * np.sin(theta - self.tipping[k])
        slope = (2.0 * self.inertia[k] * ratio * bend).sum()  # I_0 K′
        return (force @ ratio - 0.5 * speed**2 * slope) / self.inertia_seen(lead)


def row(seed, count=9):
    """Every domino different; gaps wide enough that no link goes flush."""
    rng = np.random.default_rng(seed)
    spacing = np.sort(rng.uniform(0.016, 0.03, count - 1))[::-1]
    thickness = np.sort(rng.uniform(0.005, 0.009, count))
    return de.Layout(spacing, thickness, density=rng.uniform(500.0, 2000.0, count))


@pytest.mark.parametrize("leader", [0, 1, 4, 8])
@pytest.mark.parametrize("lead", [0.0, 0.05, 0.2])
def test_lagrange_is_newton(leader, lead):
    layout = row(leader)
    chain = oracle.Chain(
        layout.spacing, layout.thickness, layout.height, layout.density, 0.0, GRAVITY
    )
    newton = chain.motion(leader, lead, 7.0)[0][-1]
    assert Lagrangian(layout, leader).acceleration(lead, 7.0) == pytest.approx(newton, rel=1e-12)


@pytest.mark.parametrize("leader", [1, 4, 8])
def test_the_slopes_are_those_of_energy(leader):
    """K′ and the torque, against differences of K and of the potential."""
    stack, lead, h = Lagrangian(row(leader), leader), 0.1, 1e-4

    def slope(f):
        near, far = f(lead + h) - f(lead - h), f(lead + 2 * h) - f(lead - 2 * h)
        return (8.0 * near - far) / (12.0 * h)

    still = stack.acceleration(lead, 0.0) * stack.inertia_seen(lead)
    assert still == pytest.approx(-slope(stack.potential), rel=1e-8)
    moving = stack.acceleration(lead, 10.0) * stack.inertia_seen(lead) - still
    assert moving == pytest.approx(-50.0 * slope(stack.inertia_seen), rel=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_lagrange_is_simulate(seed):
    """Each fall rides the Lagrangian: ½ I_0 K ω_0² + V is kept, and the time is ∫dθ/ω."""
    layout = row(seed)
    wave = de.simulate(layout, de.Physics(0.0, GRAVITY, 9.0), rtol=1e-12)
    assert wave.outcome is de.Outcome.PROPAGATED
    assert wave.flushes == wave.releases == 0
    nodes, weights = np.polynomial.legendre.leggauss(40)
    for n in range(layout.count - 1):
        stack, hit = Lagrangian(layout, n), np.arcsin(layout.spacing[n] / layout.height[n])
        energy = stack.potential(0.0)
        energy += 0.5 * stack.inertia_seen(0.0) * wave.release_velocity[n] ** 2

        def speed(lead, stack=stack, energy=energy):
            return np.sqrt(2.0 * (energy - stack.potential(lead)) / stack.inertia_seen(lead))

        assert wave.impact_velocity[n] == pytest.approx(speed(hit), rel=1e-11)
        fall = 0.5 * hit * sum(
            w / speed(0.5 * hit * (1.0 + x)) for x, w in zip(nodes, weights, strict=True)
        )  # fmt: skip
        took = wave.arrival_times[n + 1] - wave.arrival_times[n]
        assert took == pytest.approx(fall, rel=1e-10)
