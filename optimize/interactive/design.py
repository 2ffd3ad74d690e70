"""Design: a scene and one of its layouts, changed by hand within its rules, with undo and redo."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from domino_env.core.checks import require, require_choice, require_type
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave
from domino_env.scenes.io.reading import load_scene, scene_names
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import UniformBaseline, best_point, uniform_layouts
from domino_env.view.animation import require_drawable
from optimize.experiments.best_known import BestKnown, best_known
from optimize.problem import Problem

SPACING, THICKNESS = "spacing", "thickness"
NAME, TITLE = "own", "your own scene"  # of a scene that was changed or made from a layout
GAIN, COMPUTING = "gain over the uniform baseline (best equal gaps)", "computing …"
UNIFORM = "result of the uniform baseline (best equal gaps)"
NORMALISED = "normalised score (100 %: best known layout)"


class StudioDesign:
    """A scene and one of its layouts, which satisfies the rules of the scene after every change.

    Parameters
    ----------
    scene
        The scene.
    layout
        A layout that satisfies its rules; None for an approximate uniform baseline.

    Attributes
    ----------
    scene
        The scene.
    layout
        The layout that is shown; during a drag or a search it is not yet in the history.
    wave
        Wave of the layout, simulated by `Scene.simulate`.
    score
        Score of the layout, by `Scene.score`; on a floor None until the caller sets it.
    uniform
        Uniform baseline of the scene; None until the caller sets it.
    first_step
        First step of the history, a scene and a layout.

    Raises
    ------
    ValueError
        If the scene has no free values or too many dominoes to draw, or if the layout breaks its
        rules.
    TypeError
        If `scene` is no Scene or `layout` no Layout.
    """

    scene: Scene
    layout: Layout
    wave: Wave
    score: float | None

    def __init__(self, scene: Scene, layout: Layout | None = None) -> None:
        self.uniform: UniformBaseline | None = None
        self._steps: list[tuple[Scene, Layout]] = []
        self._position = -1  # the step that is shown
        self.open(scene, layout)
        self.first_step = self._steps[0]

    # the history --------------------------------------------------------------------------------

    def open(self, scene: Scene, layout: Layout | None = None) -> None:
        """Replace scene and layout as one step of the history; see the class for arguments."""
        require_type("scene", scene, Scene, "a Scene, as load_scene returns")
        require_drawable(f"scene '{scene.name}'", scene.count)
        _problem(scene)  # raises for a scene without free values
        layout = layout if layout is not None else _approximate_uniform(scene)
        if violations := scene.violations(layout):
            raise ValueError(f"not a layout of scene '{scene.name}': {'; '.join(violations)}")
        self.show(layout, scene)
        self.commit()

    def show(self, layout: Layout, scene: Scene | None = None) -> None:
        """Simulate and score a layout, without adding it to the history.

        Parameters
        ----------
        layout
            A layout of the scene.
        scene
            Another scene; None for the present one.
        """
        scene = scene or self.scene
        wave = scene.simulate(layout)
        score = None if scene.simulator.is_slow else scene.score(wave)
        self.scene, self.layout, self.wave, self.score = scene, layout, wave, score

    def commit(self) -> None:
        """Add scene and layout to the history as a step, unless nothing has changed."""
        step = self.scene, self.layout
        if not self._steps or step != self._steps[self._position]:
            self._position += 1
            self._steps[self._position :] = [step]

    @property
    def committed(self) -> Layout:
        """Layout of the present step of the history."""
        return self._steps[self._position][1]

    def can_move(self, steps: int) -> bool:
        """Return True if the history has a step at this distance from the present one."""
        return 0 <= self._position + steps < len(self._steps)

    def move(self, steps: int) -> None:
        """Show another step of the history, if there is one.

        Parameters
        ----------
        steps
            Distance from the present step: -1 for the one before, 1 for the one after.

        Raises
        ------
        ValueError
            If it is not a whole number.
        """
        require("steps", steps, whole=True)
        if self.can_move(steps):
            self._position += steps
            scene, layout = self._steps[self._position]
            self.show(layout, scene)

    # changes ------------------------------------------------------------------------------------

    def drag(self, quantity: str, index: int, value: float) -> None:
        """Show the present step with one gap or thickness changed, as far as the rules allow.

        If the length is fixed, the nearest gaps and thicknesses that can change compensate. Then
        the layout is projected to the rules.

        Parameters
        ----------
        quantity
            "spacing" or "thickness".
        index
            Gap 0 … N-2, or domino 1 … N-1.
        value
            Requested size [m], which is clipped to the bounds.

        Raises
        ------
        ValueError
            If the quantity is not free, if there is no such gap or domino, or if the value is not
            finite.
        """
        space, before = _problem(self.scene), self.committed
        pairs, height = self.scene.count - 1, before.height  # pairs of neighbours
        free = [name for name in (SPACING, THICKNESS) if getattr(self.scene, f"free_{name}")]
        require_choice("quantity", quantity, free)
        offset = int(quantity == THICKNESS)
        require("index", index, offset, offset + pairs - 1, whole=True)
        require("value", value, unit="m")
        entry = free.index(quantity) * pairs + index - offset
        unit = height if offset else np.minimum(height[:-1], height[1:])
        values = self._values(before)
        low, high = space.low, space.high
        target = value / unit[index] if self.scene.in_heights else value
        target = min(max(target, low[entry]), high[entry])
        difference = values[entry] - target  # left for the other values to compensate
        values[entry] = target
        if self.scene.length is not None:
            distance = np.abs(np.arange(space.dimension) % pairs - entry % pairs)
            nearest = np.argsort(distance, kind="stable")
            for k in nearest[(nearest != entry) & space.is_continuous[nearest]]:
                new_value = min(max(values[k] + difference, low[k]), high[k])
                difference, values[k] = difference - (new_value - values[k]), new_value
            values[entry] += difference
        self.show(self._nearest(space, values))

    def change(self, **fields: Any) -> None:
        """Change the scene, as one step of the history; the layout changes as the rules require.

        If the count changes, gaps and thicknesses are interpolated along the chain.

        Parameters
        ----------
        **fields
            New values of fields of `Scene`.

        Raises
        ------
        ValueError
            For fields that `Scene.replace` rejects, and a scene without free values or without a
            layout; the design is then not changed.
        """
        scene = self.scene.replace(**{"name": NAME, "title": TITLE} | fields)
        space = _problem(scene)
        # gaps, thicknesses, growths
        curves = self._values(self.layout).reshape(-1, self.scene.count - 1)
        before, after = (np.linspace(0.0, 1.0, n) for n in (curves.shape[1], scene.count - 1))
        values = np.concatenate([np.interp(after, before, curve) for curve in curves])
        self.open(scene, self._nearest(space, values))

    def _values(self, layout: Layout) -> Floats:
        """Return the free values (n,) of a layout, in the units of `Problem.low`."""
        space = _problem(self.scene)
        return np.asarray(space.low + space.design(layout) * (space.high - space.low))

    @staticmethod
    def _nearest(space: Problem, values: Floats) -> Layout:
        """Return the layout with the feasible values that are nearest to these (n,)."""
        design = (values - space.low) / (space.high - space.low)
        return space.layout(space.project(design[None])[0])

    # numbers ------------------------------------------------------------------------------------

    @property
    def stop(self) -> int | None:
        """Index of the leading domino with which the wave stops; None if it completes."""
        if self.wave.outcome == Outcome.PROPAGATED:
            return None
        # margins are nan from the first domino on that does not lead
        return int(np.isfinite(self.wave.stall_margin).sum()) - 1

    def numbers(self) -> dict[str, str]:
        """Return the numbers of the layout as texts with units, by their labels."""
        wave, score, scene = self.wave, self.score, self.scene
        is_speed = scene.unit == "m/s"
        text = COMPUTING if score is None else scene.format_score(score, wave)
        numbers = {"mean speed" if is_speed else "result": text}
        numbers[GAIN if is_speed else UNIFORM] = COMPUTING
        if self.uniform is not None and not is_speed:
            numbers[UNIFORM] = scene.format_score(self.uniform.score, self.uniform.wave)
        if is_speed and score is not None and self.uniform is not None:
            own_gain, best = scene.gain(score, self.uniform.score), known_best(scene)
            # + 0.0 changes -0.0 to 0.0
            numbers[GAIN] = "–" if own_gain is None else f"{round(own_gain, 4) + 0.0:+.2%}"
            known_gain = scene.gain(best.score, self.uniform.score) if best else None
            if own_gain is not None and known_gain:
                numbers[NORMALISED] = f"{round(own_gain / known_gain, 3) + 0.0:.1%}"
        if wave.hit == wave.layout.count:
            last = float(wave.arrival_times[-1])
            numbers["last domino hit after"] = f"{last:.6f} s ± {wave.error_estimate * last:.0e} s"
        else:
            numbers["dominoes hit"] = f"{wave.hit} of {wave.layout.count}"
        return numbers


@lru_cache(8)
def _problem(scene: Scene) -> Problem:
    """Return the problem of a scene, kept as it is needed for every change."""
    return Problem(scene)


def _approximate_uniform(scene: Scene) -> Layout:
    """Return the uniform baseline on fixed pivots, approximated if it would take over a second."""
    space, scene = _problem(scene), scene.on_pivots
    if scene.count <= 100 and scene.scoring.follows_wave:
        layout = scene.uniform().layout
    else:
        layout = uniform_layouts(scene).layout(best_point(scene, quick=True))
    return space.layout(space.project(space.design(layout)[None])[0])


@lru_cache(8)
def known_best(scene: Scene) -> BestKnown | None:
    """Return the best known layout of a shipped scene; None for other scenes."""
    best = best_known().get(scene.name)
    if best is None or scene.name not in scene_names() or load_scene(scene.name) != scene:
        return None
    return best
