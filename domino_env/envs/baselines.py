"""Uniform baselines of the scenes of a catalogue, computed when a scene is first used."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from domino_env.core.types import Floats, Ints
from domino_env.envs.batch import SceneArrays
from domino_env.envs.catalogue import Catalogue
from domino_env.envs.spaces import action_entries
from domino_env.kernels.arrays import record_type
from domino_env.kernels.step import environment as kernels
from domino_env.kernels.step.batch import BEGINNING, OVER
from domino_env.physics.wave import Outcome
from domino_env.scenes.objectives.speed import typical_speed
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform_layouts import UniformLayouts

POOL_RTOL = 1e-12  # relative error of the arrival times of baselines of a pool
BASELINE = record_type(score=float, speed=float, reach=float, outcome=int)


class Baselines:
    """Scenes that have been used, with the results of their uniform baselines.

    Parameters
    ----------
    catalogue
        The scenes.
    tables
        Arrays of the scenes, which are filled.

    Attributes
    ----------
    scenes
        (S,) scenes by index; None for those that are not used yet.
    results
        BASELINE of each scene, (S,): score, mean speed [m/s], reach and value of `Outcome`.
    """

    def __init__(self, catalogue: Catalogue, tables: SceneArrays) -> None:
        self._catalogue, self._tables = catalogue, tables
        self.scenes = np.full(catalogue.size, None, object)
        self.results = np.zeros(catalogue.size, BASELINE)
        if catalogue.distribution is None:
            self._store(0, catalogue.first, np.empty(0))

    def load(self, indices: Ints) -> None:
        """Store the sampled scenes with these indices, unless they are stored."""
        missing = np.array([i for i in indices.tolist() if self.scenes[i] is None], np.int64)
        if len(missing):
            new = [i for i in self._catalogue.around(missing) if self.scenes[i] is None]
            self._store_pool(new)

    def add(self, env: int, scene: Scene, present: int) -> int:
        """Store a scene given to one environment and return its index; see `Catalogue.place`."""
        index, features = self._catalogue.place(env, scene, present)
        self._store(index, scene, features)
        return index

    def speed_at(self, i: int, hit: int) -> float:
        """Return the mean speed of the uniform baseline of scene i up to its domino hit - 1 [m/s].

        It is 0 if the baseline stops, for the first domino, and within the run-out.
        """
        tables, speed = self._tables, float(self.results["speed"][i])
        count = int(tables.rules["count"][i])
        if hit == count + tables.run_out or not speed > 0.0:
            return speed
        if not 1 < hit <= count:
            return 0.0
        start, reached = tables.uniform[i, 0], tables.uniform[i, hit - 1]
        distance = start["length_left"] - reached["length_left"]
        return float(distance / (start["time_left"] - reached["time_left"]))

    def _store(self, i: int, scene: Scene, features: Floats) -> None:
        """Store scene i with its sampled numbers and its uniform baseline."""
        baseline, layout = scene.uniform(), scene.uniform().layout
        times, speed = baseline.wave.arrival_times, baseline.wave.mean_speed
        if scene.hand and speed > 0.0:  # means over orders of the pieces
            times = _mean_arrival_times(scene, float(layout.spacing[0]))
            speed = baseline.score if scene.scoring.is_mean_speed else speed
        positions = baseline.wave.layout.positions
        if not speed > 0.0:  # the wave of the baseline stops
            times = positions / typical_speed(scene.height, scene.physics)
        sizes = layout.spacing, layout.thickness[1:], layout.height
        self._tables.store(i, scene, features, sizes)
        uniform = self._tables.uniform[i, : scene.count]
        uniform["length_left"] = positions[-1] - positions[: scene.count]
        uniform["thickness_left"] = layout.thickness.sum() - np.cumsum(layout.thickness)
        score, noise = baseline.score, scene.placement
        if noise is not None and noise.quantile is not None:  # returns are compared with the mean
            score = scene.replace(placement=noise.replace(quantile=None)).score(layout)
        ends = baseline.wave.reach, baseline.wave.outcome
        self._store_times(i, scene, times, (score, speed, *ends))

    def _store_pool(self, indices: list[int]) -> None:
        """Store some scenes of the pool; their baselines are simulated as one batch."""
        pool, together = self._catalogue.pool, []
        assert pool is not None
        for i, scene in zip(indices, pool.scenes(indices), strict=True):
            is_speed = scene.scoring.is_mean_speed and scene.limits is None
            if not (is_speed and scene.is_homogeneous):
                self._store(i, scene, pool.features[i])
                continue
            spacing, thickness, _ = UniformLayouts(scene).sizes_at(pool.points[i : i + 1])
            sizes = spacing[0], thickness[0], np.full(scene.count, scene.height)
            self._tables.store(i, scene, pool.features[i], sizes)
            self.scenes[i] = scene
            positions = np.append(0.0, np.cumsum(spacing + thickness))
            self._tables.uniform["length_left"][i, : scene.count] = positions[-1] - positions
            together.append(i)
        if together:
            self._simulate(together)

    def _simulate(self, indices: list[int]) -> None:
        """Simulate the baselines of scenes by actions of 0, and store their arrival times."""
        number, tables = len(indices), self._tables
        batch = tables.new_batch(number)._replace(rules=tables.rules.copy())
        batch.rules["rtol"], batch.scene[:] = POOL_RTOL, indices
        tables.begin_layouts(batch, np.arange(number))
        observations = np.zeros((number, *(tables.layout.space.shape or ())), np.float32)
        actions = np.zeros((number, action_entries(self._catalogue.first)))
        answer, times = (observations, np.zeros(number), np.zeros(number, np.bool_)), []
        batch.episodes["phase"] = BEGINNING
        while (batch.episodes["phase"] != OVER).any():
            kernels.step_batch(0, number, batch, actions, *answer)
            times.append(batch.states["time"].copy())
        results = zip(indices, np.transpose(times), batch.episodes["score"].tolist(), strict=True)
        for i, hits, score in results:
            self._store_times(i, self.scenes[i], hits, (score, score, 1.0, Outcome.PROPAGATED))

    def _store_times(
        self, i: int, scene: Scene, times: Floats, result: tuple[float, float, float, int]
    ) -> None:
        """Store arrival times [s] and BASELINE of the uniform baseline of scene i.

        Times beyond the number of dominoes of the scene are not used.
        """
        score, speed, *_ = result
        tables = self._tables
        rules, count, sizes = tables.rules[i], scene.count, (scene.height, scene.physics)
        rules["uniform_speed"] = speed if speed > 0.0 else typical_speed(*sizes)
        unit = max(score, rules["least_score"]) if score > 0.0 else scene.criterion.typical(*sizes)
        rules["score_unit"] = unit
        tables.uniform["time_left"][i, :count] = times[count - 1 + tables.run_out] - times[:count]
        self.scenes[i], self.results[i] = scene, result


@lru_cache(maxsize=1024)  # scenes; evaluations store them again and again
def _mean_arrival_times(scene: Scene, gap: float) -> Floats:
    """Return the mean arrival times (N,) [s] of equal gaps [m] over orders of the pieces."""
    return UniformLayouts(scene).mean_arrival_times(np.full(scene.count - 1, gap))
