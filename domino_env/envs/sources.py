"""Scenes of episodes: always the same one, or one that every reset samples."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from domino_env.core.checks import require, require_choice
from domino_env.core.types import Floats
from domino_env.envs.spaces import FEATURE_LIMIT, action_entries
from domino_env.kernels.step.batch import RULES
from domino_env.physics.wave import MAX_RTOL, MIN_RTOL
from domino_env.scenes.distribution import SceneDistribution, load_any
from domino_env.scenes.io.ranges import COUNT
from domino_env.scenes.objectives.robust import LEAST_GAP
from domino_env.scenes.pool import ScenePool
from domino_env.scenes.scene import Scene

Generators = Callable[[int], np.random.Generator]  # returns the generator of an environment
SceneLike: TypeAlias = str | Path | Scene | SceneDistribution  # or the name or path of either

COUNT_FACTOR = 2  # largest count of a scene given to a reset, over the largest sampled count


class SceneSource:
    """Scenes of episodes by index, with rules, features and uniform baselines as arrays.

    Parameters
    ----------
    scene
        Scene of all episodes, or distribution from which every reset samples one; or the name or
        path of either.
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
        N, largest number of dominoes of a scene.
    window
        Number of gaps and thicknesses that are observed.
    scenes
        S scenes: P of the pool, then two of each environment, for scenes given to resets, so that
        a reset that fails leaves the scene of the present episode; None until it is used.
    rules
        RULES of each scene, (S,). Their "score_unit" divides positive scores in the gain: the score
        of the uniform baseline or, if that is not positive, √(g h), h or 1, by the unit of the
        objective.
    features
        Observed numbers of each scene, scaled to [-1, 1] over their ranges, (S, F); F = 0 if the
        scene is fixed.
    first_thickness
        Thickness of the first domino of each scene, (S,) [m].
    score, speed
        Score and mean speed [m/s] of the uniform baseline of each scene, (S,).
    schedule
        Scheduled arrival times [s], and intervals scaled to [-1, 1], (S, N, 2); 0 without a
        schedule.
    uniform_left
        Length [m] and time [s] that the uniform baseline has left with k dominoes placed,
        (S, N, 2).

    Raises
    ------
    ValueError
        For a scene that leaves nothing free or has rules that need the whole layout, for a
        distribution with uneven ground or with sampled bounds of a list, and for numbers out of
        range.
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
        if not isinstance(scene, Scene | SceneDistribution):
            scene = load_any(scene)
        self.rtol = float(rtol)
        self.distribution = scene if isinstance(scene, SceneDistribution) else None
        self.first = scene.first if isinstance(scene, SceneDistribution) else scene
        _check_scene(self.first)
        names = () if self.distribution is None else self.distribution.features
        self.observed = _observed_indices(names, hide)
        count, self.pool_size = self.first.count, 1
        if isinstance(scene, SceneDistribution):
            _check_distribution(scene)
            self.pool_size = len(shared_pool(scene))
            count = int(scene.ranges[COUNT].max) if COUNT in scene.ranges else count
        self.indices = _sampled_indices(self.pool_size, num_scenes, first_scene)
        self.window = min(int(window), count - 1)
        size = self.pool_size + 2 * num_envs * (self.distribution is not None)
        self.longest = count * (COUNT_FACTOR if self.distribution is not None else 1)
        self.scenes: list[Scene | None] = [None] * size
        self.rules = np.zeros(size, RULES)
        self.features = np.zeros((size, len(self.observed)), np.float32)
        self.first_thickness, self.score, self.speed = np.zeros((3, size))
        self.schedule, self.uniform_left = np.zeros((2, size, self.longest, 2))
        if isinstance(scene, Scene):
            self._store(0, scene, np.empty(0))

    def sample(self, generator: np.random.Generator) -> int:
        """Sample a scene, and return its index; 0 if the scene is fixed."""
        if self.distribution is None:
            return 0
        i = self.indices[int(len(self.indices) * generator.random())]
        if self.scenes[i] is None:
            pool = shared_pool(self.distribution)
            self._store(i, pool.scene(i), pool.features[i])
        return i

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
        baseline, typical = scene.uniform(), typical_speed(scene)
        speed, positions = baseline.wave.mean_speed, baseline.layout.positions
        if scene.hand and scene.criterion.is_mean_speed:  # a mean over orders of the pieces
            speed = baseline.score
        times = baseline.wave.arrival_times
        if not speed > 0.0:  # the wave of the baseline stops
            times = positions / typical
        unit = baseline.score
        if not unit > 0.0:
            unit = {"m/s": typical, "m": scene.height}.get(scene.unit, 1.0)
        self.scenes[i] = scene
        self.rules[i] = _make_rules(scene, self.rtol, speed if speed > 0.0 else typical, unit)
        self.features[i] = np.clip(features[self.observed], -FEATURE_LIMIT, FEATURE_LIMIT)
        self.first_thickness[i] = scene.first_thickness
        self.score[i], self.speed[i] = baseline.score, speed
        tempo = scene.as_placed.tempo
        if tempo is not None:
            scheduled = np.append(0.0, tempo.schedule(scene.count))
            intervals = np.diff(scheduled)
            low, high = intervals.min(), intervals.max()
            middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-12)  # not 0 if all equal
            self.schedule[i, : scene.count, 0] = scheduled
            self.schedule[i, 1 : scene.count, 1] = (intervals - middle) / half
        left = positions[-1] - positions, times[-1] - times
        self.uniform_left[i, : scene.count] = np.transpose(left)


@lru_cache(maxsize=8)  # distributions
def shared_pool(distribution: SceneDistribution) -> ScenePool:
    """Return the pool of a distribution, which all environments of this process share."""
    return ScenePool(distribution)


def _observed_indices(features: Sequence[str], hide: Sequence[str]) -> list[int]:
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
    """Return √(g h), the reference speed of a scene whose uniform baseline stops [m/s]."""
    return float(np.sqrt(scene.physics.gravity * scene.height))


def _make_rules(scene: Scene, rtol: float, speed: float, unit: float) -> tuple[Any, ...]:
    """Return the fields of RULES of a scene.

    speed: of the uniform baseline, and reference of observations [m/s]. unit: divisor of positive
    scores in the gain.
    """
    growth, tempo = scene.growth or (1.0, 1.0), scene.as_placed.tempo
    values = {name: getattr(scene.physics, name) for name in ("friction", "gravity", "push")} | {
        "count": scene.count,
        "hand": scene.hand,
        "rtol": rtol,
        "uniform_speed": speed,
        "reference_speed": speed,
        "length": scene.length or 0.0,
        "gap_low": scene.spacing[0],
        "gap_high": scene.spacing[1],
        "thickness_low": scene.thickness[0],
        "thickness_high": scene.thickness[1],
        "largest_change": scene.largest_change or 0.0,
        "least_placed": LEAST_GAP,
        "growth_low": growth[0],
        "growth_high": growth[1],
        "unit": scene.height,
        "grows": scene.growth is not None,
        "in_heights": scene.in_heights,
        "rewards_steps": scene.criterion.rewards_speed,
        "tolerance": 0.0 if tempo is None else tempo.tolerance,
        "score_unit": unit,
        "score_is_speed": scene.criterion.is_mean_speed and scene.limits is None,
    }
    return tuple(values[name] for name in RULES.names or ())


def _check_scene(scene: Scene) -> None:
    """Raise a ValueError for a scene without free sizes, or whose rules need the whole layout."""
    if not action_entries(scene):
        raise ValueError(
            f"scene '{scene.name}' leaves nothing free to choose: give spacing or thickness a min "
            "and a max"
        )
    rules = scene.spacing_values, scene.thickness_values, scene.largest_change, scene.stock
    if scene.length is not None and any(rule is not None for rule in rules):
        raise ValueError(
            f"scene '{scene.name}' has a length and also lists, a stock or a largest change: "
            "an environment cannot compute after which actions the length can still be met; leave "
            "one out, or search with `optimize`"
        )


def _check_distribution(distribution: SceneDistribution) -> None:
    """Raise a ValueError for uneven ground, and for lists or stocks that differ between scenes."""
    first, ranges = distribution.first, distribution.ranges
    if first.ground is not None:
        raise ValueError(
            f"'{distribution.name}' has uneven ground, which only a fixed scene may have: "
            "leave out [ground], or the ranges"
        )
    gaps = "spacing.min", "spacing.max"
    thicknesses = "thickness.min", "thickness.max", "row.first_thickness"
    for rule, name, keys in (
        (first.spacing_values, "a list or steps of gaps", gaps),
        (first.thickness_values, "a list, steps or a box of thicknesses", thicknesses),
    ):
        sampled = [key for key in keys if tuple(key.split(".")) in ranges]
        if rule is not None and sampled:
            raise ValueError(
                f"'{distribution.name}' has {name} and samples {', '.join(sampled)}: leave one out"
            )
