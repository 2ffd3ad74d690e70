"""The picture of a sweep: what the searches gain over uniform, over one or two swept keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter
from numpy.typing import NDArray

from domino_env.files import write_bytes
from optimize.sweeping import Sweep
from optimize.task import TaskResult

INK, SOFT, FAINT = "#1d2126", "#5c636d", "#dfe2e6"
OURS = "#0b6e99"  # the default method
MOST_PANELS = 6  # methods, or keys where there are more than two
SPREAD = 15  # values of a key from which on they are taken for drawn ones

Floats = NDArray[np.float64]


def draw(sweep: Sweep, path: Path) -> None:
    """One key: a line a method.  Two: a map a method.  More: a panel a key."""
    figure = _maps(sweep) if len(sweep.keys) == 2 and _on_a_grid(sweep) else _lines(sweep)
    write_bytes(path, lambda file: figure.savefig(file, format="png", dpi=140))


def _worth(sweep: Sweep, result: TaskResult) -> float:
    """What is drawn of a result: its gain [%], or its score where that has no unit."""
    if not sweep.scene.unit:
        return result.score
    return np.nan if result.gain is None else 100.0 * result.gain


def _what(sweep: Sweep) -> str:
    return "gain over uniform" if sweep.scene.unit else "score"


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
    figure, panels = _panels(len(keys))
    for i, (key, axes) in enumerate(zip(keys, panels, strict=True)):
        places, numbers = _places(sweep, i)
        for method in sweep.methods:
            runs = [r for r in sweep.results if r.method == method]
            x = np.array([places[sweep.point(r)[i]] for r in runs])
            y = np.array([_worth(sweep, r) for r in runs])
            colour = _colour(sweep, method)
            axes.plot(x, y, ".", color=colour, alpha=0.35, markersize=4)
            if len(places) <= SPREAD or len(keys) == 1:
                at, middle = _medians(x, y)
                axes.plot(at, middle, color=colour, linewidth=1.8, label=method)
            else:
                axes.plot([], [], color=colour, linewidth=1.8, label=method)
        if not numbers:
            axes.set_xticks(list(places.values()), [str(v) for v in places])
        elif _logarithmic(list(places.values())):
            axes.set_xscale("log")
        axes.set_xlabel(key, color=SOFT)
        axes.yaxis.set_major_formatter(_written(sweep))
        axes.grid(color=FAINT, linewidth=0.6)
    panels[0].set_ylabel(_what(sweep), color=SOFT)
    if len(sweep.methods) > 1:
        handles, names = panels[0].get_legend_handles_labels()
        figure.legend(handles, names, loc="outside right upper", frameon=False, fontsize=9)
    return figure


def _maps(sweep: Sweep) -> Figure:
    """A map for each method, medians over the seeds."""
    methods = sweep.methods[:MOST_PANELS]
    figure, panels = _panels(len(methods))
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
    shown: Any = None
    for method, image, axes in zip(methods, maps, panels, strict=True):
        shown = axes.imshow(
            image, origin="lower", aspect="auto", vmin=low, vmax=high, cmap="viridis"
        )
        _ticks(axes.set_xticks, list(columns))
        _ticks(axes.set_yticks, list(rows))
        axes.set_xlabel(sweep.keys[0], color=SOFT)
        axes.set_title(method, loc="left", color=INK, size=11, weight="bold")
    panels[0].set_ylabel(sweep.keys[1], color=SOFT)
    bar = figure.colorbar(shown, ax=panels, format=_written(sweep))
    bar.set_label(_what(sweep), color=SOFT)
    return figure


def _panels(number: int) -> tuple[Figure, list[Axes]]:
    columns = min(number, 3)
    lines = -(-number // columns)
    figure = Figure(figsize=(1.6 + 4.0 * columns, 0.5 + 3.2 * lines), facecolor="white")
    FigureCanvasAgg(figure)
    figure.set_layout_engine("constrained")
    found = list(figure.subplots(lines, columns, squeeze=False).ravel())
    for axes in found[number:]:
        axes.remove()
    for axes in found[:number]:
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.spines[["left", "bottom"]].set_color(SOFT)
        axes.tick_params(colors=SOFT, labelsize=9)
    return figure, found[:number]


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


def _colour(sweep: Sweep, method: str) -> str:
    if method == "auto":
        return OURS
    others = [m for m in sweep.methods if m != "auto"]
    colour = colormaps["tab10"]((others.index(method) + 1) % 10)
    return "#" + "".join(f"{round(255 * c):02x}" for c in colour[:3])
