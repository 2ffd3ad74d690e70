"""Compare actions and rewards: python docs/learning_matrix.py, which writes learning-matrix.csv.

Algorithms of Stable-Baselines3 learn with linear actions and the rewards of v1, with logarithmic
actions and the rewards of v1, and with the actions and rewards of `DominoChain-v2`. Runs that are
in the file are not made again, so the command continues after an interruption; --check trains a few
steps in every case.
"""

from __future__ import annotations

import argparse
import csv
import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium.spaces import Box
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from agents.algorithms import default_hyperparameters
from agents.rollout import SEEDS_PER_TRAINING, SELECTION_SEEDS, evaluation_seeds
from agents.sb3.factory import make_model
from agents.sb3.training import POOL_SCENES
from agents.vec_env import DominoVecEnv
from domino_env import Scene, SceneDistribution, load_test_set
from domino_env.core.tables import csv_table
from domino_env.core.types import Floats
from domino_env.kernels.step.environment import encode_batch
from domino_env.scenes.distribution import load_any
from domino_env.scenes.pool import ScenePool

PATH = Path(__file__).with_name("learning-matrix.csv")
COLUMNS = "scene", "algorithm", "actions", "rewards", "seed", "steps", "score", "processor_seconds"
SCENES = "sprint", "course", "varied", "draw", "tempo-noise"
NO_STOPS = "sprint", "course"  # hardly a wave stops: rewards of v1 and v2 are about the same
STEPS = {"ppo": 400_000, "sac": 20_000, "td3": 20_000}
LOGARITHMIC, LINEAR = "logarithmic", "linear"
SEEDS = range(200, 203)
EVALUATIONS = 20  # in a training; the best policy on other seeds or scenes is kept
Case = tuple[str, str, str, str, int, int]  # the first six columns


class VariantEnv(DominoVecEnv):
    """`DominoVecEnv` with linear actions, or with the rewards of v1.

    A linear action has one entry for the gap and one for the thickness, if they are free, from the
    smallest to the largest value; of a stock, the nearest piece in hand is taken.
    """

    def __init__(
        self, scene: Scene | SceneDistribution, num_envs: int, actions: str, rewards: str
    ) -> None:
        super().__init__(scene, num_envs)
        self.linear, self.has_v1_rewards = actions == LINEAR, rewards == "v1"
        self.scale = 1.0  # factor of the rewards
        if self.linear:
            size = 1 + self.vector.scenes[0].free_thickness
            self.action_space = Box(-1.0, 1.0, (size,), np.float32)

    def step_async(self, actions: Any) -> None:
        """Keep the actions (B, A) for `step_wait`."""
        if self.linear:
            batch = self.vector._batch
            rules, parts = batch.rules[batch.scene], 0.5 + 0.5 * np.clip(actions, -1.0, 1.0)
            targets = np.ones((self.num_envs, 4))  # equal heights
            for k, name in enumerate(("gap", "thickness")[: parts.shape[1]]):
                low, high = rules[f"{name}_low"], rules[f"{name}_high"]
                targets[:, k] = low + parts[:, k] * (high - low)
            actions = np.zeros(self.vector.action_space.shape or ())
            encode_batch(0, self.num_envs, batch, targets, actions)
        super().step_async(actions)

    def step_wait(self) -> Any:
        """Place a domino in every environment."""
        before = self._returns.copy()
        observations, rewards, dones, infos = super().step_wait()
        if self.has_v1_rewards:
            after = self.v1_return(before + rewards)
            for b in np.flatnonzero(dones):
                if (score := infos[b]["score"]) <= 0.0:
                    after[b] = 100.0 * (score - 1.0)
            rewards = (after - self.v1_return(before)).astype(np.float32)
        return observations, np.float32(self.scale) * rewards, dones, infos

    def v1_return(self, expected: Floats) -> Floats:
        """Return 100 (S / S_u - 1), the return of v1, from the expected gain of v2 [%] or [dB]."""
        if self.vector.scenes[0].tempo is None:
            return expected
        return 100.0 * (10.0 ** (expected / 10.0) - 1.0)


def scores(act: Any, env: VariantEnv, key: str, **reset: Any) -> Floats:
    """Return "score" or "gain" of one episode in each environment (B,)."""
    if "seed" in reset:
        env.seed(reset["seed"])
    env.set_options(reset.get("options"))
    observations: Any = env.reset()
    found = np.full(env.num_envs, np.nan)
    while np.isnan(found).any():
        observations, _, dones, infos = env.step(act(observations))
        for b in np.flatnonzero(dones & np.isnan(found)):
            value = infos[b][key]
            found[b] = -1.0 if value is None else value
    return found


def train(case: Case) -> list[object]:
    """Train and evaluate one case; return its line."""
    scene, algorithm, actions, rewards, seed, steps = case
    torch.set_num_threads(1)
    target, start = load_any(scene), time.process_time()
    chosen = default_hyperparameters(algorithm, target)
    env = VariantEnv(target, 64 if algorithm == "ppo" else chosen.num_envs, actions, rewards)
    if (algorithm, rewards) == ("td3", "v1"):
        env.scale = 0.1  # without it, critics do not come to returns of -200 in so few steps
    env.seed(SEEDS_PER_TRAINING * (1 + seed))
    if algorithm == "ppo":
        length = chosen.options["n_steps"]
        model: Any = PPO(
            "MlpPolicy", env, learning_rate=1e-3, n_steps=length, batch_size=8 * length,
            gamma=chosen.options["gamma"], seed=seed, device="cpu",
        )  # fmt: skip
    else:
        defaults: dict[str, Any] = {"tau": 0.005}  # of Stable-Baselines3
        if algorithm == "td3":  # the noise on target actions of its authors
            defaults |= {"target_policy_noise": 0.2, "target_noise_clip": 0.5}
        chosen = chosen.replace(options=chosen.options | defaults)
        model = make_model(target, algorithm, chosen, seed, env=env)

    if isinstance(target, SceneDistribution):
        tests, pool, key = load_test_set(scene), ScenePool(target, POOL_SCENES), "gain"
        selection = VariantEnv(target, POOL_SCENES, actions, rewards)
        choice: dict[str, Any] = {"options": {"scene": [pool.scene(i) for i in range(len(pool))]}}
        test = VariantEnv(target, len(tests), actions, rewards)
        final: dict[str, Any] = {"options": {"scene": tests}}
    else:
        seeds = evaluation_seeds(target)
        chosen_seeds = seeds if len(seeds) == 1 else SELECTION_SEEDS
        key, selection = "score", VariantEnv(target, len(chosen_seeds), actions, rewards)
        test = VariantEnv(target, len(seeds), actions, rewards)
        choice, final = {"seed": chosen_seeds[0]}, {"seed": seeds[0]}
    result = [-np.inf, -np.inf]  # best score in the selection, and its score in the test

    def act(observations: Any) -> Any:
        return model.predict(observations, deterministic=True)[0]

    def evaluate() -> None:
        average = np.median if key == "gain" else np.mean
        value = float(average(scores(act, selection, key, **choice)))
        if value > result[0]:
            result[:] = value, float(average(scores(act, test, key, **final)))

    class Evaluate(BaseCallback):
        done = 0

        def _on_step(self) -> bool:
            return True

        def _on_rollout_start(self) -> None:
            if self.num_timesteps * EVALUATIONS >= self.done * steps:
                self.done += 1
                evaluate()

    model.learn(steps, callback=Evaluate())
    evaluate()
    return [*case, f"{result[1]:.6f}", f"{time.process_time() - start:.0f}"]


def main() -> None:
    """Train all cases that are not in the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="train a few steps and write nothing")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="number of processes")
    options = parser.parse_args()
    cases: list[Case] = [
        (scene, algorithm, actions, rewards, seed, 4000 if options.check else STEPS[algorithm])
        for seed, scene, algorithm in product(SEEDS, SCENES, STEPS)
        for actions, rewards in ((LINEAR, "v1"), (LOGARITHMIC, "v1"), (LOGARITHMIC, "v2"))
        if not (options.check and seed > SEEDS[0]) and not (rewards == "v2" and scene in NO_STOPS)
    ]
    lines: list[list[object]] = []
    if PATH.exists() and not options.check:
        with PATH.open(newline="", encoding="utf-8") as file:
            lines = [list(line) for line in list(csv.reader(file))[1:]]
    made = {tuple(map(str, line[:6])) for line in lines}
    with ProcessPoolExecutor(options.jobs) as executor:
        missing = [case for case in cases if tuple(map(str, case)) not in made]
        for future in as_completed([executor.submit(train, case) for case in missing]):
            line = future.result()
            print(*line, flush=True)
            lines.append(line)
            if not options.check:
                PATH.write_text(csv_table(COLUMNS, lines), "utf-8")


if __name__ == "__main__":
    main()
