"""ODE solvers converge to the simulator with their orders, and have the same outcomes."""

import math

import numpy as np
import pytest

import domino_env as de
from domino_env.rigid.simulation import largest_difference
from domino_env.validation.edge_cases import short_cases
from domino_env.validation.ode import ADAPTIVE, FIXED, integrate

CASES = {case.name: (case.layout, case.physics) for case in short_cases()}
LAYOUTS = {"uniform": (de.Layout.uniform(8, pitch=0.016), de.Physics(push=8.0))} | {
    name: CASES[name]
    for name in (
        "μ = 0.25, two in one face impact", "μ = 0.25, contacts open",
        "random 11, uneven ground, μ = 0.6",
    )
}  # fmt: skip


def _error(name: str, method: str, setting: float) -> float:
    layout, physics = LAYOUTS[name]
    exact = de.simulate(layout, physics, rtol=1e-13)
    outcome, arrival_times = integrate(layout, physics, method, setting)
    assert outcome == exact.outcome == de.Outcome.PROPAGATED
    return largest_difference(arrival_times, exact.arrival_times)


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
    # an error depends on where in its step a hit falls: compare means over several steps
    def mean_error(step: float) -> float:
        return float(np.mean([_error(name, method, step * x) for x in np.linspace(0.8, 1.2, 15)]))

    coarse, fine = mean_error(2e-4), mean_error(1e-5)
    assert 0.7 < math.log(coarse / fine) / math.log(20.0) < 1.3
    assert fine < 1e-2


@pytest.mark.parametrize("method", ADAPTIVE)
@pytest.mark.parametrize("name", LAYOUTS)
def test_scipy_converges_to_the_simulator(name, method):
    loose, tight = _error(name, method, 1e-4), _error(name, method, 1e-9)
    assert loose < 2e-2
    assert tight < 1e-6
    assert tight < loose


ENDS = {
    name: CASES[name]
    for name in ("μ = 0.25, stalls in a tight gap", "μ = 0.25, out of reach", "jams")
} | {
    "jams at a face impact": (
        de.Layout([0.015, 0.001, *[0.015] * 6], 0.0075), de.Physics(1.0, push=20.0)
    ),
    "one domino": (de.Layout([], 0.0075), de.Physics()),
    "one domino, too weak a push": (de.Layout([], 0.0075), de.Physics(push=1.0)),
}  # fmt: skip


@pytest.mark.parametrize("method", [*FIXED, *ADAPTIVE])
@pytest.mark.parametrize("name", ENDS)
def test_solvers_and_simulator_have_the_same_outcome(name, method):
    wave = de.simulate(*ENDS[name])
    outcome, times = integrate(*ENDS[name], method, 1e-4 if method in FIXED else 1e-8)
    assert outcome == wave.outcome
    np.testing.assert_array_equal(np.isfinite(times), np.isfinite(wave.arrival_times))
