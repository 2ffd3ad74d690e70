"""Levenberg–Marquardt within the box, for schedules (Moré 1978).

The exact gradient of every arrival time is known, so all of them are met at once by least squares,
where a method that uses only their mean square error converges slowly. With more variables than
times, the damped step is the shortest one that helps, and layouts stay near the start. The search
then begins again elsewhere, because some starts end at a layout that cannot follow the schedule, or
at a kink.

Without a schedule the score is the only residual: its target is a little above the best so far, and
rises or falls with success (Polyak 1987, a level that is estimated).

References
----------
Moré, J. J. (1978). The Levenberg-Marquardt algorithm: implementation and theory. Lecture Notes in
Mathematics 630, 105-116.

Polyak, B. T. (1987). Introduction to Optimization. Optimization Software, New York.
"""

from __future__ import annotations

from itertools import islice

import numpy as np
from scipy.optimize import lsq_linear

from domino_env.core.types import Floats
from optimize.evaluator import Evaluator
from optimize.methods.starts import starts

ON_TIME = 1e-9  # [s] RMS error below which a row is on time
DAMPING = 1e-2  # at first, as a part of the largest squared slope
TRIES = 12  # dampings tried before a row counts as an end
ROUNDS = 100
FEW = 4  # starts that show whether a schedule can be kept
ON_SCHEDULE = f"every domino is hit on schedule, to {ON_TIME:g} s"
SLOW, PATIENCE = 0.999, 8  # the error that counts as no gain, and how many such rounds end it
LEVEL = 0.02  # relative rise asked for at first, where there is no schedule


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Search from one start after the other until a limit is reached or a layout is on time."""
    descend = _level if evaluator.problem.scene.tempo is None else _least_squares
    for start in starts(evaluator, rng):
        if descend(evaluator, start):
            evaluator.status = ON_SCHEDULE
            return


def is_soon_on_time(evaluator: Evaluator, rng: np.random.Generator) -> bool:
    """Search from a few starts; return whether a layout on time was found."""
    return any(_least_squares(evaluator, start) for start in islice(starts(evaluator, rng), FEW))


def _least_squares(evaluator: Evaluator, design: Floats) -> bool:
    """Search from one start; return whether a layout on time was found."""
    problem = evaluator.problem
    design = problem.project(design[None])[0]
    scores, late, slopes = evaluator.lateness(design)
    if len(late) == 0:
        return False
    damping = DAMPING
    idle = 0
    for _ in range(ROUNDS):
        if np.sqrt(np.mean(late**2)) < ON_TIME:
            return True
        scale = float(np.square(slopes).sum(axis=0).max())
        for _ in range(TRIES):
            step = _step(design, late, slopes, damping * scale)
            ahead = problem.project((design + step)[None])[0]
            found = evaluator.lateness(ahead)
            if found[0].score[0] > scores.score[0]:
                break
            damping *= 4.0
        else:
            return False
        gained = np.square(found[1]).sum() < SLOW * np.square(late).sum()
        idle = 0 if gained else idle + 1
        if idle == PATIENCE:
            return False
        design, (scores, late, slopes) = ahead, found
        damping = max(damping / 10.0, 1e-14)
    return False


def _step(design: Floats, late: Floats, slopes: Floats, damping: float) -> Floats:
    """The step within the box that makes |late + slopes·step|² + damping·|step|² least."""
    n = len(design)
    matrix = np.concatenate([slopes, np.sqrt(damping) * np.eye(n)])
    right = np.concatenate([-late, np.zeros(n)])
    room = np.maximum(1.0 - design, 1e-12), np.maximum(design, 1e-12)
    free = np.linalg.lstsq(matrix, right, rcond=None)[0]
    if np.all(free <= room[0]) and np.all(free >= -room[1]):
        return np.asarray(free)
    return np.asarray(lsq_linear(matrix, right, bounds=(-room[1], room[0]), method="bvls").x)


def _level(evaluator: Evaluator, design: Floats) -> bool:
    """Step to where the gradient promises the target; returns False, as nothing is on time."""
    problem = evaluator.problem
    design = problem.project(design[None])[0]
    found = evaluator.evaluate(design, gradient=True)
    best, gradient = found.score, found.gradient
    rise = LEVEL * max(abs(best), 1e-3)
    while rise > 1e-7 * max(abs(best), 1e-3):
        if not gradient.any():
            return False
        step = np.clip(rise * gradient / float(gradient @ gradient), -0.2, 0.2)
        ahead = problem.project(np.clip(design + step, 0.0, 1.0)[None])[0]
        found = evaluator.evaluate(ahead, gradient=True)
        if found.score > best:
            design, best, gradient = ahead, found.score, found.gradient
            rise *= 1.5
        else:
            rise *= 0.5
    return False
