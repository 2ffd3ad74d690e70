"""An algorithm from outside in the benchmark: A2C of Stable-Baselines3.

    domino benchmark sprint varied --algorithms examples.outside_algorithm:fit,ppo --steps 100000

`make_env` makes a single Gymnasium environment, of one scene or of sampled scenes; what is returned
needs a method `predict(observations, deterministic=True)` alone, which gets observations (B, O).
"""

from stable_baselines3 import A2C
from stable_baselines3.common.vec_env import DummyVecEnv


def fit(make_env, steps, seed):
    model = A2C(
        "MlpPolicy", DummyVecEnv([make_env] * 8), gamma=1.0, seed=10**6 + seed, device="cpu",
        policy_kwargs={"log_std_init": -1.2},  # first standard deviation 0.3 instead of 1
    )  # fmt: skip
    return model.learn(steps)
