"""Scenes as arguments, and specifications of environments that can be written as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from enum import Enum
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from gymnasium.envs.registration import EnvSpec

from domino_env.scenes.distribution import SceneDistribution, load_any
from domino_env.scenes.io.ranges import has_ranges
from domino_env.scenes.io.reading import scene_from_document
from domino_env.scenes.scene import Scene

SceneLike: TypeAlias = str | Path | Mapping[str, Any] | Scene | SceneDistribution

POINT = "uniform_point"  # key beside the tables of a document: see `Scene.with_uniform`


def as_scene(scene: SceneLike) -> Scene | SceneDistribution:
    """Return the scene or scene distribution of an argument.

    Parameters
    ----------
    scene
        A scene or distribution, its name, the path of its file, or its document, as
        `plain_argument` returns it.

    Raises
    ------
    TypeError
        For any other argument.
    ValueError
        For a name, file or document that is not valid.
    """
    if isinstance(scene, Scene | SceneDistribution):
        return scene
    if not isinstance(scene, Mapping):
        return load_any(scene)
    document = dict(scene)
    point, name = document.pop(POINT, None), str(document.get("name", "scene"))
    if has_ranges(document):
        return SceneDistribution(document, name)
    read = scene_from_document(document, name, name)
    return read if point is None else read.with_uniform(point)


def plain_argument(value: Any) -> Any:
    """Return an argument of an environment as JSON can write it, with the same meaning."""
    if isinstance(value, Scene):
        point = value.uniform_point
        return value.document() | ({} if point is None else {POINT: list(point)})
    if isinstance(value, SceneDistribution):
        return value.document | {"name": value.name}
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, Enum):
        return value.value
    return value.item() if isinstance(value, np.generic) else value


class WritableSpec:
    """Base class of environments whose `spec` can be written as JSON, with scenes as documents.

    Attributes
    ----------
    longest_episode
        Largest number of steps of an episode; None if it depends on the sampled scene.
    """

    longest_episode: int | None = None
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Specification with which Gymnasium made the environment.

        Without a time limit, `max_episode_steps` is one more than the number of steps of the
        longest episode: with this limit `gymnasium.make(spec)` truncates no episode, while a limit
        of the number itself would mark the last step, which terminates, as truncated too.
        """
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        if spec is not None:
            arguments = {name: plain_argument(value) for name, value in spec.kwargs.items()}
            limit = arguments.get("max_episode_steps") or spec.max_episode_steps
            if limit is None and self.longest_episode is not None:
                limit = self.longest_episode + 1
            spec = replace(spec, kwargs=arguments, max_episode_steps=limit)
        self._spec = spec
