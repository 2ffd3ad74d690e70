"""Estimates over runs and problems, with 95 % intervals by a stratified bootstrap.

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

TRIMMED = 0.25  # part of the runs at either end that an interquartile mean leaves out
RESAMPLES, OUTSIDE = 2000, 50  # of which at either end lie outside the interval: 2.5 %
CHUNK = 50  # resamples at a time, so that curves of hundreds of points fit into memory


@dataclass(frozen=True, eq=False)
class Estimate:
    """A statistic, or an array of them, with its interval.

    Attributes
    ----------
    value
        Statistic of the runs.
    low, high
        Ends of the 95 % interval; equal to `value` where no problem has more than one run.
    """

    value: Floats
    low: Floats
    high: Floats


def interquartile_mean(problems: Sequence[Floats]) -> Estimate:
    """Estimate the mean of the middle half of all runs.

    Parameters
    ----------
    problems
        (..., R) results of the runs on each problem, whose numbers of runs may differ.

    Returns
    -------
    Estimate
        (...) with an interval for which runs are resampled within each problem.
    """
    return _estimate(problems, middle_mean)


def middle_mean(runs: Floats, axis: int = -1) -> Floats:
    """Return the mean of the middle half of runs along an axis."""
    from scipy.stats import trim_mean

    return np.asarray(trim_mean(runs, TRIMMED, axis=axis))


def performance_profile(problems: Sequence[Floats], targets: Floats) -> Estimate:
    """Estimate the part (T,) of all runs that come beyond each target (T,)."""
    beyond = [(np.asarray(runs) > targets[:, None]).astype(np.float64) for runs in problems]
    return _estimate(beyond, np.mean)


def _estimate(problems: Sequence[Floats], statistic: Callable[..., Floats]) -> Estimate:
    """Estimate a statistic of the runs of all problems together, along the last axis."""
    rng = np.random.default_rng(0)
    runs = [np.asarray(problem, dtype=np.float64) for problem in problems]

    def resample() -> Floats:
        sizes = [group.shape[-1] for group in runs]
        indices = [rng.integers(size, size=(CHUNK, size)) for size in sizes]
        chosen = [group[..., index] for group, index in zip(runs, indices, strict=True)]
        return statistic(np.concatenate(chosen, axis=-1), axis=-1)

    value = np.asarray(statistic(np.concatenate(runs, axis=-1), axis=-1))
    spread = np.concatenate([resample() for _ in range(RESAMPLES // CHUNK)], axis=-1)
    spread.sort(axis=-1)  # no interpolation: before the first layout a score is -inf
    return Estimate(value, spread[..., OUTSIDE], spread[..., -1 - OUTSIDE])
