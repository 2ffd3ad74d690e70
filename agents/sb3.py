"""Algorithms of Stable-Baselines3 and sb3-contrib, with schedules for the exploration.

References
----------
Mania, H., Guy, A., Recht, B. (2018). Simple random search provides a competitive approach to
reinforcement learning. arXiv:1803.07055.
"""

from __future__ import annotations

import io
import math
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from sb3_contrib import ARS, TQC
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.distributions import DiagGaussianDistribution, Distribution
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.noise import NormalActionNoise
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import VecEnv

from agents.algorithms import OFF_POLICY, Hyperparameters
from agents.apg import APG
from agents.network import Policy, build_actor, read_arrays
from agents.policy import POLICY, SCENE, read_config
from agents.rollout import SEEDS_PER_TRAINING, evaluation_seeds
from agents.vec_env import DominoVecEnv
from domino_env import Scene, SceneDistribution
from domino_env.core.files import errors_with_path, write_bytes
from domino_env.envs.spaces import DECAY_LENGTHS

# arrays of a replay buffer
TRANSITIONS = "observations", "next_observations", "actions", "rewards", "dones", "timeouts"
NEAR_END_ENTRY = DECAY_LENGTHS.index(4.0)  # index of exp(-(dominoes to place) / 4) in "near_end"


class Learner:
    """Algorithm of Stable-Baselines3 or sb3-contrib, with its environments.

    It limits torch to one thread, as more threads are slower for such small networks.

    Parameters
    ----------
    target
        The scene or scene distribution.
    algorithm
        One of `CLASSES`.
    hyperparameters
        Hyperparameters of the algorithm.
    seed
        Seed of all randomness.
    num_scenes
        See `agents.train`.

    Attributes
    ----------
    env
        `DominoVecEnv` of the training.
    model
        Instance of the class in `CLASSES`.
    """

    def __init__(
        self,
        target: Scene | SceneDistribution,
        algorithm: str,
        hyperparameters: Hyperparameters,
        seed: int,
        num_scenes: int | None = None,
    ) -> None:
        self.hyperparameters = hyperparameters
        num_envs, scale = hyperparameters.num_envs, hyperparameters.reward_scale
        self.env = DominoVecEnv(target, num_envs, scale, num_scenes=num_scenes)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # about minibatches of unequal size
            self.model: Any = make_model(algorithm, hyperparameters, self.env, seed)
        self.model.set_logger(Logger(folder=None, output_formats=[]))
        if isinstance(target, Scene) and len(evaluation_seeds(target)) > 1:
            self.env.seed(SEEDS_PER_TRAINING * (1 + seed))

    @property
    def steps(self) -> int:
        """Number of dominoes placed so far."""
        return int(self.model.num_timesteps)

    @property
    def updates(self) -> int:
        """Number of updates of the policy so far."""
        count = int(getattr(self.model, "_n_updates", 0))
        if isinstance(self.model, PPO):  # it counts passes over a rollout, each of many minibatches
            count *= -(-self.model.n_steps * self.env.num_envs // self.model.batch_size)
        return count

    def learn(
        self, steps: int, between_updates: Callable[[], None], after_step: Callable[[Any], None]
    ) -> None:
        """Place dominoes, and update the policy.

        Parameters
        ----------
        steps
            Number of dominoes to place in addition to those so far.
        between_updates
            Function that is called before each rollout.
        after_step
            Function that is called after each step with the infos of all environments.
        """

        class Callback(BaseCallback):
            def _on_rollout_start(self) -> None:
                between_updates()

            def _on_step(self) -> bool:
                after_step(self.locals.get("infos", ()))
                return True

        self.model.learn(steps, callback=Callback(), reset_num_timesteps=False)

    def update_deviation(self, progress: float) -> None:
        """Set the standard deviation of the actions by its schedule.

        Parameters
        ----------
        progress
            Completed fraction of the training, 0 to 1.
        """
        if isinstance(self.model.policy, ScheduledPolicy):
            self.model.policy.deviation = self.hyperparameters.deviation(progress)

    def policy(self) -> Policy:
        """Return the current policy, without noise."""
        return build_actor(weights(self.model.policy)).act

    def save(self, path: Path) -> None:
        """Write the weights of the policy as an .npz file."""
        arrays = weights(self.model.policy)
        write_bytes(path, lambda file: np.savez_compressed(file, **arrays))

    def write_checkpoint(self, path: Path, curve: Sequence[tuple[float, ...]]) -> None:
        """Write the weights, optimiser, counters, transitions and learning curve to a file."""
        state = {
            "parameters": self.model.get_parameters(),
            "steps": self.model.num_timesteps,
            "updates": getattr(self.model, "_n_updates", 0),
            "curve": [[float(value) for value in line] for line in curve],
            "variables": {name: getattr(self.model, name).detach() for name in self._variables},
        }
        if isinstance(self.model, OffPolicyAlgorithm):
            buffer: Any = self.model.replay_buffer
            stored = {name: getattr(buffer, name)[: buffer.size()] for name in TRANSITIONS}
            state["transitions"] = {name: torch.from_numpy(x) for name, x in stored.items()}
            state["next_transition"] = int(buffer.pos)
        content = io.BytesIO()  # torch hides the error of a full disk
        torch.save(state, content)
        write_bytes(path, lambda file: file.write(content.getbuffer()))

    @property
    def _variables(self) -> list[str]:
        """Names of trained tensors outside the networks, such as the entropy coefficient."""
        return list(self.model._get_torch_save_params()[1])

    def restore(self, state: dict[str, Any]) -> None:
        """Restore the weights, optimiser, counters and transitions of a checkpoint."""
        self.model.set_parameters(state["parameters"], exact_match=True, device="cpu")
        self.model.num_timesteps = int(state["steps"])
        self.model._n_updates = int(state["updates"])
        for name in self._variables:
            getattr(self.model, name).data.copy_(state["variables"][name])
        if isinstance(self.model, OffPolicyAlgorithm):
            buffer: Any = self.model.replay_buffer
            for name in TRANSITIONS:
                values = state["transitions"][name].numpy()
                getattr(buffer, name)[: len(values)] = values
            buffer.pos, buffer.full = state["next_transition"], len(values) == buffer.buffer_size
        if hasattr(self.model, "weights"):  # ARS computes its candidates from a copy of the weights
            parameters = self.model.policy.parameters()
            self.model.weights = torch.nn.utils.parameters_to_vector(parameters).detach()


def read_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint of numbers and tensors without running pickled code.

    Raises
    ------
    ValueError
        If the file is damaged or not a checkpoint.
    """
    with errors_with_path(path):
        try:
            state: dict[str, Any] = torch.load(path, weights_only=True, map_location="cpu")
        except Exception:  # of any kind; its message recommends running pickled code
            raise ValueError(
                "not a checkpoint, or damaged: resume from a copy, or train in another folder"
            ) from None
    return state


def make_model(
    algorithm: str, hyperparameters: Hyperparameters, env: VecEnv, seed: int
) -> BaseAlgorithm:
    """Return a new algorithm of Stable-Baselines3 or sb3-contrib.

    Parameters
    ----------
    algorithm, hyperparameters, seed
        See `Learner`.
    env
        Environments of the training.
    """
    torch.set_num_threads(1)
    options = dict(hyperparameters.options)
    first, last = hyperparameters.learning_rate, hyperparameters.last_rate

    def rate(remaining: float) -> float:
        # `remaining` is negative if the last rollout exceeds the number of steps
        return first * (last + (1.0 - last) * max(remaining, 0.0))

    policy_class, policy_options = _network(algorithm, hyperparameters)
    if "action_noise" in options:
        size = env.action_space.shape or ()
        deviations = np.full(size, options["action_noise"])
        options["action_noise"] = NormalActionNoise(np.zeros(size), deviations)
    if algorithm == "ars":
        deviation = options.get("delta_std", 0.05)  # the default of ARS
        options["delta_std"] = lambda remaining: deviation * rate(remaining) / first
    if algorithm in ("apg", "ppo"):
        policy_class = ScheduledPolicy
    if algorithm == "apg":
        # smaller than the default of Stable-Baselines3: gradients become small late in a training
        policy_options["optimizer_kwargs"] = {"eps": 1e-8}
    model = CLASSES[algorithm](
        policy_class, env, learning_rate=rate, policy_kwargs=policy_options, seed=seed,
        device="cpu", verbose=0, **options,
    )  # fmt: skip
    policy: Any = model.policy
    if isinstance(policy, ScheduledPolicy):
        policy.end_factor, policy.penalty = hyperparameters.end_factor, hyperparameters.penalty
        policy.near_end = env.get_attr("observation_layout")[0]["near_end"].start + NEAR_END_ENTRY
    return model


def _network(algorithm: str, hyperparameters: Hyperparameters) -> tuple[Any, dict[str, Any]]:
    """Return the name of a policy class of Stable-Baselines3, and its arguments."""
    if algorithm == "ars":
        return "LinearPolicy", {}
    options: dict[str, Any] = {"net_arch": [hyperparameters.width] * hyperparameters.depth}
    if algorithm not in OFF_POLICY:
        options["activation_fn"] = torch.nn.Tanh
    return "MlpPolicy", options


def save_zip(folder: Path, path: str | Path) -> None:
    """Write the best policy of a training as an archive of Stable-Baselines3 or sb3-contrib.

    The archive can be loaded without this package; that of "apg" is one of PPO.

    Parameters
    ----------
    folder
        Folder of the training.
    path
        The .zip file.

    Raises
    ------
    ValueError
        If the folder holds no training.
    OSError
        If the archive cannot be written.
    """
    config, env = read_config(folder), DominoVecEnv(folder / SCENE)
    policy_class, options = _network(config.algorithm, config.hyperparameters)
    classes: Any = CLASSES | {"apg": PPO, "ars": ARS}
    model = classes[config.algorithm](policy_class, env, policy_kwargs=options, device="cpu")
    state = {name: torch.from_numpy(x) for name, x in read_arrays(folder / POLICY).items()}
    if "log_std" in state:
        deviation = math.log(config.hyperparameters.last_deviation)
        state["log_std"] = torch.full_like(state["log_std"], deviation)
    model.policy.load_state_dict(state)
    write_bytes(Path(path), model.save)


def weights(policy: torch.nn.Module) -> dict[str, Any]:
    """Return the weights of a policy as NumPy arrays by name."""
    return {name: value.detach().numpy() for name, value in policy.state_dict().items()}


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


CLASSES: dict[str, type[BaseAlgorithm]] = {
    "apg": APG,
    "ppo": PPO,
    "ars": VectorARS,
    "sac": SAC,
    "td3": TD3,
    "tqc": TQC,
}
