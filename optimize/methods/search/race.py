"""The default: many local searches that use the structure of good layouts.

1. Starts: the uniform baseline, unchanged and with one to a few tight gaps (and thick dominoes) at
   its end, whose number local searches cannot change. Local searches from all of them advance in
   lockstep, as one batch, and after every round the worse half ends (successive halving).
2. Perturbations change good layouts. Many changed layouts (children) are scored, short local
   searches refine some of them, and those near the best score continue. A perturbation that gained
   is drawn more often. If none gains anything, layouts with other numbers of tight gaps at the end
   compete like the starts.
3. Three islands (one for more than 64 dominoes) do the same from random starts, each with its own
   generator and in the same batches. The best layout of an island that gains nothing more is an
   independent estimate of the optimum. It migrates to the main search, where it is joined with the
   best so far, the start of one to the end of the other, and the island begins anew. If a length
   ties gaps and thicknesses together, SLSQP from random starts gets half of the effort: its steps
   along the length end in better layouts there, see `slsqp`.

Without a limit the search is done when perturbations gain nothing and enough of the islands agree
with the best or, after many islands, the second half of the effort gained nothing. Both depend on
evaluations, not on the speed of the machine. A search with a limit goes on until it is reached.
Without a limit, too, the evaluator ends the search when doubling the effort is
expected to gain less than the tolerance.

A search for a long layout begins with a stretched shorter one. Free-standing layouts are searched
with the analytic model first. A schedule is first fitted by least squares, as `gauss-newton` does.
If all waves stop or violate a limit, gradients are 0, and only perturbations change the layouts.

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
from optimize.methods.search import assignment, perturbations, two_fidelities
from optimize.methods.search.long_layouts import is_long, search_stretched
from optimize.methods.search.perturbations import MAX_TIGHT, PERTURBATIONS
from optimize.methods.starts import coarse_matrix, uniform_design
from optimize.methods.starts import starts as restarts
from optimize.problem import Problem

FIRST_GRADIENTS = 12  # gradients of every start in the first round
CHILDREN = 32  # children of a generation, all of which are scored
BATCH = 8  # children of a generation that are refined
# gradients of a child, of one near the best, of a new best
CHILD_GRADIENTS, NEAR_GRADIENTS, BEST_GRADIENTS = 10, 60, 240
MARGIN = 3e-4  # relative distance to the best score that counts as near
SUCCESS = 1e-6  # relative gain of a child that counts as success of its perturbation
# probability that the best layout is a parent, then the next best, and so on
PARENT_PROBABILITY = 0.35
# probability of a migrant as donor, and of a second perturbation
MIGRANT_PROBABILITY, SECOND_PROBABILITY = 0.5, 0.25
REWARD, PENALTY = 1.5, 0.97  # factors of the weight of a perturbation that gained, or did not
WEIGHTS = 0.2, 5.0  # least and largest weight: every perturbation remains possible
ELITE_SIZE = 8  # largest number of layouts from which children are made
# numbers of knots of the coarse layouts with which local searches with more places begin
COARSE_KNOTS = (28, 110)
MANY_PLACES = 200  # places above which a search has few starts, because each takes much time
FEW_STARTS = 2  # random starts with many places
MAX_TIGHT_STARTS = MAX_TIGHT - 2  # tight gaps at the end of the starts; perturbations add more
ONLY_TIGHT = 4  # number of tight gaps of a start with many places, whose end has little effect
THICK_DOMINOES = 2  # last dominoes of a start with the largest thickness
MAX_BENDS, MAX_END_CHANGES = 4, 2  # most bends and most changes of the end of a random start
LEAST_GAIN = 3e-6  # a smaller relative gain counts as zero
# A search has settled after so many generations in a row, each with at most this relative gain.
PATIENCE = (6, LEAST_GAIN)
# the same for the main search with many dominoes, and for an island with many
LARGE_PATIENCE, ISLAND_PATIENCE = (4, 2e-5), (2, 1e-4)
ALIKE_DISTANCE = 1e-3  # distance below which two design vectors count as the same
SLSQP_EFFORT = 0.5  # fraction of the effort for SLSQP, if a length ties gaps and thicknesses
ISLANDS = 3  # independent searches beside the main one
# dominoes above which there is one island, which begins when the main search has settled
MAX_PARALLEL = 64
AGREEMENT = 5e-5  # relative distance of scores within which an island agrees with the best
ENOUGH_ISLANDS = 3  # islands that agree with the best before the search is done
# what a longer search gains after such an agreement, measured in 60 searches of random scenes
SHORTFALL = "finds over 0.02 % more in one of 15 scenes"
STRETCHED = "a stretched and refined layout; a longer search, by --seconds, may find more"
# islands after which none has to agree, if the late gain is below this
MANY_ISLANDS, NO_GAIN = 8, 1e-5


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Search from the starts, then perturb and refine, with islands, until nothing is gained."""
    scene = evaluator.problem.scene
    if scene.simulator.is_slow:
        two_fidelities.run(evaluator, rng, run)  # calls this function for the analytic model
        return
    if scene.stock is not None:
        assignment.run(evaluator, rng)  # the score depends on the order of the dominoes
        return
    search = _Search(evaluator, _Elite(evaluator.problem))
    if evaluator.problem.schedule is not None:
        if least_squares.fits_schedule(evaluator, rng):
            evaluator.status = least_squares.ON_SCHEDULE
            return
        search.optima.append((evaluator.best_score, evaluator.best))
    evaluator.status = "no independent searches have ended yet; a longer search may find more"
    if is_long(scene):
        uniform = uniform_design(evaluator.problem)
        search.elite.add(float(evaluator.evaluate(uniform).score), uniform)
        search.elite.add(*search_stretched(evaluator, rng, run))
        if evaluator.may_end:
            evaluator.status = STRETCHED
            return
    elif scene.count <= MANY_PLACES:  # the starts alone fill a batch
        run_in_lockstep(evaluator, [_race(search.elite, starts(evaluator.problem))])
    islands = 1 if scene.count > MAX_PARALLEL else ISLANDS
    main, *generators = rng.spawn(1 + islands)
    searches = [search.main(main), *map(search.island, generators)]
    space = scene.space
    is_tied = space.length is not None and space.spacing.is_free and space.thickness.is_free
    if is_tied and scene.count <= MAX_PARALLEL:
        searches += map(search.slsqp_island, rng.spawn(1))
    run_in_lockstep(evaluator, searches)


def starts(problem: Problem) -> Floats:
    """Return the uniform baseline, unchanged and with tight gaps and thick dominoes at its end.

    Returns
    -------
    ndarray
        (B, n) different design vectors.
    """
    baseline = _as_parts(problem, uniform_design(problem))
    designs = [baseline]
    if problem.space.spacing.is_free:
        limit = min(MAX_TIGHT_STARTS, baseline.shape[1] - 1)
        counts = range(1, limit + 1) if baseline.shape[1] <= MANY_PLACES else [ONLY_TIGHT]
        designs += [perturbations.set_tight_gaps(baseline, count) for count in counts]
    if problem.space.thickness.is_free:
        for design in list(designs):
            thick_end = design.copy()
            thick_end[-1, -THICK_DOMINOES:] = 1.0
            designs.append(thick_end)
    return unique_points(np.array([design.ravel() for design in designs]))


def random_starts(problem: Problem, rng: np.random.Generator) -> Floats:
    """Draw variants of the uniform baseline with random bends, ends, thicknesses and growths.

    Returns
    -------
    ndarray
        (B, n) design vectors that keep the rules.
    """
    uniform = _as_parts(problem, uniform_design(problem))
    designs = []
    for _ in range(BATCH if uniform.shape[1] <= MANY_PLACES else FEW_STARTS):
        design = uniform.copy()
        for part in design[1 if problem.space.spacing.is_free else 0 :]:
            if rng.random() < 0.5:
                part[:] = rng.random()
        for _ in range(int(rng.integers(MAX_BENDS + 1))):
            design = perturbations.bend(design, design, rng)
        if problem.space.spacing.is_free:
            limit = min(MAX_TIGHT, uniform.shape[1] - 1)
            design = perturbations.set_tight_gaps(design, int(rng.integers(0, limit + 1)))
        for _ in range(int(rng.integers(MAX_END_CHANGES + 1))):
            design = perturbations.change_end(design, design, rng)
        designs.append(np.clip(design.ravel(), 0.0, 1.0))
    return problem.project(np.array(designs))


@dataclass
class _Elite:
    """Best layouts of a search so far, all different, and the weights of perturbations.

    Attributes
    ----------
    problem
        Problem of the search.
    layouts
        Score and design vector (n,) of each layout, the best first.
    weights
        Relative frequency of each perturbation.
    migrants
        Design vectors of the best layouts of the islands.
    idle
        Number of layouts tried since the last gain.
    """

    problem: Problem
    layouts: list[tuple[float, Floats]] = field(default_factory=list)
    weights: Floats = field(default_factory=lambda: np.ones(len(PERTURBATIONS)))
    migrants: list[Floats] = field(default_factory=list)
    idle: int = 0

    @property
    def score(self) -> float:
        """Best score."""
        return self.layouts[0][0]

    def add(self, score: float, design: Floats) -> None:
        """Add a layout, unless one that counts as the same has at least its score."""

        def is_alike(other: Floats) -> bool:
            return float(np.abs(other - design).max()) < ALIKE_DISTANCE

        if any(known_score >= score and is_alike(other) for known_score, other in self.layouts):
            return
        different = [layout for layout in self.layouts if not is_alike(layout[1])]
        different.append((score, design.copy()))  # after layouts of equal score
        self.layouts = sorted(different, key=lambda layout: -layout[0])[:ELITE_SIZE]

    def child(self, rng: np.random.Generator) -> tuple[Floats, int]:
        """Return a perturbed layout, and the index of its perturbation."""
        ranks = np.minimum(rng.geometric(PARENT_PROBABILITY, 2) - 1, len(self.layouts) - 1)
        parent, donor = (_as_parts(self.problem, self.layouts[r][1]) for r in ranks)
        if self.migrants and rng.random() < MIGRANT_PROBABILITY:
            donor = _as_parts(self.problem, self.migrants[int(rng.integers(len(self.migrants)))])
        index = int(rng.choice(len(PERTURBATIONS), p=self.weights / self.weights.sum()))
        child = PERTURBATIONS[index](parent, donor, rng)
        if rng.random() < SECOND_PROBABILITY:
            index = int(rng.integers(len(PERTURBATIONS)))
            child = PERTURBATIONS[index](child, donor, rng)
        return np.clip(child.ravel(), 0.0, 1.0), index

    def children(self, rng: np.random.Generator) -> tuple[Floats, list[int]]:
        """Return a generation of perturbed layouts, and the indices of their perturbations."""
        samples = [self.child(rng) for _ in range(CHILDREN)]
        return np.array([design for design, _ in samples]), [index for _, index in samples]

    def join(self, migrant: Floats, rng: np.random.Generator) -> Floats:
        """Join the best layout and a migrant, the start of one to the end of the other."""
        best = _as_parts(self.problem, self.layouts[0][1])
        migrant = _as_parts(self.problem, migrant)
        pairs = best.shape[1]
        cuts = rng.choice(pairs, min(CHILDREN // 2, pairs), replace=False)
        is_start = np.arange(pairs) < cuts[:, None, None]
        joined = [np.where(is_start, best, migrant), np.where(is_start, migrant, best)]
        return np.concatenate(joined).reshape(2 * len(cuts), -1)


@dataclass
class _Search:
    """Main search, which ends, and islands, which begin anew.

    Attributes
    ----------
    evaluator
        Evaluator of the problem.
    elite
        Best layouts of the main search.
    optima
        Best score and design vector of each independent search that has ended: of an island, or of
        the fit of a schedule.
    is_settled
        True once the main search has gained nothing for some generations.
    """

    evaluator: Evaluator
    elite: _Elite
    optima: list[tuple[float, Floats]] = field(default_factory=list)
    is_settled: bool = False

    def main(self, rng: np.random.Generator) -> Search:
        """Search from the starts, perturb, and join with the layouts of the islands."""
        if not self.elite.layouts:
            yield from _race(self.elite, starts(self.elite.problem))
        patience = LARGE_PATIENCE if self.elite.problem.scene.count > MAX_PARALLEL else PATIENCE
        yield from _settle(self.elite, rng, *patience)
        self.is_settled = True
        joined_count = 0
        while not self.is_done() or not self.evaluator.may_end:
            while joined_count == len(self.optima):
                yield None
            for score, design in self.optima[joined_count:]:
                joined_count += 1
                self.elite.add(score, design)
                self.elite.migrants.append(design)
                yield from _generation(self.elite, self.elite.join(design, rng), rng)
            yield from _settle(self.elite, rng, *patience)

    def island(self, rng: np.random.Generator) -> Search:
        """Search from random starts, again and again."""
        is_large = self.elite.problem.scene.count > MAX_PARALLEL
        while is_large and not self.is_settled:
            yield None
        while True:
            elite = _Elite(self.elite.problem)
            yield from _race(elite, random_starts(self.elite.problem, rng))
            yield from _settle(elite, rng, *(ISLAND_PATIENCE if is_large else PATIENCE))
            self.optima.append(elite.layouts[0])

    def slsqp_island(self, rng: np.random.Generator) -> Search:
        """Run SLSQP from one start after the other, with a fraction of the effort."""
        from optimize.methods.scipy_methods import descend  # SciPy's optimisers load slowly

        for start in restarts(self.evaluator, rng):
            effort = self.evaluator.effort
            descend("SLSQP", self.evaluator, start)
            self.elite.add(self.evaluator.best_score, self.evaluator.best)
            end = effort + (self.evaluator.effort - effort) / SLSQP_EFFORT
            while self.evaluator.effort < end:
                yield None

    def is_done(self) -> bool:
        """Return True at the end of the search; report the reliability of the best layout."""
        best = max([self.elite.score, *(score for score, _ in self.optima)])
        # for a schedule, distances are relative to the distance of the best from the score 1
        scale = abs(best) if self.elite.problem.schedule is None else 1.0 - best
        agree = sum(score >= best - AGREEMENT * scale for score, _ in self.optima)
        report = f"{agree} of {len(self.optima)} independent searches agree to {AGREEMENT:.3%}"
        report = f"{report}, {self.elite.idle} perturbations without gain; a longer search"
        self.evaluator.status = f"{report}, by --seconds, {SHORTFALL}"
        if agree >= ENOUGH_ISLANDS:
            return True
        self.evaluator.status = f"{report} may find more"
        return len(self.optima) >= MANY_ISLANDS and self.evaluator.late_gain < NO_GAIN


def _race(elite: _Elite, designs: Floats) -> Search:
    """Score all designs, and run local searches from those that complete, by successive halving."""
    scores, _ = yield Request(designs)
    order = np.argsort(-scores, kind="stable")
    for i in order:
        elite.add(float(scores[i]), designs[i])
    levels = _levels(elite.problem, COARSE_KNOTS)
    yield from _halve(elite, [CoarseToFine(designs[i], *levels) for i in order if scores[i] > 0.0])


def _halve(elite: _Elite, searches: list[CoarseToFine]) -> Search:
    """Advance local searches in rounds; after each the worse half ends and the gradients double."""
    gradients = FIRST_GRADIENTS
    while searches:
        yield from advance(searches, gradients)
        searches.sort(key=lambda local: -local.score)
        for local in searches:
            elite.add(local.score, local.design)
        searches = [local for local in searches[: (len(searches) + 1) // 2] if not local.done]
        gradients *= 2


def _settle(elite: _Elite, rng: np.random.Generator, patience: int, gain: float) -> Search:
    """Run generations until several in a row, and layouts with other ends, gain too little."""
    tried_counts: set[int] = set()
    while True:
        idle = 0
        while idle < patience:
            best_score = elite.score
            children, indices = elite.children(rng)
            yield from _generation(elite, children, rng, indices)
            idle = 0 if elite.score > best_score + gain * abs(best_score) else idle + 1
        best = _as_parts(elite.problem, elite.layouts[0][1])
        tight = perturbations.count_tight_gaps(best)
        if not elite.problem.space.spacing.is_free or tight in tried_counts:
            return
        tried_counts.add(tight)
        best_score = elite.score
        yield from _other_ends(elite, best, tight)
        if elite.score <= best_score + gain * abs(best_score):
            return


def _other_ends(elite: _Elite, best: Floats, tight: int) -> Search:
    """Refine layouts with other numbers of tight gaps; thicknesses shift with the gaps or stay."""
    designs = []
    for count in range(min(MAX_TIGHT, best.shape[1])):
        if count != tight:
            candidate = perturbations.set_tight_gaps(best, count)
            designs += [candidate.ravel(), np.concatenate([candidate[:1], best[1:]]).ravel()]
    projected = elite.problem.project(unique_points(np.array(designs)))
    levels = _levels(elite.problem, ())
    yield from _halve(elite, [CoarseToFine(design, *levels) for design in projected])


def _generation(
    elite: _Elite, samples: Floats, rng: np.random.Generator, indices: Sequence[int] = ()
) -> Search:
    """Score perturbed layouts and refine some of them.

    `indices` are those of their perturbations, whose weights are updated; empty if no perturbations
    made them.
    """
    designs = elite.problem.project(samples)
    scores, _ = yield Request(designs)
    best_score = elite.score
    order = np.argsort(-scores, kind="stable")
    # the best scores and some at random, from which a local search may gain more
    selection = [*order[: BATCH // 2], *rng.permutation(order[BATCH // 2 :])[: BATCH // 2]]
    for i in order[: BATCH // 2]:
        elite.add(float(scores[i]), designs[i])
    levels = _levels(elite.problem, COARSE_KNOTS[1:])
    searches = {int(i): CoarseToFine(designs[i], *levels) for i in selection if scores[i] > 0.0}
    yield from advance(list(searches.values()), CHILD_GRADIENTS)
    near = best_score - MARGIN * abs(best_score)
    promising = [i for i, local in searches.items() if local.score > near]
    promising.sort(key=lambda i: -searches[i].score)
    yield from advance([searches[i] for i in promising[: BATCH // 2]], NEAR_GRADIENTS)
    best = max((local.score for local in searches.values()), default=-np.inf)
    for i, local in searches.items():
        elite.add(local.score, local.design)
        has_gained = local.score == best and best > best_score * (1.0 + SUCCESS)
        if indices:
            weight = elite.weights[indices[i]] * (REWARD if has_gained else PENALTY)
            elite.weights[indices[i]] = np.clip(weight, *WEIGHTS)
        if has_gained:
            yield from advance([local], BEST_GRADIENTS)
            elite.add(local.score, local.design)
    has_gained = elite.score > best_score + LEAST_GAIN * abs(best_score)
    elite.idle = 0 if has_gained else elite.idle + len(designs)


def _levels(
    problem: Problem, sizes: Sequence[int]
) -> tuple[list[Floats], Callable[[Floats], Floats] | None, Floats | None]:
    """Return matrices of coarse layouts with `sizes` knots, and projection and normal or None."""
    pairs = problem.scene.count - 1
    parts = problem.dimension // pairs
    matrices = [coarse_matrix(parts, pairs, parts * size) for size in sizes if size < pairs]
    return matrices, problem.projection, problem.normal


def _as_parts(problem: Problem, design: Floats) -> Floats:
    """Return a design vector (n,) as an array (parts, pairs), see `perturbations`."""
    return design.reshape(-1, problem.scene.count - 1)
