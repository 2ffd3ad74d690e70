"""Scenes: scores, uniform baselines and rules."""

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import domino_env as de
from domino_env.scenes.uniform import best_point

SPRINT, VARIED = de.load_scene("sprint"), de.load_distribution("varied")
SMALL = de.Scene(
    name="small", count=8, spacing=(0.004, 0.03), thickness=(0.0075, 0.0075),
    physics=de.Physics(0.25, push=8.0),
)  # fmt: skip


# uniform baselines: values of two independent programs, to their digits ------------------------


@pytest.mark.parametrize(
    ("name", "speed", "digits", "gap", "thickness"),
    [
        ("sprint", 0.8030, 5e-5, 0.018, 0.0075),
        ("sprint-thickness", 0.8528, 5e-5, None, 0.004),
        ("ideal", 1.0698, 6e-5, None, 0.004),
        ("course", 0.8318, 5e-5, 1.2 / 59 - 0.0075, 0.0075),
        ("marathon", 0.988, 5e-4, 0.004, 0.0075),
    ],
)
def test_uniform_baselines_have_the_known_scores(name, speed, digits, gap, thickness):
    scene = de.load_scene(name)
    baseline = scene.uniform()
    assert baseline.score == pytest.approx(speed, abs=digits)
    assert baseline.layout.thickness[1] == pytest.approx(thickness, abs=1e-6)
    if gap is not None:  # noted to half a millimetre
        assert baseline.layout.spacing[0] == pytest.approx(gap, abs=2.5e-4)
    assert np.ptp(baseline.layout.spacing) == 0.0
    assert np.ptp(baseline.layout.thickness[1:]) == 0.0
    assert scene.violations(baseline.layout) == []
    assert baseline.wave.outcome == de.Outcome.PROPAGATED
    assert scene.score(baseline.layout) == baseline.score
    assert scene.uniform() is baseline


def test_a_baseline_that_stops_explains_why():
    baseline = SMALL.replace(physics=de.Physics(push=0.01)).uniform()
    assert baseline.wave.outcome == de.Outcome.STALLED
    assert -1.0 <= baseline.score < 0.0
    assert "stalled" in baseline.wave.explanation


def test_a_scene_without_design_variables_has_a_baseline():
    scene = SMALL.replace(spacing=(0.016, 0.016))
    assert not scene.space.spacing.is_free
    assert scene.uniform().layout.spacing.tolist() == [0.016] * 7


# the score --------------------------------------------------------------------------------------


def test_a_success_scores_its_speed_and_a_failure_its_reach():
    scene = de.load_scene("gentle").replace(limits=None)
    rng, shape = np.random.default_rng(2), (300, scene.count - 1)
    spacing, thickness = rng.uniform(*scene.spacing, shape), rng.uniform(*scene.thickness, shape)
    scores = scene.evaluate(scene.batch(spacing, thickness, rtol=1e-10)).score
    for i in (*np.flatnonzero(scores > 0.0)[:5], *np.flatnonzero(scores < 0.0)[:15]):
        layout = scene.layout(spacing[i], thickness[i])
        wave = scene.simulate(layout)
        propagated = wave.outcome == de.Outcome.PROPAGATED
        assert scores[i] == pytest.approx(wave.mean_speed if propagated else wave.reach - 1.0)
        assert scene.score(layout) == pytest.approx(scores[i], rel=1e-9)
    assert np.all((scores > 0.0) | ((scores >= -1.0) & (scores < 0.0)))


@pytest.mark.parametrize(("call", "words"), [
    (lambda: SMALL.score(SMALL.layout(0.035)), "scene 'small': spacing[0] = 0.035 m"),
    (lambda: SMALL.replace(thickness=(0.005, 0.01)).layout(0.016), "thickness is missing: give"),
    (lambda: de.load_scene("magnify").layout(0.02), "height is missing: give it, as heights grow"),
    (lambda: SMALL.replace(spacing=0.02), "scene 'small': spacing has shape (): give (2,), a pair"),
    (lambda: SMALL.replace(in_heights=float("nan")), "in_heights = nan: give True or False"),
    (lambda: SMALL.replace(physics=3), "physics = 3: give a Physics"),
    (lambda: SMALL.replace(count=1), "scene 'small': count = 1: give a whole number from 2 to"),
    (lambda: SMALL.replace(growth=(0.5, 2.0)), "growth[0] = 0.5: give a finite number from 1"),
    (lambda: SMALL.replace(settings=3), "settings = 3: give the table of an objective"),
    (lambda: SMALL.replace(placement=de.Placement(0.5)),
     "deviation = 0.5 m is more than the largest gap"),
    (lambda: de.Placement(-1.0), "deviation = -1"),
    (lambda: de.Placement(0.001, quantile=0.05), "quantile = 0.05 without draws: give draws = 256"),
    (lambda: SMALL.replace(placement=de.Placement(0.001, 100_000), count=100),
     "placement.draws = 100000 of 100 dominoes take too much memory: give at most 40000"),
    (lambda: SMALL.replace(stock=de.Stock((0.0075,), (8,), 0)), "hand = 0: give a whole number"),
    (lambda: de.load_scene("draw").replace(floor_friction=0.5),
     "stock.hand and physics.floor_friction exclude"),
    (lambda: SPRINT.replace(spacing=(0.04, 0.002)),
     "scene 'sprint': spacing.min = 0.04 is more than max = 0.002: give"),
    (lambda: SPRINT.replace(length=9.0), "scene 'sprint': row.length = 9 m cannot be met: 40 "
     "dominoes within the bounds cover 0.3705 to 1.8525 m; row.count = 191 to 948 would fit"),
    (lambda: SPRINT.replace(length=1200),
     "cannot be met: 40 dominoes within the bounds cover 0.3705 to 1.8525 m; 1200 mm is row.le"),
    (lambda: SPRINT.replace(length=300.0, height=48.0, spacing=(2.0, 40.0), thickness=(7.5, 7.5),
     first_thickness=7.5), "cover 370.5 to 1852.5 m; the dominoes are 48 m tall: lengths"),
    (lambda: SPRINT.replace(stock=de.Stock((0.005,), (3,))), "stock.count adds up to 3 dominoes"),
    (lambda: SMALL.replace(objective="men_speed"),
     "objective = 'men_speed': did you mean 'mean_speed'?"),
    (lambda: SMALL.score_placed(SMALL.layout(0.02), [-1]), "seeds[0] = -1: give a whole"),
    (lambda: SMALL.score_placed(SMALL.layout(0.02), [[0, 1]]), "seeds has shape (1, 2): give (dra"),
    (lambda: SMALL.score(de.simulate(SMALL.layout(0.01), de.Physics(0.2))), "friction=0.25"),
    (lambda: SMALL.score(de.simulate(de.Layout.uniform(3, pitch=0.024))),
     "waves of 3 dominoes: give 8, or fewer if they stop"),
    (lambda: SMALL.score(de.simulate(de.Layout([0.06] * 9, 0.01))), "waves of 10 dominoes"),
    (lambda: de.load_scene(Path(__file__).parent), "a folder without a scene.toml: name the file"),
    (lambda: de.Ground(slope=1.0).layout([0.01], [0.007] * 3), "thickness has shape (3,): give"),
    (lambda: de.Ground(profile=[]), "profile = []: give a list of 2 to 10000 entries, each a list "
     "of 2 entries"),
    (lambda: SMALL.layout([0.01, 0.02]), "spacing has shape (2,): give (7,), or one number"),
    (lambda: SMALL.score(None), "layout = None: give a Layout"),
    (lambda: SMALL.violations("small"), "layout = 'small': give a Layout"),
    (lambda: SMALL.evaluate_waves([3]), "waves = [3]: give a WaveBatch"),
    (lambda: SMALL.evaluate(3), "batch = 3: give a LayoutBatch"),
    (lambda: SMALL.batch([[0.02]], [[0.007]] * 2), "thickness has shape (2, 1): give (1, 1)"),
    (lambda: best_point(SMALL, seconds="x"), "seconds = 'x' s: give a finite number"),
    (lambda: VARIED.scene([np.nan] * 6), "numbers[0] = nan: give a finite number"),
    (lambda: VARIED.numbers(3), "scene = 3: give a Scene"),
    (lambda: VARIED.sample(1.5), "rng = 1.5: give a whole number, at least 0 (a seed; or a"),
    (lambda: de.load_scene(None), "name = None: give the name of a shipped scene, such as"),
    (lambda: de.load_scene("varid"), "there is no scene 'varid': did you mean 'varied'"),
    (lambda: de.load_scene("varied"), "varied.toml: it describes many scenes: name one"),
    (lambda: de.load_distribution("sprint"), "it is one scene, without a range: load it by"),
])  # fmt: skip
def test_wrong_arguments_are_rejected(call, words):
    with pytest.raises((ValueError, TypeError), match=re.escape(words)):
        call()


def test_every_violation_is_reported():
    scene = SMALL.replace(length=0.14, thickness=(0.006, 0.008))
    assert scene.violations(de.Layout([0.01], 0.0075)) == [
        "the layout has 2 dominoes, and the scene 8"
    ]
    gaps = np.array([0.003, 0.01, 0.01, 0.01, 0.01, 0.01, 0.031])
    thickness = np.array([0.007, 0.0075, 0.0075, 0.0075, 0.0075, 0.0075, 0.0075, 0.009])
    words = scene.violations(de.Layout(gaps, thickness, 0.05, density=1000.0))
    assert [w.split(" ")[0] for w in words] == [
        "thickness[0]", "height[0]", "density[0]", "spacing[0]", "thickness[7]", "the",
    ]  # fmt: skip
    assert words[3] == "spacing[0] = 0.003 m (and 1 more): the scene allows 0.004 to 0.03 m"
    assert words[5].startswith("the layout is 0.138000000 m long: the scene has 0.14 m (-0.002 m)")


def test_a_pickled_scene_keeps_its_baseline():
    copy = pickle.loads(pickle.dumps(SMALL))
    assert copy.uniform().score == SMALL.uniform().score
    assert not copy.uniform().layout.spacing.flags.writeable
