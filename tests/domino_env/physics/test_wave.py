"""simulate and simulate_batch: what they promise besides the physics."""

import threading

import numba
import numpy as np
import pytest

import domino_env as de
from domino_env.core.threads import share_pieces, share_rows

SUMMARY = (
    "outcome", "hit", "toppled", "reach", "mean_speed", "error_estimate", "converged", "flushes",
    "releases", "largest_flush_loss",
)  # fmt: skip
RECORD = ("arrival_times", "release_velocity", "impact_velocity", "stall_margin")


def rows(count=60, n=30, seed=0):
    """Gentle rows: about a third propagate, the others stall; some gaps are out of reach."""
    rng = np.random.default_rng(seed)
    spacing = rng.uniform(0.002, 0.026, (count, n - 1))
    spacing[::9, 11] = 0.05
    return spacing, rng.uniform(0.005, 0.014, (count, n))


PHYSICS = de.Physics(0.5, 9.81, 3.0)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-10])
def test_a_batch_is_bit_for_bit_its_rows(rtol):
    spacing, thickness = rows()
    batch = de.simulate_batch(spacing, thickness, PHYSICS, rtol=rtol)
    assert len(set(batch.outcome)) >= 2
    for b in range(len(spacing)):
        wave = de.simulate(de.Layout(spacing[b], thickness[b]), PHYSICS, rtol=rtol)
        for name in SUMMARY:
            assert getattr(wave, name) == getattr(batch, name)[b], name
        for name in RECORD:
            np.testing.assert_array_equal(getattr(wave, name), getattr(batch, name)[b])


def test_order_and_threads_change_nothing():
    spacing, thickness = rows(200)
    batch = de.simulate_batch(spacing, thickness, PHYSICS)
    order = np.random.default_rng(1).permutation(200)
    shuffled = de.simulate_batch(spacing[order], thickness[order], PHYSICS)
    np.testing.assert_array_equal(shuffled.arrival_times, batch.arrival_times[order])
    threads = numba.get_num_threads()
    try:
        numba.set_num_threads(1)
        alone = de.simulate_batch(spacing, thickness, PHYSICS)
    finally:
        numba.set_num_threads(threads)
    np.testing.assert_array_equal(alone.arrival_times, batch.arrival_times)


def test_a_worker_keeps_to_the_threads_of_its_surroundings(monkeypatch):
    """They may be told after Numba has been loaded with more."""
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    monkeypatch.setattr("numba.get_num_threads", lambda: 4)
    calls: list[tuple[int, int, int]] = []

    def task(first: int, last: int) -> None:
        calls.append((first, last, threading.get_ident()))

    share_rows(task, 100, 1)
    assert len(calls) == 4
    monkeypatch.setenv("NUMBA_NUM_THREADS", "1")
    calls.clear()
    share_rows(task, 100, 1)
    share_pieces(task, 100, 100)
    assert calls == [(0, 100, threading.get_ident())] * 2


def test_several_python_threads_may_call_at_once():
    spacing, thickness = rows(100)
    expected = de.simulate_batch(spacing, thickness, PHYSICS).arrival_times
    found = []

    def call():
        found.append(de.simulate_batch(spacing, thickness, PHYSICS).arrival_times)

    callers = [threading.Thread(target=call) for _ in range(4)]
    for caller in callers:
        caller.start()
    for caller in callers:
        caller.join()
    assert len(found) == 4
    for times in found:
        np.testing.assert_array_equal(times, expected)


def test_without_a_record_the_summary_is_the_same():
    spacing, thickness = rows()
    full = de.simulate_batch(spacing, thickness, PHYSICS)
    brief = de.simulate_batch(spacing, thickness, PHYSICS, record=False)
    for name in SUMMARY:
        np.testing.assert_array_equal(getattr(brief, name), getattr(full, name))
    assert brief.arrival_times.shape == (len(spacing), 0)


def test_what_a_wave_tells():
    wave = de.simulate(de.Layout.uniform(30, pitch=0.024), de.Physics())
    assert wave.outcome is de.Outcome.PROPAGATED
    assert (wave.hit, wave.toppled, wave.reach) == (30, 30, 1.0)
    assert wave.arrival_times[0] == 0.0
    assert np.all(np.diff(wave.arrival_times) > 0.0)
    assert wave.release_velocity[0] == 8.0
    assert wave.release_velocity.shape == (30,)
    assert wave.impact_velocity.shape == (29,)
    assert wave.stall_margin.shape == (30,)
    assert np.all((wave.stall_margin > 0.0) & (wave.stall_margin <= 1.0))
    assert wave.mean_speed == wave.layout.length / wave.arrival_times[-1]
    assert 0.0 < wave.error_estimate <= 1e-8
    assert wave.converged
    assert wave.run_time > 0.0


def test_a_wave_that_dies_says_where_and_what_to_do():
    wave = de.simulate(de.Layout.uniform(30, spacing=0.004), de.Physics(0.25, 9.81, 3.0))
    assert wave.outcome is de.Outcome.STALLED
    assert wave.mean_speed == 0.0
    assert 0.0 < wave.reach < 1.0
    assert wave.stall_margin[wave.hit - 1] == 0.0
    assert np.isnan(wave.stall_margin[wave.hit :]).all()
    assert f"domino {wave.hit - 1} led" in wave.explanation
    assert "push harder" in wave.explanation


def test_a_single_domino_topples_or_does_not():
    layout = de.Layout([], [0.0075])
    least = np.sqrt(3.0 * 9.81 * (np.hypot(0.048, 0.0075) - 0.048) / (0.048**2 + 0.0075**2))
    assert de.smallest_push(layout, de.Physics()) == pytest.approx(least, rel=1e-12)
    for factor, outcome in ((1 - 1e-9, "STALLED"), (1 + 1e-9, "PROPAGATED")):
        wave = de.simulate(layout, de.Physics(push=factor * least))
        assert wave.outcome.name == outcome
    assert wave.mean_speed == 0.0


def test_painleve_has_no_rigid_answer():
    """A light domino behind a heavy, rough, thick one: the effective inertia turns negative."""
    thickness = [0.048, 0.0005, 0.048, 0.02, 0.02]
    found = set()
    for friction in np.linspace(0.5, 3.0, 26):
        layout = de.Layout([0.03, 0.01, 0.01, 0.01], thickness, density=[9000, 100, 100, 1, 1])
        wave = de.simulate(layout, de.Physics(friction, 9.81, 20.0))
        found.add(wave.outcome)
        assert wave.explanation
    assert found <= set(de.Outcome)
    assert de.Outcome.PROPAGATED not in found


@pytest.mark.parametrize("rtol", [1e-2, 1e-14, 0.0, -1.0, float("nan")])
def test_a_tolerance_out_of_range_is_refused(rtol):
    with pytest.raises(ValueError, match=r"rtol = .*: give a finite number from"):
        de.simulate(de.Layout.uniform(3, pitch=0.02), de.Physics(), rtol=rtol)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"spacing": [0.02, 0.02]}, "one row a layout"),
        ({"spacing": [[0.02, -0.01]]}, r"spacing\[0, 1\] = -0.01 m"),
        ({"spacing": [[0.02, np.nan]]}, r"spacing\[0, 1\] = nan m"),
        ({"thickness": [[0.0, 0.01, 0.01]]}, r"thickness\[0, 0\] = 0.0 m"),
        ({"thickness": [0.01, 0.01]}, r"thickness has shape \(2,\)"),
        ({"height": [0.1, 0.05, 0.05]}, "above the top of domino 1"),
        ({"density": -1.0}, r"density\[0, 0\] = -1.0 kg/m³"),
    ],
)
def test_a_batch_that_cannot_stand_is_refused(given, message):
    good = {"spacing": [[0.02, 0.02]], "thickness": [[0.01, 0.01, 0.01]]}
    with pytest.raises(ValueError, match=message):
        de.simulate_batch(physics=de.Physics(), **(good | given))


def test_looser_runs_agree_within_what_they_say():
    spacing, thickness = rows(150, seed=3)
    spacing = np.minimum(spacing, 0.026)
    tight = de.simulate_batch(spacing, thickness, de.Physics(0.3), rtol=1e-13)
    for rtol in (1e-3, 1e-5, 1e-7, 1e-9, 1e-11):
        loose = de.simulate_batch(spacing, thickness, de.Physics(0.3), rtol=rtol)
        np.testing.assert_array_equal(loose.outcome, tight.outcome)
        came = np.isfinite(tight.arrival_times[:, 1:])
        reference = np.where(came, tight.arrival_times[:, 1:], 1.0)
        error = np.where(came, np.abs(loose.arrival_times[:, 1:] / reference - 1.0), 0.0).max(1)
        assert np.all(error <= loose.error_estimate + tight.error_estimate)
        assert np.all(loose.error_estimate[loose.converged] <= rtol)


@pytest.mark.parametrize("count", [100_000])
def test_a_hundred_thousand_dominoes(count):
    rng = np.random.default_rng(0)
    wave = de.simulate(de.Layout(rng.uniform(0.010, 0.025, count - 1), 0.0075), de.Physics())
    assert wave.outcome is de.Outcome.PROPAGATED
    assert wave.error_estimate < 1e-8


@pytest.mark.parametrize("friction", [0.0, 0.25])
@pytest.mark.parametrize("gap", [0.004, 0.016, 0.030])
def test_the_stack_is_cut_anew_as_a_strong_push_fades(friction, gap):
    """What was nothing beside a push of 2700 rad/s is much when the wave has slowed down."""
    layout, physics = de.Layout.uniform(60, spacing=gap), de.Physics(friction, 9.81, 2694.0)
    exact = de.simulate(layout, physics, rtol=1e-13).arrival_times[1:]
    for rtol in (1e-3, 1e-4, 1e-6):
        wave = de.simulate(layout, physics, rtol=rtol)
        error = np.max(np.abs(wave.arrival_times[1:] / exact - 1.0))
        assert error <= wave.error_estimate <= rtol


def test_a_wave_of_a_batch_is_that_of_its_layout():
    gaps = np.random.default_rng(5).uniform(0.004, 0.03, (3, 8))
    batch = de.simulate_batch(gaps, 0.0075, de.Physics(), rtol=1e-8)
    for b, row in enumerate(gaps):
        wave, alone = batch[b], de.simulate(de.Layout(row, 0.0075), de.Physics())
        assert wave.layout == alone.layout
        assert wave.outcome is alone.outcome
        np.testing.assert_array_equal(wave.arrival_times, alone.arrival_times)
    with pytest.raises(ValueError, match="record=True"):
        de.simulate_batch(gaps, 0.0075, de.Physics(), record=False)[0]
