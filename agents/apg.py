"""Analytic policy gradient: backpropagation of the exact gradient of the score into the policy.

The derivative of the score with respect to the layout is exact (`Scene.evaluate`), so the gradient
of the expected score needs no critic and no likelihood ratio. Layouts are built with noise, which
smooths the score over nearby layouts and decreases on a schedule; the gradient of each score is
propagated back through the placing of dominoes and through the network. The policy observes its
position in the chain, the features of sampled scenes, and the entries of `random_parts`: the
weights of all other entries of an observation stay zero.

References
----------
Freeman, C. D., et al. (2021). Brax: a differentiable physics engine for large scale rigid body
simulation. NeurIPS Datasets and Benchmarks. arXiv:2106.13281.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

from agents.closed_loop import RTOL, Episodes, antithetic_noise, random_parts
from domino_env import Scene, load_scene
from domino_env.core.checks import require, require_type
from domino_env.envs.spaces import closeness
from domino_env.physics.wave import MAX_RTOL, MIN_RTOL


class APG(OnPolicyAlgorithm):
    """Analytic policy gradient, as an algorithm of Stable-Baselines3.

    Parameters
    ----------
    policy, env, learning_rate
        See `stable_baselines3.PPO`; the environment is an `agents.DominoVecEnv`, in which each
        update builds one layout per environment.
    max_grad_norm
        Largest norm of the gradient with respect to the weights; a longer one is shortened to it.
    options
        Other arguments: `policy_kwargs`, `verbose`, `seed` and `device`; see
        `stable_baselines3.PPO`.
    """

    policy: Any  # a `ScheduledPolicy`

    def __init__(
        self,
        policy: Any,
        env: Any,
        learning_rate: Any,
        max_grad_norm: float = 5.0,
        **options: Any,
    ) -> None:
        super().__init__(
            policy, env, learning_rate, **options,
            # without effect: there is neither a rollout buffer nor a critic
            n_steps=1, gamma=1.0, gae_lambda=1.0, ent_coef=0.0, vf_coef=0.0, use_sde=False,
            sde_sample_freq=-1, max_grad_norm=max_grad_norm,
        )  # fmt: skip

    def _setup_model(self) -> None:
        """Set the weights of unused observations to 0."""
        super()._setup_model()
        if self.env is None:
            return
        env: Any = self.env
        env.reset()  # to sample scenes
        scene = env.vector.scenes[0]
        # sampled scenes have the same kinds of rules
        require_supported(scene, is_sampled=env.vector.distribution is not None)
        parts = env.vector.observation_layout
        first, last = parts["placed"].start, parts.get("features", parts["near_end"]).stop
        self._mask = np.zeros(env.observation_space.shape, np.float32)
        self._mask[first:last] = 1.0
        for name in random_parts(scene):
            self._mask[parts[name]] = 1.0
        with torch.no_grad():
            self.policy.mlp_extractor.policy_net[0].weight[:, self._mask == 0.0] = 0.0

    def collect_rollouts(
        self, env: Any, callback: Any, rollout_buffer: Any, n_rollout_steps: int
    ) -> bool:
        """Build a layout with noise in each environment, and compute the loss of the policy.

        The result is False if the callback stops the training.
        """
        callback.on_rollout_start()
        if random_parts(env.vector.scenes[0]):
            episodes = Episodes(self.policy, env, torch.from_numpy(self._mask))
            self._loss, infos = episodes.loss(), episodes.infos
        else:
            self._loss, infos = self._open_loop_loss(env)
        self.num_timesteps += sum(scene.count - 1 for scene in env.vector.scenes)
        callback.update_locals({"infos": infos})
        proceed = callback.on_step()
        callback.on_rollout_end()
        return bool(proceed)

    def _open_loop_loss(self, env: Any) -> tuple[torch.Tensor, list[dict[str, Any]]]:
        """Return the loss, minus the mean gain [%], of whole layouts, and their infos."""
        scenes, observations = _initial_observations(env)
        normal = self.policy.get_distribution(observations.flatten(0, 1)).distribution
        mean = normal.mean.unflatten(0, observations.shape[:2])
        deviation = normal.stddev.unflatten(0, observations.shape[:2])
        actions = (mean + deviation * antithetic_noise(env.num_envs, *mean.shape[1:])).double()
        scores, infos = _evaluate(scenes, *_Placing.apply(env.vector, actions))  # type: ignore[no-untyped-call]
        # a derivative of a gain is relative to the score of the uniform baseline, unless that is
        # zero, or to the score itself if hits have a schedule
        units = torch.tensor([abs(scene.uniform().score) or 1.0 for scene in scenes])
        if scenes[0].tempo is not None:
            units = torch.where(scores > 0.0, 10.0 * math.log(10.0) * scores, 1.0).detach()
        return -100.0 * (scores / units).sum() / env.num_envs, infos

    def train(self) -> None:
        """Take a step along the gradient of the mean gain."""
        optimizer = self.policy.optimizer
        self._update_learning_rate(optimizer)
        optimizer.zero_grad()
        self._loss.backward()
        torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.max_grad_norm)
        optimizer.step()
        self._n_updates += 1


def torch_score(scene: str | Path | Scene, rtol: float = RTOL) -> Callable[..., torch.Tensor]:
    """Return the score of a scene as a function of tensors, with its exact gradient.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    rtol
        Relative error allowed in the arrival times.

    Returns
    -------
    callable
        `score(spacing, thickness=None, height=None)`: maps the gaps (B, N-1) [m] and, where they
        are free, the thicknesses and heights (B, N-1) [m] of all dominoes but the first, to the
        scores (B,). The scene's rules are not checked, and there are first derivatives only: it
        raises RuntimeError for `create_graph=True` and in `torch.autograd.functional.hessian`,
        TypeError for an argument that is not a tensor, and ValueError for one of another shape or
        of numbers that are not floats.

    Raises
    ------
    ValueError
        If the scene is unknown, or if `rtol` is not from 1e-13 to 1e-3.

    Examples
    --------
    >>> import torch
    >>> from agents import torch_score
    >>> score = torch_score("sprint")
    >>> spacing = torch.full((2, 39), 0.018, requires_grad=True)
    >>> score(spacing).sum().backward()
    >>> spacing.grad.shape
    torch.Size([2, 39])
    """
    require("rtol", rtol, MIN_RTOL, MAX_RTOL)
    target = scene if isinstance(scene, Scene) else load_scene(scene)
    pairs = target.count - 1

    def score(
        spacing: torch.Tensor,
        thickness: torch.Tensor | None = None,
        height: torch.Tensor | None = None,
    ) -> torch.Tensor:
        sizes = {"spacing": spacing, "thickness": thickness, "height": height}
        for name, size in sizes.items():
            expected = f"a tensor (B, {pairs}) of floats"
            kinds = torch.Tensor if name == "spacing" else torch.Tensor | None
            require_type(name, size, kinds, expected)
            shape = (*spacing.shape[:1], pairs)
            if size is not None and not (size.is_floating_point() and size.shape == shape):
                raise ValueError(f"{name} is {size.dtype} {tuple(size.shape)}: give {expected}")
        scores: torch.Tensor = _Score.apply(target, rtol, *sizes.values())[0]  # type: ignore[no-untyped-call]
        return scores

    return score


class _Score(torch.autograd.Function):
    """Scores and reaches (B,) of layouts."""

    @staticmethod
    def forward(ctx: Any, scene: Scene, rtol: float, *sizes: Any) -> tuple[Any, Any]:
        """Simulate the layouts, and compute their gradients if these are needed."""
        arrays: list[Any] = [x if x is None else x.detach().double().numpy() for x in sizes]
        batch = scene.batch(arrays[0], arrays[1], arrays[2], rtol)
        result = scene.evaluate(batch, gradient=any(ctx.needs_input_grad))
        if result.gradient is not None:
            values = [getattr(result.gradient, x) for x in ("spacing", "thickness", "height")]
            ctx.gradients = [
                None if size is None else torch.as_tensor(value, dtype=size.dtype)
                for size, value in zip(sizes, values, strict=True)
            ]
        dtype = sizes[0].dtype
        scores, reach = (torch.tensor(part, dtype=dtype) for part in (result.score, result.reach))
        ctx.mark_non_differentiable(reach)
        return scores, reach

    @staticmethod
    def backward(ctx: Any, derivatives: torch.Tensor, _: torch.Tensor) -> Any:
        """Multiply the gradients (B, N-1) by the derivatives (B,) with respect to the scores."""
        if torch.is_grad_enabled():
            raise RuntimeError("torch_score has first derivatives only: give create_graph=False")
        gradients = (None if g is None else derivatives[:, None] * g for g in ctx.gradients)
        return None, None, *gradients


class _Placing(torch.autograd.Function):
    """Gaps, thicknesses and heights (B, P) [m] of the P dominoes that actions (B, P, A) place."""

    @staticmethod
    def forward(ctx: Any, vector: Any, actions: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Place all dominoes."""
        ctx.vector, ctx.actions = vector, actions.detach().numpy()
        return tuple(map(torch.from_numpy, vector.place_all(ctx.actions)))

    @staticmethod
    def backward(ctx: Any, *derivatives: torch.Tensor) -> Any:
        """Return the gradient with respect to actions; 0 if descent would increase |action| > 1."""
        gradient = ctx.vector.place_all_vjp(ctx.actions, torch.stack(derivatives, dim=-1).numpy())
        gradient[(np.abs(ctx.actions) > 1.0) & (ctx.actions * gradient < 0.0)] = 0.0
        return None, torch.from_numpy(gradient)


def require_supported(scene: Scene, is_sampled: bool) -> None:
    """Raise ValueError for a scene, or for sampled scenes like it, in which APG cannot learn."""
    if scene.stock is not None and not scene.hand:
        raise ValueError(
            f"scene '{scene.name}' has a stock: its score has no gradient with respect to actions, "
            "which apg needs; leave it out, or use ppo"
        )
    has_free_sizes = len(scene.space.free) == 2 and not scene.in_heights
    if random_parts(scene) and (is_sampled or not has_free_sizes or scene.count < 3):
        raise ValueError(
            f"scene '{scene.name}' has placement noise or drawn pieces: for apg it must be a fixed "
            "scene of three dominoes or more with free gaps and thicknesses in metres; change it, "
            "or use ppo"
        )


def _initial_observations(env: Any) -> tuple[list[Scene], torch.Tensor]:
    """Return the scenes of B environments, and the observations of whole episodes.

    The shape of the observations is (B, P, O), or (1, P, O) with a single scene, where P is the
    largest number of dominoes that are placed.
    """
    size, parts = env.observation_space.shape[0], env.vector.observation_layout
    progress = slice(parts["placed"].start, parts["near_end"].stop)
    features, is_fixed = parts.get("features"), env.vector.distribution is None
    first = np.zeros((1, size), np.float32) if is_fixed else env.reset()
    scenes = list(env.vector.scenes)
    longest = max(scene.count for scene in scenes)
    observations = np.zeros((len(first), longest - 1, size), np.float32)
    for episode, scene, observation in zip(observations, scenes, first, strict=False):
        pairs, near = scene.count - 1, closeness(scene.count)
        position = np.arange(pairs)[:, None] / pairs
        episode[:pairs, progress] = np.concatenate([position, near[:-1], near[:0:-1]], axis=1)
        if features is not None:
            episode[:, features] = observation[features]
    return scenes, torch.from_numpy(observations)


def _evaluate(
    scenes: list[Scene], spacing: torch.Tensor, thickness: torch.Tensor, height: torch.Tensor
) -> tuple[torch.Tensor, list[dict[str, Any]]]:
    """Return the scores (B,) of layouts of B scenes, and infos with score, reach and layout."""
    scores = list[torch.Tensor]()
    infos = list[dict[str, Any]]()
    step = len(scenes) if len(set(scenes)) == 1 else 1  # equal scenes are evaluated as a batch
    for first in range(0, len(scenes), step):
        scene, batch = scenes[first], slice(first, first + step)
        gaps, thicknesses, heights = (
            part[batch, : scene.count - 1].contiguous() for part in (spacing, thickness, height)
        )
        sizes = gaps, thicknesses, None if scene.growth is None else heights
        results, reach = _Score.apply(scene, RTOL, *sizes)  # type: ignore[no-untyped-call]
        scores.append(results)
        for b, score in enumerate(results.tolist()):
            layout = scene.layout(*(size[b].detach().numpy() for size in sizes if size is not None))
            infos.append({"score": score, "reach": float(reach[b]), "layout": layout})
    return torch.cat(scores), infos
