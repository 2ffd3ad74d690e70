"""Order of the dominoes of a stock: assignments by HiGHS and exchanges, with local searches.

At a layout whose gaps a local search has refined, the exact gradient predicts the gain of each kind
of domino at each place. An integer programme, solved by HiGHS, finds the assignment with the
largest predicted gain and a limited number of changes (see `optimize.constraints.stock`). Exchanges
of two dominoes, and moves of one to another place, are tried too. Short local searches refine the
gaps of the best few of all these layouts, and the best one is kept. Without a stock, only the local
searches remain.
"""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Floats, unique_points
from optimize.constraints.stock import assign
from optimize.evaluator import Evaluator
from optimize.methods.gradient.local_search import LocalSearch, run_local_searches
from optimize.methods.starts import starts
from optimize.problem import Problem

THOROUGH, QUICK = 80, 10  # gradients of a thorough and of a quick local search
SAME_DOMINO = 1e-9  # largest difference of the variables of two dominoes of the same kind
CHANGES = (2, 4, 8, 16)  # numbers of places that a programme may change
PROPOSALS = 200  # layouts of each kind of change that are tried, except assignments
MAX_REFINED = 8  # best layouts of a round that are refined
LEAST_GAIN = 1e-6  # a smaller relative gain counts as zero
MAX_IDLE = 3  # rounds without gain that end the search from a start


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Improve one start after the other until a limit is reached."""
    for start in starts(evaluator, rng):
        _improve(evaluator, start, rng)


def _improve(evaluator: Evaluator, start: Floats, rng: np.random.Generator) -> None:
    """Change the order of the dominoes of one start until several rounds gain nothing."""
    problem = evaluator.problem
    score, design = _refine(evaluator, problem.project(start[None]), THOROUGH)
    if problem.is_continuous.all():  # there is no order
        return
    idle = 0
    while idle < MAX_IDLE:
        neighbours = _neighbours(evaluator, design, rng, first=idle == 0)
        if len(neighbours) == 0:
            return
        scores = evaluator.evaluate(neighbours).score
        best = neighbours[np.argsort(-scores, kind="stable")[:MAX_REFINED]]
        new_score, new_design = _refine(evaluator, best, QUICK)
        if new_score > score + LEAST_GAIN * abs(score):
            score, design, idle = new_score, new_design, 0
        else:
            idle += 1
    _refine(evaluator, design[None], THOROUGH)


def _refine(evaluator: Evaluator, designs: Floats, gradients: int) -> tuple[float, Floats]:
    """Return the best score and design vector of local searches from some layouts."""
    searches = [LocalSearch(design, evaluator.problem.projection) for design in designs]
    run_local_searches(evaluator, searches, gradients)
    best = max(searches, key=lambda search: search.score)
    return best.score, best.design


def _neighbours(
    evaluator: Evaluator, design: Floats, rng: np.random.Generator, *, first: bool
) -> Floats:
    """Propose layouts (B, n) with another order.

    `first` is true if this design vector is changed for the first time; assignments, which are not
    random, are proposed only then.
    """
    problem = evaluator.problem
    proposals = [_exchanges(problem, design, rng), _insertions(problem, design, rng)]
    if first:
        proposals.append(_assignments(evaluator, design))
    designs = problem.project(np.concatenate(proposals))
    return unique_points(designs[np.any(designs != design, axis=1)])


def _assignments(evaluator: Evaluator, design: Floats) -> Floats:
    """Propose the assignments of the largest predicted gain, one for each number in CHANGES."""
    problem = evaluator.problem
    assert problem.scene.stock is not None
    stock = problem.scene.stock.without(problem.scene.first_thickness)
    kinds = np.array(stock.thickness)
    pairs = problem.scene.count - 1
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


def _exchanges(problem: Problem, design: Floats, rng: np.random.Generator) -> Floats:
    """Propose exchanges of two dominoes, which keep the gaps or the pivots."""
    pairs = problem.scene.count - 1
    thickness = design[-pairs:]
    first, second = np.nonzero(np.triu(np.abs(thickness[:, None] - thickness) > SAME_DOMINO))
    chosen = rng.permutation(len(first))[:PROPOSALS]
    first, second = first[chosen], second[chosen]
    designs = np.repeat(design[None], len(chosen), axis=0)
    indices = np.arange(len(chosen))
    i, j = len(design) - pairs + first, len(design) - pairs + second
    designs[indices, i], designs[indices, j] = design[j], design[i]
    if problem.scene.free_spacing:  # every other exchange keeps the pivots
        odd = indices % 2 == 1
        scale = (problem.high - problem.low)[-1] / (problem.high - problem.low)[0]
        shift = scale * (design[j] - design[i])
        designs[indices[odd], first[odd]] -= shift[odd]
        designs[indices[odd], second[odd]] += shift[odd]
    return np.clip(designs, 0.0, 1.0)


def _insertions(problem: Problem, design: Floats, rng: np.random.Generator) -> Floats:
    """Propose moves of one domino to another place; those between shift by one, the gaps stay."""
    pairs = problem.scene.count - 1
    thickness = design[-pairs:]
    designs = np.repeat(design[None], PROPOSALS, axis=0)
    for proposal in designs:
        i, j = rng.integers(pairs, size=2)
        proposal[-pairs:] = np.insert(np.delete(thickness, i), j, thickness[i])
    return designs
