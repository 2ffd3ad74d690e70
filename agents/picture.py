"""Pictures of trainings: the learning curve and the row of one, the curves of many."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from domino_env.files import write_bytes
from optimize.best_known import best_known

if TYPE_CHECKING:
    from agents.long_runs import Learned
    from agents.training import Run
    from optimize.result import SearchResult

SEED_COLOURS = ("#0072B2", "#56B4E9", "#009E73")


def draw(run: Run, rival: SearchResult | None, path: Path) -> None:
    """Write result.png; rival: what CMA-ES found, if it was asked."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5.5), layout="constrained")
    curve, row = figure.subplots(2, 1, height_ratios=[3, 1.2])
    table = np.array(run.curve)
    seconds, score, best = table[:, 1], table[:, 2], table[:, 3]
    shown = score > 0.0
    curve.plot(seconds[shown], score[shown], color="#56B4E9", lw=1, label="policy, without noise")
    curve.plot(seconds[best > 0.0], best[best > 0.0], color="#0072B2", lw=2, label="best so far")
    marks = [run.built.uniform.score]
    curve.axhline(marks[0], color="#6b7280", ls="--", label=f"best uniform {marks[0]:.4f}")
    if rival is not None:
        found = f"CMA-ES in {rival.seconds:.0f} s {rival.score:.4f}"
        curve.axhline(rival.score, color="#009E73", ls="-.", label=found)
        marks.append(rival.score)
    if run.clone_score is not None:
        told = f"the clone it began with {run.clone_score:.4f}"
        curve.axhline(run.clone_score, color="#CC79A7", ls="-.", label=told)
        marks.append(run.clone_score)
    known = best_known().get(run.built.scene.name)
    if known is not None:
        marks.append(known.score)
        curve.axhline(known.score, color="#D55E00", ls=":", label=f"best known {known.score:.4f}")
    low = min(marks) - 0.6 * (max(marks) - min(marks)) - 0.01 * abs(marks[0])
    curve.set_ylim(low, max(*marks, run.built.score) + 0.01 * abs(marks[0]))
    curve.set_xlabel("seconds of training")
    curve.set_ylabel("score")
    built = run.built
    curve.set_title(f"{built.scene.name}, {run.algorithm}: {built.score:.5f}, {run.steps:,} steps")
    curve.legend(loc="lower right", frameon=False)
    layout = run.built.layout
    row.plot(np.arange(layout.count - 1), layout.spacing * 1e3, color="#0072B2", label="gap")
    if run.built.scene.free_thickness:
        thick = layout.thickness * 1e3
        row.plot(np.arange(layout.count), thick, color="#E69F00", label="thickness")
        row.legend(frameon=False)
    row.set_xlabel("domino")
    row.set_ylabel("gap [mm]" if not run.built.scene.free_thickness else "[mm]")
    for axes in (curve, row):
        axes.spines[["top", "right"]].set_visible(False)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    write_bytes(path, lambda file: file.write(buffer.getvalue()))


def draw_shares(runs: list[Learned]) -> bytes:
    """Learning curves as PNG, a panel a scene: the share of the best known row's gain over time."""
    from matplotlib.figure import Figure

    scenes = list(dict.fromkeys(run.scene for run in runs))
    figure = Figure(figsize=(9, 2.6 * ((len(scenes) + 1) // 2)), layout="constrained")
    panels = figure.subplots((len(scenes) + 1) // 2, 2, squeeze=False).ravel()
    for panel, scene in zip(panels, scenes, strict=False):
        for run in (r for r in runs if r.scene == scene):
            share = (run.best - run.uniform) / (run.known - run.uniform)
            panel.plot(run.seconds, share, lw=1.5, color=SEED_COLOURS[run.seed % 3])
        panel.axhline(0.0, color="#6b7280", ls="--", lw=1)
        panel.axhline(1.0, color="#D55E00", ls=":", lw=1)
        panel.set_ylim(-0.5, 1.08)
        panel.set_yticks([0.0, 0.8, 1.0], ["uniform", "80 %", "best known"])
        panel.set_xlim(0.0, None)
        panel.set_title(scene, loc="left", fontsize=10)
        panel.set_xlabel("processor seconds")
        panel.grid(axis="y", color="#e5e7eb")
        panel.spines[["top", "right"]].set_visible(False)
    for panel in panels[len(scenes) :]:
        panel.set_axis_off()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()
