"""Problem: a scene as numbers between 0 and 1, and what they score."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from domino_env.physics.wave import Outcome, simulate
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.objectives import Evaluation
from domino_env.scenes.scene import Scene
from optimize.variables import Floats, Variables

GRADIENT_RTOL = 1e-8
# A score's error is smooth but for jumps of its tolerance, where the simulator changes its rule:
# differences over this step need the closer tolerance, and then are good to about 1e-8.
STEP = 1e-5
STEP_RTOL = 1e-10


class Problem(Variables):
    """A scene as a function of numbers between 0 and 1, for any optimiser.

    **Higher scores are better**: an optimiser that minimises is given their negative. A row that
    does what the scene asks scores more than 0 (with `objective = "mean_speed"`, its speed in m/s);
    one whose wave dies scores less, the more the further it came, so that there is always a way
    up. See `Scene.score`.

    A design is an array (n,) of entries in [0, 1], a batch of them (B, n): one entry for each free
    gap, from its least to its largest value, then for each free thickness, then for each free
    height (over that of the domino before). Every design of the box stands for one row that keeps
    all rules of the scene, the nearest one in metres: where a length, a largest change, a list of
    values or a stock ties entries together, `coupled` is true, many designs stand for the same row,
    and `project` gives the one that stands for itself. No layout that breaks a rule is simulated.

    It remembers nothing and draws nothing: equal designs score the same to the bit. It can be
    pickled for other processes, and threads may share it. Batches are faster than single designs.
    Stable are its attributes, `score`, `scores`, `score_and_gradient`, `scores_and_gradients`,
    `project`, `layout`, `design`, `equality`, `linear` and `coupled`.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    rtol
        How closely the waves are simulated.

    Attributes
    ----------
    scene
        The scene.
    dimension
        n, length of a design.
    low, high
        (n,) what 0 and 1 stand for [m], or what the scene gives in heights.
    discrete
        Whether some values come from a list or the stock, so that scores have steps.
    dominoes
        How many a score topples: those of a row, or of all its copies in a "robust" scene.

    Raises
    ------
    ValueError
        For a scene that leaves nothing free, and for one whose rules clash, with their names.

    Examples
    --------
    >>> import numpy as np
    >>> from optimize import Problem
    >>> problem = Problem("sprint")
    >>> problem.dimension
    39
    >>> round(problem.score(np.full(39, 0.4)), 4)
    0.8028
    """

    def __init__(self, scene: Scene | str | Path, rtol: float = 1e-6) -> None:
        scene = scene if isinstance(scene, Scene) else load_scene(scene)
        super().__init__(scene)
        self.rtol = rtol
        self.dominoes = scene.count * scene.waves_a_score

    def scores(self, designs: Floats, rtol: float | None = None) -> Floats:
        """Simulate designs and score them, higher is better; see `Scene.score`.

        Parameters
        ----------
        designs
            (B, n) designs.
        rtol
            How closely to simulate; the problem's own where None.

        Returns
        -------
        ndarray
            (B,) scores.

        Raises
        ------
        ValueError
            For designs of another shape, or with entries that are no numbers in [0, 1].
        """
        return self.evaluate(designs, rtol).score

    def evaluate(self, designs: Floats, rtol: float | None = None) -> Evaluation:
        """Simulate designs (B, n) and give their scores, reaches and falls: see `scores`."""
        spacing, thickness, height = self.split(self.values(self.checked(designs)))
        return self.scene.evaluate(self.scene.batch(spacing, thickness, height, rtol or self.rtol))

    def score(self, design: Floats) -> float:
        """Score one design (n,), higher is better: see `scores`."""
        return float(self.scores(self.one(design))[0])

    def score_and_gradient(self, design: Floats) -> tuple[float, Floats]:
        """Score one design (n,), with its gradient (n,); see `scores_and_gradients`."""
        found, gradients = self.scores_and_gradients(self.one(design))
        return float(found[0]), gradients[0]

    def scores_and_gradients(
        self, designs: Floats, *, of_dying: bool = True, at_will: bool = False
    ) -> tuple[Floats, Floats]:
        """Score designs, with the gradient of each.

        The cost is some four waves for each design, whatever n. At an edge of the rules (a face of
        the box, the length that is asked for) the gradient is that of the nearest layout within
        them. Where a row is no success the score is how far the wave came or how much a limit is
        broken, which has no exact gradient: it is taken by differences.

        Parameters
        ----------
        designs
            (B, n) designs.
        of_dying
            Whether what has no exact gradient gets one by differences, for 2n waves each; otherwise
            it is zero.
        at_will
            Give values from a list or the stock the gradient that they would have if they could
            move; otherwise it is 0, since they stay where they are when a design changes a little.

        Returns
        -------
        scores : ndarray
            (B,) scores.
        gradients : ndarray
            (B, n) gradients by the designs.

        Raises
        ------
        ValueError
            For designs of another shape, or with entries that are no numbers in [0, 1].
        """
        designs = self.checked(designs)
        found, gradients = self.evaluate_with_gradients(designs, at_will=at_will)
        for b in np.flatnonzero(found.without_gradient) if of_dying else ():
            around = self.scores(self.neighbours(designs[b]), STEP_RTOL)
            gradients[b] = self.difference(designs[b], around)
        return found.score, gradients

    def evaluate_with_gradients(
        self, designs: Floats, *, at_will: bool = False
    ) -> tuple[Evaluation, Floats]:
        """Evaluate designs (B, n), with the exact gradients (B, n); zero where there is none.

        See `scores_and_gradients`.
        """
        designs = self.checked(designs)
        values = self.values(designs)
        spacing, thickness, height = self.split(values)
        batch = self.scene.batch(spacing, thickness, height, GRADIENT_RTOL)
        found = self.scene.evaluate(batch, gradient=True)
        by = found.gradient
        assert by is not None
        gradients = self.by_design(
            designs, values, by.spacing, by.thickness, by.height, at_will=at_will
        )
        gradients[found.without_gradient] = 0.0
        return replace(found, gradient=None), gradients

    def neighbours(self, design: Floats) -> Floats:
        """Give the (2n, n) designs whose scores, at `STEP_RTOL`, show the slope at a design (n,).

        A step ahead in each entry, then a step behind; one-sided at the faces of the box.
        """
        n, i = self.dimension, np.arange(self.dimension)
        points = np.repeat(np.clip(design, 0.0, 1.0)[None], 2 * n, axis=0)
        points[i, i] = np.minimum(points[i, i] + STEP, 1.0)
        points[n + i, i] = np.maximum(points[n + i, i] - STEP, 0.0)
        return points

    def difference(self, design: Floats, scores: Floats) -> Floats:
        """Find the gradient (n,) at a design (n,) by the scores (2n,) of its neighbours."""
        n, here = self.dimension, np.clip(design, 0.0, 1.0)
        room = np.minimum(here + STEP, 1.0) - np.maximum(here - STEP, 0.0)
        return np.asarray((scores[:n] - scores[n:]) / room * self.steady)

    def lateness(self, design: Floats) -> tuple[Evaluation, Floats, Floats]:
        """Find how late each domino of one design is hit, with its gradient: for least squares.

        Its cost is that of N gradients.

        Parameters
        ----------
        design
            (n,) a design.

        Returns
        -------
        found : Evaluation
            Its score, reach and falls, (1,) each.
        late : ndarray
            (N-1,) arrival minus schedule of dominoes 1 … N-1 [s]; empty for a wave that dies.
        gradient : ndarray
            (N-1, n) its derivative by the design [s]; empty for a wave that dies.

        Raises
        ------
        ValueError
            Where the scene has no schedule.
        """
        tempo, pairs = self.scene.tempo, self.scene.count - 1
        if tempo is None:
            raise ValueError(f"scene '{self.scene.name}' has no schedule: there is no lateness")
        designs = self.checked(self.one(design))
        wave = simulate(self.layout(designs[0]), self.scene.physics, rtol=STEP_RTOL, gradient=True)
        found = self.scene.evaluate_waves([wave])
        if wave.outcome != Outcome.PROPAGATED:
            return found, np.empty(0), np.empty((0, self.dimension))
        pulled = [wave.pullback(bar) for bar in np.eye(pairs + 1)[1:]]
        if self.scene.ground is not None:
            pulled = [self.scene.ground.followed(one, wave.layout) for one in pulled]
        slopes = self.by_design(
            np.repeat(designs, pairs, axis=0),
            np.repeat(self.values(designs), pairs, axis=0),
            np.array([one.spacing for one in pulled]),
            np.array([one.thickness[1:] for one in pulled]),
            np.array([one.height[1:] for one in pulled]),
        )
        late = wave.arrival_times[1:] - tempo.schedule(self.scene.count)
        return found, late, slopes
