"""Picture of a training: the layout of its best policy beside the uniform one, the curve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from domino_env.core.colours import GREEN, KNOWN, OURS, SKY, UNIFORM
from domino_env.core.plot_style import LEGEND, set_time_axis
from domino_env.view.figures import beside_uniform
from optimize.experiments.best_known import best_known

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from agents.rollout import Rollout
    from agents.training import Run
    from optimize.result import SearchResult


def picture(run: Run, baseline: SearchResult | None = None) -> Figure:
    """Draw the layouts and the learning curve of a training.

    Parameters
    ----------
    run
        The training.
    baseline
        What CMA-ES found, if it was asked.

    Raises
    ------
    ValueError
        Where scenes are sampled: there is no single layout.
    """
    built = run.rollout
    if built is None:
        raise ValueError(
            f"{run.folder} was trained on the scenes of {run.scene}, which have no single layout: "
            "see progress.csv, or evaluate it in one scene"
        )
    name = f"built by {run.algorithm}"
    return beside_uniform(
        built.scene, built.layout, built.wave, built.score, name,
        lambda axes: _learning(axes, run, built, baseline),
    )  # fmt: skip


def _learning(curve: Axes, run: Run, built: Rollout, baseline: SearchResult | None) -> None:
    """Draw the scores of the policy while it learned, and lines to compare them with."""
    scene, uniform = built.scene, built.uniform.score
    table = np.array(run.curve)
    seconds, score, best = table[:, 1], table[:, 2], table[:, 3]
    shown = score > 0.0
    curve.plot(seconds[shown], score[shown], color=SKY, lw=1, label="policy, without noise")
    curve.plot(seconds[best > 0.0], best[best > 0.0], color=OURS, lw=2, label="best so far")
    marks = [(uniform, UNIFORM, "-", "best uniform")]
    if baseline is not None:
        marks.append((baseline.score, GREEN, "-.", f"CMA-ES in {baseline.seconds:.0f} s"))
    known = best_known().get(scene.name)
    if known is not None:
        marks.append((known.score, KNOWN, ":", "best known"))
    for value, colour, line, said in marks:
        curve.axhline(value, color=colour, ls=line, label=f"{said} {value:.4f}")
    values = [value for value, *_ in marks]
    low, high = min(*values, built.score), max(*values, built.score)
    room = 0.01 * abs(high)
    curve.set_ylim(low - 0.9 * (high - low) - room, high + room)  # the legend stands below
    set_time_axis(curve, seconds)
    curve.set_xlabel(f"seconds of training ({run.algorithm}, {run.steps:,} dominoes placed)")
    curve.set_ylabel(f"score [{scene.unit}]" if scene.unit else "score")
    curve.legend(loc="lower right", ncols=3, **LEGEND)
