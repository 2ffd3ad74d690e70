"""Order of the dominoes of a stock: assignments by HiGHS and exchanges, with local searches.

At a layout whose gaps a local search has refined, the exact gradient predicts the gain of each kind
of domino at each place. The assignment with the largest predicted gain and a limited number of
changes is an integer programme for HiGHS (see `optimize.constraints.stock`); besides, exchanges of
two places are tried. Short local searches refine the gaps of the best few of all these, and the
best of those is kept. Values from a list change by a step up or down instead. Without either, only
the local searches are left.
"""

from __future__ import annotations

import numpy as np

from domino_env.core.types import Floats, unique_points
from optimize.constraints.stock import assign
from optimize.evaluator import Evaluator
from optimize.methods.gradient.local_search import LocalSearch, run_local_searches
from optimize.methods.starts import starts
from optimize.problem import Problem

LONG, SHORT = 80, 10  # gradients of a thorough and of a quick local search
CHANGES = (2, 4, 8, 16)  # places that a programme may change
EXCHANGES = 200  # layouts of each kind that are tried
FEW = 8  # layouts of those tried that are refined
GAIN = 1e-6  # a smaller relative gain counts as none
IDLE = 3  # rounds without gain that end a start


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Improve one start after the other until a limit is reached."""
    for start in starts(evaluator, rng):
        _improve(evaluator, start, rng)


def _improve(evaluator: Evaluator, start: Floats, rng: np.random.Generator) -> None:
    problem = evaluator.problem
    score, design = _refined(evaluator, problem.project(start[None]), LONG)
    idle = 0
    while problem.discrete and idle < IDLE:
        tried = _others(evaluator, design, rng, first=idle == 0)
        if len(tried) == 0:
            return
        scores = evaluator.evaluate(tried).score
        best = tried[np.argsort(-scores, kind="stable")[:FEW]]
        ahead, there = _refined(evaluator, best, SHORT)
        if ahead > score + GAIN * abs(score):
            score, design, idle = ahead, there, 0
        else:
            idle += 1
    if problem.discrete:
        _refined(evaluator, design[None], LONG)


def _refined(evaluator: Evaluator, begins: Floats, gradients: int) -> tuple[float, Floats]:
    """Return the best score and design vector of local searches from some layouts."""
    project = evaluator.problem.project if evaluator.problem.coupled else None
    searches = [LocalSearch(begin, project) for begin in begins]
    run_local_searches(evaluator, searches, gradients)
    best = max(searches, key=lambda one: one.score)
    return best.score, best.design


def _others(
    evaluator: Evaluator, design: Floats, rng: np.random.Generator, *, first: bool
) -> Floats:
    """Propose layouts with another order, or other values from a list.

    first: this design vector is changed for the first time.
    """
    problem = evaluator.problem
    stock = problem.scene.stock is not None
    changed = []
    if stock:
        changed += [_exchanged(problem, design, rng), _inserted(problem, design, rng)]
    if stock and first:
        changed.append(_assigned(evaluator, design))
    if problem.scene.spacing_values or (problem.scene.thickness_values and not stock):
        changed.append(_stepped(problem, design, rng))
    if not changed:
        return np.empty((0, len(design)))
    near = problem.project(np.concatenate(changed))
    return unique_points(near[np.any(near != design, axis=1)])


def _assigned(evaluator: Evaluator, design: Floats) -> Floats:
    """Propose the assignments of the largest predicted gain that change few places."""
    problem = evaluator.problem
    assert problem.scene.stock is not None
    left = problem.scene.stock.without(problem.scene.first_thickness)
    kinds = np.array(left.thickness)
    pairs = problem.scene.count - 1
    gradient = evaluator.evaluate(design, True, differences=False, relaxed=True).gradient
    room = (problem.high - problem.low)[-pairs:]
    now = problem.low[-pairs:] + design[-pairs:] * room
    current = np.abs(now[:, None] - kinds).argmin(axis=1)
    costs = -(gradient[-pairs:] / room)[:, None] * (kinds - now[:, None])
    found = np.repeat(design[None], len(CHANGES), axis=0)
    for i, changes in enumerate(CHANGES):
        chosen = assign(costs, np.array(left.count), current, changes)
        found[i, -pairs:] = (kinds[chosen] - problem.low[-pairs:]) / room
    return found


def _exchanged(problem: Problem, design: Floats, rng: np.random.Generator) -> Floats:
    """Propose exchanges of two dominoes, with the same gaps or the same pivots."""
    pairs = problem.scene.count - 1
    body = design[-pairs:]
    first, second = np.nonzero(np.triu(np.abs(body[:, None] - body) > 1e-9))
    pick = rng.permutation(len(first))[:EXCHANGES]
    found = np.repeat(design[None], len(pick), axis=0)
    every = np.arange(len(pick))
    i, j = len(design) - pairs + first[pick], len(design) - pairs + second[pick]
    found[every, i], found[every, j] = design[j], design[i]
    if problem.scene.free_spacing:
        moved = every % 2 == 1
        scale = (problem.high - problem.low)[-1] / (problem.high - problem.low)[0]
        shift = scale * (design[j] - design[i])
        found[every[moved], first[pick][moved]] -= shift[moved]
        found[every[moved], second[pick][moved]] += shift[moved]
    return np.clip(found, 0.0, 1.0)


def _inserted(problem: Problem, design: Floats, rng: np.random.Generator) -> Floats:
    """Propose moves of one domino to another place; those between move up; the gaps stay."""
    pairs = problem.scene.count - 1
    found = np.repeat(design[None], EXCHANGES, axis=0)
    for one in found:
        i, j = rng.integers(pairs, size=2)
        body = np.delete(one[-pairs:], i)
        one[-pairs:] = np.insert(body, j, design[len(design) - pairs + i])
    return found


def _stepped(problem: Problem, design: Floats, rng: np.random.Generator) -> Floats:
    """Propose steps of one value up or down and, with a length, of another the other way."""
    values = problem.scene.spacing_values or problem.scene.thickness_values
    assert values is not None
    n = len(design)
    step = float(np.diff(values).mean()) / (problem.high - problem.low)
    found = np.repeat(design[None], EXCHANGES, axis=0)
    every = np.arange(EXCHANGES)
    for way in (1.0, -1.0) if problem.equality is not None else (0.0,):
        place = rng.integers(n, size=EXCHANGES)
        sign = way if way else rng.choice([-1.0, 1.0], EXCHANGES)
        found[every, place] += sign * step[place]
    return np.clip(found, 0.0, 1.0)
