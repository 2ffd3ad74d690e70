"""Objectives, limits, stock and growth."""

import math
from dataclasses import replace

import numpy as np
import pytest
from golden_layouts import scene_layout

import domino_env as de
from domino_env.scenes.placement import LEAST_GAP, add_errors


def some(name: str, **changes: object) -> de.Scene:
    return de.load_scene(name).replace(**changes)


def gaps_of(scene: de.Scene, spacings: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(*scene.spacing, (spacings, scene.count - 1))


# tempo ------------------------------------------------------------------------------------------


def test_the_schedule_of_tempo_rises_from_30_to_45_hits_a_second():
    scene = de.load_scene("tempo")
    times = scene.tempo.schedule(40)
    rates = 1.0 / np.diff(times, prepend=0.0)
    assert rates[0] == pytest.approx(30.0)
    assert rates[-1] == pytest.approx(45.0)
    assert np.diff(rates) == pytest.approx(np.full(38, 15.0 / 38.0))


def test_a_layout_meets_its_own_arrival_times():
    plain = some("tempo", count=9)
    layout = plain.layout(0.005 + 0.3 * gaps_of(plain, 1)[0], 0.006)
    times = plain.simulate(layout).arrival_times
    scene = plain.replace(settings=de.Tempo(times=tuple(times[1:])))
    assert scene.tempo.error(times[None])[0] == 0.0
    assert scene.score(layout) == 1.0
    late = times.copy()
    late[1:] += [0.003, -0.004, 0, 0, 0, 0, 0, 0]
    # √((9 + 16)/8) ms
    assert scene.tempo.error(late[None])[0] == pytest.approx(1e-3 * math.sqrt(25.0 / 8.0))
    assert scene.tempo.score(late[None])[0] == pytest.approx(1.0 / (1.0 + math.sqrt(25.0 / 8.0)))


@pytest.mark.parametrize("name", ["tempo", "tempo-noise"])
def test_scores_of_a_schedule_are_shown_as_the_errors_that_have_them(name):
    scene = de.load_scene(name)
    criterion, errors = scene.criterion, np.array([1e-6, 1.5, 20.0])  # [ms]
    scores = 1.0 / (1.0 + 1e-3 * errors / scene.tempo.tolerance)
    np.testing.assert_allclose(criterion.displayed(scores), errors, rtol=1e-9)
    assert np.all(criterion.displayed([0.0, -0.5, -np.inf]) == np.inf)
    _, close, far = scores
    assert criterion.label(close) == "RMS error 1.5 ms"
    assert criterion.label(1.0) == "RMS error below 1 ns"
    assert criterion.label(-0.5, 1) == "score -0.5"
    assert criterion.compare(close, far, "uniform") == "20 ms with uniform"
    assert scene.gain(close, far) == pytest.approx(0.1 * math.log10(close / far))
    assert scene.gain(0.0, far) is scene.gain(close, -0.5) is None


# placement noise --------------------------------------------------------------------------------


def test_a_score_with_a_quantile_is_the_quantile_computed_by_hand():
    scene = some("jitter", count=9)
    spacings = 0.005 + 0.4 * gaps_of(scene, 2, seed=4)
    normals = [np.random.default_rng(seed).standard_normal(8) for seed in range(256)]
    scores = scene.evaluate(scene.batch(spacings, rtol=1e-10)).score
    for gaps, score in zip(spacings, scores, strict=True):
        placed = np.maximum(gaps + 0.0005 * np.array(normals), LEAST_GAP)
        speeds = [scene.simulate(scene.layout(layout)).mean_speed for layout in placed]
        # 5 % of 256 is 12.8: twelve draws may be slower, and the thirteenth counts
        assert score == pytest.approx(sorted(speeds)[12], rel=1e-12)
        assert scene.score(scene.layout(gaps)) == pytest.approx(score, rel=1e-12)


def test_draws_that_stop_count_as_zero():
    noise = de.Placement(0.002, 40, 0.25, seed=3)
    scene = some("jitter", count=9, placement=noise)
    gaps = np.full((1, 8), 0.02)
    gaps[0, 4] = 0.047  # out of reach at 48 mm: about a third of the draws stop
    drawn = add_errors(gaps, noise.errors(8))
    stopped = np.array([scene.simulate(scene.layout(g)).mean_speed == 0.0 for g in drawn])
    assert 10 < stopped.sum() < 30
    assert scene.evaluate(scene.batch(gaps)).score[0] < 0.0  # more than a quarter
    few = scene.replace(placement=noise.replace(quantile=(stopped.sum() + 1) / 40))
    assert few.evaluate(few.batch(gaps)).score[0] > 0.0


@pytest.mark.parametrize("name", ["tempo-noise", "sprint"])
def test_the_score_under_placement_noise_is_a_mean_over_fixed_draws(name):
    scene = some(name, count=9, placement=de.Placement(1e-3, 5))
    gaps = 0.003 + 0.5 * gaps_of(scene, 2, 1)
    thick = np.full(gaps.shape, np.mean(scene.thickness))
    scores = scene.evaluate(scene.batch(gaps, thick, rtol=1e-10)).score
    for gap, score in zip(gaps, scores, strict=True):
        drawn = scene.score_placed(scene.layout(gap, thick[0]), range(5))
        assert score == pytest.approx(drawn.mean(), rel=1e-9)


# magnify, time ----------------------------------------------------------------------------------


def test_magnify_scores_the_height_of_the_last_domino_and_reports_violations():
    scene, heights = de.load_scene("magnify"), 0.048 * 1.3 ** np.arange(12)
    tall, before = heights[1:], heights[:-1]
    layout = scene.layout(0.6 * before, None, tall)
    assert scene.violations(layout) == []
    assert layout.thickness == pytest.approx(0.15 * layout.height)
    assert scene.score(layout) == pytest.approx(tall[-1])
    # gaps of a twentieth of the height do not carry such a growth
    assert -1.0 < scene.score(scene.layout(0.05 * before, None, tall)) < 0.0

    tall = np.append(tall[:4], 1.3 * tall[4:])
    words = scene.violations(scene.layout(0.91 * before, 0.15 * tall * 1.01, tall))
    assert [w.split(" ")[0] for w in words] == ["growth[5]", "spacing[0]", "thickness[1]"]
    assert words[0].endswith("the scene allows 1.0 to 1.6")
    assert words[2].endswith("(and 10 more): the scene allows 0.15 heights")


def test_the_uniform_baseline_has_the_largest_growth():
    baseline = de.load_scene("magnify").uniform()
    growth = baseline.layout.height[1:] / baseline.layout.height[:-1]
    assert np.ptp(growth) < 1e-12
    assert np.ptp(baseline.layout.spacing / baseline.layout.height[:-1]) < 1e-12
    assert baseline.wave.stall_margin.min() > 0.1  # the middle of all that reach the bound
    assert baseline.score == pytest.approx(0.048 * 1.6**11)


# limits -----------------------------------------------------------------------------------------


def test_a_broken_limit_scores_between_failures_and_successes():
    plain = some("gentle", count=20, limits=None, physics=de.Physics(friction=0.5, push=4.0))
    random = np.random.default_rng(7)
    gaps = random.uniform(*plain.spacing, (400, 19))
    thick = random.uniform(*plain.thickness, (400, 19))
    limited = plain.replace(limits=de.Limits(stall_margin=0.4))
    before, after = (one.evaluate(one.batch(gaps, thick)).score for one in (plain, limited))
    layouts = map(plain.layout, gaps, thick)
    waves = [plain.simulate(layout, rtol=1e-6) for layout in layouts]
    assert after.tolist() == [limited.score(wave) for wave in waves]
    excess = np.maximum(0.4 - np.array([wave.stall_margin.min() for wave in waves]), 0.0)
    stopped = np.array([wave.outcome != de.Outcome.PROPAGATED for wave in waves])
    kept, broken = ~stopped & (excess == 0.0), ~stopped & (excess > 0.0)
    assert min(kept.sum(), broken.sum()) > 5
    assert np.all((after[stopped] >= -1.0) & (after[stopped] < -0.5))
    assert np.all((after[broken] > -0.5) & (after[broken] < 0.0))
    assert np.array_equal(after[kept], before[kept])
    assert np.all(np.diff(after[broken][np.argsort(excess[broken])]) <= 0.0)  # less is better
    assert np.all(np.argsort(before[stopped]) == np.argsort(after[stopped]))


# stock -------------------------------------------------------------------------------------------


def test_violations_of_the_stock_are_reported_and_its_uniform_baseline_has_none():
    scene = de.load_scene("stock")
    left = scene.stock.without(0.0075)
    assert left.count == (16, 13, 10)
    order = np.random.default_rng(0).permutation(left.dominoes)
    assert scene.violations(scene.layout(0.015, order)) == []
    order[order == 0.005] = 0.0075
    assert scene.violations(scene.layout(0.015, order)) == [
        "30 dominoes are 0.0075 m thick: the stock has 14"
    ]
    order[3] = 0.006
    assert scene.violations(scene.layout(0.015, order))[0].startswith("thickness[4] = 0.006 m")
    baseline = scene.uniform()  # of one pitch
    assert np.ptp(baseline.layout.pitch) < 1e-12
    assert np.all(np.diff(baseline.layout.thickness[1:]) >= 0.0)  # as the file lists them
    assert scene.violations(baseline.layout) == []


# all objectives ----------------------------------------------------------------------


@pytest.mark.parametrize("name", ["sprint", "course", "tempo", "jitter", "magnify"])
@pytest.mark.parametrize("limits", [None, de.Limits(0.3)])
def test_scores_with_and_without_gradients_are_bitwise_equal(name, limits):
    scene = de.load_scene(name).replace(limits=limits)
    layouts = [scene_layout(np.random.default_rng(seed), scene) for seed in range(6)]
    sizes = zip(*((x.spacing, x.thickness[1:], x.height[1:]) for x in layouts), strict=True)
    batch = scene.batch(*map(np.array, sizes), rtol=1e-8)
    evaluation, again = scene.evaluate(batch), scene.evaluate(batch, gradient=True)
    for key in ("score", "reach", "falls"):
        assert np.array_equal(getattr(evaluation, key), getattr(again, key))
    assert not again.gradient.spacing[evaluation.score <= 0.0].any()
    assert np.all(evaluation.falls > 0)


def test_waves_of_incomplete_layouts_count_all_dominoes_and_schedules_need_arrivals():
    scene = de.load_scene("sprint")
    spacing = np.full(20, 0.02)
    spacing[9] = 0.06
    wave = de.simulate(de.Layout(spacing, scene.first_thickness, scene.height), scene.physics)
    reach = wave.hit / scene.count
    batch = wave.as_batch()
    batch = replace(batch, summary=batch.summary._replace(reach=np.array([reach])))
    assert scene.evaluate_waves(batch).falls.tolist() == [wave.hit]
    tempo = de.load_scene("tempo")
    layout = tempo.uniform().layout
    waves = tempo.batch(layout.spacing[None], layout.thickness[None, 1:]).simulate(record=False)
    with pytest.raises(ValueError, match="record=True"):
        tempo.evaluate_waves(waves)
