"""Features: all that the speed of a row of given gaps and thicknesses depends on, as numbers.

Lengths count in heights h of a domino and times in √(h/g): a scene and its enlargement have the
same features, as they are the same (lengths × k, push / √k). Density and width cancel where all
dominoes are equally high.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from domino_env import Scene
from domino_env.scenes.distribution import load_distribution

Floats = NDArray[np.float64]

FEATURES = (
    "friction", "push", "count", "least gap", "largest gap", "first thickness", "least thickness",
    "largest thickness", "pitch",
)  # fmt: skip
"""The last is the length per pair of dominoes, 0 where the scene asks for none."""


def features_of(scene: Scene) -> Floats:
    """Give the `FEATURES` of a scene, (9,)."""
    h, gravity = scene.height, scene.physics.gravity
    unit = 1.0 if scene.in_heights else h
    pitch = 0.0 if scene.length is None else scene.length / (scene.count - 1) / h
    return np.array([
        scene.physics.friction, scene.physics.push * np.sqrt(h / gravity), scene.count,
        scene.spacing[0] / unit, scene.spacing[1] / unit, scene.first_thickness / h,
        scene.thickness[0] / unit, scene.thickness[1] / unit, pitch,
    ])  # fmt: skip


_distribution = lru_cache(load_distribution)


def outside(scene: Scene) -> tuple[str, ...]:
    """Say in what a scene differs from those that the policy was trained on; empty if in nothing.

    These are drawn from "varied", "varied-thickness" and "varied-course", at any size.
    """
    free, course = scene.free_thickness, scene.length is not None
    if free and course:
        return ("free thickness over a given length",)
    drawn = _distribution("varied-thickness" if free else "varied-course" if course else "varied")
    known = dict(zip(FEATURES, features_of(scene), strict=True))
    known["length"] = known["pitch"] * (scene.count - 1)
    if not free:
        known["thickness"] = known["least thickness"]
    return tuple(
        f"{name} {known[name]:.4g} is outside {one.min:.4g} to {one.max:.4g}"
        for name, one in zip(drawn.features, drawn.ranges.values(), strict=True)
        if not one.min * (1.0 - 1e-9) <= known[name] <= one.max * (1.0 + 1e-9)
    )


def require_kind(scene: Scene) -> None:
    """Raise ValueError for a scene that asks for something else than fast rows."""
    other = []
    if scene.floor_friction is not None:
        other.append("its rows stand on a floor")
    elif not scene.criterion.is_mean_speed:
        other.append(f"its objective is {scene.objective}")
    if not scene.free_spacing:
        other.append("its gaps are not free")
    if scene.ground is not None:
        other.append("its ground is not flat")
    if scene.stock is not None or scene.thickness_values is not None or scene.growth is not None:
        other.append("its dominoes are from a stock or list, or grow")
    if scene.spacing_values is not None or scene.largest_change is not None:
        other.append("its gaps are listed or tied to each other")
    if scene.limits is not None:
        other.append("it limits the wave")
    if scene.count < 4:
        other.append(f"it has {scene.count} dominoes")
    if other:
        raise ValueError(
            f"scene '{scene.name}': {', '.join(other)}; this policy was trained on fast rows of 4 "
            "or more dominoes of one height with free gaps, and thickness and length if asked "
            "for: search this one with `domino optimize`"
        )
