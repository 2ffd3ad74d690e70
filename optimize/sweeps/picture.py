"""The picture of a sweep: what the searches gain over uniform, over one or two swept keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from domino_env.core.colours import INK, KNOWN, OURS, SOFT
from domino_env.core.plot_style import LEGEND, method_lines, new_panels, style, write_png
from optimize.studies.task import TaskResult
from optimize.sweeps.runner import Sweep

MOST_PANELS = 6  # methods, or keys where there are more than two
PANEL, BESIDE = (4.0, 3.2), (1.6, 0.5)  # [in]
WRITTEN = 12  # values of both keys up to which a map says its numbers
SPREAD = 15  # values of a key from which on they are taken for drawn ones

Floats = NDArray[np.float64]


def draw(sweep: Sweep, path: Path) -> None:
    """Draw a line a method over one key, a map a method over two, and a panel a key over more."""
    figure = _maps(sweep) if len(sweep.keys) == 2 and _on_a_grid(sweep) else _lines(sweep)
    write_png(figure, path)


def _worth(sweep: Sweep, result: TaskResult) -> float:
    """What is drawn of a result: its gain [%], or its score where that has no unit."""
    if not sweep.scene.unit:
        return result.score
    return np.nan if result.gain is None else 100.0 * result.gain


def _what(sweep: Sweep) -> str:
    return "gain over uniform" if sweep.scene.unit else "score"


def _words(sweep: Sweep) -> tuple[str, str]:
    """Headline and subtitle."""
    seeds, rows = len({r.seed for r in sweep.results}), max(r.evaluations for r in sweep.results)
    over = "one seed" if seeds == 1 else f"medians over {seeds} seeds"
    return (
        f"{sweep.scene.name}: {_what(sweep)}, over {' and '.join(sweep.keys)}",
        f"{sweep.scene.title} · {len(sweep.points)} scenes, up to {rows} rows a search, {over}",
    )


def _written(sweep: Sweep) -> FuncFormatter:
    percent = " %" if sweep.scene.unit else ""
    return FuncFormatter(lambda y, _: f"{y:g}{percent}")


def _places(sweep: Sweep, i: int) -> tuple[dict[Any, float], bool]:
    """Where the values of key i are drawn, and whether these are the values themselves."""
    values = list(dict.fromkeys(point[i] for point in sweep.points))
    if all(isinstance(v, int | float) for v in values):
        return {v: float(v) for v in sorted(values)}, True
    return {v: float(k) for k, v in enumerate(values)}, False


def _on_a_grid(sweep: Sweep) -> bool:
    sizes = [len(_places(sweep, i)[0]) for i in range(2)]
    return len(sweep.points) == sizes[0] * sizes[1]


def _lines(sweep: Sweep) -> Figure:
    """A panel for each key: the median of each method over it, and single results faintly."""
    keys = sweep.keys[:MOST_PANELS]
    figure, panels = new_panels(len(keys), 3, PANEL, BESIDE, *_words(sweep))
    styles = method_lines(sweep.methods)
    for i, (key, axes) in enumerate(zip(keys, panels, strict=True)):
        places, numbers = _places(sweep, i)
        for method in sweep.methods:
            runs = [r for r in sweep.results if r.method == method]
            x = np.array([places[sweep.point(r)[i]] for r in runs])
            y = np.array([_worth(sweep, r) for r in runs])
            line = styles[method] | {"linewidth": 1.8, "label": method}
            axes.plot(x, y, ".", color=line["color"], alpha=0.35, markersize=4)
            if len(places) <= SPREAD or len(keys) == 1:
                at, middle = _medians(x, y)
                axes.plot(at, middle, **line)
            else:
                axes.plot([], [], **line)
        if not numbers:
            axes.set_xticks(list(places.values()), [str(v) for v in places])
        elif _logarithmic(list(places.values())):
            axes.set_xscale("log")
        axes.set_xlabel(key)
        axes.yaxis.set_major_formatter(_written(sweep))
    panels[0].set_ylabel(_what(sweep))
    if len(sweep.methods) > 1:
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside right center", **LEGEND)
    return figure


def _maps(sweep: Sweep) -> Figure:
    """A map for each method, medians over the seeds."""
    methods = sweep.methods[:MOST_PANELS]
    figure, panels = new_panels(len(methods), 3, PANEL, BESIDE, *_words(sweep))
    (across, _), (up, _) = _places(sweep, 0), _places(sweep, 1)
    columns, rows = {v: k for k, v in enumerate(across)}, {v: k for k, v in enumerate(up)}
    maps = []
    for method in methods:
        cells: dict[tuple[int, int], list[float]] = {}
        for r in sweep.results:
            if r.method == method:
                x, y = sweep.point(r)
                cells.setdefault((rows[y], columns[x]), []).append(_worth(sweep, r))
        image = np.full((len(rows), len(columns)), np.nan)
        for at, found in cells.items():
            image[at] = _middle(np.array(found))
        maps.append(image)
    told = np.concatenate([image.ravel() for image in maps])
    told = told[np.isfinite(told)]
    low, high = (told.min(), told.max()) if len(told) else (0.0, 1.0)
    middle, colours = low, ["white", OURS]
    if sweep.scene.unit:  # of gains blue is better than uniform, orange worse
        high = max(-low, high)
        low, middle, colours = -high, 0.0, [KNOWN, "white", OURS]
    shades = LinearSegmentedColormap.from_list("gain", colours)
    written = len(columns) <= WRITTEN and len(rows) <= WRITTEN
    shown: Any = None
    for method, image, axes in zip(methods, maps, panels, strict=True):
        shown = axes.imshow(image, origin="lower", aspect="auto", vmin=low, vmax=high, cmap=shades)
        for (j, k), value in np.ndenumerate(image):
            if written and np.isfinite(value):
                dark = abs(value - middle) > 0.6 * (high - middle)
                colour = "white" if dark else INK
                axes.text(k, j, f"{value:.3g}", ha="center", va="center", size=8, color=colour)
        _ticks(axes.set_xticks, list(columns))
        _ticks(axes.set_yticks, list(rows))
        axes.set_xlabel(sweep.keys[0])
        style(axes, method)
        axes.grid(visible=False)
    panels[0].set_ylabel(sweep.keys[1])
    bar = figure.colorbar(shown, ax=panels, format=_written(sweep))
    bar.set_label(_what(sweep), color=SOFT)
    bar.ax.tick_params(colors=SOFT, labelsize=9)
    bar.outline.set_visible(False)
    return figure


def _ticks(put: Any, values: list[Any]) -> None:
    """At most a dozen, written shortly."""
    every = -(-len(values) // 12)
    at = range(0, len(values), every)
    names = [f"{values[k]:g}" if isinstance(values[k], float) else str(values[k]) for k in at]
    put(list(at), names)


def _medians(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    at = np.unique(x)
    return at, np.array([_middle(y[x == one]) for one in at])


def _middle(values: Floats) -> float:
    told = values[np.isfinite(values)]
    return float(np.median(told)) if len(told) else np.nan


def _logarithmic(values: list[float]) -> bool:
    """Whether values that are evenly spread are so in the logarithm."""
    if len(values) < 3 or values[0] <= 0.0 or values[-1] / values[0] < 20.0:
        return False
    steps = np.diff(np.log(values))
    return bool(np.ptp(steps) < 0.2 * steps.mean())
