"""Picture of a training: its layout beside the uniform baseline, and the learning curve."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from domino_env.view.figures import beside_uniform
from optimize.experiments.best_known import best_known
from optimize.result import draw_scores

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
    """Draw the learning curve, with the uniform baseline and the best known score."""
    table = np.array(run.curve)
    lines = {f"uniform baseline {rollout.uniform.score:.4f}": rollout.uniform.score}
    known = best_known().get(rollout.scene.name)
    if known is not None:
        lines[f"best known {known.score:.4f}"] = known.score
    curves = {"best so far": table[:, 3], "policy, without noise": table[:, 2]}
    about = f"training ({run.algorithm}, {run.steps:,} dominoes placed)"
    draw_scores(axes, table[:, 1], curves, lines, rollout.scene.unit, about)
