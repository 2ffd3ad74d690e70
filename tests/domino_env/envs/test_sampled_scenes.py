"""Environments that sample a scene at every reset."""

import tomllib

import numpy as np
import pytest
from env_scenes import check_return, gain_of, play
from sampled_scenes import small_scenes

import domino_env as de

SMALL = small_scenes()
RUN_OUTS = small_scenes("[run_out]\ncount = 3\nspacing = {min = 0.003, max = 0.03}\n")


def actions_of(env, seed):
    actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (200, *env.action_space.shape))
    return lambda k: actions[k]


@pytest.mark.parametrize("name", ["varied", "varied-course", "varied-thickness", SMALL, RUN_OUTS])
def test_a_sampled_scene_and_the_same_fixed_scene_give_the_same_episode(name):
    """The observation of the fixed scene lacks the features."""
    env = de.DominoChain(name, window=3)
    features = len(env.distribution.features)
    for seed in range(3):
        actions = actions_of(env, seed)
        _, observations, rewards, info = play(env, actions, seed=seed)
        scene = env.scene
        assert scene is info["scene"]
        assert scene.uniform().score > 0.0
        fixed = de.DominoChain(scene, window=3)
        _, alone, same_rewards, same_info = play(fixed, actions)
        np.testing.assert_array_equal(observations[:, :-features], alone)
        np.testing.assert_allclose(rewards, same_rewards, rtol=0.0, atol=1e-9)
        assert info["wave"] == same_info["wave"]
        check_return(scene, rewards, info["score"])
        assert info["gain"] == pytest.approx(gain_of(scene, info["score"]), abs=1e-11)
        # bitwise in the same environment, which then samples nothing
        before = env.np_random.bit_generator.state
        _, again, rewards_again, _ = play(env, actions, options={"scene": scene})
        assert env.np_random.bit_generator.state == before
        np.testing.assert_array_equal(again, observations)
        np.testing.assert_allclose(rewards_again, same_rewards, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["varied-draw", "varied-tempo"])
def test_random_episodes_in_sampled_scenes_are_those_of_the_same_fixed_scenes(name):
    """Every environment has its own box or schedule."""
    scenes = de.load_test_set(name, "validation")[:3]
    env, actions = de.DominoChainVector(3, name), actions_of(de.DominoChain(scenes[0]), 0)
    env.reset(seed=[5, 6, 7], options={"scene": scenes})
    infos = [{} for _ in scenes]
    rewards, k = np.zeros((3, 40)), 0
    while not all(infos):
        action = np.tile(actions(k), (3, 1))
        _, rewards[:, k], ended, info = env.advance(action)
        for j, b in enumerate(np.flatnonzero(ended)):
            infos[b] = infos[b] or {key: info[key][j] for key in ("layout", "score")}
        k += 1
    for b, scene in enumerate(scenes):
        _, _, alone, info = play(de.DominoChain(scene), actions, seed=5 + b)
        np.testing.assert_allclose(rewards[b, : len(alone)], alone, rtol=0.0, atol=1e-9)
        np.testing.assert_array_equal(infos[b]["layout"].thickness, info["layout"].thickness)
        assert infos[b]["score"] == pytest.approx(info["score"], rel=1e-12)


def test_features_of_the_sampled_scene_are_observed():
    env = de.DominoChain(SMALL)
    for seed in range(20):
        observations, info = env.reset(seed=seed)
        scene, numbers = info["scene"], observations[env.observation_layout["features"]]
        features = dict(zip(SMALL.features, numbers, strict=True))
        assert np.abs(numbers).max() <= 1.0
        assert scene.count == round(6.5 + 2.5 * features["count"])
        assert scene.height == pytest.approx(0.045 + 0.015 * features["height"], rel=1e-5)
        push = scene.physics.push * np.sqrt(scene.height / scene.physics.gravity)
        assert push == pytest.approx(np.sqrt(0.5 * 1.2) * (1.2 / 0.5) ** (features["push"] / 2.0))
        assert scene.spacing[1] >= 2.0 * scene.spacing[0]
    assert "friction" in SMALL.features


def test_hidden_numbers_are_left_out_of_the_observation():
    whole, partial = de.DominoChain(SMALL), de.DominoChain(SMALL, hide=("friction", "count"))
    names, first = list(SMALL.features), whole.observation_layout["features"].start
    hidden = [first + names.index(name) for name in ("friction", "count")]
    for seed in range(3):
        actions = actions_of(whole, seed)
        _, observations, rewards, _ = play(whole, actions, seed=seed)
        _, others, same_rewards, _ = play(partial, actions, seed=seed)
        np.testing.assert_array_equal(others, np.delete(observations, hidden, axis=1))
        np.testing.assert_array_equal(same_rewards, rewards)
    given, _ = partial.reset(options={"scene": whole.scene})
    np.testing.assert_array_equal(given, np.delete(observations[0], hidden))
    assert "features" not in de.DominoChain(SMALL, hide=SMALL.features).observation_layout


def test_a_sampled_scene_whose_heights_cannot_grow_has_a_finite_observation():
    document = tomllib.loads(de.load_scene("magnify").to_toml())
    document["growth"]["max"] = {"min": 1.0, "max": 1.01}
    distribution = de.SceneDistribution(document, "grown")
    env = de.DominoChain(distribution)
    observation, _ = env.reset(options={"scene": distribution.scene(np.array([1.0]))})
    assert observation[env.observation_layout["height"]] == 0.0
    assert np.isfinite(observation).all()


def test_the_number_of_scenes_can_be_limited():
    few = de.DominoChainVector(64, "varied", num_scenes=3, first_scene=100)
    envs = de.DominoChainVector(64, "varied", first_scene=4094)
    few.reset(seed=0)
    envs.reset(seed=0)
    assert {scene.name for scene in few.scenes} == {f"varied-{i}" for i in (100, 101, 102)}
    assert {scene.name for scene in envs.scenes} == {"varied-4094", "varied-4095"}
    alone = de.DominoChain("varied", num_scenes=3, first_scene=100)
    assert alone.reset(seed=7)[1]["scene"] == few.scenes[7]
    for words, settings in (
        ("num_scenes = 0", {"num_scenes": 0}),
        ("first_scene = 4096: give a whole number from 0 to 4095", {"first_scene": 4096}),
        ("num_scenes = 3: give a whole number from 1 to 2", {"num_scenes": 3, "first_scene": 4094}),
        ("hide = 'frction': did you mean 'friction'", {"hide": ["frction"]}),
        ("hide = 'friction': a fixed scene has", {"hide": "friction", "scene": "sprint"}),
        ("hide = 3: choose one of friction, ", {"hide": 3}),
        ("first_scene = 1: give a whole number from 0 to 0", {"first_scene": 1, "scene": "sprint"}),
    ):
        with pytest.raises(ValueError, match=words):
            de.DominoChain(**{"scene": "varied"} | settings)


def test_reset_takes_scenes_for_some_environments():
    chosen = SMALL.sample(np.random.default_rng(8), "chosen")
    envs = de.DominoChainVector(3, SMALL, autoreset_mode="SameStep")
    observations, infos = envs.reset(seed=1, options={"scene": [None, chosen, None]})
    assert infos["scene"][1] is chosen
    alone, _ = de.DominoChain(SMALL).reset(options={"scene": chosen})
    np.testing.assert_array_equal(observations[1], alone)
    gains = {}
    while len(gains) < 3:  # each builds its own uniform baseline
        layouts = [scene.uniform().layout for scene in envs.scenes]
        *_, ended, _, infos = envs.step(envs.actions_towards(layouts))
        for b in np.flatnonzero(ended):
            gains[b] = infos["final_info"]["gain"][b]
    np.testing.assert_allclose(list(gains.values()), 0.0, atol=1e-6)


def test_scenes_that_the_distribution_does_not_cover_are_rejected():
    env = de.DominoChain(SMALL)
    scene = env.reset(seed=0)[1]["scene"]
    env.reset(options={"scene": scene})
    far = {"layout": de.Layout([0.5], 0.0075)}
    for other, words, options in (
        (de.load_scene("sprint"), "differs from those of 'small' in more than friction, push", {}),
        (scene.replace(first_thickness=0.008), "differs from those of 'small'", {}),
        (scene.replace(count=19), "has 19 dominoes: use at most 18", {}),
        ("sprint", "scene = 'sprint': give one Scene for all, or a list with one for each of", {}),
        (scene.replace(name="other"), r"spacing\[0\] = 0.5 m: the scene allows", far),
    ):
        with pytest.raises(ValueError, match=words):
            env.reset(options={"scene": other} | options)
        assert env.scene is scene
    assert env.reset(options={"scene": scene.replace(count=18)})[0] in env.observation_space
    with pytest.raises(ValueError, match="unknown reset option 'scene'; accepted: layout"):
        de.DominoChain("sprint").reset(options={"scene": scene})
    with pytest.raises(ValueError, match="give one Scene for all, or a list with one for each of"):
        de.DominoChainVector(3, SMALL).reset(options={"scene": [scene, None]})
    with pytest.raises(ValueError, match="use DominoChain-v2"):
        de.DominoLayout(SMALL)
