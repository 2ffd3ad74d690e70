"""Scripted policies, and calls that policies reject."""

import time
from dataclasses import replace
from itertools import groupby
from types import SimpleNamespace

import numpy as np
import pytest
from env_scenes import SMALL
from sampled_scenes import small_scenes

import domino_env as de
from agents import design, evaluate
from agents.evaluation import ScenesEvaluation, evaluate_gains, evaluate_scenes
from agents.rollout import EVALUATION_SEEDS, build, complete_layout
from agents.scripted import SCRIPTED, ScriptedPolicy

NOISY = de.load_scene("sprint").replace(count=12, placement=de.Placement(0.002))
PIECES = de.Stock((0.005, 0.0075, 0.010), (4, 5, 4), 3)
DRAWN = de.load_scene("draw").replace(count=12, stock=PIECES)
ON_TIME = {"objective": "tempo", "settings": de.load_scene("tempo").settings}
DRAWN_ON_TIME = de.load_scene("draw").replace(**ON_TIME)


@pytest.mark.parametrize("name", ["uniform", "ramp"])
def test_a_scripted_policy_keeps_the_rules_and_has_the_score_of_the_scene(name):
    rollout = SCRIPTED[name](SMALL)
    assert SMALL.violations(rollout.layout) == []
    assert rollout.score == SMALL.score(rollout.layout)
    assert rollout.gain == pytest.approx(rollout.score / rollout.uniform.score - 1.0)


@pytest.mark.parametrize(("call", "words"), [
    (lambda: evaluate("uniform"), "policy 'uniform' has no scene of its own: give one"),
    (lambda: evaluate("designer"), "policy 'designer' has no scene of its own: give one"),
    (lambda: evaluate("plan", SMALL), "no best known layout of scene 'small' is shipped"),
    (lambda: evaluate("sprint", "sprint-thickness"), "choose a scene with the same free variables"),
    (lambda: evaluate("sprnt"), r"policy = 'sprnt': did you mean 'sprint'\? .*archive"),
    (lambda: evaluate(3), "run = 3: give the name of a policy, or a folder"),
    (lambda: ScriptedPolicy("rule").build(de.load_scene("stock")), "draws no pieces in random"),
    (lambda: ScriptedPolicy("rule").build(DRAWN.replace(spacing=(0.02, 0.02))), "give .*free gaps"),
    (lambda: ScriptedPolicy("controller").build(DRAWN_ON_TIME), "without a hand; use another"),
    (lambda: ScriptedPolicy("ramp").build(de.load_scene("draw")), "use another policy"),
    (lambda: ScriptedPolicy("ramp").build(de.load_scene("stock")), "'stock' has a stock: ramp"),
    (lambda: ScriptedPolicy("ramp").build(de.load_scene("magnify")), "has gaps in heights: ramp"),
    (lambda: ScriptedPolicy("controller").build(de.load_scene("sprint")), "keeps the sched"),
    (lambda: design("tempo"), "its objective is tempo.*domino optimize"),
    (lambda: design("stock"), "from a stock.*domino optimize"),
    (lambda: design("magnify"), "or grow.*domino optimize"),
    (lambda: design("jitter"), "its scores are those of draws.*domino optimize"),
    (lambda: design("relay"), "a run-out follows its dominoes.*domino optimize"),
    (lambda: design("table"), "dominoes stand on a floor.*domino optimize"),
    (lambda: design(SMALL, tries=0), "tries = 0: give a whole number"),
    (lambda: design(SMALL, steps=-1), "steps = -1: give a whole number"),
])  # fmt: skip
def test_wrong_arguments_are_rejected(call, words):
    with pytest.raises((ValueError, TypeError), match=words):
        call()


def test_a_ramp_beats_uniform_and_keeps_a_length():
    assert SCRIPTED["ramp"](SMALL).gain > 0.0
    exact = replace(SMALL, length=0.14)
    rollout = SCRIPTED["ramp"](exact)
    assert exact.violations(rollout.layout) == []


def test_a_layout_whose_wave_stops_is_completed():
    scene = replace(de.load_scene("sprint"), name="stops", count=6, physics=de.Physics(push=2.8))
    rollout = build(lambda _: np.array([-1.0], dtype=np.float32), scene)
    assert rollout.layout.count == 6
    assert rollout.score < 0.0
    assert rollout.gain is None
    hills = de.load_scene("hills")
    beginning = hills.ground.layout([0.012] * 9, [0.0075] * 10)
    assert hills.violations(complete_layout(beginning, hills)) == []


@pytest.mark.parametrize(("scene", "words"), [
    ("sprint", "score 0.802997 m/s (PROPAGATED), level with the uniform baseline (0.802997), "),
    ("tempo", "RMS error 18.7318 ms (PROPAGATED), 18.73 ms with the uniform baseline, below 1 ns "),
    ("tempo-noise", "RMS error 19.299 ms (mean of 200 episodes), 19.16 ms with the uniform"),
])  # fmt: skip
def test_scripted_policies_are_evaluated_by_name(output_of, scene, words):
    assert evaluate("uniform", SMALL).score == SMALL.uniform().score
    assert f"{scene}: {words}" in output_of("evaluate", "uniform", "--scene", scene)


@pytest.mark.parametrize(("given", "words"), [
    ("--scene course --scenes 2", "--scenes: leave out --scene, or name a scene distribution"),
    ("--scene varied --distribution varied-course", "--distribution: leave it out; it is for"),
    ("--scene sprint --distribution varied", "--distribution: leave it out; it is for"),
    ("--scene varied --seed 3", "scenes = None: give a whole number, at least 1"),
    ("--scene sprint --seed 3", "--seed: leave it out without --scenes"),
])  # fmt: skip
def test_options_that_would_be_ignored_are_rejected(error_of, given, words):
    assert words in error_of("evaluate", "uniform", *given.split())


def test_the_time_of_a_policy_does_not_include_the_uniform_baseline(monkeypatch):
    events: list[str] = []
    baseline, clock = de.Scene.uniform, time.process_time
    monkeypatch.setattr(de.Scene, "uniform", lambda scene: events.append("b") or baseline(scene))
    monkeypatch.setattr("time.process_time", lambda: events.append("clock") or clock())
    policy = SimpleNamespace(build=lambda scene: SimpleNamespace(score=1.0))
    evaluate_scenes([SMALL, SMALL], policy)
    start = events.index("clock")
    assert [key for key, _ in groupby(events[start:])] == ["clock", "b", "clock"]
    assert "b" in events[:start]


@pytest.mark.parametrize("scene", [NOISY, DRAWN], ids=["placement noise", "drawn pieces"])
def test_rollouts_are_means_over_seeds_and_so_are_baselines_that_have_no_mean_of_their_own(scene):
    rollout = ScriptedPolicy("uniform").build(scene)
    scores = scene.score_placed(rollout.layout, EVALUATION_SEEDS)
    assert rollout.score == scores.mean() != scene.uniform().score
    expected = scene.uniform().score if scene.hand else rollout.score
    assert rollout.uniform.score == expected
    assert f"score {scores.mean():.6f} m/s, level with uniform" in repr(rollout)
    env = de.DominoChainVector(3, scene)
    env.reset(seed=EVALUATION_SEEDS[0])
    for _ in range(scene.count - 1):
        info = env.step(np.zeros(env.action_space.shape))[4]
    assert info["score"] == pytest.approx(scores[:3], rel=1e-5)


def test_policies_of_random_sampled_scenes_have_reproducible_scores():
    noisy = small_scenes("[placement]\ndeviation = 0.0005\n")
    scenes = [noisy.sample(np.random.default_rng(seed)) for seed in range(3)]

    def policy(observation):
        return 0.1 * observation[..., -2:]

    gains = evaluate_gains(policy, noisy, scenes)
    assert (gains == evaluate_gains(policy, noisy, scenes)).all()
    env, scores = de.DominoChain(noisy), []
    for seed in range(4):
        observation, _ = env.reset(seed=seed, options={"scene": scenes[0]})
        info = {}
        while not info:
            observation, *_, info = env.step(policy(observation))
        scores.append(info["score"])
    rollout = build(policy, scenes[0], distribution=noisy, seeds=range(4))
    assert rollout.score == np.mean(scores) != scores[0]
    assert not evaluate_scenes(scenes, ScriptedPolicy("uniform")).gains().any()


@pytest.mark.parametrize(("name", "reacting"), [
    ("varied-draw", "rule"), ("varied-tempo", "controller"),
])  # fmt: skip
def test_references_of_sampled_random_scenes_are_ranked(name, reacting):
    scene = de.load_test_set(name)[0]
    gains = [ScriptedPolicy(policy).build(scene).gain for policy in ("uniform", "plan", reacting)]
    assert gains[0] + 0.01 < gains[1] < gains[2]
    assert abs(gains[0]) < 0.01  # other episodes than those of the baseline


def test_gains_in_many_scenes_are_those_of_their_objective():
    scene = de.load_scene("tempo")
    done = ScenesEvaluation([scene] * 2, np.full(2, 0.05), {"policy": np.array([0.5, -0.5])}, {})
    assert done.gains().tolist() == [scene.gain(0.5, 0.05), pytest.approx(-11.0)]


def test_a_controller_keeps_the_schedule_that_a_plan_misses():
    scene = de.load_scene("tempo-noise")
    plan, controller = (ScriptedPolicy(name).build(scene) for name in ("plan", "controller"))
    assert 4.0 * plan.uniform.score < plan.score < 0.6 * controller.score
    tempo = scene.settings
    errors = scene.placement_errors(np.random.default_rng(EVALUATION_SEEDS[0]))
    chosen = controller.layout.spacing - errors
    free = (chosen > scene.spacing[0] + 1e-6) & (chosen < scene.spacing[1] - 1e-6)
    for n in np.flatnonzero(free)[::9]:  # without its own error, each hit is on time
        gaps = np.append(controller.layout.spacing[:n], chosen[n])
        first = de.Layout(gaps, controller.layout.thickness[: n + 2], scene.height)
        wave = scene.simulate(first)
        assert wave.arrival_times[-1] == pytest.approx(tempo.schedule(40)[n], abs=1e-6)
