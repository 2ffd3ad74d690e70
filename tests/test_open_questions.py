"""The page of open questions: its numbers are those of its program, its formulas hold."""

import numpy as np
import pytest

import domino_env as de
from domino_env.core.tables import fill_tables


@pytest.fixture(scope="module")
def questions(script):
    return script("docs/open_questions.py")


def test_the_page_has_the_numbers_of_its_program(questions):
    """`python docs/open_questions.py` and `python docs/pages.py` update it."""
    page = questions.PATH.with_suffix(".md").read_text("utf-8")
    assert fill_tables(page, {"friction": questions.friction_table()}) == page
    stored = questions.PATH.read_text("utf-8").splitlines()[1:]
    names = {line.partition(",")[0] for line in stored}
    assert {"estimate", "gaps", "sprint.best.stops", "simpson"} <= names
    quoted = dict(line.split(",") for line in stored)
    assert float(quoted["gaps"]) <= 16.0
    assert float(quoted["estimate"]) <= 1.5
    for theory, errors in questions.standard_errors().items():
        assert quoted[f"{theory.split()[0]}.standard"] == questions.largest(errors)


def random_waves(rng, count=40):
    """Return thicknesses, gaps and frictions of waves that exist, and the waves."""
    lines, waves = [], []
    while len(lines) < count:
        thickness, gap, friction = chain = rng.uniform((0.05, 0.05, 0.0), (0.3, 0.9, 0.6))
        physics = de.Physics(friction, gravity=1.0)
        wave = de.steady_wave(gap + thickness, thickness, 1.0, physics, rtol=1e-8)
        if wave.exists:
            lines.append(chain)
            waves.append((wave.omega_release, wave.omega_impact))
    return np.array(lines).T, np.array(waves).T


def test_three_values_give_both_velocities_wherever_waves_exist(questions):
    chains, velocities = random_waves(np.random.default_rng(1))
    assert questions.three_values(*chains) == pytest.approx(velocities, rel=4e-3)
    near = chains[:, (chains[1] < 0.7) & (chains[2] < 0.3)]
    known = velocities[:, (chains[1] < 0.7) & (chains[2] < 0.3)]
    assert questions.two_values(*near) == pytest.approx(known, rel=0.012)
    assert near.shape[1] > 10


def test_the_product_of_the_velocities_is_that_of_the_released_energy(questions):
    """ω₊ω₋ = η R / (1 + η (1 - η) M), with R of the exact wave."""
    chains, (release, impact) = random_waves(np.random.default_rng(2), 10)
    thickness, gap, friction = chains
    sizes = thickness, gap + thickness, friction
    begin, end = (questions.stack(*sizes, angle) for angle in (0.0 * gap, np.arcsin(gap)))
    first, last = (np.sum(x[1] * x[2], axis=0) for x in (begin, end))
    cosine = np.sqrt(1.0 - gap**2)
    eta = (cosine - friction * thickness) / (cosine + friction * gap)
    assert first == pytest.approx(1.0 + eta * last)
    released = impact**2 * last - release**2 * first
    assert release * impact == pytest.approx(eta * released / (1.0 + eta * (1.0 - eta) * last))


def test_simpsons_rule_gives_the_duration_of_an_interval(questions):
    (_, gap, friction, *_), errors = questions.mean_errors()
    near = gap < 0.75
    assert np.abs(errors["Simpson"][near]).max() < 3e-3
    assert np.abs(errors["Simpson"][near & (friction == 0.0)]).max() < 7e-4
    assert np.abs(errors["Simpson"]).max() < 0.025
    assert min(np.abs(errors[name]).max() for name in errors if name != "Simpson") > 0.08


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.3])
def test_the_limit_of_the_steady_wave_has_a_formula(questions, friction):
    for thickness in (0.05, 0.2, 0.3):
        limit = questions.endless_limit(thickness, friction)
        assert questions.limit_formula(thickness, friction) == pytest.approx(limit, rel=0.034)
        if friction == 0.0:  # van Leeuwen, eq. 79
            assert 1.0 / (1.0 + limit) == pytest.approx(
                de.existence_limit(thickness, 1.0), rel=3e-3
            )


def test_the_derivative_of_k_is_a_sum(questions):
    """K' = 2 Σ J D, with D of the next domino Ω D + Ψ J²."""
    thickness, pitch, angle, step = np.array([0.15]), np.array([0.5]), 0.1, 1e-5
    lean, factor, _ = questions.stack(thickness, pitch, 0.0, np.array([angle]))
    ahead, sine = lean[:-1], np.sin(np.diff(lean, axis=0))
    ratio = factor[1:] / factor[:-1]
    bend = -pitch * (np.cos(lean[1:]) + np.sin(ahead) * sine * ratio) / (1.0 - sine**2)
    total, change = 0.0, 0.0
    for k in range(100):
        total += 2.0 * factor[k] * change
        change = ratio[k] * change + bend[k] * factor[k] ** 2
    low, high = (
        np.sum(questions.stack(thickness, pitch, 0.0, np.array([angle + x]))[1] ** 2)
        for x in (-step, step)
    )
    assert total == pytest.approx((high - low) / (2.0 * step), rel=1e-6)


def test_laws_of_placing_errors_agree_with_samples(questions):
    for best in (False, True):
        values = questions.placed("sprint", best)
        assert values["loss.law"][1:4] == pytest.approx(values["loss"][1:4], rel=0.25)
        assert values["scatter.law"][1:4] == pytest.approx(values["scatter"][1:4], rel=0.25)
        assert (values["stops"][3] > 10.0) == best


def test_causes_that_fit_are_those_of_the_page(questions):
    (friction,), square = questions.best_values(("friction",))
    frequencies = questions.frequencies(friction)
    deviations = (frequencies - [64.4, 42.3, 28.1]) / [1.3, 0.85, 0.56]
    assert square == pytest.approx(np.sum(deviations**2))
    page = questions.PATH.with_suffix(".md").read_text("utf-8")
    assert f" | {friction:.3g} | {square:.1f} |" in page
    wave = de.steady_wave(0.024, 0.0075, physics=de.Physics(friction, gravity=9.8))
    assert wave.frequency == pytest.approx(frequencies[1], rel=1e-6)
    assert questions.needed("all frequencies", 1) == "13.6 %"


def test_figures_are_drawn(questions):
    assert len(questions.draw_friction().axes) == 2
    assert len(questions.draw_means().axes[0].lines) == 6
