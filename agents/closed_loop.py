"""Analytic policy gradients of closed-loop policies, which observe random quantities.

Episodes are run in the environment itself, and the gradient is exact for their random errors and
pieces. Entries of an observation that the policy does not use are set to zero.

- Pieces in random order: the policy uses position, hand, stock and the latest thicknesses, which
  do not depend on the gaps. It takes the pieces that the rule of `agents.draw` takes, and learns
  the preferences of the rule by regression; the gradient is with respect to the gaps.
- Placement noise and a schedule: the policy uses position, lateness, the next intervals, and the
  latest gaps and thicknesses. The gradient includes the effect of an action on later observations:
  the arrival times are linearised with their exact derivatives with respect to gaps and
  thicknesses.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch

from agents.draw import rule, shipped_references
from domino_env import Scene
from domino_env.core.types import Floats
from domino_env.kernels.step.action import SLOPE

RTOL = 1e-5  # relative error allowed in the arrival times of layouts built in training
# [%] weight in the loss of the mean squared error of preferences, which are -1 to 1
PREFERENCE_WEIGHT = 10.0
# parts of an observation that are used besides the position
HAND_PARTS = "thicknesses", "hand", "stock"
TEMPO_PARTS = "lateness", "intervals", "gaps", "thicknesses"


def random_parts(scene: Scene) -> tuple[str, ...]:
    """Return the names of the random parts of an observation that a policy uses; () for none."""
    if scene.hand:
        return HAND_PARTS
    return TEMPO_PARTS if scene.placement and scene.tempo is not None else ()


class Episodes:
    """Episodes of B environments with noise on the actions, and the loss of the policy in them.

    Parameters
    ----------
    actor
        `ScheduledPolicy` that acts.
    env
        `DominoVecEnv` of one scene.
    mask
        (O,) 1 for the entries of an observation that are used, 0 for the others.

    Attributes
    ----------
    infos
        Last info of the episode of each environment.
    """

    def __init__(self, actor: Any, env: Any, mask: torch.Tensor) -> None:
        scene: Scene = env.vector.scenes[0]
        self.scene, self.actor, self.parts = scene, actor, env.vector.observation_layout
        num_envs, pairs = env.num_envs, scene.count - 1
        self.noise = antithetic_noise(num_envs, pairs, env.action_space.shape[0])
        observations = torch.zeros(num_envs, pairs, len(mask))
        policy = rule(scene, shipped_references()["rule"]) if scene.hand else None
        self.preferences = torch.zeros(num_envs, pairs, env.action_space.shape[0] - 1)
        self.infos = [dict[str, Any]()] * num_envs
        observation, running = env.reset(), np.ones(num_envs, np.bool_)
        for n in range(pairs):
            observations[:, n] = torch.from_numpy(observation) * mask
            with torch.no_grad():
                actions = self.actions(observations[:, n], n).double().numpy()
            if policy is not None:
                self.preferences[:, n] = torch.from_numpy(policy(observation)[:, 1:])
                actions[:, 1:] = self.preferences[:, n]
            observation, _, terminated, infos = env.step(actions)
            for b in np.flatnonzero(terminated & running):
                self.infos[b] = infos[b]
            running &= ~terminated
        # the loss has no layouts whose wave stops: their scores are not positive
        complete = [b for b, info in enumerate(self.infos) if info["score"] > 0.0]
        self.observations, self.noise = observations[complete], self.noise[complete]
        self.preferences = self.preferences[complete]
        layouts = [self.infos[b]["layout"] for b in complete]
        self.spacing = np.array([layout.spacing for layout in layouts]).reshape(-1, pairs)
        self.thickness = np.array([layout.thickness[1:] for layout in layouts]).reshape(-1, pairs)

    def actions(self, observations: torch.Tensor, n: int) -> torch.Tensor:
        """Return the actions (B, A) of step n, with noise."""
        normal: torch.distributions.Normal = self.actor.get_distribution(observations).distribution
        return normal.mean + normal.stddev * self.noise[:, n]

    def loss(self) -> Any:
        """Return the loss: minus the mean gain [%] up to a constant, and the regression loss."""
        if not len(self.spacing):  # all waves stopped
            return 0.0 * self.actor.action_net.bias.sum()  # a zero with a gradient
        return self._hand_loss() if self.scene.hand else self._tempo_loss()

    def _hand_loss(self) -> Any:
        """Return the loss for pieces in random order."""
        normal = self.actor.get_distribution(self.observations.flatten(0, 1)).distribution
        mean, deviation = (part.reshape(*self.noise.shape) for part in (normal.mean, normal.stddev))
        actions = (mean + deviation * self.noise).double()[..., 0]
        batch = self.scene.batch(self.spacing, self.thickness, rtol=RTOL)
        gradient = self.scene.evaluate(batch, gradient=True).gradient
        assert gradient is not None
        uniform = self.scene.uniform()
        gaps = _sizes(actions, self.scene.spacing, uniform.layout.spacing[0])
        score = (torch.tensor(gradient.spacing) * gaps).sum(dim=1)
        error = (mean[..., 1:] - self.preferences) ** 2
        return -100.0 / uniform.score * score.mean() + PREFERENCE_WEIGHT * error.mean()

    def _tempo_loss(self) -> Any:
        """Return the loss for placement noise and a schedule."""
        scene, tempo = self.scene, self.scene.tempo
        assert tempo is not None
        uniform_layout = scene.uniform().layout
        times, by_gap, by_thickness = map(torch.tensor, self._derivatives())
        schedule = torch.from_numpy(tempo.schedule(scene.count))
        # changes of gap and thickness of the dominoes so far (B, n, 2) [m]; their values are 0, and
        # only their gradients are used
        changes = torch.zeros(len(times), 0, 2, dtype=torch.double)
        sizes = {"gaps": torch.from_numpy(self.spacing)}
        sizes["thicknesses"] = torch.from_numpy(self.thickness)
        for n in range(scene.count - 1):
            observation = self.observations[:, n].clone()
            if n:  # the first observation does not depend on actions
                earlier = torch.stack([by_gap[:, n - 1, :n], by_thickness[:, n - 1, :n]], dim=2)
                delay = times[:, n - 1] - schedule[n - 1] + (earlier * changes).sum(dim=(1, 2))
                late = torch.log1p(delay.abs() / tempo.tolerance)
                observation[:, self.parts["lateness"].start] = torch.copysign(late, delay).float()
                for k, (name, size) in enumerate(sizes.items()):
                    part, ratios = self.parts[name], changes[:, :n, k] / size[:, :n]
                    latest = ratios.flip(1)[:, : part.stop - part.start].float()
                    observation[:, part.start : part.start + latest.shape[1]] += latest
            actions = self.actions(observation, n).double()
            chosen = [
                _sizes(actions[:, 0], scene.spacing, uniform_layout.spacing[0]),
                _sizes(actions[:, 1], scene.thickness, uniform_layout.thickness[1]),
            ]
            change = torch.stack([size - size.detach() for size in chosen], dim=1)
            changes = torch.cat([changes, change[:, None]], dim=1)
        shift = (by_gap * changes[:, None, :, 0] + by_thickness * changes[:, None, :, 1]).sum(dim=2)
        error = ((times + shift - schedule) ** 2).mean(dim=1).sqrt()
        return 10.0 * torch.log10(1.0 + error / tempo.tolerance).mean()

    def _derivatives(self) -> tuple[Floats, Floats, Floats]:
        """Return arrival times (B, N-1) [s], and their derivatives (B, N-1, N-1).

        The derivatives are with respect to gaps, and to thicknesses [s/m].
        """
        num_layouts, pairs = self.spacing.shape
        spacing, thickness = (np.repeat(x, pairs, axis=0) for x in (self.spacing, self.thickness))
        waves = self.scene.batch(spacing, thickness, rtol=RTOL).simulate(record=True)
        gradient = waves.pullback(np.tile(np.eye(pairs, pairs + 1, 1), (num_layouts, 1)))
        shape = num_layouts, pairs, -1
        times = waves.arrival_times.reshape(shape)[:, 0, 1:]
        by_thickness = gradient.thickness.reshape(shape)[..., 1:]
        return times.copy(), gradient.spacing.reshape(shape), by_thickness.copy()


def antithetic_noise(number: int, *shape: int) -> torch.Tensor:
    """Return standard normal noise (number, …); the second half is the negative of the first."""
    half = torch.randn((number + 1) // 2, *shape)
    return torch.cat([half, -half])[:number]


def _sizes(actions: torch.Tensor, bounds: tuple[float, float], uniform: float) -> torch.Tensor:
    """Return the gaps or thicknesses [m] of entries of actions, see `domino_env.kernels.step`."""
    low, high = (abs(math.log(bound / uniform)) for bound in bounds)
    entries = actions.clamp(-1.0, 1.0)
    spans = torch.where(entries < 0.0, low, high)
    logarithms = entries * (SLOPE + (spans - SLOPE).clamp(min=0.0) * entries**2)
    return uniform * torch.exp(torch.maximum(torch.minimum(logarithms, spans), -spans))
