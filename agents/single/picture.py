"""Picture of a training: its learning curve, and the row that its best policy builds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from domino_env.support.plot_style import (
    AMBER,
    GREEN,
    KNOWN,
    LEGEND,
    OURS,
    PINK,
    SKY,
    UNIFORM,
    new_figure,
    style,
    write_png,
)
from optimize.records.shipped import best_known

if TYPE_CHECKING:
    from agents.single.result import Run
    from optimize.evaluation.result import SearchResult


def draw(run: Run, rival: SearchResult | None, path: Path) -> None:
    """Draw result.png of a training.

    Parameters
    ----------
    run
        The training.
    rival
        What CMA-ES found, if it was asked.
    path
        The file.
    """
    figure = new_figure(9.0, 5.5)
    curve, row = figure.subplots(2, 1, height_ratios=[3, 1.2])
    table = np.array(run.curve)
    seconds, score, best = table[:, 1], table[:, 2], table[:, 3]
    shown = score > 0.0
    curve.plot(seconds[shown], score[shown], color=SKY, lw=1, label="policy, without noise")
    curve.plot(seconds[best > 0.0], best[best > 0.0], color=OURS, lw=2, label="best so far")
    marks = [run.built.uniform.score]
    curve.axhline(marks[0], color=UNIFORM, ls="--", label=f"best uniform {marks[0]:.4f}")
    if rival is not None:
        found = f"CMA-ES in {rival.seconds:.0f} s {rival.score:.4f}"
        curve.axhline(rival.score, color=GREEN, ls="-.", label=found)
        marks.append(rival.score)
    if run.clone_score is not None:
        label = f"the clone it began with {run.clone_score:.4f}"
        curve.axhline(run.clone_score, color=PINK, ls="-.", label=label)
        marks.append(run.clone_score)
    known = best_known().get(run.built.scene.name)
    if known is not None:
        marks.append(known.score)
        curve.axhline(known.score, color=KNOWN, ls=":", label=f"best known {known.score:.4f}")
    low = min(marks) - 0.6 * (max(marks) - min(marks)) - 0.01 * abs(marks[0])
    curve.set_ylim(low, max(*marks, run.built.score) + 0.01 * abs(marks[0]))
    curve.set_xlabel("seconds of training")
    curve.set_ylabel("score")
    built = run.built
    style(curve, f"{built.scene.name}, {run.algorithm}: {built.score:.5f}, {run.steps:,} steps")
    curve.legend(loc="lower right", **LEGEND)
    layout = run.built.layout
    row.plot(np.arange(layout.count - 1), layout.spacing * 1e3, color=OURS, label="gap")
    if run.built.scene.free_thickness:
        thick = layout.thickness * 1e3
        row.plot(np.arange(layout.count), thick, color=AMBER, label="thickness")
        row.legend(**LEGEND)
    row.set_xlabel("domino")
    row.set_ylabel("gap [mm]" if not run.built.scene.free_thickness else "[mm]")
    style(row)
    write_png(figure, path)
