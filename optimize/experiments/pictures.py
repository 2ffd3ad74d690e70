"""Pictures of experiments: curves of methods in panels, and intervals."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter

from domino_env.core import plot_style
from domino_env.core.colours import BEST_KNOWN, FAINT, UNIFORM
from domino_env.core.files import amount
from domino_env.core.types import Floats
from optimize.experiments.experiment import Experiment
from optimize.experiments.task import Label

Band = tuple[Floats, Floats] | None  # ends of the interval around each point
Curve = tuple[Any, Floats, Band]  # x, numbers or words; y, and the band around y
Panels = Mapping[str, Mapping[str, Curve]]  # by title, by method
Prepare = Callable[[Axes, str], None]  # sets the scales of a panel, given its title

MAX_COLOURS = 7  # methods whose colours can be distinguished at a glance
MEDIANS = "medians and range of"  # in subtitles, before the number of seeds
ACROSS = 2  # panels side by side
LABEL_DISTANCE = 0.07  # of the names of lines, in heights of a panel
MAX_PANELS = 6  # of the picture of a sweep
MAX_MARKERS = 40  # of a line, one for each point
ENDS = LOWEST, HIGHEST = -0.12, 1.25  # normalised scores that are drawn
SCORE_TICKS = ([0.0, 0.5, 0.8, 1.0], ["0", "50 %", "80 %", "100 %"])
EARLIEST = 200.0  # environment steps of a training, from which on its curve is drawn


@plot_style.own_style()
def draw_curves(
    path: Path,
    panels: Panels,
    headings: tuple[str, str],
    labels: tuple[str, str],
    prepare: Prepare,
    methods: Sequence[str],
    dashed: Collection[str] = (),
) -> None:
    """Draw the curves of all methods in a panel for each title.

    Parameters
    ----------
    path
        PNG file.
    panels
        Curves by method of each panel, by title.
    headings
        Headline and subtitle above all panels.
    labels
        Labels of the horizontal and the vertical axis.
    prepare
        Function that sets the scales of a panel; see `Prepare`.
    methods
        Methods with a colour and a name, in this order; all others are grey behind them.
    dashed
        Methods whose lines are dashed.
    """
    figure, all_axes = plot_style.new_panels(len(panels), ACROSS, (4.6, 2.9), (0.0, 0.0), *headings)
    lines = plot_style.method_lines(methods)
    for (title, curves), axes in zip(panels.items(), all_axes, strict=True):
        plot_style.style(axes, title)
        axes.set_ylabel(labels[1] if axes in all_axes[::ACROSS] else "")
        prepare(axes, title)
        axes.set_xlabel(labels[0])
        ends: dict[str, float] = {}  # last y of each method with a colour
        for method, (x, y, band) in curves.items():
            if method not in methods:
                axes.plot(x, y, color=FAINT, lw=0.9, zorder=1.0)
                continue
            ends[method] = y[-1]
            line = lines[method] | {"linewidth": 2.4 if method == "auto" else 1.5}
            line |= {"linestyle": "--"} if method in dashed else {}
            if isinstance(x[0], str):  # no lines between words
                spread = np.abs(np.array(band) - y)
                axes.errorbar(x, y, spread, fmt="o", color=line["color"])
                continue
            marked: Any = None if len(x) <= MAX_MARKERS else [-1]  # the last is visible if alone
            line |= {"marker": "o", "markersize": 3.5, "markevery": marked}
            if band is not None:
                axes.fill_between(x, *band, color=line["color"], alpha=0.12, linewidth=0)
            if x[0] == x[-1]:  # one score at one time, such as that of a scripted policy
                axes.axhline(y[0], color=line["color"], lw=0.8, ls=line["linestyle"], zorder=1.5)
            axes.plot(x, y, **line)
        _label_ends(axes, ends, {method: lines[method]["color"] for method in ends})
    plot_style.write_png(figure, path)


def _label_ends(axes: Axes, ends: Mapping[str, float], colours: Mapping[str, str]) -> None:
    """Write the names of lines at the right edge of a panel, near their last y and apart."""
    to_axes = axes.transData + axes.transAxes.inverted()
    left = axes.get_xlim()[0]
    places = {
        name: float(np.clip(np.nan_to_num(to_axes.transform((left, y))[1]), 0.0, 1.0))
        for name, y in ends.items()
    }
    names = sorted(places, key=lambda name: places[name])
    heights = [places[name] for name in names]
    least = min(LABEL_DISTANCE, 1.0 / max(len(names) - 1, 1))
    for k in range(1, len(names)):  # apart upwards, then downwards from the top
        heights[k] = max(heights[k], heights[k - 1] + least)
    heights[-1:] = [min(height, 1.0) for height in heights[-1:]]
    for k in range(len(names) - 2, -1, -1):
        heights[k] = min(heights[k], heights[k + 1] - least)
    for name, y in zip(names, heights, strict=True):
        axes.text(
            1.02, y, name, transform=axes.transAxes, color=colours[name], fontsize=7, va="center"
        )


def draw_over_time(experiment: Experiment, path: Path) -> None:
    """Draw the shortfall from the best known, or the RMS error, against time or evaluations."""
    times = experiment.curve_times()
    panels: dict[str, dict[str, Curve]] = {}
    errors: dict[str, str] = {}  # label of the axis, by problems with RMS errors
    ends: dict[str, list[float]] = {}  # median shortfalls at the end, by method
    for problem, method in product(experiment.problems, experiment.methods):
        if runs := experiment.runs(method, problem):
            shortfalls = 100.0 * np.array([experiment.shortfalls(r, times) for r in runs])
            median, low, high = _median_and_range(shortfalls)
            ends.setdefault(method, []).append(median[-1])
            criterion = runs[0].criterion
            if criterion.shows_errors:
                errors[problem] = criterion.quantity()
                scores = [experiment.best_scores(r, times) for r in runs]
                median, low, high = _median_and_range(criterion.displayed(scores))
            panels.setdefault(problem, {})[method] = (times, median, (low, high))
    best = sorted(ends, key=lambda method: np.mean(ends[method]))[:MAX_COLOURS]
    # smallest and largest shortfall that are drawn [%]
    lowest, highest = np.clip(0.5 * min(map(min, ends.values())), 1e-4, 1.0), 30.0

    def prepare(axes: Axes, problem: str) -> None:
        axes.set_xscale("log")
        plot_style.label_plainly(axes.xaxis, (1, 3) if times[-1] < 1e3 * times[0] else (1,))
        axes.set_xlim(times[0], 1.1 * times[-1])  # with space for the last marker
        if problem in errors:
            plot_style.set_wide_axis(axes, _ends(panels[problem]))
            axes.set_ylabel(errors[problem])
        else:
            axes.set(yscale="log", ylim=(lowest, highest))
            axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g} %"))

    clock = "seconds" if experiment.clock == "seconds" else "layouts simulated"
    name = "RMS error" if len(errors) == len(panels) else "Shortfall from the best known"
    headings = (
        f"{name} against {clock}",
        f"{experiment.tasks[0].limit} for each run, {experiment.describe_seeds(MEDIANS)}",
    )
    draw_curves(path, panels, headings, (clock, "shortfall from the best known"), prepare, best)


def draw_over_settings(experiment: Experiment, path: Path) -> None:
    """Draw gains or RMS errors in a panel for each setting, over all values of the other settings.

    Of two settings with few values and one method, there is a curve for each value of the other. If
    the numbers displayed of the first scene are errors, these are drawn.
    """
    first = experiment.results[0]
    keys, criterion = experiment.keys, first.criterion
    shows_errors, unit = criterion.shows_errors, "" if criterion.shows_errors else " %"
    quantity = criterion.quantity() if shows_errors else "gain over uniform"
    labels = {key: list(dict.fromkeys(r.labels[key] for r in experiment.results)) for key in keys}
    words = {key for key in keys if any(isinstance(label, str) for label in labels[key])}
    groups, methods = experiment.describe_seeds(MEDIANS), experiment.methods
    # a curve for each value of the other setting
    split = len(keys) == 2 and len(methods) == 1 and sum(map(len, labels.values())) <= MAX_COLOURS
    if len(keys) > 1 and not split:
        groups = "medians and range over seeds and the other settings"
    scenes = amount(len(experiment.problems), "scene")
    headings = (
        f"{first.scene_name}: {quantity}, over {' and '.join(keys)}",
        f"{scenes}, {experiment.tasks[0].limit} for each search, {groups}",
    )
    points: dict[tuple[str, str], dict[Label, list[float]]] = {}  # by panel and curve
    for key, r in product(keys[:MAX_PANELS], experiment.results):
        other, value = next(((k, v) for k, v in r.labels.items() if k != key), ("", ""))
        text = f"{value:.6g}" if isinstance(value, float) else value
        curve = f"{other} = {text}" if split else r.method
        heights = points.setdefault((key, curve), {}).setdefault(r.labels[key], [])
        if shows_errors:
            heights.append(float(r.criterion.displayed(r.score)))
        elif r.gain is not None:
            heights.append(100.0 * r.gain)
    panels: dict[str, dict[str, Curve]] = {}
    for (key, curve), values in points.items():
        places = sorted(values, key=labels[key].index if key in words else float)
        bands = [_median_and_range(np.array(values[place] or [np.nan])) for place in places]
        median, low, high = np.array(bands).T
        x = [str(place) for place in places] if key in words else places
        panels.setdefault(key, {})[curve] = (x, median, (low, high))

    def prepare(axes: Axes, key: str) -> None:
        places = np.array([] if key in words else labels[key])
        if len(places) and min(places) > 0.0 and np.median(places) < 0.2 * max(places):
            axes.set_xscale("log")  # most values are far below the largest
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}{unit}"))
        if shows_errors:
            plot_style.set_wide_axis(axes, _ends(panels[key]))

    curves = list(dict.fromkeys(curve for _, curve in points)) if split else methods
    draw_curves(path, panels, headings, ("", quantity), prepare, curves[:MAX_COLOURS])


def draw_over_steps(experiment: Experiment, path: Path, first: Collection[str]) -> None:
    """Draw the best normalised score over steps, in a panel for all problems and one for each.

    Parameters
    ----------
    experiment
        A benchmark.
    path
        PNG file.
    first
        Methods whose lines are solid, and which come first in the legend.
    """
    panels: dict[str, dict[str, Curve]] = {}
    complete = set(experiment.complete_methods)
    # None for all problems, if several methods have runs on each
    overview = [None] if len(experiment.problems) > 1 and len(complete) > 1 else []
    for problem, method in product([*overview, *experiment.problems], experiment.methods):
        if experiment.runs(method, problem) and (problem or method in complete):
            times, mean = experiment.curve(method, "steps", problem, EARLIEST)
            panel = panels.setdefault(problem or "all scenes", {})
            panel[method] = (times, mean.value, mean.interval)

    def prepare(axes: Axes, _: str) -> None:
        axes.set(xscale="log", ylim=(LOWEST, HIGHEST))
        axes.axhline(0.0, color=UNIFORM, linestyle=":", linewidth=1)
        axes.axhline(1.0, color=BEST_KNOWN, linestyle=":", linewidth=1)
        axes.set_yticks(*SCORE_TICKS)

    headings = (
        "Normalised score of the best policy or layout over environment steps",
        "interquartile means, 95 % intervals of five or more runs",
    )
    methods = experiment.rank(first)
    labels = "environment steps, logarithmic", ""
    draw_curves(path, panels, headings, labels, prepare, methods, set(methods) - set(first))


@plot_style.own_style()
def draw_intervals(experiment: Experiment, path: Path, first: Collection[str]) -> None:
    """Draw the interquartile means with their intervals, and the performance profiles.

    There is a panel of means for each problem; that of all problems has the methods with runs on
    each. Colours are those of `draw_over_steps`.
    """
    several = len(experiment.problems) > 1 and len(experiment.complete_methods) > 1
    overview: list[str | None] = [None] if several else []
    problems = [*overview, *experiment.problems]
    methods = experiment.rank(first)
    lines = plot_style.method_lines(methods)
    figure, panels = plot_style.new_panels(
        len(problems), ACROSS, (4.6, 2.9), headline="Normalised scores at the end of the runs",
        subtitle="interquartile means of the longest runs, with 95 % intervals; budgets differ",
    )  # fmt: skip
    for problem, axes in zip(problems, panels, strict=True):
        names = experiment.rank((), problem)[::-1]
        names = names if problem else [n for n in names if n in experiment.complete_methods]
        for y, name in enumerate(names):
            mean, colour = experiment.mean_score(name, problem), lines[name]["color"]
            if mean.interval is not None:
                axes.plot(np.clip(mean.interval, *ENDS), [y, y], color=colour, lw=5, alpha=0.35)
            marker = "o" if mean.value >= LOWEST else "<"  # a worse mean is at the left end
            axes.plot(np.clip([mean.value], *ENDS), [y], marker, color=colour, markersize=5)
        plot_style.style(axes, problem or "all scenes (algorithms with runs on each)")
        axes.set_xlim(*ENDS)
        axes.set_ylim(-0.6, len(names) - 0.4)
        axes.set_yticks(range(len(names)), names)
        axes.axvline(0.0, color=UNIFORM, linestyle=":", linewidth=1)
        axes.axvline(1.0, color=BEST_KNOWN, linestyle=":", linewidth=1)
        axes.set_xticks([0.0, 0.5, 1.0], ["0", "50 %", "100 %"])
        axes.set_xlabel("normalised score")
    plot_style.write_png(figure, path)


def _median_and_range(values: Floats) -> tuple[Any, Any, Any]:
    """Return the median over the first axis, and the smallest and the largest value."""
    return np.median(values, axis=0), values.min(axis=0), values.max(axis=0)


def _ends(panel: Mapping[str, Curve]) -> Floats:
    """Return the ends of all bands of a panel, one after the other."""
    return np.concatenate([end for _, _, band in panel.values() for end in band or ()])
