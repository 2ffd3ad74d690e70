"""Edge cases: times within tolerance, or an outcome with the reason of the end."""

import math
import tracemalloc
from fractions import Fraction
from pathlib import Path

import near_stalls
import numpy as np
import pytest
from precise import precise_wave

import domino_env as de
from domino_env.core.files import read_json
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
    wave = de.simulate(case.layout, case.physics, rtol=1e-13)
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
    wave = de.simulate(case.layout, case.physics, rtol=1e-12)
    swing = math.sqrt(case.layout.height.min() / case.physics.gravity)
    last = wave.arrival_times[wave.hit - 1] / wave.hit
    step = min(last, swing) / 150.0 if last > 0.0 else swing / 1e4
    outcome, times = integrate(case.layout, case.physics, "rk4", step)
    assert outcome == wave.outcome
    error = largest_difference(times, wave.arrival_times)
    assert error < 1e-6 + 100.0 * wave.error_estimate


def test_a_fault_names_the_expected_outcome():
    layout = de.Layout.uniform(3, pitch=0.016)
    case = edge_cases.EdgeCase("group", "name", layout, de.Physics(), (de.Outcome.JAMMED,))
    assert edge_cases.examine(case).faults == "expected JAMMED"


def test_a_million_dominoes_need_little_more_than_their_results():
    layout = de.Layout.uniform(1_000_000, pitch=0.016)
    tracemalloc.start()
    wave = de.simulate(layout, de.Physics(), rtol=1e-6)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert wave.outcome == de.Outcome.PROPAGATED
    assert wave.converged
    assert peak < 1.5 * 4 * 8 * 1_000_000  # four numbers per domino


@pytest.mark.parametrize("width", [0.0, 0.01], ids=["equal gaps", "random gaps"])
def test_long_layouts_do_not_lose_digits(width):
    rng, errors = np.random.default_rng(6), []
    for count in (100, 100_000):
        layout = de.Layout(0.0085 + width * rng.uniform(0.15, 1.15, count - 1), 0.0075)
        waves = (de.simulate(layout, de.Physics(), rtol=rtol) for rtol in (1e-13, 1e-10))
        fine, time = (wave.arrival_times[-1] for wave in waves)
        errors.append(abs(time / fine - 1.0))
    assert max(errors) < 1e-10
    assert errors[1] < 1e-12 + 30.0 * errors[0]  # √1000, of the error of the time itself


# cases in which searches found an error above its estimate
OPTIMISTIC_CASES = read_json(Path(__file__).parents[2] / "data" / "optimistic_cases.json")


@pytest.mark.parametrize("name", OPTIMISTIC_CASES)
def test_estimates_hold_where_searches_found_larger_errors(name):
    case = OPTIMISTIC_CASES[name]
    layout, physics = de.Layout(**case["layout"]), de.Physics(**case["physics"])
    tight = de.simulate(layout, physics, rtol=1e-13)
    if "arrival_times" in case:  # of `precise_wave`
        times = tuple(map(Fraction, case["arrival_times"]))
        true = edge_cases.PreciseWave(de.Outcome[case["outcome"]], times, 0, 0.0)
        assert tight.outcome == true.outcome
        assert true.relative_error(tight.arrival_times) <= tight.error_estimate
    for rtol in (1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 1e-10):
        wave = de.simulate(layout, physics, rtol=rtol)
        assert edge_cases.inconsistencies(wave) == []
        assert (wave.outcome, wave.hit, wave.toppled) == (tight.outcome, tight.hit, tight.toppled)
        error = largest_difference(wave.arrival_times, tight.arrival_times)
        assert error <= max(wave.error_estimate, 0.02 * rtol) + tight.error_estimate
        assert error <= rtol + tight.error_estimate or not wave.converged


def test_near_the_smallest_push_and_after_tight_gaps_no_wave_ends_otherwise():
    waves, found = near_stalls.faults(30)
    assert sum(waves.values()) > 1000
    assert [case for case in found if near_stalls.OPTIMISTIC not in case[0]] == []
    assert len(found) <= sum(waves.values()) // 500


@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_where_rounding_decides_about_a_stall_no_wave_converges(friction):
    layout = de.Layout([0.01, 0.03, 0.002], 0.0075)
    least = de.smallest_push(layout, de.Physics(friction))
    for excess in (-1e-9, -1e-15, 0.0, 1e-15, 1e-13, 1e-8):
        wave = de.simulate(layout, de.Physics(friction, push=least * (1.0 + excess)), rtol=1e-3)
        if abs(excess) < 1e-10:
            assert wave.error_estimate == math.inf
            assert not wave.converged
        else:
            assert wave.propagated == bool(excess > 0.0)
            assert wave.converged
