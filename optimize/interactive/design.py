"""Designs: a scene and one of its layouts, from which other designs are made within its rules."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property, lru_cache
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
from optimize.experiments.best_known import best_known
from optimize.problem import Problem

SPACING, THICKNESS = "spacing", "thickness"
NAME, TITLE = "own", "your own scene"  # of a scene that was changed or made from a layout
SAME_GAIN = 5e-5  # smaller relative differences count as equal
EQUAL = 1e-6  # relative range of values that count as equal


@dataclass(frozen=True)
class Design:
    """A scene and a layout that satisfies its rules.

    Parameters
    ----------
    scene
        The scene.
    layout
        The layout.

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

    def __post_init__(self) -> None:
        require_type("scene", self.scene, Scene, "a Scene, as load_scene returns")
        require_drawable(f"scene '{self.scene.name}'", self.scene.row_count)
        _problem(self.scene)  # raises for a scene without free values
        if violations := self.scene.violations(self.layout):
            message = f"not a layout of scene '{self.scene.name}': {'; '.join(violations)}"
            raise ValueError(message)

    @classmethod
    def uniform(cls, scene: Scene) -> Design:
        """Return the best uniform layout on fixed pivots, to 1 µm if the best takes a second."""
        space, on_pivots = _problem(scene), scene.on_pivots
        if scene.count <= 100 and on_pivots.scoring.follows_wave:
            layout = on_pivots.uniform().layout
        else:
            layout = uniform_layouts(on_pivots).layout(best_point(on_pivots, quick=True))
        return cls(scene, space.layout(space.project(space.design(layout)[None])[0]))

    @cached_property
    def wave(self) -> Wave:
        """Wave of the layout on fixed pivots, simulated by `Scene.simulate`."""
        return self.scene.simulate(self.layout)

    @cached_property
    def score(self) -> float:
        """Score of the layout, by `Scene.score`; computed when it is first read."""
        return self.scene.score(self.wave)

    @property
    def is_scored(self) -> bool:
        """True if the score is known or takes no time; on a floor it takes a second."""
        return not self.scene.simulator.is_slow or "score" in vars(self)

    @property
    def stop(self) -> int | None:
        """Index of the leading domino with which the wave stops; None if it completes."""
        if self.wave.outcome == Outcome.PROPAGATED:
            return None
        # margins are nan from the first domino on that does not lead
        return int(np.isfinite(self.wave.stall_margin).sum()) - 1

    # other designs ------------------------------------------------------------------------------

    def with_size(self, quantity: str, index: int, value: float) -> Design:
        """Return the design with another gap or thickness, as far as the rules allow.

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
        space, pairs = _problem(self.scene), self.scene.count - 1
        free = [name for name in (SPACING, THICKNESS) if getattr(self.scene, f"free_{name}")]
        require_choice("quantity", quantity, free)
        offset = int(quantity == THICKNESS)
        require("index", index, offset, offset + pairs - 1, whole=True)
        require("value", value, unit="m")
        curves, low, high = self._curves, space.low, space.high
        values, entry = curves.ravel(), free.index(quantity) * pairs + index - offset
        target = value / (self.layout.height[index] if offset else self._units[index])
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
        return self._with_curves(curves)

    def with_shift(self, index: int, shift: float, *, following: bool = False) -> Design:
        """Return the design with a domino 1 … N-1 moved along the floor, as the rules allow.

        Parameters
        ----------
        index
            The domino.
        shift
            Distance [m], positive forward.
        following
            True to move all that follow as well; otherwise the gap ahead compensates.

        Raises
        ------
        ValueError
            If gaps are not free, if there is no such domino, or if the shift is not finite.
        """
        require("index", index, 1, self.scene.count - 1, whole=True)
        require("shift", shift, unit="m")
        if following or index == self.scene.count - 1 or not self.scene.free_spacing:
            gap = float(self.layout.spacing[index - 1]) + shift
            return self.with_size(SPACING, index - 1, gap)
        curves, space, pair = self._curves, _problem(self.scene), [index - 1, index]
        low, high, gaps = (
            values.reshape(curves.shape)[0, pair] * self._units[pair]
            for values in (space.low, space.high, curves)
        )
        shift = max(shift, low[0] - gaps[0], gaps[1] - high[1])
        shift = min(shift, high[0] - gaps[0], gaps[1] - low[1])
        curves[0, pair] = (gaps[0] + shift, gaps[1] - shift) / self._units[pair]
        return self._with_curves(curves)

    def with_domino(self, gap: int) -> Design:
        """Return the design with one more domino, in the middle of a gap 0 … N-2."""
        require("gap", gap, 0, self.scene.count - 2, whole=True)
        curves = np.insert(self._curves, gap, self._curves[:, gap], axis=1)
        if self.scene.free_spacing:
            rest = self.layout.spacing[gap] - self.layout.thickness[gap + 1]
            curves[0, gap : gap + 2] = 0.5 * rest / self._units[gap]
        return self._with_curves(curves, self._changed(count=self.scene.count + 1))

    def without_domino(self, index: int) -> Design:
        """Return the design without one of the dominoes 1 … N-1."""
        require("index", index, 1, self.scene.count - 1, whole=True)
        curves, last = self._curves, self.scene.count - 1
        if self.scene.free_spacing and index < last:
            rest = self.layout.thickness[index] / self._units[index - 1]
            curves[0, index] += curves[0, index - 1] + rest
        scene = self._changed(count=last)
        return self._with_curves(np.delete(curves, index - 1, axis=1), scene)

    def with_scene(self, **fields: Any) -> Design:
        """Return the design with a changed scene, and the layout changed as the rules require.

        Equal gaps become the best equal gaps of the new scene. Others are interpolated along the
        chain if the count changes.

        Parameters
        ----------
        **fields
            New values of fields of `Scene`.

        Raises
        ------
        ValueError
            For fields that `Scene.replace` rejects, and a scene without free values or without a
            layout.
        """
        scene, curves = self._changed(**fields), self._curves
        if (np.ptp(curves, axis=1) <= EQUAL * curves.max(axis=1)).all():
            return Design.uniform(scene)
        before, after = (np.linspace(0.0, 1.0, n) for n in (curves.shape[1], scene.count - 1))
        return self._with_curves(np.array([np.interp(after, before, c) for c in curves]), scene)

    def _changed(self, **fields: Any) -> Scene:
        return self.scene.replace(**{"name": NAME, "title": TITLE} | fields)

    @property
    def _curves(self) -> Floats:
        """Free gaps, thicknesses, growths (K, N-1) of the layout, in the units of the problem."""
        space = _problem(self.scene)
        values = space.low + space.design(self.layout) * (space.high - space.low)
        return np.array(values.reshape(-1, self.scene.count - 1))

    @property
    def _units(self) -> Floats:
        """Lengths (N-1,) of one unit of the gaps [m]."""
        height = self.layout.height
        is_ratio = self.scene.in_heights
        return np.minimum(height[:-1], height[1:]) if is_ratio else np.ones(len(height) - 1)

    def _with_curves(self, curves: Floats, scene: Scene | None = None) -> Design:
        """Return the design of the feasible values that are nearest to these (K, N-1)."""
        scene = scene or self.scene
        space = _problem(scene)
        design = (curves.ravel() - space.low) / (space.high - space.low)
        return Design(scene, space.layout(space.project(design[None])[0]))

    # words --------------------------------------------------------------------------------------

    def headline(self, uniform: UniformBaseline | None) -> tuple[str, str]:
        """Return the result, and how it compares with the uniform baseline, if that is known."""
        scene, wave = self.scene, self.wave
        if self.stop is not None:
            return f"stops at domino {self.stop}", f"{wave.hit} of {wave.layout.count} are hit"
        if not self.is_scored:
            return f"{wave.mean_speed:.3f} m/s", "with fixed pivots; computing it on the floor …"
        if scene.unit != "m/s":
            compared = uniform and _round(scene.format_score(uniform.score, uniform.wave))
            text = _round(scene.format_score(self.score, wave))
            return text, f"best equal gaps: {compared}" if compared else ""
        gain = scene.gain(self.score, uniform.score) if uniform else None
        if gain is None:
            return f"{self.score:.3f} m/s", "" if uniform else "computing the best equal gaps …"
        words = (
            "as fast as"
            if abs(gain) < SAME_GAIN
            else f"{abs(gain):.2%} " + ("faster than" if gain > 0.0 else "slower than")
        )
        return f"{self.score:.3f} m/s", f"{words} the best equal gaps"

    def details(self, uniform: UniformBaseline | None) -> str:
        """Return time, length, normalised score and outcome in one line."""
        wave, best, scene = self.wave, known_best(self.scene), self.scene
        parts = [f"{wave.layout.count} dominoes over {1e3 * wave.layout.length:.0f} mm"]
        if self.stop is not None:
            return "; ".join([*parts, wave.explanation.partition(" (smallest_push")[0]])
        last, error = float(wave.arrival_times[-1]), wave.error_estimate
        parts.append(f"last hit after {last:.4f} s (computed to {error * last:.0e} s)")
        if best and uniform and self.is_scored and scene.unit == "m/s":
            known = best.score - uniform.score
            share = round((self.score - uniform.score) / known, 2) + 0.0  # no -0 %
            if share > 0.0:
                parts.append(f"{share:.0%} of the gain of the best known row")
        return "; ".join(parts)


def _round(text: str) -> str:
    """Return a text with its decimal numbers rounded to four significant digits."""
    return re.sub(r"\d+\.\d+", lambda match: f"{float(match[0]):.4g}", text)


@lru_cache(8)
def _problem(scene: Scene) -> Problem:
    """Return the problem of a scene, kept as it is needed for every change."""
    return Problem(scene)


@lru_cache(8)
def known_best(scene: Scene) -> Design | None:
    """Return the best known layout of a shipped scene, with its score; None for other scenes."""
    best = best_known().get(scene.name)
    if best is None or scene.name not in scene_names() or load_scene(scene.name) != scene:
        return None
    design = Design(scene, best.layout)
    vars(design)["score"] = best.score
    return design
