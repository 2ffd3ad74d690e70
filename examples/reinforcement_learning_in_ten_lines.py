"""PPO of Stable-Baselines3 on one scene, with a small first deviation, and its curve.

    python examples/reinforcement_learning_in_ten_lines.py

It takes a minute and a half of processor time, and writes docs/ten-lines.png and the model,
ppo-sprint.zip; `python docs/films.py ppo-sprint.zip` writes an episode of it, docs/ten-lines.gif.
`examples/ppo_of_stable_baselines3.py` learns in less time, on sampled scenes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.evaluation import evaluate_policy

import domino_env as de
from domino_env.core.colours import BEST_KNOWN, RESULT, SOFT
from domino_env.core.plot_style import new_axes, own_style, write_png
from optimize.experiments.best_known import best_known

DOCS = Path(__file__).resolve().parents[1] / "docs"
ENVIRONMENT, SCENE, NUM_ENVS, ROLLOUT = "domino_env:DominoChain-v2", "sprint", 16, 128


class Curve(BaseCallback):
    """Return of the policy without noise, before each rollout."""

    def __init__(self):
        super().__init__()
        self.test = make_vec_env(ENVIRONMENT, n_envs=1, env_kwargs={"scene": SCENE})
        self.points = []

    def _on_rollout_start(self):
        value, _ = evaluate_policy(self.model, self.test, n_eval_episodes=1)
        self.points.append((self.num_timesteps, value))

    def _on_training_end(self):
        self._on_rollout_start()

    def _on_step(self):
        return True


def train(steps=100_000, seed=0):
    """Return the model, and the steps and returns of its curve."""
    torch.set_num_threads(1)  # more threads slow such small networks down
    envs, curve = make_vec_env(ENVIRONMENT, NUM_ENVS, env_kwargs={"scene": SCENE}), Curve()
    model = PPO(
        "MlpPolicy", envs, n_steps=ROLLOUT, seed=seed, device="cpu",
        policy_kwargs={"log_std_init": -1.2},  # first deviation 0.3 instead of 1
    )  # fmt: skip
    model.learn(steps, callback=curve)
    return model, *np.transpose(curve.points)


@own_style()
def draw_curve(steps, returns):
    """Draw the return of the policy over the steps of the training."""
    scene = de.load_scene(SCENE)
    best = 100.0 * (best_known()[SCENE].score / scene.uniform().score - 1.0)
    figure, axes = new_axes(
        7.5, 3.2, f"PPO with a first deviation of 0.3 on {SCENE}, one seed",
        xlabel="steps: dominoes placed in training", ylabel="return: gain over equal gaps [%]",
        ylim=(max(min(returns), -20.0) - 1.0, best + 1.0),
    )  # fmt: skip
    axes.plot(steps, returns, ".-", color=RESULT)
    for height, words, colour in ((0.0, "best equal gaps", SOFT), (best, "best known", BEST_KNOWN)):
        axes.axhline(height, color=colour, linewidth=0.9, linestyle="--")
        axes.annotate(
            words, (0.99, height), (0.0, 4.0), size=9, color=colour, va="bottom", ha="right",
            xycoords=("axes fraction", "data"), textcoords="offset points",
        )  # fmt: skip
    return figure


if __name__ == "__main__":
    model, steps, returns = train()
    model.save("ppo-sprint")
    print(
        *(f"{step:.0f}: {one:+.2f} %" for step, one in zip(steps, returns, strict=True)), sep="\n"
    )
    write_png(draw_curve(steps, returns), DOCS / "ten-lines.png")
