"""Scenes of episodes: always the same one, or one that every reset samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env.core.checks import require, require_choice
from domino_env.core.models import plain
from domino_env.core.types import Floats, Ints
from domino_env.envs.arguments import SceneLike, as_scene
from domino_env.envs.spaces import FEATURE_LIMIT, ObservationLayout, action_entries, closeness
from domino_env.kernels.arrays import CONTACT, STATE, UNEVEN_CONTACT
from domino_env.kernels.step import environment as kernels
from domino_env.kernels.step.batch import BEGINNING, EPISODE, RULES, RUNNING, UNIFORM, Batch
from domino_env.physics.wave import MAX_RTOL, MIN_RTOL, Outcome
from domino_env.scenes.distribution import SceneDistribution
from domino_env.scenes.io.ranges import COUNT
from domino_env.scenes.objectives.tempo import LEAST_SCORE
from domino_env.scenes.placement import LEAST_GAP
from domino_env.scenes.pool import ScenePool
from domino_env.scenes.scene import Scene
from domino_env.scenes.uniform_layouts import UniformLayouts

Generators = Callable[[int], np.random.Generator]  # returns the generator of an environment

COUNT_FACTOR = 2  # largest count of a scene given to a reset, over the largest sampled count
MAX_RING = 1024  # most dominoes stored behind the leader; some thirty influence the wave
POOL_RTOL = 1e-12  # relative error of the arrival times of baselines of a pool


class SceneSource:
    """Scenes of episodes by index, with rules, features and uniform baselines as arrays.

    Parameters
    ----------
    scene
        Scene of all episodes, or distribution from which every reset samples one; see `as_scene`.
    num_envs
        B, the number of environments.
    rtol
        Relative error allowed in the arrival times.
    window
        Largest number of gaps and thicknesses that are observed.
    num_scenes, first_scene, hide
        See `DominoChain`.

    Attributes
    ----------
    distribution
        The distribution; None if the scene is fixed.
    first
        The scene, or an example of the distribution.
    rtol
        Relative error allowed in the arrival times.
    observed
        Indices of the sampled numbers that are observed.
    pool_size
        P, number of scenes in the pool of the distribution; 1 if the scene is fixed.
    indices
        Indices of the scenes that resets sample.
    longest
        N, largest number of dominoes of a scene, without those of a run-out.
    longest_episode
        Number of steps of an episode, if its wave does not stop; None if it is sampled.
    run_out
        Number of fixed dominoes of the run-out.
    window
        Number of gaps and thicknesses that are observed.
    scenes
        S scenes: P of the pool, then two of each environment, for scenes given to resets, so that
        a reset that fails leaves the scene of the present episode; None until it is used.
    rules
        RULES of each scene, (S,). "score_unit" is the divisor of positive scores in the gain: the
        score of the uniform baseline if that is positive, else √(g h) for speeds, h for heights and
        1 for other scores.
    features
        Observed numbers of each scene, scaled to [-1, 1] over their ranges, (S, F); F = 0 if the
        scene is fixed.
    first_thickness
        Thickness of the first domino of each scene, (S,) [m].
    run_out_gap
        Gap between the dominoes of the run-out of each scene, (S,) [m]; 0 without a run-out.
    score, speed, outcome, reach
        Score, mean speed [m/s], value of `Outcome` and reach of the uniform baseline of each scene,
        (S,).
    uniform
        UNIFORM of each domino of the uniform baseline of each scene, (S, N).
    kinds
        Thicknesses of the kinds of a stock [m] and numbers of pieces of each scene, (S, 2, K).
    pieces
        Kinds of the pieces that are drawn in random order, (S, P); P = 0 without a hand.
    schedule
        Scheduled arrival times [s], and intervals scaled to [-1, 1], (S, N, 2); (S, 0, 2) without
        a schedule.
    observation_layout
        Slice of each part of an observation, by name.

    Raises
    ------
    ValueError
        For a scene that leaves nothing free or has rules that need the whole layout, for a
        distribution with uneven ground, and for numbers out of range.
    """

    def __init__(
        self,
        scene: SceneLike,
        num_envs: int,
        rtol: float,
        window: int,
        num_scenes: int | None = None,
        first_scene: int = 0,
        hide: Sequence[str] = (),
    ) -> None:
        require("num_envs", num_envs, 1, whole=True)
        require("rtol", rtol, MIN_RTOL, MAX_RTOL)
        require("window", window, 0, whole=True, hint="the number of gaps observed")
        scene = as_scene(scene)
        self.rtol = float(rtol)
        self.distribution = scene if isinstance(scene, SceneDistribution) else None
        self.first = scene.first if isinstance(scene, SceneDistribution) else scene
        _check_scene(self.first)
        names = () if self.distribution is None else self.distribution.features
        self.observed = _observed_indices(names, hide)
        count, self.pool_size = self.first.count, 1
        self.longest_episode: int | None = count - 1
        if isinstance(scene, SceneDistribution):
            _check_distribution(scene)
            self.pool_size = len(shared_pool(scene))
            if COUNT in scene.ranges:
                count, self.longest_episode = int(scene.ranges[COUNT].max), None
        self.indices = _sampled_indices(self.pool_size, num_scenes, first_scene)
        self.window = min(int(window), count - 1)
        size = self.pool_size + 2 * num_envs * (self.distribution is not None)
        self.longest = count * (COUNT_FACTOR if self.distribution is not None else 1)
        self.run_out = self.first.row_count - self.first.count
        self.observation_layout = ObservationLayout(self.first, self.window, len(self.observed))
        self.num_envs = int(num_envs)
        self.scenes = np.full(size, None, object)
        self.rules, self.uniform = np.zeros(size, RULES), np.zeros((size, self.longest), UNIFORM)
        self.features = np.zeros((size, len(self.observed)), np.float32)
        self.first_thickness, self.run_out_gap, self.score, self.speed = np.zeros((4, size))
        self.kinds = np.zeros((size, *_kinds(self.first).shape))
        self.pieces = np.zeros((size, len(piece_kinds(self.first))), np.int16)
        self.outcome, self.reach = np.full(size, int(Outcome.PROPAGATED)), np.ones(size)
        scheduled = 0 if self.first.tempo is None else self.longest
        self.schedule = np.zeros((size, scheduled, 2))
        if isinstance(scene, Scene):
            self._store(0, scene, np.empty(0))

    def sample(self, generator: np.random.Generator) -> int:
        """Sample a scene, and return its index, which `load` takes; 0 if the scene is fixed."""
        if self.distribution is None:
            return 0
        return self.indices[int(len(self.indices) * generator.random())]

    def load(self, indices: Ints) -> None:
        """Store the sampled scenes with these indices, unless they are stored."""
        missing = np.array([i for i in indices.tolist() if self.scenes[i] is None], np.int64)
        if len(missing):
            # the more environments, the sooner all scenes are used; computing a baseline that is
            # not known takes long
            blocks = np.unique(missing // self.num_envs)[:, None] * self.num_envs
            near = (blocks + np.arange(self.num_envs)).ravel()
            near = near[(near >= self.indices.start) & (near < self.indices.stop)]
            assert self.distribution is not None
            near = near[shared_pool(self.distribution).is_known(near)]
            self._store_pool(np.union1d(missing, near).tolist())

    def add(self, env: int, scene: Scene, present: int) -> int:
        """Store a scene for one environment.

        Parameters
        ----------
        env
            Index of the environment.
        scene
            The scene.
        present
            Index of the present scene of the environment, which stays stored.

        Returns
        -------
        int
            Index of the scene.

        Raises
        ------
        ValueError
            For a scene that the distribution does not cover, or with too many dominoes.
        """
        assert self.distribution is not None
        numbers = self.distribution.numbers(scene)
        if scene.count > self.longest:
            raise ValueError(
                f"scene '{scene.name}' has {scene.count} dominoes: use at most {self.longest}, "
                f"{COUNT_FACTOR} times as many as '{self.distribution.name}' samples"
            )
        index = self.pool_size + 2 * env
        index += index == present
        self._store(index, scene, self.distribution.scale(numbers))
        return index

    def _store(self, i: int, scene: Scene, features: Floats) -> None:
        """Store scene i with its features and its uniform baseline."""
        baseline, layout = scene.uniform(), scene.uniform().layout
        times, speed = baseline.wave.arrival_times, baseline.wave.mean_speed
        if scene.hand and speed > 0.0:  # means over orders of the pieces
            times = _mean_arrival_times(scene, float(layout.spacing[0]))
            speed = baseline.score if scene.scoring.is_mean_speed else speed
        positions = baseline.wave.layout.positions
        if not speed > 0.0:  # the wave of the baseline stops
            times = positions / typical_speed(scene)
        self._store_sizes(i, scene, features, layout.spacing, layout.thickness[1:], layout.height)
        uniform = self.uniform[i, : scene.count]
        uniform["length_left"] = positions[-1] - positions[: scene.count]
        uniform["thickness_left"] = layout.thickness.sum() - np.cumsum(layout.thickness)
        score, noise = baseline.score, scene.placement
        if noise is not None and noise.quantile is not None:  # returns are compared with the mean
            score = scene.replace(placement=noise.replace(quantile=None)).score(layout)
        self._store_times(i, times, speed, score)
        self.outcome[i], self.reach[i] = baseline.wave.outcome, baseline.wave.reach

    def _store_pool(self, indices: list[int]) -> None:
        """Store some scenes of the pool; their baselines are simulated as one batch."""
        assert self.distribution is not None
        pool, new = shared_pool(self.distribution), [i for i in indices if self.scenes[i] is None]
        for i, scene in zip(new, pool.scenes(new), strict=True):
            is_speed = scene.scoring.is_mean_speed and scene.limits is None
            if not (is_speed and scene.is_homogeneous):
                self._store(i, scene, pool.features[i])
                continue
            spacing, thickness, _ = UniformLayouts(scene).sizes_at(pool.points[i : i + 1])
            height = np.full(scene.count, scene.height)
            self._store_sizes(i, scene, pool.features[i], spacing[0], thickness[0], height)
            positions = np.append(0.0, np.cumsum(spacing + thickness))
            self.uniform["length_left"][i, : scene.count] = positions[-1] - positions
        new = [i for i in new if not self.score[i] > 0.0]
        if new:
            self._simulate_baselines(new)

    def _simulate_baselines(self, indices: list[int]) -> None:
        """Simulate the baselines of scenes by actions of 0, and store their arrival times."""
        number = len(indices)
        batch = self.new_batch(number)._replace(rules=self.rules.copy())
        batch.rules["rtol"], batch.scene[:] = POOL_RTOL, indices
        self.begin_layouts(batch, np.arange(number))
        observations = np.zeros((number, *(self.observation_layout.space.shape or ())), np.float32)
        actions, times = np.zeros((number, action_entries(self.first))), [np.zeros(number)]
        answer = observations, np.zeros(number), np.zeros(number, np.bool_)
        batch.episodes["phase"] = BEGINNING
        kernels.step_batch(0, number, batch, actions, *answer)
        while (batch.episodes["phase"] == RUNNING).any():
            kernels.step_batch(0, number, batch, actions, *answer)
            times.append(batch.states["time"].copy())
        results = zip(indices, np.transpose(times), batch.episodes["score"].tolist(), strict=True)
        for i, hits, score in results:
            self._store_times(i, hits, score, score)

    def _store_sizes(
        self,
        i: int,
        scene: Scene,
        features: Floats,
        spacing: Floats,
        thickness: Floats,
        height: Floats,
    ) -> None:
        """Store scene i, and the sizes of its uniform baseline [m].

        They are gaps (N-1,), thicknesses of dominoes 1 … N-1 and heights (N,).
        """
        self.scenes[i], self.rules[i] = scene, _make_rules(scene, self.rtol)
        self.features[i] = np.clip(features[self.observed], -FEATURE_LIMIT, FEATURE_LIMIT)
        self.first_thickness[i] = scene.first_thickness
        self.kinds[i], self.pieces[i] = _kinds(scene), piece_kinds(scene)
        self.run_out_gap[i] = 0.0 if scene.run_out is None else scene.run_out.spacing
        tempo = scene.tempo
        if tempo is not None:
            scheduled = np.append(0.0, tempo.schedule(scene.count))
            intervals = np.diff(scheduled)
            low, high = intervals.min(), intervals.max()
            middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-12)  # not 0 if all equal
            self.schedule[i, : scene.count, 0] = scheduled
            self.schedule[i, 1 : scene.count, 1] = (intervals - middle) / half
        uniform = self.uniform[i, : scene.count]
        behind, ahead = height[:-1], height[1:]
        uniform["gap"][:-1] = spacing / np.minimum(behind, ahead) if scene.in_heights else spacing
        uniform["thickness"][:-1] = thickness / ahead if scene.in_heights else thickness
        uniform["growth"][:-1] = ahead / behind

    def _store_times(self, i: int, times: Floats, speed: float, score: float) -> None:
        """Store arrival times [s], mean speed [m/s] and score of the uniform baseline of scene i.

        Times beyond the number of dominoes of the scene are not used.
        """
        scene, rules = self.scenes[i], self.rules[i]
        typical, count = typical_speed(scene), scene.count
        unit = {"m/s": typical, "m": scene.height}.get(scene.unit, 1.0)
        rules["uniform_speed"] = speed if speed > 0.0 else typical
        rules["score_unit"] = max(score, rules["least_score"]) if score > 0.0 else unit
        self.uniform["time_left"][i, :count] = times[count - 1 + self.run_out] - times[:count]
        self.score[i], self.speed[i] = score, speed

    def begin_layouts(self, batch: Batch, envs: Ints) -> None:
        """Write the first domino and the run-out of some environments into a batch."""
        scenes = batch.scene[envs]
        batch.thickness[envs, 0] = self.first_thickness[scenes]
        if self.run_out:
            places = self.rules["count"][scenes][:, None] + np.arange(self.run_out)
            batch.spacing[envs[:, None], places - 1] = self.run_out_gap[scenes, None]
            batch.thickness[envs[:, None], places] = self.first_thickness[scenes, None]
        if len(batch.height) == len(batch.scene):  # else environments share the heights
            batch.height[envs] = self.rules["unit"][scenes, None]

    def new_batch(self, num_envs: int) -> Batch:
        """Return the arrays of environments before their first reset; scenes are shared."""
        scene, longest = self.first, self.longest + self.run_out
        features = () if self.distribution is None else self.distribution.features
        own_height = scene.growth is not None or "height" in features
        # a power of two for the whole chain, or for the part that influences the wave
        ring_size = 1 << min(longest, MAX_RING - 1).bit_length()
        contact = CONTACT if scene.ground is None else UNEVEN_CONTACT
        batch = Batch(
            scene=np.zeros(num_envs, np.int64),
            rules=self.rules,
            entries=self.observation_layout.starts,
            features=self.features,
            uniform=self.uniform,
            schedule=self.schedule,
            closeness=closeness(longest),
            kinds=self.kinds,
            box=np.zeros((num_envs, self.kinds.shape[2])),
            order=np.zeros((num_envs, self.pieces.shape[1]), np.int16),
            errors=np.zeros((num_envs if scene.placement else 0, longest - 1)),
            rings=np.zeros((num_envs, ring_size), contact),
            states=np.zeros(num_envs, STATE),
            episodes=np.zeros(num_envs, EPISODE),
            spacing=np.full((num_envs, longest - 1), scene.spacing[0]),
            thickness=np.full((num_envs, longest), scene.first_thickness),
            height=np.full((num_envs if own_height else 1, longest), scene.height),
            density=np.full((1, longest), scene.density),
        )
        if scene.ground is None:
            return batch
        _, tilt = scene.ground.rise_and_tilt(np.empty(0), batch.thickness[0, :1])
        return batch._replace(
            rise=np.zeros((num_envs, longest - 1)),
            tilt=np.full((num_envs, longest), tilt[0]),
            places=np.zeros((num_envs, longest)),
            curve=scene.ground.curve,
        )


def _kinds(scene: Scene) -> Floats:
    """Return the thicknesses [m] and numbers of pieces of a stock that leaves a choice, (2, K)."""
    if scene.stock is None or not scene.free_thickness:
        return np.empty((2, 0))
    box = scene.stock.without(scene.first_thickness)
    kinds = np.array([box.thickness, box.count], dtype=np.float64)
    return np.ascontiguousarray(kinds[:, np.argsort(box.thickness)])


def piece_kinds(scene: Scene, taken: Floats | None = None) -> NDArray[np.int16]:
    """Return the kinds (P,) of the pieces that are drawn in random order; empty without a hand.

    taken: thicknesses of the dominoes placed so far [m]; None for the first one alone.
    """
    if not scene.hand or scene.stock is None or not scene.free_thickness:
        return np.zeros(0, np.int16)
    left = scene.stock.without(*([scene.first_thickness] if taken is None else taken)).dominoes
    return np.searchsorted(_kinds(scene)[0], left).astype(np.int16)


@lru_cache(maxsize=1024)  # scenes; evaluations store them again and again
def _mean_arrival_times(scene: Scene, gap: float) -> Floats:
    """Return the mean arrival times (N,) [s] of equal gaps [m] over orders of the pieces."""
    return UniformLayouts(scene).mean_arrival_times(np.full(scene.count - 1, gap))


@lru_cache(maxsize=8)  # distributions
def shared_pool(distribution: SceneDistribution) -> ScenePool:
    """Return the pool of a distribution, which all environments of this process share."""
    return ScenePool(distribution)


def _observed_indices(features: Sequence[str], hide: object) -> list[int]:
    """Return the indices of the features that are not hidden."""
    hidden = list(hide) if np.iterable(hide) and not isinstance(hide, str) else [hide]
    for name in hidden:
        if not features:
            raise ValueError(f"hide = '{name}': a fixed scene has no features; leave hide out")
        require_choice("hide", name, features)
    return [i for i, name in enumerate(features) if name not in hidden]


def _sampled_indices(size: int, num_scenes: int | None, first_scene: int) -> range:
    """Return the indices of the scenes that resets sample, in a pool of `size` scenes."""
    hint = f"scenes are numbered from 0 to {size - 1}" if size > 1 else "the scene is fixed"
    require("first_scene", first_scene, 0, size - 1, whole=True, hint=hint)
    most = size - first_scene
    require("num_scenes", num_scenes, 1, most, whole=True, hint=hint, optional=True)
    return range(size)[first_scene:][:num_scenes]


def typical_speed(scene: Scene) -> float:
    """Return √(g h), in place of the speed of a uniform baseline that stops [m/s]."""
    return float(np.sqrt(scene.physics.gravity * scene.height))


def _make_rules(scene: Scene, rtol: float) -> tuple[Any, ...]:
    """Return the fields of RULES of a scene; those of its uniform baseline are 0."""
    growth, tempo = scene.growth or (1.0, 1.0), scene.tempo
    values = plain(scene.physics) | {
        "count": scene.count,
        "run_out": scene.row_count - scene.count,
        "hand": scene.hand,
        "rtol": rtol,
        "uniform_speed": 0.0,
        "length": scene.length or 0.0,
        "gap_low": scene.spacing[0],
        "gap_high": scene.spacing[1],
        "thickness_low": scene.thickness[0],
        "thickness_high": scene.thickness[1],
        "least_placed": LEAST_GAP,
        "growth_low": growth[0],
        "growth_high": growth[1],
        "unit": scene.height,
        "grows": scene.growth is not None,
        "in_heights": scene.in_heights,
        "rewards_steps": scene.criterion.rewards_speed,
        "tolerance": 0.0 if tempo is None else tempo.tolerance,
        "score_unit": 0.0,
        "least_score": 0.0 if tempo is None else LEAST_SCORE,
        "fixed": not (scene.hand or scene.placement),
        "score_is_speed": scene.as_placed.scoring.is_mean_speed and scene.limits is None,
    }
    return tuple(values[name] for name in RULES.names or ())


def _check_scene(scene: Scene) -> None:
    """Raise a ValueError for a scene without free sizes, or whose rules need the whole layout."""
    if not action_entries(scene):
        raise ValueError(
            f"scene '{scene.name}' leaves nothing free to choose: give spacing or thickness a min "
            "and a max"
        )
    is_uneven = scene.ground is not None and not scene.ground.is_even
    if scene.placement is not None and (scene.length is not None or is_uneven):
        reason = "gaps with errors do not add up to the length of the scene"
        if is_uneven:
            reason = "gaps with errors may be so narrow that dominoes lean against each other"
        raise ValueError(
            f"scene '{scene.name}' has [placement], and {reason}: leave one out, or search with "
            "`optimize`"
        )
    if scene.length is not None and scene.stock is not None:
        raise ValueError(
            f"scene '{scene.name}' has a length and also a stock: an environment cannot compute "
            "after which actions the length can still be met; leave one out, or search with "
            "`optimize`"
        )


def _check_distribution(distribution: SceneDistribution) -> None:
    """Raise a ValueError for uneven ground."""
    if distribution.first.ground is not None:
        raise ValueError(
            f"'{distribution.name}' has uneven ground, which only a fixed scene may have: "
            "leave out [ground], or the ranges"
        )
