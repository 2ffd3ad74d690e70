"""The vector environment of Stable-Baselines3 beside its own DummyVecEnv."""

import numpy as np
import pytest
from env_scenes import SMALL
from sampled_scenes import small_scenes

pytest.importorskip("stable_baselines3")

from gymnasium.wrappers import TimeLimit
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import DummyVecEnv

import domino_env as de
from agents import evaluate
from agents.vec_env import DominoVecEnv
from domino_env.envs import ENVIRONMENTS

SAMPLED = small_scenes()


@pytest.mark.parametrize("scene", [SMALL, SAMPLED], ids=["one scene", "sampled scenes"])
@pytest.mark.parametrize("info", ["all", "numbers"])
@pytest.mark.parametrize("limit", [None, 3], ids=["whole episodes", "truncated"])
def test_infos_are_those_of_single_environments(scene, info, limit):
    def single():
        env = de.DominoChain(scene, info=info)
        return env if limit is None else TimeLimit(env, limit)

    batch = DominoVecEnv(scene, 4, info=info, max_episode_steps=limit)
    singles = DummyVecEnv([single] * 4)
    for envs in (batch, singles):
        envs.seed(3)
    np.testing.assert_array_equal(batch.reset(), singles.reset())
    assert set(batch.reset_infos[0]) == ({"score", "gain", "outcome"} if info == "numbers" else
                                         {"scene"} if scene is SAMPLED else set())  # fmt: skip
    rng, ends = np.random.default_rng(0), 0
    for _ in range(25):
        actions = rng.uniform(-1.2, 1.2, (4, *batch.action_space.shape))
        *answers, infos = batch.step(actions)
        *expected, single_infos = singles.step(actions)
        np.testing.assert_equal(answers, expected)
        np.testing.assert_equal(batch.reset_infos, singles.reset_infos)
        for b, (ours, theirs) in enumerate(zip(infos, single_infos, strict=True)):
            if not answers[2][b]:
                del theirs["TimeLimit.truncated"]
            more = {"episode"} if answers[2][b] else set()
            if ours.get("TimeLimit.truncated") and info == "all":  # the wrapper does not know them
                more |= {"layout", "wave", *["scene"] * (scene is SAMPLED)}
            assert set(ours) == set(theirs) | more
            for key in set(theirs) - {"layout", "wave"}:
                np.testing.assert_equal(ours[key], theirs[key])
        ends += answers[2].sum()
    assert ends > 8


def test_attributes_are_those_of_single_environments():
    batch, singles = DominoVecEnv(SAMPLED, 4), DummyVecEnv([lambda: de.DominoChain(SAMPLED)] * 4)
    for envs in (batch, singles):
        envs.seed(1)
        envs.reset()
    for name in ("scene", "action_space", "observation_space", "np_random_seed", "distribution"):
        for indices in (None, 2, -1, [3, 1]):
            assert batch.get_attr(name, indices) == singles.get_attr(name, indices)
    assert batch.get_attr("scenes", [1]) == [batch.vector.scenes[1]]
    assert not batch.has_attr("no_such_name")


def test_invalid_indices_and_arguments_are_rejected():
    batch = DominoVecEnv(SMALL, 4)
    calls = batch.get_attr, batch.env_method, lambda name, indices: batch.set_attr(name, 1, indices)
    for call in calls:
        with pytest.raises(
            IndexError, match="there is no environment 17; give numbers from 0 to 3"
        ):
            call("render_mode", indices=[0, 17])
    with pytest.raises(IndexError, match="no environment -5"):
        batch.env_is_wrapped(TimeLimit, -5)
    with pytest.raises(ValueError, match=r"indices = \[1\]: 'tag' is set for all 4 environments"):
        batch.set_attr("tag", 1, [1])
    batch.set_attr("tag", 1)
    assert batch.get_attr("tag", [0, 2]) == [1, 1]
    with pytest.raises(ValueError, match="autoreset_mode = 'NextStep': Stable-Baselines3 begins"):
        DominoVecEnv(SMALL, 4, autoreset_mode="NextStep")


def test_options_hold_for_the_next_reset():
    batch, chosen = DominoVecEnv(SAMPLED, 2), SAMPLED.sample(7, "chosen")
    batch.set_options({"scene": chosen})
    batch.reset()
    assert batch.get_attr("scene") == [chosen, chosen]
    batch.reset()
    assert chosen not in batch.get_attr("scene")


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_a_policy_of_any_environment_builds_layouts(name, tmp_path):
    scene, path = de.load_scene("sprint").replace(count=6), tmp_path / "model.zip"
    model = PPO("MlpPolicy", DominoVecEnv(scene, 2, environment=name), 1e-3, 2, 4, device="cpu")
    model.learn(4).save(path)
    rollout = evaluate(path, scene)
    single = ENVIRONMENTS[name].make(scene)
    observation, over = single.reset()[0], False
    while not over:
        action, _ = model.predict(observation, deterministic=True)
        observation, _, over, _, info = single.step(action)
    assert rollout.layout.spacing == pytest.approx(info["layout"].spacing, rel=1e-6)
    assert rollout.score == pytest.approx(info["score"], rel=1e-5)
    with pytest.raises(ValueError, match="environment = 'Chain': choose one of DominoChain-v2"):
        DominoVecEnv(scene, environment="Chain")
