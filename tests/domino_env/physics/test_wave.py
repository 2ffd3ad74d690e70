"""Waves, batches, steady waves and smallest pushes: consistency, defaults, rejected arguments."""

import copy
import math
import pickle
import re
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from unittest.mock import Mock

import numba
import numpy as np
import pytest
from uneven_layouts import uneven_layout

import domino_env as de
from domino_env.core.progress import Advice
from domino_env.core.threads import share_evenly, share_pieces

SUMMARY = (
    "outcome", "hit", "toppled", "reach", "mean_speed", "error_estimate", "converged", "flushes",
    "releases", "largest_flush_loss",
)  # fmt: skip
RECORD = ("arrival_times", "release_velocity", "impact_velocity", "stall_margin")
PHYSICS = de.Physics(0.5, 9.81, 3.0)


def random_batch(count=60, n=30):
    """Return gaps and thicknesses [m]: a third of the chains complete, some gaps are too wide."""
    rng = np.random.default_rng(0)
    spacing = rng.uniform(0.002, 0.026, (count, n - 1))
    spacing[::9, 11] = 0.05
    return spacing, rng.uniform(0.005, 0.014, (count, n))


@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-10])
def test_a_batch_equals_its_single_waves_bitwise(rtol):
    """With and without a record, as waves of the batch and simulated alone."""
    spacing, thickness = random_batch()
    batch = de.simulate_batch(spacing, thickness, PHYSICS, rtol=rtol)
    brief = de.simulate_batch(spacing, thickness, PHYSICS, rtol=rtol, record=False)
    assert len(set(batch.outcome)) >= 2
    for b in range(len(spacing)):
        wave = de.simulate(de.Layout(spacing[b], thickness[b]), PHYSICS, rtol=rtol)
        assert batch[b].layout == wave.layout
        for name in SUMMARY:
            known = getattr(wave, name)
            assert known == getattr(batch, name)[b] == getattr(brief, name)[b], name
            assert known == getattr(batch[b], name), name
        for name in RECORD:
            np.testing.assert_array_equal(getattr(wave, name), getattr(batch, name)[b])
    assert brief.arrival_times.shape == (len(spacing), 0)
    with pytest.raises(ValueError, match="record=True"):
        brief[0]


def test_results_do_not_depend_on_the_number_of_threads():
    spacing, thickness = random_batch(200)
    expected = de.simulate_batch(spacing, thickness, PHYSICS).arrival_times

    def times(threads):
        numba.set_num_threads(threads)
        return de.simulate_batch(spacing, thickness, PHYSICS).arrival_times

    with ThreadPoolExecutor(3) as callers:
        for arrivals in callers.map(times, (1, 1, numba.get_num_threads())):
            np.testing.assert_array_equal(arrivals, expected)


def test_a_worker_uses_the_threads_that_the_environment_allows(monkeypatch):
    """The environment may be set after Numba has been loaded with more."""
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    monkeypatch.setattr("numba.threading_layer", lambda: "omp")  # started
    monkeypatch.setattr("numba.get_num_threads", lambda: 4)
    calls: list[tuple[int, int, int]] = []

    def task(first: int, last: int) -> None:
        calls.append((first, last, threading.get_ident()))

    share_evenly(task, 100, 1)
    assert len(calls) == 4
    monkeypatch.setenv("NUMBA_NUM_THREADS", "1")
    calls.clear()
    share_evenly(task, 100, 1)
    share_pieces(task, 100, 100)
    assert calls == [(0, 100, threading.get_ident())] * 2


def test_lengths_in_millimetres_are_reported():
    wave = de.simulate(de.Layout([18, 18], [7.5] * 3))
    assert wave.outcome is de.Outcome.OUT_OF_REACH
    assert "a domino is 7.5 m thick, and the dominoes are 0.048 m tall" in wave.explanation
    assert "; the dominoes are 48 m" in de.simulate(de.Layout([16.5], 7.5, 48.0)).explanation
    with pytest.warns(Advice, match="profile spans 500 m, more than 100 m: lengths are in metres"):
        de.Ground(profile=[[0, 0], [200, 10], [500, 0]])
    assert "lengths are in metres" not in de.simulate(de.Layout([0.02, 0.05], 0.0075)).explanation


# steady waves ------------------------------------------------------------------------------------

RNG = np.random.default_rng(0)
PATTERNS = [  # gaps and thicknesses, with face impacts, and now and then separations, in each
    *((np.array([gap]), np.array([0.0075]), slope)
      for gap, slope in ((0.0085, 0.0), (0.0325, 0.0), (0.0165, -0.06), (0.0165, 0.1))),
    *((RNG.uniform(0.008, 0.034, n), RNG.uniform(0.005, 0.010, n), 0.0) for n in (2, 3, 4)),
]  # fmt: skip


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize(("gaps", "thickness", "slope"), PATTERNS)
def test_a_long_chain_tends_to_the_steady_wave(gaps, thickness, slope, friction):
    physics, period, repeats = de.Physics(friction, push=15.0), len(gaps), 250 // len(gaps)
    pitch = gaps + np.roll(thickness, -1)
    if period == 1:
        layout = de.Layout.uniform(repeats, pitch=pitch[0], slope=slope)
        steady = de.steady_wave(pitch[0], 0.0075, physics=physics, slope=slope)
    else:
        layout = de.Layout(np.tile(gaps, repeats)[:-1], np.tile(thickness, repeats))
        steady = de.steady_pattern(pitch, thickness, physics=physics)
    wave = de.simulate(layout, physics, rtol=1e-12)
    assert steady.exists
    rtol = 1e-9 if period == 1 else 1e-8
    last = slice((repeats - 2) * period, (repeats - 1) * period)
    times = np.diff(wave.arrival_times)[last]
    np.testing.assert_allclose(steady.omega_release, wave.release_velocity[last], rtol=rtol)
    np.testing.assert_allclose(steady.omega_impact, wave.impact_velocity[last], rtol=rtol)
    np.testing.assert_allclose(steady.fall_times, times, rtol=rtol)
    assert steady.speed == pytest.approx(pitch.sum() / times.sum(), rel=rtol)


def test_an_array_of_pitches_gives_a_curve():
    pitches = np.array([[0.0078, 0.016], [0.024, 0.06]])
    curve = de.steady_wave(pitches, 0.0075)
    for at, pitch in np.ndenumerate(pitches):
        one = de.steady_wave(pitch, 0.0075)
        assert (one.exists, one.speed) == (curve.exists[at], curve.speed[at])
        assert curve.explanation[at] == one.explanation
        np.testing.assert_array_equal(curve.fall_times[at], one.fall_times)
    assert curve.exists.tolist() == [[False, True], [True, False]]


def test_chains_without_a_steady_wave_are_explained():
    tight = de.steady_wave(0.0078, 0.0075)
    assert not tight.exists
    assert tight.speed == 0.0
    assert math.isnan(tight.omega_release)
    assert "energy" in tight.explanation
    assert "make it less than the height" in de.steady_wave(0.06, 0.0075).explanation
    for pitch, words in ((0.007, "more than 0"), ([], "give one chain"), ("a", "pitch = 'a'")):
        with pytest.raises(ValueError, match=words):
            de.steady_wave(pitch, 0.0075)


def test_the_speed_estimate_has_the_stated_error_in_its_range():
    rng = np.random.default_rng(63)
    thickness = np.append(rng.uniform(0.02, 0.3, 40), [0.02, 0.02, 0.3, 0.3])
    low = np.maximum(0.1, 0.5 * thickness)
    gap = np.append(rng.uniform(low[:40], 0.7), [0.1, 0.7, 0.15, 0.7])
    friction = np.append(rng.uniform(0.0, 0.3, 40), [0.3, 0.0, 0.3, 0.3])
    for d, s, mu in zip(thickness, gap, friction, strict=True):
        chain = (d + s) * 0.048, d * 0.048, 0.048, de.Physics(mu)
        steady = de.steady_wave(*chain, rtol=1e-6)
        assert de.speed_estimate(*chain) == pytest.approx(steady.speed, rel=0.015)


@pytest.mark.parametrize("friction", [0.0, 0.25])
@pytest.mark.parametrize("push", [5.0, 50.0])
def test_the_smallest_gap_separates_propagation_from_a_stall(friction, push):
    physics = de.Physics(friction, push=push)
    gap = de.smallest_gap(0.01, 0.05, physics, 30)
    for factor, outcome in ((1.0, "PROPAGATED"), (1.0 - 1e-5, "STALLED")):
        layout = de.Layout.uniform(30, spacing=factor * gap, thickness=0.01, height=0.05)
        assert de.simulate(layout, physics).outcome.name == outcome


def test_the_smallest_gap_is_near_its_formula_or_infinite():
    rng = np.random.default_rng(79)
    for a, mu, p in rng.uniform((0.05, 0.0, 0.0), (0.3, 0.3, 1.0), (20, 3)):
        tipping = de.smallest_push(de.Layout([], a, 1.0), de.Physics(mu, gravity=1.0))
        push = 1.5 * 33.0**p
        physics = de.Physics(mu, gravity=1.0, push=push * tipping)
        square = a * a + mu * (0.5 * a + 0.75 * a * a)
        limit = 2.0 * square / (1.0 - square)
        formula = a * math.hypot(limit, 1.35 / push)
        assert de.smallest_gap(a, 1.0, physics) == pytest.approx(formula, rel=0.16)
    weak = physics.replace(push=0.99 * tipping)
    assert de.smallest_gap(a, 1.0, weak) == math.inf


# the smallest push -------------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [0.0, 0.25, 0.5])
@pytest.mark.parametrize("seed", range(6))
def test_the_smallest_push_separates_propagation_from_a_stall(friction, seed):
    rng = np.random.default_rng(seed)
    flat = de.Layout(rng.uniform(0.002, 0.02, 30), rng.uniform(0.005, 0.012, 31))
    for layout in (flat, uneven_layout(5, 8)):
        least = de.smallest_push(layout, de.Physics(friction))
        if math.isinf(least):
            ends = de.simulate(layout, de.Physics(friction, 9.81, 1e4)).outcome
            assert ends not in (de.Outcome.PROPAGATED, de.Outcome.STALLED)
            continue
        for excess, outcome in ((-1e-9, "STALLED"), (1e-9, "PROPAGATED")):
            physics = de.Physics(friction, push=least * (1.0 + excess))
            assert de.simulate(layout, physics, rtol=1e-13).outcome.name == outcome


def test_the_smallest_push_of_one_domino_and_of_a_gap_out_of_reach():
    least = np.sqrt(3.0 * 9.81 * (np.hypot(0.048, 0.0075) - 0.048) / (0.048**2 + 0.0075**2))
    alone = de.Layout([], [0.0075])
    assert de.smallest_push(alone, de.Physics()) == pytest.approx(least, rel=1e-12)
    for excess, outcome in ((-1e-9, "STALLED"), (1e-9, "PROPAGATED")):
        wave = de.simulate(alone, de.Physics(push=least * (1.0 + excess)))
        assert (wave.outcome.name, wave.mean_speed) == (outcome, 0.0)
    assert de.smallest_push(de.Layout([0.02, 0.05], 0.0075), de.Physics()) == math.inf


@pytest.mark.parametrize("slope", [-5.0, 0.0, 4.0])
def test_a_released_domino_passes_its_balance_at_a_tenth_of_the_smallest_push(slope):
    alone = de.Ground(slope=slope).layout([], [0.008], 0.043)
    released = de.Physics.released(alone, friction=0.1, gravity=3.7)
    least = de.smallest_push(alone, released)
    assert (released.friction, released.gravity) == (0.1, 3.7)
    assert released.replace(push=round(released.push, 3)).is_released(alone)
    assert not de.Physics().is_released(alone)
    with pytest.raises(ValueError, match=r"gravity = -1\.0: give a finite number"):
        de.Physics.released(alone, gravity=-1.0)
    assert released.push == pytest.approx(np.hypot(least, 0.1 * least))
    row = de.load_scene("course").uniform().layout
    waves = [
        de.simulate(row, de.Physics(push=de.Physics.released(row).push * factor))
        for factor in (1.0, np.hypot(1.0, 0.02) / np.hypot(1.0, 0.1))
    ]
    # a finger of a fifth of the speed delays all hits by the same time
    delay = waves[1].arrival_times[1:] - waves[0].arrival_times[1:]
    assert delay == pytest.approx(np.full(59, delay[0]), abs=0.0012)
    assert delay[0] > 0.1


@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_the_error_estimate_holds_just_above_a_stall(friction):
    """One unit in the last place of the push moves the time by far more than rtol."""
    layout = de.Layout(np.random.default_rng(5).uniform(0.004, 0.02, 15), 0.0075)
    push = de.smallest_push(layout, de.Physics(friction)) * (1.0 + 1e-12)
    wave, neighbour = (
        de.simulate(layout, de.Physics(friction, 9.81, p), rtol=1e-10)
        for p in (push, np.nextafter(push, 10.0))
    )
    moved = np.max(np.abs(neighbour.arrival_times[1:] / wave.arrival_times[1:] - 1.0))
    assert moved > 1e-8
    assert not wave.converged
    assert moved < wave.error_estimate < 1e-2


# errors ------------------------------------------------------------------------------------------


def test_physics_are_floats_and_immutable():
    physics = de.Physics(friction=0, gravity=10, push=3)
    values = physics.friction, physics.gravity, physics.push
    assert values == (0.0, 10.0, 3.0)
    assert all(type(value) is float for value in values)
    assert de.Physics(push=np.float64(3.0)).replace(friction=0, gravity=np.int64(10)) == physics
    assert de.Physics() == de.Physics(0.25, 9.81, 8.0)
    with pytest.raises(AttributeError, match="immutable"):
        physics.push = 1.0


LAYOUT = de.Layout([0.02], 0.0075)
GAPS = [[0.02, 0.02]]
WAVE = de.simulate(LAYOUT, gradient=True)
BATCH = de.simulate_batch([[0.02]], 0.0075)
CURVED = de.Ground(profile=[[0.0, 0.0], [0.5, 0.01], [1.0, 0.02]])
ON_CURVES = de.simulate(CURVED.layout([0.02] * 5, 0.0075), gradient=True)


@pytest.mark.parametrize("function", [
    de.simulate, de.diagnose, de.smallest_push, de.simulate_standing, de.verify, de.Motion,
])  # fmt: skip
def test_arguments_of_another_type_are_rejected(function):
    with pytest.raises(TypeError, match=r"layout = \[0.018, 0.02\]: give a Layout, such as L"):
        function([0.018, 0.02], de.Physics())
    with pytest.raises(TypeError, match=r"physics = 0\.25: give a Physics, such as"):
        function(LAYOUT, 0.25)


@pytest.mark.parametrize("function", [
    de.simulate, de.diagnose, de.smallest_push, de.simulate_standing, de.Motion,
])  # fmt: skip
@pytest.mark.parametrize("rtol", [2.0, 0.0, math.nan, "x", np.full(3, 1e-8)], ids=str)
def test_tolerances_out_of_range_are_rejected(function, rtol):
    with pytest.raises(ValueError, match=r"^rtol = .*: give a finite number"):
        function(LAYOUT, PHYSICS, rtol=rtol)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: de.Physics(friction=-0.1), "friction = -0.1: give a finite number from 0 to 1e+09"),
    (lambda: de.Physics(gravity=0.0), "gravity = 0.0: give a finite number from 1e-09"),
    (lambda: de.steady_wave([0.02, 0.03], [0.007] * 3), "shapes pitch (2,), thickness (3,), hei"),
    (lambda: de.steady_wave([0.02, np.nan], 0.0075), "pitch[1] = nan m: give a finite number"),
    (lambda: de.steady_wave(0.02, 0.0075, slope="up"), "slope = 'up' rad: give a finite number"),
    (lambda: de.steady_pattern([], 0.0075), "the sizes have shape (0,): give one chain or more"),
    (lambda: de.existence_limit(7.5), "thickness = 7.5 m: give a finite number, more than 0"),
    (lambda: de.speed_estimate(0.0077, 0.0075), "pitch = 0.0077 m: give a finite number from 0.01"),
    (lambda: de.speed_estimate(24.0, 0.0075), "pitch = 24.0 m: give a finite number from 0.0123"),
    (lambda: de.speed_estimate(0.1, 0.05), "thickness = 0.05 m: give a finite number from 0.00096"),
    (lambda: de.speed_estimate(0.02, 0.0075, physics=de.Physics(0.5)), "friction = 0.5: give a"),
    (lambda: de.smallest_gap(0.0075, 0.0), "height = 0.0 m: give a finite number"),
    (lambda: de.smallest_gap(0.0075, count=1), "count = 1: give a whole number"),
    (lambda: de.simulate_batch(GAPS[0], 0.01),
     "spacing has shape (2,): give (B, N-1), one layout per index b"),
    (lambda: de.simulate_batch([[0.02, np.nan]], 0.01), "spacing[0, 1] = nan m"),
    (lambda: de.simulate_batch(GAPS, [0.01, 0.01]), "thickness has shape (2,)"),
    (lambda: de.simulate_batch(GAPS, 0.01, height=[0.1, 0.05, 0.05]),
     "layout 0: domino 0 (height 0.1 m) would strike 0.0979796 m up domino 1 "),
    (lambda: de.simulate_batch(GAPS, 0.01, tilt=[[0.3, 0, 0]]), "layout 0: domino 0 does not st"),
    (lambda: de.simulate_batch(GAPS, 0.01, rise=[[0.0, 0.021]]),
     "layout 0: domino 2 stands 0.021 m above domino 1"),
    (lambda: de.simulate(LAYOUT).gradient(), "this wave has no saved states of its layout "
     "to differentiate: simulate it with simulate(layout, physics, gradient=True)"),
    (lambda: WAVE.gradient("energy"), "quantity = 'energy': choose one of time"),
    (lambda: WAVE.pullback(np.ones(4)), "arrival_bar has shape (4,): give (2,), a"),
    (lambda: WAVE.pullback([0, np.nan]), "arrival_bar[1] = nan"),
    (lambda: replace(WAVE, layout=de.Layout([], 0.01)).pullback([1.0]), "this wave has no saved"),
    (lambda: WAVE.tape["leader"].fill(9), "assignment destination is read-only"),
    (lambda: WAVE.arrival_times.fill(1.0), "assignment destination is read-only"),
    (lambda: de.simulate(de.Layout([], 0.0075), gradient=True).gradient(),
     "there is no time to differentiate: a single domino has none"),
    (lambda: de.Layout.uniform(0, pitch=0.02), "count = 0"),
    (lambda: de.Layout.uniform(3, pitch=0.02, spacing=0.01),
     "pitch=0.02, spacing=0.01: give either pitch"),
    (lambda: de.Layout.uniform(3, pitch=0.0075),
     "pitch = 0.0075 m: give a finite number, more than 0.0075 (the thickness)"),
    (lambda: de.Layout.uniform(3, spacing=0.01, slope="up"), "slope = 'up' rad: give a finite"),
    (lambda: de.simulate_batch([[0.018]], 0.0075, 0.25), "physics = 0.25: give a Physics"),
    (lambda: BATCH.pullback([1.0]),
     "arrival_bar has shape (1,): give (1, 2), that of the thicknesses"),
    (lambda: de.simulate_standing(LAYOUT, floor_friction=-0.1), "floor_friction = -0.1: give"),
    (lambda: de.verify(LAYOUT, PHYSICS, floors=[-0.3]), "floors[0] = -0.3: give a finite number"),
    (lambda: de.verify(LAYOUT, PHYSICS, engine="mujco"), "engine = 'mujco': choose one of False, "),
    (lambda: de.verify(de.Layout([], 0.0075), PHYSICS), "one domino has no wave"),
    (lambda: de.Ground(slope=1.0).along_ground(3, LAYOUT), "gradient = 3: give a Gradient"),
    (lambda: CURVED.along_ground(replace(ON_CURVES.gradient(), tilt=np.zeros(2)), ON_CURVES.layout),
     "gradient.tilt has shape (2,): give (6,), as of a layout"),
    (lambda: CURVED.along_ground(ON_CURVES.gradient(), LAYOUT),
     "layout.spacing has shape (1,): give (5,), that of the gradient"),
    (lambda: de.Ground(slope=1.0).rise_and_tilt("x", 0.0075), "spacing = 'x': give numbers"),
    (lambda: CURVED.rise_and_tilt([0.01] * 5, [0.0075] * 2),
     "thickness has shape (2,): give (6,), one more than gaps"),
    (lambda: CURVED.rise_and_tilt([-0.02], [0.0075] * 2), "spacing[0] = -0.02 m: give a finite"),
    (lambda: CURVED.rise_and_tilt(np.ones((1, 1, 1)), 0.1), "spacing has shape (1, 1, 1): give"),
    (lambda: de.Layout(np.ma.array([0.01, 0.03], mask=[0, 1]), 0.0075), "spacing = "),
    (lambda: BATCH["a"], "b = 'a': give the index of a wave"),
    (lambda: BATCH[1], "b = 1: give an index less than 1, the number of waves"),
    (lambda: BATCH.wave(0, de.Layout([], 0.0075)), "layout.thickness has shape (1,): give (2,)"),
    (lambda: BATCH.arrival_times.fill(3.0), "assignment destination is read-only"),
    (lambda: de.Layout(Mock(__array__=Mock(side_effect=RuntimeError)), 0.01), "spacing = <Mock id"),
    (lambda: de.simulate_batch([[0.02]], 0.0075, rise=[[1], [1, 2]]), "rise = [[1], [1, 2]]: give"),
    (lambda: de.Tempo(20.0, 40.0, tolerance=1e-3).error([0.1]), "arrivals has shape (1,): give"),
    (lambda: de.Stock((0.005,), (3,)).without(math.nan), "no domino of nan m is in the stock"),
    (lambda: LAYOUT.to_csv(""), "path = '': give a name of 1 to 255 characters"),
    (lambda: de.Layout.read("a" * 300 + ".csv"), "path = 'aaa"),
    (lambda: de.load_scene("a\0.toml"), "name = 'a\\x00.toml': give a name"),
    (lambda: de.fit_friction("ab", "cd"), "pitches = 'ab': give numbers"),
    (lambda: de.fit_friction((0.005,), (60.0,)),
     "rows: x = 0.005 is a gap of -0.0025 m: give more than 0"),
    (lambda: de.fit_friction((0.016,), ()), "1 pitches and 0 frequencies: give one for each"),
    (lambda: CURVED.height([0.1, math.inf]), "x[1] = inf: give a finite number"),
    (lambda: de.Layout([0.02], 0.0075, height=10**400), "height = 1000"),
    (lambda: de.Layout.read(3), "path = 3: give a path, as a string or a pathlib.Path"),
    (lambda: de.simulate_standing(LAYOUT, stop=3), "stop = 3: give a function"),
    (lambda: de.Motion(LAYOUT, PHYSICS).angles([np.nan]), "times[0] = nan s: give a finite number"),
    (lambda: de.clicks(LAYOUT), "wave = Layout(2 dominoes"),
    (lambda: de.measure(np.zeros((2, 9)), 44100, LAYOUT), "samples has shape (2, 9): give (S,)"),
    (lambda: de.measure(np.ones(9), 3, LAYOUT), "rate = 3 samples per second: give"),
    (lambda: de.Ground(profile=np.full((2, 3), np.longdouble(1))), "profile[0]"),
])  # fmt: skip
def test_wrong_arguments_are_rejected(call, words):
    with pytest.raises((ValueError, TypeError, OSError, IndexError), match=f"^{re.escape(words)}"):
        call()


@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda wave: pickle.loads(pickle.dumps(wave))]
)
@pytest.mark.parametrize("name", ["wave", "batch", "standing", "gradient"])
def test_arrays_of_a_copied_result_are_read_only(name, duplicate):
    standing = de.simulate_standing(LAYOUT, rtol=0.1) if name == "standing" else None
    result = {"wave": WAVE, "batch": BATCH, "standing": standing, "gradient": WAVE.gradient()}[name]
    values = [*vars(result).values(), *vars(duplicate(result)).values()]
    arrays = 0
    while values:
        value = values.pop()
        values += value if isinstance(value, tuple) else ()
        arrays += isinstance(value, np.ndarray)
        assert not (isinstance(value, np.ndarray) and value.flags.writeable)
    assert arrays


def test_pieces_of_a_batch_are_complete_when_one_raises(monkeypatch):
    """They write into arrays that the caller may use again after the error."""
    monkeypatch.setattr("domino_env.core.threads.allowed_threads", lambda: 2)
    failed, complete = threading.Event(), []

    def task(first: int, last: int) -> None:
        if first == 0:
            failed.set()
            raise ZeroDivisionError
        failed.wait(10.0)
        complete.append(last - first)

    with pytest.raises(ZeroDivisionError):
        share_pieces(task, 80, 100)
    assert sum(complete) == 70
