"""Polishing: a few exact-gradient steps from the row that the networks propose."""

from __future__ import annotations

import numpy as np

from domino_env import Layout, Scene
from optimize.methods.gradient.local_search import Ascent
from optimize.problem import Problem

LEAST, MOST, DOMINOES = 4, 12, 320  # steps, and dominoes in all of them that take some 4 ms
BEND = 1.0  # second derivative of ln(score) by the logarithm of a gap, times how many there are


def steps_of(count: int) -> int:
    """Give the steps that are worth their time for a row of `count` dominoes."""
    return int(np.clip(DOMINOES // count, LEAST, MOST))


def polished(scene: Scene, layout: Layout, steps: int) -> Layout:
    """Climb from a row by quasi-Newton steps with the exact gradient of the score.

    Near good rows the curvature of the score is much the same in all scenes, so that the first step
    can go by it; what the flushes make of it is learned on the way.

    Parameters
    ----------
    scene
        Whose score counts, and whose rules are kept.
    layout
        Where to begin.
    steps
        Evaluations with gradient; 0 for none.

    Returns
    -------
    Layout
        The best row met.
    """
    if steps < 1:
        return layout
    problem = Problem(scene)
    start, span = problem.design(layout), problem.high - problem.low
    inverse = ((problem.low + start * span) / span) ** 2 * (scene.count - 1) / BEND
    unit = float(np.sqrt(scene.physics.gravity * scene.height))  # of which scores are about one
    project = problem.project if problem.coupled else None
    arm = Ascent(start, project, inverse / unit)
    while arm.told < steps and not arm.done:
        scores, slopes = problem.scores_and_gradients(arm.wanted[None], of_dying=False)
        arm.tell(float(scores[0]), slopes[0])
    return problem.layout(arm.design)
