"""The default: many climbs that work with the structure of good rows.

1. Starts: the best uniform row, as it is and with one to a few tight gaps (and thick dominoes) at
   its end, which is what local climbs get wrong. All of them climb in lockstep, as one batch, and
   every round the worse half is dropped (successive halving), so that most gradients go where they
   pay.
2. Then good rows are changed by structured moves; many are scored, the best few climb a little, and
   those that come near the best climb on. Moves that have paid are drawn more often.
3. When that gains no more, the same begins abroad with random starts, and the best come home.

Where the score has no slope, on a grid or where all waves die, the moves alone do the search.

References
----------
Jamieson, K., Talwalkar, A. (2016). Non-stochastic best arm identification and hyperparameter
optimization. AISTATS, 240-248 (successive halving).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from domino_env.support.distinct import distinct_rows
from optimize.evaluation.budget import Budget
from optimize.methods.schedules import schedule
from optimize.methods.structured import assignment
from optimize.methods.structured.ascent import Refined, climb
from optimize.methods.structured.moves import MOVES, TIGHT_AT_MOST, bend, free_the_end, tight_end
from optimize.problem import Floats, Problem

FIRST = 12  # gradients of every start
WIDE = 8  # children that climb together
DRAWN = 32  # children that are drawn for these
SHORT, MORE = 10, 60  # gradients of a child, and of one that came near the best
NEAR = 3e-4  # relative distance to the best that counts as near
ELITE = 8  # rows that children come from
COARSE = (28, 110)  # numbers of the schedules that long rows climb on first
LONG = 200  # places from which on a row is long
PATIENCE, GAIN = 6, 3e-6  # generations without a relative gain after which to look elsewhere
EMIGRANTS = 2  # rows that come home from there
ALIKE = 1e-3  # largest distance of two designs that are one


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Race the starts, then change and climb, at home and abroad, until the budget is spent."""
    if budget.problem.scene.stock is not None:
        assignment.run(budget, rng)  # what stands where decides, and no climb can change it
        return
    home = _Elite(budget.problem)
    _race(budget, home, starts(budget.problem))
    while True:
        _settle(budget, home, rng)
        abroad = _Elite(budget.problem)
        _race(budget, abroad, random_starts(budget.problem, rng))
        _settle(budget, abroad, rng)
        for score, design in abroad.rows[:EMIGRANTS]:
            home.add(score, design)


def starts(problem: Problem) -> Floats:
    """Change the end of the best uniform row: tight gaps, extreme thicknesses.

    Returns
    -------
    ndarray
        (B, n) designs, that of the best uniform row first, each once.
    """
    uniform = problem.scene.uniform().layout
    row = _columns(problem, problem.design(uniform))
    found = [row]
    if problem.scene.free_spacing:
        most = min(TIGHT_AT_MOST - 2, row.shape[1] - 1)
        # the end of a long row hardly matters
        counts = range(1, most + 1) if row.shape[1] <= LONG else range(4, 5)
        found += [tight_end(row, count) for count in counts]
    if problem.scene.free_thickness:
        for design in list(found):
            thick = design.copy()
            thick[-1, -2:] = 1.0
            found.append(thick)
    return distinct_rows(np.array([design.ravel() for design in found]))


def random_starts(problem: Problem, rng: np.random.Generator) -> Floats:
    """Draw rows with random hills and hollows, a random end, random thickness.

    Returns
    -------
    ndarray
        (B, n) designs, based on the best uniform row, that keep the rules.
    """
    mark = _columns(problem, problem.design(problem.scene.uniform().layout))
    found = []
    for _ in range(WIDE):
        design = mark.copy()
        for part in design[1 if problem.scene.free_spacing else 0 :]:
            if rng.random() < 0.5:
                part[:] = rng.random()
        for _ in range(int(rng.integers(0, 5))):
            design = bend(design, design, rng)
        if problem.scene.free_spacing:
            most = min(TIGHT_AT_MOST, mark.shape[1] - 1)
            design = tight_end(design, int(rng.integers(0, most + 1)))
        for _ in range(int(rng.integers(0, 3))):
            design = free_the_end(design, design, rng)
        found.append(np.clip(design.ravel(), 0.0, 1.0))
    return problem.project(np.array(found))


@dataclass
class _Elite:
    """The best rows so far that are not alike, and which moves have paid."""

    problem: Problem
    rows: list[tuple[float, Floats]] = field(default_factory=list)
    paid: Floats = field(default_factory=lambda: np.ones(len(MOVES)))

    def add(self, score: float, design: Floats) -> None:
        alike = [
            i
            for i, (_, other) in enumerate(self.rows)
            if float(np.abs(other - design).max()) < ALIKE
        ]
        if any(self.rows[i][0] >= score for i in alike):
            return
        self.rows = [row for i, row in enumerate(self.rows) if i not in alike]
        self.rows.append((score, design.copy()))
        self.rows.sort(key=lambda row: -row[0])
        del self.rows[ELITE:]

    def child(self, rng: np.random.Generator) -> tuple[Floats, int]:
        """A changed row, and which move has changed it."""
        ranks = np.minimum(rng.geometric(0.35, 2) - 1, len(self.rows) - 1)
        parent, other = (_columns(self.problem, self.rows[r][1]) for r in ranks)
        move = int(rng.choice(len(MOVES), p=self.paid / self.paid.sum()))
        child = MOVES[move](parent, other, rng)
        if rng.random() < 0.25:
            move = int(rng.integers(len(MOVES)))
            child = MOVES[move](child, other, rng)
        return np.clip(child.ravel(), 0.0, 1.0), move

    def learn(self, move: int, *, gained: bool) -> None:
        self.paid[move] = np.clip(self.paid[move] * (1.5 if gained else 0.97), 0.2, 5.0)


def _race(budget: Budget, elite: _Elite, designs: Floats) -> None:
    scores = budget.scores(designs)
    order = np.argsort(-scores, kind="stable")
    for i in order:
        elite.add(float(scores[i]), designs[i])
    levels = _levels(budget.problem, COARSE)
    arms = [Refined(designs[i], *levels) for i in order if scores[i] > 0.0]
    gradients = FIRST
    while arms:
        climb(budget, arms, gradients)
        arms.sort(key=lambda arm: -arm.score)
        for arm in arms:
            elite.add(arm.score, arm.design)
        arms = [arm for arm in arms[: (len(arms) + 1) // 2] if not arm.done]
        gradients *= 2


def _settle(budget: Budget, elite: _Elite, rng: np.random.Generator) -> None:
    """One generation after the other until several in a row have gained nothing."""
    idle = 0
    while idle < PATIENCE:
        before = elite.rows[0][0]
        _generation(budget, elite, rng)
        idle = 0 if elite.rows[0][0] > before + GAIN * abs(before) else idle + 1


def _generation(budget: Budget, elite: _Elite, rng: np.random.Generator) -> None:
    drawn = [elite.child(rng) for _ in range(DRAWN)]
    designs = budget.problem.project(np.array([design for design, _ in drawn]))
    scores = budget.scores(designs)
    before = elite.rows[0][0]
    order = np.argsort(-scores, kind="stable")
    # the best by their score, and some by chance: what a climb can make of them shows later
    chosen = [*order[: WIDE // 2], *rng.choice(order[WIDE // 2 :], WIDE // 2, replace=False)]
    for i in order[: WIDE // 2]:
        elite.add(float(scores[i]), designs[i])
    levels = _levels(budget.problem, COARSE[1:])
    arms = {int(i): Refined(designs[i], *levels) for i in chosen if scores[i] > 0.0}
    climb(budget, list(arms.values()), SHORT)
    near = [i for i, arm in arms.items() if arm.score > before - NEAR * abs(before)]
    near.sort(key=lambda i: -arms[i].score)
    climb(budget, [arms[i] for i in near[: WIDE // 2]], MORE)
    best = max((arm.score for arm in arms.values()), default=-np.inf)
    for i, arm in arms.items():
        elite.add(arm.score, arm.design)
        gained = arm.score == best and best > before * (1.0 + 1e-6)
        elite.learn(drawn[i][1], gained=gained)
        if gained:
            climb(budget, [arm], 4 * MORE)
            elite.add(arm.score, arm.design)


def _levels(
    problem: Problem, most: Sequence[int]
) -> tuple[list[Floats], Callable[[Floats], Floats] | None]:
    """The schedules that a row is long enough for, and the projection where there is a length."""
    pairs = problem.scene.count - 1
    parts = problem.dimension // pairs
    matrices = [schedule(parts, pairs, parts * m) for m in most if m < pairs]
    return matrices, problem.project if problem.coupled else None


def _columns(problem: Problem, design: Floats) -> Floats:
    """(parts, pairs): gaps first, where they are free, then thicknesses."""
    return design.reshape(-1, problem.scene.count - 1)
