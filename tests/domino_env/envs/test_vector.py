"""Vector environments are bitwise equal to single ones."""

import copy

import gymnasium
import numba
import numpy as np
import pytest
from env_scenes import SCENES, short
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from sampled_scenes import small_scenes

import domino_env as de
from domino_env import DominoChain, DominoChainVector, DominoLayout, DominoLayoutVector

NEXT, SAME, OFF = AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP, AutoresetMode.DISABLED
KINDS = {"chain": (DominoChainVector, DominoChain), "layout": (DominoLayoutVector, DominoLayout)}
GENTLE, COURSE = de.load_scene("gentle"), short("course", 13)
NAMES = (
    "sprint", "gentle", "limits", "few draws", "tempo-noise", "draw", "ideal",
    "hills", "two", "three", "magnify", "box", "tempo",
)  # fmt: skip
FIXED = {name: SCENES[name] for name in NAMES} | {
    "course": COURSE,
    "both over a course": COURSE.replace(thickness=(0.004, 0.012), first_thickness=0.0075),
    "thicknesses over a course": COURSE.replace(thickness=(0.004, 0.012), spacing=(0.0118, 0.0118)),
}
SAMPLED = {"small": small_scenes(), "varied": de.load_distribution("varied")}
CASES = [*[("chain", name) for name in FIXED | SAMPLED], *[("layout", name) for name in FIXED]]


def policies(rng, shape):
    """Yield actions of different policies side by side, without end."""
    kind = rng.integers(4, size=shape[0])
    centre = rng.uniform(-1.0, 1.0, shape)
    while True:
        wild = rng.uniform(-1.5, 1.5, shape)
        edge = rng.choice([-1.0, 1.0], shape)
        near = centre + rng.normal(0.0, 0.05, shape)
        actions = np.choose(kind[:, None], [wild, edge, near, np.broadcast_to(centre, shape)])
        yield actions.astype(np.float32)


def assert_same(together, alone):
    """Require that two answers of a vector environment, or parts of them, agree bit for bit."""
    assert type(together) is type(alone)
    if isinstance(together, dict):
        assert set(together) == set(alone)
        names = sorted(together)
        together, alone = (tuple(part[key] for key in names) for part in (together, alone))
    if isinstance(together, tuple) or getattr(together, "dtype", None) is np.dtype(object):
        for pair in zip(together, alone, strict=True):
            assert_same(*pair)
    elif isinstance(together, np.ndarray):
        np.testing.assert_array_equal(together, alone, strict=True)
    else:
        assert together == alone
        if isinstance(together, de.Wave):
            np.testing.assert_array_equal(together.arrival_times, alone.arrival_times)


@pytest.mark.parametrize("mode", [NEXT, SAME, OFF], ids=["next step", "same step", "disabled"])
@pytest.mark.parametrize(("kind", "name"), CASES)
def test_vector_and_single_environments_agree_across_episode_ends(kind, name, mode):
    together, alone = KINDS[kind]
    scene = (FIXED | SAMPLED)[name]
    window = {"window": 5} if kind == "chain" else {}
    batch = together(6, scene, autoreset_mode=mode, rtol=1e-5, **window)
    singles = SyncVectorEnv([lambda: alone(scene, rtol=1e-5, **window)] * 6, autoreset_mode=mode)
    for space in ("single_observation_space", "action_space", "observation_space"):
        assert getattr(batch, space) == getattr(singles, space)
    assert_same(batch.reset(seed=3), singles.reset(seed=3))
    rng = np.random.default_rng(len(name))
    draw, over, ends = policies(rng, batch.action_space.shape), np.zeros(6, np.bool_), 0
    for step in range(90):
        # some begin anew while others go on
        mask = rng.random(6) < (0.1 if step % 3 == 2 else 0.0)
        mask |= over & (mode == OFF)
        if mask.any():
            options = [{"reset_mask": mask.copy()} for _ in range(2)]
            assert_same(batch.reset(options=options[0]), singles.reset(options=options[1]))
        actions = next(draw)
        answer = batch.step(actions)
        assert_same(answer, singles.step(actions))
        over = answer[2]
        ends += over.sum()
        if ends > 24 and (kind == "layout" or step > 40):
            break
    assert ends >= 6


@pytest.mark.parametrize("name", ["sprint", "tempo-noise", "draw", "magnify"])
def test_an_action_for_the_layout_equals_actions_for_its_dominoes(name):
    scene = SCENES[name]
    chain, whole = DominoChainVector(4, scene), DominoLayoutVector(4, scene)
    for envs in (chain, whole):
        envs.reset(seed=10)
    size = scene.count - 1, *chain.single_action_space.shape
    actions = np.random.default_rng(3).uniform(-0.3, 0.3, size)
    for action in actions:
        built = chain.step(np.tile(action, (4, 1)))[4]
    at_once = whole.step(np.tile(actions.T.ravel(), (4, 1)))[4]
    assert built["score"].tolist() == at_once["score"].tolist()
    # seeds are those of placement errors, or of orders of pieces
    assert len(set(built["score"].tolist())) == (4 if scene.placement or scene.hand else 1)


def test_returned_arrays_do_not_change():
    env, rng = DominoChainVector(3, "sprint", autoreset_mode=SAME), np.random.default_rng(0)
    begun, _ = env.reset()
    answers = [env.step(rng.uniform(-1, 1, (3, 1))) for _ in range(39)]
    arrays = begun, *(answer[:4] for answer in answers), answers[-1][4]["final_obs"]
    kept = copy.deepcopy(arrays)
    for _ in range(50):
        observations = env.step(rng.uniform(-1, 1, (3, 1)))[0]
    assert_same(arrays, kept)
    latest = observations.copy()
    observations[:] = 7.0  # changes the copy of the caller only
    observations, _ = env.reset(options={"reset_mask": np.array([True, False, False])})
    np.testing.assert_array_equal(observations[1:], latest[1:])


def test_results_do_not_depend_on_the_number_of_threads():
    threads = numba.get_num_threads()
    if numba.config.NUMBA_NUM_THREADS < 2:
        pytest.skip("one thread is all there is")
    answers = []
    for number in (1, 2):
        numba.set_num_threads(number)
        env = DominoChainVector(300, GENTLE, autoreset_mode=SAME)
        env.reset()
        draw = policies(np.random.default_rng(1), env.action_space.shape)
        answers.append(tuple(env.step(next(draw))[:4] for _ in range(40)))
    numba.set_num_threads(threads)
    assert_same(*answers)


def test_reset_takes_layouts_to_start_from():
    env = DominoChainVector(3, GENTLE)
    starts = [de.Layout([0.02] * 4, 0.0075), None, de.Layout([0.02] * 9, 0.0075)]
    observations, _ = env.reset(options={"layout": starts})
    for observed, start in zip(observations, starts, strict=True):
        alone, _ = DominoChain(GENTLE).reset(options=start and {"layout": start})
        np.testing.assert_array_equal(observed, alone)
    growing = DominoChainVector(2, "magnify")
    growing.reset()
    assert np.isfinite(growing.actions_towards([None, None])).all()  # no layout, no height to scale
    both, _ = env.reset(options={"layout": starts[0], "reset_mask": np.array([False, True, False])})
    np.testing.assert_array_equal(both, observations[[0, 0, 2]])
    for wrong in (starts[:2], 3, [None, None, "row.csv"]):
        with pytest.raises(ValueError, match=r"layout = .*: give one Layout for all, or a list"):
            env.reset(options={"layout": wrong})
    with pytest.raises(ValueError, match=r"start from in environment 2: .* the scene allows"):
        env.reset(options={"layout": [None, None, de.Layout([0.03], 0.0075)]})


def test_every_environment_has_its_own_seed():
    env = DominoChainVector(3, "sprint")
    env.reset(seed=5)
    assert env.np_random_seed == (5, 6, 7)
    assert env.np_random[2].random() == np.random.default_rng(7).random()
    env.reset(seed=[1, None, np.int64(2)])
    assert env.np_random_seed == (1, 6, 2)
    assert env.np_random[2].random() == np.random.default_rng(2).random()
    env.reset(seed=20, options={"reset_mask": np.array([False, True, False])})
    assert env.np_random_seed == (1, 21, 2)


def test_gymnasium_makes_and_wraps_vector_environments():
    env = gymnasium.make_vec("DominoChain-v2", num_envs=4, scene="sprint", autoreset_mode=SAME)
    assert isinstance(env.unwrapped, DominoChainVector)
    assert env.metadata["autoreset_mode"] is SAME
    env = gymnasium.wrappers.vector.RecordEpisodeStatistics(env)
    env.reset(seed=0)
    for _ in range(39):
        *_, infos = env.step(np.zeros((4, 1), np.float32))
    gain = infos["final_info"]["gain"]
    np.testing.assert_allclose(infos["episode"]["r"], 100.0 * gain, atol=1e-3)
    listed = gymnasium.make_vec("DominoLayout-v2", num_envs=2, scene="gentle")
    assert isinstance(listed.unwrapped, DominoLayoutVector)


def test_invalid_calls_are_rejected():
    with pytest.raises(ValueError, match="num_envs"):
        DominoChainVector(0, "sprint")
    with pytest.raises(ValueError, match="autoreset_mode = 'SameStp': did you mean 'SameStep'"):
        DominoChainVector(2, "sprint", autoreset_mode="SameStp")
    with pytest.raises(ValueError, match="render_mode = 'human': choose None or one of rgb_array"):
        DominoChainVector(2, "sprint", render_mode="human")
    env = DominoChainVector(2, "gentle", autoreset_mode=OFF)
    actions = np.zeros((2, 29, 1))
    for wrong in (actions[:1], actions[:, :5], actions[..., :0], actions + np.nan):
        with pytest.raises(ValueError, match="action"):
            env.place_all(wrong)
        with pytest.raises(ValueError, match="action"):
            env.place_all_vjp(wrong, np.zeros((2, 29, 3)))
    for wrong in (np.zeros((2, 29)), np.full((2, 29, 3), np.nan)):
        with pytest.raises(ValueError, match=r"derivatives.* give (\(2, 29, 3\)|a finite number)"):
            env.place_all_vjp(actions, wrong)
    for before in ({}, {"reset_mask": np.array([True, False])}):
        if before:
            env.reset(options=before)
        with pytest.raises(ResetNeeded, match=r"call reset\(\) before the first"):
            env.step(np.zeros((2, 2)))
    env.reset()
    for mask, words in (
        ([1, 0], r"is int64 of shape \(2,\): give \(2,\) booleans"),
        (np.array([True]), r"is bool of shape \(1,\)"),
        (np.zeros(2, np.bool_), "at least one of them True"),
    ):
        with pytest.raises(ValueError, match=words):
            env.reset(options={"reset_mask": mask})
    for seed, words in (([1], "a number or 2 seeds"), ([1, -3], "seed = -3"), (1.5, "seed = 1.5")):
        with pytest.raises(ValueError, match=words):
            env.reset(seed=seed)
    ended = np.zeros(2, np.bool_)
    while not ended.any():
        ended = env.step(np.array([[-1.0, 1.0], [0.5, -1.0]]))[2]
    with pytest.raises(ResetNeeded, match=r"environment \d is over: call reset"):
        env.step(np.zeros((2, 2)))
