"""Design: a scene and one of its layouts, changed by hand within the rules, with undo and redo."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from domino_env.core.checks import require, require_choice
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave
from domino_env.scenes.io.reading import load_scene, scene_names
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import UniformBaseline, best_point, gain, uniform_layouts
from domino_env.view.animation import require_drawable
from optimize.design_space import DesignSpace
from optimize.experiments.best_known import BestKnown, best_known

SPACING, THICKNESS = "spacing", "thickness"
NAME, TITLE = "own", "your own scene"  # of a changed scene
GAIN, COMPUTING = "gain over the uniform baseline (best equal gaps)", "computing …"
NORMALISED = "normalised score (100 %: best known layout)"


class Design:
    """A scene and one of its layouts, which keeps the scene's rules through every change.

    Parameters
    ----------
    scene
        The scene.
    layout
        A layout that keeps its rules; None for an approximate uniform baseline.

    Attributes
    ----------
    scene
        The scene.
    layout
        The layout that is shown; during a drag or a search it is not yet in the history.
    wave
        Its wave, simulated by `Scene.simulate`.
    score
        Its score by `Scene.score`; None on a floor until it is set.
    uniform
        Uniform baseline of the scene; None until it is set.
    first_step
        The first step of the history.

    Raises
    ------
    ValueError
        If the scene has no free values, or if the layout breaks its rules.
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
        """Replace scene and layout, as one step of the history; see the class for the arguments."""
        require_drawable(f"scene '{scene.name}'", scene.count)
        _design_space(scene)  # raises for a scene without free values
        layout = layout if layout is not None else _approximate_uniform(scene)
        if violations := scene.violations(layout):
            raise ValueError(f"not a layout of scene '{scene.name}': {'; '.join(violations)}")
        self.show(layout, scene)
        self.commit()

    def show(self, layout: Layout, scene: Scene | None = None) -> None:
        """Simulate and score a layout that is not yet part of the history.

        Parameters
        ----------
        layout
            A layout of the scene.
        scene
            Another scene; None for the present one.
        """
        scene = scene or self.scene
        wave = scene.simulate(layout)
        score = None if scene.floor_friction is not None else scene.score(wave)
        self.scene, self.layout, self.wave, self.score = scene, layout, wave, score

    def commit(self) -> None:
        """Add scene and layout to the history as a step, unless nothing has changed."""
        step = self.scene, self.layout
        if not self._steps or step != self._steps[self._position]:
            self._position += 1
            self._steps[self._position :] = [step]

    @property
    def committed(self) -> Layout:
        """Layout of the last step of the history."""
        return self._steps[self._position][1]

    def can_move(self, steps: int) -> bool:
        """Return True if the history has a step that far from the present one."""
        return 0 <= self._position + steps < len(self._steps)

    def move(self, steps: int) -> None:
        """Show another step of the history: -1 for the one before, 1 for the one after."""
        if self.can_move(steps):
            self._position += steps
            scene, layout = self._steps[self._position]
            self.show(layout, scene)

    # changes ------------------------------------------------------------------------------------

    def drag(self, part: str, index: int, value: float) -> None:
        """Show the last step with one gap or thickness changed, as far as the rules allow.

        A fixed length is kept by the nearest gaps and thicknesses that can change. Then the nearest
        layout that keeps all rules is taken.

        Parameters
        ----------
        part
            "spacing" or "thickness".
        index
            Gap 0 … N-2, or domino 1 … N-1.
        value
            Requested size [m], which is clipped to the bounds.

        Raises
        ------
        ValueError
            If the part is not free, or if there is no such gap or domino.
        """
        space, before = _design_space(self.scene), self.committed
        pairs, height = self.scene.count - 1, before.height
        free = [name for name in (SPACING, THICKNESS) if getattr(self.scene, f"free_{name}")]
        require_choice("part", part, free)
        offset = int(part == THICKNESS)
        require("index", index, offset, offset + pairs - 1, whole=True)
        require("value", value, unit="m")
        entry = free.index(part) * pairs + index - offset
        unit = height if offset else np.minimum(height[:-1], height[1:])
        values = self._values(before)
        low, high = space.low, space.high
        target = value / unit[index] if self.scene.in_heights else value
        target = min(max(target, low[entry]), high[entry])
        difference = values[entry] - target  # for the other values to compensate
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
        """Change the scene, and keep the layout as far as the new rules allow.

        If the count changes, gaps and thicknesses are interpolated along the chain.

        Parameters
        ----------
        **fields
            New values of fields of `Scene`.

        Raises
        ------
        ValueError
            See `Scene.replace`; the design is not changed.
        """
        scene = self.scene.replace(**{"name": NAME, "title": TITLE} | fields)
        space = _design_space(scene)
        parts = self._values(self.layout).reshape(-1, self.scene.count - 1)
        before, after = (np.linspace(0.0, 1.0, n) for n in (parts.shape[1], scene.count - 1))
        layout = self._nearest(space, np.concatenate([np.interp(after, before, p) for p in parts]))
        self.open(scene, layout)

    def _values(self, layout: Layout) -> Floats:
        """Return the free values (n,) of a layout [m]."""
        space = _design_space(self.scene)
        return np.asarray(space.low + space.design(layout) * (space.high - space.low))

    @staticmethod
    def _nearest(space: DesignSpace, values: Floats) -> Layout:
        """Return the layout of the allowed values that are nearest to values (n,) [m]."""
        design = (values - space.low) / (space.high - space.low)
        return space.layout(space.project(design[None])[0])

    # numbers ------------------------------------------------------------------------------------

    @property
    def stop(self) -> int | None:
        """Number of the leading domino with which the wave stopped; None if it completes."""
        if self.wave.outcome == Outcome.PROPAGATED:
            return None
        return int(np.isfinite(self.wave.stall_margin).sum()) - 1

    def numbers(self) -> dict[str, str]:
        """Return the numbers of the layout by name, in words and units."""
        wave, score, scene = self.wave, self.score, self.scene
        speed = scene.unit == "m/s"
        text = COMPUTING if score is None else scene.format_score(score, wave)
        numbers = {"mean speed" if speed else "result": text}
        if speed:
            numbers[GAIN] = COMPUTING
        if speed and score is not None and self.uniform is not None:
            own_gain, record = gain(score, self.uniform.score), known_record(scene)
            numbers[GAIN] = "–" if own_gain is None else f"{round(own_gain, 4) + 0.0:+.2%}"
            most = gain(record.score, self.uniform.score) if record else None
            if own_gain is not None and most:
                numbers[NORMALISED] = f"{round(own_gain / most, 3) + 0.0:.1%}"
        if wave.hit == wave.layout.count:
            last = float(wave.arrival_times[-1])
            numbers["last domino hit after"] = f"{last:.6f} s ± {wave.error_estimate * last:.0e} s"
        else:
            numbers["dominoes hit"] = f"{wave.hit} of {wave.layout.count}"
        return numbers


@lru_cache(8)
def _design_space(scene: Scene) -> DesignSpace:
    return DesignSpace(scene)


def _approximate_uniform(scene: Scene) -> Layout:
    """Approximate the uniform baseline on fixed pivots, in about a second."""
    space, scene = _design_space(scene), scene.replace(floor_friction=None)
    if scene.count <= 100 and not scene.criterion.simulates_anew:
        layout = scene.uniform().layout
    else:
        layout = uniform_layouts(scene).layout(best_point(scene, quick=True))
    return space.layout(space.project(space.design(layout)[None])[0])


@lru_cache(8)
def known_record(scene: Scene) -> BestKnown | None:
    """Return the best known layout of a shipped scene; None for other scenes."""
    record = best_known().get(scene.name)
    if record is None or scene.name not in scene_names() or load_scene(scene.name) != scene:
        return None
    return record
