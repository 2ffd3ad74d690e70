"""Levenberg-Marquardt within the box, for schedules (Moré 1978).

The exact gradient of every arrival time is known, so all of them are met at once by least squares,
where a method that uses only their mean square error converges slowly. With more variables than
times, the damped step is the shortest one that helps, and layouts stay near the start. The search
then begins again elsewhere, because some starts end at a layout that cannot follow the schedule, or
at a kink. A scene without a schedule has no residuals: local searches on its score replace them.

References
----------
Moré, J. J. (1978). The Levenberg-Marquardt algorithm: implementation and theory. Lecture Notes in
Mathematics 630, 105-116.
"""

from __future__ import annotations

from itertools import islice

import numpy as np
from scipy.optimize import lsq_linear

from domino_env.core.types import Floats
from optimize.evaluator import Evaluator
from optimize.methods.gradient.local_search import LocalSearch, run_local_searches
from optimize.methods.starts import starts

ON_TIME = 1e-9  # [s] RMS error below which a layout is on time
DAMPING = 1e-2  # at first, relative to the largest squared derivative
HARDER, EASIER = 4.0, 10.0  # factor of the damping after a step that fails; divisor after others
SMALLEST = 1e-14  # least damping, above the rounding of the squares
TRIES = 12  # dampings tried before a layout counts as a minimum
ROUNDS = 100  # steps from one start at most
ROOM = 1e-12  # least room of a variable at a face of the box, which the bounded solver needs
FEW = 4  # starts that show whether a schedule can be kept
ON_SCHEDULE = f"every domino is hit on schedule, to {ON_TIME:g} s"
SLOW, PATIENCE = 0.999, 8  # ratio of errors that counts as no gain, and rounds of it that end it


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Search from one start after the other until a limit is reached or a layout is on time."""
    problem = evaluator.problem
    for start in starts(evaluator, rng):
        if problem.scene.tempo is None:
            project = problem.project if problem.coupled else None
            run_local_searches(evaluator, [LocalSearch(start, project)], ROUNDS)
        elif _least_squares(evaluator, start):
            evaluator.status = ON_SCHEDULE
            return


def is_soon_on_time(evaluator: Evaluator, rng: np.random.Generator) -> bool:
    """Search from a few starts; return whether a layout on time was found."""
    return any(_least_squares(evaluator, start) for start in islice(starts(evaluator, rng), FEW))


def _least_squares(evaluator: Evaluator, design: Floats) -> bool:
    """Search from one start; return whether a layout on time was found."""
    problem = evaluator.problem
    design = problem.project(design[None])[0]
    scores, lateness, gradient = evaluator.lateness(design)
    if len(lateness) == 0:
        return False
    damping = DAMPING
    idle = 0
    for _ in range(ROUNDS):
        if np.sqrt(np.mean(lateness**2)) < ON_TIME:
            return True
        scale = float(np.square(gradient).sum(axis=0).max())
        for _ in range(TRIES):
            step = _step(design, lateness, gradient, damping * scale)
            candidate = problem.project((design + step)[None])[0]
            result = evaluator.lateness(candidate)
            if result[0].score[0] > scores.score[0]:
                break
            damping *= HARDER
        else:
            return False
        gained = np.square(result[1]).sum() < SLOW * np.square(lateness).sum()
        idle = 0 if gained else idle + 1
        if idle == PATIENCE:
            return False
        design, (scores, lateness, gradient) = candidate, result
        damping = max(damping / EASIER, SMALLEST)
    return False


def _step(design: Floats, lateness: Floats, gradient: Floats, damping: float) -> Floats:
    """Minimise |lateness + gradient·step|² + damping·|step|² within the box."""
    n = len(design)
    matrix = np.concatenate([gradient, np.sqrt(damping) * np.eye(n)])
    right = np.concatenate([-lateness, np.zeros(n)])
    low, high = -np.maximum(design, ROOM), np.maximum(1.0 - design, ROOM)
    step = np.linalg.lstsq(matrix, right, rcond=None)[0]
    if np.any((step < low) | (step > high)):
        step = lsq_linear(matrix, right, bounds=(low, high), method="bvls").x
    return np.asarray(step)
