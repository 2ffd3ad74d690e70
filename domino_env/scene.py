"""Scene: a design problem, read from one TOML file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from domino_env.layout import Layout
from domino_env.physics import Physics
from domino_env.wave import Outcome, Wave, simulate, simulate_batch

Floats = NDArray[np.float64]
Bounds = tuple[float, float]

SCORE_RTOL = 1e-10  # what is reported; searches may look less closely
LENGTH_TOLERANCE = 1e-9  # [m]


@dataclass(frozen=True, eq=False)
class UniformMark:
    """The best uniform layout of a scene, its wave and its score: the mark to beat."""

    layout: Layout
    wave: Wave
    score: float


@dataclass(frozen=True, eq=False)
class Scene:
    """A design problem: what stands, what may be chosen, what counts.

    name, title: how it is called, and what it is about.
    objective: "mean_speed", from the first pivot to the last [m/s].
    physics: friction, gravity, push.
    count: number of dominoes N.
    height, width [m], density [kg/m³]: of every domino.
    first_thickness: of domino 0, which is the scene's [m].
    spacing, thickness: least and largest free gap, and thickness of dominoes 1 … N-1 [m]; equal
        where the scene fixes it.
    length: first pivot to last [m], met to 1e-9 m; None where it is free.
    """

    name: str
    title: str
    objective: str
    physics: Physics
    count: int
    height: float
    width: float
    density: float
    first_thickness: float
    spacing: Bounds
    thickness: Bounds
    length: float | None = None

    @property
    def free_spacing(self) -> bool:
        """Whether the designer chooses the gaps."""
        return self.spacing[0] < self.spacing[1]

    @property
    def free_thickness(self) -> bool:
        """Whether the designer chooses the thickness of all dominoes but the first."""
        return self.thickness[0] < self.thickness[1]

    def layout(self, spacing: ArrayLike, thickness: ArrayLike | None = None) -> Layout:
        """The row with these free gaps (N-1,) and thicknesses of dominoes 1 … N-1 (N-1,) [m].

        A single number serves all.  `thickness` may be left out where the scene fixes it.
        Bounds are not applied: see `violations`.
        """
        gaps = np.broadcast_to(np.asarray(spacing, dtype=np.float64), (self.count - 1,))
        if thickness is None:
            if self.free_thickness:
                raise ValueError(f"scene '{self.name}' leaves the thickness free: give it too")
            thickness = self.thickness[0]
        rest = np.broadcast_to(np.asarray(thickness, dtype=np.float64), (self.count - 1,))
        full = np.concatenate(([self.first_thickness], rest))
        return Layout(gaps, full, self.height, self.width, self.density)

    def violations(self, layout: Layout) -> list[str]:
        """What the layout breaks of the scene's rules, a sentence each; empty if nothing."""
        if layout.count != self.count:
            return [f"{layout.count} dominoes stand where the scene asks for {self.count}"]
        found = []
        if not np.isclose(layout.thickness[0], self.first_thickness, rtol=1e-9, atol=0.0):
            found.append(
                f"thickness[0] = {layout.thickness[0]} m: the first domino is the scene's, "
                f"{self.first_thickness} m thick"
            )
        for name, values, wanted in (
            ("height", layout.height, self.height),
            ("density", layout.density, self.density),
        ):
            if not np.allclose(values, wanted, rtol=1e-9, atol=0.0):
                i = int(np.argmax(np.abs(values - wanted)))
                found.append(f"{name}[{i}] = {values[i]}: the scene's dominoes have {wanted}")
        found += _outside("spacing", layout.spacing, self.spacing, 0)
        found += _outside("thickness", layout.thickness[1:], self.thickness, 1)
        if self.length is not None and abs(layout.length - self.length) > LENGTH_TOLERANCE:
            found.append(
                f"the row is {layout.length:.9f} m long, not {self.length} m: "
                f"{layout.length - self.length:+.3g} m"
            )
        return found

    def simulate(self, layout: Layout, rtol: float = SCORE_RTOL) -> Wave:
        """The wave of a layout under the scene's physics."""
        return simulate(layout, self.physics, rtol=rtol)

    def score(self, layout: Layout) -> float:
        """What every method is judged by; higher is better.

        The mean speed [m/s] of a wave that propagates.  A wave that dies scores between -1 and 0,
        higher the further it came, so that a search can climb.  Raises ValueError for a layout
        that breaks the scene's rules.
        """
        broken = self.violations(layout)
        if broken:
            raise ValueError(f"scene '{self.name}': {'; '.join(broken)}")
        return self.score_wave(self.simulate(layout))

    def score_wave(self, wave: Wave) -> float:
        """The score of a wave that has been simulated."""
        if wave.outcome == Outcome.PROPAGATED:
            return wave.mean_speed
        return wave.reach - 1.0

    def score_batch_gradient(
        self, spacing: Floats, thickness: Floats | None, rtol: float = 1e-8
    ) -> tuple[Floats, Floats, Floats]:
        """`score_batch` with its exact gradient, (B,), (B, N-1) and (B, N-1).

        By gaps and by thicknesses of dominoes 1 … N-1 [1/s]; zero for a wave that died.
        """
        full = self._thicknesses(len(spacing), thickness)
        batch = simulate_batch(
            spacing, full, self.physics, height=self.height, density=self.density, rtol=rtol,
            gradient=True,
        )  # fmt: skip
        assert batch.gradient is not None
        alive = batch.outcome == Outcome.PROPAGATED
        time = np.where(alive, batch.total_time, 1.0)[:, None]
        speed = batch.mean_speed[:, None]
        # v = length / t, and the length grows with every gap and thickness
        by_gap = alive[:, None] * (1.0 - speed * batch.gradient.spacing) / time
        by_thickness = alive[:, None] * (1.0 - speed * batch.gradient.thickness[:, 1:]) / time
        return np.where(alive, batch.mean_speed, batch.reach - 1.0), by_gap, by_thickness

    def _thicknesses(self, rows: int, thickness: Floats | None) -> Floats:
        """Thicknesses of all dominoes, (B, N) [m]."""
        full = np.empty((rows, self.count))
        full[:, 0] = self.first_thickness
        full[:, 1:] = self.thickness[0] if thickness is None else thickness
        return full

    def score_batch(self, spacing: Floats, thickness: Floats | None, rtol: float = 1e-6) -> Floats:
        """Scores of B layouts at once.

        spacing: (B, N-1); thickness of dominoes 1 … N-1: (B, N-1), or None where it is fixed [m].
        The scene's rules are not checked again.
        """
        full = self._thicknesses(len(spacing), thickness)
        batch = simulate_batch(
            spacing, full, self.physics, height=self.height, density=self.density, rtol=rtol,
            record=False,
        )  # fmt: skip
        return np.where(batch.outcome == Outcome.PROPAGATED, batch.mean_speed, batch.reach - 1.0)

    def uniform(self) -> UniformMark:
        """The best uniform pitch (and thickness) within the scene's rules; found once, kept."""
        return self._uniform

    @cached_property
    def _uniform(self) -> UniformMark:
        from domino_env.uniform import best_uniform

        layout = best_uniform(self)
        wave = self.simulate(layout)
        return UniformMark(layout, wave, self.score_wave(wave))

    def to_toml(self) -> str:
        """The scene as a file that `load_scene` reads."""
        from domino_env.scene_files import to_toml

        return to_toml(self)


def _outside(name: str, values: Floats, bounds: Bounds, first: int) -> list[str]:
    low, high = bounds
    slack = 1e-12 * high
    bad = np.flatnonzero(~((values >= low - slack) & (values <= high + slack)))
    if len(bad) == 0:
        return []
    i = int(bad[0])
    more = f" (and {len(bad) - 1} more)" if len(bad) > 1 else ""
    allowed = f"{low} to {high} m" if low < high else f"{low} m"
    return [f"{name}[{i + first}] = {values[i]} m{more}: the scene allows {allowed}"]


def scene_names() -> list[str]:
    """Names of the scenes that ship."""
    folder = resources.files("domino_env") / "scenes"
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith("toml"))


def load_scene(name: str | Path) -> Scene:
    """A scene that ships, by name, or one of your own, by the path of its TOML file.

    Raises ValueError naming file, key, value and what is allowed.
    """
    from domino_env.scene_files import read_scene

    return read_scene(name)
