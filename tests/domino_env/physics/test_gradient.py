"""Gradients of a wave, compared with differences, multi-precision solutions, and laws."""

import pickle
from dataclasses import astuple, replace

import numpy as np
import pytest
from uneven_layouts import uneven_layout

import domino_env as de
from domino_env.kernels.adjoint.chain import vjp_batch

STEPS = np.array([-2.0, -1.0, -0.5, 0.5, 1.0, 2.0])  # times the smallest step
FINE, COARSE = (np.array([0, 1, -8, 8, -1, 0]) / 6.0, np.array([1, -8, 0, 0, 8, -1]) / 12.0)
PARTS = ("spacing", "thickness", "height", "density", "rise", "tilt")  # flat ground: the first four

grounds = pytest.mark.parametrize("uneven", [False, True], ids=["flat", "uneven"])


def parts(gradient):
    """Return the parts of a gradient; on flat ground those of rise and tilt are missing."""
    return [part for part in astuple(gradient) if part is not None]


def of_time(layout, physics, rtol=1e-12):
    return de.simulate(layout, physics, rtol=rtol, gradient=True).gradient()


def random_layout(rng, count, uneven, unequal=True):
    """Return a layout in which contacts become face contacts and separate."""
    if uneven:
        return uneven_layout(int(rng.integers(1, 1000)), count, unequal=True)
    gaps = rng.uniform(0.004, 0.044, count - 1)
    if not unequal:
        return de.Layout(gaps, 0.0075)
    thick, height = rng.uniform(0.003, 0.012, count), rng.uniform(0.04795, 0.04805, count)
    return de.Layout(gaps, thick, height, density=10.0 ** rng.uniform(2.5, 3.5, count))


def batch_of(layouts, uneven):
    return {n: np.stack([getattr(x, n) for x in layouts]) for n in PARTS[: 6 if uneven else 4]}


def differences(layout, physics, name, uneven, of):
    """Return Richardson's differences by one part of the layout.

    They are nan near a kink: where the numbers of face impacts or separations differ, or the
    differences of two step sizes disagree.
    """
    part = getattr(layout, name)
    size = len(part)
    step = {"rise": np.full(size, 1e-6), "tilt": np.full(size, 1e-4)}.get(name, 1e-4 * part)
    batch = batch_of([layout] * (len(STEPS) * size), uneven)
    moves = STEPS[:, None, None] * np.diag(step)
    batch[name] = batch[name] + moves.reshape(-1, size)
    waves = de.simulate_batch(**batch, physics=physics, rtol=1e-13)
    values = waves.total_time if of == "time" else waves.mean_speed
    values = values.reshape(len(STEPS), size)
    events = (waves.flushes * 1000 + waves.releases).reshape(len(STEPS), size)
    fine, coarse = FINE @ values / step, COARSE @ values / step
    same = (events == events[0]).all(axis=0) & np.isfinite(values).all(axis=0)
    agree = np.abs(fine - coarse) < 1e-6 * np.abs(fine).max()
    return np.where(same & agree, fine, np.nan)


@grounds
@pytest.mark.parametrize("friction", [0.0, 0.25, 0.6])
def test_gradients_match_finite_differences(friction, uneven):
    rng = np.random.default_rng(round(100 * friction))
    checked = kinks = flushes = releases = 0
    while checked < 20:
        layout = random_layout(rng, 9, uneven, unequal=checked % 2 == 0)
        physics = de.Physics(friction, 9.81, rng.uniform(10.0, 40.0))
        wave = de.simulate(layout, physics, rtol=1e-12, gradient=True)
        if wave.outcome != de.Outcome.PROPAGATED or wave.stall_margin.min() < 1e-3:
            continue
        of = "speed" if checked % 4 > 1 else "time"
        gradient = wave.gradient(of)
        for name in PARTS[: 6 if uneven else 4]:
            exact = getattr(gradient, name)
            fine = differences(layout, physics, name, uneven, of)
            smooth = np.isfinite(fine)
            kinks += int((~smooth).sum())
            assert np.abs(exact - fine)[smooth].max(initial=0.0) < 1e-7 * np.abs(exact).max()
        flushes, releases = flushes + wave.flushes, releases + wave.releases
        checked += 1
    assert flushes > 30
    assert releases > 0 or uneven
    assert kinks < 50  # of 700 derivatives, of 1040 on uneven ground


# change of the last time from the sizes `low` with a larger friction to `high` with a smaller one,
# by `precise.precise_wave`
@pytest.mark.parametrize(("uneven", "friction", "change"), [
    (False, 0.0, 1.5631871211118127e-08), (True, 0.3, -1.1369952780932147e-08),
])  # fmt: skip
def test_the_gradient_matches_multi_precision_solutions(friction, uneven, change):
    """Compare the derivative along one direction in which all sizes change.

    The scaling laws relate gravity and push to the other derivatives.
    """
    flat = de.Layout([0.004, 0.03, 0.02], np.array([7.5, 6.0, 9.0, 5.0]) * 1e-3)
    layout, physics = uneven_layout(7, 3) if uneven else flat, de.Physics(friction, push=14.0)
    wave = de.simulate(layout, physics, rtol=1e-13, gradient=True)
    assert wave.flushes > 0
    rng, gradient = np.random.default_rng(0), wave.gradient()
    way = {"spacing": 1e-9, "thickness": 1e-9} | ({"rise": 1e-9, "tilt": 1e-7} if uneven else {})
    way = {n: size * rng.uniform(-1.0, 1.0, len(getattr(layout, n))) for n, size in way.items()}
    low, high = (
        replace(layout, **{n: getattr(layout, n) + sign * move for n, move in way.items()})
        for sign in (-1.0, 1.0)
    )
    exact = sum(float((getattr(high, n) - getattr(low, n)) @ getattr(gradient, n)) for n in way)
    smoother = 1e-8 * (friction > 0.0)
    exact += ((friction - smoother) - (friction + smoother)) * gradient.friction
    assert change == pytest.approx(exact, rel=1e-9 if uneven else 1e-10)


# friction, push 1 + 1e-7 times the smallest [rad/s], and the derivative of the last time by it
# [s²/rad], by `precise_wave` between pushes 1e-10 of the push above and below
@pytest.mark.parametrize(("friction", "push", "derivative"), [
    (0.25, 2.8763733065926576, -202896.50232592), (0.0, 2.7228503907455495, -214265.43019713),
])  # fmt: skip
def test_the_gradient_near_a_stall_is_large_and_accurate(friction, push, derivative):
    layout, physics = de.Layout([0.011, 0.009], 0.0075), de.Physics(friction, push=push)
    wave = de.simulate(layout, physics, rtol=1e-10, gradient=True)
    assert wave.stall_margin.min() < 2e-6
    assert wave.gradient().push == pytest.approx(derivative, rel=1e-6)
    assert abs(derivative) > 1e4 * abs(of_time(layout, physics.replace(push=2.0 * push)).push)


# laws -----------------------------------------------------------------------------------------


@pytest.fixture(params=[0.0, 0.25], ids=["without friction", "with friction"])
def wave(request):
    layout = random_layout(np.random.default_rng(8), 14, uneven=False)
    wave = de.simulate(layout, de.Physics(request.param, 9.81, 30.0), rtol=1e-12, gradient=True)
    assert wave.outcome == de.Outcome.PROPAGATED
    assert wave.flushes > 0
    return wave


def test_gradients_obey_the_scaling_laws(wave):
    """Times scale by the root of lengths and the inverse root of gravity, not by density."""
    g, layout, physics, total = wave.gradient(), wave.layout, wave.physics, wave.arrival_times[-1]
    by_length = (
        layout.spacing @ g.spacing + layout.thickness @ g.thickness + layout.height @ g.height
    )
    by_push = physics.push * g.push
    assert by_length - 0.5 * by_push == pytest.approx(0.5 * total, rel=1e-9)
    assert physics.gravity * g.gravity + 0.5 * by_push == pytest.approx(-0.5 * total, rel=1e-9)
    by_density = layout.density * g.density
    assert abs(by_density.sum()) < 1e-12 * np.abs(by_density).sum()


def test_later_dominoes_cannot_change_earlier_times(wave):
    for k in (1, 5, 12):
        bar = np.zeros(14)
        bar[k] = 1.0
        g = wave.pullback(bar)
        assert not g.spacing[k:].any()
        for part in (g.thickness, g.height, g.density):
            assert not part[k + 1 :].any()
        assert g.spacing[k - 1] != 0.0


# kinks, edges, batches ------------------------------------------------------------------------


def test_the_gradient_at_a_kink_is_that_of_one_side():
    physics = de.Physics(0.25, 9.81, 14.0)

    def layout(gap):
        return de.Layout([0.012, gap, 0.02, 0.03], 0.0075)

    low, high = 0.015, 0.03
    flushes = [de.simulate(layout(gap), physics).flushes for gap in (low, high)]
    assert flushes[0] != flushes[1]
    while high - low > 1e-15:
        middle = 0.5 * (low + high)
        same = de.simulate(layout(middle), physics, rtol=1e-13).flushes == flushes[0]
        low, high = (middle, high) if same else (low, middle)
    sides = [of_time(layout(gap), physics).spacing[1] for gap in (low - 1e-9, high + 1e-9)]
    for gap in (low, high):
        at = of_time(layout(gap), physics).spacing[1]
        assert min(abs(at - side) for side in sides) < 1e-4 * max(map(abs, sides))


@pytest.mark.parametrize("friction", [0.0, 0.25])
def test_equal_and_nearly_equal_gaps_have_the_same_gradient(friction):
    """Simultaneous face impacts have finite gradients; uniform layouts take their own code path.

    A 1e-12 difference in one gap takes another path through the code, to the same gradient.
    """
    together = de.Layout(np.r_[np.full(6, 0.005), np.full(6, 0.02)], 0.0075)
    g = of_time(together, de.Physics(friction, 9.81, 24.0))
    assert all(np.isfinite(part).all() for part in parts(g))
    even, physics = de.Layout.uniform(60, pitch=0.016), de.Physics(friction, 9.81, 8.0)
    gaps = even.spacing.copy()
    gaps[-1] *= 1.0 + 1e-12
    for rtol, tolerance in ((1e-12, 1e-8), (1e-6, 1e-3)):
        shared, general = (of_time(x, physics, rtol) for x in (even, de.Layout(gaps, 0.0075)))
        for a, b in zip(parts(shared), parts(general), strict=True):
            assert a == pytest.approx(b, rel=tolerance, abs=tolerance * np.abs(b).max())


@grounds
def test_a_batch_gives_the_gradient_of_each(uneven):
    rng = np.random.default_rng(3)
    layouts = [random_layout(rng, 12, uneven, unequal=uneven) for _ in range(40)]
    layouts[7] = replace(layouts[7], spacing=np.full(11, 0.06))
    batch = de.simulate_batch(**batch_of(layouts, uneven), rtol=1e-8, gradient=True)
    assert batch.outcome[7] == de.Outcome.OUT_OF_REACH
    bars = rng.standard_normal((40, 12))
    compiled = vjp_batch.signatures
    pulled = pickle.loads(pickle.dumps(batch)).pullback(np.asfortranarray(bars))
    assert vjp_batch.signatures == compiled  # neither needs kernels of its own
    for b, layout in enumerate(layouts):
        one = de.simulate(layout, de.Physics(), rtol=1e-8, gradient=True)
        if one.outcome != de.Outcome.PROPAGATED:
            assert not any(np.any(part[b]) for part in (*parts(batch.gradient), *parts(pulled)))
            continue
        assert batch.total_time[b] == one.arrival_times[-1]
        for part, whole in zip(parts(one.gradient()), parts(batch.gradient), strict=True):
            assert np.array_equal(part, whole[b])
        for part, whole in zip(parts(one.pullback(bars[b])), parts(pulled), strict=True):
            assert np.array_equal(part, whole[b])


def test_the_pullback_of_a_stopped_wave_covers_the_dominoes_reached():
    layout = de.Layout([0.012, 0.02, 0.06, 0.02], 0.0075)
    wave = de.simulate(layout, de.Physics(0.25, push=10.0), gradient=True)
    assert wave.outcome == de.Outcome.OUT_OF_REACH
    g = wave.pullback([0.0, 0.0, 1.0, 0.0, 0.0])
    assert g.spacing[:2].all()
    assert not g.spacing[2:].any()
    with pytest.raises(ValueError, match=r"arrival_bar\[3\] = 1.0, but the wave did not reach"):
        wave.pullback([0.0, 0.0, 1.0, 1.0, 0.0])
    with pytest.raises(ValueError, match="there is no time to differentiate: a gap is out of"):
        wave.gradient()
