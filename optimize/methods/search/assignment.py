"""Order of the dominoes of a stock: assignments by HiGHS, then an annealed search of exchanges.

At a layout whose gaps a local search has refined, the exact gradient predicts the gain of each kind
of domino at each place. An integer programme, solved by HiGHS, finds the assignment with the
largest predicted gain and a limited number of changes (`assign`). Random
changes of the order are tried too, and short local searches refine the gaps of the best few of all
these layouts, until several rounds gain nothing.

Then the search is annealed. Every generation changes the present layout at random: exchanges of one
or two pairs of dominoes, a domino that moves to another place, a part in reverse order, a
permutation of up to eight neighbours, and an exchange with a spare domino. Gaps stay at their
places, move with their dominoes, or keep the pivots. All changed layouts are scored in one batch,
the best few are refined, and the best of these becomes the present layout if it loses less than a
threshold, which falls to zero in every cycle. Each cycle begins at the best layout so far; cycles
with a low threshold and with a high one follow each other, so that no limit has to be known. Small
random changes of the gaps move layouts off the kinks of the score, at which local searches would
end. Without a stock, only local searches from several starts remain.

References
----------
Dueck, G., Scheuer, T. (1990). Threshold accepting: a general purpose optimization algorithm
appearing superior to simulated annealing. Journal of Computational Physics 90, 161-175.
"""

from __future__ import annotations

from itertools import count

import numpy as np

from domino_env.core.types import Floats, Ints
from optimize.evaluator import Evaluator
from optimize.methods.gradient.local_search import LocalSearch, run_local_searches
from optimize.methods.starts import starts, uniform_design
from optimize.problem import Problem

THOROUGH = 80  # gradients of a thorough local search
SAME_DOMINO = 1e-9  # largest difference of the variables of two dominoes of the same kind
LEAST_GAIN = 1e-6  # a smaller relative gain counts as zero
CHANGES = (2, 4, 8, 16)  # numbers of places that a programme may change
# first rounds: random changes, refined layouts, gradients of each, rounds without gain at the end
PROPOSALS, PROPOSALS_REFINED, QUICK, MAX_IDLE = 400, 8, 10, 3
# annealed generations: children that are scored, those that are refined, gradients of each, and
# gradients of the one that is accepted
CHILDREN, CHILDREN_REFINED, CHILD_GRADIENTS, ACCEPTED_GRADIENTS = 120, 4, 12, 25
# generations of a cycle, and the largest relative loss that is accepted at its start. The threshold
# doubles from cycle to cycle; after some cycles it begins anew, with longer cycles.
CYCLE, THRESHOLD, THRESHOLD_DOUBLINGS = 100, 5e-4, 4
MAX_TRIES = 8  # random changes until dominoes of different kinds change places
# probabilities that gaps move with their dominoes, and that the pivots stay
MOVED_GAPS, SAME_PIVOTS = 0.8, 0.1
SPARE_PROBABILITY = 0.2  # probability of an exchange with a spare domino, if there is one
MOST_NEIGHBOURS = 8  # largest number of neighbours that are permuted
SHAKE = 4e-3  # standard deviation of random changes of gaps, relative to their range
FACE_DISTANCE = 1e-3  # distance to a face of the box up to which a gap is not changed at random


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Search the order of the dominoes until a limit is reached."""
    problem = evaluator.problem
    if not problem.space.is_discrete.any():  # there is no order
        for start in starts(evaluator, rng):
            _refine(evaluator, start, THOROUGH)
    _improve(evaluator, rng)
    for cycle in count():
        before = evaluator.best_score
        generations = CYCLE * (1 + cycle // THRESHOLD_DOUBLINGS)
        _anneal(evaluator, generations, THRESHOLD * 2 ** (cycle % THRESHOLD_DOUBLINGS), rng)
        gain = (evaluator.best_score - before) / abs(before)
        evaluator.status = f"the last {generations} generations gained {gain:.2g} of the score"


def _improve(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Change the order of the uniform baseline until several rounds gain nothing."""
    problem = evaluator.problem
    current = _refine(evaluator, uniform_design(problem), THOROUGH)
    idle = 0
    while idle < MAX_IDLE:
        children = _children(problem, current.design, PROPOSALS, rng)
        if idle == 0:  # assignments are not random
            assignments = problem.project(_assignments(evaluator, current.design))
            children = np.concatenate([children, assignments])
        child = _best_refined(evaluator, children, PROPOSALS_REFINED, QUICK)
        has_gained = child.score > current.score + LEAST_GAIN * abs(current.score)
        current, idle = (child, 0) if has_gained else (current, idle + 1)


def _anneal(
    evaluator: Evaluator, generations: int, threshold: float, rng: np.random.Generator
) -> None:
    """Run one cycle of generations, from the best layout so far, with a falling threshold."""
    current = _refine(evaluator, evaluator.best, THOROUGH)
    for generation in range(generations):
        loss = threshold * (1.0 - generation / generations) ** 2 * abs(current.score)
        children = _children(evaluator.problem, current.design, CHILDREN, rng)
        child = _best_refined(evaluator, children, CHILDREN_REFINED, CHILD_GRADIENTS)
        if child.score > current.score - loss:
            run_local_searches(evaluator, [child], ACCEPTED_GRADIENTS)
            current = child


def _best_refined(
    evaluator: Evaluator, designs: Floats, refined: int, gradients: int
) -> LocalSearch:
    """Score layouts (B, n), refine the best of them, and return the best local search."""
    scores = evaluator.evaluate(designs).score
    designs = designs[np.argsort(-scores, kind="stable")]
    pairs = evaluator.problem.scene.count - 1
    _, firsts = np.unique(designs[:, -pairs:], axis=0, return_index=True)  # the best of each order
    searches = [_local_search(evaluator.problem, designs[i]) for i in np.sort(firsts)[:refined]]
    run_local_searches(evaluator, searches, gradients)
    return max(searches, key=lambda search: search.score)


def _refine(evaluator: Evaluator, design: Floats, gradients: int) -> LocalSearch:
    """Return a local search from one layout (n,) after some gradients."""
    search = _local_search(evaluator.problem, evaluator.problem.project(design[None])[0])
    run_local_searches(evaluator, [search], gradients)
    return search


def _local_search(problem: Problem, design: Floats) -> LocalSearch:
    """Return a local search from a design vector (n,) that keeps the rules.

    It does not move dominoes of the stock, so that without a given length it needs no projection.
    """
    project = None if problem.equality is None else problem.project
    return LocalSearch(design, project, normal=problem.normal)


def _assignments(evaluator: Evaluator, design: Floats) -> Floats:
    """Propose the assignments of the largest predicted gain, one for each number in CHANGES."""
    problem = evaluator.problem
    stock, pairs = problem.space.pieces, problem.space.pairs
    assert stock is not None
    kinds = np.array(stock.thickness)
    gradient = evaluator.evaluate(design, True, relaxed=True).gradient
    span = (problem.high - problem.low)[-pairs:]  # the last variables are the thicknesses
    thickness = problem.low[-pairs:] + design[-pairs:] * span
    current = np.abs(thickness[:, None] - kinds).argmin(axis=1)
    costs = -(gradient[-pairs:] / span)[:, None] * (kinds - thickness[:, None])
    designs = np.repeat(design[None], len(CHANGES), axis=0)
    for i, changes in enumerate(CHANGES):
        chosen = assign(costs, np.array(stock.count), current, changes)
        designs[i, -pairs:] = (kinds[chosen] - problem.low[-pairs:]) / span
    return designs


def assign(costs: Floats, count: Ints, current: Ints, changes: int) -> Ints:
    """Choose a kind of domino for each place so that the sum of costs is smallest.

    Parameters
    ----------
    costs
        (n, kinds) cost of each kind at each place.
    count
        (kinds,) number of dominoes of each kind, n or more in all.
    current
        (n,) index of the present kind at each place.
    changes
        Largest number of places that change.

    Returns
    -------
    ndarray
        (n,) index of the kind for each place.

    Raises
    ------
    RuntimeError
        If the solver fails.
    """
    from scipy import optimize
    from scipy.sparse import eye_array, kron

    places, kinds = costs.shape
    at_each_place = kron(eye_array(places), np.ones((1, kinds)))
    of_each_kind = kron(np.ones((1, places)), eye_array(kinds))
    rules = [
        optimize.LinearConstraint(at_each_place, 1.0, 1.0),
        optimize.LinearConstraint(of_each_kind, -np.inf, count),
    ]
    is_limited = changes < places  # otherwise the vertices are whole numbers by themselves
    if is_limited:
        unchanged = np.eye(kinds)[current].reshape(1, -1)
        rules.append(optimize.LinearConstraint(unchanged, places - changes, np.inf))
    scaled_costs = (costs - costs.min()) / (float(np.ptp(costs)) or 1.0)
    result = optimize.milp(
        scaled_costs.ravel(), constraints=rules, bounds=optimize.Bounds(0.0, 1.0),
        integrality=int(is_limited),
    )  # fmt: skip
    if result.x is None:
        raise RuntimeError(f"no assignment was found ({result.message}): try another method")
    return np.asarray(np.argmax(result.x.reshape(places, kinds), axis=1))


def _children(problem: Problem, design: Floats, number: int, rng: np.random.Generator) -> Floats:
    """Change a layout at random, `number` times; return the design vectors (number, n)."""
    pairs = problem.scene.count - 1
    span = (problem.high - problem.low)[[0, -1]]  # of a gap and of a thickness
    pieces, spares = design[-pairs:], _spares(problem, design)
    children = np.repeat(design[None], number, axis=0)
    for child in children:
        order = np.arange(pairs)
        if len(spares) and rng.random() < SPARE_PROBABILITY:
            child[len(child) - pairs + int(rng.integers(pairs))] = rng.choice(spares)
        else:
            for _ in range(MAX_TRIES):
                order = _reorder(pieces, rng)
                if np.any(np.abs(pieces[order] - pieces) > SAME_DOMINO):
                    break
            child[-pairs:] = pieces[order]
        if problem.space.spacing.is_free:
            variant = rng.random()
            if variant < MOVED_GAPS:
                child[:pairs] = design[order]
            elif variant < MOVED_GAPS + SAME_PIVOTS:
                child[:pairs] += span[1] / span[0] * (pieces - child[-pairs:])
    if problem.space.spacing.is_free:
        gaps = children[:, :pairs]
        inside = (gaps > FACE_DISTANCE) & (gaps < 1.0 - FACE_DISTANCE)
        gaps += np.where(inside, SHAKE * rng.standard_normal(gaps.shape), 0.0)
    return problem.project(np.clip(children, 0.0, 1.0))


def _reorder(pieces: Floats, rng: np.random.Generator) -> Ints:
    """Return a random change of the order of the places, as an array of places (pairs,)."""
    pairs = len(pieces)
    order = np.arange(pairs)
    kind = int(rng.integers(5))
    if kind < 2:  # exchange one pair of different dominoes, or two
        for _ in range(kind + 1):
            i = int(rng.integers(pairs))
            others = np.flatnonzero(np.abs(pieces[order] - pieces[order[i]]) > SAME_DOMINO)
            j = int(rng.choice(others)) if len(others) else i
            order[[i, j]] = order[[j, i]]
        return order
    i, j = sorted(rng.integers(pairs, size=2).tolist())
    if kind == 2:  # move a domino, which shifts those between
        order[i : j + 1] = np.roll(order[i : j + 1], rng.choice([-3, -2, -1, 1, 2, 3]))
    elif kind == 3:
        order[i : j + 1] = order[i : j + 1][::-1]
    else:
        end = i + int(rng.integers(2, MOST_NEIGHBOURS + 1))
        order[i:end] = rng.permutation(order[i:end])
    return order


def _spares(problem: Problem, design: Floats) -> Floats:
    """Return the variables of the kinds of which a layout (n,) leaves dominoes in the stock."""
    stock = problem.space.pieces
    assert stock is not None
    kinds = (np.array(stock.thickness) - problem.low[-1]) / (problem.high - problem.low)[-1]
    pieces = design[-(problem.scene.count - 1) :]
    used = np.abs(pieces[:, None] - kinds).argmin(axis=1)
    return np.asarray(kinds[np.bincount(used, minlength=len(kinds)) < np.array(stock.count)])
