"""Drafts: a scene and one of its layouts, from which other drafts are made within its rules."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from domino_env.core.checks import require, require_choice
from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave
from domino_env.scenes.io.reading import load_scene
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform import UniformBaseline, best_point, stored_point
from domino_env.scenes.uniform_layouts import UniformLayouts
from domino_env.view.animation import require_drawable
from optimize.experiments.best_known import best_known
from optimize.problem import Problem

SPACING, THICKNESS = "spacing", "thickness"
NAMED: dict[str, Any] = {
    "name": "own",
    "title": "your own scene",
}  # if it was changed or made from a layout
SAME_GAIN = 5e-5  # smaller relative differences count as equal
EQUAL = 1e-6  # relative range of values that count as equal


@dataclass(frozen=True)
class Draft:
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
    """

    scene: Scene
    layout: Layout

    def __post_init__(self) -> None:
        require_drawable(f"scene '{self.scene.name}'", self.scene.row_count)
        _problem(self.scene)  # raises for a scene without free values
        if violations := self.scene.violations(self.layout):
            message = f"not a layout of scene '{self.scene.name}': {'; '.join(violations)}"
            raise ValueError(message)

    @classmethod
    def uniform(cls, scene: Scene) -> Draft:
        """Return the best uniform layout on fixed pivots.

        It ignores the placement noise of a scene that does not ship, and its gap has an error of
        1 µm in rows of more than 100 dominoes.
        """
        analytic = scene.on_pivots
        is_stored = stored_point(analytic.document()) is not None
        analytic = analytic if is_stored else analytic.as_placed
        if is_stored or scene.count <= 100:
            layout = analytic.uniform().layout
        else:
            layout = UniformLayouts(analytic).layout(best_point(analytic, quick=True))
        return cls(scene, layout)

    @classmethod
    def nearest(cls, scene: Scene, curves: Floats) -> Draft:
        """Return the draft of the feasible values that are nearest to some (K, N-1)."""
        space = _problem(scene)
        design = (curves.ravel() - space.low) / (space.high - space.low)
        return cls(scene, space.layout(space.project(design[None])[0]))

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

    # other drafts -------------------------------------------------------------------------------

    def with_size(
        self, quantity: str, index: int, value: float, others: Sequence[int] | None = None
    ) -> Draft:
        """Return the draft with another gap or thickness, as far as the rules allow.

        Then the layout is projected to the rules.

        Parameters
        ----------
        quantity
            "spacing" or "thickness".
        index
            Gap 0 … N-2, or thickness of the domino behind that gap.
        value
            Requested size [m], which is clipped to the bounds.
        others
            Gaps that compensate, so that the length does not change. If it is None and the length
            is fixed, the nearest gaps and thicknesses that can change compensate.

        Raises
        ------
        ValueError
            If the quantity is not free, if there is no such gap, or if the value is not finite.
        """
        scene, space, pairs = self.scene, _problem(self.scene), self.scene.count - 1
        free = [name for name in (SPACING, THICKNESS) if getattr(scene, f"free_{name}")]
        require_choice("quantity", quantity, free)
        require("index", index, 0, pairs - 1, whole=True)
        require("value", value, unit="m")
        units, entry = self._units.ravel(), free.index(quantity) * pairs + index
        low, high, values = units * (space.low, space.high, self._curves.ravel())
        if others is None and scene.length is not None:
            distance = np.abs(np.arange(space.dimension) % pairs - index)
            nearest = np.argsort(distance, kind="stable")
            others = nearest[(nearest != entry) & space.is_continuous[nearest]].tolist()
        target = min(max(value, low[entry]), high[entry])
        difference, values[entry] = values[entry] - target, target
        for k in others or ():
            new_value = min(max(values[k] + difference, low[k]), high[k])
            difference, values[k] = difference - (new_value - values[k]), new_value
        if others:
            values[entry] += difference  # for which the others have no room
        return Draft.nearest(scene, values / units)

    def with_shift(self, index: int, shift: float, following: bool = False) -> Draft:
        """Return the draft with a domino 1 … N-1 moved along the floor, as the rules allow.

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
        gap = float(self.layout.spacing[index - 1]) + shift
        is_last = following or index == self.scene.count - 1
        return self.with_size(SPACING, index - 1, gap, None if is_last else [index])

    def with_domino(self, gap: int) -> Draft:
        """Return the draft with one more domino, in the middle of a gap 0 … N-2."""
        require("gap", gap, 0, self.scene.count - 2, whole=True)
        curves = np.insert(self._curves, gap, self._curves[:, gap], axis=1)
        if self.scene.free_spacing:
            rest = self.layout.spacing[gap] - self.layout.thickness[gap + 1]
            curves[0, gap : gap + 2] = 0.5 * rest / self._units[0, gap]
        return Draft.nearest(self.scene.replace(count=self.scene.count + 1, **NAMED), curves)

    def without_domino(self, index: int) -> Draft:
        """Return the draft without one of the dominoes 1 … N-1."""
        last = self.scene.count - 1
        require("index", index, 1, last, whole=True)
        curves = self._curves
        if self.scene.free_spacing and index < last:
            rest = self.layout.thickness[index] / self._units[0, index - 1]
            curves[0, index] += curves[0, index - 1] + rest
        scene = self.scene.replace(count=last, **NAMED)
        return Draft.nearest(scene, np.delete(curves, index - 1, axis=1))

    def repaired(self) -> Draft:
        """Return the draft with the best equal gap where the wave stops."""
        assert self.stop is not None
        gap = min(self.stop, self.scene.count - 2)
        return self.with_size(SPACING, gap, Draft.uniform(self.scene).layout.spacing[gap])

    def with_scene(self, scene: Scene) -> Draft:
        """Return a draft of another scene with the same free quantities.

        Equal gaps become the best equal gaps of that scene. Others are interpolated along the
        chain if the count changes.
        """
        curves = self._curves
        if (np.ptp(curves, axis=1) <= EQUAL * curves.max(axis=1)).all():
            return Draft.uniform(scene)
        before, after = (np.linspace(0.0, 1.0, n) for n in (curves.shape[1], scene.count - 1))
        return Draft.nearest(scene, np.array([np.interp(after, before, c) for c in curves]))

    @property
    def _curves(self) -> Floats:
        """Free gaps, thicknesses, growths (K, N-1) of the layout, in the units of the problem."""
        space = _problem(self.scene)
        values = space.low + space.design(self.layout) * (space.high - space.low)
        return np.asarray(values.reshape(-1, self.scene.count - 1))

    @property
    def _units(self) -> Floats:
        """Lengths of one unit of these values (K, N-1) [m]."""
        curves, height = np.ones_like(self._curves), self.layout.height
        if self.scene.in_heights:
            shorter = np.minimum(height[:-1], height[1:])
            curves[:] = shorter if self.scene.free_spacing else height[1:]
            curves[1:] = height[1:]
        return curves

    # words --------------------------------------------------------------------------------------

    def headline(self, uniform: UniformBaseline | None) -> tuple[str, str]:
        """Return the result, and how it compares with the uniform baseline, if that is known."""
        scene, wave = self.scene, self.wave
        if self.stop is not None:
            return f"stops at domino {self.stop}", f"{wave.hit} of {wave.layout.count} are hit"
        if not self.is_scored:
            return f"{wave.mean_speed:.3f} m/s", "with fixed pivots; computing it on the floor …"
        number = _round(scene.format_score(self.score, wave))
        if uniform is None:
            return number, "computing the best equal gaps …"
        gain = scene.gain(self.score, uniform.score)
        if scene.unit != "m/s" or gain is None:
            known = _round(scene.format_score(uniform.score, uniform.wave))
            return number, f"best equal gaps: {known}"
        words = f"{abs(gain):.2%} {'faster' if gain > 0.0 else 'slower'} than"
        if abs(gain) < SAME_GAIN:
            words = "as fast as"
        return number, f"{words} the best equal gaps"

    def details(self, uniform: UniformBaseline | None) -> str:
        """Return time, length, normalised score and outcome in one line."""
        wave, best, scene = self.wave, known_best(self.scene), self.scene
        words = f"{wave.layout.count} dominoes over {1e3 * wave.layout.length:.0f} mm; "
        if self.stop is not None:
            return words + wave.explanation.partition(" (smallest_push")[0]
        last, error = float(wave.arrival_times[-1]), wave.error_estimate
        words += f"last hit after {last:.4f} s (computed to {error * last:.0e} s)"
        if best and uniform and self.is_scored and scene.unit == "m/s":
            share = (self.score - uniform.score) / (best.score - uniform.score)
            if share > 0.005:  # rounded to more than 0 %
                words += f"; {share:.0%} of the gain of the best known row"
        return words


def _round(text: str) -> str:
    """Return a text with its decimal numbers rounded to three digits, or to whole numbers."""

    def three_digits(match: re.Match[str]) -> str:
        number = float(match[0])
        return f"{number:#.3g}" if number < 100.0 else f"{number:.0f}"

    return re.sub(r"\d+\.\d+", three_digits, text)


@lru_cache(8)
def _problem(scene: Scene) -> Problem:
    """Return the problem of a scene, kept as it is needed for every change."""
    return Problem(scene)


@lru_cache(8)
def known_best(scene: Scene) -> Draft | None:
    """Return the best known layout of a shipped scene, with its score; None for other scenes."""
    best = best_known().get(scene.name)
    if best is None or load_scene(scene.name) != scene:
        return None
    draft = Draft(scene, best.layout)
    vars(draft)["score"] = best.score
    return draft
