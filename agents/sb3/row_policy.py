"""The policy of PPO here: its mean action is learned, the deviation from that is given.

Two things differ from stable-baselines3's own. The deviation of the actions is larger near the end
of the row, where the best rows have a few tight gaps and thick dominoes: which of them are wanted
is seen only once the rest of the row is good, and must not have been decided by then. And means
that have left the box are drawn back to it: beyond it all samples are cut off at the same end, and
nothing is learned from them any more.
"""

from __future__ import annotations

import math
from typing import Any

import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution, Distribution
from stable_baselines3.common.policies import ActorCriticPolicy

from domino_env.envs.spaces import SCALES

NEAR_END = SCALES.index(4.0)  # of the entries "near_end": exp(-(dominoes to come) / 4)


class RowPolicy(ActorCriticPolicy):
    """Normal actions whose standard deviation is not learned.

    Attributes
    ----------
    deviation
        Standard deviation of the actions, far from the end.
    end
        So many times larger it is at the end, where it stays below 1.
    pull
        This times half the mean squared excess of the means over [-1, 1] is added to the loss.
    near_end
        Index of the entry exp(-(dominoes to come) / 4) in an observation.
    """

    deviation, end, pull, near_end = 1.0, 1.0, 0.0, 0

    def extract_features(self, obs: Any, features_extractor: Any = None) -> Any:
        """Note how near the end each row is; see `ActorCriticPolicy`."""
        self._near = obs[:, [self.near_end]]
        return super().extract_features(obs, features_extractor)

    def get_distribution(self, obs: Any) -> Distribution:
        """Note how near the end each row is; `extract_features` is not asked here."""
        self._near = obs[:, [self.near_end]]
        return super().get_distribution(obs)

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> Distribution:
        means: Any = self.action_net(latent_pi)
        if self.pull > 0.0 and means.requires_grad:
            excess = (means - means.clamp(-1.0, 1.0)).detach() * (self.pull / len(means))
            means.register_hook(lambda slope: slope + excess)
        wider = math.log(self.end) * self._near
        log_deviations = torch.clamp(math.log(self.deviation) + wider, max=0.0)
        assert isinstance(self.action_dist, DiagGaussianDistribution)
        return self.action_dist.proba_distribution(means, log_deviations)
