"""Edge cases: times within tolerance, or an outcome with the reason of the end."""

import math
import tracemalloc
from fractions import Fraction

import numpy as np
import pytest
from precise import precise_wave

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome, simulate
from domino_env.rigid.simulation import largest_difference
from domino_env.validation import edge_cases
from domino_env.validation.ode import integrate

CASES = list(edge_cases.edge_cases(10_000))
SHORT = {str(case): case for case in edge_cases.short_cases()}


@pytest.mark.parametrize("case", CASES, ids=str)
def test_errors_are_within_estimate_and_tolerance(case):
    for rtol in (1e-4, 1e-8, 1e-12):
        assert edge_cases.examine(case, rtol).faults == ""


@pytest.mark.parametrize("name", SHORT)
def test_the_tightest_tolerance_agrees_with_the_stored_digits(name):
    case, true = SHORT[name], edge_cases.reference_waves()[name]
    wave = simulate(case.layout, case.physics, rtol=1e-13)
    error = true.relative_error(wave.arrival_times)
    assert error <= wave.error_estimate
    if true.lowest > 1e-3:
        assert (wave.outcome, wave.flushes) == (true.outcome, true.flushes)
        assert error < 4e-15 / true.lowest


def test_the_stored_digits_are_complete_and_up_to_date():
    assert list(edge_cases.reference_waves()) == list(SHORT)
    assert len(SHORT) == 60
    for name in ("short: μ = 0.25, one face impact", "short: jams", "short: μ = 0, out of reach"):
        stored = edge_cases.reference_waves()[name]
        wave = precise_wave(SHORT[name].layout, SHORT[name].physics)
        assert (wave.outcome, wave.flushes) == (stored.outcome, stored.flushes)
        for time, known in zip(wave.arrival_times, stored.arrival_times, strict=True):
            assert abs(time - known) <= Fraction(1, 10**25) * known


# steps in time do not converge for these within the run time of a test
HARD_TO_STEP = ("near stall", "smallest push", "near touching", "out of reach", "long", "nearly")
EASY_TO_STEP = [case for case in CASES if not any(word in str(case) for word in HARD_TO_STEP)]


@pytest.mark.parametrize("case", EASY_TO_STEP, ids=str)
def test_time_steps_give_the_same_outcome_and_times(case):
    wave = simulate(case.layout, case.physics, rtol=1e-12)
    swing = math.sqrt(case.layout.height.min() / case.physics.gravity)
    last = wave.arrival_times[wave.hit - 1] / wave.hit
    step = min(last, swing) / 150.0 if last > 0.0 else swing / 1e4
    outcome, times = integrate(case.layout, case.physics, "rk4", step)
    assert outcome == wave.outcome
    error = largest_difference(times, wave.arrival_times)
    assert error < 1e-6 + 100.0 * wave.error_estimate


def test_a_fault_names_the_expected_outcome():
    layout = Layout.uniform(3, pitch=0.016)
    case = edge_cases.EdgeCase("group", "name", layout, Physics(), (Outcome.JAMMED,))
    assert edge_cases.examine(case).faults == "expected JAMMED"


def test_a_million_dominoes_need_little_more_than_their_results():
    layout = Layout.uniform(1_000_000, pitch=0.016)
    tracemalloc.start()
    wave = simulate(layout, Physics(), rtol=1e-6)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert wave.outcome == Outcome.PROPAGATED
    assert wave.converged
    assert peak < 1.5 * 4 * 8 * 1_000_000  # four numbers per domino


@pytest.mark.parametrize("width", [0.0, 0.01], ids=["equal gaps", "random gaps"])
def test_long_layouts_do_not_lose_digits(width):
    rng, errors = np.random.default_rng(6), []
    for count in (100, 100_000):
        layout = Layout(0.0085 + width * rng.uniform(0.15, 1.15, count - 1), 0.0075)
        waves = (simulate(layout, Physics(), rtol=rtol) for rtol in (1e-13, 1e-10))
        fine, time = (wave.arrival_times[-1] for wave in waves)
        errors.append(abs(time / fine - 1.0))
    assert max(errors) < 1e-10
    assert errors[1] < 1e-12 + 30.0 * errors[0]  # √1000, of the error of the time itself


def unit_case(
    gaps: list[float], thickness: float | list[float], density: float | list[float] = 1.0, *,
    push: float, friction: float = 0.0,
) -> tuple[Layout, Physics]:  # fmt: skip
    """Return a case in units of the height."""
    return Layout(gaps, thickness, 1.0, 1.0, density), Physics(friction, 1.0, push)


# cases in which searches found an error above its estimate
OPTIMISTIC_CASES = {
    "ends at its tipping angle, hardly moving": unit_case(
        [1.0] * 10, 0.00036485, push=0.0004468513023334257
    ),
    "estimates 1e-7, errs by 2e-6 at 1e-3": unit_case(
        [0.1, 1e-5, 0.316227766, 1.0, 1.0, 1.0], [1.0, 0.1, *[1.0] * 5],
        [1.0, 1.0, 10.0, *[1.0] * 4], push=7.882387605032138,
    ),
    "both ends agree by chance": (
        Layout.uniform(40, spacing=0.030911384993333128, thickness=0.00924701313940406),
        Physics(0.0, push=15.0),
    ),
    "a long swing after a short one": (
        Layout(
            [0.0003998121950933414, 0.0024307203265825175, 0.00027056174440934574,
             2.981996535611405e-05, 0.040442350690182254, 7.831118266524827e-05],
            [0.008497527102326187, 0.00013887970175246816, 0.004195647167169866,
             0.000557115619964209, 0.012071447579553545, 0.0009131604587606111,
             7.54051973757832e-05],
        ),
        Physics(0.0, push=40.0),
    ),
    "a rapid change before a long slow interval": unit_case(
        [7.49894209e-07, 7.49894210e-02, 1.0, 1.0], 1.0, push=7.882387605032138
    ),
    "friction of next to nothing": unit_case(
        [1.0, 0.1, 1.0, 1.0, 1.0], 1.0, push=7.882387605032138, friction=4.2840694269053945e-60
    ),
    "a heavy domino almost touched, error 7e-8, estimate once 1e-8": unit_case(
        [1e-05, 0.562341326, *[1.0] * 8], 1.0, [1.0, 100.0, *[1.0] * 9], push=78.82387605032137
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", OPTIMISTIC_CASES)
def test_estimates_hold_where_searches_found_larger_errors(name):
    case = OPTIMISTIC_CASES[name]
    tight = simulate(*case, rtol=1e-13)
    for rtol in (1e-3, 1e-4, 1e-6, 1e-10):
        wave = simulate(*case, rtol=rtol)
        assert edge_cases.inconsistencies(wave) == []
        assert wave.outcome == tight.outcome
        error = largest_difference(wave.arrival_times, tight.arrival_times)
        assert error <= max(wave.error_estimate, 0.02 * rtol) + tight.error_estimate
        assert error <= rtol + tight.error_estimate or not wave.converged
