"""Design: a scene and one of its layouts, changed by hand within the rules, with undo and redo."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave
from domino_env.scenes.io.reading import load_scene, scene_names
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import best_point, gain, uniform_layouts
from domino_env.view.animation import require_drawable
from optimize.design_space import DesignSpace
from optimize.experiments.best_known import best_known

SPACING, THICKNESS = "spacing", "thickness"
NAME = "own"  # of a scene that was changed


class Design:
    """A scene and one of its layouts, which keeps the scene's rules through every change.

    Parameters
    ----------
    scene
        The scene.
    layout
        A layout that keeps its rules; None for about the best equal gaps.

    Attributes
    ----------
    scene
        The scene.
    layout
        The layout that is shown; during a drag or a search it is not yet in the history.
    wave
        Its wave, as of `Scene.simulate`.
    score
        Its score, as of `Scene.score`; None on a floor until `evaluate` is called.

    Raises
    ------
    ValueError
        For a scene without free values, and for a layout that breaks the scene's rules.
    """

    scene: Scene
    layout: Layout
    wave: Wave
    score: float | None

    def __init__(self, scene: Scene, layout: Layout | None = None) -> None:
        self._past: list[tuple[Scene, Layout]] = []
        self._future: list[tuple[Scene, Layout]] = []
        self.open(scene, layout)
        self.first = self.scene, self.layout

    # the history --------------------------------------------------------------------------------

    def open(self, scene: Scene, layout: Layout | None = None) -> None:
        """Replace scene and layout, as one step of the history; arguments as of the class."""
        require_drawable(f"scene '{scene.name}'", scene.count)
        space = DesignSpace(scene)
        layout = layout if layout is not None else _about_uniform(space)
        if broken := scene.violations(layout):
            raise ValueError(f"not a layout of scene '{scene.name}': {'; '.join(broken)}")
        self.scene, self.space = scene, space
        self.show(layout)
        self.commit()

    def show(self, layout: Layout) -> None:
        """Simulate and score a layout of the scene that is not yet part of the history."""
        self.layout, self.wave = layout, self.scene.simulate(layout)
        slow = self.scene.floor_friction is not None
        self.score = None if slow else self.scene.score(self.wave)

    def commit(self) -> None:
        """Keep what is shown as a step of the history, unless nothing has changed."""
        if not self._past or self._past[-1] != (self.scene, self.layout):
            self._past.append((self.scene, self.layout))
            self._future.clear()

    @property
    def kept(self) -> Layout:
        """Layout of the last step of the history."""
        return self._past[-1][1]

    @property
    def can_undo(self) -> bool:
        """True where there is an earlier step."""
        return len(self._past) > 1

    @property
    def can_redo(self) -> bool:
        """True where a step was undone."""
        return bool(self._future)

    def undo(self) -> None:
        """Go back by one step."""
        if self.can_undo:
            self._future.append(self._past.pop())
            self._return()

    def redo(self) -> None:
        """Repeat the step that was undone last."""
        if self.can_redo:
            self._past.append(self._future.pop())
            self._return()

    def _return(self) -> None:
        self.scene, layout = self._past[-1]
        self.space = DesignSpace(self.scene)
        self.show(layout)

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
            Size wanted [m].
        """
        space, before = self.space, self.kept
        pairs, height = self.scene.count - 1, before.height
        entry, unit = index, np.minimum(height[:-1], height[1:])
        if part == THICKNESS:
            entry, unit = index - 1 + pairs * self.scene.free_spacing, height
        values = space.low + space.design(before) * (space.high - space.low)
        low, high = space.low[entry], space.high[entry]
        wanted = np.clip(value / unit[index] if self.scene.in_heights else value, low, high)
        left = values[entry] - wanted  # what the others have to take up
        values[entry] = wanted
        if self.scene.length is not None:
            distance = np.abs(np.arange(space.dimension) % pairs - entry % pairs)
            distance[entry] = space.dimension
            for k in np.argsort(distance, kind="stable")[:-1] if left else ():
                if space.movable[k]:
                    moved = np.clip(values[k] + left, space.low[k], space.high[k])
                    left, values[k] = left - (moved - values[k]), moved
                if not left:
                    break
            values[entry] += left
        self.show(self._nearest(space, values))

    def change(self, **fields: Any) -> None:
        """Change the scene, and keep the layout as far as the new rules allow.

        Where the count changes, gaps and thicknesses are interpolated along the chain.

        Parameters
        ----------
        **fields
            New values of fields of `Scene`.

        Raises
        ------
        ValueError
            As of `Scene.replace`; nothing changes then.
        """
        scene = self.scene.replace(**{"name": NAME, "title": None} | fields)
        space = DesignSpace(scene)
        old = self.space.low + self.space.design(self.layout) * (self.space.high - self.space.low)
        parts = old.reshape(-1, self.scene.count - 1)
        before, after = (np.linspace(0.0, 1.0, n) for n in (parts.shape[1], scene.count - 1))
        layout = self._nearest(space, np.concatenate([np.interp(after, before, p) for p in parts]))
        self.open(scene, layout)

    @staticmethod
    def _nearest(space: DesignSpace, values: Floats) -> Layout:
        """Return the layout of the allowed values that are nearest to values (n,) [m]."""
        design = (values - space.low) / (space.high - space.low)
        return space.layout(space.project(design[None])[0])

    # numbers ------------------------------------------------------------------------------------

    @property
    def stop(self) -> int | None:
        """Number of the leading domino with which the wave stopped; None where it completes."""
        if self.wave.outcome == Outcome.PROPAGATED:
            return None
        return int(np.isfinite(self.wave.stall_margin).sum()) - 1

    def numbers(self, uniform: float | None) -> dict[str, str]:
        """Return what a page shows of the layout, in words and units.

        Parameters
        ----------
        uniform
            Score of the uniform baseline; None while it is not known.
        """
        wave, score, computing = self.wave, self.score, "computing …"
        speed = self.scene.unit == "m/s"
        found = {"mean speed" if speed else "result": computing}
        if score is not None:
            found = {key: self.scene.in_words(score, wave) for key in found}
        if speed:
            found["gain over the uniform baseline (best equal gaps)"] = computing
            if score is not None and uniform is not None:
                lead, record = gain(score, uniform), known_record(self.scene)
                found["gain over the uniform baseline (best equal gaps)"] = (
                    "–" if lead is None else f"{lead:+.2%}"
                )
                most = gain(record[1], uniform) if record else None
                if lead is not None and most:
                    found["normalised score (100 %: best known layout)"] = f"{lead / most:.1%}"
        if wave.hit == wave.layout.count:
            last = float(wave.arrival_times[-1])
            found["last domino hit after"] = f"{last:.6f} s ± {wave.error_estimate * last:.0e} s"
        else:
            found["dominoes hit"] = f"{wave.hit} of {wave.layout.count}"
        return found


def _about_uniform(space: DesignSpace) -> Layout:
    """Return about the best layout of equal gaps, with fixed pivots: within a second or so."""
    scene = space.scene.replace(floor_friction=None)
    if scene.count <= 100 and not scene.criterion.simulates_anew:
        layout = scene.uniform().layout
    else:
        layout = uniform_layouts(scene).layout(best_point(scene, quick=True))
    return space.layout(space.project(space.design(layout)[None])[0])


@lru_cache(8)
def known_record(scene: Scene) -> tuple[Layout, float] | None:
    """Return the best known layout of a scene that ships and its score; None for other scenes."""
    record = best_known().get(scene.name)
    if record is None or scene.name not in scene_names() or load_scene(scene.name) != scene:
        return None
    return record.layout, record.score
