"""Single environments: returns of episodes, observations, bounds of actions."""

import copy
import inspect
import pickle
import re
import warnings
from itertools import product
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from env_scenes import SCENES, check_return, courses, gain_of, play, scaled, short
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env, data_equivalence
from sampled_scenes import small_scenes

import domino_env as de
from domino_env.envs import ENVIRONMENTS

KINDS = [getattr(de, entry.single.partition(":")[2]) for entry in ENVIRONMENTS.values()]


def at_random(env, rng, low=-1.0, high=1.0):
    return lambda k: rng.uniform(low, high, env.action_space.shape)


# returns of episodes ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", SCENES)
def test_an_episode_keeps_all_rules_and_returns_the_gain_in_score(name, kind):
    scene, rng = SCENES[name], np.random.default_rng(7)
    env = kind(scene)
    spreads = [(-1.0, 1.0), (-1.5, 1.5), (-7.0, -7.0), (7.0, 7.0), *rng.uniform(-1, 1, (4, 2))]
    returns, scores = [], []
    for seed, spread in enumerate(spreads[: 3 if name == "table" else None]):
        policy = at_random(env, rng, *np.sort(spread))
        _, observations, rewards, info = play(env, policy, seed=seed)
        layout, wave, score = info["layout"], info["wave"], info["score"]
        assert all(observation in env.observation_space for observation in observations)
        if kind is de.DominoLayout:
            assert observations.tolist() == [[0.0], [1.0]]
        exact = gain_of(scene, score)
        assert info["gain"] == pytest.approx(exact, rel=1e-9, abs=1e-12)
        check_return(scene, rewards, score)
        if scene.objective == "magnify":
            assert not rewards[:-1].any()
        again = scene.simulate(layout, rtol=1e-6)
        np.testing.assert_array_equal(wave.arrival_times, again.arrival_times)
        assert wave.layout == scene.row(layout)
        assert wave.outcome is info["outcome"] is again.outcome
        # on curved ground the pitches are not summed in the same order
        placed, uniform = scene.as_placed, scene.uniform()
        rounding = 1e-15 * (scene.ground is not None)
        same = layout.count == scene.count and not (scene.hand or scene.placement)
        if same and np.abs(layout.spacing - uniform.layout.spacing).max() < 1e-12:
            rounding = 1e-8  # the score of the uniform baseline has a smaller tolerance
        assert score == pytest.approx(placed.score(wave), rel=rounding)
        if layout.count < scene.count:
            assert wave.outcome != de.Outcome.PROPAGATED
            others = not placed.scoring.follows_wave, scene.growth, scene.ground
            if others == (False, None, None):
                sizes, missing = (layout.spacing, layout.thickness[1:]), scene.count - layout.count
                rest = scene.layout(*(np.pad(s, (0, missing), mode="edge") for s in sizes))
                longer = scene.simulate(rest, 1e-6)
                assert score == pytest.approx(placed.score(longer), abs=1e-9)
        else:
            assert scene.placement or scene.violations(layout) == []
            if name != "table" and score > 0.0:
                returns.append(rewards.sum())
                scores.append(placed.score(scene.simulate(layout)))
    order = np.argsort(scores)
    clear = np.diff(np.array(scores)[order]) > 1e-5
    assert np.all(np.diff(np.array(returns)[order])[clear] > 0.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("scene", "action"),
    [
        (de.load_scene("sprint"), -1.0),  # a gain is expected before the wave stops
        (short("tempo", 12).replace(physics=de.Physics(push=4.0)), -1.0),  # a loss
        (short("gentle", 12), 1.0),
        (short("magnify", 12), -1.0),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_a_wave_that_stops_returns_less_than_was_expected(scene, action, kind):
    env = kind(scene)
    _, _, rewards, info = play(env, lambda _: np.full(env.action_space.shape, action))
    assert info["score"] < 0.0 < scene.uniform().score
    check_return(scene, rewards, info["score"])


@pytest.mark.parametrize("noise", [{}, {"placement": de.Placement(1e-3, 4)}])
def test_rewards_and_observations_follow_a_schedule(noise):
    scene = short("tempo", 8).replace(**noise)
    env = de.DominoChain(scene, rtol=1e-10)
    actions = np.sin([[1.0 + k, 2.0 * k] for k in range(7)])
    _, observations, rewards, info = play(env, actions.__getitem__, seed=0)
    tempo, parts = scene.settings, env.observation_layout
    late = info["wave"].arrival_times[1:] - tempo.schedule(8)
    squares, left = np.append(0.0, late**2), np.arange(7, -1, -1)
    rms = np.sqrt((np.cumsum(squares) + left * squares) / 7)
    scores, ends = 1.0 / (1.0 + rms / tempo.tolerance), np.log10(scene.uniform().score)
    returns = 10.0 * (np.log10(scores) - ends * np.arange(8) / 7)
    assert rewards == pytest.approx(np.diff(returns), rel=1e-6)
    assert rewards.sum() == pytest.approx(100.0 * info["gain"])
    assert info["score"] == scene.as_placed.score(info["wave"])
    lateness = np.sign(late) * np.log1p(np.abs(late) / tempo.tolerance)
    assert observations[1:-1, parts["lateness"]][:, 0] == pytest.approx(lateness[:-1], abs=1e-6)
    rate = np.diff(np.append(0.0, tempo.schedule(8)))
    ahead = 2.0 * (rate - rate.min()) / np.ptp(rate) - 1.0
    assert observations[0, parts["intervals"]] == pytest.approx(ahead, abs=1e-6)
    later = [*ahead[5:], *[0.0] * 5]
    assert observations[5, parts["intervals"]] == pytest.approx(later, abs=1e-6)


@pytest.mark.parametrize(("name", "push"), [("sprint", 3.0), ("gentle", 5.0)])
def test_rewards_do_not_depend_on_the_size_of_the_dominoes(name, push):
    scene = short(name, 12)
    scene = scene.replace(physics=scene.physics.replace(push=push))
    outcomes, returns = set(), []
    for factor in (0.1, 1.0, 10.0):
        env = de.DominoChain(scaled(scene, factor), rtol=1e-10)
        rng, rewards = np.random.default_rng(1), []
        for low, high in ((-0.1, 0.1), (-1.0, 1.0), (-7.0, -7.0), (7.0, 7.0)):
            *_, episode, info = play(env, at_random(env, rng, low, high))
            rewards.append(episode)
            outcomes.add(info["outcome"])
        returns.append(np.concatenate(rewards))
    np.testing.assert_allclose(returns, returns[1][None].repeat(3, axis=0), rtol=1e-6, atol=1e-6)
    assert len(outcomes) > 1


STOPPING = de.Scene(  # gaps so small that the weak push carries few dominoes
    count=30, spacing=(0.004, 0.006), thickness=(0.0075, 0.0075), physics=de.Physics(push=3.0)
)


@pytest.mark.parametrize("name", ["sprint", "sprint-thickness", "course", "hills", "stops"])
def test_rewards_are_changes_of_the_gain_expected_with_the_rest_uniform(name):
    scene = STOPPING if name == "stops" else short(name, 12)
    uniform, free = scene.uniform(), np.sqrt(scene.physics.gravity * scene.height)
    at, times, speed = uniform.layout.positions, uniform.wave.arrival_times, uniform.wave.mean_speed
    assert (speed > 0.0) == (name != "stops")
    if name == "stops":
        times, speed = at / free, free
    env, rng = de.DominoChain(scene, rtol=1e-10), np.random.default_rng(2)
    for spread in (0.2, 1.0):
        *_, rewards, info = play(env, at_random(env, rng, -spread, spread))
        placed = slice(1, len(rewards))
        x, t = info["layout"].positions[placed], info["wave"].arrival_times[placed]
        left, time = at[-1] - at[placed], times[-1] - times[placed]
        if scene.length is not None:
            left, time = scene.length - x, time * (scene.length - x) / left
        expected = 100.0 * ((x + left) / (t + time) / speed - 1.0)
        np.testing.assert_allclose(np.cumsum(rewards)[:-1], expected, rtol=1e-6, atol=1e-6)
        check_return(scene, rewards, info["score"])


# observations -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["sprint", "sprint-thickness", "course", "gentle", "hills", "magnify", "jitter"]
)
def test_observations_are_as_documented(name):
    window, scene = 3, short(name, 9)
    env = de.DominoChain(scene, window=window)
    h, g, count = scene.height, scene.physics.gravity, scene.count
    scales, parts = (1, 2, 4, 8), env.observation_layout
    v = scene.uniform().wave.mean_speed
    for seed in range(3):
        policy = at_random(env, np.random.default_rng(seed))
        _, observations, _, info = play(env, policy, seed=seed)
        layout, wave = info["layout"], info["wave"]
        for k, observation in enumerate(observations):
            stopped = k + 1 == len(observations) and wave.outcome != de.Outcome.PROPAGATED
            front, time = wave.release_velocity[k], wave.arrival_times[k]
            if k + 1 == count:  # observed once the last domino has tipped over
                front = observation[0] / np.sqrt(h / g)
                assert front > 0.0
            if stopped:
                front, time = 0.0, wave.arrival_times[np.isfinite(wave.arrival_times)][-1]
            distance = layout.positions[k]
            expected = {
                "front": front * np.sqrt(h / g),
                "lead": (distance - v * time) / (10.0 * h),
                "speed": distance / time / v - 1.0 if time > 0.0 else 0.0,
            }
            if scene.length is not None:
                pitches = np.add(scene.spacing, scene.thickness)
                left, pairs = scene.length - distance, count - 1 - k
                expected["length_left"] = left / scene.length
                mean = np.interp(left / pairs, pitches, (-1.0, 1.0)) if pairs else 0.0
                expected["pitch_left"] = mean
            before, tall = layout.height[:k], layout.height[1 : k + 1]
            gaps = layout.spacing[:k] / (before if scene.in_heights else 1.0)
            baseline, thickness = scene.uniform().layout, layout.thickness[1:]
            growth = baseline.height[1:] / baseline.height[:-1]
            equal = baseline.spacing / (baseline.height[:-1] if scene.in_heights else 1.0)
            for part, free, values, uniform in (
                ("gaps", scene.space.spacing.is_free, gaps, equal),
                ("thicknesses", scene.free_thickness, thickness, baseline.thickness[1:]),
                ("growths", scene.growth, tall / before, growth),
            ):
                if free:
                    latest = np.log(values[:k] / uniform[0])[::-1][:window]
                    expected[part] = [*latest, *np.zeros(window - len(latest))]
            if scene.growth:
                height = np.log(layout.height[k] / h) / (count - 1)
                expected["height"] = height / np.log(scene.growth[1])
            expected["placed"] = k / (count - 1)
            expected["near_start"] = [np.exp(-k / c) for c in scales]
            expected["near_end"] = [np.exp(-(count - 1 - k) / c) for c in scales]
            if scene.ground is not None:
                here = layout.pivots[k, 0]
                ahead = here + np.arange(1, 1 + window) * (0.025 + 0.0075)
                up = scene.ground.height([ahead - 1e-5, ahead + 1e-5, ahead, 0.0 * ahead + here])
                expected["slopes"] = (up[0] - up[1]) / 2e-5 * h / 0.0075
                expected["rises"] = (up[2] - up[3]) / h
            assert list(parts) == list(expected)
            for part, values in expected.items():
                np.testing.assert_allclose(observation[parts[part]], values, rtol=2e-6, atol=3e-6)
            assert parts[part].stop == len(observation)


def test_equal_pieces_are_observed_as_equal_at_every_place():
    """Pieces of the baseline differ from place to place; they are not the reference."""
    env = de.DominoChain("draw", window=1)
    _, observations, _, info = play(
        env, at_random(env, np.random.default_rng(1), -0.1, 0.1), seed=0
    )
    thickness = info["layout"].thickness[1:]
    observed = observations[1:, env.observation_layout["thicknesses"]][:, 0]
    for kind in env.scene.stock.thickness:
        assert len(set(observed[: len(thickness)][np.isclose(thickness, kind)])) == 1


# bounds of actions --------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", [courses()["free course"], SCENES["sprint-thickness"]])
def test_extreme_actions_reach_the_narrowed_bounds(scene):
    env, rng = de.DominoChain(scene), np.random.default_rng(6)
    env.reset()
    for n in range(min(scene.count - 2, 20)):
        before = env.snapshot().layout
        gaps, pitches = np.array(scene.spacing), np.array([-np.inf, np.inf])
        if scene.length is not None:
            later = (scene.count - 2 - n) * np.add(scene.spacing, scene.thickness)
            pitches = scene.length - before.length - later[::-1]
        for edge, part in product((0, 1), ("spacing", "thickness")):
            twin, end = copy.deepcopy(env), 2.0 * edge - 1.0
            twin.step([end, 0.0] if part == "spacing" else [0.0, end])
            layout = twin.snapshot().layout
            bound = np.clip(pitches[edge] - layout.thickness[-1], *gaps)
            if part == "thickness":
                bound = np.clip(pitches[edge] - gaps[1 - edge], *scene.thickness)
            assert getattr(layout, part)[-1] == pytest.approx(bound, abs=1e-12)
        env.step(rng.uniform(-1.0, 1.0, 2))


# reset --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["sprint-thickness", "course", "hills", "magnify"])
def test_an_episode_continues_from_a_given_layout(name):
    env = de.DominoChain(name)
    actions, observations, rewards, info = play(env, at_random(env, np.random.default_rng(8)))
    whole = info["layout"]
    for given in (1, len(actions) // 2, len(actions) - 1):
        start = de.Layout(
            whole.spacing[:given], whole.thickness[: given + 1], whole.height[: given + 1],
            rise=whole.rise[:given], tilt=whole.tilt[: given + 1],
        )  # fmt: skip
        policy = actions[given:].__getitem__
        _, resumed, resumed_rewards, last = play(env, policy, options={"layout": start})
        np.testing.assert_array_equal(resumed, observations[given:])
        np.testing.assert_allclose(resumed_rewards, rewards[given:], rtol=0.0, atol=1e-12)
        assert last["score"] == info["score"]


def test_layouts_from_which_no_episode_can_start_are_rejected():
    env = de.DominoChain("gentle")
    scene = env.scene
    env.reset()
    env.step([0.0, 0.0])
    before = env.snapshot()
    for start, words in (
        (scene.layout(0.02, 0.006), "leave at least one of the scene's 30"),
        (de.Layout([0.03], 0.0075), r"spacing\[0\] = 0.03 m: the scene allows 0.002 to 0.025 m"),
        (de.Layout([0.02], [0.009, 0.0075]), "the scene allows 0.0075 m"),
        (de.Layout([0.02], 0.0075, 0.06), r"height\[0\] = 0.06"),
        (de.Layout([0.002] * 9, [0.0075] + [0.014] * 9), "its wave stops: the wave stalled"),
    ):
        with pytest.raises(ValueError, match=words):
            env.reset(options={"layout": start})
    after = env.snapshot()  # the chain is unchanged
    assert after.time == before.time
    assert after.layout == before.layout
    with pytest.raises(ValueError, match="m of the length for 29 dominoes, which cover"):
        de.DominoChain("course").reset(options={"layout": de.Layout([0.04] * 30, 0.0075)})


# errors -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_invalid_calls_are_rejected(kind):
    for scene, options, words in (
        ("sprnt", {}, "no scene 'sprnt': did you mean 'sprint'"),
        ("sprint", {"render_mode": "film"}, "render_mode = 'film': choose None or one of rgb"),
        ("sprint", {"rtol": 0.1}, r"rtol = 0\.1: give a finite number from 1e-13 to 0.001"),
        (de.load_scene("sprint").replace(spacing=(0.02, 0.02)), {}, "leaves nothing free"),
        (de.load_scene("stock").replace(length=0.9), {}, "has a length and"),
    ):
        with pytest.raises(ValueError, match=words):
            kind(scene, **options)
    with pytest.raises(ValueError, match="window = -1: give a whole number, at least 0"):
        de.DominoChain("sprint", window=-1)
    env = kind("gentle")
    size = env.action_space.shape[0]
    with pytest.raises(ResetNeeded, match=r"call reset\(\) before"):
        env.step(np.zeros(size))
    with pytest.raises(ValueError, match="unknown reset option 'spacing'; accepted: "):
        env.reset(options={"spacing": [0.01]})
    with pytest.raises(TypeError, match="options = 3: give a dictionary of options, or None"):
        env.reset(options=3)
    env.reset()
    with pytest.raises(ValueError, match=rf"action has shape \(3,\): give \({size},\)"):
        env.step(np.zeros(3))
    with pytest.raises(ValueError, match=r"action = 'a': give numbers"):
        env.step("a")
    with pytest.raises(ValueError, match=r"action\[1\] = nan: give a finite number \(from"):
        env.step(np.where(np.arange(size) == 1, np.nan, 0.0))
    with pytest.warns(UserWarning, match=r"render\(\) shows nothing without a render mode"):
        assert env.render() is None
    while not env.step(np.zeros(size))[2]:
        pass
    with pytest.raises(ResetNeeded, match=r"call reset\(\)"):
        env.step(np.zeros(size))


def test_the_page_names_all_arguments():
    text = (Path(__file__).parents[3] / "docs" / "environments.md").read_text("utf-8")
    page = text.partition("\n## ")[0]
    lines = dict(line.strip("| ").split(" | ", 1) for line in page.splitlines() if " | " in line)
    for kind, listed in zip(KINDS, lines["Arguments"].split(" | "), strict=True):
        known = set(inspect.signature(kind).parameters)
        assert re.findall(r"`(\w+)`", listed) == sorted(known, key=listed.index)


# third-party tools --------------------------------------------------------------------------------


IDS = tuple(ENVIRONMENTS)
CHECKED = {name: name for name in de.scene_names()}
CHECKED |= {"table": short("table", 4), "two dominoes": short("sprint-thickness", 2)}


@pytest.mark.parametrize(
    ("id_", "scene"),
    [*product(IDS, CHECKED.values()), (IDS[0], small_scenes())],
    ids=[*map(", ".join, product(IDS, CHECKED)), "sampled scenes"],
)
def test_environments_pass_the_checkers_of_gymnasium_and_sb3(id_, scene):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = gymnasium.make(id_, scene=scene)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
        checker.check_env(env, skip_render_check=True)


@pytest.mark.parametrize("kind", [*KINDS, de.DominoChainVector])
@pytest.mark.parametrize("copied", [copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))])
def test_a_copy_is_independent(kind, copied):
    env = kind(scene="gentle")
    env.reset(seed=1)
    rng = np.random.default_rng(0)
    for _ in range(0 if env.longest_episode == 1 else 5):
        env.step(rng.uniform(0.0, 1.0, env.action_space.shape))
    twin = copied(env)
    action = rng.uniform(0.0, 1.0, env.action_space.shape)
    answer, same = env.step(action), twin.step(action)
    for one, other in zip(answer[:4], same[:4], strict=True):
        np.testing.assert_array_equal(one, other)
    env.reset()
    which = (0,) if kind is de.DominoChainVector else ()
    assert twin.snapshot(*which).hit > env.snapshot(*which).hit


def test_the_last_info_can_be_kept_and_copied():
    env = de.DominoChain("sprint")
    *_, info = play(env, at_random(env, np.random.default_rng(0)))
    layout, wave = info["layout"], info["wave"]
    kept = pickle.loads(pickle.dumps((layout, wave)))  # before either is computed
    play(env, at_random(env, np.random.default_rng(1)))  # other chains in the same arrays
    assert env.scene.score(wave) == info["score"]
    assert kept == (layout, wave)
    assert copy.deepcopy(wave) == wave
    assert hash(kept[0]) == hash(layout)


def test_infos_of_processes_equal_those_of_one_process():
    """Those of processes are pickled, and contain nothing of other environments."""
    infos = []
    for mode in ("sync", "async", "vector_entry_point"):
        envs = gymnasium.make_vec("DominoLayout-v2", 3, mode, scene=short("gentle"))
        envs.reset(seed=0)
        infos.append(envs.step(np.zeros(envs.action_space.shape, np.float32))[4])
        envs.close()
    assert len(pickle.dumps(infos[2]["wave"][1])) < 3000
    for key in ("layout", "wave"):
        assert data_equivalence(infos[0][key], infos[1][key], exact=True)
        assert data_equivalence(infos[0][key], infos[2][key], exact=True)
