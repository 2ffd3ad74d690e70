"""Free-standing layouts on a floor: a search on the analytic model, corrected by the slow one.

A free-standing simulation takes as long as ten thousand analytic ones, and its speed differs by a
ratio that changes little and smoothly from layout to layout, most with the last gaps. So `auto`
searches the analytic model first, twice with other random numbers, and the layouts that it finds
are simulated free-standing. From then on the ratio is learned: its logarithm as a linear function
of the design vector near the best, by regression with a prior under which neighbours have similar
slopes, and the residuals as a Gaussian process. Round after round, perturbations change the best
layouts, and local searches maximise the analytic speed times that ratio, each with slopes drawn
from their posterior. The most promising layouts are simulated free-standing, which improves the
ratio in turn. When that gains no more the search is done.

Only free-standing simulations count as evaluations; the analytic ones of a round, some two thousand
gradients, take less time than its eight free-standing ones.

References
----------
Alexandrov, N. M., Lewis, R. M. (2001). An overview of first-order model management for engineering
optimization. Optimization and Engineering 2, 413-430 (search on a cheap model that is corrected).

Thompson, W. R. (1933). On the likelihood that one unknown probability exceeds another in view of
the evidence of two samples. Biometrika 25, 285-294 (to try what is drawn from the posterior).
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from domino_env.core.types import Floats
from optimize.evaluator import BudgetSpent, Evaluator
from optimize.methods.gradient.local_search import LocalSearch
from optimize.methods.search.perturbations import PERTURBATIONS
from optimize.problem import Problem

Method = Callable[[Evaluator, np.random.Generator], None]

RUNS, ANALYTIC = 2, 3000  # analytic searches, and evaluations of each
TOGETHER = 8  # rows that are toppled together, as many as share a look at the clock
APART = 0.02  # largest difference of two candidates, as a part of the box, that makes them one
WORSE = 0.02  # relative distance to the analytic best up to which a row is a candidate
PARENTS, CLIMBS, STEPS = 4, 24, 80  # rows that are changed, climbs from them, gradients of each
ALIKE = 1e-3  # largest difference of two rows of which one is toppled only
PATIENCE, GAIN = 5, 3e-5  # rounds without a relative gain after which the search is done
BOX = 0.1  # of the range of a place: how far from the best the line is taken for straight
SLOPE = 1e-3  # how much the logarithm of the ratio is likely to change across a place's range
NEIGHBOURS = 2.0  # places over which these slopes are alike
FAR = 0.3  # of the range of a place: distance of designs that are not alike
NOISE = 3e-5  # relative, of a standing score beside those of rows near by


def run(evaluator: Evaluator, rng: np.random.Generator, hinged_method: Method) -> None:
    """Search the layout that is fastest on the floor of the scene.

    hinged_method: the method that searches the analytic model.
    """
    hinged = Problem(replace(evaluator.problem.scene, floor_friction=None))
    known = _Known(evaluator, hinged)
    known.evaluate(evaluator.problem.design(evaluator.problem.scene.uniform().layout)[None])
    known.evaluate(_candidates(evaluator, hinged, hinged_method, rng))
    idle = 0
    while idle < PATIENCE:
        before, rows = known.score, _promising(known, rng)
        if not len(rows):
            return
        known.evaluate(rows)
        idle = 0 if known.score > before + GAIN * abs(before) else idle + 1
        spent = f"{evaluator.evaluations} free-standing layouts simulated"
        evaluator.status = f"{spent}, the last {idle} rounds without gain"


def _candidates(
    evaluator: Evaluator, hinged: Problem, method: Method, rng: np.random.Generator
) -> Floats:
    """(C, n) rows that are good on the analytic model and not alike.

    The number of evaluations is fixed, so that a search that is resumed asks the same again.
    """
    found: list[tuple[float, Floats]] = []
    for child in rng.spawn(RUNS):
        if evaluator.progress >= 1.0:
            raise BudgetSpent
        limit = evaluator.max_seconds
        seconds = None if limit is None else max(limit - evaluator.seconds, 1e-9)
        inner = Evaluator(hinged, ANALYTIC, seconds)
        with suppress(BudgetSpent):
            method(inner, child)
        found += inner.finalists
    found.sort(key=lambda one: -one[0])
    chosen: list[Floats] = []
    for score, design in found:
        apart = min((float(np.abs(design - other).max()) for other in chosen), default=1.0)
        if apart > APART and score > found[0][0] - WORSE * abs(found[0][0]):
            chosen.append(design)
    return np.array(chosen[:TOGETHER])


class _Known:
    """What is known of standing rows, and of the ratio of their scores to the analytic ones."""

    def __init__(self, evaluator: Evaluator, hinged: Problem) -> None:
        self.evaluator, self.hinged = evaluator, hinged
        self.designs = np.empty((0, hinged.dimension))
        self.scores, self.ratios = np.empty(0), np.empty(0)
        place = np.arange(hinged.dimension)
        near = np.exp(-0.5 * ((place[:, None] - place[None]) / NEIGHBOURS) ** 2)
        pairs = hinged.scene.count - 1
        near[place[:, None] // pairs != place[None] // pairs] = 0.0  # gaps and thicknesses apart
        self.prior = SLOPE**2 * (0.5 * near + 0.5 * np.eye(hinged.dimension))

    @property
    def score(self) -> float:
        """The best standing score."""
        return float(self.scores.max())

    @property
    def best(self) -> Floats:
        """The design (n,) of the best."""
        return np.asarray(self.designs[int(np.argmax(self.scores))])

    def evaluate(self, designs: Floats) -> None:
        """Simulate layouts in both models, and learn from them."""
        scores = self.evaluator.evaluate(designs).score
        analytic = self.hinged.evaluate(designs).score
        both = (scores > 0.0) & (analytic > 0.0)
        ratios = np.log(np.where(both, scores, 1.0) / np.where(both, analytic, 1.0))
        self.designs = np.concatenate([self.designs, designs])
        self.scores = np.concatenate([self.scores, scores])
        self.ratios = np.concatenate([self.ratios, np.where(both, ratios, np.nan)])

    def slopes(self, number: int, rng: np.random.Generator) -> Floats:
        """Draw slopes (number, n) of the logarithm of the ratio; the first are the likeliest."""
        there = np.flatnonzero(np.isfinite(self.ratios))
        away = self._away(self.designs[there])
        far = np.abs(self.designs[there] - self.best).max(axis=1, initial=0.0) / BOX
        weight = 1.0 / (NOISE * (1.0 + far)) ** 2
        level = weight / max(float(weight.sum()), 1.0)
        centred = away - level @ away
        wanted = self.ratios[there] - level @ self.ratios[there]
        weighted = weight[:, None] * centred
        covariance = np.linalg.inv(np.linalg.inv(self.prior) + weighted.T @ centred)
        mean = covariance @ (weighted.T @ wanted)
        root = np.linalg.cholesky(0.5 * (covariance + covariance.T))
        drawn = mean + rng.standard_normal((number, len(mean))) @ root.T
        drawn[0] = mean
        return np.asarray(drawn)

    def corrected(self, designs: Floats, slopes: Floats) -> tuple[Floats, Floats]:
        """Analytic scores (B,) and gradients (B, n) times the ratio by slopes (B, n)."""
        found = self.hinged.evaluate(designs, True, differences=False)
        scores, gradients = found.score, found.gradient
        factor = np.where(scores > 0.0, np.exp(np.sum(slopes * self._away(designs), axis=1)), 1.0)
        inside = (np.abs(designs - self.best) < BOX) & (scores > 0.0)[:, None]
        scores = scores * factor
        return scores, factor[:, None] * gradients + scores[:, None] * np.where(inside, slopes, 0.0)

    def promised(self, designs: Floats, slope: Floats) -> Floats:
        """What designs (B, n) are likely to score (B,), by slopes (n,) and what was off these."""
        scores, _ = self.corrected(designs, np.repeat(slope[None], len(designs), axis=0))
        there = np.flatnonzero(np.isfinite(self.ratios))
        if not len(there):
            return scores
        rows, here = self.designs[there], there[int(np.argmax(self.scores[there]))]
        off = self.ratios[there] - self.ratios[here] - self._away(rows) @ slope
        near = _near(rows, rows) + (NOISE / SLOPE) ** 2 * np.eye(len(rows))
        learned = _near(designs, rows) @ np.linalg.solve(near, off)
        return np.where(scores > 0.0, scores * np.exp(learned), scores)

    def _away(self, designs: Floats) -> Floats:
        """How far designs are from the best; no line is straight for ever, so at most so far."""
        return np.clip(designs - self.best, -BOX, BOX)


def _near(some: Floats, others: Floats) -> Floats:
    """(B, C) how alike designs are, from 0 to 1."""
    apart = np.sum((some[:, None] - others[None]) ** 2, axis=2)
    return np.asarray(np.exp(-0.5 * apart / FAR**2))


def _promising(known: _Known, rng: np.random.Generator) -> Floats:
    """(B, n) rows that are likely to be better than the best, or to teach something."""
    problem, hinged = known.evaluator.problem, known.hinged
    order = np.argsort(-known.scores, kind="stable")[:PARENTS]
    pairs = problem.scene.count - 1
    designs = [known.best]
    for _ in range(CLIMBS - 1):
        ranks = np.minimum(rng.geometric(0.5, 2) - 1, len(order) - 1)
        parent, other = (known.designs[order[r]].reshape(-1, pairs) for r in ranks)
        changed = PERTURBATIONS[int(rng.integers(len(PERTURBATIONS)))](parent, other, rng)
        designs.append(np.clip(changed.ravel(), 0.0, 1.0))
    slopes = known.slopes(CLIMBS, rng)
    arms = [LocalSearch(design, hinged.project) for design in designs]
    _refine(known, arms, slopes)
    ends = np.array([arm.design for arm in arms])
    promised = known.promised(ends, slopes[0])
    chosen: list[int] = []
    for i in np.argsort(-promised, kind="stable"):
        others = np.concatenate([known.designs, ends[chosen]])
        if np.abs(others - ends[i]).max(axis=1).min() > ALIKE and len(chosen) < TOGETHER:
            chosen.append(int(i))
    return ends[chosen]


def _refine(known: _Known, arms: list[LocalSearch], slopes: Floats) -> None:
    """Advance local searches on the corrected model in lockstep, each with its own slopes."""
    for _ in range(STEPS):
        left = [i for i, arm in enumerate(arms) if not arm.done]
        if not left:
            return
        wanted = np.array([arms[i].wanted for i in left])
        scores, gradients = known.corrected(wanted, slopes[left])
        for i, score, gradient in zip(left, scores, gradients, strict=True):
            arms[i].update(float(score), gradient)
