"""Write references of scenes with random episodes: python docs/draw_references.py [RUN].

With the folder of a training on `varied-draw`, whose layouts hindsight improves too, it writes
those of `varied-draw` and `varied-tempo` into agents/references.json, in fifteen minutes: median
gains of the rule and of the controller in the test set, and of hindsight.

Without, it writes agents/draw.json. It takes four minutes and fits three references:

- rule: its 25 coefficients, by CMA-ES;
- open loop: a fixed sequence of gaps and desired thicknesses, by exact gradients and by exchanges;
- hindsight: the order is known; exchanges and moves of pieces that the hand allows, and local
  searches over the gaps. It is the best known, and no bound.

Rule and open loop are fitted to the orders of `SELECTION_SEEDS`.
"""

from __future__ import annotations

import json
import sys
from itertools import permutations
from pathlib import Path
from typing import Any

import cma
import numpy as np

from agents.benchmark import REFERENCES
from agents.draw import (
    KNOTS,
    PATH,
    fit_gaps,
    open_loop,
    relative,
    rule,
    rule_sizes,
    shipped_references,
    to_actions,
)  # fmt: skip
from agents.network import Policy
from agents.policy import ScenePolicy
from agents.rollout import EVALUATION_SEEDS, SELECTION_SEEDS, episode_scores, last_infos
from agents.scripted import ScriptedPolicy
from domino_env import (
    DominoChain,
    DominoChainVector,
    Scene,
    SceneDistribution,
    load_scene,
    load_test_set,
)
from domino_env.core.files import read_json, write_text
from domino_env.core.types import Floats, Ints
from optimize.methods.gradient.local_search import LocalSearch
from optimize.methods.search.cma_es import cma_options

GENERATIONS, POPULATION = 400, 16
FIRST_STEP = 0.3  # standard deviation of the coefficients of the rule
PREFERENCES = -0.75, -0.25, 0.25, 0.75  # relative thicknesses: every ranking of three kinds
LONG, SHORT = 80, 12  # gradients of a thorough and of a quick local search
FEW = 8  # changes that are refined in a round
ROUNDS = 40
# in a sampled scene
HINDSIGHT: dict[str, Any] = {"seeds": EVALUATION_SEEDS[:4], "rounds": 6, "gradients": LONG}
GAIN = 1e-5  # a smaller relative gain of a round ends the search


def fit_rule(scene: Scene, rng: np.random.Generator, generations: int = GENERATIONS) -> Floats:
    """Return the (25,) coefficients of the rule with the best mean score on the planning orders."""
    start = np.zeros(sum(KNOTS))
    uniform = scene.uniform().layout.spacing[:1]
    start[KNOTS[0] : KNOTS[0] + KNOTS[1]] = relative(uniform, scene.spacing)

    def mean_scores(candidates: Floats) -> Floats:
        orders = len(SELECTION_SEEDS)
        policy = rule(scene, np.repeat(candidates, orders, axis=0))
        scores = episode_scores(policy, scene, [*SELECTION_SEEDS] * len(candidates))
        means: Floats = scores.reshape(-1, orders).mean(axis=1)
        return means

    options = cma_options(rng, len(start), POPULATION) | {"bounds": None}
    strategy = cma.CMAEvolutionStrategy(start, FIRST_STEP, options)
    for _ in range(generations):
        proposed = strategy.ask()
        strategy.tell(proposed, -mean_scores(np.array(proposed)))
    # the mean of the last generation: the best point of a noisy function is a lucky one
    return np.asarray(strategy.result.xfavorite)


def fit_fixed(scene: Scene, sizes: Floats, rounds: int = ROUNDS) -> Floats:
    """Return relative sizes (N-1, 2) with a high mean score on the planning orders.

    Parameters
    ----------
    scene
        A scene with a hand.
    sizes
        (N-1, 2) relative gaps and desired thicknesses to begin at.
    rounds
        Largest number of rounds, each of which changes one requested thickness.
    """
    env, seeds = DominoChainVector(len(SELECTION_SEEDS), scene), [*SELECTION_SEEDS]

    def pieces(wishes: Floats) -> Floats:
        env.reset(seed=seeds)
        both = np.stack([np.zeros(len(wishes)), wishes], axis=1)
        return env.place_all(np.tile(to_actions(scene, both), (len(seeds), 1, 1)))[1]

    def refined(gap: Floats, thickness: Floats, gradients: int) -> tuple[float, Floats]:
        search = LocalSearch(gap)
        while not search.done and search.evaluations < gradients:
            search.update(*_mean(scene, search.candidate, thickness))
        return search.score, search.design

    gap, wishes = 0.5 * (np.clip(sizes[:, 0], -1.0, 1.0) + 1.0), sizes[:, 1]
    score, gap = refined(gap, pieces(wishes), LONG)
    for _ in range(rounds):
        changes = [(n, wish) for n in range(len(wishes)) for wish in PREFERENCES]
        tried = np.repeat(wishes[None], len(changes), axis=0)
        for i, (n, wish) in enumerate(changes):
            tried[i, n] = wish
        placed = [pieces(sequence) for sequence in tried]
        gaps = np.broadcast_to(_gaps(scene, gap), (len(tried) * len(seeds), len(gap)))
        scores = scene.evaluate(scene.batch(gaps, np.concatenate(placed))).score
        best = np.argsort(-scores.reshape(len(tried), -1).mean(axis=1), kind="stable")[:FEW]
        results = [(*refined(gap, placed[i], SHORT), int(i)) for i in best]
        new_score, new_gap, i = max(results, key=lambda result: result[0])
        if new_score <= score * (1.0 + GAIN):
            break
        score, gap, wishes = new_score, new_gap, tried[i]
    gap = refined(gap, pieces(wishes), LONG)[1]
    return np.stack([2.0 * gap - 1.0, wishes], axis=1)


def _gaps(scene: Scene, design: Floats) -> Floats:
    """Return the gaps [m] of values in [0, 1]."""
    return scene.spacing[0] + design * (scene.spacing[1] - scene.spacing[0])


def _mean(scene: Scene, design: Floats, thickness: Floats) -> tuple[float, Floats]:
    """Return the mean score of gaps with the pieces of each order, and its gradient."""
    gaps = np.tile(_gaps(scene, design), (len(thickness), 1))
    result = scene.evaluate(scene.batch(gaps, thickness), gradient=True)
    assert result.gradient is not None
    gradient = result.gradient.spacing.mean(axis=0) * (scene.spacing[1] - scene.spacing[0])
    return float(result.score.mean()), gradient


def hindsight(
    scene: Scene,
    policies: list[Policy],
    seeds: range,
    rounds: int = ROUNDS,
    gradients: int = SHORT,
    trained: ScenePolicy | None = None,
) -> tuple[Floats, Floats, Floats]:
    """Search the best layout for each order of pieces, with the order known.

    Parameters
    ----------
    scene
        A scene with a hand.
    policies
        Policies whose layouts are improved, each separately; the best result of each order counts.
    seeds
        S seeds of orders.
    rounds
        Largest number of rounds.
    gradients
        Number of gradients of a local search in a round.
    trained
        Policy of a distribution of scenes, whose layouts are improved too.

    Returns
    -------
    tuple of ndarray
        Scores (S,), gaps and thicknesses (S, N-1) [m].
    """
    orders = scene.orders([np.random.default_rng(seed) for seed in seeds])
    starts = [_layouts_of(policy, scene, seeds) for policy in policies]
    if trained is not None:
        assert isinstance(trained.scene, SceneDistribution)
        starts.append(_layouts_of(trained.policy, scene, seeds, trained.scene))
    results = [_improved(scene, orders, *start, rounds, gradients) for start in starts]
    best, each = np.argmax([scores for scores, _, _ in results], axis=0), np.arange(len(orders))
    score, gaps, thickness = (np.array(part)[best, each] for part in zip(*results, strict=True))
    return score, gaps, thickness


def _improved(
    scene: Scene, orders: Floats, gaps: Floats, thickness: Floats, rounds: int, gradients: int
) -> tuple[Floats, Floats, Floats]:
    """Return scores (S,), gaps and thicknesses (S, N-1) of searches that begin at S layouts."""
    score, gaps = _refined(scene, gaps, thickness, gradients)
    live = np.arange(len(orders))
    for _ in range(rounds):
        origin, sequences = _changes(orders[live], thickness[live], scene.hand)
        scores = scene.evaluate(scene.batch(gaps[live][origin], sequences)).score
        ranked = np.lexsort((-scores, origin))
        place = np.arange(len(ranked)) - np.searchsorted(origin[ranked], origin[ranked])
        few = ranked[place < FEW]
        new_scores, new_gaps = _refined(scene, gaps[live][origin[few]], sequences[few], gradients)
        better = np.zeros(len(live), np.bool_)
        for i in np.argsort(new_scores):  # the best of each order last
            b = live[origin[few[i]]]
            if new_scores[i] > score[b] * (1.0 + GAIN):
                score[b], gaps[b], thickness[b] = new_scores[i], new_gaps[i], sequences[few[i]]
                better[origin[few[i]]] = True
        live = live[better]
        if not len(live):
            break
    return *_refined(scene, gaps, thickness, LONG), thickness


def _layouts_of(
    policy: Policy, scene: Scene, seeds: range, distribution: SceneDistribution | None = None
) -> tuple[Floats, Floats]:
    """Return the gaps and thicknesses (S, N-1) [m] that a policy builds."""
    env = DominoChainVector(len(seeds), distribution or scene)
    options = None if distribution is None else {"scene": scene}
    layouts = last_infos(policy, env, "layout", seed=list(seeds), options=options)
    spacing = np.array([layout.spacing for layout in layouts])
    return spacing, np.array([layout.thickness[1:] for layout in layouts])


def _refined(
    scene: Scene, gaps: Floats, thickness: Floats, gradients: int
) -> tuple[Floats, Floats]:
    """Return scores (B,) and gaps (B, N-1) [m] of local searches over the gaps, side by side."""
    low, high = scene.spacing
    searches = [LocalSearch((gap - low) / (high - low)) for gap in gaps]
    for _ in range(gradients):
        live = [b for b, search in enumerate(searches) if not search.done]
        if not live:
            break
        candidates = _gaps(scene, np.array([searches[b].candidate for b in live]))
        result = scene.evaluate(scene.batch(candidates, thickness[live]), gradient=True)
        assert result.gradient is not None
        for b, score, gradient in zip(live, result.score, result.gradient.spacing, strict=True):
            searches[b].update(float(score), gradient * (high - low))
    scores = np.array([search.score for search in searches])
    return scores, _gaps(scene, np.array([search.design for search in searches]))


def _changes(orders: Floats, thickness: Floats, hand: int) -> tuple[Ints, Floats]:
    """Return the layouts that are changed, and their sequences after one change that a hand allows.

    Two pieces are exchanged, or one is moved.
    """
    pairs, kinds = orders.shape[1], np.unique(orders)
    drawn = (orders[:, :, None] == kinds).cumsum(axis=1)
    ready = np.minimum(np.arange(pairs) + hand - 1, pairs - 1)
    places = []
    for i, j in permutations(range(pairs), 2):
        exchanged = np.arange(pairs)
        exchanged[[i, j]] = j, i
        places += [exchanged, np.insert(np.delete(np.arange(pairs), i), j, i)]
    origin, sequences = [], []
    indices = np.unique(places, axis=0)
    for b, sequence in enumerate(thickness):
        tried = np.unique(sequence[indices], axis=0)
        tried = tried[(tried != sequence).any(axis=1)]
        taken = (tried[:, :, None] == kinds).cumsum(axis=1)
        allowed = tried[(taken <= drawn[b, ready]).all(axis=(1, 2))]
        origin.append(np.full(len(allowed), b))
        sequences.append(allowed)
    return np.concatenate(origin), np.concatenate(sequences)


def sampled_references(trained: ScenePolicy) -> None:
    """Write the references of sampled scenes with random episodes."""
    gains: dict[str, list[tuple[float, float]]] = {}
    for name, policy in (("varied-draw", "rule"), ("varied-tempo", "controller")):
        for scene in load_test_set(name):
            rollout, best = ScriptedPolicy(policy).build(scene), 1.0  # without errors of arrival
            if scene.hand:
                policies = [
                    rule(scene, fit_gaps(scene, shipped_references()["rule"], reacts=reacts))
                    for reacts in (True, False)
                ]
                best = float(hindsight(scene, policies, trained=trained, **HINDSIGHT)[0].mean())
            gain = scene.gain(best, scene.uniform().score)
            gains.setdefault(name, []).append((rollout.gain or -1.0, gain or -1.0))
    document = read_json(REFERENCES)
    for name, values in gains.items():
        one, best = np.median(values, axis=0).tolist()
        document[name] = {"zero": 0.0, "one": one, "hindsight": best}
    write_text(REFERENCES, json.dumps(document, indent=1) + "\n")


def main() -> None:
    """Fit rule, open loop and hindsight to the scene "draw", and write them."""
    scene, rng = load_scene("draw"), np.random.default_rng(0)
    fitted = fit_rule(scene, rng)
    policy = rule(scene, fitted)
    spacing, _ = _layouts_of(policy, scene, SELECTION_SEEDS)
    gaps = relative(spacing.mean(axis=0), scene.spacing)
    env = DominoChain(scene)
    observed = np.ones((scene.count - 1, *(env.observation_space.shape or ())), np.float32)
    place = np.arange(scene.count - 1) / (scene.count - 1)
    observed[:, env.observation_layout["placed"].start] = place
    desired = rule_sizes(scene, fitted)(observed)[:, 1]
    plan = fit_fixed(scene, np.stack([gaps, desired], axis=1))
    best, _, _ = hindsight(scene, [policy, open_loop(scene, plan)], EVALUATION_SEEDS)
    document = {"rule": fitted.tolist(), "plan": plan.tolist(), "hindsight": float(best.mean())}
    write_text(PATH, json.dumps(document, indent=1) + "\n")


if __name__ == "__main__":
    sampled_references(ScenePolicy.load(Path(sys.argv[1]))) if sys.argv[1:] else main()
