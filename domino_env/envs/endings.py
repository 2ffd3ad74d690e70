"""The end of episodes: scores, returns, and infos with layouts and waves.

A batch ends tens of thousands of episodes a second, and few of their waves are ever looked at: one
is simulated when it is, unless the score has needed it already.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from domino_env.physics.layout import Layout
from domino_env.physics.physics import Physics
from domino_env.physics.wave import Outcome, Wave, WaveBatch, simulate, simulate_batch
from domino_env.scenes.scene import Scene

Floats = NDArray[np.float64]

_OUTCOMES = np.array([Outcome(i) for i in range(len(Outcome))], object)


class Endings:
    """E episodes that ended together.

    Parameters
    ----------
    scenes
        (E,) what was built.
    baseline
        (E,) scores of their best uniform rows.
    rtol
        Relative error allowed in the arrival times.
    spacing
        (E, N-1) [m]; what lies beyond the dominoes placed is not used.
    thickness
        (E, N) [m]
    height
        (E, N), or (1, N) where all rows have the same [m]
    placed
        (E,) dominoes placed after the first.

    Attributes
    ----------
    outcome
        (E,) values of `Outcome`.
    reach
        (E,) how far each wave came, of the scene's N dominoes.
    score
        (E,) as of `Scene.score`.
    """

    def __init__(
        self,
        scenes: list[Scene],
        baseline: Floats,
        rtol: float,
        spacing: Floats,
        thickness: Floats,
        height: Floats,
        placed: list[int],
    ) -> None:
        self.scenes, self.baseline, self.rtol = scenes, baseline, rtol
        self.spacing, self.thickness, self.height, self.placed = spacing, thickness, height, placed
        self.outcome = np.zeros(len(placed), np.int64)
        self.reach, self.score = np.zeros(len(placed)), np.zeros(len(placed))
        self._waves: dict[int, Wave] = {}

    def judge(self, which: Iterable[int]) -> None:
        """Simulate the rows of some episodes, and score their waves.

        The outcome and reach of a wave that died before all dominoes were placed stay as they are:
        its row goes on where nothing is placed yet.
        """
        alike: dict[int, list[int]] = {}
        for i in which:
            alike.setdefault(id(self.scenes[i]), []).append(i)
        for rows in alike.values():
            scene = self.scenes[rows[0]]
            waves = simulate_all([self.layout(i) for i in rows], scene.physics, self.rtol)
            for i, wave in zip(rows, waves, strict=True):
                if self.placed[i] == scene.count - 1:
                    self.outcome[i], self.reach[i] = wave.outcome, wave.reach
                    self._waves[i] = wave
                else:
                    self._waves[i] = replace(wave, reach=float(self.reach[i]))
            self.score[rows] = scene.evaluate_waves([self._waves[i] for i in rows]).score

    @cached_property
    def returns(self) -> Floats:
        """The gains over the best uniform row (E,), in per cent, once all are judged."""
        mark, runs = self.baseline, self.baseline > 0.0
        if runs.all():
            return 100.0 * (self.score / mark - 1.0)
        over = 100.0 * (self.score / np.where(runs, mark, 1.0) - 1.0)
        return np.where(runs, over, 100.0 * (self.score - mark) / np.maximum(-mark, 1e-9))

    def infos(self) -> dict[str, NDArray[Any]]:
        """Give what the last info of each episode holds, (E,) each."""
        layouts, waves = (np.empty(len(self.placed), object) for _ in range(2))
        for i in range(len(self.placed)):
            layouts[i], waves[i] = LazyLayout.of(self, i), LazyWave.of(self, i)
        return {
            "score": self.score.copy(),
            "gain": self.returns / 100.0,
            "outcome": _OUTCOMES[self.outcome],
            "layout": layouts,
            "wave": waves,
        }

    def layout(self, i: int) -> Layout:
        """Return what was placed in episode i."""
        scene, placed = self.scenes[i], self.placed[i]
        row = (
            self.spacing[i, :placed],
            self.thickness[i, : placed + 1],
            self.height[i % len(self.height), : placed + 1],
            scene.width,
            scene.density,
        )
        return Layout(*row) if scene.ground is None else scene.ground.layout(*row)

    def wave(self, i: int) -> Wave:
        """Return the wave of episode i; its reach counts against the scene's N dominoes."""
        if i in self._waves:
            return self._waves[i]
        wave = simulate(self.layout(i), self.scenes[i].physics, rtol=self.rtol)
        return replace(wave, reach=float(self.reach[i]))


class _Lazy:
    """What is known to be the i-th of some endings, and worked out when it is first looked at."""

    @classmethod
    def of(cls, endings: Endings, i: int) -> Self:
        """Stand for episode i."""
        self = object.__new__(cls)
        self.__dict__["_lazy"] = (endings, i)
        return self

    def __getattr__(self, name: str) -> Any:
        lazy = None if name.startswith("__") else self.__dict__.pop("_lazy", None)
        if lazy is None:
            raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
        self.__dict__.update(self._fields(*lazy))
        return getattr(self, name)

    def _fields(self, endings: Endings, i: int) -> dict[str, Any]:
        raise NotImplementedError


class LazyLayout(_Lazy, Layout):
    """A Layout whose arrays are made when they are first looked at."""

    def _fields(self, endings: Endings, i: int) -> dict[str, Any]:
        return vars(endings.layout(i))


class LazyWave(_Lazy, Wave):
    """A Wave that is simulated when it is first looked at, if it has not been before.

    Two are equal if they are waves of equal layouts under the same physics and tolerance.
    """

    def _fields(self, endings: Endings, i: int) -> dict[str, Any]:
        return vars(endings.wave(i))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Wave):
            return NotImplemented
        return (self.layout, self.physics, self.rtol, self.reach) == (
            other.layout,
            other.physics,
            other.rtol,
            other.reach,
        )

    def __hash__(self) -> int:
        return hash((self.layout, self.physics, self.rtol))


def simulate_all(layouts: list[Layout], physics: Physics, rtol: float) -> list[Wave]:
    """Simulate rows, those of the same length in one call over all cores; see `simulate`."""
    places: dict[int, list[int]] = {}
    for i, layout in enumerate(layouts):
        places.setdefault(layout.count, []).append(i)
    waves: dict[int, Wave] = {}
    for alike in places.values():
        if len(alike) == 1:
            waves[alike[0]] = simulate(layouts[alike[0]], physics, rtol=rtol)
            continue
        rows = [layouts[i] for i in alike]
        batch = simulate_batch(
            np.stack([row.spacing for row in rows]),
            np.stack([row.thickness for row in rows]),
            physics,
            height=np.stack([row.height for row in rows]),
            density=np.stack([row.density for row in rows]),
            rise=np.stack([row.rise for row in rows]),
            tilt=np.stack([row.tilt for row in rows]),
            rtol=rtol,
        )
        for b, i in enumerate(alike):
            waves[i] = _wave_of(batch, b, layouts[i], physics, rtol)
    return [waves[i] for i in range(len(layouts))]


def _wave_of(batch: WaveBatch, b: int, layout: Layout, physics: Physics, rtol: float) -> Wave:
    """One wave of a batch, as `simulate` gives it."""
    return Wave(
        layout=layout,
        physics=physics,
        outcome=Outcome(batch.outcome[b]),
        hit=int(batch.hit[b]),
        toppled=int(batch.toppled[b]),
        arrival_times=batch.arrival_times[b].copy(),
        release_velocity=batch.release_velocity[b].copy(),
        impact_velocity=batch.impact_velocity[b].copy(),
        stall_margin=batch.stall_margin[b].copy(),
        reach=float(batch.reach[b]),
        error_estimate=float(batch.error_estimate[b]),
        converged=bool(batch.converged[b]),
        flushes=int(batch.flushes[b]),
        releases=int(batch.releases[b]),
        largest_flush_loss=float(batch.largest_flush_loss[b]),
        rtol=rtol,
        run_time=batch.run_time / len(batch),
    )
