"""Pictures of experiments: curves of methods in panels, maps over two settings, intervals."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from domino_env.core.colours import FAINT, INK, KNOWN, UNIFORM
from domino_env.core.plot_style import (
    LEGEND,
    method_lines,
    new_panels,
    plain_numbers,
    style,
    write_png,
)
from domino_env.core.types import Floats
from optimize.experiments.estimates import performance_profile
from optimize.experiments.experiment import Experiment
from optimize.experiments.task import Label, TaskResult

Band = tuple[Floats, Floats] | None  # ends of the interval around each point
Curve = tuple[Floats, Floats, Band]  # x, y, and the band around y
Panels = Mapping[str, Mapping[str, Curve]]  # by title, by method
Prepare = Callable[[Axes, str], None]  # sets the scales of the panel of a title

MAX_COLOURS = 7  # methods whose colours can be distinguished at a glance
MEDIANS = "medians and range of"
MAX_PANELS = 6  # of a sweep
MAX_TICKS = 12  # of an axis of a map
PROFILE_TARGETS = np.linspace(-0.25, 1.0, 251)  # normalised scores
LOWEST, HIGHEST = -0.3, 1.06  # normalised scores that are drawn
SCORE_TICKS = ([0.0, 0.5, 0.8, 1.0], ["uniform", "50 %", "80 %", "best known"])
CLOCK_NAMES = {"seconds": "processor seconds", "evaluations": "environment steps"}
EARLIEST = {"seconds": 1e-2, "evaluations": 10.0}  # drawn of each clock


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
        Curves.
    headings
        Headline and subtitle above all panels.
    labels
        Labels of the horizontal and the vertical axis.
    prepare
        Function that sets the scales of a panel.
    methods
        Methods with a colour and a name, in this order; all others are grey behind them.
    dashed
        Methods whose lines are dashed.
    """
    figure, all_axes = new_panels(len(panels), 3, (3.8, 3.0), (1.9, 0.5), *headings)
    lines = method_lines(methods)
    handles: dict[str, Any] = {}
    for (title, curves), axes in zip(panels.items(), all_axes, strict=True):
        style(axes, title)
        prepare(axes, title)
        axes.set_xlabel(labels[0])
        for method, (x, y, band) in curves.items():
            if method not in methods:
                handles["others"] = axes.plot(x, y, color=FAINT, lw=0.9, zorder=1.0)[0]
                continue
            line = lines[method] | {"linewidth": 2.4 if method == "auto" else 1.5}
            line |= {"linestyle": "--"} if method in dashed else {}
            line |= {"marker": "o", "markersize": 3.5, "markevery": [-1]}  # visible if alone
            if band is not None:
                axes.fill_between(x, *band, color=line["color"], alpha=0.12, linewidth=0)
            handles[method] = axes.plot(x, y, **line)[0]
    all_axes[0].set_ylabel(labels[1])
    figure.legend(list(handles.values()), list(handles), loc="outside right center", **LEGEND)
    write_png(figure, path)


def draw_over_time(experiment: Experiment, path: Path) -> None:
    """Draw the shortfall from the best known against run time, in a panel for each problem."""
    times = experiment.times()
    panels: dict[str, dict[str, Curve]] = {}
    ends: dict[str, list[float]] = {}
    for problem, method in product(experiment.problems, experiment.methods):
        if runs := experiment.runs(method, problem):
            gaps = 100.0 * np.array([experiment.gaps(r, times) for r in runs])
            middle, *band = _band(gaps)
            panels.setdefault(problem, {})[method] = (times, middle, (band[0], band[1]))
            ends.setdefault(method, []).append(middle[-1])
    best = sorted(ends, key=lambda method: np.mean(ends[method]))[:MAX_COLOURS]

    def prepare(axes: Axes, _: str) -> None:
        axes.set(xscale="log", yscale="log", ylim=(1e-4, 30.0))
        plain_numbers(axes.xaxis, (1,))
        axes.set_xlim(times[0], times[-1])
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g} %"))

    clock = "seconds" if experiment.clock == "seconds" else "layouts simulated"
    headings = (
        f"Shortfall from the best known against {clock}",
        f"{experiment.limit} for each run, {experiment.over_seeds(MEDIANS)}",
    )
    draw_curves(path, panels, headings, (clock, "shortfall from the best known"), prepare, best)


def draw_over_settings(experiment: Experiment, path: Path, name: str, unit: str) -> None:
    """Draw a map for each method over two settings, else a panel for each setting.

    Parameters
    ----------
    experiment
        A sweep.
    path
        PNG file.
    name
        Name of the scene that was varied.
    unit
        Unit of its score; without one, scores are drawn, not gains.
    """
    keys, value = experiment.keys, "gain over uniform" if unit else "score"
    number = len(experiment.points)
    headings = (
        f"{name}: {value}, over {' and '.join(keys)}",
        f"{number} scenes, {experiment.limit} a search, {experiment.over_seeds(MEDIANS)}",
    )
    columns = zip(*experiment.points, strict=True)
    places = {key: _places(list(column)) for key, column in zip(keys, columns, strict=True)}
    if len(keys) == 2 and number == len(places[keys[0]]) * len(places[keys[1]]):
        across, up = (list(places[key]) for key in keys)
        write_png(_maps(experiment, across, up, headings, gains=bool(unit)), path)
        return
    panels: dict[str, dict[str, Curve]] = {}
    for key in keys[:MAX_PANELS]:
        panels[key] = {}
        for method in experiment.methods:
            groups: dict[float, list[float]] = {}
            for r in experiment.runs(method):
                x = places[key][r.labels[key]]
                groups.setdefault(x, []).append(_value(r, gains=bool(unit)))
            lines = [(x, *_band(np.array(groups[x]))) for x in sorted(groups)]
            x, middle, *ends = np.array(lines).T
            panels[key][method] = (x, middle, (ends[0], ends[1]))

    def prepare(axes: Axes, key: str) -> None:
        ticks = places[key]
        if any(isinstance(label, str) for label in ticks):
            axes.set_xticks(list(ticks.values()), [str(label) for label in ticks])
        elif min(ticks.values()) > 0.0 and np.median([*ticks.values()]) < 0.2 * max(ticks.values()):
            axes.set_xscale("log")  # the values are spread so
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}{' %' * bool(unit)}"))

    draw_curves(path, panels, headings, ("", value), prepare, experiment.methods[:MAX_COLOURS])


def draw_over_clock(experiment: Experiment, clock: str, path: Path, solid: Collection[str]) -> None:
    """Draw the best normalised score over a clock, in a panel for all problems and for each.

    Parameters
    ----------
    experiment
        A benchmark.
    clock
        "seconds" or "evaluations".
    path
        PNG file.
    solid
        Methods whose lines are solid.
    """
    panels: dict[str, dict[str, Curve]] = {}
    everywhere = set(experiment.complete)
    together = [None] if len(experiment.problems) > 1 else []
    for problem, method in product([*together, *experiment.problems], experiment.methods):
        if experiment.runs(method, problem) and (problem or method in everywhere):
            times, mean = experiment.curve(method, clock, problem, EARLIEST[clock])
            panel = panels.setdefault(problem or "all scenes", {})
            panel[method] = (times, mean.value, mean.interval)

    def prepare(axes: Axes, _: str) -> None:
        axes.set(xscale="log", ylim=(LOWEST, HIGHEST))
        axes.axhline(0.0, color=UNIFORM, linestyle=":", linewidth=1)
        axes.axhline(1.0, color=KNOWN, linestyle=":", linewidth=1)
        axes.set_yticks(*SCORE_TICKS)

    name = CLOCK_NAMES[clock] + ", logarithmic"
    headings = (
        f"Normalised score of the best policy or layout over {CLOCK_NAMES[clock]}",
        "interquartile means, 95 % intervals of five or more runs",
    )
    dashed = set(experiment.methods) - set(solid)
    draw_curves(path, panels, headings, (name, ""), prepare, experiment.methods, dashed)


def draw_intervals(experiment: Experiment, path: Path) -> None:
    """Draw the interquartile means with their intervals, and the performance profile."""
    figure, (means, profile) = new_panels(
        2, 2, (4.6, 3.4), headline="Normalised scores at the end of the runs",
        subtitle="95 % intervals of five or more runs, all scenes with equal weights",
    )  # fmt: skip
    order = [name for name in experiment.ranked(())[::-1] if name in experiment.complete]
    lines = method_lines(experiment.methods)
    for y, name in enumerate(order):
        mean, colour = experiment.mean_score(name), lines[name]["color"]
        if mean.interval is not None:
            means.plot(mean.interval, [y, y], color=colour, linewidth=5, alpha=0.35)
        means.plot([mean.value], [y], "o", color=colour, markersize=5)
        fraction = performance_profile(experiment.final_scores(name), PROFILE_TARGETS)
        profile.plot(PROFILE_TARGETS, fraction.value, label=name, **lines[name])
        if fraction.interval is not None:
            profile.fill_between(
                PROFILE_TARGETS, *fraction.interval, color=colour, alpha=0.12, linewidth=0
            )
    style(means, "interquartile mean")
    means.set_xlim(LOWEST, HIGHEST)
    means.set_yticks(range(len(order)), order)
    means.axvline(0.0, color=UNIFORM, linestyle=":", linewidth=1)
    style(profile, "fraction of runs with a higher normalised score")
    profile.set_ylim(0.0, 1.02)
    profile.set_xlim(PROFILE_TARGETS[0], PROFILE_TARGETS[-1])
    profile.legend(loc="lower left", **LEGEND)
    for axes in (means, profile):
        axes.set_xticks([0.0, 0.5, 1.0], ["uniform", "50 %", "best known"])
        axes.set_xlabel("normalised score")
    write_png(figure, path)


def _maps(
    experiment: Experiment,
    across: list[Label],
    up: list[Label],
    headings: tuple[str, str],
    *,
    gains: bool,
) -> Figure:
    """Draw the medians of each method over the values of two settings."""
    methods = experiment.methods[:MAX_PANELS]
    figure, panels = new_panels(len(methods), 3, (4.0, 3.2), (1.6, 0.5), *headings)
    maps = np.full((len(methods), len(up), len(across)), np.nan)
    for m, method in enumerate(methods):
        cells: dict[tuple[int, int], list[float]] = {}
        for r in experiment.runs(method):
            x, y = r.labels.values()
            cells.setdefault((up.index(y), across.index(x)), []).append(_value(r, gains=gains))
        for cell, values in cells.items():
            maps[(m, *cell)] = _band(np.array(values))[0]
    known = maps[np.isfinite(maps)]
    colours = {"cmap": "Blues", "vmin": known.min(initial=1.0), "vmax": known.max(initial=0.0)}
    if gains:  # blue is better than uniform, red worse
        largest = np.abs(known).max(initial=0.0)
        colours = {"cmap": "RdBu", "vmin": -largest, "vmax": largest}
    image: Any = None
    for method, values_there, axes in zip(methods, maps, panels, strict=True):
        image = axes.imshow(values_there, origin="lower", aspect="auto", **colours)
        axes.grid(False)
        axes.set_title(method, loc="left", size=11, color=INK)
        axes.set_xlabel(experiment.keys[0])
        for set_ticks, labels in ((axes.set_xticks, across), (axes.set_yticks, up)):
            ticks = range(0, len(labels), -(-len(labels) // MAX_TICKS))
            names = [f"{v:g}" if isinstance(v := labels[k], float) else str(v) for k in ticks]
            set_ticks(list(ticks), names)
    panels[0].set_ylabel(experiment.keys[1])
    percent = " %" if gains else ""
    bar = figure.colorbar(image, ax=panels, format=FuncFormatter(lambda y, _: f"{y:g}{percent}"))
    bar.outline.set_visible(False)
    return figure


def _value(result: TaskResult, *, gains: bool) -> float:
    """Return the value that is drawn for a result: its gain [%], or its score."""
    if not gains:
        return result.score
    return np.nan if result.gain is None else 100.0 * result.gain


def _band(values: Floats) -> tuple[Any, Any, Any]:
    """Return median, least and largest value over the first axis, NaN left out."""
    if not np.isfinite(values).any():
        return (np.full(values.shape[1:], np.nan),) * 3
    values = np.where(np.isnan(values), np.nanmedian(values, axis=0), values)
    return np.median(values, axis=0), values.min(axis=0), values.max(axis=0)


def _places(values: list[Label]) -> dict[Label, float]:
    """Return the coordinates of values: numbers themselves, words one after the other."""
    if any(isinstance(value, str) for value in values):
        return {value: float(k) for k, value in enumerate(dict.fromkeys(values))}
    return {value: float(value) for value in sorted(values, key=float)}
