"""Checkers, wrappers and recorders of other libraries, on every environment.

    python -m pytest tests/compat.py          make compat

They take the place of the parts of these libraries' own test suites that accept any environment:
the packages are installed without their tests. Parts that do not apply are `NOT_HERE`, with the
reason; a part that a new version adds and that is in neither table fails. This takes some minutes,
so it is not among the files that `make test` collects.
"""

import warnings
from importlib.util import find_spec

import gymnasium
import numpy as np
import pytest
from gymnasium import wrappers
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.wrappers import vector as vector_wrappers

import domino_env as de

CHAIN, LAYOUT = "DominoChain-v2", "DominoLayout-v2"
# every scene on which an episode takes milliseconds; `table` simulates each layout on a floor
SCENES = [name for name in de.scene_names() if name != "table"]
CASES = [
    *[(CHAIN, name) for name in [*SCENES, *de.distribution_names()]],
    *[(LAYOUT, name) for name in SCENES],
]
pytestmark = pytest.mark.filterwarnings("ignore")  # what they advise, such as about image sizes

BOTH = {  # arguments of wrappers of single and of vector environments
    "ArrayConversion": {"env_xp": np, "target_xp": np},
    "ClipReward": {"min_reward": -1.0, "max_reward": 1.0},
    "DtypeObservation": {"dtype": np.float64},
    "RescaleAction": {"min_action": np.float32(0.0), "max_action": np.float32(1.0)},
    "RescaleObservation": {"min_obs": np.float32(0.0), "max_obs": np.float32(1.0)},
    "TransformReward": {"func": lambda reward: reward},
    "ClipAction": {}, "FlattenObservation": {}, "NormalizeObservation": {}, "NormalizeReward": {},
    "NumpyToTorch": {}, "RecordEpisodeStatistics": {}, "ReshapeObservation": {},
}  # fmt: skip
WRAPPERS = BOTH | {  # of single environments
    "AddWhiteNoise": {"probability_of_noise_per_pixel": 0.1},
    "DelayObservation": {"delay": 2},
    "DiscretizeAction": {"bins": 3},
    "DiscretizeObservation": {"bins": 3},
    "FrameStackObservation": {"stack_size": 3},
    "MaxAndSkipObservation": {"skip": 2},
    "ObstructView": {"obstructed_pixels_ratio": 0.2, "obstruction_width": 5},
    "RepeatAction": {"num_repeats": 2},
    "StickyAction": {"repeat_action_probability": 0.5},
    "TimeLimit": {"max_episode_steps": 3},
    "TransformAction": {"func": lambda action: action, "action_space": None},
    "TransformObservation": {"func": lambda value: value, "observation_space": None},
    "AddRenderObservation": {}, "Autoreset": {}, "GrayscaleObservation": {}, "HumanRendering": {},
    "OrderEnforcing": {}, "PassiveEnvChecker": {}, "RenderCollection": {},
    "TimeAwareObservation": {},
}  # fmt: skip
VECTOR_WRAPPERS = BOTH | {
    "DictInfoToList": {},
    "TransformAction": {"func": lambda action: action},
    "TransformObservation": {"func": lambda value: value},
    "VectorizeTransformAction": {"wrapper": wrappers.ClipAction},
    "VectorizeTransformObservation": {"wrapper": wrappers.FlattenObservation},
    "VectorizeTransformReward": {
        "wrapper": wrappers.ClipReward, "min_reward": -1.0, "max_reward": 1.0,
    },
}  # fmt: skip
NOT_HERE = {
    "AtariPreprocessing": "of Atari games",
    "FilterObservation": "of dictionaries; observations are arrays",
    "JaxToNumpy": "of environments written in JAX",
    "JaxToTorch": "of environments written in JAX",
    "RecordVideo": "needs moviepy, which is not among the extras",
    "ResizeObservation": "of images, with OpenCV, which is not among the extras",
    "vector": "the module of vector wrappers",
}
NOT_HERE_VECTOR = NOT_HERE | {
    "GrayscaleObservation": "of images; no wrapper adds them to a vector environment",
    "HumanRendering": "opens a window for all environments, which needs OpenCV",
}
IMAGES = ("AddRenderObservation", "GrayscaleObservation")
FRAMES = ("AddWhiteNoise", "HumanRendering", "ObstructView", "RenderCollection", *IMAGES)


def make(case, **arguments):
    """Make the single environment of a case."""
    kind, scene = case
    return gymnasium.make(kind, scene=scene, **arguments)


def play(env, steps=8):
    """Reset an environment, take some random steps, and reset it after each end of an episode."""
    env.action_space.seed(0)
    observation, _ = env.reset(seed=0)
    for _ in range(steps):
        observation, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if isinstance(observation, np.ndarray):
            assert observation in env.observation_space
        if terminated or truncated:
            env.reset()


# Gymnasium ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("info", ["all", "numbers"])
@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_the_checker_of_gymnasium_passes(case, info):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(make(case, info=info, disable_env_checker=True).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("names", [
    (wrappers.__all__, WRAPPERS, NOT_HERE),
    (vector_wrappers.__all__, VECTOR_WRAPPERS, NOT_HERE_VECTOR),
], ids=["single", "vector"])  # fmt: skip
def test_every_wrapper_is_applied_or_left_out_for_a_reason(names):
    known, applied, left_out = map(set, names)
    assert known <= applied | left_out
    assert not applied & left_out


@pytest.mark.parametrize("name", WRAPPERS)
@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_wrappers_of_gymnasium_accept_the_environment(case, name, monkeypatch):
    options = dict(WRAPPERS[name])
    if name == "TimeAwareObservation" and make(case).spec.max_episode_steps is None:
        pytest.skip("the number of dominoes is sampled: it needs a TimeLimit")
    if name in ("ArrayConversion", "NumpyToTorch"):
        pytest.importorskip("array_api_compat")
    if name == "HumanRendering":
        pytest.importorskip("pygame")
        monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = make(case, info="numbers", render_mode="rgb_array" if name in FRAMES else None)
    if name in IMAGES[1:]:
        env = wrappers.AddRenderObservation(env)
    if name == "ReshapeObservation":
        options["shape"] = (1, *env.observation_space.shape)
    if name.startswith("Discretize"):  # else it numbers all combinations of the entries
        options["multidiscrete"] = True
    wrapped = getattr(wrappers, name)(env, **options)
    if name == "NumpyToTorch":
        import torch

        wrapped.reset()
        wrapped.step(torch.zeros(env.action_space.shape))
        return
    if name == "Autoreset":
        wrapped.reset(seed=0)
        for _ in range(4):
            wrapped.step(wrapped.action_space.sample())
        return
    play(wrapped, 3 if name in FRAMES else 8)
    if name in FRAMES and name not in ("HumanRendering", *IMAGES):
        assert len(wrapped.render())
    wrapped.close()


@pytest.mark.parametrize("name", VECTOR_WRAPPERS)
@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_vector_wrappers_of_gymnasium_accept_the_environment(case, name):
    kind, scene = case
    if name in ("ArrayConversion", "NumpyToTorch"):
        pytest.importorskip("array_api_compat")
    envs = gymnasium.make_vec(kind, num_envs=3, scene=scene, info="numbers")
    options = dict(VECTOR_WRAPPERS[name])
    if name == "ReshapeObservation":
        options["shape"] = (1, *envs.single_observation_space.shape)
    wrapped = getattr(vector_wrappers, name)(envs, **options)
    wrapped.reset(seed=0)
    for _ in range(4):
        actions = wrapped.action_space.sample()
        if name == "NumpyToTorch":
            import torch

            actions = torch.from_numpy(actions)
        wrapped.step(actions)
    wrapped.close()


# Stable-Baselines3 --------------------------------------------------------------------------------


@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_the_checker_of_stable_baselines3_passes(case):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(make(case).unwrapped)


@pytest.mark.parametrize("name", ["VecCheckNan", "VecFrameStack", "VecMonitor", "VecNormalize"])
@pytest.mark.parametrize("scene", [*SCENES, *de.distribution_names()])
def test_wrappers_of_stable_baselines3_accept_the_vector(scene, name):
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    from agents import DominoVecEnv

    options = {"n_stack": 2} if name == "VecFrameStack" else {}
    envs = getattr(vec_env, name)(DominoVecEnv(scene, 3), **options)
    envs.reset()
    for _ in range(4):
        envs.step(np.zeros((3, *envs.action_space.shape), np.float32))


@pytest.mark.parametrize("name", ["A2C", "DDPG", "PPO", "SAC", "TD3"])  # DQN: of discrete actions
@pytest.mark.parametrize("case", [(CHAIN, "sprint"), (CHAIN, "varied"), (LAYOUT, "gentle")],
                         ids="-".join)  # fmt: skip
def test_algorithms_of_stable_baselines3_train_save_and_load(case, name, tmp_path):
    sb3 = pytest.importorskip("stable_baselines3")
    options = {"learning_starts": 20} if name in ("DDPG", "SAC", "TD3") else {"n_steps": 32}
    kind = getattr(sb3, name)
    model = kind("MlpPolicy", make(case), device="cpu", **options).learn(40)
    model.save(tmp_path / "model")
    observation, _ = make(case).reset(seed=0)
    expected, _ = model.predict(observation, deterministic=True)
    again, _ = kind.load(tmp_path / "model").predict(observation, deterministic=True)
    np.testing.assert_array_equal(again, expected)


# Minari -------------------------------------------------------------------------------------------


@pytest.mark.skipif(not find_spec("jax"), reason="Minari's DataCollector needs jax")
@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_minari_records_and_recovers_the_environment(case, tmp_path, monkeypatch):
    minari = pytest.importorskip("minari")
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    kind, name = case
    scene = de.load_scene(name) if name in SCENES else de.load_distribution(name)
    env = gymnasium.make(kind, scene=scene, info="numbers")
    collector = minari.DataCollector(env, record_infos=True, data_format="arrow")
    over, rewards, (observation, _) = False, [], collector.reset(seed=4)
    while not over:
        action = np.zeros(env.action_space.shape, np.float32)
        *_, reward, over, _, info = collector.step(action)
        rewards.append(reward)
    data = collector.create_dataset("domino/zeros-v0")
    (episode,) = data
    np.testing.assert_allclose(episode.rewards, rewards, rtol=1e-6)
    assert episode.infos["gain"].tolist() == [0.0] * len(rewards) + [info["gain"]]
    recovered = data.recover_environment()
    np.testing.assert_array_equal(recovered.reset(seed=4)[0], observation)
    assert data_equivalence(recovered.unwrapped.spec.kwargs, env.unwrapped.spec.kwargs)
