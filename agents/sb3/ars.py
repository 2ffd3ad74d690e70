"""Augmented random search (ARS) in a batch of environments.

References
----------
Mania, H., Guy, A., Recht, B. (2018). Simple random search provides a competitive approach to
reinforcement learning. arXiv:1803.07055.
"""

from __future__ import annotations

from collections import deque
from typing import Any

import torch
from sb3_contrib import ARS


class VectorARS(ARS):
    """ARS of sb3-contrib that evaluates linear candidates in a batch of environments."""

    def evaluate_candidates(
        self, candidate_weights: torch.Tensor, callback: Any, async_eval: Any
    ) -> torch.Tensor:
        """Build a layout with each of P candidates, and return the returns (P,) of the episodes."""
        callback.on_rollout_start()
        self.ep_info_buffer = deque()
        env: Any = self.env
        batches = torch.split(candidate_weights, env.num_envs)
        returns = torch.cat([self._returns(env, batch, callback) for batch in batches])
        callback.on_rollout_end()
        return returns

    def _returns(self, env: Any, weights: torch.Tensor, callback: Any) -> torch.Tensor:
        """Return the returns (P,) of P candidates; surplus environments repeat the last one."""
        num_envs, number = env.num_envs, len(weights)
        padded = torch.cat([weights, weights[-1:].expand(num_envs - number, -1)])
        observations = torch.from_numpy(env.reset())
        matrices = padded.reshape(num_envs, -1, observations.shape[1])  # weights of linear policies
        running = torch.ones(num_envs, dtype=torch.bool)
        returns = torch.zeros(num_envs)
        while running[:number].any():
            actions = torch.bmm(matrices, observations[:, :, None])[:, :, 0].clamp(-1.0, 1.0)
            next_observations, rewards, dones, infos = env.step(actions.numpy())
            returns += torch.from_numpy(rewards) * running
            running &= ~torch.from_numpy(dones)
            self.num_timesteps += num_envs
            callback.update_locals({"infos": infos})
            callback.on_step()
            observations = torch.from_numpy(next_observations)
        return returns[:number]
