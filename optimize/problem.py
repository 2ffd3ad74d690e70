"""Problem: the score of a scene as a function of numbers between 0 and 1."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from domino_env.core.checks import numbers
from domino_env.core.results import dataclass_repr
from domino_env.core.types import Bools, Floats
from domino_env.physics.wave import Outcome, simulate
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.objectives import ScoreGradient
from domino_env.scenes.scene import Scene
from optimize.design_space import DesignSpace

GRADIENT_RTOL = 1e-8  # relative error of the arrival times of gradients
# The error of a score is smooth but for jumps of its tolerance, where the simulator changes its
# rule. Differences over this step need the closer tolerance, and then are good to about 1e-8.
STEP = 1e-5  # of a difference, as a part of the box
STEP_RTOL = 1e-10  # relative error of the arrival times of differences


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of B design vectors; of a single one, without the first axis.

    Attributes
    ----------
    score
        (B,) higher is better.
    reach
        (B,) part of the layout that the wave passed; 1 if it completes.
    falls
        (B,) number of simulated intervals between hits.
    gradient
        (B, n) gradients by the design vectors; None if not requested.
    """

    score: Any
    reach: Any
    falls: Any
    gradient: Any = None

    __repr__ = dataclass_repr

    @property
    def without_gradient(self) -> Bools:
        """(B,) True without an exact gradient: the wave stopped or broke a limit."""
        return np.asarray((self.score < 0.0) | (self.reach < 1.0))

    def squeeze(self) -> Scores:
        """Drop the first axis of a batch of one."""
        gradient = None if self.gradient is None else self.gradient[0]
        return Scores(float(self.score[0]), float(self.reach[0]), int(self.falls[0]), gradient)


class Problem(DesignSpace):
    """The score of a scene as a function of numbers between 0 and 1, for any optimiser.

    **Higher scores are better**: an optimiser that minimises is given their negative. A layout that
    completes and keeps its limits scores more than 0 (with `objective = "mean_speed"`, its speed
    [m/s]). One whose wave stops scores less than 0, the more the further it came, so that a search
    can ascend. See `Scene.score`.

    A design vector is an array (n,) of entries in [0, 1], a batch of them (B, n): one entry for
    each free gap, from its least to its largest value, then for each free thickness, then for each
    free height (over that of the domino before). Every design vector of the box stands for one
    layout that keeps all rules of the scene, the nearest one in metres: if a length, a largest
    change, a list of values or a stock ties entries together, `coupled` is true, many design
    vectors stand for the same layout, and `project` gives the one that stands for itself. No layout
    that breaks a rule is simulated.

    It has no memory and no randomness: equal design vectors have bitwise equal scores. It can be
    pickled for other processes, and threads may share it. Batches are faster than single designs.
    Its attributes, `evaluate`, `project`, `layout`, `design`, `equality`, `linear` and `coupled`
    are a stable interface.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    rtol
        Relative error allowed in the arrival times.

    Attributes
    ----------
    scene
        The scene.
    dimension
        n, length of a design vector.
    low, high
        (n,) values at 0 and 1 [m], or in heights if the scene gives them so.
    discrete
        True if some values come from a list or the stock, so that scores have steps.
    dominoes
        Number of dominoes that are simulated for one score.

    Raises
    ------
    ValueError
        If the scene has no free values, or if its rules contradict each other.

    Examples
    --------
    >>> import numpy as np
    >>> from optimize import Problem
    >>> problem = Problem("sprint")
    >>> problem.dimension
    39
    >>> round(problem.evaluate(np.full(39, 0.4)).score, 4)
    0.8028
    """

    def __init__(self, scene: Scene | str | Path, rtol: float = 1e-6) -> None:
        scene = scene if isinstance(scene, Scene) else load_scene(scene)
        super().__init__(scene)
        self.rtol = rtol
        self.dominoes = scene.count * scene.criterion.simulations_per_score

    def evaluate(
        self,
        designs: Floats,
        gradient: bool = False,
        *,
        rtol: float | None = None,
        differences: bool = True,
        relaxed: bool = False,
        stop: Callable[[], bool] | None = None,
    ) -> Scores:
        """Simulate design vectors and score them; higher is better.

        A gradient costs some four simulations for each design vector, whatever n. At an edge of the
        rules (a face of the box, the given length) it is that of the nearest layout within them.

        Parameters
        ----------
        designs
            (n,) a design vector, or (B, n) a batch.
        gradient
            True to compute gradients too.
        rtol
            Relative error allowed in the arrival times; None for that of the problem. Gradients
            always use 1e-8.
        differences
            True to take a gradient by differences, with 2n simulations, if there is no exact
            one, because the wave stopped or broke a limit; otherwise it is zero.
        relaxed
            True to differentiate by values from a list or the stock as if they could move;
            otherwise these derivatives are 0.
        stop
            Function that returns True to stop a simulation on a floor; None to run it to its end.

        Returns
        -------
        Scores
            Scores, reaches and falls, and gradients if requested.

        Raises
        ------
        ValueError
            If the shape is another one, or if entries are outside of [0, 1].
        StoppedError
            If `stop` returned True.
        """
        designs = numbers("designs", designs, None)
        single = designs.ndim == 1
        designs = self.check(self.as_batch(designs) if single else designs)
        values = self.values(designs)
        sizes = self.split(values)
        rtol = GRADIENT_RTOL if gradient else self.rtol if rtol is None else rtol
        batch = replace(self.scene.batch(*sizes, rtol), stop=stop)
        result = self.scene.evaluate(batch, gradient=gradient)
        scores = Scores(result.score, result.reach, result.falls)
        if result.gradient is not None:
            gradients = self.design_gradient(designs, values, result.gradient, relaxed=relaxed)
            gradients[scores.without_gradient] = 0.0
            scores = replace(scores, gradient=gradients)
            if differences:
                self.fill_gradients(designs, scores, self.evaluate)
        return scores.squeeze() if single else scores

    def fill_gradients(
        self, designs: Floats, scores: Scores, evaluate: Callable[..., Scores]
    ) -> None:
        """Fill in gradients by differences if a score has no exact one.

        Parameters
        ----------
        designs
            (B, n) design vectors.
        scores
            Their scores, with zero gradients if there is no exact one.
        evaluate
            Function called as `evaluate` of this class.
        """
        n = self.dimension
        for b in np.flatnonzero(scores.without_gradient):
            design = np.clip(designs[b], 0.0, 1.0)
            above, below = np.minimum(design + STEP, 1.0), np.maximum(design - STEP, 0.0)
            points = np.repeat(design[None], 2 * n, axis=0)
            np.fill_diagonal(points[:n], above)
            np.fill_diagonal(points[n:], below)
            score = evaluate(points, rtol=STEP_RTOL).score
            scores.gradient[b] = (score[:n] - score[n:]) / (above - below) * self.is_continuous

    def lateness(self, design: Floats) -> tuple[Scores, Floats, Floats]:
        """Compute how late each domino of a scene with a schedule is hit, for least squares.

        It takes as long as N gradients.

        Parameters
        ----------
        design
            (n,) a design vector.

        Returns
        -------
        scores : Scores
            Its score, reach and falls, (1,) each.
        lateness : ndarray
            (N-1,) arrival minus schedule of dominoes 1 … N-1 [s]; empty for a wave that stops.
        gradient : ndarray
            (N-1, n) derivatives by the design vector [s]; empty for a wave that stops.

        Raises
        ------
        ValueError
            If the scene has no schedule.
        """
        tempo, pairs = self.scene.tempo, self.scene.count - 1
        if tempo is None:
            raise ValueError(f"scene '{self.scene.name}' has no schedule: there is no lateness")
        wave = simulate(self.layout(design), self.scene.physics, rtol=STEP_RTOL, gradient=True)
        result = self.scene.evaluate_waves([wave])
        scores = Scores(result.score, result.reach, result.falls)
        if wave.outcome != Outcome.PROPAGATED:
            return scores, np.empty(0), np.empty((0, self.dimension))
        gradients = [wave.pullback(unit) for unit in np.eye(pairs + 1)[1:]]
        if self.scene.ground is not None:
            gradients = [self.scene.ground.along_ground(g, wave.layout) for g in gradients]
        designs = np.repeat(self.check(self.as_batch(design)), pairs, axis=0)
        by_sizes = ScoreGradient(
            np.array([g.spacing for g in gradients]),
            np.array([g.thickness[1:] for g in gradients]),
            np.array([g.height[1:] for g in gradients]),
        )
        gradient = self.design_gradient(designs, self.values(designs), by_sizes)
        return scores, wave.arrival_times[1:] - tempo.schedule(self.scene.count), gradient
