"""Pictures of experiments: curves of methods in panels, and maps over two settings."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from domino_env.core.colours import FAINT, INK, KNOWN, OURS
from domino_env.core.plot_style import (
    LEGEND,
    method_lines,
    new_panels,
    plain_numbers,
    style,
    write_png,
)
from domino_env.core.types import Floats
from optimize.experiments.experiment import Experiment
from optimize.experiments.task import Label, TaskResult

Curve = tuple[Floats, Floats, Floats, Floats]  # places; what is drawn, and its band
Panels = Mapping[str, Mapping[str, Curve]]  # by title, by method
Prepare = Callable[[Axes, str], None]  # axes of a title

MOST = 7  # methods whose colours are told apart at a glance
MEDIANS = "medians and range of"
MOST_PANELS = 6  # of a sweep
WRITTEN = 12  # values of both keys up to which a map has its numbers


def draw_curves(
    path: Path,
    panels: Panels,
    headline: str,
    subtitle: str,
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
        The curves.
    headline, subtitle
        Words above all panels.
    labels
        Words below and beside the panels.
    prepare
        Sets the scales of a panel.
    methods
        Those that have a colour and a name, in this order; all others are grey behind them.
    dashed
        Methods whose lines are dashed.
    """
    figure, all_axes = new_panels(len(panels), 3, (3.8, 3.0), (1.9, 0.5), headline, subtitle)
    lines = method_lines(methods)
    drawn: dict[str, Any] = {}
    for (title, found), axes in zip(panels.items(), all_axes, strict=True):
        style(axes, title)
        prepare(axes, title)
        axes.set_xlabel(labels[0])
        for method, (places, middle, low, high) in found.items():
            if method not in methods:
                drawn["others"] = axes.plot(places, middle, color=FAINT, lw=0.9, zorder=1.0)[0]
                continue
            line = lines[method] | {"linewidth": 2.4 if method == "auto" else 1.5}
            line |= {"linestyle": "--"} if method in dashed else {}
            axes.fill_between(places, low, high, color=line["color"], alpha=0.12, linewidth=0)
            line |= {"marker": "o", "markersize": 3.5, "markevery": [-1]}  # of a single layout, all
            drawn[method] = axes.plot(places, middle, **line)[0]
    all_axes[0].set_ylabel(labels[1])
    figure.legend(list(drawn.values()), list(drawn), loc="outside right center", **LEGEND)
    write_png(figure, path)


def draw_over_time(experiment: Experiment, gaps: Path, targets: Path) -> None:
    """Draw the gap to the best known, and the part of the targets reached, against run time."""
    times, of_all = experiment.times(), "all problems"
    gap_curves: dict[str, dict[str, Curve]] = {}
    reached: dict[str, dict[str, Curve]] = {}
    several = [of_all] if len(experiment.problems) > 1 else []
    for problem in [*experiment.problems, *several]:
        one = None if problem == of_all else problem
        for method in experiment.methods:
            runs = experiment.of(method, one)
            if not runs:
                continue
            part = 100.0 * experiment.reached(method, times, one)
            reached.setdefault(problem, {})[method] = (times, part, part, part)
            if one is not None:
                band = 100.0 * np.array([experiment.gaps(r, times) for r in runs])
                gap_curves.setdefault(problem, {})[method] = (times, *_band(band))
    ends = {m: -experiment.reached(m, times[-1:])[0] for m in experiment.methods}
    best = sorted(ends, key=ends.__getitem__)[:MOST]
    clock = "seconds" if experiment.clock == "seconds" else "layouts simulated"
    budget = f"{experiment.budget} for each run"

    def prepare(axes: Axes) -> None:
        axes.set_xscale("log")
        plain_numbers(axes.xaxis, (1,))
        axes.set_xlim(times[0], times[-1])
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g} %"))

    def for_gaps(axes: Axes, _: str) -> None:
        axes.set_yscale("log")  # before anything is drawn: no scale is guessed
        axes.set_ylim(1e-4, 30.0)
        prepare(axes)

    def for_targets(axes: Axes, _: str) -> None:
        axes.set_ylim(0.0, 100.0)
        prepare(axes)

    what = "gap to the best known"
    draw_curves(
        gaps, gap_curves, f"{what.capitalize()} against {clock}",
        f"{budget}, {experiment.over_seeds(MEDIANS)}", (clock, what), for_gaps, best,
    )  # fmt: skip
    what = "targets reached"
    draw_curves(
        targets, reached, f"{what.capitalize()} against {clock}",
        f"{budget}, {experiment.over_seeds('all runs of')}", (clock, what), for_targets, best,
    )  # fmt: skip


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
    keys, what = experiment.keys, "gain over uniform" if unit else "score"
    headline = f"{name}: {what}, over {' and '.join(keys)}"
    number = len(experiment.points)
    subtitle = f"{number} scenes, {experiment.budget} a search, {experiment.over_seeds(MEDIANS)}"
    columns = zip(*experiment.points, strict=True)
    places = {key: _places(list(column)) for key, column in zip(keys, columns, strict=True)}
    values = [list(found) for found in places.values()]
    if len(keys) == 2 and len(experiment.points) == len(values[0]) * len(values[1]):
        write_png(_maps(experiment, values, headline, subtitle, bool(unit)), path)
        return
    panels: dict[str, dict[str, Curve]] = {}
    for key in keys[:MOST_PANELS]:
        panels[key] = {}
        for method in experiment.methods:
            at: dict[float, list[float]] = {}
            for r in experiment.of(method):
                at.setdefault(places[key][r.labels[key]], []).append(_worth(r, bool(unit)))
            lines = [(place, *_band(np.array(at[place]))) for place in sorted(at)]
            panels[key][method] = tuple(np.array(lines).T)

    def prepare(axes: Axes, key: str) -> None:
        at = places[key]
        if any(isinstance(value, str) for value in at):
            axes.set_xticks(list(at.values()), [str(value) for value in at])
        elif min(at.values()) > 0.0 and np.median([*at.values()]) < 0.2 * max(at.values()):
            axes.set_xscale("log")  # the values are spread so
        axes.yaxis.set_major_formatter(FuncFormatter(lambda y, _: f"{y:g}{' %' * bool(unit)}"))

    draw_curves(path, panels, headline, subtitle, ("", what), prepare, experiment.methods[:MOST])


def _maps(
    experiment: Experiment, values: list[list[Label]], headline: str, subtitle: str, gains: bool
) -> Figure:
    """Draw the medians of each method over the values of two settings."""
    methods, (across, up) = experiment.methods[:MOST_PANELS], values
    figure, panels = new_panels(len(methods), 3, (4.0, 3.2), (1.6, 0.5), headline, subtitle)
    maps = np.full((len(methods), len(up), len(across)), np.nan)
    for m, method in enumerate(methods):
        cells: dict[tuple[int, int], list[float]] = {}
        for r in experiment.of(method):
            x, y = r.labels.values()
            cells.setdefault((up.index(y), across.index(x)), []).append(_worth(r, gains))
        for place, found in cells.items():
            maps[(m, *place)] = _band(np.array(found))[0]
    known = maps[np.isfinite(maps)]
    low, high = (known.min(), known.max()) if len(known) else (0.0, 1.0)
    middle, colours = low, ["white", OURS]
    if gains:  # blue is better than uniform, orange worse
        high = max(-low, high)
        low, middle, colours = -high, 0.0, [KNOWN, "white", OURS]
    shades = LinearSegmentedColormap.from_list("gain", colours)
    image: Any = None
    for method, cell, axes in zip(methods, maps, panels, strict=True):
        image = axes.imshow(cell, origin="lower", aspect="auto", vmin=low, vmax=high, cmap=shades)
        for (j, k), value in np.ndenumerate(cell):
            if np.isfinite(value) and max(cell.shape) <= WRITTEN:
                dark = abs(value - middle) > 0.6 * (high - middle)
                colour = "white" if dark else INK
                axes.text(k, j, f"{value:.3g}", ha="center", va="center", size=8, color=colour)
        axes.grid(False)
        axes.set_title(method, loc="left", size=11, color=INK)
        axes.set_xlabel(experiment.keys[0])
        for put, names in ((axes.set_xticks, across), (axes.set_yticks, up)):
            every = -(-len(names) // 12)
            at = range(0, len(names), every)
            put(list(at), [f"{v:g}" if isinstance(v := names[k], float) else str(v) for k in at])
    panels[0].set_ylabel(experiment.keys[1])
    percent = " %" if gains else ""
    bar = figure.colorbar(image, ax=panels, format=FuncFormatter(lambda y, _: f"{y:g}{percent}"))
    bar.outline.set_visible(False)
    return figure


def _worth(result: TaskResult, gains: bool) -> float:
    """Return what is drawn of a result: its gain [%], or its score."""
    if not gains:
        return result.score
    return np.nan if result.gain is None else 100.0 * result.gain


def _band(values: Floats) -> tuple[Any, Any, Any]:
    """Return median, least and largest over the first axis, of what is known."""
    if not np.isfinite(values).any():
        return (np.full(values.shape[1:], np.nan),) * 3
    values = np.where(np.isnan(values), np.nanmedian(values, axis=0), values)
    return np.median(values, axis=0), values.min(axis=0), values.max(axis=0)


def _places(values: list[Label]) -> dict[Label, float]:
    """Return where values are drawn: numbers at themselves, words one after the other."""
    if any(isinstance(value, str) for value in values):
        return {value: float(k) for k, value in enumerate(dict.fromkeys(values))}
    return {value: float(value) for value in sorted(values, key=float)}
