"""Which domino goes where: assignments by HiGHS and exchanges, the gaps refined by climbs.

At a row whose gaps are as good as a climb makes them, the exact slopes tell what each place would
gain from each kind in the box.  The assignment that promises most, changing no more than so many
places, is a programme for HiGHS (see `optimize.constraints.stock`); besides, exchanges of two
places are tried.  The best few of all these climb a little in their gaps, and the best of those is
kept.  Values from a list go a step up or down instead.  Without either, only the climbs are left.
"""

from __future__ import annotations

import numpy as np

from domino_env.core.types import distinct_rows
from optimize.constraints.stock import assign
from optimize.evaluator import Budget
from optimize.methods.gradient.local_search import Ascent, climb
from optimize.methods.starts import starts
from optimize.problem import Problem
from optimize.variables import Floats

LONG, SHORT = 80, 10  # gradients of a climb
CHANGES = (2, 4, 8, 16)  # places that a programme may change
EXCHANGES = 200  # of each kind, tried of all
FEW = 8  # of the tried that climb
GAIN = 1e-6  # a smaller relative one is none
IDLE = 3  # rounds without gain that end a start


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Improve one start after the other until the budget is spent."""
    for start in starts(budget, rng):
        _improve(budget, start, rng)


def _improve(budget: Budget, start: Floats, rng: np.random.Generator) -> None:
    problem = budget.problem
    score, design = _climb(budget, problem.project(start[None]), LONG)
    idle = 0
    while problem.discrete and idle < IDLE:
        tried = _others(budget, design, rng, first=idle == 0)
        if len(tried) == 0:
            return
        found = budget.scores(tried)
        best = tried[np.argsort(-found, kind="stable")[:FEW]]
        ahead, there = _climb(budget, best, SHORT)
        if ahead > score + GAIN * abs(score):
            score, design, idle = ahead, there, 0
        else:
            idle += 1
    if problem.discrete:
        _climb(budget, design[None], LONG)


def _climb(budget: Budget, begins: Floats, gradients: int) -> tuple[float, Floats]:
    """The best of some rows after a climb each."""
    project = budget.problem.project if budget.problem.coupled else None
    arms = [Ascent(begin, project) for begin in begins]
    climb(budget, arms, gradients)
    best = max(arms, key=lambda arm: arm.score)
    return best.score, best.design


def _others(budget: Budget, design: Floats, rng: np.random.Generator, *, first: bool) -> Floats:
    """Rows that differ in what stands where, or in values from a list.

    first: whether this design is looked at for the first time.
    """
    problem = budget.problem
    stock = problem.scene.stock is not None
    found = []
    if stock:
        found += [_exchanged(problem, design, rng), _inserted(problem, design, rng)]
    if stock and first:
        found.append(_assigned(budget, design))
    if problem.scene.spacing_values or (problem.scene.thickness_values and not stock):
        found.append(_stepped(problem, design, rng))
    if not found:
        return np.empty((0, len(design)))
    near = problem.project(np.concatenate(found))
    return distinct_rows(near[np.any(near != design, axis=1)])


def _assigned(budget: Budget, design: Floats) -> Floats:
    """The most promising assignments that change few places."""
    problem = budget.problem
    assert problem.scene.stock is not None
    left = problem.scene.stock.without(problem.scene.first_thickness)
    kinds = np.array(left.thickness)
    pairs = problem.scene.count - 1
    _, slopes = budget.scores_and_gradients(design[None], of_dying=False, at_will=True)
    room = (problem.high - problem.low)[-pairs:]
    now = problem.low[-pairs:] + design[-pairs:] * room
    current = np.abs(now[:, None] - kinds).argmin(axis=1)
    prices = -(slopes[0, -pairs:] / room)[:, None] * (kinds - now[:, None])
    found = np.repeat(design[None], len(CHANGES), axis=0)
    for i, changes in enumerate(CHANGES):
        chosen = assign(prices, np.array(left.count), current, changes)
        found[i, -pairs:] = (kinds[chosen] - problem.low[-pairs:]) / room
    return found


def _exchanged(problem: Problem, design: Floats, rng: np.random.Generator) -> Floats:
    """Two dominoes that change places; their gaps stay, or the pivots do."""
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
    """One domino taken out and put in elsewhere; those between move up; the gaps stay."""
    pairs = problem.scene.count - 1
    found = np.repeat(design[None], EXCHANGES, axis=0)
    for row in found:
        i, j = rng.integers(pairs, size=2)
        body = np.delete(row[-pairs:], i)
        row[-pairs:] = np.insert(body, j, design[len(design) - pairs + i])
    return found


def _stepped(problem: Problem, design: Floats, rng: np.random.Generator) -> Floats:
    """One value a step up or down, and, where a length is asked, another the other way."""
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
