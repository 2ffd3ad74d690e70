"""Estimates over runs and problems, with 95 % intervals by a stratified bootstrap.

Every problem has the same weight, whatever its number of runs. With equal numbers of runs,
interquartile mean and mean are those of the package rliable (see the reference); the median is the
mean over the problems of the medians of their runs.

References
----------
Agarwal, R., Schwarzer, M., Castro, P. S., Courville, A., Bellemare, M. G. (2021). Deep
reinforcement learning at the edge of the statistical precipice. Advances in Neural Information
Processing Systems 34. arXiv:2108.13264.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from domino_env.core.types import Floats

TRIM = 0.25  # fraction of the weight at either end that an interquartile mean leaves out
LEAST_RUNS = 5  # runs on each problem for an interval; with fewer runs it is too narrow
RESAMPLES, EXCLUDED = 2000, 50  # number, and how many at either end are outside 95 %
CHUNK = 50  # resamples at a time, so that curves of hundreds of points fit into memory

Statistic = Callable[[Sequence[Floats]], Floats]
"""Function that maps the results (..., R) of the runs on each problem to a statistic (...)."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """A statistic (...), or an array of statistics, with its 95 % interval.

    Attributes
    ----------
    value
        Statistic of the runs.
    interval
        Lower and upper end of the interval; None if a problem has fewer than `LEAST_RUNS` runs.
    """

    value: Floats
    interval: tuple[Floats, Floats] | None


def normalise(scores: Floats | float, uniform: float, best: float) -> Floats:
    """Return (scores - uniform) / (best - uniform); 0 if the uniform baseline is best known."""
    scores = np.asarray(scores, dtype=np.float64)
    largest = best - uniform
    return (scores - uniform) / largest if largest > 0.0 else np.zeros_like(scores)


def interquartile_mean(problems: Sequence[Floats]) -> Estimate:
    """Estimate the mean of the middle half of all runs.

    Parameters
    ----------
    problems
        Results (..., R) of the runs on each problem, whose numbers R may differ.

    Returns
    -------
    Estimate
        Mean (...); for its interval, runs are resampled within each problem.
    """
    return estimate(middle_mean, problems)


def middle_mean(problems: Sequence[Floats]) -> Floats:
    """Return the mean (...) of the middle half of results (..., R), problems of equal weight."""
    runs = np.concatenate(problems, axis=-1)
    weights = np.concatenate([np.full(p.shape[-1], 1.0 / p.shape[-1]) for p in problems])
    order = np.argsort(runs, axis=-1, kind="stable")
    runs, weights = np.take_along_axis(runs, order, axis=-1), weights[order] / len(problems)
    cumulative = np.cumsum(weights, axis=-1)
    edge = TRIM + 1e-9  # runs with all of their weight beyond it are left out; 1e-9: rounding
    weights = np.where((cumulative > edge) & (1.0 - cumulative + weights > edge), weights, 0.0)
    values = np.where(weights > 0.0, runs, 0.0)  # as -inf times 0 is nan
    mean: Floats = (weights * values).sum(axis=-1) / weights.sum(axis=-1)
    return mean


def median(problems: Sequence[Floats]) -> Floats:
    """Return the mean over the problems of the medians (...) of results (..., R)."""
    return np.asarray(np.mean([np.median(p, axis=-1) for p in problems], axis=0))


def mean(problems: Sequence[Floats]) -> Floats:
    """Return the mean (...) of results (..., R), problems of equal weight."""
    return np.asarray(np.mean([p.mean(axis=-1) for p in problems], axis=0))


def estimate(statistic: Statistic, problems: Sequence[Floats]) -> Estimate:
    """Estimate a statistic of the runs on some problems.

    Parameters
    ----------
    statistic
        See `Statistic`; it is also called with a further dimension before the last, of resamples.
    problems
        Results (..., R) of the runs on each problem.

    Returns
    -------
    Estimate
        Statistic (...); its interval is that of the percentiles of resamples, in which the runs on
        each problem are drawn from these with replacement.
    """
    rng = np.random.default_rng(0)
    runs = [np.asarray(problem, dtype=np.float64) for problem in problems]
    value = np.asarray(statistic(runs))
    if min(results.shape[-1] for results in runs) < LEAST_RUNS:
        return Estimate(value, None)
    statistics = []
    for _ in range(RESAMPLES // CHUNK):
        indices = [rng.integers(r.shape[-1], size=(CHUNK, r.shape[-1])) for r in runs]
        samples = [results[..., index] for results, index in zip(runs, indices, strict=True)]
        statistics.append(statistic(samples))
    resampled = np.concatenate(statistics, axis=-1)
    resampled.sort(axis=-1)  # not np.percentile, which interpolates: scores may be -inf
    return Estimate(value, (resampled[..., EXCLUDED], resampled[..., -1 - EXCLUDED]))
