"""Environments as other libraries use them: specifications, time limits, infos."""

import json
from typing import Any

import gymnasium
import numpy as np
import pytest
from env_scenes import SCENES, SMALL, short
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeAwareObservation, TimeLimit
from sampled_scenes import small_scenes

import domino_env as de
from domino_env.envs import ENVIRONMENTS
from domino_env.envs.arguments import as_scene, plain_argument

CHAIN, LAYOUT = [*ENVIRONMENTS][:2]
NUMBERS = {"score", "gain", "outcome"}
SAMPLED = small_scenes()


def episodes(env: Any, actions: Any) -> list[Any]:
    """Return what an environment answers to a reset and to actions."""
    answers = [env.reset(seed=5)[0]]
    for action in actions:
        answers += env.step(action)[:4]
    return answers


# specifications -----------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [*SCENES, *de.distribution_names()])
def test_a_scene_as_an_argument_survives_json(name):
    scene = SCENES.get(name) or de.load_distribution(name)
    again = as_scene(json.loads(json.dumps(plain_argument(scene))))
    assert again == scene
    assert getattr(again, "uniform_point", None) == getattr(scene, "uniform_point", None)


@pytest.mark.parametrize("name", ["sprint", "scene", "known baseline", "path", "distribution"])
def test_a_written_specification_makes_the_same_environments(name, tmp_path):
    file = tmp_path / "own.toml"
    file.write_text(SMALL.to_toml())
    arguments: dict[str, Any] = {
        "sprint": "sprint", "scene": SMALL, "known baseline": SMALL.with_uniform([0.02, 0.0075]),
        "path": file, "distribution": SAMPLED,
    }  # fmt: skip
    env = gymnasium.make(CHAIN, scene=arguments[name], rtol=np.float64(1e-5))
    spec = EnvSpec.from_json(env.spec.to_json())
    shape = env.action_space.shape
    actions = np.random.default_rng(0).uniform(-0.2, 0.2, (3, *shape))
    expected = episodes(env, actions)
    np.testing.assert_equal(episodes(gymnasium.make(spec), actions), expected)
    for settings in ({}, {"vectorization_mode": "sync"}):
        vector = gymnasium.make_vec(spec, num_envs=1, **settings)
        answers = episodes(vector, actions[:, None])
        np.testing.assert_equal([answer[0] for answer in answers], expected)
    native = gymnasium.make_vec(
        CHAIN, num_envs=2, scene=arguments[name], autoreset_mode=AutoresetMode.SAME_STEP
    )
    again = gymnasium.make_vec(EnvSpec.from_json(native.spec.to_json()))
    assert again.num_envs == 2
    assert again.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    both = np.stack([actions, actions], axis=1)
    np.testing.assert_equal(episodes(again, both), episodes(native, both))


def test_a_document_that_is_no_scene_is_rejected():
    with pytest.raises(ValueError, match="odd"):
        de.DominoChain({"name": "odd", "row": {"count": 1}})
    with pytest.raises(TypeError, match="name = 3"):
        de.DominoChain(3)


def test_the_specification_has_the_length_of_episodes_where_it_is_fixed():
    env = gymnasium.make(CHAIN, scene=SMALL)
    assert env.spec.max_episode_steps == SMALL.count
    assert gymnasium.make(LAYOUT, scene=SMALL).spec.max_episode_steps == 2
    assert gymnasium.make(CHAIN, scene=SAMPLED).spec.max_episode_steps is None
    assert gymnasium.make_vec(CHAIN, num_envs=2, scene=SMALL).spec.max_episode_steps == SMALL.count
    limited = gymnasium.make_vec(CHAIN, num_envs=2, scene=SMALL, max_episode_steps=3)
    assert limited.spec.max_episode_steps == 3
    aware, again = TimeAwareObservation(env), gymnasium.make(env.spec)
    aware.reset()
    again.reset()
    ends = []
    for step in range(1, SMALL.count):  # no episode of the specification is truncated
        observation, *_ = aware.step(np.zeros(1, np.float32))
        assert observation[-1] == step
        ends.append(again.step(np.zeros(1, np.float32))[2:4])
    assert ends == [(False, False)] * (SMALL.count - 2) + [(True, False)]


# time limits --------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", list(AutoresetMode), ids=lambda mode: mode.value)
@pytest.mark.parametrize("info", ["all", "numbers"])
@pytest.mark.parametrize("scene", [SMALL, SAMPLED], ids=["one scene", "sampled scenes"])
def test_a_time_limit_truncates_the_native_vector_as_the_wrapper_does(scene, info, mode):
    limit, settings = 3, {"scene": scene, "info": info}
    native = gymnasium.make_vec(
        CHAIN, num_envs=4, max_episode_steps=limit, autoreset_mode=mode, **settings
    )
    singles = SyncVectorEnv(
        [lambda: gymnasium.make(CHAIN, max_episode_steps=limit, **settings)] * 4,
        autoreset_mode=mode,
    )
    rng, cuts = np.random.default_rng(1), 0
    answers = native.reset(seed=2), singles.reset(seed=2)
    np.testing.assert_equal(answers[0][0], answers[1][0])
    for _ in range(12):
        actions = rng.uniform(-1.0, 1.0, native.action_space.shape)
        over = None if mode != AutoresetMode.NEXT_STEP else native.unwrapped._over.copy()
        first, second = native.step(actions), singles.step(actions)
        np.testing.assert_equal(first[:4], second[:4])
        cut, infos = first[3] & ~first[2], first[4]
        if mode == AutoresetMode.SAME_STEP and (first[2] | first[3]).any():
            for b in np.flatnonzero(first[2] | first[3]):
                np.testing.assert_equal(infos["final_obs"][b], second[4]["final_obs"][b])
            infos = infos["final_info"]
        assert over is None or not (over & cut).any()
        for b in np.flatnonzero(cut):
            cuts += 1
            if info == "numbers":
                assert (infos["gain"][b], infos["outcome"][b]) == (0.0, -1)
                continue
            wave = infos["wave"][b]
            assert wave.layout == infos["layout"][b]
            assert wave.layout.count == limit + 1
            assert wave.hit == wave.layout.count
            assert "score" not in infos or not infos["_score"][b]
            if mode != AutoresetMode.SAME_STEP:  # there the next episode has begun
                alone = singles.envs[b].unwrapped.wave
                assert alone == wave == native.unwrapped.wave(b)
                np.testing.assert_array_equal(alone.arrival_times, wave.arrival_times)
                assert native.unwrapped.snapshot(b).wave is wave
        if mode == AutoresetMode.DISABLED and (first[2] | first[3]).any():
            mask = first[2] | first[3]
            options = [{"reset_mask": mask.copy()} for _ in range(2)]
            answers = native.reset(options=options[0]), singles.reset(options=options[1])
            np.testing.assert_equal(answers[0][0], answers[1][0])
    assert cuts > 4


def test_a_time_limit_is_checked_and_may_exceed_the_episode():
    for wrong in (0, 2.5):
        with pytest.raises(ValueError, match=f"max_episode_steps = {wrong}"):
            de.DominoChainVector(2, SMALL, max_episode_steps=wrong)
    assert de.DominoChainVector(2, SMALL, max_episode_steps=-1).max_episode_steps is None
    whole = de.DominoLayoutVector(2, SMALL, max_episode_steps=1)
    single = TimeLimit(de.DominoLayout(SMALL), 1)
    whole.reset()
    single.reset()
    action = np.zeros(whole.action_space.shape)
    *_, terminated, truncated, infos = whole.step(action)
    assert single.step(action[0])[2:4] == (terminated[0], truncated[0]) == (True, True)
    assert infos["gain"].tolist() == [0.0, 0.0]


def test_the_wave_so_far_is_known_at_every_step():
    env = de.DominoChain(short("relay", 8))
    env.reset()
    for placed in range(1, 8):
        *_, info = env.step(np.zeros(1))
        assert env.wave.layout.positions[: placed + 1][-1] > 0.0
        assert env.wave.arrival_times.shape[0] >= placed + 1
    assert env.wave is info["wave"]


# infos --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", [SMALL, SAMPLED], ids=["one scene", "sampled scenes"])
def test_infos_of_numbers_have_the_same_keys_in_every_step(scene):
    env, rich = de.DominoChain(scene, info="numbers"), de.DominoChain(scene)
    _, info = env.reset(seed=1)
    rich.reset(seed=1)
    infos, over = [info], False
    while not over:
        action = np.zeros(env.action_space.shape)
        *_, over, _, info = env.step(action)
        *_, expected = rich.step(action)
        infos.append(info)
    for info in infos:
        assert set(info) == NUMBERS
        # what TorchRL's default_info_dict_reader reads of a value
        assert all(hasattr(value, "dtype") and value.shape == () for value in info.values())
        assert len({value.dtype for value in infos[0].values()}) == 2
    for info in infos[:-1]:
        assert info == {"score": 0.0, "gain": 0.0, "outcome": -1}
    assert infos[-1] == {key: expected[key] for key in NUMBERS}
    assert isinstance(expected["gain"], np.float64)
    assert isinstance(expected["score"], np.float64)
    with pytest.raises(ValueError, match="info = 'number': did you mean 'numbers'"):
        de.DominoChain(scene, info="number")


@pytest.mark.parametrize("kind", ENVIRONMENTS)
@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
def test_tensors_of_torch_take_infos_of_numbers(kind, mode):
    torch = pytest.importorskip("torch")
    pytest.importorskip("array_api_compat", reason="wrappers that convert arrays need it")
    from gymnasium.wrappers import NumpyToTorch
    from gymnasium.wrappers.vector import NumpyToTorch as VectorNumpyToTorch

    scene = SMALL if kind == LAYOUT else SAMPLED
    single = NumpyToTorch(gymnasium.make(kind, scene=scene, info="numbers"))
    vector = VectorNumpyToTorch(
        gymnasium.make_vec(kind, num_envs=3, scene=scene, info="numbers", autoreset_mode=mode)
    )
    observations, infos = vector.reset(seed=0)
    assert set(infos) == {*NUMBERS, *(f"_{key}" for key in NUMBERS)}
    ends, over = 0, False
    single.reset(seed=0)
    while not over:
        *_, over, _, info = single.step(torch.zeros(single.action_space.shape))
    assert info["gain"].dtype == torch.float64
    for _ in range(14):
        observations, _, ended, _, infos = vector.step(torch.zeros(vector.action_space.shape))
        last = infos.get("final_info", infos)
        ends += int(ended.sum())
        assert isinstance(observations, torch.Tensor)
        assert not ended.any() or torch.isfinite(last["gain"][ended]).all()
    assert ends > 3


# actions and options ------------------------------------------------------------------------------


@pytest.mark.parametrize("entry", ENVIRONMENTS.values(), ids=ENVIRONMENTS)
def test_the_action_of_a_step_that_resets_may_have_any_entries(entry):
    env = entry.make_vec(2, SMALL)
    env.reset()
    actions = np.zeros(env.action_space.shape)
    ended = np.zeros(2, np.bool_)
    while not ended.all():
        ended = env.step(actions)[2]
    actions[0] = np.nan
    with pytest.raises(ValueError, match="action"):
        env.step(actions[:, :0])
    observations, rewards, *_ = env.step(actions)
    np.testing.assert_equal(observations[0], observations[1])
    assert rewards.tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match="action"):  # no environment ignores it now
        env.step(actions)
    disabled = entry.make_vec(2, SMALL, autoreset_mode="Disabled")
    disabled.reset()
    with pytest.raises(ValueError, match="action"):
        disabled.step(actions)


def test_options_of_a_reset_hold_for_one_episode():
    scene = SAMPLED.sample(7, "chosen")
    env = de.DominoChainVector(2, SAMPLED, autoreset_mode="SameStep")
    env.reset(seed=0, options={"scene": scene})
    assert env.scenes == (scene, scene)
    seen = np.zeros(2, np.bool_)
    while not seen.all():
        seen |= env.step(np.zeros(env.action_space.shape))[2]
    assert scene not in env.scenes
    single = de.DominoChain(SAMPLED)
    single.reset(seed=0, options={"scene": scene})
    assert single.scene is scene
    single.reset()
    assert single.scene != scene
