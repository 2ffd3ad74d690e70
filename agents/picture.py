"""Picture of a training: its layout beside the uniform baseline, and the learning curve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from domino_env.core.colours import KNOWN, OURS, SKY, UNIFORM
from domino_env.core.plot_style import LEGEND, set_time_axis
from domino_env.view.figures import beside_uniform
from optimize.experiments.best_known import best_known

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from agents.rollout import Rollout
    from agents.training import Run


def picture(run: Run) -> Figure:
    """Draw the layout of a training, the uniform baseline and the learning curve.

    Parameters
    ----------
    run
        The training.

    Returns
    -------
    Figure
        The figure.

    Raises
    ------
    ValueError
        If scenes are sampled: there is no single layout.
    """
    rollout = run.rollout
    if rollout is None:
        raise ValueError(
            f"{run.folder} was trained on sampled scenes of {run.scene}, which have no single "
            "layout: see progress.csv, or evaluate it in one scene"
        )
    return beside_uniform(
        rollout.scene, rollout.layout, rollout.wave, rollout.score, f"built by {run.algorithm}",
        lambda axes: _draw_learning(axes, run, rollout),
    )  # fmt: skip


def _draw_learning(axes: Axes, run: Run, rollout: Rollout) -> None:
    """Draw the scores of the policy during training, with lines to compare them with."""
    scene = rollout.scene
    table = np.array(run.curve)
    seconds, score, best = table[:, 1], table[:, 2], table[:, 3]
    for values, width, colour, label in (
        (score, 1, SKY, "policy, without noise"), (best, 2, OURS, "best so far"),
    ):  # fmt: skip
        shown = values > 0.0
        axes.plot(seconds[shown], values[shown], color=colour, lw=width, label=label)
    lines = [(rollout.uniform.score, UNIFORM, "-", "uniform baseline")]
    known = best_known().get(scene.name)
    if known is not None:
        lines.append((known.score, KNOWN, ":", "best known"))
    for value, colour, line, label in lines:
        axes.axhline(value, color=colour, ls=line, label=f"{label} {value:.4f}")
    scores = [rollout.score, *(value for value, *_ in lines)]
    low, high = min(scores), max(scores)
    margin = 0.01 * abs(high)
    axes.set_ylim(low - 0.9 * (high - low) - margin, high + margin)  # the legend is below
    set_time_axis(axes, seconds)
    axes.set_xlabel(f"seconds of training ({run.algorithm}, {run.steps:,} dominoes placed)")
    axes.set_ylabel(f"score [{scene.unit}]" if scene.unit else "score")
    axes.legend(loc="lower right", ncols=3, **LEGEND)
