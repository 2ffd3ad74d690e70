"""Gradients of a wave: against differences, against many digits, and by laws."""

from __future__ import annotations

from dataclasses import astuple
from typing import Any

import numpy as np
import pytest

from domino_env.physics.gradient import Gradient
from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.steady import smallest_push
from domino_env.physics.wave import Outcome, Wave, simulate, simulate_batch
from domino_env.validation.precise import precise_wave

STEPS = np.array([-2.0, -1.0, -0.5, 0.5, 1.0, 2.0])  # times the smallest step
FINE, COARSE = (np.array([0, 1, -8, 8, -1, 0]) / 6.0, np.array([1, -8, 0, 0, 8, -1]) / 12.0)


def parts(gradient: Gradient) -> list[Any]:
    """Return what a gradient has; on flat ground there is nothing of the ground."""
    return [part for part in astuple(gradient) if part is not None]


def of_time(layout: Layout, physics: Physics, rtol: float = 1e-12) -> Gradient:
    return simulate(layout, physics, rtol=rtol, gradient=True).gradient()


def random_row(rng: np.random.Generator, count: int, unequal: bool) -> tuple[np.ndarray, ...]:
    """Spacing, thickness, height, density of a row in which links flush and slip off."""
    height = rng.uniform(0.04795, 0.04805, count) if unequal else np.full(count, 0.048)
    return (
        rng.uniform(0.004, 0.044, count - 1),
        rng.uniform(0.003, 0.012, count) if unequal else np.full(count, 0.0075),
        height,
        10.0 ** rng.uniform(2.5, 3.5, count) if unequal else np.full(count, 1040.0),
    )


def differences(row: tuple[np.ndarray, ...], physics: Physics, what: int) -> np.ndarray:
    """Richardson's differences of the total time by one of the four parts; nan where they see a
    kink: another sequence of flushes and releases, or two step sizes that disagree."""
    part = row[what]
    size = len(part)
    step = 1e-4 * part
    batch = []
    for other in row:
        batch.append(np.repeat(other[None], len(STEPS) * size, axis=0))
    for k, factor in enumerate(STEPS):
        i = np.arange(size)
        batch[what][k * size + i, i] += factor * step
    found = simulate_batch(
        batch[0], batch[1], physics, height=batch[2], density=batch[3], rtol=1e-13
    )
    times = found.total_time.reshape(len(STEPS), size)
    events = (found.flushes * 1000 + found.releases).reshape(len(STEPS), size)
    fine, coarse = FINE @ times / step, COARSE @ times / step
    same = (events == events[0]).all(axis=0) & np.isfinite(times).all(axis=0)
    agree = np.abs(fine - coarse) < 1e-6 * np.abs(fine).max()
    return np.where(same & agree, fine, np.nan)


@pytest.mark.parametrize("friction", [0.0, 0.25, 0.6])
def test_all_of_a_row_by_differences(friction: float) -> None:
    rng = np.random.default_rng(round(100 * friction))
    checked = kinks = flushes = releases = 0
    while checked < 40:
        row = random_row(rng, 9, unequal=checked % 2 == 0)
        physics = Physics(friction, 9.81, rng.uniform(10.0, 40.0))
        wave = simulate(Layout(*row[:3], 0.024, row[3]), physics, rtol=1e-12, gradient=True)
        if wave.outcome != Outcome.PROPAGATED or wave.stall_margin.min() < 1e-3:
            continue
        gradient = wave.gradient()
        parts = (gradient.spacing, gradient.thickness, gradient.height, gradient.density)
        for what, exact in enumerate(parts):
            fine = differences(row, physics, what)
            seen = np.isfinite(fine)
            kinks += int((~seen).sum())
            size = np.abs(exact).max()
            assert np.abs(exact - fine)[seen].max(initial=0.0) < 1e-7 * size
            assert seen.sum() >= len(exact) / 2
        flushes, releases = flushes + wave.flushes, releases + wave.releases
        checked += 1
    assert flushes > 60
    assert releases > 0
    assert kinks < 100  # of 1400 derivatives


def test_physics_by_differences() -> None:
    rng = np.random.default_rng(4)
    for _ in range(20):
        row = Layout(rng.uniform(0.006, 0.04, 11), 0.0075)
        values = {"friction": 0.25, "gravity": 9.81, "push": rng.uniform(12.0, 30.0)}
        gradient = of_time(row, Physics(**values))
        for name, value in values.items():
            times, kinds = [], set()
            for factor in STEPS:
                other = Physics(**{**values, name: value * (1.0 + 1e-4 * factor)})
                wave = simulate(row, other, rtol=1e-13)
                times.append(wave.arrival_times[-1])
                kinds.add((wave.flushes, wave.releases))
            fine, coarse = (w @ np.array(times) / (1e-4 * value) for w in (FINE, COARSE))
            if len(kinds) == 1 and abs(fine / coarse - 1.0) < 1e-6:
                assert getattr(gradient, name) == pytest.approx(fine, rel=1e-7)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_against_differences_of_sixty_digits(friction: float) -> None:
    """The same equations, solved without quadrature tables, tails or tolerances."""
    gaps, thick = np.array([0.004, 0.03, 0.02]), np.array([7.5, 6.0, 9.0, 5.0]) * 1e-3
    physics = Physics(friction, 9.81, 14.0)
    wave = simulate(Layout(gaps, thick), physics, rtol=1e-13, gradient=True)
    assert wave.flushes > 0
    gradient = wave.gradient()
    for parts, exact, i in (
        (gaps, gradient.spacing, 0),
        (gaps, gradient.spacing, 2),
        (thick, gradient.thickness, 0),
        (thick, gradient.thickness, 2),
    ):
        times, places = [], []
        for sign in (-1.0, 1.0):
            kept = parts[i]
            parts[i] = kept * (1.0 + sign * 1e-6)
            times.append(precise_wave(Layout(gaps, thick), physics).arrival_times[-1])
            places.append(parts[i])
            parts[i] = kept
        slope = float((times[1] - times[0]) / (places[1] - places[0]))
        assert exact[i] == pytest.approx(slope, rel=1e-10)


@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_near_a_stall_it_is_large_and_right(friction: float) -> None:
    row = Layout([0.011, 0.009, 0.012, 0.010], 0.0075)
    least = smallest_push(row, Physics(friction))
    physics = Physics(friction, 9.81, least * (1.0 + 1e-7))
    wave = simulate(row, physics, rtol=1e-10, gradient=True)
    assert wave.stall_margin.min() < 2e-6
    step = 1e-10 * least  # small against the excess
    times = [
        precise_wave(row, Physics(friction, 9.81, physics.push + sign * step)).arrival_times[-1]
        for sign in (-1.0, 1.0)
    ]
    width = (physics.push + step) - (physics.push - step)
    slope = float((times[1] - times[0]) / width)
    assert wave.gradient().push == pytest.approx(slope, rel=1e-6)
    assert abs(slope) > 1e4 * abs(of_time(row, Physics(friction, 9.81, 2.0 * least)).push)


# laws -----------------------------------------------------------------------------------------


@pytest.fixture(params=[0.0, 0.25], ids=["without friction", "with friction"])
def wave(request: pytest.FixtureRequest) -> Wave:
    rng = np.random.default_rng(8)
    row = Layout(*random_row(rng, 14, unequal=True)[:3], 0.024, 10.0 ** rng.uniform(2.5, 3.5, 14))
    wave = simulate(row, Physics(request.param, 9.81, 30.0), rtol=1e-12, gradient=True)
    assert wave.outcome == Outcome.PROPAGATED
    assert wave.flushes > 0
    return wave


def test_lengths_scale_times_by_their_root(wave: Wave) -> None:
    g, row = wave.gradient(), wave.layout
    by_length = row.spacing @ g.spacing + row.thickness @ g.thickness + row.height @ g.height
    by_push = wave.physics.push * g.push
    assert by_length - 0.5 * by_push == pytest.approx(0.5 * wave.arrival_times[-1], rel=1e-9)


def test_gravity_scales_times_by_its_inverse_root(wave: Wave) -> None:
    g, physics = wave.gradient(), wave.physics
    scaled = physics.gravity * g.gravity + 0.5 * physics.push * g.push
    assert scaled == pytest.approx(-0.5 * wave.arrival_times[-1], rel=1e-9)


def test_a_common_density_changes_nothing(wave: Wave) -> None:
    parts = wave.layout.density * wave.gradient().density
    assert abs(parts.sum()) < 1e-12 * np.abs(parts).sum()


def test_what_stands_later_cannot_change_what_fell_before(wave: Wave) -> None:
    for k in (1, 5, 12):
        bar = np.zeros(14)
        bar[k] = 1.0
        g = wave.pullback(bar)
        assert not g.spacing[k:].any()
        for part in (g.thickness, g.height, g.density):
            assert not part[k + 1 :].any()
        assert g.spacing[k - 1] != 0.0


def test_a_pullback_is_linear(wave: Wave) -> None:
    rng = np.random.default_rng(1)
    one, two = rng.standard_normal((2, 14))
    both = wave.pullback(2.0 * one - two)
    first, second = wave.pullback(one), wave.pullback(two)
    for a, b, c in zip(parts(first), parts(second), parts(both), strict=True):
        assert 2.0 * a - b == pytest.approx(c, rel=1e-12, abs=1e-12 * np.abs(c).max())


def test_the_speed_is_the_way_over_the_time(wave: Wave) -> None:
    time, speed = wave.gradient("time"), wave.gradient("speed")
    total = wave.arrival_times[-1]
    way = np.r_[0.0, np.ones(13)]
    assert speed.spacing == pytest.approx((1.0 - wave.mean_speed * time.spacing) / total)
    assert speed.thickness == pytest.approx((way - wave.mean_speed * time.thickness) / total)
    assert speed.friction == pytest.approx(-wave.mean_speed * time.friction / total)


def test_asking_for_a_gradient_changes_no_bit_of_the_wave(wave: Wave) -> None:
    plain = simulate(wave.layout, wave.physics, rtol=1e-12)
    assert np.array_equal(plain.arrival_times, wave.arrival_times)
    assert plain.tape is None


# kinks, edges, many at once -------------------------------------------------------------------


def test_at_the_onset_of_a_flush_it_is_one_of_the_two_sides() -> None:
    physics = Physics(0.25, 9.81, 14.0)

    def row(gap: float) -> Layout:
        return Layout([0.012, gap, 0.02, 0.03], 0.0075)

    low, high = 0.015, 0.03
    flushes = [simulate(row(gap), physics).flushes for gap in (low, high)]
    assert flushes[0] != flushes[1]
    while high - low > 1e-15:
        middle = 0.5 * (low + high)
        if simulate(row(middle), physics, rtol=1e-13).flushes == flushes[0]:
            low = middle
        else:
            high = middle
    sides = [of_time(row(gap), physics).spacing[1] for gap in (low - 1e-9, high + 1e-9)]
    for gap in (low, high):
        at = of_time(row(gap), physics).spacing[1]
        assert min(abs(at - side) for side in sides) < 1e-4 * max(map(abs, sides))


def test_equal_gaps_that_flush_together_have_a_finite_gradient() -> None:
    row = Layout(np.r_[np.full(6, 0.005), np.full(6, 0.02)], 0.0075)
    for friction in (0.0, 0.25):
        g = of_time(row, Physics(friction, 9.81, 24.0))
        assert all(np.isfinite(part).all() for part in parts(g))


def test_a_batch_gives_what_each_gives() -> None:
    rng = np.random.default_rng(3)
    gaps = rng.uniform(0.002, 0.04, (40, 19))
    gaps[7] = 0.002
    physics = Physics(0.25, push=8.0)
    batch = simulate_batch(gaps, 0.0075, physics, rtol=1e-8, gradient=True)
    assert batch.gradient is not None
    assert batch.outcome[7] != Outcome.PROPAGATED
    for b, row in enumerate(gaps):
        one = simulate(Layout(row, 0.0075), physics, rtol=1e-8, gradient=True)
        if one.outcome != Outcome.PROPAGATED:
            assert not any(np.any(part[b]) for part in parts(batch.gradient))
            continue
        assert batch.total_time[b] == one.arrival_times[-1]
        for part, whole in zip(parts(one.gradient()), parts(batch.gradient), strict=True):
            assert np.array_equal(part, whole[b])


def test_a_long_row_takes_as_many_bytes_a_domino_as_a_short_one() -> None:
    used = []
    for count in (1000, 20_000):
        gaps = np.random.default_rng(2).uniform(0.01, 0.02, count - 1)
        wave = simulate(Layout(gaps, 0.0075), Physics(), rtol=1e-6, gradient=True)
        assert wave.tape is not None
        used.append(wave.tape.nbytes / count)
        g = wave.gradient()
        late = g.spacing[-1000:-100]
        assert np.abs(late).min() > 0.01
    assert used[1] < 1.2 * used[0]


def test_a_wave_that_died_pulls_back_what_it_reached() -> None:
    row = Layout([0.012, 0.02, 0.06, 0.02], 0.0075)
    wave = simulate(row, Physics(0.25, push=10.0), gradient=True)
    assert wave.outcome == Outcome.OUT_OF_REACH
    g = wave.pullback([0.0, 0.0, 1.0, 0.0, 0.0])
    assert g.spacing[:2].all()
    assert not g.spacing[2:].any()
    with pytest.raises(ValueError, match=r"arrival_bar\[3\] = 1.0, but the wave never came to"):
        wave.pullback([0.0, 0.0, 1.0, 1.0, 0.0])
    with pytest.raises(ValueError, match="there is no time to differentiate: a gap is out of"):
        wave.gradient()


def test_what_cannot_be_differentiated_is_told() -> None:
    row = Layout.uniform(5, pitch=0.02)
    with pytest.raises(ValueError, match=r"simulate\(layout, physics, gradient=True\)"):
        simulate(row, Physics()).gradient()
    wave = simulate(row, Physics(), gradient=True)
    with pytest.raises(ValueError, match="'time' or its 'speed'"):
        wave.gradient("energy")
    with pytest.raises(ValueError, match=r"shape \(4,\): give one number for each of the 5"):
        wave.pullback(np.ones(4))
    with pytest.raises(ValueError, match=r"arrival_bar\[2\] = nan"):
        wave.pullback([0.0, 0.0, np.nan, 0.0, 0.0])
    alone = simulate(Layout(np.empty(0), [0.0075]), Physics(), gradient=True)
    with pytest.raises(ValueError, match="a single domino has none"):
        alone.gradient()


@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_uniform_rows_share_their_stack_and_nothing_else(friction: float) -> None:
    """A hair of difference in one gap walks another way through the code, to the same answer."""
    physics = Physics(friction, 9.81, 8.0)
    even = Layout.uniform(60, pitch=0.016)
    gaps = even.spacing.copy()
    gaps[-1] *= 1.0 + 1e-12
    for rtol, tolerance in ((1e-12, 1e-8), (1e-6, 1e-3)):
        shared = of_time(even, physics, rtol)
        apart = of_time(Layout(gaps, even.thickness), physics, rtol)
        for a, b in zip(parts(shared), parts(apart), strict=True):
            assert a == pytest.approx(b, rel=tolerance, abs=tolerance * np.abs(b).max())
