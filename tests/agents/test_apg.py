"""Analytic policy gradients: rows as functions of actions, and slopes pulled back through them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch

import domino_env as de
from agents.algorithms import hyperparameters
from agents.apg import progress_of_row, require_smooth
from agents.sb3 import Learner
from domino_env import DominoChain

SHORT = replace(de.load_scene("sprint"), name="short", count=12)
FREE = replace(SHORT, thickness=(0.004, 0.012))


def test_what_is_observed_of_progress_is_what_the_environment_shows() -> None:
    env = DominoChain(SHORT)
    observation, _ = env.reset()
    wanted = progress_of_row(SHORT.count)
    for seen in wanted:
        assert np.array_equal(observation[-len(seen) :], seen)
        observation = env.step(np.zeros(1))[0]


@pytest.mark.parametrize(
    "scene",
    [FREE, replace(FREE, length=0.24), replace(FREE, ground=de.Ground(slope=-4.0))],
    ids=["free", "given length", "uneven ground"],
)
def test_the_slope_by_the_weights_is_that_of_the_score(scene) -> None:
    """Against differences of the score of the row that the policy builds in the environment."""
    learner = Learner(scene, "apg", replace(hyperparameters("apg", 11), rows=2), 0)
    model, policy = learner.model, learner.model.policy
    policy.deviation, policy.pull = 1e-9, 0.0
    bias = policy.action_net.bias
    with torch.no_grad():
        bias += 0.1
    model.learn(1, callback=None, log_interval=None)  # one update, of rows without noise
    model._update_learning_rate = lambda optimizer: optimizer.param_groups[0].update(lr=0.0)
    model.max_grad_norm = 1e9
    model.learn(1, callback=None, log_interval=None, reset_num_timesteps=False)
    slope, start = bias.grad.numpy().copy(), bias.detach().clone()

    def loss(at: torch.Tensor) -> float:
        with torch.no_grad():
            bias.copy_(at)
        act, single = learner.policy(), DominoChain(scene, rtol=1e-10)
        seen, ended = single.reset()[0], False
        while not ended:
            seen, _, ended, _, info = single.step(act(seen))
        return -100.0 * info["gain"]

    for i in range(2):
        step = torch.eye(2)[i] * 1e-3
        difference = (loss(start + step) - loss(start - step)) / 2e-3
        assert slope[i] == pytest.approx(difference, rel=1e-2)
    weight = policy.mlp_extractor.policy_net[0].weight
    assert int(weight.any(dim=0).sum()) == 9  # of progress alone


def test_drawn_scenes_are_climbed_together() -> None:
    plan = replace(hyperparameters("apg", 39), rows=3)
    model = Learner(de.load_distribution("varied"), "apg", plan, 0).model
    model.policy.deviation = 0.05
    told: list[dict[str, object]] = []
    before = model.policy.action_net.weight.detach().clone()
    model.learn(1, callback=lambda now, _: told.extend(now["infos"]) or True, log_interval=None)
    assert len(told) == 3
    for info, scene in zip(told, model.env.vector.scenes, strict=True):
        assert scene.violations(info["layout"]) == []
    assert not torch.equal(before, model.policy.action_net.weight)


def test_values_that_jump_have_no_slope() -> None:
    with pytest.raises(ValueError, match="'short' has lists, steps or a stock"):
        require_smooth(replace(SHORT, spacing_values=(0.01, 0.02)))
