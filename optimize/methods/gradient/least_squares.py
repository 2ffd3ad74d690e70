"""Levenberg-Marquardt within the box, for schedules (Moré 1978).

The exact gradient of every arrival time is known, so least squares fit all of them at once; a
method that uses only their mean square error converges slowly. Damping keeps the steps short, so
that with more variables than times the layout stays near the start. Some starts end at a kink, or
at a layout that cannot follow the schedule; then the search begins again elsewhere. A scene without
a schedule has no residuals: local searches on its score replace the least squares.

References
----------
Moré, J. J. (1978). The Levenberg-Marquardt algorithm: implementation and theory. Lecture Notes in
Mathematics 630, 105-116.
"""

from __future__ import annotations

from functools import partial
from itertools import islice

import numpy as np
from scipy.optimize import lsq_linear

from domino_env.core.types import Floats
from domino_env.physics.wave import Outcome, simulate
from domino_env.scenes.objectives import ScoreGradient, Scores
from optimize.evaluator import Evaluator
from optimize.methods.gradient.local_search import LocalSearch, run_local_searches
from optimize.methods.starts import starts
from optimize.problem import Problem

RTOL = 1e-10  # relative error allowed in the arrival times
ON_TIME_ERROR = 1e-9  # [s] RMS error below which a layout is on time
DAMPING = 1e-2  # first damping, over the largest sum of squared derivatives of a variable
# factor of the damping after a step that fails; divisor after one that gains
DAMPING_FACTOR, DAMPING_DIVISOR = 4.0, 10.0
MIN_DAMPING = 1e-14  # least damping, above the rounding of the squares
MAX_DAMPINGS = 12  # dampings tried before a layout counts as a minimum
MAX_STEPS = 100  # largest number of steps from one start
LEAST_ROOM = 1e-12  # least room of a variable at a face of the box, which the bounded solver needs
STARTS = 4  # starts after which a schedule counts as one that cannot be kept
ON_SCHEDULE = f"every domino is hit on schedule, to {ON_TIME_ERROR:g} s"
# least ratio of squared errors after and before a step that counts as slow; slow steps in a row
# that end the search from a start
SLOW_RATIO, PATIENCE = 0.999, 8


def run(evaluator: Evaluator, rng: np.random.Generator) -> None:
    """Search from one start after the other until a limit is reached or a layout is on time."""
    problem = evaluator.problem
    for start in starts(evaluator, rng):
        if problem.schedule is None:
            run_local_searches(evaluator, [LocalSearch(start, problem.projection)], MAX_STEPS)
        elif _fit_schedule(evaluator, start):
            evaluator.status = ON_SCHEDULE
            return


def fits_schedule(evaluator: Evaluator, rng: np.random.Generator) -> bool:
    """Return True if least squares from a few starts give a layout on time."""
    return any(_fit_schedule(evaluator, start) for start in islice(starts(evaluator, rng), STARTS))


def _fit_schedule(evaluator: Evaluator, design: Floats) -> bool:
    """Return True if least squares from one start (n,) give a layout on time."""
    problem = evaluator.problem
    design = problem.project(design[None])[0]
    compute = partial(compute_lateness, problem)
    scores, (lateness, gradient) = evaluator.evaluate_by("lateness", design, compute)
    if len(lateness) == 0:
        return False
    damping, slow_steps = DAMPING, 0
    for _ in range(MAX_STEPS):
        if np.sqrt(np.mean(lateness**2)) < ON_TIME_ERROR:
            return True
        scale = float(np.square(gradient).sum(axis=0).max())
        for _ in range(MAX_DAMPINGS):
            step = _step(design, lateness, gradient, damping * scale)
            candidate = problem.project((design + step)[None])[0]
            new_scores, new = evaluator.evaluate_by("lateness", candidate, compute)
            if new_scores.score[0] > scores.score[0]:
                break
            damping *= DAMPING_FACTOR
        else:
            return False
        is_slow = np.square(new[0]).sum() >= SLOW_RATIO * np.square(lateness).sum()
        slow_steps = slow_steps + 1 if is_slow else 0
        if slow_steps == PATIENCE:
            return False
        design, scores, (lateness, gradient) = candidate, new_scores, new
        damping = max(damping / DAMPING_DIVISOR, MIN_DAMPING)
    return False


def compute_lateness(problem: Problem, design: Floats) -> tuple[Scores, list[Floats]]:
    """Compute how late each domino is hit in a scene with a schedule.

    This takes as long as N/2 gradients, measured at N = 40.

    Parameters
    ----------
    problem
        Problem with a `schedule`.
    design
        (n,) a design vector.

    Returns
    -------
    scores : Scores
        Its score, reach and falls, (1,) each.
    arrays : list of ndarray
        (N-1,) arrival time minus schedule of dominoes 1 … N-1 [s], and (N-1, n) its derivatives
        with respect to the design vector [s]; both empty if the wave stops.
    """
    scene, pairs = problem.scene, problem.scene.count - 1
    wave = simulate(problem.layout(design), scene.physics, rtol=RTOL, gradient=True)
    scores = scene.evaluate_waves(wave.as_batch())
    if wave.outcome != Outcome.PROPAGATED:
        return scores, [np.empty(0), np.empty((0, problem.dimension))]
    gradients = [wave.pullback(unit) for unit in np.eye(pairs + 1)[1:]]
    if scene.ground is not None:
        gradients = [scene.ground.along_ground(gradient, wave.layout) for gradient in gradients]
    by_sizes = ScoreGradient(
        np.array([g.spacing for g in gradients]),
        np.array([g.thickness[1:] for g in gradients]),
        np.array([g.height[1:] for g in gradients]),
    )
    designs = np.repeat(design[None], pairs, axis=0)
    gradient = problem.design_gradient(designs, problem.values(designs), by_sizes)
    assert problem.schedule is not None
    return scores, [wave.arrival_times[1:] - problem.schedule.schedule(scene.count), gradient]


def _step(design: Floats, lateness: Floats, gradient: Floats, damping: float) -> Floats:
    """Return the step (n,) of least |lateness + gradient·step|² + damping·|step|² in the box."""
    n = len(design)
    matrix = np.concatenate([gradient, np.sqrt(damping) * np.eye(n)])
    right_side = np.concatenate([-lateness, np.zeros(n)])
    low, high = -np.maximum(design, LEAST_ROOM), np.maximum(1.0 - design, LEAST_ROOM)
    step = np.linalg.lstsq(matrix, right_side, rcond=None)[0]
    if np.any((step < low) | (step > high)):
        step = lsq_linear(matrix, right_side, bounds=(low, high), method="bvls").x
    return np.asarray(step)
