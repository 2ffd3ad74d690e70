"""ODE solvers meet the simulator, each at its own order, and end as it ends."""

import math

import numpy as np
import pytest

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import simulate
from domino_env.rigid.simulation import largest_difference
from domino_env.validation.ode import ADAPTIVE, FIXED, integrate

RNG = np.random.default_rng(8)
UNEQUAL = Layout(
    RNG.uniform(0.012, 0.03, 9), RNG.uniform(0.004, 0.012, 10), RNG.uniform(0.0475, 0.0485, 10),
    density=RNG.uniform(500.0, 2000.0, 10),
)  # fmt: skip
LAYOUTS = {
    "uniform": (Layout.uniform(8, pitch=0.016), Physics(push=8.0)),
    "face impacts together": (Layout([*[0.005] * 4, *[0.03] * 3], 0.0075), Physics(push=12.0)),
    "separations": (Layout([0.044, 0.042, 0.02, 0.045, 0.044], 0.01), Physics(0.1, push=10.0)),
    "unequal": (UNEQUAL, Physics(0.3, push=20.0)),
}


def _error(name: str, method: str, setting: float) -> float:
    layout, physics = LAYOUTS[name]
    exact = simulate(layout, physics, rtol=1e-13)
    stepped = integrate(layout, physics, method, setting)
    assert stepped.outcome == exact.outcome
    return largest_difference(stepped.arrival_times, exact.arrival_times)


def test_the_layouts_have_every_state_of_contact():
    assert simulate(*LAYOUTS["face impacts together"]).flushes >= 4
    assert simulate(*LAYOUTS["separations"]).releases > 0


@pytest.mark.parametrize("name", LAYOUTS)
def test_runge_kutta_with_located_hits_is_of_order_four(name):
    steps = np.array([2e-3, 1e-3, 5e-4, 2.5e-4])
    errors = [_error(name, "rk4", step) for step in steps]
    order = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 3.6 < order < 4.6
    assert _error(name, "rk4", 5e-5) < 2e-12


@pytest.mark.parametrize("method", ["euler", "rk4-step"])
@pytest.mark.parametrize("name", LAYOUTS)
def test_hits_located_to_the_step_leave_order_one(name, method):
    # an error depends on where in its step a hit falls: the mean over several steps tells
    def mean_error(step: float) -> float:
        return float(np.mean([_error(name, method, step * x) for x in np.linspace(0.8, 1.2, 15)]))

    coarse, fine = mean_error(2e-4), mean_error(1e-5)
    assert 0.7 < math.log(coarse / fine) / math.log(20.0) < 1.3
    assert fine < 1e-2


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("name", LAYOUTS)
def test_scipy_meets_the_answer(name, method):
    loose, tight = _error(name, method, 1e-4), _error(name, method, 1e-9)
    assert loose < 2e-2
    assert tight < 1e-6
    assert tight < loose


DEAD = {
    "stalled": (Layout.uniform(6, spacing=0.003), Physics(0.5, push=3.0)),
    "out of reach": (Layout([0.02, 0.06, 0.02], 0.0075), Physics()),
    "jammed at a hit": (Layout.uniform(4, spacing=0.012), Physics(7.0, push=50.0)),
    "jammed at a face impact": (
        Layout([0.015, 0.001, *[0.015] * 6], 0.0075),
        Physics(1.0, push=20.0),
    ),
    "one domino": (Layout([], 0.0075), Physics()),
    "one domino, too weak a push": (Layout([], 0.0075), Physics(push=1.0)),
}


@pytest.mark.parametrize("method", [*FIXED, *ADAPTIVE])
@pytest.mark.parametrize("name", DEAD)
def test_a_wave_ends_for_the_same_reason(name, method):
    layout, physics = DEAD[name]
    wave = simulate(layout, physics)
    setting = 1e-4 if method in FIXED else 1e-8
    stepped = integrate(layout, physics, method, setting)
    assert stepped.outcome == wave.outcome
    np.testing.assert_array_equal(
        np.isfinite(stepped.arrival_times), np.isfinite(wave.arrival_times)
    )
