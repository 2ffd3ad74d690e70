"""Augmented random search that tries its candidates side by side, each in a row of its own."""

from __future__ import annotations

from collections import deque
from typing import Any

import torch
from sb3_contrib import ARS
from torch.func import functional_call, vmap


class SideBySideARS(ARS):
    """ARS of sb3-contrib, which would try one candidate after the other, in all rows alike.

    References
    ----------
    Mania, H., Guy, A., Recht, B. (2018). Simple random search provides a competitive approach to
    reinforcement learning. arXiv:1803.07055.
    """

    @property
    def _rows(self) -> Any:
        return self.env

    def evaluate_candidates(
        self, candidate_weights: torch.Tensor, callback: Any, async_eval: Any
    ) -> torch.Tensor:
        """Build a row with each candidate; the (P,) returns of their episodes.

        Raises
        ------
        ValueError
            Where `async_eval` is given.
        """
        if async_eval is not None:
            raise ValueError("candidates are tried side by side here: leave async_eval out")
        callback.on_rollout_start()
        self.ep_info_buffer = deque()
        rows = self._rows.num_envs
        parts = torch.split(candidate_weights, rows)
        returns = torch.cat([self._tried(part, callback) for part in parts])
        callback.on_rollout_end()
        return returns

    def _tried(self, weights: torch.Tensor, callback: Any) -> torch.Tensor:
        """(P,) returns of at most as many candidates as there are rows; the last stands in."""
        rows, many = self._rows.num_envs, len(weights)
        filled = torch.cat([weights, weights[-1:].expand(rows - many, -1)])
        policy: Any = self.policy
        net, at, named = policy.action_net, 0, {}
        for name, value in net.named_parameters():
            size = value.numel()
            named[name] = filled[:, at : at + size].reshape(rows, *value.shape)
            at += size
        act = vmap(lambda own, observations: functional_call(net, own, (observations,)))
        observations = torch.from_numpy(self._rows.reset())
        running = torch.ones(rows, dtype=torch.bool)
        returns = torch.zeros(rows)
        while running[:many].any():
            actions = act(named, observations).clamp(-1.0, 1.0)
            after, rewards, ended, infos = self._rows.step(actions.numpy())
            returns += torch.from_numpy(rewards) * running
            running &= ~torch.from_numpy(ended)
            self.num_timesteps += rows
            callback.update_locals({"infos": infos})
            callback.on_step()
            observations = torch.from_numpy(after)
        return returns[:many] + 0.0
