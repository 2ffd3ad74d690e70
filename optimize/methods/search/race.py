"""The default: many climbs that work with the structure of good rows.

1. Starts: the best uniform row, as it is and with one to a few tight gaps (and thick dominoes) at
   its end, which is what local climbs get wrong. All of them climb in lockstep, as one batch, and
   every round the worse half is dropped (successive halving), so that most gradients go where they
   pay.
2. Then good rows are changed by structured moves; many are scored, the best few climb a little, and
   those that come near the best climb on. Moves that have paid are drawn more often.
3. Beside it others do the same from random starts, each with a generator of its own and in the same
   batches. Where one of them gains no more its best is an independent opinion of what can be
   reached: it is joined with the best so far, start to end and end to start, and begins anew.

The search is done when moves gain nothing any more and enough of the independent climbs agree with
the best; where they never do, when twice as much was spent as the last gain took. Both count
evaluations, so that the end does not depend on the machine.

A long row begins as a shorter one ended, stretched: see `long_rows`.
A row that stands on a floor is searched on the analytic model first; from there its ratio to the
standing speed is learned from the rows that are toppled: see `two_fidelities`.
A schedule is first tried to be met by least squares, as `gauss-newton` does.

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

from domino_env.core.types import distinct_rows
from optimize.evaluator import Budget
from optimize.methods.gradient import least_squares
from optimize.methods.gradient.local_search import Refined, climbing
from optimize.methods.gradient.lockstep import Asked, Search, side_by_side
from optimize.methods.schedules import schedule
from optimize.methods.search import assignment, two_fidelities
from optimize.methods.search.long_rows import best_stretched, is_long
from optimize.methods.search.perturbations import (
    MOVES,
    TIGHT_AT_MOST,
    bend,
    free_the_end,
    tight_end,
)
from optimize.problem import Problem
from optimize.variables import Floats

FIRST = 12  # gradients of every start
WIDE = 8  # children that climb together
DRAWN = 32  # children that are drawn for these
SHORT, MORE = 10, 60  # gradients of a child, and of one that came near the best
NEAR = 3e-4  # relative distance to the best that counts as near
ELITE = 8  # rows that children come from
COARSE = (28, 110)  # numbers of the schedules that long rows climb on first
FEW = 2  # random starts of a long row, where each takes long
LONG = 200  # places from which on a row is long
PATIENCE, GAIN = 6, 3e-6  # generations without a relative gain after which a search has settled
LONGEST = 2000  # dominoes up to which generations pay; then another shorter row gains more
ALIKE = 1e-3  # largest distance of two designs that are one
ABROAD = 3  # independent searches beside the first
AGREE = 5e-5  # relative distance within which two of them agree
ENOUGH = 3  # of them that agree, and the search is done
MANY, AGAIN = 8, 2.0  # of them that need not agree, once so many times the evaluations were spent


def run(budget: Budget, rng: np.random.Generator) -> None:
    """Race the starts, then change and climb, at home and abroad, until nothing is gained."""
    if budget.problem.scene.floor_friction is not None:
        two_fidelities.run(budget, rng, run)  # the same on the analytic model first
        return
    if budget.problem.scene.stock is not None:
        assignment.run(budget, rng)  # what stands where decides, and no climb can change it
        return
    search = _Search(budget, _Elite(budget.problem))
    if budget.problem.scene.tempo is not None:
        if least_squares.is_soon_on_time(budget, rng):
            budget.standing = least_squares.ON_SCHEDULE
            return
        search.ends.append((budget.best_score, budget.best))
    budget.standing = "no independent climbs have ended yet; a longer search may find more"
    if is_long(budget.problem.scene):
        search.stretch(rng)
        if budget.problem.scene.count > LONGEST:
            return
    elif budget.problem.scene.count <= LONG:  # a batch by itself, and soon over
        side_by_side(budget, [_race(search.home, starts(budget.problem))])
    first, *others = rng.spawn(1 + ABROAD)
    side_by_side(budget, [search.at_home(first), *map(search.abroad, others)])


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
    for _ in range(WIDE if mark.shape[1] <= LONG else FEW):
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
    """The best rows so far that are not alike, and which moves have paid.

    guests: the best of other searches, to be joined with.
    idle: rows tried since the last gain.
    """

    problem: Problem
    rows: list[tuple[float, Floats]] = field(default_factory=list)
    paid: Floats = field(default_factory=lambda: np.ones(len(MOVES)))
    guests: list[Floats] = field(default_factory=list)
    idle: int = 0

    @property
    def score(self) -> float:
        return self.rows[0][0]

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
        if self.guests and rng.random() < 0.5:
            other = _columns(self.problem, self.guests[int(rng.integers(len(self.guests)))])
        move = int(rng.choice(len(MOVES), p=self.paid / self.paid.sum()))
        child = MOVES[move](parent, other, rng)
        if rng.random() < 0.25:
            move = int(rng.integers(len(MOVES)))
            child = MOVES[move](child, other, rng)
        return np.clip(child.ravel(), 0.0, 1.0), move

    def children(self, rng: np.random.Generator) -> tuple[Floats, list[int]]:
        """A generation of changed rows, and which moves have changed them."""
        drawn = [self.child(rng) for _ in range(DRAWN)]
        return np.array([design for design, _ in drawn]), [move for _, move in drawn]

    def joined(self, guest: Floats, rng: np.random.Generator) -> Floats:
        """The best row and a guest, the start of the one before the end of the other."""
        ours, theirs = (_columns(self.problem, row) for row in (self.rows[0][1], guest))
        pairs = ours.shape[1]
        cuts = rng.choice(pairs, min(DRAWN // 2, pairs), replace=False)
        at = np.arange(pairs) < cuts[:, None, None]
        both = np.concatenate([np.where(at, ours, theirs), np.where(at, theirs, ours)])
        return both.reshape(len(both), -1)

    def learn(self, move: int, *, gained: bool) -> None:
        self.paid[move] = np.clip(self.paid[move] * (1.5 if gained else 0.97), 0.2, 5.0)


@dataclass
class _Search:
    """One search at home, which is done some day, and others abroad, which are not.

    ends: what every one of these has come to, score and design.
    """

    budget: Budget
    home: _Elite
    ends: list[tuple[float, Floats]] = field(default_factory=list)

    def stretch(self, rng: np.random.Generator) -> None:
        """Begin a long row as a shorter one ended; one that is very long ends so too."""
        problem = self.home.problem
        mark = problem.design(problem.scene.uniform().layout)
        self.home.add(self.budget.score(mark), mark)
        self.home.add(*best_stretched(self.budget, rng, run))
        while problem.scene.count > LONGEST and not self.done():
            self.ends.append(best_stretched(self.budget, rng, run))
            self.home.add(*self.ends[-1])

    def at_home(self, rng: np.random.Generator) -> Search:
        if not self.home.rows:
            yield from _race(self.home, starts(self.home.problem))
        yield from _settle(self.home, rng)
        met = 0
        while not self.done():
            while met == len(self.ends):
                yield None
            for score, design in self.ends[met:]:
                met += 1
                self.home.add(score, design)
                self.home.guests.append(design)
                yield from _generation(self.home, self.home.joined(design, rng), rng)
            yield from _settle(self.home, rng)

    def abroad(self, rng: np.random.Generator) -> Search:
        while True:
            elite = _Elite(self.home.problem)
            yield from _race(elite, random_starts(self.home.problem, rng))
            yield from _settle(elite, rng)
            self.ends.append(elite.rows[0])

    def done(self) -> bool:
        """Whether to stop; says in any case how much the best is to be trusted."""
        best = max([self.home.score, *(score for score, _ in self.ends)])
        # of a schedule, what is left to gain is what counts
        scale = abs(best) if self.home.problem.scene.tempo is None else 1.0 - best
        agree = sum(score >= best - AGREE * scale for score, _ in self.ends)
        words = f"{agree} of {len(self.ends)} independent climbs agree to {AGREE:.3%}"
        self.budget.standing = f"{words}, {self.home.idle} moves without gain"
        if agree >= ENOUGH:
            return True
        self.budget.standing += "; a longer search may find more"
        return len(self.ends) >= MANY and self.budget.spent >= AGAIN * self.budget.gained


def _race(elite: _Elite, designs: Floats) -> Search:
    scores, _ = yield Asked(designs)
    order = np.argsort(-scores, kind="stable")
    for i in order:
        elite.add(float(scores[i]), designs[i])
    levels = _levels(elite.problem, COARSE)
    arms = [Refined(designs[i], *levels) for i in order if scores[i] > 0.0]
    gradients = FIRST
    while arms:
        yield from climbing(arms, gradients)
        arms.sort(key=lambda arm: -arm.score)
        for arm in arms:
            elite.add(arm.score, arm.design)
        arms = [arm for arm in arms[: (len(arms) + 1) // 2] if not arm.done]
        gradients *= 2


def _settle(elite: _Elite, rng: np.random.Generator) -> Search:
    """One generation after the other until several in a row have gained nothing."""
    idle = 0
    while idle < PATIENCE:
        before = elite.score
        children, moves = elite.children(rng)
        yield from _generation(elite, children, rng, moves)
        idle = 0 if elite.score > before + GAIN * abs(before) else idle + 1


def _generation(
    elite: _Elite, drawn: Floats, rng: np.random.Generator, moves: Sequence[int] = ()
) -> Search:
    """Score changed rows and climb a little with some of them; moves: what has changed them."""
    designs = elite.problem.project(drawn)
    scores, _ = yield Asked(designs)
    before = elite.score
    order = np.argsort(-scores, kind="stable")
    # the best by their score, and some by chance: what a climb can make of them shows later
    chosen = [*order[: WIDE // 2], *rng.permutation(order[WIDE // 2 :])[: WIDE // 2]]
    for i in order[: WIDE // 2]:
        elite.add(float(scores[i]), designs[i])
    levels = _levels(elite.problem, COARSE[1:])
    arms = {int(i): Refined(designs[i], *levels) for i in chosen if scores[i] > 0.0}
    yield from climbing(list(arms.values()), SHORT)
    near = [i for i, arm in arms.items() if arm.score > before - NEAR * abs(before)]
    near.sort(key=lambda i: -arms[i].score)
    yield from climbing([arms[i] for i in near[: WIDE // 2]], MORE)
    best = max((arm.score for arm in arms.values()), default=-np.inf)
    for i, arm in arms.items():
        elite.add(arm.score, arm.design)
        gained = arm.score == best and best > before * (1.0 + 1e-6)
        if moves:
            elite.learn(moves[i], gained=gained)
        if gained:
            yield from climbing([arm], 4 * MORE)
            elite.add(arm.score, arm.design)
    elite.idle = 0 if elite.score > before + GAIN * abs(before) else elite.idle + len(designs)


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
