"""Scripted policies."""

from dataclasses import replace

import numpy as np
import pytest
from env_scenes import SMALL

import domino_env as de
from agents import evaluate
from agents.rollout import build, complete_layout
from agents.scripted import SCRIPTED
from domino_env import DominoChain


@pytest.mark.parametrize("name", ["uniform", "greedy", "ramp"])
def test_a_scripted_policy_keeps_the_rules_and_has_the_score_of_the_scene(name):
    rollout = SCRIPTED[name](SMALL)
    assert SMALL.violations(rollout.layout) == []
    assert rollout.score == SMALL.score(rollout.layout)
    if rollout.score > 0.0:  # the largest next reward alone may stop the wave
        assert rollout.gain == pytest.approx(rollout.score / rollout.uniform.score - 1.0)
    else:
        assert name == "greedy"
        assert rollout.gain is None


def test_a_ramp_beats_uniform_and_keeps_a_length():
    assert SCRIPTED["ramp"](SMALL).gain > 0.0
    exact = replace(SMALL, length=0.14)
    rollout = SCRIPTED["ramp"](exact)
    assert exact.violations(rollout.layout) == []


def test_greedy_takes_the_action_with_the_largest_next_reward():
    rollout = SCRIPTED["greedy"](SMALL)
    env = DominoChain(SMALL)
    env.reset()
    low, high = SMALL.spacing
    action = 2.0 * (rollout.layout.spacing[0] - low) / (high - low) - 1.0
    reward = env.step(np.array([action]))[1]
    for other in np.linspace(-1.0, 1.0, 9):
        env.reset()
        assert env.step(np.array([other]))[1] <= reward + 1e-9


def test_a_layout_whose_wave_stops_is_completed():
    scene = replace(de.load_scene("sprint"), name="stops", count=6, physics=de.Physics(push=2.8))
    rollout = build(lambda _: np.array([-1.0], dtype=np.float32), scene)
    assert rollout.layout.count == 6
    assert rollout.score < 0.0
    assert rollout.gain is None
    hills = de.load_scene("hills")
    beginning = hills.ground.layout([0.012] * 9, [0.0075] * 10)
    assert hills.violations(complete_layout(beginning, hills)) == []


def test_scripted_policies_are_evaluated_by_name(output_of):
    assert evaluate("uniform", SMALL).score == SMALL.uniform().score
    with pytest.raises(ValueError, match="has no scene of its own: give one"):
        evaluate("uniform")
    with pytest.raises(ValueError, match="no best known layout of scene 'small' is shipped"):
        evaluate("plan", SMALL)
    output = output_of("evaluate", "uniform", "--scene", "sprint")
    assert "score 0.802997" in output
    assert "level with the uniform baseline" in output
