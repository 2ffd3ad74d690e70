"""Scenes with a floor: scores, gradients, uniform baselines and searches."""

import numpy as np

import domino_env as de
from domino_env.scenes import uniform
from domino_env.scenes.placement import add_errors
from optimize import search

SMALL = de.load_scene("table").replace(count=5, floor_friction=0.3, spacing=(0.01, 0.025))
GAPS = np.random.default_rng(3).uniform(*SMALL.spacing, (6, SMALL.count - 1))


def test_the_score_is_the_speed_of_the_free_standing_layout():
    layout = SMALL.layout(GAPS[0])
    free_standing = de.simulate_standing(layout, SMALL.physics, SMALL.floor_friction)
    assert free_standing.topples.all()
    together = SMALL.evaluate(SMALL.batch(GAPS[:1])).score[0]
    assert SMALL.score(layout) == free_standing.mean_speed == together
    fixed = SMALL.replace(floor_friction=None).score(layout)
    assert 1e-4 < abs(free_standing.mean_speed / fixed - 1.0) < 0.05
    text = SMALL.format_score(SMALL.score(layout), SMALL.simulate(layout))
    assert "floor of friction 0.3" in text


def test_a_failure_scores_by_the_part_that_topples():
    scene = SMALL.replace(spacing=(0.001, 0.06))
    gaps = np.repeat(GAPS[:1], 3, axis=0)
    gaps[0, 1] = gaps[1, 3] = 0.055  # out of reach
    early, late, whole = scene.evaluate(scene.batch(gaps)).score
    assert -1.0 < early < late < 0.0 < whole
    assert 2.0 / 5.0 <= early + 1.0 < 4.0 / 5.0 <= late + 1.0


def test_a_quantile_on_a_floor_is_that_of_free_standing_layouts():
    placement = de.Placement(0.001, quantile=0.5, draws=4, seed=1)
    scene = SMALL.replace(placement=placement)
    drawn = add_errors(GAPS[:1], placement.errors(GAPS.shape[1]))
    speeds = np.sort(SMALL.evaluate(SMALL.batch(drawn)).score)
    evaluation = scene.evaluate(scene.batch(GAPS[:1], rtol=1e-8), gradient=True)
    assert evaluation.score == speeds[1] == scene.score(scene.layout(GAPS[0]))
    assert np.all(np.isfinite(evaluation.gradient.spacing))
    assert evaluation.gradient.spacing.any()
    assert scene.scoring.cost == 4 * SMALL.scoring.cost
    words = scene.format_score(evaluation.score[0], scene.simulate(scene.layout(GAPS[0])))
    assert words.endswith("on a floor of friction 0.3 reached by 50 % of the layouts as placed")


def test_the_uniform_baseline_is_the_best_equal_gap_on_its_floor(monkeypatch):
    monkeypatch.setattr(uniform, "FREE_STANDING", uniform.FREE_STANDING._replace(line=4))
    baseline = SMALL.uniform()
    assert baseline.score == SMALL.score(baseline.layout)
    gaps = np.linspace(*SMALL.spacing, 16)[:, None] * np.ones(SMALL.count - 1)
    assert baseline.score >= SMALL.evaluate(SMALL.batch(gaps)).score.max() * (1.0 - 3e-4)


def test_a_scene_without_success_has_a_baseline_and_a_search(monkeypatch):
    coarse = uniform.FREE_STANDING._replace(line=3, finest=1e-3)
    monkeypatch.setattr(uniform, "FREE_STANDING", coarse)
    scene = SMALL.replace(physics=de.Physics(push=0.3))
    assert -1.0 < scene.uniform().score < 0.0
    assert scene.uniform().score <= search(scene, budget=4, progress=False).score < 0.0


def test_auto_is_reproducible_and_finds_a_good_layout_on_a_floor(monkeypatch):
    from optimize.methods.search import two_fidelities

    monkeypatch.setattr(two_fidelities, "ANALYTIC_EVALUATIONS", 200)
    scene = SMALL.replace(count=8, spacing=(0.002, 0.04))
    result = search(scene, budget=20, seed=1, progress=False)
    assert 10 < result.evaluations <= 20
    assert result.score == scene.score(result.layout) > result.uniform.score
    assert search(scene, budget=20, seed=1, progress=False).layout == result.layout
    fixed = search(scene.replace(floor_friction=None), budget=600, progress=False)
    assert result.score > scene.score(fixed.layout) * (1.0 - 5e-5)
