"""References of the scene draw, and learning where episodes are random."""

import numpy as np
import pytest

import domino_env as de
from agents.draw import open_loop, rule, shipped_references
from agents.rollout import EVALUATION_SEEDS, SEEDS_PER_TRAINING, SELECTION_SEEDS, episode_scores
from agents.scripted import ScriptedPolicy
from domino_env.view.drawing import STANDING_COLOUR

DRAW = de.load_scene("draw")
SMALL = DRAW.replace(count=8, stock=de.Stock((0.005, 0.0075, 0.010), (2, 3, 3), 2))


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


def test_hindsight_is_not_below_its_start_and_places_pieces_in_hand(references):
    numbers = shipped_references()
    policies = [rule(DRAW, numbers["rule"]), open_loop(DRAW, numbers["plan"])]
    seeds = EVALUATION_SEEDS[:3]
    best, _, thickness = references.hindsight(DRAW, policies, seeds, rounds=1)
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


def test_frames_show_the_hand():
    env = de.DominoChain(DRAW, render_mode="rgb_array")
    env.reset(seed=10_000)
    assert 1e3 * env.snapshot().hand == pytest.approx([7.5, 7.5, 10.0])
    # the first domino stands on the left
    assert (env.render()[:, 600:] == STANDING_COLOUR).all(axis=-1).any()


def test_training_seeds_differ_from_selection_and_evaluation_seeds():
    pytest.importorskip("stable_baselines3")
    from agents.algorithms import default_hyperparameters
    from agents.sb3.factory import make_model

    chosen = default_hyperparameters("ppo", SMALL).replace(num_envs=4, options={"n_steps": 7})
    used = set()
    for seed in range(2):
        model = make_model(SMALL, "ppo", chosen, seed).learn(28)
        seeds = model.env.vector.np_random_seed
        assert min(seeds) >= SEEDS_PER_TRAINING > max(*SELECTION_SEEDS, *EVALUATION_SEEDS)
        assert not used & {*seeds}
        used |= {*seeds}
