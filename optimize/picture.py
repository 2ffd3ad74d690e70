"""The picture of a search: both rows to scale, what differs along them, the search."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from domino_env.core.colours import OURS, UNIFORM
from domino_env.core.plot_style import beside_line, clock, write_png
from domino_env.view.figures import beside_uniform
from optimize.result import SearchResult


def draw(result: SearchResult, path: Path) -> None:
    """Draw the result of a search into a PNG file."""
    write_png(picture(result), path)


def picture(result: SearchResult) -> Figure:
    """Draw the figure, from top to bottom; Matplotlib's global state is not touched."""
    return beside_uniform(
        result.scene, result.layout, result.wave, result.score, f"found by {result.method}",
        lambda axes: _search(axes, result),
    )  # fmt: skip


def _search(axes: Axes, result: SearchResult) -> None:
    """Best score against time, with the uniform pitch's score as a line."""
    times = np.array([t for _, _, t, _ in result.trace])
    scores = np.array([score for _, _, _, score in result.trace])
    mark, last = result.uniform.score, scores[-1]
    axes.axhline(mark, color=UNIFORM, linewidth=1.5)
    axes.step(times, scores, color=OURS, linewidth=1.5, where="post")
    above = scores[0] < mark  # where the curve is not
    beside_line(axes, f"best uniform pitch {mark:.4f}", 0.005, mark, UNIFORM, above=above)
    beside_line(axes, f"{result.method} {last:.4f}", 1.0, last, OURS, above=last >= mark)
    lowest = scores[scores > 0.0].min() if last > 0.0 else scores.min()
    if last > 0.0:  # how it began would flatten the rest
        lowest = max(lowest, 0.85 * last)
    low, high = min(lowest, mark if mark > 0.0 else lowest), max(last, mark)
    room = 0.2 * (high - low) + 0.005 * abs(high)
    axes.set_ylim(low - room, high + room)
    clock(axes, times)
    unit = f" [{result.scene.unit}]" if result.scene.unit else ""
    axes.set_ylabel(f"best score{unit}" if high > 0.0 else "best score (below 0: it dies)")
    axes.set_xlabel(
        f"seconds of search ({result.method}, seed {result.seed}, {result.evaluations} rows)"
    )
