"""Many rows at once are the same as each alone, to the last bit."""

import copy
import pickle
from dataclasses import fields, replace

import gymnasium
import numba
import numpy as np
import pytest
from drawn_scenes import small_scenes
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import domino_env as de
from domino_env import DominoChain, DominoChainVector, DominoLayout, DominoLayoutVector
from domino_env.envs import episodes
from domino_env.scenes.objectives.base import Limits
from domino_env.scenes.objectives.robust import Placement
from domino_env.scenes.objectives.tempo import Tempo
from domino_env.scenes.rules import Stock

NEXT, SAME, OFF = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED


def scenes():
    gentle, course = de.load_scene("gentle"), de.load_scene("course")
    return {
        "sprint": de.load_scene("sprint"),
        "gentle": gentle,
        "course": replace(course, count=13, length=12 * 0.0203),
        "ideal": replace(de.load_scene("ideal"), count=9),
        "two": replace(gentle, count=2),
        "three": replace(gentle, count=3),
        "growing": replace(de.load_scene("magnify"), count=7),
        "box": replace(
            de.load_scene("stock"), count=7, stock=Stock((0.01, 0.005, 0.0075), (3, 2, 2))
        ),
        "limits": replace(gentle, count=6, limits=Limits(0.3, 0.3)),
        "stepped": replace(
            de.load_scene("sprint"), count=6, spacing_values=(0.01, 0.02, 0.03), largest_change=0.01
        ),
    }


SCENES = scenes()
DRAWN = {"small": small_scenes(), "varied": de.load_distribution("varied")}


def policies(rng, shape):
    """What rows may be asked to do, without end; it may change with every step."""
    kind = rng.integers(4, size=shape[0])
    centre = rng.uniform(-1.0, 1.0, shape)
    while True:
        wild = rng.uniform(-1.5, 1.5, shape)
        edge = rng.choice([-1.0, 1.0], shape)
        near = centre + rng.normal(0.0, 0.05, shape)
        actions = np.choose(kind[:, None], [wild, edge, near, np.broadcast_to(centre, shape)])
        yield actions.astype(np.float32)


def assert_same(mine, theirs):
    """Two answers of a vector environment, or parts of them, agree bit for bit."""
    assert type(mine) is type(theirs)
    if isinstance(mine, dict):
        assert set(mine) == set(theirs)
        for key in mine:
            assert_same(mine[key], theirs[key])
    elif isinstance(mine, tuple):
        for one, other in zip(mine, theirs, strict=True):
            assert_same(one, other)
    elif isinstance(mine, np.ndarray) and mine.dtype == object:
        assert mine.shape == theirs.shape
        for one, other in zip(mine, theirs, strict=True):
            assert_same(one, other)
    elif isinstance(mine, np.ndarray):
        assert mine.dtype == theirs.dtype
        np.testing.assert_array_equal(mine, theirs)
    else:
        assert mine == theirs


KINDS = {"chain": (DominoChainVector, DominoChain), "layout": (DominoLayoutVector, DominoLayout)}


def pair(kind, scene, rows, mode, **arguments):
    """Our rows together, and the same rows one by one in Gymnasium's own vector environment."""
    together, alone = KINDS[kind]
    mine = together(rows, scene, autoreset_mode=mode, **arguments)
    singles = [lambda: alone(scene, **arguments)] * rows
    return mine, SyncVectorEnv(singles, autoreset_mode=mode)


@pytest.mark.parametrize("mode", [NEXT, SAME], ids=["next step", "same step"])
@pytest.mark.parametrize("name", [*SCENES, *DRAWN])
def test_together_and_alone_agree_across_the_ends_of_episodes(name, mode):
    rng = np.random.default_rng(len(name))
    mine, theirs = pair("chain", (SCENES | DRAWN)[name], 7, mode, window=5, rtol=1e-5)
    assert mine.single_observation_space == theirs.single_observation_space
    assert mine.action_space == theirs.action_space
    assert mine.observation_space == theirs.observation_space
    assert_same(mine.reset(seed=3), theirs.reset(seed=3))
    ends = 0
    for step, actions in enumerate(policies(rng, mine.action_space.shape)):
        answer = mine.step(actions)
        assert_same(answer, theirs.step(actions))
        ends += answer[2].sum()
        if step == 50:
            mine.reference_speed = 1.3
            theirs.set_attr("reference_speed", 1.3)
        if ends >= 28 and step > 60:
            break


WHOLE = SCENES | {
    "gaps and thicknesses over a course": replace(
        SCENES["course"], thickness=(0.004, 0.012), first_thickness=0.0075
    ),
    "thicknesses over a course": replace(
        SCENES["course"], thickness=(0.004, 0.012), spacing=(0.0118, 0.0118)
    ),
    "on schedule": replace(
        de.load_scene("tempo"), count=6, settings=Tempo(30.0, 40.0), spacing=(0.002, 0.03)
    ),
    "placed with errors": replace(
        de.load_scene("jitter"), count=6, settings=Placement(0.0005, draws=8)
    ),
}


@pytest.mark.parametrize("mode", [NEXT, SAME, OFF], ids=["next step", "same step", "disabled"])
@pytest.mark.parametrize("name", WHOLE)
def test_whole_rows_together_and_alone_agree_across_the_ends_of_episodes(name, mode):
    rng = np.random.default_rng(len(name))
    mine, theirs = pair("layout", WHOLE[name], 5, mode, rtol=1e-5)
    assert mine.single_observation_space == theirs.single_observation_space
    assert mine.action_space == theirs.action_space
    assert mine.observation_space == theirs.observation_space
    assert_same(mine.reset(seed=3), theirs.reset(seed=3))
    draw, over = policies(rng, mine.action_space.shape), np.zeros(5, np.bool_)
    for step in range(9):
        mask = rng.random(5) < 0.3 if step % 3 == 2 else np.zeros(5, np.bool_)
        if mode == OFF:
            mask |= over
        if mask.any():  # from now on rows need not end together
            options = [{"reset_mask": mask.copy()} for _ in range(2)]
            assert_same(mine.reset(options=options[0]), theirs.reset(options=options[1]))
        actions = next(draw)
        answer = mine.step(actions)
        assert_same(answer, theirs.step(actions))
        over = answer[2]


@pytest.mark.parametrize("name", ["gentle", "growing", "limits"])
def test_waves_of_whole_rows_are_those_of_simulate(name):
    env = DominoLayoutVector(6, SCENES[name], autoreset_mode=SAME)
    env.reset()
    draw = policies(np.random.default_rng(4), env.action_space.shape)
    infos = env.step(next(draw))[4]["final_info"]
    assert len({wave.outcome for wave in infos["wave"]} | {de.Outcome.PROPAGATED}) > 1
    for layout, wave, score in zip(infos["layout"], infos["wave"], infos["score"], strict=True):
        alone = de.simulate(layout, env.scene.physics, rtol=1e-6)
        for field in fields(de.Wave):
            if field.name not in ("run_time", "layout"):
                np.testing.assert_equal(getattr(wave, field.name), getattr(alone, field.name))
        assert wave.layout == layout
        assert score == env.scene.score(alone)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("number", [1, 4])
def test_no_row_is_simulated_twice(kind, number, monkeypatch):
    env = KINDS[kind][0](number, SCENES["limits"], render_mode="ansi")  # scored as a whole
    env.reset()
    calls = []
    for name in ("simulate", "simulate_batch"):
        known = getattr(episodes, name)

        def counted(*arguments, known=known, **named):
            calls.append(known)
            return known(*arguments, **named)

        monkeypatch.setattr(episodes, name, counted)
    ended = np.zeros(number, np.bool_)
    while not ended.any():
        _, _, ended, _, infos = env.step(np.zeros(env.action_space.shape))
    assert len(calls) == 1
    env.render()
    assert all(wave.mean_speed >= 0.0 for wave in infos["wave"])
    assert len(calls) == 1


@pytest.mark.parametrize("name", ["gentle", "small"])
@pytest.mark.parametrize("mode", [NEXT, SAME, OFF], ids=["next step", "same step", "disabled"])
def test_some_rows_may_begin_anew_while_others_go_on(mode, name):
    rng = np.random.default_rng(12)
    mine, theirs = pair("chain", (SCENES | DRAWN)[name], 6, mode)
    assert_same(mine.reset(seed=1), theirs.reset(seed=1))
    over, ends = np.zeros(6, np.bool_), 0
    for step, actions in enumerate(policies(rng, mine.action_space.shape)):
        mask = rng.random(6) < 0.1
        if mode == OFF:
            mask |= over
        if mask.any():
            options = [{"reset_mask": mask.copy()} for _ in range(2)]
            assert_same(mine.reset(options=options[0]), theirs.reset(options=options[1]))
        answer = mine.step(actions)
        assert_same(answer, theirs.step(actions))
        over = answer[2]
        ends += over.sum()
        if ends > 20 and step > 30:
            break


def test_final_observations_and_infos_are_those_of_the_end():
    env = DominoChainVector(3, "sprint", autoreset_mode=SAME)
    first, _ = env.reset()
    rng = np.random.default_rng(0)
    for step in range(39):
        seen, rewards, ended, truncated, infos = env.step(rng.uniform(-1, 1, (3, 1)))
        assert ended.all() == (step == 38)
        assert not truncated.any()
    np.testing.assert_array_equal(seen, first)
    told = infos["final_info"]
    for i in range(3):
        last = infos["final_obs"][i]
        assert last[-9] == 1.0  # all are placed
        speed = told["wave"][i].mean_speed
        assert told["score"][i] == speed
        assert last[2] == pytest.approx(speed / env.reference_speed - 1.0, rel=1e-5)
    kept = infos["final_obs"][0].copy(), told["layout"][0].spacing.copy(), rewards.copy()
    for _ in range(50):
        env.step(rng.uniform(-1, 1, (3, 1)))
    np.testing.assert_array_equal(infos["final_obs"][0], kept[0])
    np.testing.assert_array_equal(told["layout"][0].spacing, kept[1])
    np.testing.assert_array_equal(rewards, kept[2])


def test_threads_change_nothing():
    threads = numba.get_num_threads()
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("one thread is all there is")
    answers = []
    for number in (1, 2):
        numba.set_num_threads(number)
        env = DominoChainVector(300, SCENES["gentle"], autoreset_mode=SAME)
        env.reset()
        draw = policies(np.random.default_rng(1), env.action_space.shape)
        answers.append([env.step(next(draw)) for _ in range(40)])
    numba.set_num_threads(threads)
    for one, other in zip(*answers, strict=True):
        assert_same(one[:4], other[:4])


def test_rows_begin_where_they_are_told_to():
    scene = SCENES["gentle"]
    env = DominoChainVector(3, scene)
    starts = [scene_start(4), None, scene_start(9)]
    seen, _ = env.reset(options={"layout": starts})
    for row, start in enumerate(starts):
        alone = DominoChain(scene)
        expected, _ = alone.reset(options=None if start is None else {"layout": start})
        np.testing.assert_array_equal(seen[row], expected)
    both, _ = env.reset(options={"layout": starts[0], "reset_mask": np.array([False, True, False])})
    np.testing.assert_array_equal(both, seen[[0, 0, 2]])
    with pytest.raises(ValueError, match="2 layouts to start from: give one for all, or one for"):
        env.reset(options={"layout": starts[:2]})
    with pytest.raises(ValueError, match=r"the layout to start from: .* the scene allows"):
        env.reset(options={"layout": [None, None, de.Layout([0.03], 0.0075)]})


def scene_start(gaps):
    return de.Layout(np.full(gaps, 0.02), 0.0075)


def test_every_row_has_its_own_seed():
    env = DominoChainVector(3, "sprint")
    env.reset(seed=5)
    assert env.np_random_seed == (5, 6, 7)
    assert env.np_random[2].random() == np.random.default_rng(7).random()
    env.reset(seed=[1, None, 2])
    assert env.np_random_seed == (1, 6, 2)
    env.reset(seed=20, options={"reset_mask": np.array([False, True, False])})
    assert env.np_random_seed == (1, 21, 2)
    for bad, words in (
        ([1, 2], "2 seeds for 3 environments"),
        ([1, 2, -3], "seed = -3"),
        (-1, "seed = -1"),
    ):
        with pytest.raises(ValueError, match=words):
            env.reset(seed=bad)


def test_what_is_returned_is_not_written_again():
    env = DominoChainVector(4, "sprint")
    first, _ = env.reset()
    kept, answers = first.copy(), []
    for _ in range(3):
        answer = env.step(np.zeros((4, 1)))
        answers.append((answer, copy.deepcopy(answer)))
        answer[0][:] += 0.0
    np.testing.assert_array_equal(first, kept)
    for answer, before in answers:
        assert_same(answer, before)
    answers[-1][0][0][:] = 7.0  # what others do to it is no matter
    seen, _ = env.reset(options={"reset_mask": np.array([True, False, False, False])})
    np.testing.assert_array_equal(seen[1:], answers[-1][1][0][1:])


def test_gymnasium_makes_it_and_wraps_it():
    env = gymnasium.make_vec("DominoChain-v0", num_envs=4, scene="sprint", autoreset_mode=SAME)
    assert isinstance(env.unwrapped, DominoChainVector)
    assert env.metadata["autoreset_mode"] is SAME
    env = gymnasium.wrappers.vector.RecordEpisodeStatistics(env)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(39):
        *_, infos = env.step(rng.uniform(-1, 1, (4, 1)).astype(np.float32))
    gain = infos["final_info"]["gain"]
    np.testing.assert_allclose(infos["episode"]["r"], 100.0 * gain, atol=1e-3)
    listed = gymnasium.make_vec("DominoChain-v0", num_envs=2, scene="gentle")
    listed = gymnasium.wrappers.vector.DictInfoToList(listed)
    listed.reset()
    told = []
    while not any(told):
        *_, told = listed.step(-np.ones((2, 2), np.float32))
    assert set(told[0]) == {"score", "gain", "outcome", "layout", "wave"}
    whole = gymnasium.make_vec("DominoLayout-v0", num_envs=2, scene="sprint")
    whole.reset()
    assert isinstance(whole.unwrapped, DominoLayoutVector)
    assert whole.step(np.zeros((2, 39), np.float32))[2].all()


@pytest.mark.parametrize("name", ["gentle", "small"])
@pytest.mark.parametrize("way", [copy.deepcopy, lambda e: pickle.loads(pickle.dumps(e))])
def test_a_copy_goes_its_own_way(way, name):
    env = DominoChainVector(3, (SCENES | DRAWN)[name])
    env.reset(seed=4)
    draw = policies(np.random.default_rng(2), env.action_space.shape)
    for _ in range(6):
        env.step(next(draw))
    twin = way(env)
    for _ in range(30):
        actions = next(draw)
        assert_same(env.step(actions), twin.step(actions))


def test_bad_use_is_told_what_is_wrong():
    for number in (0, -1, 2.5):
        with pytest.raises(ValueError, match="num_envs"):
            DominoChainVector(number, "sprint")
    with pytest.raises(ValueError, match="render_mode = 'human': choose None or one of rgb_array"):
        DominoChainVector(2, "sprint", render_mode="human")
    env = DominoChainVector(2, "gentle", autoreset_mode=OFF)
    with pytest.raises(ResetNeeded, match=r"call reset\(\) before the first"):
        env.step(np.zeros((2, 2)))
    env.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ResetNeeded, match=r"call reset\(\) before the first"):
        env.step(np.zeros((2, 2)))
    env.reset()
    with pytest.raises(ValueError, match=r"action of shape \(2,\): expected \(2, 2\)"):
        env.step(np.zeros(2))
    with pytest.raises(ValueError, match=r"action\[1, 0\] = inf"):
        env.step(np.array([[0.0, 0.0], [np.inf, 0.0]]))
    for mask, kind, words in (
        ([True, False], TypeError, "is list: give a NumPy array"),
        (np.array([1, 0]), TypeError, "is int64: give a NumPy array"),
        (np.array([True]), ValueError, r"has shape \(1,\): expected \(2,\)"),
        (np.zeros(2, np.bool_), ValueError, "chooses no environment"),
    ):
        with pytest.raises(kind, match=words):
            env.reset(options={"reset_mask": mask})
    ended = np.zeros(2, np.bool_)
    while not ended.any():
        ended = env.step(np.array([[-1.0, 1.0], [0.5, -1.0]]))[2]
    with pytest.raises(ResetNeeded, match=r"environment \d is over: call reset"):
        env.step(np.zeros((2, 2)))
