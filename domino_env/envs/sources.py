"""Scenes of episodes: always the same one, or one sampled at every reset."""

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

Generators = Callable[[int], np.random.Generator]  # generator of an environment, by its index
SceneLike: TypeAlias = str | Path | Scene | SceneDistribution  # or the name or path of either

COUNT_FACTOR = 2  # largest count of a given scene over that of the longest sampled one


class SceneSource:
    """Scenes by their indices, with rules, features and uniform baselines as arrays.

    Parameters
    ----------
    scene
        The one scene, or the distribution that one is sampled from at every reset; or the name or
        path of either.
    num_envs
        B, the number of environments.
    rtol
        Relative error allowed in the arrival times.
    window
        Number of gaps (and thicknesses) observed, at most.
    num_scenes, first_scene, hide
        See `DominoChain`.

    Attributes
    ----------
    distribution
        The distribution; None if the scene is fixed.
    first
        The scene, or the first of the distribution.
    observed
        Indices of the sampled numbers that are observed.
    indices
        Indices of the scenes that resets sample.
    longest
        Largest number of dominoes of a scene.
    window
        Number of gaps (and thicknesses) observed.
    scenes
        Scenes of the pool, then one place for each environment that is given its own scene.
    rules
        RULES of each scene, (S,). A success is divided by their "score_unit" in the gain: the score
        of the baseline. Where that is no success: √(g h), h, or 1, by the unit of the objective.
    features
        Observed numbers of each, (S, F); F = 0 if the scene is fixed.
    first_thickness
        Thickness of the first domino of each, (S,) [m].
    score, speed
        Score and speed [m/s] of the uniform baseline of each, (S,).
    schedule
        Arrival times [s] and intervals, scaled to -1 … 1, if hits have a schedule, (S, N, 2).
    uniform_left
        Length [m] and time [s] that the baseline has left with k dominoes placed, (S, N, 2).

    Raises
    ------
    ValueError
        If the scene leaves nothing free or has rules that need the whole layout, and for a
        tolerance out of the simulator's range.
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
        require("window", window, 0, whole=True, hint="the number of dominoes observed")
        if not isinstance(scene, Scene | SceneDistribution):
            scene = load_any(scene)
        self.rtol = float(rtol)
        self.distribution = scene if isinstance(scene, SceneDistribution) else None
        self.first = scene.first if isinstance(scene, SceneDistribution) else scene
        _require_choice(self.first)
        names = () if self.distribution is None else self.distribution.features
        self.observed = _observed_indices(names, hide)
        count, sampled = self.first.count, 1
        if isinstance(scene, SceneDistribution):
            _require_shared(scene)
            sampled = len(shared_pool(scene))
            count = int(scene.ranges[COUNT].max) if COUNT in scene.ranges else count
        self.indices = _sampled_indices(sampled, num_scenes, first_scene)
        self.sampled, self.window = sampled, min(int(window), count - 1)
        places = sampled + num_envs * (self.distribution is not None)
        self.longest = count * (COUNT_FACTOR if self.distribution is not None else 1)
        self.scenes: list[Scene | None] = [None] * places
        self.rules = np.zeros(places, RULES)
        self.features = np.zeros((places, len(self.observed)), np.float32)
        self.first_thickness, self.score, self.speed = np.zeros((3, places))
        self.schedule, self.uniform_left = np.zeros((2, places, self.longest, 2))
        if isinstance(scene, Scene):
            self._store(0, scene, np.empty(0))

    def sample(self, generator: np.random.Generator) -> int:
        """Return the index of a random scene; 0 if the scene is fixed."""
        if self.distribution is None:
            return 0
        i = self.indices[int(len(self.indices) * generator.random())]
        if self.scenes[i] is None:
            pool = shared_pool(self.distribution)
            self._store(i, pool.scene(i), pool.features[i])
        return i

    def add(self, env: int, scene: Scene) -> int:
        """Store a scene for one environment, and return its index.

        Raises
        ------
        ValueError
            For a scene that the distribution does not cover, or with too many dominoes.
        """
        assert self.distribution is not None
        numbers = self.distribution.numbers(scene)
        if scene.count > self.longest:
            raise ValueError(
                f"scene '{scene.name}' has {scene.count} dominoes: at most {self.longest}, "
                f"{COUNT_FACTOR} times as many as '{self.distribution.name}' samples"
            )
        self._store(self.sampled + env, scene, self.distribution.scale(numbers))
        return self.sampled + env

    def _store(self, i: int, scene: Scene, features: Floats) -> None:
        baseline, free_fall = scene.uniform(), free_fall_speed(scene)
        speed, positions = baseline.wave.mean_speed, baseline.layout.positions
        if scene.hand and scene.criterion.is_mean_speed:  # the score is a mean over orders
            speed = baseline.score
        times = baseline.wave.arrival_times
        if not speed > 0.0:  # of free fall, if the baseline stops
            times = positions / free_fall
        unit = baseline.score
        if not unit > 0.0:
            unit = {"m/s": free_fall, "m": scene.height}.get(scene.unit, 1.0)
        self.scenes[i] = scene
        self.rules[i] = _make_rules(scene, self.rtol, speed if speed > 0.0 else free_fall, unit)
        self.features[i] = np.clip(features[self.observed], -FEATURE_LIMIT, FEATURE_LIMIT)
        self.first_thickness[i] = scene.first_thickness
        self.score[i], self.speed[i] = baseline.score, speed
        tempo = scene.as_placed.tempo
        if tempo is not None:
            due = np.append(0.0, tempo.schedule(scene.count))
            intervals = np.diff(due)
            low, high = intervals.min(), intervals.max()
            middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-12)
            self.schedule[i, : scene.count, 0] = due
            self.schedule[i, 1 : scene.count, 1] = (intervals - middle) / half
        left = positions[-1] - positions, times[-1] - times
        self.uniform_left[i, : scene.count] = np.transpose(left)


@lru_cache(maxsize=8)
def shared_pool(distribution: SceneDistribution) -> ScenePool:
    """Return the pool that all environments of this process sample from."""
    return ScenePool(distribution)


def _observed_indices(features: Sequence[str], hide: Sequence[str]) -> list[int]:
    """Return the indices of the sampled numbers that are observed."""
    hidden = list(hide) if np.iterable(hide) and not isinstance(hide, str) else [hide]
    for name in hidden:
        if not features:
            raise ValueError(f"hide = '{name}': a fixed scene has no features; leave hide out")
        require_choice("hide", name, features)
    return [i for i, name in enumerate(features) if name not in hidden]


def _sampled_indices(sampled: int, num_scenes: int | None, first_scene: int) -> range:
    """Return the indices of the scenes that are sampled."""
    hint = f"scenes are numbered from 0 to {sampled - 1}" if sampled > 1 else "the scene is fixed"
    require("first_scene", first_scene, 0, sampled - 1, whole=True, hint=hint)
    if num_scenes is None:
        return range(first_scene, sampled)
    require("num_scenes", num_scenes, 1, sampled - first_scene, whole=True, hint=hint)
    return range(first_scene, first_scene + num_scenes)


def free_fall_speed(scene: Scene) -> float:
    """Return √(g h), the reference speed of a scene whose baseline stops [m/s]."""
    return float(np.sqrt(scene.physics.gravity * scene.height))


def _make_rules(scene: Scene, rtol: float, speed: float, unit: float) -> tuple[Any, ...]:
    """Return the fields of RULES of a scene that is compared with a speed [m/s].

    unit: score by which a success is divided in the gain.
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


def _require_choice(scene: Scene) -> None:
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
            "an environment cannot compute domino by domino what remains reachable; leave one "
            "out, or search with `optimize`"
        )


def _require_shared(distribution: SceneDistribution) -> None:
    """Raise a ValueError for ground and for differing lists or stocks, which environments share."""
    first, sampled = distribution.first, distribution.ranges
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
        varied = [key for key in keys if tuple(key.split(".")) in sampled]
        if rule is not None and varied:
            raise ValueError(
                f"'{distribution.name}' has {name} and samples {', '.join(varied)}: leave one out"
            )
