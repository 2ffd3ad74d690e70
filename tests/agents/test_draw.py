"""References of the scene draw, and learning where episodes are random."""

from itertools import permutations

import numpy as np
import pytest

import domino_env as de
from agents.draw import open_loop, rule, shipped_references
from agents.rollout import EVALUATION_SEEDS, SEEDS_PER_TRAINING, SELECTION_SEEDS, episode_scores
from agents.scripted import ScriptedPolicy
from domino_env import DominoChain, DominoChainVector

DRAW = de.load_scene("draw")
SMALL = DRAW.replace(count=8, stock=de.Stock((0.005, 0.0075, 0.010), (2, 3, 3), 2))

TWELVE = DRAW.replace(count=12, stock=de.Stock((0.005, 0.0075, 0.010), (4, 5, 4), 3))


@pytest.fixture(scope="module")
def references(script):
    return script("docs/draw_references.py")


def feasible(order, sequence, hand):
    """Place pieces one after another from a hand."""
    held, box = list(order[:hand]), list(order[hand:])
    for piece in sequence:
        if piece not in held:
            return False
        held.remove(piece)
        held += box[:1]
        box = box[1:]
    return True


def test_all_changes_that_the_hand_allows_are_generated(references):
    orders = SMALL.orders([*map(np.random.default_rng, range(5))])
    assert SMALL.orders([]).shape == (0, SMALL.count - 1)
    origin, sequences = references._changes(orders, orders, SMALL.hand)
    expected = set()
    for b, order in enumerate(orders):
        for i, j in permutations(range(len(order)), 2):
            exchanged = order.copy()
            exchanged[[i, j]] = exchanged[[j, i]]
            for sequence in (exchanged, np.insert(np.delete(order, i), j, order[i])):
                if (sequence != order).any() and feasible(order, sequence, SMALL.hand):
                    expected.add((b, *sequence))
    changes = [(b, *sequence) for b, sequence in zip(origin, sequences, strict=True)]
    assert sorted(changes) == sorted(expected)


def test_hindsight_is_not_below_its_start_and_places_pieces_in_hand(references):
    numbers = shipped_references()
    policies = [rule(DRAW, numbers["rule"]), open_loop(DRAW, numbers["plan"])]
    seeds = EVALUATION_SEEDS[:3]
    best, _, thickness = references.hindsight(DRAW, seeds, policies, rounds=1)
    for policy in policies:
        assert (best >= episode_scores(policy, DRAW, seeds) * (1.0 - 1e-6)).all()
    orders = DRAW.orders([np.random.default_rng(seed) for seed in seeds])
    for order, sequence in zip(orders, thickness, strict=True):
        assert feasible(order, sequence, DRAW.hand)


def test_fitted_references_are_better_than_equal_gaps_on_the_planning_orders(references):
    uniform = SMALL.uniform().score
    seeds = np.random.default_rng(0), np.random.default_rng(0)
    fitted, again = (references.fit_rule(SMALL, rng, generations=12) for rng in seeds)
    assert fitted.tolist() == again.tolist()
    assert episode_scores(rule(SMALL, fitted), SMALL, SELECTION_SEEDS).mean() > uniform
    start = np.zeros((7, 2))
    start[:, 0] = np.interp(SMALL.uniform().layout.spacing, SMALL.spacing, (-1.0, 1.0))
    plan = open_loop(SMALL, references.fit_fixed(SMALL, start, rounds=1))
    assert episode_scores(plan, SMALL, SELECTION_SEEDS).mean() > uniform


def test_shipped_references_are_ranked_on_evaluation_seeds(output_of):
    scores = [ScriptedPolicy(name).build(DRAW).score for name in ("uniform", "plan", "rule")]
    assert scores == sorted(scores)
    assert scores[-1] < shipped_references()["hindsight"]
    output = output_of("evaluate", "rule", "--scene", "draw")
    assert "over the open-loop plan over the same 200 episodes" in output


def test_a_batch_of_rules_equals_single_rules():
    several = np.random.default_rng(1).normal(size=(3, 25))
    env = DominoChain(SMALL)
    observations = np.array([env.reset(seed=seed)[0] for seed in range(3)])
    together = rule(SMALL, several)(observations)
    for own, observation, expected in zip(several, observations, together, strict=True):
        assert rule(SMALL, own)(observation) == pytest.approx(expected)


def test_frames_show_the_hand():
    env = DominoChain(DRAW, render_mode="ansi")
    env.reset(seed=10_000)
    assert "in hand 7.5, 7.5, 10 mm" in env.render()


def test_training_seeds_differ_from_selection_and_evaluation_seeds():
    pytest.importorskip("stable_baselines3")
    from agents.algorithms import default_hyperparameters
    from agents.sb3 import make_model

    chosen = default_hyperparameters("ppo", SMALL).replace(num_envs=4, options={"n_steps": 7})
    used = set()
    for seed in range(2):
        model = make_model(SMALL, "ppo", chosen, seed).learn(28)
        seeds = model.env.vector.np_random_seed
        assert min(seeds) >= SEEDS_PER_TRAINING > max(*SELECTION_SEEDS, *EVALUATION_SEEDS)
        assert not used & {*seeds}
        used |= {*seeds}


def test_rollouts_and_the_baseline_are_means_over_the_same_orders():
    rollout = ScriptedPolicy("uniform").build(TWELVE)
    scores = TWELVE.score_placed(rollout.layout, EVALUATION_SEEDS)
    assert rollout.score == rollout.uniform.score == scores.mean() != TWELVE.uniform().score
    env = DominoChainVector(3, TWELVE)
    env.reset(seed=EVALUATION_SEEDS[0])
    for _ in range(TWELVE.count - 1):  # pieces as they come
        info = env.step(np.zeros((3, 4)))[4]
    assert info["score"] == pytest.approx(scores[:3], rel=1e-5)
