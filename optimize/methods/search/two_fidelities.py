"""Free-standing layouts on a floor: a search with the analytic model and a fitted correction.

A free-standing simulation takes as long as ten thousand analytic ones. The ratio of its speed to
the analytic one changes little and smoothly with the layout, most with the last gaps. So `auto`
searches with the analytic model first, twice with different random numbers, and simulates the best
layouts free-standing. Then it fits the ratio: its logarithm near the best layout as a linear
function of the design vector, by regression with a prior of similar coefficients for neighbours,
and the residuals as a Gaussian process. In every round, perturbations change the best layouts, and
local searches maximise the analytic speed times the ratio, each with coefficients drawn from their
posterior. The layouts of the highest predicted score are simulated free-standing, which improves
the fit. The search is done when several rounds gain nothing.

Only free-standing simulations count as evaluations; the analytic ones of a round, some two thousand
gradients, take less time than its eight free-standing ones.

References
----------
Alexandrov, N. M., Lewis, R. M. (2001). An overview of first-order model management for engineering
optimization. Optimization and Engineering 2, 413-430 (search on a corrected cheap model).

Thompson, W. R. (1933). On the likelihood that one unknown probability exceeds another in view of
the evidence of two samples. Biometrika 25, 285-294 (draws from the posterior).
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from domino_env.core.types import Floats
from optimize.evaluator import TOLERANCE, BudgetSpent, Evaluator
from optimize.methods.gradient.local_search import LocalSearch
from optimize.methods.registry import Method
from optimize.methods.search.perturbations import PERTURBATIONS
from optimize.problem import Problem

ANALYTIC_RUNS, ANALYTIC_EVALUATIONS = 2, 3000  # analytic searches, and evaluations of each
BATCH = 8  # layouts that are simulated free-standing in one batch
# Distances of layouts are the largest differences of their design vectors.
LEAST_DISTANCE = 0.02  # distance above which two candidates differ enough
MARGIN = 0.02  # relative distance to the best analytic score up to which a layout is a candidate
# layouts that are changed, local searches, gradients of each
PARENTS, SEARCHES, GRADIENTS = 4, 24, 80
# probability that the best layout is a parent, then the next best, and so on
PARENT_PROBABILITY = 0.5
ALIKE_DISTANCE = 1e-3  # distance up to which only one of two layouts is simulated free-standing
PATIENCE, LEAST_GAIN = 5, 3e-5  # rounds without this relative gain after which the search is done
# largest distance of a variable from the best at which the logarithm of the ratio is linear
LINEAR_RANGE = 0.1
# prior standard deviation of a coefficient, which is the change of the logarithm of the ratio over
# the range of a variable, and of a residual
PRIOR_DEVIATION = 1e-3
CORRELATED_PLACES = 2.0  # correlation length of the coefficients, in places
SHARED = 0.5  # fraction of the prior variance that neighbours share
CORRELATION_LENGTH = 0.3  # of the residuals, as a Euclidean distance of design vectors
NOISE = 3e-5  # standard deviation of a free-standing score, relative


def run(evaluator: Evaluator, rng: np.random.Generator, analytic_method: Method) -> None:
    """Search for the layout that is fastest on the floor of the scene.

    Parameters
    ----------
    evaluator
        Evaluator of a scene with a floor.
    rng
        Random generator of the search.
    analytic_method
        Method that searches the analytic model.
    """
    analytic = Problem(evaluator.problem.scene.on_pivots)
    layouts = _SimulatedLayouts(evaluator, analytic)
    layouts.evaluate(evaluator.problem.design(evaluator.problem.scene.uniform().layout)[None])
    layouts.evaluate(_candidates(evaluator, analytic, analytic_method, rng))
    idle = 0
    while idle < PATIENCE or not evaluator.may_end:
        best_score, designs = layouts.score, _propose(layouts, rng)
        if not len(designs):
            return
        layouts.evaluate(designs)
        idle = 0 if layouts.score > best_score + LEAST_GAIN * abs(best_score) else idle + 1
        effort = f"{evaluator.evaluations} free-standing layouts simulated"
        evaluator.status = f"{effort}, the last {idle} rounds without gain"


def _candidates(
    evaluator: Evaluator, analytic: Problem, method: Method, rng: np.random.Generator
) -> Floats:
    """Return design vectors (C, n) that differ and have high analytic scores.

    The number of analytic evaluations is fixed, so that a resumed search repeats them.
    """
    finalists: list[tuple[float, Floats]] = []
    for generator in rng.spawn(ANALYTIC_RUNS):
        if evaluator.progress >= 1.0:
            raise BudgetSpent
        limits = ANALYTIC_EVALUATIONS, evaluator.remaining_seconds
        analytic_evaluator = Evaluator(analytic, *limits, tolerance=TOLERANCE)  # may end early
        with suppress(BudgetSpent):
            method(analytic_evaluator, generator)
        finalists += analytic_evaluator.finalists
    finalists.sort(key=lambda finalist: -finalist[0])
    best = finalists[0][0]
    picks: list[Floats] = []
    for score, design in finalists:
        distance = min((float(np.abs(design - previous).max()) for previous in picks), default=1.0)
        if distance > LEAST_DISTANCE and score > best - MARGIN * abs(best):
            picks.append(design)
    return np.array(picks[:BATCH])


class _SimulatedLayouts:
    """Layouts simulated in both models so far, and the fit of the ratios of their scores.

    Attributes
    ----------
    evaluator
        Evaluator of the free-standing layouts.
    analytic
        Problem of the analytic model.
    designs
        (K, n) design vectors of the layouts.
    scores
        (K,) their free-standing scores.
    log_ratios
        (K,) logarithms of free-standing over analytic scores; nan if one of the waves stops.
    prior
        (n, n) prior covariance of the coefficients of the ratio.
    """

    def __init__(self, evaluator: Evaluator, analytic: Problem) -> None:
        self.evaluator, self.analytic = evaluator, analytic
        self.designs = np.empty((0, analytic.dimension))
        self.scores, self.log_ratios = np.empty(0), np.empty(0)
        place = np.arange(analytic.dimension)
        kernel = np.exp(-0.5 * ((place[:, None] - place[None]) / CORRELATED_PLACES) ** 2)
        pairs = analytic.scene.count - 1
        kernel[place[:, None] // pairs != place[None] // pairs] = 0.0  # gaps and thicknesses differ
        identity = np.eye(analytic.dimension)
        self.prior = PRIOR_DEVIATION**2 * (SHARED * kernel + (1.0 - SHARED) * identity)

    @property
    def score(self) -> float:
        """Best free-standing score."""
        return float(self.scores.max())

    @property
    def best(self) -> Floats:
        """Design vector (n,) of the best free-standing score."""
        return np.asarray(self.designs[int(np.argmax(self.scores))])

    def evaluate(self, designs: Floats) -> None:
        """Simulate layouts in both models and add them."""
        scores = self.evaluator.evaluate(designs).score
        analytic = self.analytic.evaluate(designs).score
        completes = (scores > 0.0) & (analytic > 0.0)
        log_ratios = np.log(np.where(completes, scores, 1.0) / np.where(completes, analytic, 1.0))
        self.designs = np.concatenate([self.designs, designs])
        self.scores = np.concatenate([self.scores, scores])
        self.log_ratios = np.concatenate([self.log_ratios, np.where(completes, log_ratios, np.nan)])

    def draw_coefficients(self, number: int, rng: np.random.Generator) -> Floats:
        """Draw coefficients (number, n) from their posterior, except the first, the mean."""
        is_known = np.isfinite(self.log_ratios)
        designs, log_ratios = self.designs[is_known], self.log_ratios[is_known]
        offset = self._offset(designs)
        distance = np.abs(designs - self.best).max(axis=1, initial=0.0) / LINEAR_RANGE
        # layouts far from the best count less, because the ratio is linear only near it
        weight = 1.0 / (NOISE * (1.0 + distance)) ** 2
        mean_weight = weight / max(float(weight.sum()), 1.0)  # all 0 if no layout completes
        centred = offset - mean_weight @ offset
        weighted = weight[:, None] * centred
        covariance = np.linalg.inv(np.linalg.inv(self.prior) + weighted.T @ centred)
        mean = covariance @ (weighted.T @ (log_ratios - mean_weight @ log_ratios))
        root = np.linalg.cholesky(0.5 * (covariance + covariance.T))
        samples = mean + rng.standard_normal((number, len(mean))) @ root.T
        samples[0] = mean
        return np.asarray(samples)

    def correct(self, designs: Floats, coefficients: Floats) -> tuple[Floats, Floats]:
        """Return scores (B,) and gradients (B, n) of the analytic model times the linear ratio.

        Each of the B design vectors has its own coefficients (B, n).
        """
        analytic = self.analytic.evaluate(designs, True)
        completes = analytic.score > 0.0
        exponent = np.sum(coefficients * self._offset(designs), axis=1)
        factor = np.where(completes, np.exp(exponent), 1.0)
        inside = (np.abs(designs - self.best) < LINEAR_RANGE) & completes[:, None]
        scores = analytic.score * factor
        by_ratio = scores[:, None] * np.where(inside, coefficients, 0.0)
        return scores, factor[:, None] * analytic.gradient + by_ratio

    def predict(self, designs: Floats, coefficients: Floats) -> Floats:
        """Predict the scores (B,) of designs (B, n) by coefficients (n,) and the residuals."""
        scores, _ = self.correct(designs, np.repeat(coefficients[None], len(designs), axis=0))
        is_known = np.isfinite(self.log_ratios)
        if not is_known.any():
            return scores
        simulated, log_ratios = self.designs[is_known], self.log_ratios[is_known]
        best = int(np.argmax(self.scores[is_known]))
        residuals = log_ratios - log_ratios[best] - self._offset(simulated) @ coefficients
        covariance = _correlation(simulated, simulated)
        covariance += (NOISE / PRIOR_DEVIATION) ** 2 * np.eye(len(simulated))
        expected = _correlation(designs, simulated) @ np.linalg.solve(covariance, residuals)
        return np.where(scores > 0.0, scores * np.exp(expected), scores)

    def _offset(self, designs: Floats) -> Floats:
        """Return the differences (B, n) from the best, clipped to the range of the linear ratio."""
        return np.clip(designs - self.best, -LINEAR_RANGE, LINEAR_RANGE)


def _correlation(first: Floats, second: Floats) -> Floats:
    """Return the correlation (B, C) of the residuals of designs (B, n) and (C, n), from 0 to 1."""
    square = np.sum((first[:, None] - second[None]) ** 2, axis=2)
    return np.asarray(np.exp(-0.5 * square / CORRELATION_LENGTH**2))


def _propose(layouts: _SimulatedLayouts, rng: np.random.Generator) -> Floats:
    """Return design vectors (B, n) that differ and have high predicted scores."""
    problem, analytic = layouts.evaluator.problem, layouts.analytic
    order = np.argsort(-layouts.scores, kind="stable")[:PARENTS]
    pairs = problem.scene.count - 1
    designs = [layouts.best]
    for _ in range(SEARCHES - 1):
        ranks = np.minimum(rng.geometric(PARENT_PROBABILITY, 2) - 1, len(order) - 1)
        parent, donor = (layouts.designs[order[rank]].reshape(-1, pairs) for rank in ranks)
        candidate = PERTURBATIONS[int(rng.integers(len(PERTURBATIONS)))](parent, donor, rng)
        designs.append(np.clip(candidate.ravel(), 0.0, 1.0))
    coefficients = layouts.draw_coefficients(SEARCHES, rng)
    searches = [LocalSearch(design, analytic.project) for design in designs]
    _refine(layouts, searches, coefficients)
    ends = np.array([search.design for search in searches])
    predicted = layouts.predict(ends, coefficients[0])
    picks: list[int] = []
    for i in np.argsort(-predicted, kind="stable"):
        simulated = np.concatenate([layouts.designs, ends[picks]])
        if np.abs(simulated - ends[i]).max(axis=1).min() > ALIKE_DISTANCE and len(picks) < BATCH:
            picks.append(int(i))
    return ends[picks]


def _refine(layouts: _SimulatedLayouts, searches: list[LocalSearch], coefficients: Floats) -> None:
    """Advance local searches in lockstep on the corrected model, each with its own coefficients."""
    for _ in range(GRADIENTS):
        running = [i for i, search in enumerate(searches) if not search.done]
        if not running:
            return
        layouts.evaluator.require_more()
        candidates = np.array([searches[i].candidate for i in running])
        scores, gradients = layouts.correct(candidates, coefficients[running])
        for i, score, gradient in zip(running, scores, gradients, strict=True):
            searches[i].update(float(score), gradient)
