"""Results of episodes: scores, returns, and infos with layouts and waves.

A batch ends tens of thousands of episodes per second, and few of their waves are ever used.
Therefore a wave is simulated when it is first read, unless the score required it before.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from domino_env.core.types import Floats
from domino_env.physics.layout import Layout
from domino_env.physics.wave import Outcome, Wave
from domino_env.scenes.scene import Scene
from domino_env.scenes.waves import LayoutBatch

_OUTCOMES = np.array([*Outcome], object)  # members by value


@dataclass(eq=False)
class EpisodeResults:
    """Results of E episodes that ended together.

    Attributes
    ----------
    scenes
        Scene of each episode.
    baseline
        Scores of their uniform baselines, (E,).
    unit
        Divisors of positive scores in `returns`, (E,).
    rtol
        Relative error allowed in the arrival times.
    spacing
        Gaps, (E, N-1) [m]. Here and below, entries beyond the placed dominoes are not used.
    thickness
        Thicknesses, (E, N) [m].
    height
        Heights, (E, N), or (1, N) if all episodes share them [m].
    placed
        Numbers of dominoes placed after the first, E integers.
    outcome
        Values of `Outcome`, (E,).
    reach
        Fraction of the scene's N dominoes that each wave reached, (E,).
    score
        Scores as in `Scene.score`, (E,). `simulate` replaces scores, outcomes and reaches that the
        steps could not determine.
    """

    scenes: list[Scene]
    baseline: Floats
    unit: Floats
    rtol: float
    spacing: Floats
    thickness: Floats
    height: Floats
    placed: list[int]
    outcome: NDArray[np.int64]
    reach: Floats
    score: Floats
    _waves: dict[int, Wave] = field(default_factory=dict)

    def simulate(self, episodes: Iterable[int]) -> None:
        """Simulate the whole layouts of some episodes, and score their waves.

        A wave that stopped before all dominoes were placed keeps its outcome and reach, as its
        layout is incomplete.

        Parameters
        ----------
        episodes
            Indices of the episodes.
        """
        groups: dict[tuple[int, int], list[int]] = {}
        for i in episodes:
            groups.setdefault((id(self.scenes[i]), self.placed[i]), []).append(i)
        for (_, placed), group in groups.items():
            scene = self.scenes[group[0]]
            waves = self._simulate_group(scene, placed, group)
            if placed == scene.count - 1:
                self.outcome[group] = [wave.outcome for wave in waves]
                self.reach[group] = [wave.reach for wave in waves]
            else:
                ends = zip(waves, self.reach[group].tolist(), self.outcome[group], strict=True)
                waves = [replace(w, reach=r, outcome=Outcome(o)) for w, r, o in ends]
            self._waves |= zip(group, waves, strict=True)
            self.score[group] = scene.as_placed.evaluate_waves(waves).score

    def _simulate_group(self, scene: Scene, placed: int, episodes: list[int]) -> list[Wave]:
        """Return the waves of episodes of one scene and one number of placed dominoes."""
        if len(episodes) == 1 and scene.ground is None:  # takes half the time of a batch of one
            return [scene.simulate(self.layout(episodes[0]), self.rtol)]
        heights = self.height if len(self.height) == 1 else self.height[episodes]
        sizes = self.thickness[episodes, : placed + 1], heights[:, : placed + 1], scene.width
        batch = LayoutBatch(
            self.spacing[episodes, :placed], *sizes, scene.density, scene.physics, self.rtol,
            scene.ground,
        )  # fmt: skip
        if scene.run_out is not None and placed == scene.count - 1:
            batch = scene.run_out.append_to(batch)
        waves = batch.simulate(record=True)
        return [waves.wave(b, batch.layout(b)) for b in range(len(episodes))]

    @cached_property
    def returns(self) -> Floats:
        """Gains over the uniform baseline, (E,) [%]; cached, so `simulate` has to come first.

        A score of 0 or less counts as the gain of the lowest success, plus the score.
        """
        gain, unit = self.scenes[0].criterion.gain, self.unit

        def value(score: Floats) -> Floats:
            return gain(np.maximum(score, 0.0), unit) + np.minimum(score, 0.0)

        baseline = np.where(self.baseline > 0.0, 0.0, value(self.baseline))
        return 100.0 * (value(self.score) - baseline)

    def infos(self) -> dict[str, NDArray[Any]]:
        """Return the last info of each episode, an array (E,) for each key."""
        episodes = range(len(self.placed))
        return {
            "score": self.score.copy(),
            "gain": self.returns / 100.0,
            "outcome": _OUTCOMES[self.outcome],
            "layout": object_array(LazyLayout.from_episode(self, i) for i in episodes),
            "wave": object_array(LazyWave.from_episode(self, i) for i in episodes),
        }

    def layout(self, i: int) -> Layout:
        """Return the layout placed in episode i."""
        sizes = self.spacing[i], self.thickness[i], self.height[i % len(self.height)]
        return placed_layout(self.scenes[i], self.placed[i], *sizes)

    def wave(self, i: int) -> Wave:
        """Return the wave of episode i; its reach is relative to the scene's N dominoes."""
        if i in self._waves:
            return self._waves[i]
        wave = self.scenes[i].simulate(self.layout(i), self.rtol)
        return replace(wave, reach=float(self.reach[i]))


class _Lazy:
    """Result of one episode, computed when an attribute is first read."""

    _compute: ClassVar[str]  # name of the method of `EpisodeResults` that computes it

    @classmethod
    def from_episode(cls, results: EpisodeResults, i: int) -> Self:
        """Return the result of episode i, to be computed later."""
        self = object.__new__(cls)
        self.__dict__["_episode"] = (results, i)
        return self

    def __getattr__(self, name: str) -> Any:
        episode = None if name.startswith("__") else self.__dict__.pop("_episode", None)
        if episode is None:
            raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")
        results, i = episode
        self.__dict__.update(vars(getattr(results, self._compute)(i)))
        return getattr(self, name)


class LazyLayout(_Lazy, Layout):
    """Layout that is built when it is first read."""

    _compute = "layout"


class LazyWave(_Lazy, Wave):
    """Wave that is simulated when it is first read, unless it was simulated before.

    Two such waves are equal if layouts, physics, tolerance and reach are equal.
    """

    _compute = "wave"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Wave):
            return NotImplemented
        names = "layout", "physics", "rtol", "reach"
        return all(getattr(self, name) == getattr(other, name) for name in names)

    def __hash__(self) -> int:
        return hash((self.layout, self.physics, self.rtol))


def placed_layout(
    scene: Scene, placed: int, spacing: Floats, thickness: Floats, height: Floats
) -> Layout:
    """Return the layout of the dominoes that an episode has placed.

    Parameters
    ----------
    scene
        Scene of the episode.
    placed
        n, number of dominoes placed after the first.
    spacing, thickness, height
        Gaps (n,), thicknesses (n + 1,) and heights (n + 1,) of its dominoes [m], or more; entries
        beyond these are not used.
    """
    sizes = spacing[:placed], thickness[: placed + 1], height[: placed + 1]
    parts = *sizes, scene.width, scene.density
    return Layout(*parts) if scene.ground is None else scene.ground.layout(*parts)


def object_array(values: Iterable[Any]) -> NDArray[Any]:
    """Return values of any type as an array of dtype object, one entry for each."""
    listed = list(values)
    array = np.empty(len(listed), object)
    for i, value in enumerate(listed):  # a list of arrays would become an array of two dimensions
        array[i] = value
    return array
