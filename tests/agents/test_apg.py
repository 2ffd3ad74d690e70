"""Analytic policy gradients: scores as functions of actions and of weights."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3")
import torch

import domino_env as de
from agents import DominoVecEnv, closed_loop, torch_score
from agents.algorithms import default_hyperparameters
from agents.apg import _initial_observations, require_supported
from agents.closed_loop import random_parts
from agents.network import build_actor
from agents.rollout import SEEDS_PER_TRAINING, episode_scores
from agents.sb3.factory import make_model, weights

SHORT = replace(de.load_scene("sprint"), name="short", count=12)
FREE = replace(SHORT, thickness=(0.004, 0.012))


SCENES = {
    "free": FREE,
    "given length": replace(FREE, length=0.24),
    "uneven ground": replace(FREE, ground=de.Ground(slope=-4.0)),
    "draw": de.load_scene("draw"),
    "tempo-noise": de.load_scene("tempo-noise"),
}


@pytest.mark.parametrize("name", SCENES)
def test_the_gradient_by_the_weights_matches_finite_differences(name, monkeypatch):
    """Compare with differences of the mean score of the same episodes."""
    scene = SCENES[name]
    seeds = range(SEEDS_PER_TRAINING, SEEDS_PER_TRAINING + (2 if random_parts(scene) else 1))
    chosen = default_hyperparameters("apg", SHORT).replace(num_envs=2)
    model = make_model(scene, "apg", chosen, 0)
    policy = model.policy
    layer = policy.mlp_extractor.policy_net[0]
    if not random_parts(scene):
        assert int(layer.weight.any(dim=0).sum()) == 9  # of the position alone
    policy.deviation, policy.penalty = 1e-9, 0.0
    with torch.no_grad():
        policy.action_net.bias += 0.1  # away from the uniform baseline
        policy.action_net.weight.mul_(20.0 if random_parts(scene) else 5.0)  # larger reactions
        if name == "draw":  # always prefers the same thickness
            policy.action_net.weight[1:] = 0.0
            policy.action_net.bias[1:] = torch.tensor([-0.1, 0.9, 0.1])
            numbers = {"rule": np.repeat([0.1, 0.0], [7, 18])}
            monkeypatch.setattr(closed_loop, "shipped_references", lambda: numbers)
    model.env.seed(SEEDS_PER_TRAINING)
    if random_parts(scene):
        mask = torch.from_numpy(model._mask)
        closed_loop.Episodes(policy, model.env, mask).loss().backward()
    else:
        model._open_loop_loss(model.env)[0].backward()
    gradient, start = layer.bias.grad.numpy().copy(), layer.bias.detach().clone()

    def loss(bias: torch.Tensor) -> float:
        with torch.no_grad():
            layer.bias.copy_(bias)
        scores = episode_scores(build_actor(weights(policy)).act, scene, seeds)
        return -100.0 * float(scene.criterion.gain(scores, scene.uniform().score).mean())

    for i in np.argsort(-np.abs(gradient))[:2]:
        step = torch.eye(len(start))[i] * 1e-3
        difference = (loss(start + step) - loss(start - step)) / 2e-3
        assert gradient[i] == pytest.approx(difference, rel=2e-2)


def test_an_update_uses_all_sampled_scenes():
    chosen = default_hyperparameters("apg", SHORT).replace(num_envs=3)
    model = make_model(de.load_distribution("varied"), "apg", chosen, 0)
    model.policy.deviation = 0.05
    infos: list[dict[str, object]] = []
    before = model.policy.action_net.weight.detach().clone()
    model.learn(1, callback=lambda now, _: infos.extend(now["infos"]) or True, log_interval=None)
    assert len(infos) == 3
    for info, scene in zip(infos, model.env.vector.scenes, strict=True):
        assert scene.violations(info["layout"]) == []
    assert not torch.equal(before, model.policy.action_net.weight)


def test_sampled_scenes_are_new_in_every_update_if_their_numbers_are_hidden():
    varied = de.load_distribution("varied")
    env = DominoVecEnv(varied, 3, hide=varied.features)
    (first, observations), (second, _) = (_initial_observations(env) for _ in range(2))
    assert len(observations) == len({*first, *second}) / 2 == 3


@pytest.mark.parametrize(("name", "changes", "is_sampled", "words"), [
    ("stock", {}, False, "'stock' has a stock: its score has no gradient"),
    ("draw", {}, True, "'draw' has placement noise or drawn pieces: for apg it must be a fixed"),
    ("draw", {"spacing": (0.02, 0.02)}, False, "with free gaps and thicknesses in metres; change"),
    ("draw", {"count": 2}, False, "a fixed scene of three dominoes or more .* or use ppo"),
    ("tempo-noise", {"thickness": (0.0075, 0.0075)}, False, "'tempo-noise' has placement noise"),
])  # fmt: skip
def test_scenes_in_which_apg_cannot_learn_are_rejected(name, changes, is_sampled, words):
    with pytest.raises(ValueError, match=words):
        require_supported(de.load_scene(name).replace(**changes), is_sampled)


def test_arguments_of_a_score_of_tensors_are_checked():
    with pytest.raises(TypeError, match=r"spacing = 3: give a tensor \(B, 11\)"):
        torch_score(SHORT)(3)
    with pytest.raises(ValueError, match="rtol = 5: give a finite number from 1e-13"):
        torch_score(SHORT, rtol=5)


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
    for wrong in (gaps[:, 1:], gaps.long(), gaps[0, 0]):
        with pytest.raises(ValueError, match=r"spacing is torch\..*: give a tensor \(B, 11\)"):
            score(wrong, *sizes[1:])
    with pytest.raises(RuntimeError, match="first derivatives only"):
        torch.autograd.functional.hessian(lambda x: score(x, *sizes[1:]).sum(), gaps)
    single = score(gaps.detach().float().requires_grad_(), *sizes[1:])
    single.sum().backward()
    assert single.dtype == torch.float32
