"""Problem: the score of a scene as a function of design vectors in the unit box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from domino_env.core.checks import numbers
from domino_env.core.types import Floats
from domino_env.physics.wave import Outcome, simulate
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.objectives import ScoreGradient, Scores
from domino_env.scenes.scene import Scene
from optimize.design_space import DesignSpace

GRADIENT_RTOL = 1e-8  # relative error allowed in the arrival times for a gradient
# The error of a score is smooth, except for jumps within the tolerance where the simulator changes
# its quadrature rule. With this step and this tolerance, differences are exact to about 1e-8.
STEP = 1e-5  # change of an entry of a design vector for a difference
# relative error allowed in the arrival times for a difference and for `Problem.lateness`
STEP_RTOL = 1e-10


class Problem(DesignSpace):
    """The score of a scene as a function of design vectors in the unit box, for any optimiser.

    **Higher scores are better**: minimise their negative. A layout that completes and keeps the
    limits of the scene scores more than 0 (with `objective = "mean_speed"`, its speed [m/s]). One
    whose wave stops scores less than 0 (with "toppled" it may score more), and higher the further
    the wave comes, so that a search can ascend. See `Scene.score`.

    A design vector is an array (n,) of entries in [0, 1], and a batch of them is (B, n). A design
    vector has one entry for each free gap, then for each free thickness, then for each growth
    (height over that of the domino before). 0 stands for the least value and 1 for the largest. The
    layout of a design vector is the nearest one (in metres) that keeps all rules of the scene. If
    a length, a largest change, a list of values or a stock ties entries together, `coupled` is
    true: many design vectors stand for the same layout, and `project` returns the one of these that
    has its values. No layout that breaks a rule is simulated.

    A problem has no state and no randomness: equal design vectors have bitwise equal scores. It can
    be pickled for other processes, and threads may share it. Batches are faster than single design
    vectors. Its attributes, `evaluate`, `project`, `layout`, `design`, `equality`, `linear` and
    `coupled` are a stable interface.

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
        (n,) least and largest values [m], in domino heights if the scene gives them so; growths are
        ratios.
    discrete
        True if some values come from a list or the stock, so that scores have steps.
    dominoes
        Number of dominoes that are simulated for one score.

    Raises
    ------
    ValueError
        If the scene is unknown or has no free values, or if its rules contradict each other.

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
        self.dominoes = scene.count * scene.scoring.cost

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

        A gradient costs some four simulations for each design vector, for any n. Where a rule binds
        (a face of the box, the given length) it is that of the nearest layout that keeps the rule.

        Parameters
        ----------
        designs
            (n,) a design vector, or (B, n) a batch.
        gradient
            True to compute gradients too.
        rtol
            Relative error allowed in the arrival times, 1e-13 to 1e-3; None for that of the
            problem. Exact gradients always use 1e-8, differences 1e-10.
        differences
            True to compute a gradient by differences, with 2n simulations, where the wave stops or
            violates a limit, so that there is no exact one; otherwise that gradient is zero.
        relaxed
            True to treat values from a list or the stock as continuous in exact gradients;
            otherwise, and in differences, these derivatives are 0.
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
            If `stop` returns True.
        """
        designs = numbers("designs", designs, None)
        single = designs.ndim == 1
        designs = self.check(self.as_batch(designs) if single else designs)
        values = self.values(designs)
        sizes = self.split(values)
        rtol = GRADIENT_RTOL if gradient else self.rtol if rtol is None else rtol
        scores = self.scene.evaluate(self.scene.batch(*sizes, rtol), gradient, stop)
        if scores.gradient is not None:
            gradients = self.design_gradient(designs, values, scores.gradient, relaxed=relaxed)
            gradients[scores.without_gradient] = 0.0
            scores = replace(scores, gradient=gradients)
            if differences:
                self.fill_gradients(designs, scores, self.evaluate)
        return scores.squeeze() if single else scores

    def fill_gradients(
        self, designs: Floats, scores: Scores, evaluate: Callable[..., Scores]
    ) -> None:
        """Compute gradients by differences where a score has no exact one.

        Parameters
        ----------
        designs
            (B, n) design vectors.
        scores
            Their scores; gradients are replaced where `without_gradient` is true.
        evaluate
            Function with the arguments of `evaluate`, which scores the 2n points of a difference.
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
        """Compute how late each domino is hit in a scene with a schedule, for least squares.

        This takes as long as N/2 gradients, measured at N = 40.

        Parameters
        ----------
        design
            (n,) a design vector.

        Returns
        -------
        scores : Scores
            Its score, reach and falls, (1,) each.
        lateness : ndarray
            (N-1,) arrival time minus schedule of dominoes 1 … N-1 [s]; empty if the wave stops.
        gradient : ndarray
            (N-1, n) derivatives of the lateness with respect to the design vector [s]; empty if the
            wave stops.

        Raises
        ------
        ValueError
            If the scene has no schedule, or scores its mean over draws of placement noise; if the
            shape is another one; or if entries are outside of [0, 1].
        """
        tempo, pairs = self.scene.tempo, self.scene.count - 1
        if tempo is None or not self.scene.scoring.follows_wave:
            expected = 'give one with objective = "tempo" and no draws of placement noise'
            raise ValueError(f"scene '{self.scene.name}' is not scored by a schedule: {expected}")
        wave = simulate(self.layout(design), self.scene.physics, rtol=STEP_RTOL, gradient=True)
        scores = self.scene.evaluate_waves([wave])
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
