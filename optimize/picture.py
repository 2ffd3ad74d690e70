"""The picture of a run: both rows to scale, spacing and wave speed along them, the search."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from domino_env.files import write_bytes
from domino_env.layout import Layout
from domino_env.wave import Wave
from optimize.result import SearchResult

UNIFORM, BEST, INK, FAINT = "#8a8f98", "#0b6e99", "#222222", "#d9dce1"
SHOWN = 120  # dominoes drawn of a longer row


def draw(result: SearchResult, path: Path) -> None:
    """Draw the result of a search into a PNG file."""
    figure = Figure(figsize=(11.0, 9.0), dpi=130, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(4, 1, height_ratios=[1.15, 1.0, 1.0, 1.0], hspace=0.08)
    rows = figure.add_subplot(grid[0])
    spacing = figure.add_subplot(grid[1])
    speed = figure.add_subplot(grid[2], sharex=spacing)
    search = figure.add_subplot(grid[3])
    figure.suptitle(_headline(result), fontsize=13, x=0.02, ha="left", color=INK)
    _draw_rows(rows, result)
    _draw_spacing(spacing, result)
    _draw_speed(speed, result)
    _draw_search(search, result)
    write_bytes(path, lambda file: figure.savefig(file, format="png"))


def _headline(result: SearchResult) -> str:
    name, wave = result.scene.name, result.wave
    if wave.mean_speed == 0.0:
        return f"{name}: no layout found that topples to the end"
    mark = result.uniform.wave.mean_speed
    if mark == 0.0:
        return f"{name}: {wave.mean_speed:.4f} m/s; no uniform pitch topples to the end"
    return (
        f"{name}: {wave.mean_speed:.4f} m/s, {result.gain:+.2%} against the best uniform pitch "
        f"({mark:.4f} m/s)"
    )


def _draw_rows(axes: Axes, result: SearchResult) -> None:
    """Both rows from the side, the same scale, the wave running to the right."""
    tallest = result.scene.height * 1e3
    pairs = ((result.uniform.layout, UNIFORM, "best uniform"), (result.layout, BEST, result.method))
    ends = []
    for level, (layout, colour, label) in enumerate(pairs):
        base = -level * 1.75 * tallest
        shown = min(layout.count, SHOWN)
        front = layout.positions[:shown] * 1e3
        thick = layout.thickness[:shown] * 1e3
        tall = layout.height[:shown] * 1e3
        boxes = [Rectangle((x - d, base), d, h) for x, d, h in zip(front, thick, tall, strict=True)]
        axes.add_collection(PatchCollection(boxes, facecolor=colour, edgecolor="none"))
        axes.axhline(base, color=INK, linewidth=0.6)
        more = f" (first {shown} of {layout.count})" if shown < layout.count else ""
        axes.text(-thick[0], base + 1.12 * tallest, label + more, fontsize=9, color=colour)
        ends.append(front[-1])
    axes.set_xlim(-result.layout.thickness[0] * 1e3 - 5.0, max(ends) + 5.0)
    axes.set_ylim(-1.75 * tallest - 4.0, 1.6 * tallest)
    axes.set_aspect("equal", adjustable="box", anchor="W")
    axes.set_yticks([])
    axes.set_xlabel("position along the row [mm]")
    for side in ("left", "right", "top", "bottom"):
        axes.spines[side].set_visible(False)


def _style(axes: Axes, ylabel: str) -> None:
    axes.grid(color=FAINT, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_ylabel(ylabel)


def _draw_spacing(axes: Axes, result: SearchResult) -> None:
    gaps = np.arange(result.scene.count - 1)
    low, high = (1e3 * b for b in result.scene.spacing)
    for bound in {low, high}:
        axes.axhline(bound, color=FAINT, linewidth=1.5)
    axes.plot(gaps, 1e3 * result.uniform.layout.spacing, color=UNIFORM, label="best uniform")
    axes.plot(gaps, 1e3 * result.layout.spacing, color=BEST, marker=".", label=result.method)
    _style(axes, "spacing [mm]")
    if result.scene.free_thickness:
        right = axes.twinx()
        right.step(gaps, 1e3 * result.layout.thickness[1:], color=BEST, linestyle=":", where="mid")
        right.set_ylabel("thickness, dotted [mm]")
        right.spines["top"].set_visible(False)
    axes.legend(frameon=False, fontsize=9, loc="upper center", ncols=2)


def local_speed(layout: Layout, wave: Wave) -> np.ndarray:
    """(N-1,) pitch over the time between two arrivals [m/s]; nan where the wave did not come."""
    times = np.where(np.isfinite(wave.arrival_times), wave.arrival_times, np.nan)
    speed: np.ndarray = layout.pitch / np.diff(times)
    return speed


def _draw_speed(axes: Axes, result: SearchResult) -> None:
    gaps = np.arange(result.scene.count - 1)
    uniform, best = result.uniform, result
    axes.plot(gaps, local_speed(uniform.layout, uniform.wave), color=UNIFORM)
    axes.plot(gaps, local_speed(best.layout, best.wave), color=BEST, marker=".")
    _style(axes, "local wave speed [m/s]")
    axes.set_xlabel("gap number")


def _draw_search(axes: Axes, result: SearchResult) -> None:
    """Best score against time; what dies scores below zero and is left out."""
    trace = [(t, score) for _, _, t, score in result.trace if score > 0.0]
    mark = result.uniform.score
    if mark > 0.0:
        axes.axhline(mark, color=UNIFORM, linewidth=1.5, label=f"best uniform {mark:.4f}")
    if trace:
        seconds = [t for t, _ in trace] + [result.seconds]
        scores = [score for _, score in trace] + [trace[-1][1]]
        axes.step(
            seconds, scores, color=BEST, where="post", label=f"{result.method} {scores[-1]:.4f}"
        )
        low = min(mark if mark > 0.0 else scores[0], scores[0])
        axes.set_ylim(max(low, 0.9 * scores[-1]) - 0.01 * scores[-1], 1.01 * scores[-1])
    _style(axes, "best mean speed [m/s]")
    axes.set_xlabel(f"seconds of search ({result.evaluations} layouts simulated)")
    axes.set_xlim(left=0.0)
    axes.legend(frameon=False, fontsize=9, loc="lower right")
