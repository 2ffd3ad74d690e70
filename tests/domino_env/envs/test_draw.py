"""Pieces drawn from a box in random order, some of them in hand."""

import numpy as np
import pytest
from env_scenes import play

import domino_env as de
from domino_env import DominoChain, DominoChainVector
from domino_env.scenes.uniform_layouts import PLANNING_ORDERS

COUNT = 12
STOCK = de.Stock((0.005, 0.0075, 0.010), (4, 5, 4), 3)  # one more than the scene needs
SCENE = de.load_scene("draw").replace(count=COUNT, stock=STOCK)
KINDS, FIRST = np.array(STOCK.thickness), np.array([SCENE.first_thickness])


def counts(thickness):
    """Return how many dominoes of each kind there are."""
    return (np.asarray(thickness)[:, None] == KINDS).sum(axis=0)


def parts(env, observation):
    """Return how many pieces of each kind are in hand (all where there is none) and in the box."""
    shown = env.observation_layout
    box = observation[shown["stock"]] * STOCK.without(SCENE.first_thickness).count
    return (observation[shown["hand"]] * STOCK.hand, box) if "hand" in shown else (box, 0.0)


@pytest.mark.parametrize("size", [STOCK.hand, None])
def test_an_action_takes_the_preferred_piece_in_hand_and_no_piece_is_lost(size):
    env = DominoChain(SCENE.replace(stock=STOCK.replace(hand=size)))
    rng = np.random.default_rng(0)
    for seed in range(5):
        observation, _ = env.reset(seed=seed)
        order = np.random.default_rng(seed).permutation(STOCK.without(*FIRST).dominoes)
        for n in range(COUNT - 1):
            hand, box = parts(env, observation)
            placed = env.snapshot().layout.thickness
            assert hand + box + counts(placed) == pytest.approx(STOCK.count, abs=1e-5)
            drawn = order[: n + size] if size else order
            assert hand + counts(placed[1:]) == pytest.approx(counts(drawn), abs=1e-5)
            action = rng.uniform(-1.5, 1.0, 4)  # preferences below -1 count as -1
            observation, _, ended, _, info = env.step(action)
            last = (info["layout"] if ended else env.snapshot().layout).thickness[-1]
            preferences = np.where(hand > 0.5, np.maximum(action[1:], -1.0), -2.0)
            assert preferences[last == KINDS][0] == preferences.max()
            if ended:
                break


def test_a_hand_of_the_whole_stock_equals_no_hand():
    whole = SCENE.replace(stock=STOCK.replace(hand=sum(STOCK.count)))
    free = SCENE.replace(stock=STOCK.replace(hand=None))
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (COUNT - 1, 4))
    # bounds of the gap, as the baselines of the two scenes have other gaps
    actions[:, 0] = np.where(np.arange(COUNT - 1) % 4, 1.0, -1.0)
    infos = [play(DominoChain(scene), lambda k: actions[k], seed=2)[3] for scene in (whole, free)]
    assert infos[0]["layout"] == infos[1]["layout"]
    assert infos[0]["score"] == infos[1]["score"]


def test_pieces_of_a_given_layout_are_removed_from_the_stock():
    env = DominoChain(SCENE)
    start = de.Layout(np.full(4, 0.02), [0.0075, *[0.005] * 4], SCENE.height, SCENE.width)
    for seed in range(4):
        observation, _ = env.reset(seed=seed, options={"layout": start})
        hand, box = parts(env, observation)
        assert hand[0] == box[0] == 0.0  # all four thin ones stand
        rest = np.random.default_rng(seed).permutation(STOCK.without(*start.thickness).dominoes)
        assert hand == pytest.approx(counts(rest[: STOCK.hand]), abs=1e-6)
    with pytest.raises(ValueError, match=r"6 dominoes are 0\.0075 m thick: the stock has 5"):
        env.reset(options={"layout": de.Layout(np.full(5, 0.02), 0.0075)})


def test_the_uniform_baseline_is_the_best_equal_gap_with_pieces_in_drawn_order():
    thickness = SCENE.orders([*map(np.random.default_rng, range(PLANNING_ORDERS))])[:, : COUNT - 1]

    def mean(gap):
        return SCENE.evaluate(SCENE.batch(np.full(thickness.shape, gap), thickness)).score.mean()

    uniform = SCENE.uniform()
    gap = uniform.layout.spacing[0]
    assert np.ptp(uniform.layout.spacing) == 0.0
    assert uniform.layout.thickness[1:].tolist() == thickness[0].tolist()
    assert uniform.score == pytest.approx(mean(gap), rel=1e-6)
    gaps = *np.linspace(*SCENE.spacing, 40), gap - 1e-4, gap + 1e-4
    assert max(map(mean, gaps)) <= uniform.score * (1.0 + 1e-6)
    assert DominoChainVector(1, SCENE).baselines.results["speed"] == uniform.score


EXACT = STOCK.replace(count=(4, 4, 4))  # all pieces are placed


@pytest.mark.parametrize("hand", [3, None])
def test_rewards_expect_the_pieces_that_remain(hand):
    """The length after each step is that of the whole layout if later gaps are uniform."""
    scene = SCENE.replace(stock=EXACT.replace(hand=hand))
    uniform = scene.uniform()
    env, gap = DominoChain(scene, rtol=1e-10), uniform.layout.spacing.mean()
    actions = np.random.default_rng(4).uniform(-0.5, 0.5, (COUNT - 1, 4))
    *_, rewards, info = play(env, actions.__getitem__, seed=1)
    layout, times = info["layout"], info["wave"].arrival_times
    if scene.hand:
        thickness = scene.orders([*map(np.random.default_rng, range(PLANNING_ORDERS))])
        batch = scene.batch(np.full(thickness.shape, gap), thickness, rtol=1e-10)
        expected_times = batch.simulate(record=True).arrival_times.mean(axis=0)
    else:
        expected_times = uniform.wave.arrival_times
    left = np.append(np.cumsum(uniform.layout.spacing[::-1])[::-1], 0.0)
    pieces = KINDS @ EXACT.count - FIRST[0]  # the sum of their thicknesses [m]
    for k in range(1, COUNT - 1):
        length = layout.positions[k] + left[k] + pieces - layout.thickness[1 : k + 1].sum()
        speed = length / (times[k] + expected_times[-1] - expected_times[k])
        assert rewards[:k].sum() == pytest.approx(100.0 * (speed / uniform.score - 1.0), abs=1e-6)
