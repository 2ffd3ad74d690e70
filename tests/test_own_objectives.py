"""Objectives of a user's own: right in scenes, gradients, searches and environments."""

from dataclasses import replace

import numpy as np
import pytest

import domino_env as de
from domino_env.scenes.objectives import OBJECTIVES, Objective, ScoreGradient
from domino_env.scenes.objectives.speed import MeanSpeed
from optimize import search, studio

PLACE = 8  # domino whose hit is scored


class SpeedSquared(Objective):
    name, unit = "speed_squared", "m²/s²"
    needs_time_gradient = rewards_steps = True

    def success(self, waves):
        return waves.mean_speed**2

    def derivatives(self, waves, layouts):
        return MeanSpeed(None).derivatives(waves, layouts).scale(2.0 * waves.mean_speed)


class EarlyHit(Objective):
    name, unit = "early_hit", "1/s"
    needs_arrivals = True

    def success(self, waves):
        return 1.0 / waves.arrival_times[:, PLACE]

    def derivatives(self, waves, layouts):
        bars = np.zeros(waves.arrival_times.shape)
        bars[:, PLACE] = -1.0 / waves.arrival_times[:, PLACE] ** 2
        return ScoreGradient.from_gradient(layouts.along_ground(waves.pullback(bars)))


class LateFinish(EarlyHit):
    """Time of the last hit over that of the twentieth, by the gradient of the total time too."""

    name, unit = "late_finish", ""
    needs_time_gradient = True

    def success(self, waves):
        return waves.total_time * super().success(waves)

    def derivatives(self, waves, layouts):
        early = super().success(waves)
        parts = zip(
            super().derivatives(waves, layouts).scale(waves.total_time),
            ScoreGradient.from_gradient(waves.gradient).scale(early),
            strict=True,
        )
        return ScoreGradient(*(first + second for first, second in parts))


class LastEnergy(Objective):
    """Kinetic energy of the last leader as it hits the last domino; derivatives by differences."""

    name, unit = "last_energy", "J"
    needs_arrivals = True

    def success(self, waves):
        thickness, height = waves.arrays.thickness[:, -2], waves.arrays.height[:, -2]
        inertia = 1040.0 * 0.024 * thickness * height * (thickness**2 + height**2) / 3.0
        return 0.5 * inertia * waves.impact_velocity[:, -1] ** 2

    def derivatives(self, waves, layouts):
        spacing, thickness = layouts.spacing, layouts.thickness
        by_gap, by_thickness = np.zeros((2, *spacing.shape))
        height = 0.0 * by_gap
        for k in range(spacing.shape[1]):
            for sign in (1.0, -1.0):
                step = np.zeros(spacing.shape)
                step[:, k] = sign * 1e-6
                wider = replace(layouts, spacing=spacing + step).simulate(record=True)
                by_gap[:, k] += sign * self.success(wider) / 2e-6
                thicker = np.concatenate([thickness[:, :1], thickness[:, 1:] + step], axis=1)
                thick = replace(layouts, thickness=thicker).simulate(record=True)
                by_thickness[:, k] += sign * self.success(thick) / 2e-6
        return ScoreGradient(by_gap, by_thickness, height)


OWN = (SpeedSquared, EarlyHit, LateFinish, LastEnergy)


@pytest.fixture(params=OWN, ids=lambda kind: kind.name)
def scene(request, monkeypatch):
    monkeypatch.setitem(OBJECTIVES, request.param.name, request.param)
    thick = de.load_scene("sprint-thickness")
    return thick.replace(count=10, objective=request.param.name)


def some_layouts(scene, number):
    random = np.random.default_rng(3)
    shape = number, scene.count - 1
    return random.uniform(0.008, 0.02, shape), random.uniform(*scene.thickness, shape)


def test_scores_are_those_of_the_waves(scene):
    gaps, thicknesses = some_layouts(scene, 3)
    scores = scene.evaluate(scene.batch(gaps, thicknesses, rtol=1e-10)).score
    for gap, thick, score in zip(gaps, thicknesses, scores, strict=True):
        layout = scene.layout(gap, thick)
        wave = de.simulate(layout, scene.physics, rtol=1e-10)
        times = wave.arrival_times
        inertia = wave.layout.thickness[-2] * 0.048 * (wave.layout.thickness[-2] ** 2 + 0.048**2)
        expected = {
            "speed_squared": wave.mean_speed**2,
            "early_hit": 1.0 / times[PLACE],
            "late_finish": times[-1] / times[PLACE],
            "last_energy": 0.5 * 1040.0 * 0.024 * inertia / 3.0 * wave.impact_velocity[-1] ** 2,
        }[scene.objective]
        assert score == scene.score(layout) == pytest.approx(expected, rel=1e-12)
        assert f"{score:.6f}" in scene.format_score(score, wave)
    stopped = scene.evaluate(scene.batch(np.full((1, 9), 0.05), thicknesses[:1])).score
    assert -1.0 < stopped[0] < 0.0


@pytest.mark.parametrize("limits", [None, de.Limits(0.01)], ids=["", "limits"])
def test_gradients_agree_with_differences(scene, limits):
    scene = scene.replace(limits=limits)
    sizes, step = some_layouts(scene, 2), 2e-6
    gradient = scene.evaluate(scene.batch(*sizes, rtol=1e-10), gradient=True).gradient
    for k in (0, 4, 8):
        for part, by_size in enumerate((gradient.spacing, gradient.thickness)):
            scores = []
            for sign in (1.0, -1.0):
                moved = [size.copy() for size in sizes]
                moved[part][:, k] += sign * step
                scores.append(scene.evaluate(scene.batch(*moved, rtol=1e-10)).score)
            difference = (scores[0] - scores[1]) / (2.0 * step)
            largest = np.abs(by_size).max()
            np.testing.assert_allclose(by_size[:, k], difference, atol=2e-6 * largest, rtol=2e-5)


def test_a_search_finds_a_better_layout(scene):
    result = search(scene, budget=60, seed=1)
    assert result.score == scene.score(result.layout) > scene.uniform().score > 0.0
    assert result.gain == pytest.approx(result.score / scene.uniform().score - 1.0)


def test_the_score_of_an_episode_is_that_of_its_layout(scene):
    vector = de.DominoChainVector(3, scene, autoreset_mode="Disabled")
    vector.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (9, *vector.action_space.shape))
    actions[:, 0] = 0.0  # the uniform baseline
    total, rewards = np.zeros(3), []
    for action in actions:
        _, reward, ended, _, infos = vector.step(action)
        rewards.append(reward)
        total += reward
    assert ended.all()
    for layout, score, gain, sum_ in zip(
        infos["layout"], infos["score"], infos["gain"], total, strict=True
    ):
        assert 0.0 < score == pytest.approx(scene.score(scene.simulate(layout, 1e-6)), rel=1e-5)
        assert gain == pytest.approx(score / scene.uniform().score - 1.0)
        assert sum_ == pytest.approx(100.0 * gain, abs=1e-9)
    assert infos["score"][0] == scene.uniform().score
    assert np.any(np.array(rewards)[:-1, 1:]) == scene.criterion.rewards_steps


def test_the_page_answers_with_a_sentence(scene):
    message = (
        f"scene 'sprint-thickness' has objective = '{scene.objective}', and the page computes "
        "magnify, mean_speed, tempo only: .* `domino optimize sprint-thickness`"
    )
    with pytest.raises(ValueError, match=message):
        studio(scene)
