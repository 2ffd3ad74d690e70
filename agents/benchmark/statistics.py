"""What is said of few runs: interquartile means and performance profiles, with intervals.

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
from numpy.typing import NDArray

Floats = NDArray[np.float64]

CUT = 0.25  # of the runs at either end are left out of an interquartile mean
RESAMPLES = 2000
CONFIDENCE = 0.95
TOGETHER = 50  # resamples at a time: a curve has hundreds of points


@dataclass(frozen=True, eq=False)
class Estimate:
    """A number, or an array of them, with the interval in which it lies.

    Attributes
    ----------
    value
        What the runs say.
    low, high
        Ends of the 95 % interval; as `value` where no scene has more than one run. A single run of
        a scene says nothing of how runs differ there, and stays as it is.
    """

    value: Floats
    low: Floats
    high: Floats

    @property
    def is_known(self) -> bool:
        """Whether there is an interval of any width."""
        return bool(np.any(self.high > self.low))


def interquartile_mean(scenes: Sequence[Floats]) -> Estimate:
    """Estimate the mean of the middle half of all runs.

    Parameters
    ----------
    scenes
        (..., R) results of the runs on each scene; scenes may have different numbers of runs.

    Returns
    -------
    Estimate
        (...) with an interval by a stratified bootstrap: runs are drawn anew within each scene.
    """
    return _estimate(scenes, middle_mean)


def middle_mean(runs: Floats, axis: int = -1) -> Floats:
    """Give the mean of the middle half of runs along an axis."""
    from scipy.stats import trim_mean

    return np.asarray(trim_mean(runs, CUT, axis=axis))


def performance_profile(scenes: Sequence[Floats], targets: Floats) -> Estimate:
    """Estimate the part of all runs that come beyond each target.

    Parameters
    ----------
    scenes
        (R,) results of the runs on each scene.
    targets
        (T,) values.

    Returns
    -------
    Estimate
        (T,) parts, 0 to 1, with intervals as of `interquartile_mean`.
    """
    beyond = [(np.asarray(runs) > targets[:, None]).astype(np.float64) for runs in scenes]
    return _estimate(beyond, np.mean)


def _estimate(scenes: Sequence[Floats], statistic: Callable[..., Floats]) -> Estimate:
    """A statistic of the runs of all scenes together, along the last axis."""
    from scipy.stats import bootstrap

    runs = [np.asarray(one, dtype=np.float64) for one in scenes]
    single = [one for one in runs if one.shape[-1] < 2]  # nothing can be drawn anew there
    several = [one for one in runs if one.shape[-1] >= 2]

    def of_all(*drawn: Floats, axis: int = -1) -> Floats:
        shape = drawn[0].shape[:-1]  # with the resamples last, where there are any
        fixed = [one[..., None, :] if len(shape) >= one.ndim else one for one in single]
        fixed = [np.broadcast_to(one, (*shape, 1)) for one in fixed]
        return statistic(np.concatenate([*drawn, *fixed], axis=axis), axis=axis)

    if not several:
        value = np.asarray(statistic(np.concatenate(runs, axis=-1), axis=-1))
        return Estimate(value, value, value)
    value = np.asarray(of_all(*several))
    found = bootstrap(
        several, of_all, axis=-1, vectorized=True, n_resamples=RESAMPLES, batch=TOGETHER,
        confidence_level=CONFIDENCE, method="percentile", rng=np.random.default_rng(0),
    ).confidence_interval  # fmt: skip
    return Estimate(value, np.asarray(found.low), np.asarray(found.high))
