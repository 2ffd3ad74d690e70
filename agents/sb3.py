"""Trainings with algorithms of Stable-Baselines3 and sb3-contrib, and schedules of exploration.

References
----------
Mania, H., Guy, A., Recht, B. (2018). Simple random search provides a competitive approach to
reinforcement learning. arXiv:1803.07055.
"""

from __future__ import annotations

import io
import json
import math
import time
import warnings
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
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

from agents import policy as files
from agents.algorithms import OFF_POLICY, Hyperparameters
from agents.apg import APG
from agents.evaluation import choose_scenes, evaluate_gains
from agents.network import build_actor, read_arrays
from agents.rollout import SEEDS_PER_TRAINING, SELECTION_SEEDS, Rollout, build, is_random
from agents.vec_env import DominoVecEnv
from domino_env import Scene, SceneDistribution
from domino_env.core.files import errors_with_path, write_bytes, write_text
from domino_env.core.models import plain
from domino_env.core.progress import leave_out, notice, progress_bar
from domino_env.core.results import revision, versions
from domino_env.core.tables import write_csv
from domino_env.core.types import Floats
from domino_env.envs.spaces import DECAY_LENGTHS
from domino_env.scenes.pool import ScenePool

COLUMNS = (
    "steps", "seconds", "score", "best_score", "processor_seconds", "test_score", "simulations",
)  # fmt: skip
EVALUATIONS = 200  # number of evaluations in a training, each with a checkpoint
POOL_SCENES = 50  # number of training scenes in which evaluations score a policy
# arrays of a replay buffer
TRANSITIONS = "observations", "next_observations", "actions", "rewards", "dones", "timeouts"
NEAR_END_ENTRY = DECAY_LENGTHS.index(4.0)  # index of exp(-(dominoes to place) / 4) in "near_end"


def model_state(model: Any) -> dict[str, Any]:
    """Return weights, optimiser, counters and transitions of an algorithm, for `restore`."""
    state: dict[str, Any] = {
        "parameters": model.get_parameters(),
        "steps": model.num_timesteps,
        "updates": getattr(model, "_n_updates", 0),
        "variables": {name: getattr(model, name).detach() for name in _variables(model)},
    }
    if isinstance(model, OffPolicyAlgorithm):
        buffer: Any = model.replay_buffer
        stored = {name: getattr(buffer, name)[: buffer.size()] for name in TRANSITIONS}
        state["transitions"] = {name: torch.from_numpy(x) for name, x in stored.items()}
        state["next_transition"] = int(buffer.pos)
    return state


def restore(model: Any, state: dict[str, Any]) -> None:
    """Restore the state of an algorithm from `model_state`."""
    model.set_parameters(state["parameters"], exact_match=True, device="cpu")
    model.num_timesteps = int(state["steps"])
    model._n_updates = int(state["updates"])
    for name in _variables(model):
        getattr(model, name).data.copy_(state["variables"][name])
    if isinstance(model, OffPolicyAlgorithm):
        buffer: Any = model.replay_buffer
        for name in TRANSITIONS:
            values = state["transitions"][name].numpy()
            getattr(buffer, name)[: len(values)] = values
        buffer.pos, buffer.full = state["next_transition"], len(values) == buffer.buffer_size
    if hasattr(model, "weights"):  # ARS computes its candidates from a copy of the weights
        model.weights = torch.nn.utils.parameters_to_vector(model.policy.parameters()).detach()


def _variables(model: Any) -> list[str]:
    """Return the names of trained tensors outside the networks, as the entropy coefficient."""
    return list(model._get_torch_save_params()[1])


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
    target: Scene | SceneDistribution,
    algorithm: str,
    hyperparameters: Hyperparameters,
    seed: int,
    num_scenes: int | None = None,
    env: VecEnv | None = None,
) -> Any:
    """Return a new algorithm of Stable-Baselines3 or sb3-contrib, with its environments.

    It limits torch to one thread, as more threads are slower for such small networks.

    Parameters
    ----------
    target, algorithm, hyperparameters, seed, num_scenes
        See `agents.train`.
    env
        Environments of the training; None for a `DominoVecEnv`.
    """
    torch.set_num_threads(1)
    if env is None:
        env = DominoVecEnv(target, hyperparameters.num_envs, num_scenes=num_scenes)
    options = dict(hyperparameters.options)
    first, last = hyperparameters.learning_rate, hyperparameters.last_rate

    def rate(remaining: float) -> float:
        # `remaining` is negative if the last rollout exceeds the number of steps
        return first * (last + (1.0 - last) * max(remaining, 0.0))

    policy_class, policy_options = _network(algorithm, hyperparameters)
    options.pop("policy_kwargs", None)
    if "action_noise" in options:
        size = env.action_space.shape or ()
        deviations = np.full(size, options["action_noise"])
        options["action_noise"] = NormalActionNoise(np.zeros(size), deviations)
    if algorithm == "ars":
        deviation = options.get("delta_std", 0.05)  # the default of ARS
        options["delta_std"] = lambda remaining: deviation * rate(remaining) / first
    if algorithm in ("apg", "ppo"):
        policy_class = ScheduledPolicy
        if options.get("use_sde"):
            raise ValueError(
                f"use_sde = True: the noise of {algorithm} follows a schedule; leave it out, or "
                "choose sac or tqc"
            )
    if algorithm == "apg":
        # smaller than the default of Stable-Baselines3: gradients become small late in a training
        policy_options["optimizer_kwargs"] = {"eps": 1e-8}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # about minibatches of unequal size
        model: Any = CLASSES[algorithm](
            policy_class, env, learning_rate=rate, policy_kwargs=policy_options, seed=seed,
            device="cpu", verbose=0, **options,
        )  # fmt: skip
    model.set_logger(Logger(folder=None, output_formats=[]))
    if is_random(target):
        env.seed(SEEDS_PER_TRAINING * (1 + seed))
    policy = model.policy
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
    return "MlpPolicy", options | hyperparameters.options.get("policy_kwargs", {})


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
    config, env = files.read_config(folder), DominoVecEnv(folder / files.SCENE)
    policy_class, options = _network(config.algorithm, config.hyperparameters)
    classes: Any = CLASSES | {"apg": PPO, "ars": ARS}
    model = classes[config.algorithm](policy_class, env, policy_kwargs=options, device="cpu")
    state = {name: torch.from_numpy(x) for name, x in read_arrays(folder / files.POLICY).items()}
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


def clocks() -> Floats:
    """Return the wall-clock time and the processor time (2,) [s]."""
    return np.array([time.perf_counter(), time.process_time()])


@dataclass(eq=False)
class Training(BaseCallback):
    """Training in progress; a step places one domino.

    Parameters
    ----------
    target
        Scene or scene distribution.
    config
        Arguments of the training.
    folder, progress
        See `train`.
    """

    target: Scene | SceneDistribution
    config: files.ConfigDocument
    folder: Path
    progress: bool | None

    def __post_init__(self) -> None:
        super().__init__()
        # scenes of evaluations and of the test set; none if the target is a single scene
        self.scenes: list[Scene] = []
        self.tests: list[Scene] = []
        self.simulations = 0
        if isinstance(self.target, SceneDistribution):
            pool = ScenePool(self.target, self.config.num_scenes)
            numbers = range(len(pool))[: -POOL_SCENES - 1 : -1]  # the last ones, in reverse order
            self.scenes = [pool.scene(number) for number in numbers]
            with suppress(ValueError):  # raised if the distribution has no test set
                self.tests = choose_scenes(self.target)
        self.curve: list[tuple[float, ...]] = []
        self.best = self.test_score = -np.inf
        self.next_evaluation = 0  # steps
        self.start = clocks()  # earlier if a training is resumed
        self.total = self.config.steps
        self.bar = progress_bar(self.progress, total=self.total, unit=" dominoes", unit_scale=True)

    def run(self, resume: bool) -> bool:
        """Train from the beginning, or from the checkpoint in the folder.

        Return True if the training was interrupted. Ctrl-C does not write a checkpoint, as an
        unfinished update cannot be resumed.

        Raises
        ------
        ValueError
            If the weights are not finite any more.
        """
        if resume and (self.folder / files.CHECKPOINT).exists():
            self._resume()
        else:
            if resume:
                notice(f"{self.folder} has no {files.CHECKPOINT}: the training begins again")
            self._make_model(self.config.seed)
            write_text(self.folder / files.SCENE, self.target.to_toml())
            self.write_json(files.CONFIG, **plain(self.config), versions=versions())
        interrupted = False
        try:
            remaining = self.total - self.model.num_timesteps
            self.model.learn(remaining, callback=self, reset_num_timesteps=False)
        except KeyboardInterrupt:
            interrupted = True
        except (ValueError, RuntimeError):  # of torch or of an environment, for nan
            self._require_finite()
            raise
        is_evaluated = bool(self.curve) and self.curve[-1][0] == self.model.num_timesteps
        if not self.curve or not (interrupted or is_evaluated):
            self.evaluate()
        if interrupted:
            self._write_curve()
        else:
            self.write_checkpoint()
        self.bar.close()
        self.elapsed = clocks() - self.start
        return interrupted

    def _require_finite(self) -> None:
        """Write the learning curve and raise ValueError if weights are not finite."""
        if not all(np.isfinite(array).all() for array in weights(self.model.policy).values()):
            self.bar.close()
            self._write_curve()
            raise ValueError(
                f"{self.config.algorithm}, seed {self.config.seed}: the weights are not finite "
                f"after {self.model.num_timesteps} steps: train with a smaller learning_rate or "
                f"another seed; {self.folder} has the best policy until then"
            )

    def _make_model(self, seed: int) -> None:
        config = self.config
        self.model = make_model(
            self.target, config.algorithm, config.hyperparameters, seed, config.num_scenes
        )

    def write_json(self, name: str, **document: Any) -> None:
        """Write a JSON file into the folder."""
        write_text(self.folder / name, json.dumps(document, indent=1) + "\n")

    def _resume(self) -> None:
        """Continue in the state of the checkpoint, with other random numbers."""
        path = self.folder / files.CHECKPOINT
        state = read_checkpoint(path)
        try:
            # a seed of its own, so that the random numbers before the checkpoint are not repeated
            self._make_model((self.config.seed + int(state["steps"])) % 2**32)
            restore(self.model, state)
            self.curve = [tuple(map(float, line)) for line in state["curve"]]
            last = dict(zip(COLUMNS, self.curve[-1], strict=True))
            self.best, self.test_score = last["best_score"], last["test_score"]
            self.simulations = int(last["simulations"])
            self.start = clocks() - np.array([last["seconds"], last["processor_seconds"]])
        except (IndexError, KeyError, TypeError, ValueError, RuntimeError) as error:
            raise ValueError(f"{path}: not a checkpoint of this training: {error}") from None
        self.next_evaluation = self.model.num_timesteps + max(self.total // EVALUATIONS, 1)
        self.bar.update(self.model.num_timesteps)

    def _on_rollout_start(self) -> None:
        """Evaluate and write a checkpoint if due, and update the standard deviation."""
        steps, policy = self.model.num_timesteps, self.model.policy
        if steps >= self.next_evaluation:
            self.evaluate()
            self.write_checkpoint()
            self.next_evaluation = steps + max(self.total // EVALUATIONS, 1)
        if not self.bar.n:
            leave_out(self.bar, steps)
        self.bar.update(steps - self.bar.n)
        if isinstance(policy, ScheduledPolicy):
            progress = min(steps / self.total, 1.0)
            policy.deviation = self.config.hyperparameters.deviation(progress)

    def _on_step(self) -> bool:
        """Count the layouts that were built with exploration noise."""
        self.simulations += sum("score" in info for info in self.locals.get("infos", ()))
        return True

    def evaluate(self) -> None:
        """Evaluate the policy without noise, and write it if it is the best so far."""
        (seconds, processor_seconds), rollout = clocks() - self.start, None
        steps, arrays = self.model.num_timesteps, weights(self.model.policy)
        act = build_actor(arrays).act
        if isinstance(self.target, Scene):
            seeds = SELECTION_SEEDS if is_random(self.target) else None
            rollout = build(act, self.target, seeds=seeds)
            score = rollout.score
        else:
            score = float(np.median(evaluate_gains(act, self.target, self.scenes)))
        self.simulations += len(self.scenes) or 1
        if score > self.best:
            path, test_score = self.folder / files.POLICY, score
            write_bytes(path, lambda file: np.savez_compressed(file, **arrays))
            if isinstance(self.target, SceneDistribution) and self.tests:
                pause = clocks()
                test_score = float(np.median(evaluate_gains(act, self.target, self.tests)))
                self.start += clocks() - pause  # the test set is not part of the training
            if rollout is not None:
                result = {"score": score, "gain": rollout.gain, "steps": steps, "seconds": seconds}
                self.write_json(files.BEST, **result)
                rollout.layout.to_csv(self.folder / "layout.csv")
                rollout.layout.to_json(self.folder / "layout.json")
            self.best, self.test_score = score, test_score  # all files are written
        latest = self.best, processor_seconds, self.test_score
        line = steps, seconds, score, *latest, self.simulations  # as in `COLUMNS`
        self.curve.append(tuple(map(float, line)))
        best = f"median gain {self.best:+z.2%}"
        if isinstance(self.target, Scene):
            best = self.target.criterion.label(self.best, 4)
        self.bar.set_postfix_str(f"best {best}", refresh=False)

    def write_checkpoint(self) -> None:
        """Write the checkpoint, which includes the learning curve, and progress.csv."""
        content = io.BytesIO()  # torch hides the error of a full disk
        torch.save(model_state(self.model) | {"curve": self.curve}, content)
        write_bytes(self.folder / files.CHECKPOINT, lambda file: file.write(content.getbuffer()))
        self._write_curve()

    def _write_curve(self) -> None:
        """Write the learning curve as progress.csv."""
        lines = ([f"{x:.10g}" for x in line] for line in self.curve)
        write_csv(self.folder / files.PROGRESS, COLUMNS, lines)

    def write_summary(self, interrupted: bool, rollout: Rollout | None) -> tuple[int, float]:
        """Write the summary; return the numbers of steps and of seconds.

        Parameters
        ----------
        interrupted
            True if the training was interrupted.
        rollout
            Layout of the best policy; None if scenes are sampled.
        """
        seconds, processor_seconds = self.elapsed
        result: dict[str, Any]
        result = {"median_gain": self.best, "test_median_gain": self.test_score}
        if rollout is not None:
            result = {
                "score": rollout.score,
                "uniform_score": rollout.uniform.score,
                "gain": rollout.gain,
                "last_score": self.curve[-1][2],  # of the last evaluation
            }
        evaluations = len(self.curve) * (len(self.scenes) or 1)
        noisy_layouts = self.simulations - evaluations  # APG computes the gradient of each
        updates, model = int(getattr(self.model, "_n_updates", 0)), self.model
        if isinstance(model, PPO):  # it counts passes over a rollout, each of many minibatches
            updates *= -(-model.n_steps * model.n_envs // model.batch_size)
        self.write_json(
            files.SUMMARY, finished=not interrupted, scene=self.target.name,
            algorithm=self.config.algorithm, seed=self.config.seed, revision=revision(), **result,
            steps=model.num_timesteps, seconds=seconds, processor_seconds=processor_seconds,
            simulations=self.simulations,
            gradients=noisy_layouts * (self.config.algorithm == "apg"), updates=updates,
        )  # fmt: skip
        return model.num_timesteps, seconds
