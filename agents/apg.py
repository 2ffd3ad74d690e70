"""Analytic policy gradient: the exact slope of the score, pulled back through the policy.

No other environment of this kind can tell the derivative of its return by the actions; here it is
exact (`Scene.evaluate`). So the gradient of the expected return by the weights needs no
critic and no likelihoods: rows are built with noise, which lets the policy see beyond the nearest
slope and falls on a schedule, and each row's slope goes back through what its actions stand for
and through the network. The policy goes by how far the row has come alone (and by the features of
the scene, where scenes are drawn): the weights of all else that is observed are zero and stay so.
What it has placed is a function of that too, so that nothing is lost as long as what is placed
stands where it should.

References
----------
Freeman, C. D., et al. (2021). Brax: a differentiable physics engine for large scale rigid body
simulation. NeurIPS Datasets and Benchmarks. arXiv:2106.13281.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

from domino_env import Scene
from domino_env.core.types import Floats
from domino_env.envs.spaces import closeness

RTOL = 1e-5  # of rows that are built while learning


class APG(OnPolicyAlgorithm):
    """Analytic policy gradient, as an algorithm of stable-baselines3.

    Parameters
    ----------
    policy, env, learning_rate, policy_kwargs, verbose, seed, device
        As of `stable_baselines3.PPO`; the environment is an `agents.vec_env.DominoVecEnv`, each
        of whose rows is built once an update.
    """

    def __init__(
        self,
        policy: Any,
        env: Any,
        learning_rate: Any = 0.02,
        max_grad_norm: float = 5.0,
        policy_kwargs: dict[str, Any] | None = None,
        verbose: int = 0,
        seed: int | None = None,
        device: str = "auto",
        _init_setup_model: bool = True,
    ) -> None:
        super().__init__(
            policy, env, learning_rate, policy_kwargs=policy_kwargs, verbose=verbose, seed=seed,
            device=device, _init_setup_model=_init_setup_model,
            # of rollouts and critics, which there are none of
            n_steps=1, gamma=1.0, gae_lambda=1.0, ent_coef=0.0, vf_coef=0.0, use_sde=False,
            sde_sample_freq=-1, max_grad_norm=max_grad_norm,
        )  # fmt: skip

    def _setup_model(self) -> None:
        """Begin as the best uniform row, with weights for what the policy may go by."""
        super()._setup_model()
        if self.env is None:
            return
        env: Any = self.env
        env.reset()  # which draws scenes, if they are drawn
        require_smooth(env.vector.scenes[0])  # which all scenes are like
        seen = env.vector.observation_layout
        first, last = seen["placed"].start, seen.get("features", seen["near_end"]).stop
        layouts = [scene.uniform().layout for scene in env.vector.scenes]
        env.vector.step(env.vector.actions_towards(layouts))  # later gaps may have other bounds
        start = env.vector.actions_towards(layouts).mean(axis=0)
        with torch.no_grad():
            weight = self._actor.mlp_extractor.policy_net[0].weight
            weight[:, :first] = 0.0
            weight[:, last:] = 0.0
            self._actor.action_net.bias.copy_(torch.from_numpy(start))

    @property
    def _actor(self) -> Any:
        return self.policy

    def collect_rollouts(
        self, env: Any, callback: Any, rollout_buffer: Any, n_rollout_steps: int
    ) -> bool:
        """Build rows with noise, one in each place of the environment, and find their slopes."""
        callback.on_rollout_start()
        number = env.num_envs
        scenes, seen = _begin(env)
        normal = self._actor.get_distribution(seen.flatten(0, 1)).distribution
        mean, deviation = (
            part.reshape(*seen.shape[:2], -1) for part in (normal.mean, normal.stddev)
        )
        half = torch.randn((number + 1) // 2, *mean.shape[1:])
        noise = torch.cat([half, -half])[:number]  # antithetic
        actions = (mean + deviation * noise).double()
        values = actions.detach().numpy()
        infos, bars = _scored(scenes, *env.vector.place_all(values))
        gradient = env.vector.place_all_back(values, bars)
        gradient[(np.abs(values) > 1.0) & (values * gradient > 0.0)] = 0.0  # further outwards
        self._loss = -(actions * torch.from_numpy(gradient)).sum()
        self.num_timesteps += sum(scene.count - 1 for scene in scenes)
        callback.update_locals({"infos": infos})
        going_on = callback.on_step()
        callback.on_rollout_end()
        return bool(going_on)

    def train(self) -> None:
        """Take a step up the slope of the mean return."""
        optimizer = self._actor.optimizer
        self._update_learning_rate(optimizer)
        optimizer.zero_grad()
        self._loss.backward()
        torch.nn.utils.clip_grad_norm_(self._actor.parameters(), self.max_grad_norm)
        optimizer.step()
        self._n_updates += 1


def require_smooth(scene: Scene) -> None:
    """Raise ValueError for a scene whose layouts are no smooth function of actions."""
    lists = (scene.spacing_values, scene.thickness_values, scene.stock)
    if any(rule is not None for rule in lists):
        raise ValueError(
            f"scene '{scene.name}' has lists, steps or a stock, whose values jump: apg follows the "
            "gradient by the actions, and there is none; leave them out, or choose ppo"
        )


def _begin(env: Any) -> tuple[list[Scene], torch.Tensor]:
    """Scenes of R rows, and what the policy goes by while they are built.

    That is (R, P, O) for P pairs of the longest row, or (1, P, O) where all rows have one scene.
    """
    size, layout = env.observation_space.shape[0], env.vector.observation_layout
    progress = slice(layout["placed"].start, layout["near_end"].stop)
    features = layout.get("features")
    drawn = np.zeros((1, size), np.float32) if features is None else env.reset()
    scenes = list(env.vector.scenes)
    seen = np.zeros((len(drawn), max(scene.count for scene in scenes) - 1, size), np.float32)
    for row, scene, observed in zip(seen, scenes, drawn, strict=False):
        row[: scene.count - 1, progress] = progress_of_row(scene.count)
        if features is not None:
            row[:, features] = observed[features]
    return scenes, torch.from_numpy(seen)


def progress_of_row(count: int) -> NDArray[np.float32]:
    """Return what is observed of how far a row has come while it is built, (N-1, 1 + 2 S)."""
    placed, near = np.arange(count - 1)[:, None] / (count - 1), closeness(count)
    return np.concatenate([placed.astype(np.float32), near[:-1], near[:0:-1]], axis=1)


def _scored(
    scenes: list[Scene], spacing: Floats, thickness: Floats, height: Floats
) -> tuple[list[dict[str, Any]], Floats]:
    """Infos of layouts, and the gradient of the mean return by gap, thickness and height.

    The gradient (R, P, 3) counts in per cent of the uniform baseline's score, as returns do.
    """
    bars = np.zeros((*spacing.shape, 3))
    infos = list[dict[str, Any]]()
    alike = len(set(scenes)) == 1
    step = len(scenes) if alike else 1
    for chosen in (slice(b, b + step) for b in range(0, len(scenes), step)):
        scene = scenes[chosen][0]
        pairs = slice(0, scene.count - 1)
        gaps, thick, tall = (
            np.ascontiguousarray(part[chosen, pairs]) for part in (spacing, thickness, height)
        )
        grown = None if scene.growth is None else tall
        found = scene.evaluate(scene.batch(gaps, thick, grown, RTOL), gradient=True)
        by = found.gradient
        assert by is not None
        unit = 100.0 / (abs(scene.uniform().score) or 1.0) / len(scenes)
        for k, exact in enumerate((by.spacing, by.thickness, by.height)):
            bars[chosen, pairs, k] = unit * exact
        for b, score in enumerate(found.score):
            layout = scene.layout(gaps[b], thick[b], None if grown is None else grown[b])
            infos.append({"score": float(score), "reach": float(found.reach[b]), "layout": layout})
    return infos, bars
