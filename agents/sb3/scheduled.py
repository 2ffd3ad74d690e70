"""Policy whose exploration noise follows a schedule."""

from __future__ import annotations

import math
from typing import Any

import torch
from stable_baselines3.common.distributions import DiagGaussianDistribution, Distribution
from stable_baselines3.common.policies import ActorCriticPolicy


class ScheduledPolicy(ActorCriticPolicy):
    """Policy with normal actions whose standard deviation follows a schedule.

    The standard deviation is larger near the end of the chain. There the best layouts have a few
    tight gaps and thick dominoes, which can be optimised only when the rest of the layout is good.
    An additional loss reduces means outside [-1, 1]: all samples beyond a bound are clipped to it,
    so their rewards have no gradient.

    Attributes
    ----------
    deviation
        Standard deviation of the actions far from the end of the chain.
    end_factor
        Ratio of the standard deviation at the end to `deviation`. The standard deviation is at most
        1.
    penalty
        Factor of the additional loss, half the mean squared distance of the means from [-1, 1].
    near_end
        Index of the entry exp(-(dominoes to place) / 4) in an observation.
    """

    deviation, end_factor, penalty, near_end = 1.0, 1.0, 0.0, 0

    def extract_features(self, obs: Any, features_extractor: Any = None) -> Any:
        """Store the entry `near_end`, and extract features as `ActorCriticPolicy` does."""
        self._near_end = obs[:, [self.near_end]]
        return super().extract_features(obs, features_extractor)

    def get_distribution(self, obs: Any) -> Distribution:
        """Store the entry `near_end`, as the base class does not call `extract_features` here."""
        self._near_end = obs[:, [self.near_end]]
        return super().get_distribution(obs)

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> Distribution:
        means: Any = self.action_net(latent_pi)
        if self.penalty > 0.0 and means.requires_grad:
            excess = (means - means.clamp(-1.0, 1.0)).detach() * (self.penalty / len(means))
            means.register_hook(lambda gradient: gradient + excess)  # plus that of the penalty
        factor = math.log(self.end_factor) * self._near_end
        log_deviations = torch.clamp(math.log(self.deviation) + factor, max=0.0)
        assert isinstance(self.action_dist, DiagGaussianDistribution)
        return self.action_dist.proba_distribution(means, log_deviations)
