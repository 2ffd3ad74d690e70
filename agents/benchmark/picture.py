"""The pictures of a benchmark: what was reached, and the learning curves over two clocks."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from agents.algorithms import ALGORITHMS
from agents.benchmark.results import TARGETS, Benchmark
from domino_env.core.colours import KNOWN, UNIFORM
from domino_env.core.plot_style import (
    LEGEND,
    method_lines,
    new_panels,
    plain_numbers,
    style,
    write_png,
)
from optimize.studies.task import TaskResult

LOWEST, HIGHEST = -0.3, 1.06  # of the share that is drawn
SHARES = ([0.0, 0.5, 0.8, 1.0], ["uniform", "50 %", "80 %", "best known"])
BELOW = ([0.0, 0.5, 1.0], ["uniform", "50 %", "best known"])  # there is less room
WHERE = "where it lies between the best uniform row and the best row known"


def lines_of(benchmark: Benchmark) -> dict[str, dict[str, Any]]:
    """Give each algorithm its line: whole for what learns, broken for what it is held against."""
    names = benchmark.algorithms
    learn = [name for name in names if name in ALGORITHMS]
    colours = method_lines([*learn, *(name for name in names if name not in ALGORITHMS)])
    return {
        name: {
            "color": colours[name]["color"],
            "linestyle": "-" if name in ALGORITHMS else "--",
            "linewidth": 1.8 if name in ALGORITHMS else 1.3,
        }
        for name in names
    }


def draw_reached(benchmark: Benchmark, path: Path) -> None:
    """Draw interquartile means with their intervals, and the performance profile beside them."""
    names = benchmark.algorithms
    figure, (means, profile) = new_panels(
        2, 2, (4.6, 3.4), (0.0, 0.0), "What is reached in the end",
        f"{WHERE}; 95 % intervals over seeds, all scenes together",
    )  # fmt: skip
    looks = lines_of(benchmark)
    order = sorted(names, key=lambda name: float(benchmark.gain(name).value))
    for place, name in enumerate(order):
        found, colour = benchmark.gain(name), looks[name]["color"]
        low, value, high = (np.clip(float(x), LOWEST, None) for x in
                            (found.low, found.value, found.high))  # fmt: skip
        means.plot([low, high], [place, place], color=colour, linewidth=5, alpha=0.35)
        means.plot([value], [place], "o", color=colour, markersize=5)
        reached = benchmark.profile(name)
        profile.plot(TARGETS, reached.value, label=name, **looks[name])
        profile.fill_between(TARGETS, reached.low, reached.high, color=colour, alpha=0.12, lw=0)
    style(means, "interquartile mean")
    means.set_yticks(range(len(order)), order)
    means.axvline(0.0, color=UNIFORM, linestyle=":", linewidth=1)
    style(profile, "part of the runs that reach a share")
    profile.set_ylim(0.0, 1.02)
    profile.set_xlim(TARGETS[0], TARGETS[-1])
    profile.legend(loc="lower left", **LEGEND)
    for axes in (means, profile):
        axes.set_xticks(*BELOW)
    write_png(figure, path)


def draw_curves(benchmark: Benchmark, clock: str, path: Path) -> None:
    """Draw the best row so far over a clock, a panel for all scenes and one for each."""
    panels: list[str | None] = [*benchmark.scenes]
    if len(panels) > 1:
        panels.insert(0, None)
    figure, all_axes = new_panels(
        len(panels), 2, (4.3, 2.7), (1.1, 0.0), f"Best row so far over {clock}",
        f"{WHERE}; interquartile means, 95 % intervals",
    )  # fmt: skip
    looks = lines_of(benchmark)
    drawn: dict[str, Any] = {}
    for scene, axes in zip(panels, all_axes, strict=True):
        style(axes, scene or "all scenes")
        axes.set_xscale("log")
        end = max(_end(benchmark, r, clock) for r in benchmark.results
                  if scene in (None, r.scene_name))  # fmt: skip
        for name in benchmark.algorithms:
            found = benchmark.curve(name, clock, scene)
            if found is None:
                continue
            times, shares = found
            if len(times) > 1 and times[-1] > times[0]:
                axes.fill_between(
                    times, shares.low, shares.high, color=looks[name]["color"], alpha=0.15, lw=0
                )
            drawn[name] = axes.plot(times, shares.value, **looks[name])[0]
            last = (float(times[-1]), float(shares.value[-1]))
            axes.plot(*last, "o", color=looks[name]["color"], markersize=3.5)
            axes.plot([last[0], end], [last[1]] * 2, color=looks[name]["color"], lw=0.6, alpha=0.6)
        axes.axhline(0.0, color=UNIFORM, linestyle=":", linewidth=1)
        axes.axhline(1.0, color=KNOWN, linestyle=":", linewidth=1)
        axes.set_ylim(LOWEST, HIGHEST)
        axes.set_yticks(*SHARES)
        plain_numbers(axes.xaxis, (1,))
        axes.set_xlabel(clock)
    figure.legend(list(drawn.values()), list(drawn), loc="outside right center", **LEGEND)
    write_png(figure, path)


def _end(benchmark: Benchmark, result: TaskResult, clock: str) -> float:
    return float(benchmark.steps(result, clock)[0][-1])
