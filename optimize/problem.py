"""Problem: the score of a scene as a function of design vectors in the unit box."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from domino_env.core.checks import numbers
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.physics import require_layout
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.objectives import ScoreGradient, Scores
from domino_env.scenes.objectives.tempo import Tempo
from domino_env.scenes.scene import Scene

ROUNDING = 1e-9  # distance outside of [0, 1] that counts as rounding
GRADIENT_RTOL = 1e-8  # relative error allowed in the arrival times for a gradient


class Problem:
    """The score of a scene as a function of design vectors in the unit box, for any optimiser.

    **Higher scores are better**: minimise their negative. A layout that completes and keeps the
    limits of the scene scores more than 0 (with `objective = "mean_speed"`, its speed [m/s]). One
    whose wave stops scores less than 0, and higher the further the wave comes, so that a search can
    ascend. See `Scene.score`.

    A design vector is an array (n,) of entries in [0, 1], and a batch of them is (B, n). A design
    vector has one entry for each free gap, then for each free thickness, then for each growth
    (height over that of the domino before). 0 stands for the least value and 1 for the largest. The
    layout of a design vector is the nearest one (in metres) that keeps all rules of the scene. If
    a length or a stock ties entries together, `coupled` is true: many design vectors stand for the
    same layout, and `project` returns the one of these that has its values. No layout that breaks a
    rule is simulated.

    A problem has no state and no randomness: equal design vectors have bitwise equal scores. It can
    be pickled for other processes, and threads may share it. Batches are faster than single design
    vectors. Its attributes, `evaluate`, `project`, `layout`, `design`, `equality` and `coupled` are
    a stable interface.

    Parameters
    ----------
    scene
        A scene, its name, or the path of its file.
    rtol
        Relative error allowed in the arrival times.

    Attributes
    ----------
    scene, space
        The scene and its design space.
    dimension
        n, length of a design vector.
    low, high
        (n,) least and largest values [m], in domino heights if the scene gives them so; growths are
        ratios.
    dominoes
        Number of dominoes that are simulated for one score.

    Raises
    ------
    ValueError
        If the scene is unknown or has no free values.

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
        if not scene.space.free:
            raise ValueError(
                f"scene '{scene.name}' leaves nothing free to search: give spacing or thickness "
                "a min and a larger max"
            )
        self.scene, self.space = scene, scene.space
        self.low, self.high = self.space.low.ravel(), self.space.high.ravel()
        self.dimension = len(self.low)
        self.rtol = rtol
        self.dominoes = scene.row_count * scene.scoring.cost

    def evaluate(
        self, designs: Floats, gradient: bool = False, *, stop: Callable[[], bool] | None = None
    ) -> Scores:
        """Simulate design vectors and score them; higher is better.

        A gradient costs some four simulations for each design vector, for any n. Where a rule binds
        (a face of the box, the given length) it is that of the nearest layout that keeps the rule,
        and where the wave stops or violates a limit it is 0.

        Parameters
        ----------
        designs
            (n,) a design vector, or (B, n) a batch.
        gradient
            True to compute gradients too, with a relative error of 1e-8 allowed in the arrival
            times. Derivatives with respect to values from the stock are 0.
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
        checked = self.check(designs)
        single, designs = np.ndim(designs) == 1, checked
        values = self.values(designs)
        rtol = GRADIENT_RTOL if gradient else self.rtol
        batch = self.scene.batch(*self.space.sizes(values), rtol)
        scores = self.scene.evaluate(batch, gradient, stop)
        if scores.gradient is not None:
            gradients = self.design_gradient(designs, values, scores.gradient)
            scores = replace(scores, gradient=gradients)
        return scores.squeeze() if single else scores

    # design vectors and layouts ------------------------------------------------------------------

    @property
    def schedule(self) -> Tempo | None:
        """Schedule that scores the wave of a layout itself; None if there is none."""
        return self.scene.tempo if self.scene.scoring.follows_wave else None

    @property
    def equality(self) -> tuple[Floats, float] | None:
        """Coefficients a (n,) and right side b of a·x = b [m]; None without a given length."""
        total = self.space.total
        return None if total is None else (self.high - self.low, total - float(self.low.sum()))

    @property
    def normal(self) -> Floats | None:
        """Coefficients (n,) of the sum of the free values that a length fixes; None without one."""
        return None if self.equality is None else self.equality[0]

    @property
    def coupled(self) -> bool:
        """True if several design vectors stand for the same layout, see `project`."""
        return self.space.total is not None or bool(self.space.is_discrete.any())

    def project(self, designs: Floats) -> Floats:
        """Find the nearest design vectors (in metres) that keep the rules of the scene.

        Parameters
        ----------
        designs
            (B, n) finite numbers, also outside of [0, 1].

        Returns
        -------
        ndarray
            (B, n) design vectors, which stand for the same layouts.

        Raises
        ------
        ValueError
            If the shape is another one, or if entries are not finite.
        """
        return self._unit_values(self.values(self.check(designs, unbounded=True)))

    @property
    def projection(self) -> Callable[[Floats], Floats] | None:
        """Method `project`; None if every design vector stands for itself."""
        return self.project if self.coupled else None

    def layout(self, design: Floats) -> Layout:
        """Return the layout that a design vector (n,) stands for.

        Raises
        ------
        ValueError
            If the shape is another one, or if entries are outside of [0, 1].
        """
        return self.scene.batch(*self.space.sizes(self.values(self.check([design])))).layout(0)

    def design(self, layout: Layout) -> Floats:
        """Return the design vector (n,) of a layout that keeps the rules of the scene.

        Raises
        ------
        TypeError
            If `layout` is no Layout.
        ValueError
            If the layout has another number of dominoes than the scene.
        """
        require_layout(layout)
        scene = self.scene
        if layout.count != scene.count:
            raise ValueError(
                f"the layout has {layout.count} dominoes: scene '{scene.name}' needs {scene.count}"
            )
        values = self.space.values(layout.spacing, layout.thickness[1:], layout.height[1:])
        return np.asarray(self._unit_values(values[None])[0])

    def values(self, designs: Floats) -> Floats:
        """Return the values (B, P, N-1) of design vectors (B, n), after the rules are applied."""
        return self.space.project(self._targets(designs))

    def design_gradient(self, designs: Floats, values: Floats, gradient: ScoreGradient) -> Floats:
        """Convert derivatives of scores to derivatives with respect to the design vectors.

        Parameters
        ----------
        designs
            (B, n) design vectors.
        values
            (B, P, N-1) their values, see `values`.
        gradient
            Derivatives with respect to the sizes.

        Returns
        -------
        ndarray
            (B, n) derivatives; where the rules bind, those of the nearest layout that keeps them.
            Values from the stock have derivatives of 0, because they do not change when a design
            vector changes a little.
        """
        by_value = self.space.sizes_vjp(values, gradient)
        by_target = self.space.project_vjp(by_value, self._targets(designs), values)
        return np.asarray(by_target.reshape(designs.shape) * (self.high - self.low))

    def check(self, designs: ArrayLike, *, unbounded: bool = False) -> Floats:
        """Return design vectors (B, n) as numbers in [0, 1], rounding errors clipped.

        Parameters
        ----------
        designs
            (n,) a design vector, or (B, n) a batch.
        unbounded
            True to accept all finite entries as they are.

        Raises
        ------
        ValueError
            If the shape is another one, or if entries are not finite or outside of [0, 1].
        """
        designs = np.atleast_2d(numbers("designs", designs, None))
        numbers("designs", designs, None, ("B", self.dimension))
        is_valid = np.isfinite(designs)
        if not unbounded:
            is_valid &= (designs >= -ROUNDING) & (designs <= 1.0 + ROUNDING)
        if not is_valid.all():
            b, i = np.argwhere(~is_valid)[0]
            entry = designs[b, i]
            hint = ", or pass the design through `project`" * bool(np.isfinite(entry))
            expected = "a finite number" if unbounded else f"a number in [0, 1]{hint}"
            raise ValueError(f"design {b} has {entry} at place {i}: give {expected}")
        return designs if unbounded else np.clip(designs, 0.0, 1.0)

    def _targets(self, designs: Floats) -> Floats:
        """Return the values (B, P, N-1) of design vectors before the rules are applied."""
        targets = np.clip(self.low + designs * (self.high - self.low), self.low, self.high)
        return targets.reshape(len(designs), *self.space.low.shape)

    def _unit_values(self, values: Floats) -> Floats:
        """Return the design vectors (B, n) of values (B, P, N-1) that keep the rules."""
        scaled = (values - self.space.low) / (self.space.high - self.space.low)
        return np.asarray(np.clip(scaled, 0.0, 1.0).reshape(len(values), -1))
