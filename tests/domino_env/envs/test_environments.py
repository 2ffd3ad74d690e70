"""DominoChain-v0 and DominoLayout-v0, one row at a time."""

import copy
import pickle
import subprocess
import sys
import warnings
from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

import domino_env as de
from domino_env import DominoChain, DominoLayout
from domino_env.scenes.objectives.base import Limits
from domino_env.scenes.rules import Stock

SCENES = de.scene_names()
BOTH = ("DominoChain-v0", "DominoLayout-v0")


@pytest.fixture(autouse=True)
def quick_marks(monkeypatch):
    """Some row in place of the best uniform one, where finding that takes long."""
    search, found = de.Scene.uniform, {}

    def uniform(scene):
        if scene.name not in ("stock", "jitter", "table"):
            return search(scene)
        if scene not in found:
            gap, thickness = sum(scene.spacing) / 2, scene.thickness[0]
            if scene.stock is not None:
                thickness = scene.stock.without(scene.first_thickness).dominoes[: scene.count - 1]
            layout = scene.layout(gap, thickness)
            wave = scene.simulate(layout)
            found[scene] = de.UniformBaseline(layout, wave, scene.score(wave))
        return found[scene]

    monkeypatch.setattr(de.Scene, "uniform", uniform)


def short(name, count=7):
    """A scene with fewer dominoes, and as much less course."""
    scene = de.load_scene(name)
    length = scene.length and scene.length * (count - 1) / (scene.count - 1)
    return replace(scene, count=count, length=length)


def play(env, policy, **reset):
    """Actions, observations, rewards and the last info of one episode."""
    seen, info = env.reset(**reset)
    assert info == {}
    actions, observations, rewards = [], [seen], []
    over = False
    while not over:
        assert info == {}
        actions.append(policy(len(actions)))
        seen, reward, over, truncated, info = env.step(actions[-1])
        observations.append(seen)
        rewards.append(reward)
        assert truncated is False
    return np.array(actions), np.array(observations), np.array(rewards), info


def at_random(env, rng, low=-1.0, high=1.0):
    return lambda k: rng.uniform(low, high, env.action_space.shape)


def completed(scene, layout):
    """The layout with dominoes behind it, where its wave died before all were placed."""
    missing = scene.count - layout.count
    return de.Layout(
        np.r_[layout.spacing, np.full(missing, scene.spacing[1])],
        np.r_[layout.thickness, np.full(missing, scene.thickness[1])],
        scene.height,
        scene.width,
        scene.density,
    )


# what an episode is worth ------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["gentle", "course", "sprint-thickness", "ideal"])
def test_the_return_orders_rows_as_the_score_does(name):
    env, rng = DominoChain(name), np.random.default_rng(3)
    scene = env.scene
    returns, scores = [], []
    for episode in range(60):
        edge = rng.uniform(-1.0, 1.0, 2) if episode % 2 else (-1.0, 1.0)
        *_, rewards, info = play(env, at_random(env, rng, *np.sort(edge)))
        returns.append(rewards.sum())
        scores.append(scene.score(completed(scene, info["layout"])))
    returns, scores = np.array(returns), np.array(scores)
    failed = scores < 0.0
    if name == "gentle":
        assert 5 < failed.sum() < 55
    exact = 100.0 * (scores / scene.uniform().score - 1.0)
    np.testing.assert_allclose(returns, exact, rtol=0.0, atol=2e-4)
    order = np.argsort(scores)
    clear = np.diff(scores[order]) > 4e-6
    assert clear.sum() > 40
    assert np.all(np.diff(returns[order])[clear] > 0.0)
    assert np.all(returns[failed] < -100.0)
    assert np.all(returns[~failed] > -100.0)


def test_at_the_scenes_own_tolerance_the_return_is_the_score():
    env = DominoChain("gentle", rtol=1e-10)
    for seed in range(20):
        *_, rewards, info = play(env, at_random(env, np.random.default_rng(seed)))
        score = env.scene.score(completed(env.scene, info["layout"]))
        assert info["score"] == score
        exact = 100.0 * (score / env.scene.uniform().score - 1.0)
        assert rewards.sum() == pytest.approx(exact, abs=1e-11)


@pytest.mark.parametrize("name", SCENES)
def test_the_last_step_tells_layout_wave_and_score(name):
    env = DominoChain(short(name, 12))
    scene = env.scene
    for seed in range(4):
        *_, info = play(env, at_random(env, np.random.default_rng(seed)))
        layout, wave = info["layout"], info["wave"]
        assert isinstance(layout, de.Layout)
        assert isinstance(wave, de.Wave)
        again = de.simulate(layout, scene.physics, rtol=1e-6)
        np.testing.assert_array_equal(wave.arrival_times, again.arrival_times)
        assert wave.layout == layout
        assert wave.outcome is info["outcome"] is again.outcome
        assert info["score"] == scene.score(wave)
        mark = scene.uniform().score
        if mark > 0.0:
            assert info["gain"] == pytest.approx(info["score"] / mark - 1.0, rel=1e-12)


def test_rows_that_a_step_cannot_judge_are_judged_at_the_end():
    # equal gaps take another way through the simulator; here no rule reaches the tolerance
    for env, policy in (
        (DominoChain("sprint"), lambda k: [-0.2]),
        (DominoChain("gentle", rtol=1e-13), lambda k: np.sin([1.0 + k, 2.0 * k])),
    ):
        *_, rewards, info = play(env, policy)
        again = de.simulate(info["layout"], env.scene.physics, rtol=info["wave"].rtol)
        assert info["score"] == env.scene.score(again)
        exact = 100.0 * (info["score"] / env.scene.uniform().score - 1.0)
        assert rewards.sum() == pytest.approx(exact, abs=1e-11)


def test_the_best_uniform_row_is_worth_nothing():
    env = DominoChain("sprint")
    gap = env.scene.uniform().layout.spacing[0]
    low, high = env.scene.spacing
    *_, rewards, info = play(env, lambda k: [2.0 * (gap - low) / (high - low) - 1.0])
    assert rewards.sum() == pytest.approx(0.0, abs=1e-6)
    assert info["gain"] == pytest.approx(0.0, abs=1e-8)


def test_single_steps_pay_the_lead_gained():
    env = DominoChain("sprint-thickness", reference_speed=0.5)
    rng = np.random.default_rng(0)
    *_, rewards, info = play(env, at_random(env, rng))
    layout, times = info["layout"], info["wave"].arrival_times
    lead = (layout.pitch - 0.5 * np.diff(times)) / env.scene.height
    np.testing.assert_allclose(rewards[:-1], lead[:-1], rtol=1e-9)


def test_the_reference_speed_moves_rewards_and_not_their_sum():
    env = DominoChain("sprint")
    assert env.reference_speed == env.scene.uniform().wave.mean_speed
    actions, *_, rewards, _ = play(env, at_random(env, np.random.default_rng(1)))

    def again(k):
        if k == 20:
            env.reference_speed = 0.9
        return actions[k]

    *_, moved, _ = play(env, again)
    np.testing.assert_array_equal(moved[:20], rewards[:20])
    assert np.all(moved[20:-1] < rewards[20:-1])
    assert moved.sum() == pytest.approx(rewards.sum(), abs=1e-10)
    for bad in (0.0, -1.0, np.nan, np.inf, [0.8, 0.9]):
        with pytest.raises(ValueError, match="reference_speed"):
            env.reference_speed = bad


# what is seen ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["sprint", "sprint-thickness", "course", "gentle", "hills"])
def test_observations_are_what_the_page_says(name):
    window, scene = 3, short(name, 9)
    env = DominoChain(scene, window=window)
    h, g, count = scene.height, scene.physics.gravity, scene.count
    for seed in range(3):
        _, observations, _, info = play(env, at_random(env, np.random.default_rng(seed)))
        layout, wave = info["layout"], info["wave"]
        for k, seen in enumerate(observations):
            died = k + 1 == len(observations) and wave.outcome != de.Outcome.PROPAGATED
            front, time = wave.release_velocity[k], wave.arrival_times[k]
            if k + 1 == count:  # the last domino is seen when it has tipped over
                front = seen[0] / np.sqrt(h / g)
                assert front > 0.0
            if died:
                front, time = 0.0, wave.arrival_times[np.isfinite(wave.arrival_times)][-1]
            way = layout.positions[k]
            expected = [
                front * np.sqrt(h / g),
                (way - env.reference_speed * time) / (10.0 * h),
                way / time / env.reference_speed - 1.0 if time > 0.0 else 0.0,
            ]
            if scene.length is not None:
                pitches = np.add(scene.spacing, scene.thickness)
                left, pairs = scene.length - way, count - 1 - k
                mean = np.interp(left / pairs, pitches, (-1.0, 1.0)) if pairs else 0.0
                expected += [left / scene.length, mean]
            for free, values, bounds in (
                (scene.free_spacing, layout.spacing[:k], scene.spacing),
                (scene.free_thickness, layout.thickness[1 : k + 1], scene.thickness),
            ):
                if free:
                    latest = np.interp(values[::-1][:window], bounds, (-1.0, 1.0))
                    expected += [*latest, *np.zeros(window - len(latest))]
            expected += [k / (count - 1)]
            expected += [np.exp(-k / c) for c in (1, 2, 4, 8)]
            expected += [np.exp(-(count - 1 - k) / c) for c in (1, 2, 4, 8)]
            if scene.ground is not None:
                here = layout.pivots[k, 0]
                ahead = here + np.arange(1, 1 + window) * (0.025 + 0.0075)
                up = scene.ground.height([ahead - 1e-5, ahead + 1e-5, ahead, 0.0 * ahead + here])
                expected += [*((up[0] - up[1]) / 2e-5 * h / 0.0075), *((up[2] - up[3]) / h)]
            np.testing.assert_allclose(seen, expected, rtol=2e-6, atol=3e-6)


def test_what_cannot_vary_is_not_seen():
    def entries(scene):
        return DominoChain(scene, window=4).observation_space.shape[0]

    assert entries("sprint") == 3 + 4 + 9
    assert entries("course") == 3 + 2 + 4 + 9
    assert entries("sprint-thickness") == 3 + 4 + 4 + 9
    assert DominoChain("sprint").action_space.shape == (1,)
    assert DominoChain("gentle").action_space.shape == (2,)
    fixed = replace(de.load_scene("gentle"), spacing=(0.02, 0.02))
    assert entries(fixed) == 3 + 4 + 9
    *_, info = play(DominoChain(fixed), lambda k: [0.5])
    np.testing.assert_allclose(info["layout"].thickness[1:], 0.005 + 0.75 * 0.009)
    np.testing.assert_array_equal(info["layout"].spacing, 0.02)


# what may be chosen ------------------------------------------------------------------------------


def courses():
    course = de.load_scene("course")
    free = replace(course, thickness=(0.004, 0.012), first_thickness=0.0075)
    return [
        course,
        replace(course, length=59 * (0.0075 + 0.002) + 1e-4),  # hardly anything to choose
        replace(course, length=59 * (0.0075 + 0.040)),  # nothing
        free,
        replace(free, spacing=(0.01, 0.01)),
    ]


@pytest.mark.parametrize("scene", courses(), ids=["course", "tight", "stretched", "free", "thick"])
@pytest.mark.parametrize("kind", [DominoChain, DominoLayout])
def test_every_row_has_the_length_asked_for(scene, kind):
    env, rng = kind(scene), np.random.default_rng(5)
    policies = [at_random(env, rng) for _ in range(5)]
    policies += [at_random(env, rng, edge, edge) for edge in (-1.0, 1.0, -7.0, 7.0)]
    policies += [lambda k: rng.choice([-1.0, 1.0], env.action_space.shape)] * 5
    for policy in policies:
        *_, info = play(env, policy)
        if info["layout"].count == scene.count:
            assert scene.violations(info["layout"]) == []


def test_bounds_ahead_are_reached_by_the_ends_of_the_action():
    env, rng = DominoChain(courses()[3]), np.random.default_rng(6)
    env.reset()
    for k in range(env.scene.count - 1):
        ahead = env.bounds_ahead()
        for edge in (0, 1):
            twin = copy.deepcopy(env)
            side = 2.0 * edge - 1.0
            twin.step([side, 0.0])
            twin.step([side, side]) if k < env.scene.count - 2 else None
            snapshot = twin.snapshot()
            assert snapshot.spacing[k] == pytest.approx(ahead["spacing"][edge], abs=1e-15)
            twin = copy.deepcopy(env)
            twin.step([0.0, side])
            assert twin.snapshot().thickness[k + 1] == ahead["thickness"][edge]
        env.step(rng.uniform(-1.0, 1.0, 2))


def test_actions_stand_for_what_the_page_says():
    env = DominoChain("sprint-thickness")
    env.reset()
    for action, gap, thickness in (
        ([1.0, -1.0], 0.040, 0.004),
        ([0.0, 0.5], 0.021, 0.010),
        ([-3.0, 9.0], 0.002, 0.012),
        ([-1.0, 1.0], 0.002, 0.012),
    ):
        env.step(action)
        snapshot = env.snapshot()
        assert snapshot.spacing[-1] == pytest.approx(gap, rel=1e-14)
        assert snapshot.thickness[-1] == pytest.approx(thickness, rel=1e-14)


# beginning ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["sprint-thickness", "course", "hills"])
def test_an_episode_goes_on_from_a_row_that_stands(name):
    env = DominoChain(name)
    actions, observations, rewards, info = play(env, at_random(env, np.random.default_rng(8)))
    whole = info["layout"]
    for given in (1, 2, 17, len(actions) - 1):
        start = de.Layout(
            whole.spacing[:given], whole.thickness[: given + 1],
            rise=whole.rise[:given], tilt=whole.tilt[: given + 1],
        )  # fmt: skip
        rest = iter(actions[given:])
        _, seen, paid, told = play(env, lambda k, rest=rest: next(rest), options={"layout": start})
        np.testing.assert_array_equal(seen, observations[given:])
        np.testing.assert_allclose(paid, rewards[given:], rtol=0.0, atol=1e-12)
        assert told["score"] == info["score"]


def test_rows_that_cannot_be_gone_on_from_are_refused():
    env = DominoChain("gentle")
    scene = env.scene
    env.reset()
    env.step([0.0, 0.0])
    before = env.snapshot()
    for start, words in (
        (scene.layout(0.02, 0.006), "at least one of the scene's 30 must be left"),
        (de.Layout([0.03], 0.0075), r"spacing\[0\] = 0.03 m: the scene allows 0.002 to 0.025 m"),
        (de.Layout([0.02], [0.009, 0.0075]), "the first domino is the scene's"),
        (de.Layout([0.02], 0.0075, 0.06), r"height\[0\] = 0.06"),
        (de.Layout([0.002] * 9, [0.0075] + [0.014] * 9), "its wave stops: the wave stalled"),
    ):
        with pytest.raises(ValueError, match=words):
            env.reset(options={"layout": start})
    after = env.snapshot()  # nothing has happened to the row
    assert after.time == before.time
    np.testing.assert_array_equal(after.spacing, before.spacing)
    course = DominoChain("course")
    with pytest.raises(ValueError, match="m of the length for 29 dominoes, which cover"):
        course.reset(options={"layout": de.Layout([0.04] * 30, 0.0075)})
    with pytest.raises(ValueError, match="unknown reset option 'spacing': allowed: layout"):
        env.reset(options={"spacing": [0.01]})


def test_the_seed_changes_nothing_and_the_global_stream_stays_untouched():
    before = np.random.get_state()[1].copy()  # noqa: NPY002 - it is what must not move
    first, second = (DominoChain("sprint").reset(seed=s)[0] for s in (1, 2))
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(before, np.random.get_state()[1])  # noqa: NPY002
    env = DominoChain("sprint")
    env.reset(seed=9)
    assert env.np_random_seed == 9
    assert env.np_random.random() == np.random.default_rng(9).random()


# the whole row as one action ---------------------------------------------------------------------


@pytest.mark.parametrize("name", SCENES)
def test_a_whole_row_is_worth_what_its_score_says(name):
    env = DominoLayout(short(name, 10))
    scene, rng = env.scene, np.random.default_rng(2)
    for _ in range(5):
        _, observations, rewards, info = play(env, at_random(env, rng))
        assert observations.tolist() == [[0.0], [1.0]]
        assert len(rewards) == 1
        assert scene.violations(info["layout"]) == []
        assert info["score"] == scene.score(info["wave"])
        assert info["score"] == pytest.approx(scene.score(info["layout"]), rel=2e-6)
        assert rewards[0] == pytest.approx(100.0 * info["gain"], rel=1e-12)
        mark = scene.uniform().score
        if mark > 0.0:
            assert info["gain"] == pytest.approx(info["score"] / mark - 1.0)


def test_both_environments_agree_on_a_row():
    chain, whole = DominoChain("gentle"), DominoLayout("gentle")
    rng = np.random.default_rng(4)
    for _ in range(10):
        actions, _, rewards, info = play(chain, at_random(chain, rng))
        if info["outcome"] == de.Outcome.PROPAGATED:
            _, _, worth, told = play(whole, lambda k, a=actions: a.T.ravel())
            assert told["layout"] == info["layout"]
            assert told["score"] == info["score"]
            assert worth.sum() == pytest.approx(rewards.sum(), abs=1e-11)


def test_a_length_is_met_by_the_nearest_row():
    env = DominoLayout("course")
    rng = np.random.default_rng(11)
    low, high = env.scene.spacing
    total = env.scene.length - 59 * 0.0075
    for _ in range(20):
        action = rng.uniform(-2.0, 2.0, 59)
        *_, info = play(env, lambda k, a=action: a)
        wanted = low + 0.5 * (np.clip(action, -1.0, 1.0) + 1.0) * (high - low)
        gaps = info["layout"].spacing
        # the nearest point moves all that are between their bounds alike, and none past it
        shift = gaps - wanted
        inner = (gaps > low + 1e-12) & (gaps < high - 1e-12)
        assert np.ptp(shift[inner]) < 1e-12
        common = shift[inner].mean()
        assert np.all(np.clip(wanted + common, low, high) == pytest.approx(gaps, abs=1e-12))
        assert gaps.sum() == pytest.approx(total, abs=1e-12)


# scenes that ask more ----------------------------------------------------------------------------


def demanding():
    """Scenes with every rule and objective beyond bounds and a length, by name."""
    thick, gentle = short("sprint-thickness", 9), short("gentle", 6)
    grid = tuple((np.arange(4, 81) * 0.0005).tolist())
    return {
        "grid": replace(thick, spacing_values=grid, thickness_values=(0.004, 0.0075, 0.012)),
        "smooth": replace(thick, largest_change=0.003),
        "smooth grid": replace(thick, largest_change=0.0031, spacing_values=grid),
        "stock": replace(
            short("stock", 9), name="box", stock=Stock((0.01, 0.005, 0.0075), (3, 4, 2))
        ),
        "limits": replace(thick, limits=Limits(0.5, 0.3)),
        "deadly limits": replace(gentle, limits=Limits(0.5, 0.3)),
        "toppled": replace(gentle, objective="toppled"),
        "magnify": short("magnify", 8),
        "tempo": short("tempo", 8),
        "jitter": replace(short("jitter", 8), name="few draws",
                          settings=de.load_scene("jitter").placement.replace(draws=8)),
        "time": replace(short("course", 8), objective="time"),
    }  # fmt: skip


DEMANDING = demanding()


@pytest.mark.parametrize("kind", [DominoChain, DominoLayout])
@pytest.mark.parametrize("name", DEMANDING)
def test_all_rules_are_kept_and_all_objectives_paid(name, kind):
    env, rng = kind(DEMANDING[name]), np.random.default_rng(7)
    scene, mark = env.scene, env.scene.uniform().score
    whole, returns, scores = 0, [], []
    for episode in range(30):
        edge = (-1.0, 1.0) if episode % 3 else np.sort(rng.uniform(-1.5, 1.5, 2))
        _, observations, rewards, info = play(env, at_random(env, rng, *edge))
        for seen in observations:
            assert seen in env.observation_space
        layout = info["layout"]
        exact = 100.0 * (info["score"] - mark) / abs(mark)
        assert rewards.sum() == pytest.approx(exact, abs=1e-9)
        if scene.objective in ("tempo", "toppled", "magnify"):
            assert not rewards[:-1].any()
        if layout.count < scene.count:
            assert info["outcome"] != de.Outcome.PROPAGATED
            if scene.placement is None and scene.growth is None:
                layout = completed(scene, layout)
                assert info["score"] == pytest.approx(scene.score(
                    scene.simulate(layout, 1e-6)), abs=1e-12)  # fmt: skip
            continue
        whole += 1
        assert scene.violations(layout) == []
        assert info["score"] == scene.score(scene.simulate(layout, 1e-6))
        returns.append(rewards.sum())
        scores.append(scene.score(layout))
    assert whole >= 5
    order = np.argsort(scores)
    clear = np.diff(np.array(scores)[order]) > 1e-5
    assert np.all(np.diff(np.array(returns)[order])[clear] > 0.0)


def test_a_box_empties_and_the_nearest_left_is_taken():
    env = DominoChain(DEMANDING["stock"])
    seen, _ = env.reset()
    np.testing.assert_array_equal(seen[-12:-9], 1.0)  # thin to thick; the first is taken out
    taken = []
    for _ in range(8):
        seen, *_ = env.step([0.5, 1.0])
        taken.append(env.snapshot().thickness[-1])
        left = [4 - taken.count(0.005), 1 - taken.count(0.0075), 3 - taken.count(0.01)]
        np.testing.assert_allclose(seen[-12:-9], np.array(left) / (4, 1, 3))
    assert taken == [0.01] * 3 + [0.0075] + [0.005] * 4
    start = de.Layout([0.02] * 3, [0.0075, 0.005, 0.01, 0.005])
    seen, _ = env.reset(options={"layout": start})
    np.testing.assert_allclose(seen[-12:-9], [0.5, 1.0, 2 / 3])
    with pytest.raises(ValueError, match=r"4 dominoes are 0\.0075 m thick: the stock has 2"):
        env.reset(options={"layout": de.Layout([0.02] * 3, 0.0075)})


def test_growing_rows_are_seen_in_their_own_measure():
    env = DominoChain(DEMANDING["magnify"], window=2)
    assert env.action_space.shape == (2,)
    env.reset()
    env.step([0.5, -0.5])
    seen, *_ = env.step([-0.25, 1.0])
    snapshot = env.snapshot()
    ratio = snapshot.height[1:] / snapshot.height[:-1]
    np.testing.assert_allclose(ratio, [1.15, 1.6])
    np.testing.assert_allclose(snapshot.thickness, 0.15 * snapshot.height)
    np.testing.assert_allclose(
        snapshot.spacing / snapshot.height[:-1], 0.05 + 0.85 * np.array([0.75, 0.375])
    )
    np.testing.assert_allclose(seen[3:7], [-0.25, 0.5, 1.0, -0.5], atol=1e-6)
    most = 7 * np.log(1.6)
    assert seen[7] == pytest.approx(np.log(1.15 * 1.6) / most, rel=1e-6)
    start = de.Layout(snapshot.spacing, snapshot.thickness, snapshot.height)
    again, _ = env.reset(options={"layout": start})
    np.testing.assert_allclose(again, seen, rtol=1e-6)


def test_rules_that_cannot_be_kept_domino_by_domino_are_refused():
    both = replace(de.load_scene("course"), largest_change=0.001)
    for kind in (DominoChain, DominoLayout):
        with pytest.raises(ValueError, match="a length and for lists, a stock or a largest change"):
            kind(both)


# errors ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [DominoChain, DominoLayout])
def test_bad_use_is_told_what_is_wrong(kind):
    with pytest.raises(ValueError, match="no scene 'sprnt': did you mean 'sprint'"):
        kind("sprnt")
    with pytest.raises(ValueError, match="render_mode = 'film': choose None or one of rgb_array"):
        kind("sprint", render_mode="film")
    with pytest.raises(ValueError, match=r"rtol = 0\.1: give a finite number from 1e-13 to 0.001"):
        kind("sprint", rtol=0.1)
    nothing = replace(de.load_scene("sprint"), spacing=(0.02, 0.02))
    with pytest.raises(ValueError, match="leaves nothing free"):
        kind(nothing)
    env = kind("gentle")
    size = env.action_space.shape[0]
    with pytest.raises(ResetNeeded, match=r"call reset\(\) before"):
        env.step(np.zeros(size))
    env.reset()
    with pytest.raises(ValueError, match=rf"action of shape \(3,\): expected \({size},\)"):
        env.step(np.zeros(3))
    bad = np.zeros(size)
    bad[1] = np.nan
    with pytest.raises(ValueError, match=r"action\[1\] = nan: every entry must be finite"):
        env.step(bad)
    over = False
    while not over:
        over = env.step(np.zeros(size))[2]
    with pytest.raises(ResetNeeded, match=r"call reset\(\)"):
        env.step(np.zeros(size))


def test_a_window_is_a_number_of_dominoes():
    with pytest.raises(ValueError, match=r"window = -1: give a whole number, at least 0"):
        DominoChain("sprint", window=-1)
    assert DominoChain("sprint", window=0).observation_space.shape == (12,)
    assert DominoChain(short("sprint", 4), window=99).observation_space.shape == (3 + 3 + 9,)


def test_drawing_without_a_mode_warns():
    env = DominoChain("sprint")
    env.reset()
    with pytest.warns(UserWarning, match=r"render\(\) shows nothing without a render mode"):
        assert env.render() is None


# others' tools -----------------------------------------------------------------------------------


def quick(name):
    """A scene, short where a score takes long."""
    return short(name, 4) if name == "table" else name


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("id_", BOTH)
def test_gymnasiums_checker_is_content(id_, name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(id_, scene=quick(name)).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("id_", BOTH)
def test_stable_baselines_checker_is_content(id_, name):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(gymnasium.make(id_, scene=quick(name)), skip_render_check=True)


def test_scenes_of_two_dominoes_end_with_their_first_step():
    for kind in (DominoChain, DominoLayout):
        env = kind(short("sprint-thickness", 2))
        check_env(env, skip_render_check=True)
        *_, rewards, info = play(env, lambda k: [0.0, 0.0])
        assert len(rewards) == 1
        assert info["layout"].count == 2


@pytest.mark.parametrize("kind", [DominoChain, DominoLayout])
@pytest.mark.parametrize("way", [copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))])
def test_a_copy_goes_its_own_way(kind, way):
    env = kind("gentle")
    env.reset(seed=1)
    rng = np.random.default_rng(0)
    if kind is DominoChain:
        for _ in range(5):
            env.step(rng.uniform(0.0, 1.0, 2))
    twin = way(env)
    action = rng.uniform(0.0, 1.0, env.action_space.shape)
    told, same = env.step(action), twin.step(action)
    np.testing.assert_array_equal(told[0], same[0])
    assert told[1:4] == same[1:4]
    env.reset()
    assert twin.snapshot().hit > env.snapshot().hit


def test_what_is_told_at_the_end_can_be_kept_and_copied():
    env = DominoChain("sprint")
    *_, info = play(env, at_random(env, np.random.default_rng(0)))
    layout, wave = info["layout"], info["wave"]
    kept = pickle.loads(pickle.dumps((layout, wave)))  # before anybody has looked
    play(env, at_random(env, np.random.default_rng(1)))  # other rows in the same arrays
    assert env.scene.score(wave) == info["score"]
    assert kept == (layout, wave)
    assert copy.deepcopy(wave) == wave
    assert hash(kept[0]) == hash(layout)
    assert replace(wave, reach=0.5).reach == 0.5
    with pytest.raises(AttributeError, match="no attribute 'speed'"):
        wave.speed  # noqa: B018 - reading it is the test


def test_gymnasiums_wrappers_work():
    env = gymnasium.make("DominoChain-v0", scene="sprint")
    env = gymnasium.wrappers.RecordEpisodeStatistics(env)
    env = gymnasium.wrappers.NormalizeObservation(env)
    env = gymnasium.wrappers.FrameStackObservation(env, 3)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    over = False
    while not over:
        seen, _, over, truncated, info = env.step(rng.uniform(-1, 1, 1).astype(np.float32))
        assert not truncated
    assert seen.shape == (3, *env.unwrapped.observation_space.shape)
    assert info["episode"]["l"] == 39
    assert info["episode"]["r"] == pytest.approx(100.0 * info["gain"], abs=1e-3)
    short_one = gymnasium.wrappers.TimeLimit(gymnasium.make("DominoChain-v0"), 5)
    short_one.reset()
    steps = [short_one.step(np.zeros(1, np.float32)) for _ in range(5)]
    assert [s[3] for s in steps] == [False] * 4 + [True]


def test_the_environments_are_known_in_whatever_order_things_are_imported():
    known = "assert {'DominoChain-v0', 'DominoLayout-v0'} < set(gymnasium.registry)"
    for script in (
        "import domino_env, gymnasium; " + known,
        "import gymnasium, domino_env; " + known,
        "import gymnasium.vector, domino_env; " + known,
        "import domino_env, gymnasium, importlib; importlib.reload(domino_env); " + known,
        "import gymnasium; gymnasium.make('domino_env:DominoChain-v0', scene='gentle').reset()",
    ):
        words = [sys.executable, "-W", "error", "-c", script]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
