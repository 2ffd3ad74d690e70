"""The default: many local searches that use the structure of good layouts.

1. Starts: the uniform baseline, as it is and with one to a few tight gaps (and thick dominoes) at
   its end, which local searches get wrong. Local searches from all of them advance in lockstep, as
   one batch, and every round the worse half is dropped (successive halving).
2. Perturbations change good layouts. Many are scored, short local searches refine the best few, and
   those that come near the best continue. Perturbations that gained are drawn more often.
3. Three islands do the same from random starts, each with its own generator and in the same
   batches. Where an island gains no more, its best is an independent estimate of what can be
   reached: it migrates to the main search, where it is joined with the best so far, start to end
   and end to start, and the island begins anew.

The search is done when perturbations gain nothing any more and enough of the islands agree with the
best; where they never do, when twice as much was spent as the last gain took. Both count
evaluations, so that the end does not depend on the machine.

A long layout begins as a stretched shorter one: see `long_layouts`. A free-standing layout is
searched on the analytic model first: see `two_fidelities`. A schedule is first fitted by least
squares, as `gauss-newton` does. Where the score has no gradient, on a grid or where all waves stop,
only perturbations are left.

References
----------
Jamieson, K., Talwalkar, A. (2016). Non-stochastic best arm identification and hyperparameter
optimization. AISTATS, 240-248 (successive halving).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from domino_env.core.types import Floats, unique_points
from optimize.evaluator import Evaluator
from optimize.methods.gradient import least_squares
from optimize.methods.gradient.local_search import CoarseToFine, advance
from optimize.methods.gradient.lockstep import Request, Search, run_in_lockstep
from optimize.methods.search import assignment, two_fidelities
from optimize.methods.search.long_layouts import best_stretched, is_long
from optimize.methods.search.perturbations import (
    PERTURBATIONS,
    TIGHT_AT_MOST,
    bend,
    free_the_end,
    tight_end,
)
from optimize.methods.starts import schedule, uniform_design
from optimize.problem import Problem

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
ISLANDS = 3  # independent searches beside the main one
AGREE = 5e-5  # relative distance within which two of them agree
ENOUGH = 3  # of them that agree, and the search is done
MANY, AGAIN = 8, 2.0  # of them that need not agree, once so many times the evaluations were spent


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Race the starts, then perturb and refine, with islands, until nothing is gained."""
    if evaluator.problem.scene.floor_friction is not None:
        two_fidelities.run(evaluator, rng, run)  # this search on the analytic model first
        return
    if evaluator.problem.scene.stock is not None:
        assignment.run(evaluator, rng)  # the order decides, which no local search can change
        return
    search = _Search(evaluator, _Elite(evaluator.problem))
    if evaluator.problem.scene.tempo is not None:
        if least_squares.is_soon_on_time(evaluator, rng):
            evaluator.status = least_squares.ON_SCHEDULE
            return
        search.ends.append((evaluator.best_score, evaluator.best))
    evaluator.status = "no independent searches have ended yet; a longer search may find more"
    if is_long(evaluator.problem.scene):
        search.stretch(rng)
        if evaluator.problem.scene.count > LONGEST:
            return
    elif evaluator.problem.scene.count <= LONG:  # a batch by itself, and soon over
        run_in_lockstep(evaluator, [_race(search.elite, starts(evaluator.problem))])
    first, *others = rng.spawn(1 + ISLANDS)
    run_in_lockstep(evaluator, [search.main(first), *map(search.island, others)])


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
    return unique_points(np.array([design.ravel() for design in found]))


def random_starts(problem: Problem, rng: np.random.Generator) -> Floats:
    """Draw rows with random hills and hollows, a random end, random thickness.

    Returns
    -------
    ndarray
        (B, n) designs, based on the best uniform row, that keep the rules.
    """
    mark = _columns(problem, uniform_design(problem))
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
    """The best layouts so far that are not alike, and the success of each perturbation.

    migrants: the best of the islands, to be joined with.
    idle: layouts tried since the last gain.
    """

    problem: Problem
    rows: list[tuple[float, Floats]] = field(default_factory=list)
    weights: Floats = field(default_factory=lambda: np.ones(len(PERTURBATIONS)))
    migrants: list[Floats] = field(default_factory=list)
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
        """A perturbed layout, and the index of its perturbation."""
        ranks = np.minimum(rng.geometric(0.35, 2) - 1, len(self.rows) - 1)
        parent, other = (_columns(self.problem, self.rows[r][1]) for r in ranks)
        if self.migrants and rng.random() < 0.5:
            other = _columns(self.problem, self.migrants[int(rng.integers(len(self.migrants)))])
        move = int(rng.choice(len(PERTURBATIONS), p=self.weights / self.weights.sum()))
        child = PERTURBATIONS[move](parent, other, rng)
        if rng.random() < 0.25:
            move = int(rng.integers(len(PERTURBATIONS)))
            child = PERTURBATIONS[move](child, other, rng)
        return np.clip(child.ravel(), 0.0, 1.0), move

    def children(self, rng: np.random.Generator) -> tuple[Floats, list[int]]:
        """A generation of perturbed layouts, and the indices of their perturbations."""
        drawn = [self.child(rng) for _ in range(DRAWN)]
        return np.array([design for design, _ in drawn]), [move for _, move in drawn]

    def joined(self, migrant: Floats, rng: np.random.Generator) -> Floats:
        """The best layout and a migrant, the start of one joined to the end of the other."""
        ours, theirs = (_columns(self.problem, row) for row in (self.rows[0][1], migrant))
        pairs = ours.shape[1]
        cuts = rng.choice(pairs, min(DRAWN // 2, pairs), replace=False)
        at = np.arange(pairs) < cuts[:, None, None]
        both = np.concatenate([np.where(at, ours, theirs), np.where(at, theirs, ours)])
        return both.reshape(len(both), -1)

    def learn(self, move: int, *, gained: bool) -> None:
        self.weights[move] = np.clip(self.weights[move] * (1.5 if gained else 0.97), 0.2, 5.0)


@dataclass
class _Search:
    """The main search, which ends, and the islands, which begin anew.

    ends: score and design vector that each island has come to.
    """

    evaluator: Evaluator
    elite: _Elite
    ends: list[tuple[float, Floats]] = field(default_factory=list)

    def stretch(self, rng: np.random.Generator) -> None:
        """Begin a long layout as a stretched shorter one; a very long one ends so too."""
        problem = self.elite.problem
        mark = uniform_design(problem)
        self.elite.add(float(self.evaluator.evaluate(mark).score), mark)
        self.elite.add(*best_stretched(self.evaluator, rng, run))
        while problem.scene.count > LONGEST and not self.done():
            self.ends.append(best_stretched(self.evaluator, rng, run))
            self.elite.add(*self.ends[-1])

    def main(self, rng: np.random.Generator) -> Search:
        if not self.elite.rows:
            yield from _race(self.elite, starts(self.elite.problem))
        yield from _settle(self.elite, rng)
        met = 0
        while not self.done():
            while met == len(self.ends):
                yield None
            for score, design in self.ends[met:]:
                met += 1
                self.elite.add(score, design)
                self.elite.migrants.append(design)
                yield from _generation(self.elite, self.elite.joined(design, rng), rng)
            yield from _settle(self.elite, rng)

    def island(self, rng: np.random.Generator) -> Search:
        while True:
            elite = _Elite(self.elite.problem)
            yield from _race(elite, random_starts(self.elite.problem, rng))
            yield from _settle(elite, rng)
            self.ends.append(elite.rows[0])

    def done(self) -> bool:
        """Return whether to stop, and report how reliable the best is."""
        best = max([self.elite.score, *(score for score, _ in self.ends)])
        # of a schedule, what is left to gain is what counts
        scale = abs(best) if self.elite.problem.scene.tempo is None else 1.0 - best
        agree = sum(score >= best - AGREE * scale for score, _ in self.ends)
        words = f"{agree} of {len(self.ends)} independent searches agree to {AGREE:.3%}"
        self.evaluator.status = f"{words}, {self.elite.idle} perturbations without gain"
        if agree >= ENOUGH:
            return True
        self.evaluator.status += "; a longer search may find more"
        return (
            len(self.ends) >= MANY and self.evaluator.evaluations >= AGAIN * self.evaluator.gained
        )


def _race(elite: _Elite, designs: Floats) -> Search:
    scores, _ = yield Request(designs)
    order = np.argsort(-scores, kind="stable")
    for i in order:
        elite.add(float(scores[i]), designs[i])
    levels = _levels(elite.problem, COARSE)
    arms = [CoarseToFine(designs[i], *levels) for i in order if scores[i] > 0.0]
    gradients = FIRST
    while arms:
        yield from advance(arms, gradients)
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
    """Score perturbed layouts and refine some of them; moves: indices of their perturbations."""
    designs = elite.problem.project(drawn)
    scores, _ = yield Request(designs)
    before = elite.score
    order = np.argsort(-scores, kind="stable")
    # the best by their score, and some by chance: what a climb can make of them shows later
    chosen = [*order[: WIDE // 2], *rng.permutation(order[WIDE // 2 :])[: WIDE // 2]]
    for i in order[: WIDE // 2]:
        elite.add(float(scores[i]), designs[i])
    levels = _levels(elite.problem, COARSE[1:])
    arms = {int(i): CoarseToFine(designs[i], *levels) for i in chosen if scores[i] > 0.0}
    yield from advance(list(arms.values()), SHORT)
    near = [i for i, arm in arms.items() if arm.score > before - NEAR * abs(before)]
    near.sort(key=lambda i: -arms[i].score)
    yield from advance([arms[i] for i in near[: WIDE // 2]], MORE)
    best = max((arm.score for arm in arms.values()), default=-np.inf)
    for i, arm in arms.items():
        elite.add(arm.score, arm.design)
        gained = arm.score == best and best > before * (1.0 + 1e-6)
        if moves:
            elite.learn(moves[i], gained=gained)
        if gained:
            yield from advance([arm], 4 * MORE)
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
