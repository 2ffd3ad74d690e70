"""Analytic policy gradient: the exact slope of the score, pulled back through the policy.

No other environment of this kind can tell the derivative of its return by the actions; here it is
exact (`Scene.score_batch_gradient`). So the gradient of the expected return by the weights needs no
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

from functools import lru_cache
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

from agents.apg.rows import lay, require_smooth
from domino_env import Scene
from domino_env.envs.observation import SCALES

RTOL = 1e-5  # of rows that are built while learning
PROGRESS = 1 + 2 * len(SCALES)  # entries of an observation that tell how far the row has come


class APG(OnPolicyAlgorithm):
    """Analytic policy gradient, as an algorithm of stable-baselines3.

    Parameters
    ----------
    policy, env, learning_rate, policy_kwargs, verbose, seed, device
        As of `stable_baselines3.PPO`; the environment is an `agents.sb3.vec_env.DominoVecEnv`, each
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
        rows: Any = self.env
        scene, policy = rows.rows.scene, self._actor
        require_smooth(scene)
        with torch.no_grad():
            policy.mlp_extractor.policy_net[0].weight[:, :-PROGRESS] = 0.0
            policy.action_net.bias.copy_(torch.tensor(uniform_action(scene)))

    @property
    def _actor(self) -> Any:
        return self.policy

    def collect_rollouts(
        self, env: Any, callback: Any, rollout_buffer: Any, n_rollout_steps: int
    ) -> bool:
        """Build rows with noise, one in each place of the environment, and find their slopes."""
        callback.on_rollout_start()
        scene, size = env.rows.scene, int(np.prod(self.observation_space.shape or ()))
        pairs = scene.count - 1
        normal = self._actor.get_distribution(progress_of_row(scene.count, size)).distribution
        half = torch.randn((env.num_envs + 1) // 2, *normal.mean.shape)
        noise = torch.cat([half, -half])[: env.num_envs]  # antithetic
        actions = (normal.mean + normal.stddev * noise).double()
        rows = lay([scene] * env.num_envs, actions)
        spacing, thickness, height = (part.detach().numpy() for part in rows)
        tall = None if scene.growth is None else height
        found, slopes = scene.evaluate_batch_gradient(spacing, thickness, RTOL, tall)
        rise = (
            rows.spacing * torch.from_numpy(slopes.spacing)
            + rows.thickness * torch.from_numpy(slopes.thickness)
            + rows.height * torch.from_numpy(slopes.height)
        ).sum() / env.num_envs
        # in per cent of the uniform row's score, as returns are
        self._loss = -100.0 / (abs(scene.uniform().score) or 1.0) * rise
        self.num_timesteps += env.num_envs * pairs
        layouts = (
            scene.layout(spacing[b], thickness[b], None if tall is None else tall[b])
            for b in range(env.num_envs)
        )
        infos = [
            {"score": float(score), "reach": float(reach), "layout": layout}
            for score, reach, layout in zip(found.score, found.reach, layouts, strict=True)
        ]
        callback.update_locals({"infos": infos})
        going_on = callback.on_step()
        callback.on_rollout_end()
        return bool(going_on)

    def train(self) -> None:
        """Take a step up the slope of the mean return."""
        optimizer = self._actor.optimizer
        self._update_learning_rate(optimizer)
        optimizer.zero_grad()
        self._loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self._actor.parameters(), self.max_grad_norm)
        optimizer.step()
        self._n_updates += 1


def uniform_action(scene: Scene) -> list[float]:
    """Give the action that builds the best uniform row, taken again and again.

    With a largest change of the gaps, where an action is a change, it is that of the middle.
    """
    row = scene.uniform().layout
    gap, thick, tall = row.spacing[0], row.thickness[1], row.height[1]
    if scene.in_heights:
        gap, thick = gap / min(scene.height, tall), thick / tall
    chosen = [(gap, scene.spacing)] * scene.free_spacing
    chosen += [(thick, scene.thickness)] * scene.free_thickness
    if scene.growth is not None:
        chosen += [(tall / scene.height, scene.growth)] * scene.free_height
    actions = [2.0 * (value - low) / (high - low) - 1.0 for value, (low, high) in chosen]
    if scene.largest_change is not None and scene.free_spacing:
        actions[0] = 0.0
    return actions


@lru_cache(maxsize=64)
def progress_of_row(count: int, size: int) -> torch.Tensor:
    """Return what is observed (N-1, O) while a row is built, where it tells how far that has come.

    All other entries are 0.
    """
    placed, scales = np.arange(count - 1)[:, None], np.array(SCALES)
    seen = np.zeros((count - 1, size), dtype=np.float32)
    seen[:, -PROGRESS:] = np.concatenate(
        [
            placed / (count - 1),
            np.exp(-placed / scales),
            np.exp((placed - count + 1) / scales),
        ],
        axis=1,
    )
    return torch.from_numpy(seen)
