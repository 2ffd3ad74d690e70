"""Summary of an experiment: normalised scores over seeds and problems, with intervals.

A normalised score is (score - uniform) / (best known - uniform): 0 is the uniform baseline, 1 the
best known layout.

References
----------
Agarwal, R., Schwarzer, M., Castro, P. S., Courville, A., Bellemare, M. G. (2021). Deep
reinforcement learning at the edge of the statistical precipice. Advances in Neural Information
Processing Systems 34. arXiv:2108.13264.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from domino_env.core.types import Floats
from optimize.experiments.experiment import Experiment, problem_of
from optimize.experiments.task import TaskResult

CLOCKS = {"processor seconds": 2, "environment steps": 0}  # columns of a trace
SECONDS, STEPS = CLOCKS
CUT = 0.25  # part of the runs at either end that an interquartile mean leaves out
RESAMPLES, OUTSIDE = 2000, 50  # of which at either end lie outside the interval: 2.5 %
TOGETHER = 50  # resamples at a time: a curve has hundreds of points
POINTS = 120  # of a curve
TARGETS = np.linspace(-0.25, 1.0, 251)  # of the profile
LOWEST, HIGHEST = -0.3, 1.06  # normalised scores that are drawn
TICKS = ([0.0, 0.5, 0.8, 1.0], ["uniform", "50 %", "80 %", "best known"])


@dataclass(frozen=True, eq=False)
class Estimate:
    """A number, or an array of them, with the interval in which it lies.

    Attributes
    ----------
    value
        Statistic of the runs.
    low, high
        Ends of the 95 % interval; as `value` where no problem has more than one run.
    """

    value: Floats
    low: Floats
    high: Floats

    @property
    def is_known(self) -> bool:
        """Whether the interval has any width."""
        return bool(np.any(self.high > self.low))


def interquartile_mean(problems: Sequence[Floats]) -> Estimate:
    """Estimate the mean of the middle half of all runs.

    Parameters
    ----------
    problems
        (..., R) results of the runs on each problem, whose numbers of runs may differ.

    Returns
    -------
    Estimate
        (...) with an interval by a stratified bootstrap: runs are resampled within each problem.
    """
    return _estimate(problems, middle_mean)


def middle_mean(runs: Floats, axis: int = -1) -> Floats:
    """Return the mean of the middle half of runs along an axis."""
    from scipy.stats import trim_mean

    return np.asarray(trim_mean(runs, CUT, axis=axis))


def performance_profile(problems: Sequence[Floats], targets: Floats) -> Estimate:
    """Estimate the part (T,) of all runs that come beyond each target (T,)."""
    beyond = [(np.asarray(runs) > targets[:, None]).astype(np.float64) for runs in problems]
    return _estimate(beyond, np.mean)


def _estimate(problems: Sequence[Floats], statistic: Callable[..., Floats]) -> Estimate:
    """Estimate a statistic of the runs of all problems together, along the last axis."""
    rng = np.random.default_rng(0)
    runs = [np.asarray(one, dtype=np.float64) for one in problems]

    def resampled() -> Floats:
        sizes = [one.shape[-1] for one in runs]
        drawn = [rng.integers(size, size=(TOGETHER, size)) for size in sizes]
        chosen = [one[..., which] for one, which in zip(runs, drawn, strict=True)]
        return statistic(np.concatenate(chosen, axis=-1), axis=-1)

    value = np.asarray(statistic(np.concatenate(runs, axis=-1), axis=-1))
    spread = np.concatenate([resampled() for _ in range(RESAMPLES // TOGETHER)], axis=-1)
    spread.sort(axis=-1)  # no interpolation: before the first layout a score is -inf
    return Estimate(value, spread[..., OUTSIDE], spread[..., -1 - OUTSIDE])


@dataclass(frozen=True, eq=False)
class Summary:
    """Normalised scores of an experiment, at the end and over a clock."""

    experiment: Experiment

    def normalised(self, result: TaskResult, scores: Floats | float) -> Floats:
        """Normalise scores on the problem of a result; 0 where there is nothing to gain."""
        uniform = result.uniform_score
        to_gain = self.experiment.best_of(result) - uniform
        return (
            (np.asarray(scores) - uniform) / to_gain if to_gain > 0.0 else 0.0 * np.asarray(scores)
        )

    def final(self, method: str, problem: str | None = None) -> list[Floats]:
        """Return the normalised scores (R,) that the runs end with, by problem."""
        return self._by_problem(
            self.experiment.of(method, problem), lambda r: self.normalised(r, r.score)
        )

    def gain(self, method: str, problem: str | None = None) -> Estimate:
        """Estimate the interquartile mean of the normalised scores."""
        return interquartile_mean(self.final(method, problem))

    def steps(self, result: TaskResult, clock: str = SECONDS) -> tuple[Floats, Floats]:
        """Return times (K,) by a clock, and the best normalised scores (K,) by then."""
        trace = np.array(result.trace, dtype=np.float64)
        return trace[:, CLOCKS[clock]], self.normalised(result, trace[:, 3])

    def at(self, result: TaskResult, times: Floats, clock: str = SECONDS) -> Floats:
        """Return the best normalised score (T,) at each time; -inf before the first layout."""
        found, scores = self.steps(result, clock)
        at = np.searchsorted(found, times, side="right") - 1
        return np.where(at >= 0, scores[np.maximum(at, 0)], -np.inf)

    def curve(self, runs: Sequence[TaskResult], clock: str) -> tuple[Floats, Estimate]:
        """Estimate the interquartile mean of the best normalised scores over a clock.

        From when all runs have built a layout, to when the last one ends.
        """
        spans = [self.steps(r, clock)[0] for r in runs]
        first = max(float(span[0]) for span in spans)
        last = max(float(span[-1]) for span in spans)
        times = np.geomspace(max(first, 1e-9), max(last, first, 1e-9), POINTS)
        times[0] = first  # bitwise
        scores = self._by_problem(runs, lambda r: self.at(r, times, clock))
        return times, interquartile_mean([one.T for one in scores])

    def gain_after(self, method: str, seconds: float) -> float:
        """Return the interquartile mean after a time [s]; -inf before there is one."""
        when = np.array([seconds])
        runs = [self.at(r, when)[0] for r in self.experiment.of(method)]
        return float(middle_mean(np.array(runs)))

    def seconds_past_uniform(self, result: TaskResult) -> float:
        """Find when a run passed the uniform baseline [s]; inf where it never did."""
        times, scores = self.steps(result)
        past = np.flatnonzero(scores > 0.0)
        return float(times[past[0]]) if len(past) else np.inf

    def ordered(self, first: Collection[str], problem: str | None = None) -> list[str]:
        """Return the methods, those named first before all others, each group best first."""
        methods = [m for m in self.experiment.methods if self.experiment.of(m, problem)]
        return sorted(methods, key=lambda m: (m not in first, -float(self.gain(m, problem).value)))

    @staticmethod
    def _by_problem(
        runs: Sequence[TaskResult], value: Callable[[TaskResult], Floats]
    ) -> list[Floats]:
        found: dict[str, list[Floats]] = {}
        for r in runs:
            found.setdefault(problem_of(r), []).append(value(r))
        return [np.array(values) for values in found.values()]


def draw_reached(summary: Summary, path: Path) -> None:
    """Draw the interquartile means with their intervals, and the performance profile."""
    from domino_env.core.colours import UNIFORM
    from domino_env.core.plot_style import LEGEND, method_lines, new_panels, style, write_png

    figure, (means, profile) = new_panels(
        2, 2, (4.6, 3.4), headline="Normalised scores in the end",
        subtitle="95 % intervals over seeds, all scenes together",
    )  # fmt: skip
    order = summary.ordered(())[::-1]
    lines = method_lines(summary.experiment.methods)
    for place, name in enumerate(order):
        found, colour = summary.gain(name), lines[name]["color"]
        ends = [max(float(found.low), LOWEST), max(float(found.high), LOWEST)]
        means.plot(ends, [place, place], color=colour, linewidth=5, alpha=0.35)
        means.plot([max(float(found.value), LOWEST)], [place], "o", color=colour, markersize=5)
        reached = performance_profile(summary.final(name), TARGETS)
        profile.plot(TARGETS, reached.value, label=name, **lines[name])
        profile.fill_between(TARGETS, reached.low, reached.high, color=colour, alpha=0.12, lw=0)
    style(means, "interquartile mean")
    means.set_yticks(range(len(order)), order)
    means.axvline(0.0, color=UNIFORM, linestyle=":", linewidth=1)
    style(profile, "part of the runs beyond a normalised score")
    profile.set_ylim(0.0, 1.02)
    profile.set_xlim(TARGETS[0], TARGETS[-1])
    profile.legend(loc="lower left", **LEGEND)
    for axes in (means, profile):
        axes.set_xticks([0.0, 0.5, 1.0], ["uniform", "50 %", "best known"])
    write_png(figure, path)


def draw_over_clock(summary: Summary, clock: str, path: Path, first: Collection[str]) -> None:
    """Draw the best normalised score over a clock, in a panel for all problems and for each.

    Parameters
    ----------
    summary
        What is drawn.
    clock
        One of CLOCKS.
    path
        PNG file.
    first
        Methods whose lines are solid.
    """
    from matplotlib.axes import Axes

    from domino_env.core.colours import KNOWN, UNIFORM
    from domino_env.core.plot_style import plain_numbers
    from optimize.experiments.pictures import Curve, draw_curves

    experiment, of_all = summary.experiment, "all scenes"
    several = [of_all] if len(experiment.problems) > 1 else []
    panels: dict[str, dict[str, Curve]] = {}
    for problem in [*several, *experiment.problems]:
        panels[problem] = {}
        for method in experiment.methods:
            if runs := experiment.of(method, None if problem == of_all else problem):
                times, found = summary.curve(runs, clock)
                panels[problem][method] = (times, found.value, found.low, found.high)

    def prepare(axes: Axes, _: str) -> None:
        axes.set_xscale("log")
        plain_numbers(axes.xaxis, (1,))
        axes.axhline(0.0, color=UNIFORM, linestyle=":", linewidth=1)
        axes.axhline(1.0, color=KNOWN, linestyle=":", linewidth=1)
        axes.set_ylim(LOWEST, HIGHEST)
        axes.set_yticks(*TICKS)

    draw_curves(
        path, panels, f"Best normalised score so far over {clock}",
        "interquartile means, 95 % intervals", (clock, ""), prepare, experiment.methods,
        dashed=[method for method in experiment.methods if method not in first],
    )  # fmt: skip
