"""Analytic policy gradients: scores as functions of actions and of weights."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch

import domino_env as de
from agents import torch_score
from agents.algorithms import default_hyperparameters
from agents.apg import require_smooth
from agents.sb3 import Learner
from domino_env import DominoChain

SHORT = replace(de.load_scene("sprint"), name="short", count=12)
FREE = replace(SHORT, thickness=(0.004, 0.012))


@pytest.mark.parametrize(
    "scene",
    [FREE, replace(FREE, length=0.24), replace(FREE, ground=de.Ground(slope=-4.0))],
    ids=["free", "given length", "uneven ground"],
)
def test_the_gradient_by_the_weights_is_that_of_the_score(scene):
    """Compare with differences of the score of the layout built in the environment."""
    learner = Learner(scene, "apg", replace(default_hyperparameters("apg", 11), num_envs=2), 0)
    model, policy = learner.model, learner.model.policy
    policy.deviation, policy.penalty = 1e-9, 0.0
    bias = policy.action_net.bias
    with torch.no_grad():
        bias += 0.1
    model.learn(1, callback=None, log_interval=None)  # one update, without noise
    model._update_learning_rate = lambda optimizer: optimizer.param_groups[0].update(lr=0.0)
    model.max_grad_norm = 1e9
    model.learn(1, callback=None, log_interval=None, reset_num_timesteps=False)
    gradient, start = bias.grad.numpy().copy(), bias.detach().clone()

    def loss(at: torch.Tensor) -> float:
        with torch.no_grad():
            bias.copy_(at)
        act, single = learner.policy(), DominoChain(scene, rtol=1e-10)
        observation, ended = single.reset()[0], False
        while not ended:
            observation, _, ended, _, info = single.step(act(observation))
        return -100.0 * info["gain"]

    for i in range(2):
        step = torch.eye(2)[i] * 1e-3
        difference = (loss(start + step) - loss(start - step)) / 2e-3
        assert gradient[i] == pytest.approx(difference, rel=1e-2)
    weight = policy.mlp_extractor.policy_net[0].weight
    assert int(weight.any(dim=0).sum()) == 9  # of the position alone


def test_an_update_in_sampled_scenes_uses_all_of_them():
    chosen = replace(default_hyperparameters("apg", 39), num_envs=3)
    model = Learner(de.load_distribution("varied"), "apg", chosen, 0).model
    model.policy.deviation = 0.05
    infos: list[dict[str, object]] = []
    before = model.policy.action_net.weight.detach().clone()
    model.learn(1, callback=lambda now, _: infos.extend(now["infos"]) or True, log_interval=None)
    assert len(infos) == 3
    for info, scene in zip(infos, model.env.vector.scenes, strict=True):
        assert scene.violations(info["layout"]) == []
    assert not torch.equal(before, model.policy.action_net.weight)


def test_listed_values_have_no_gradient():
    with pytest.raises(ValueError, match="'short' has a list of values, a step or a stock"):
        require_smooth(replace(SHORT, spacing_values=(0.01, 0.02)))


@pytest.mark.parametrize("scene", [SHORT, FREE], ids=["gaps", "gaps and thicknesses"])
def test_a_score_of_tensors_has_the_exact_gradient(scene):
    score = torch_score(scene, rtol=1e-8)
    rng = np.random.default_rng(0)
    gaps, thickness = (torch.tensor(rng.uniform(*bounds, (2, 11)), requires_grad=True)
                       for bounds in ((0.012, 0.018), (0.006, 0.008)))  # fmt: skip
    sizes = (gaps, thickness) if scene is FREE else (gaps,)
    scores = score(*sizes)
    layouts = [scene.layout(*(size[b].detach().numpy() for size in sizes)) for b in range(2)]
    assert scores.tolist() == pytest.approx([scene.score(layout) for layout in layouts], rel=1e-6)
    assert torch.autograd.gradcheck(score, sizes, eps=1e-6, atol=1e-3, rtol=1e-3)
    single = score(gaps.detach().float().requires_grad_(), *sizes[1:])
    single.sum().backward()
    assert single.dtype == torch.float32
