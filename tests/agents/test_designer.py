"""The designer: its layouts, and its training range."""

from dataclasses import replace

import numpy as np
import pytest
from env_scenes import scaled

import domino_env as de
from agents import design, evaluate
from agents.designer.features import tight_candidates
from agents.evaluation import choose_scenes, evaluate_scenes

SPRINT = de.load_scene("sprint")


# scenes -------------------------------------------------------------------------------------------


def test_features_outside_the_training_are_reported():
    assert not any(design(key).range_violations for key in ("sprint", "course", "sprint-thickness"))
    long = design(replace(SPRINT, count=100))
    assert long.range_violations == ("count 100 is outside 15 to 80",)
    assert long.score > 0.0
    both = replace(de.load_scene("sprint-thickness"), length=0.8)
    assert design(both).range_violations == ("free thickness with a given length",)
    assert both.violations(design(both).layout) == []


# designing ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["varied", "varied-thickness", "varied-course"])
def test_designs_keep_the_rules_and_beat_the_uniform_baseline_in_test_scenes(kind):
    done = evaluate_scenes(choose_scenes(kind, 12))
    gains = done.gains()
    assert np.mean(gains > 0.0) >= 0.9
    assert np.median(gains) > 0.015
    assert np.all(done.scores["policy"] >= done.scores["proposal"] - 1e-6)
    for scene in done.scenes:
        made = design(scene)
        assert scene.violations(made.layout) == []
        assert made.score == scene.score(made.layout)
        assert made.tight_gaps < tight_candidates(scene.count)


@pytest.mark.parametrize("pitch", [1.02, 1.5, 3.0, 4.9])
def test_designs_of_any_length_keep_it(pitch):
    scene = replace(de.load_scene("sprint-thickness"), length=39 * pitch * 0.0103)
    assert scene.violations(design(scene).layout) == []


def test_a_design_scales_with_the_dominoes():
    k = 3.7
    large = scaled(SPRINT, k).replace(density=500.0)
    small, big = design(SPRINT), design(large)
    assert big.tight_gaps == small.tight_gaps
    assert big.layout.spacing == pytest.approx(k * small.layout.spacing, rel=1e-5)
    assert big.score == pytest.approx(np.sqrt(k) * small.score, rel=1e-5)
    fast = de.Physics(0.25, 4.0 * 9.81, 2.0 * SPRINT.physics.push)  # time runs twice as fast
    strong = replace(SPRINT, physics=fast)
    assert design(strong).layout.spacing == pytest.approx(small.layout.spacing, rel=1e-5)


def test_tries_do_not_lower_and_gradient_steps_raise_the_score():
    scores = [design(SPRINT, tries=n, steps=0).score for n in (1, 4, 13)]
    assert scores[0] <= scores[1] + 1e-9 <= scores[2] + 2e-9
    refined = [design("course", steps=k).score for k in (0, 6, 30)]
    assert refined[0] < refined[1] < refined[2]


# commands -----------------------------------------------------------------------------------------


def test_the_designer_is_evaluated_by_name_in_one_scene_and_in_many(output_of):
    assert evaluate("designer", "sprint").score == design("sprint").score
    words = "evaluate", "designer", "--scenes", 3, "--seed", 5
    assert "| proposal | " in output_of(*words, "--distribution", "varied-course")
    assert "0.0% of 3" in output_of("evaluate", "uniform", "--scenes", 3)
