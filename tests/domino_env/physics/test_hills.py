"""Rows over ground that is not flat: laws, gradients, contacts as drawn, what is refused."""

import pickle
import re
from dataclasses import astuple

import numpy as np
import oracle
import pytest
from hilly_rows import hilly_row

import domino_env as de
from domino_env.physics.motion import Motion, outlines
from domino_env.validation.ode import integrate
from domino_env.validation.precise import precise_wave

PARTS = ("spacing", "thickness", "height", "density", "rise", "tilt")
STEPS = np.array([-2.0, -1.0, 1.0, 2.0])
WEIGHTS = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0


def test_two_dominoes_on_level_treads():
    """The second 10 mm higher: Ω = .771 and ω⁺/ω⁻ = .4344 at the hit."""
    layout = de.Layout([0.02], [0.0075, 0.0075], rise=0.01)
    wave = de.simulate(layout, de.Physics(0.25), rtol=1e-12)
    assert wave.release_velocity[1] / wave.impact_velocity[0] == pytest.approx(0.4344, abs=5e-5)
    chain = oracle.Chain([0.02], [0.0075, 0.0075], 0.048, 1040.0, 0.25, 9.81, rise=0.01)
    theta = chain.angles(1, 0.0)
    assert chain.ratios(chain.contacts(1, theta))[0] == pytest.approx(0.771, abs=5e-4)


@pytest.mark.parametrize("slope", [-0.1, 0.1])
def test_an_even_slope_is_flat_ground_under_turned_gravity(slope):
    rng = np.random.default_rng(3)
    gaps, thick = rng.uniform(0.006, 0.03, 9), rng.uniform(0.007, 0.01, 10)
    layout = de.Layout(gaps, thick, rise=-(gaps + thick[1:]) * np.sin(slope), tilt=slope)
    wave = de.simulate(layout, de.Physics(push=14.0), rtol=1e-12)
    slow = oracle.topple(gaps, thick, push=14.0, turned=slope)
    np.testing.assert_allclose(wave.arrival_times, slow.arrival, rtol=1e-11)
    np.testing.assert_allclose(layout.positions, de.Layout(gaps, thick).positions, rtol=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_other_units(friction):
    """Lengths × k and push/√k give times × √k; later dominoes change nothing earlier."""
    row = hilly_row(3, 14, unequal=True)
    wave = de.simulate(row, de.Physics(friction, push=16.0), rtol=1e-12)
    k = 0.37
    small = de.Layout(
        k * row.spacing, k * row.thickness, k * row.height, 1.0, row.density, k * row.rise, row.tilt
    )
    other = de.simulate(small, de.Physics(friction, push=16.0 / np.sqrt(k)), rtol=1e-12)
    np.testing.assert_allclose(other.arrival_times, np.sqrt(k) * wave.arrival_times, 2e-12)
    part = de.Layout(
        row.spacing[:6], row.thickness[:7], row.height[:7], 1.0, row.density[:7], row.rise[:6],
        row.tilt[:7],
    )  # fmt: skip
    first = de.simulate(part, de.Physics(friction, push=16.0), rtol=1e-12)
    np.testing.assert_array_equal(first.arrival_times, wave.arrival_times[:7])


@pytest.mark.parametrize("of", ["time", "speed"])
@pytest.mark.parametrize(("friction", "seed"), [(0.0, 1), (0.2, 2), (0.5, 5)])
def test_gradients_against_differences(friction, seed, of):
    """Rows that flush and slip off; where differences see a kink they say nothing."""
    row, physics = hilly_row(seed, 9, unequal=True), de.Physics(friction, push=20.0)
    wave = de.simulate(row, physics, rtol=1e-13, gradient=True)
    assert wave.outcome == de.Outcome.PROPAGATED
    assert wave.flushes > 0
    gradient, seen = wave.gradient(of), 0
    for name in PARTS:
        exact, size = getattr(gradient, name), len(getattr(row, name))
        step = {"tilt": 1e-4, "density": 0.1}.get(name, 1e-6)
        parts = {n: np.tile(getattr(row, n), (4 * size, 1)) for n in PARTS}
        parts[name] += np.kron(STEPS * step, np.eye(size)).reshape(size, 4, size).swapaxes(0, 1).reshape(-1, size)  # noqa: E501  # fmt: skip
        found = de.simulate_batch(physics=physics, rtol=1e-13, record=False, **parts)
        values = found.total_time if of == "time" else found.mean_speed
        fine = WEIGHTS @ values.reshape(4, size) / step
        coarse = np.array([-0.25, 0.0, 0.0, 0.25]) @ values.reshape(4, size) / step
        smooth = np.abs(fine - coarse) < 1e-4 * np.abs(fine).max()
        assert np.abs(exact - fine)[smooth].max() < 2e-8 * np.abs(exact).max()
        seen += int(smooth.sum())
    assert seen > 40  # of 52


def test_gradients_against_sixty_digits():
    """Along one direction through everything, from waves of four dominoes."""
    row, physics = hilly_row(5, 4), de.Physics(0.3, push=14.0)
    wave = de.simulate(row, physics, rtol=1e-13, gradient=True)
    assert wave.flushes > 0
    rng, ends = np.random.default_rng(0), []
    ways = {"spacing": 1e-9, "thickness": 1e-9, "rise": 1e-9, "tilt": 1e-7}
    ways = {n: size * rng.uniform(-1.0, 1.0, len(getattr(row, n))) for n, size in ways.items()}
    for sign in (-1.0, 1.0):
        parts = {n: getattr(row, n) + sign * way for n, way in ways.items()}
        ends.append((parts, precise_wave(de.Layout(**parts), physics).arrival_times[-1]))
    gradient = wave.gradient()
    exact = sum(float((ends[1][0][n] - ends[0][0][n]) @ getattr(gradient, n)) for n in ways)
    assert float(ends[1][1] - ends[0][1]) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("method", ["rk4", "DOP853"])
def test_steppers_and_sixty_digits_agree(method):
    row, physics = hilly_row(7, 4), de.Physics(0.25, push=12.0)
    wave = de.simulate(row, physics, rtol=1e-13)
    assert precise_wave(row, physics).relative_error(wave.arrival_times) < 2e-15
    stepped = integrate(row, physics, method, 1e-4 if method == "rk4" else 1e-11)
    np.testing.assert_allclose(stepped.arrival_times, wave.arrival_times, rtol=1e-9)


def test_a_uniform_row_on_a_slope_becomes_the_steady_wave():
    for slope in (-0.06, 0.1):
        steady = de.steady_wave(0.024, 0.0075, slope=slope)
        wave = de.simulate(
            de.Layout.uniform(60, pitch=0.024, slope=slope), de.Physics(), rtol=1e-12
        )
        assert wave.release_velocity[-2] == pytest.approx(steady.omega_release, rel=1e-8)
        assert 0.024 / np.diff(wave.arrival_times)[-1] == pytest.approx(steady.speed, rel=1e-8)
    flat = de.steady_wave(0.024, 0.0075)
    assert de.steady_wave(0.024, 0.0075, slope=0.0).speed == flat.speed < steady.speed


def test_the_smallest_push_is_just_enough():
    row = hilly_row(5, 8)
    least = de.smallest_push(row, de.Physics(0.2))
    for excess, outcome in ((1e-9, "PROPAGATED"), (-1e-9, "STALLED")):
        push = de.Physics(0.2, push=least * (1.0 + excess))
        assert de.simulate(row, push, rtol=1e-13).outcome.name == outcome


def test_contacts_are_closed_where_they_are_drawn():
    """Behind the leader a tip lies on a rear face or an edge on a front, and none overlap."""
    row, physics = hilly_row(3, 10), de.Physics(0.2, push=14.0)
    wave, motion = de.simulate(row, physics), Motion(row, physics)
    assert wave.flushes > 0
    assert wave.releases == 0
    times = np.append(0.5 * (wave.arrival_times[1:] + wave.arrival_times[:-1]), motion.end)
    leaders, _ = motion.leader(times)
    np.testing.assert_array_equal(motion.angles(0.0)[0], row.tilt)
    for leader, leans in zip(leaders, motion.angles(times), strict=True):
        foot, top, _, edge = outlines(row, leans).swapaxes(0, 1)
        tips = oracle.dot(edge[1:] - top[:-1], oracle.ahead(leans[1:]))  # short of the rear face
        edges = oracle.dot(edge[1:] - foot[:-1], oracle.ahead(leans[:-1]))
        apart = np.minimum(tips, edges)
        np.testing.assert_allclose(apart[:leader], 0.0, atol=1e-12)
        assert (apart[leader:] > 0.0).all()


def test_a_diagnosis_agrees_with_the_wave():
    row, physics = hilly_row(3, 12), de.Physics(0.25, push=14.0)
    wave, found = de.simulate(row, physics, rtol=1e-10), de.diagnose(row, physics)
    assert found.outcome is wave.outcome
    np.testing.assert_allclose(found.stall_margin, wave.stall_margin, rtol=1e-6)
    assert found.flush_loss.max() == pytest.approx(wave.largest_flush_loss, rel=1e-6)


def test_batches_give_what_single_rows_give():
    rows = [hilly_row(seed, 12, unequal=True) for seed in range(6)]
    stacked = {name: np.stack([getattr(row, name) for row in rows]) for name in PARTS}
    batch = de.simulate_batch(physics=de.Physics(), rtol=1e-8, **stacked)
    pulled = de.simulate_batch(physics=de.Physics(), rtol=1e-8, gradient=True, **stacked)
    for b, row in enumerate(rows):
        wave = de.simulate(row, de.Physics(), gradient=True)
        np.testing.assert_array_equal(batch.arrival_times[b], wave.arrival_times)
        assert batch.mean_speed[b] == wave.mean_speed
        if wave.outcome == de.Outcome.PROPAGATED:
            single, many = astuple(wave.gradient()), astuple(pulled.gradient)
            for one, all_of in zip(single, many, strict=True):
                np.testing.assert_array_equal(one, all_of[b])


@pytest.mark.parametrize("name", ["row.csv", "row.json"])
def test_files_and_copies_keep_the_ground(tmp_path, name):
    row = hilly_row(1, 7)
    (row.to_csv if name.endswith("csv") else row.to_json)(tmp_path / name)
    for again in (de.Layout.read(tmp_path / name), pickle.loads(pickle.dumps(row))):
        assert again == row
        assert hash(again) == hash(row)
    assert row != de.Layout(row.spacing, row.thickness)
    (tmp_path / "hand.csv").write_text(
        "spacing_mm,thickness_mm,rise_mm,tilt_deg\n12,7.5,-0.5,2\n15,7.5,0,1.5\n,7.5,,1\n"
    )
    hand = de.Layout.read(tmp_path / "hand.csv")
    np.testing.assert_allclose(hand.rise, [-0.0005, 0.0])
    np.testing.assert_allclose(hand.tilt, np.radians([2.0, 1.5, 1.0]))
    de.Layout.uniform(3, pitch=0.02).to_csv(tmp_path / "flat.csv")
    assert "rise" not in (tmp_path / "flat.csv").read_text()


@pytest.mark.parametrize(
    ("ground", "words"),
    [
        ({"tilt": 0.16}, "domino 0 does not stand: tilt[0] is 9.167°, and it tips over by itself"),
        ({"tilt": [0.0, 0.0, -0.2]}, "domino 2 does not stand: tilt[2] is -11.46°"),
        (
            {"rise": [0.0, 0.021]},
            "stands 0.021 m above domino 1, seen from its own ground: that is",
        ),
        ({"rise": -0.01}, "domino 0 (height 0.048 m) would strike 0.0536"),
        ({"tilt": [0.15, -0.15, 0.0], "spacing": [0.01, 0.02]}, "lean against each other before"),
        ({"rise": [np.nan, 0.0]}, "rise[0] = nan m: must be finite"),
        ({"rise": [0.0, 0.0, 0.0]}, "rise has shape (3,): give one number or one a pair, (2,)"),
    ],
)
def test_what_cannot_stand_is_refused(ground, words):
    row = {"spacing": [0.02, 0.02], "thickness": [0.0075] * 3} | ground
    with pytest.raises(ValueError, match=re.escape(words)):
        de.Layout(**row)
    if np.ndim(ground.get("rise", 0)) == 0 or len(ground["rise"]) == 2:
        batch = {name: np.atleast_2d(value) for name, value in row.items()}
        if "tilt" in ground:
            batch["tilt"] = np.broadcast_to(ground["tilt"], (1, 3))
        with pytest.raises(ValueError, match=re.escape("layout 0: ")):
            de.simulate_batch(physics=de.Physics(), **batch)


def test_scenes_on_flat_ground_refuse_hills():
    scene = de.load_scene("ideal")
    assert any("flat" in broken for broken in scene.violations(hilly_row(1, scene.count)))
