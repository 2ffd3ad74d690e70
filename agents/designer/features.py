"""Features of a scene, and the observations of the designer's networks.

The speed of a layout with given gaps and thicknesses depends on the features only. The unit of
length is the height h of a domino and that of time √(h/g), so a scene and its enlargement (lengths
× k, push / √k) have the same features. Density and width cancel where all dominoes are equally
high.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from domino_env import Scene
from domino_env.core.types import Floats
from domino_env.scenes.distribution import load_distribution

FEATURES = (
    "friction", "push", "count", "spacing min", "spacing max", "first_thickness", "thickness min",
    "thickness max", "pitch",
)  # fmt: skip
"""Names of the features; the last is the length per pair of dominoes, 0 without a given length."""

TIGHT = 13  # numbers of tight gaps at the end: 0 … 12
SCALES = (1.0, 2.0, 4.0, 8.0, 16.0)  # [dominoes] over which the ends of a layout are observed
LOW = np.array([0.0, 0.2, 15.0, 0.02, 0.4, 0.08, 0.08, 1.0])  # scaled to -1, as HIGH to 1
HIGH = np.array([0.5, 1.4, 80.0, 0.2, 0.95, 0.25, 0.25, 5.0])
BY_LOGARITHM = np.array([False, True, True, True, True, False, False, True])
SCENE = len(LOW) + 3  # entries that describe the scene
SIZE = SCENE + 5 + 2 * len(SCALES)  # entries of an observation


def features_of(scene: Scene) -> Floats:
    """Return the `FEATURES` of a scene, (9,)."""
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
    """Return the features of a scene that are outside the ranges of the training, in words.

    The ranges are those of "varied", "varied-thickness" and "varied-course", at any size.
    """
    free, course = scene.free_thickness, scene.length is not None
    if free and course:
        return ("free thickness over a given length",)
    nearest = _distribution("varied-thickness" if free else "varied-course" if course else "varied")
    values = dict(zip(FEATURES, features_of(scene), strict=True))
    values["length"] = values["pitch"] * (scene.count - 1)
    if not free:
        values["thickness fixed"] = values["thickness min"]
    return tuple(
        f"{name} {values[name]:.4g} is outside {bounds.min:.4g} to {bounds.max:.4g}"
        for name, bounds in zip(nearest.features, nearest.ranges.values(), strict=True)
        if not bounds.min * (1.0 - 1e-9) <= values[name] <= bounds.max * (1.0 + 1e-9)
    )


def require_kind(scene: Scene) -> None:
    """Raise ValueError for a scene of another kind than those of the training."""
    floor, lists = scene.floor_friction is not None, (scene.stock, scene.thickness_values)
    reasons = {
        "its dominoes stand on a floor": floor,
        f"its objective is {scene.objective}": not (floor or scene.criterion.is_mean_speed),
        "its gaps are not free": not scene.free_spacing,
        "its ground is not flat": scene.ground is not None,
        "its dominoes are from a stock or list, or grow": (*lists, scene.growth) != (None,) * 3,
        "its gaps are listed or tied to each other": (
            (scene.spacing_values, scene.largest_change) != (None, None)
        ),
        "it limits the wave": scene.limits is not None,
        f"it has {scene.count} dominoes": scene.count < 4,
    }
    differences = [reason for reason, applies in reasons.items() if applies]
    if differences:
        raise ValueError(
            f"scene '{scene.name}': {', '.join(differences)}; this policy was trained to maximise "
            "the mean speed of 4 or more dominoes of one height with free gaps, with or without "
            "free thickness or a given length: use `domino optimize` for this scene"
        )


def tight_of(count: int) -> int:
    """Return how many numbers of tight gaps `count` dominoes allow: at most half are tight."""
    return min(TIGHT, count // 2)


def scaled(features: Floats) -> Floats:
    """Scale the features of scenes to inputs of a network, of about -1 to 1.

    Parameters
    ----------
    features
        (…, 9) features of scenes, see `FEATURES`.

    Returns
    -------
    NDArray
        (…, SCENE): friction, push, count, bounds of the gap, first thickness, least thickness,
        largest over least; 1 with a given length, its pitch from -1 to 1 between the smallest and
        the largest that the bounds allow, and the logarithm of the mean gap between the thinnest
        dominoes (all three 0 without a given length).
    """
    values = np.asarray(features, dtype=np.float64)
    least, largest, thin, thick, pitch = (values[..., i] for i in (3, 4, 6, 7, 8))
    plain = np.concatenate([values[..., :7], (thick / thin)[..., None]], axis=-1)
    low, high = (np.where(BY_LOGARITHM, np.log(np.maximum(x, 1e-3)), x) for x in (LOW, HIGH))
    plain = np.where(BY_LOGARITHM, np.log(np.maximum(plain, 1e-9)), plain)
    given = pitch > 0.0
    place = (pitch - least - thin) / (largest + thick - least - thin)
    mean = np.log(np.where(given, np.maximum(pitch - thin, least), 1.0))
    course = [given, np.where(given, 2.0 * place - 1.0, 0.0), np.where(given, mean + 1.0, 0.0)]
    described = [2.0 * (plain - low) / (high - low) - 1.0, np.stack(course, axis=-1)]
    return np.concatenate(described, axis=-1)


def observations(features: Floats, tight: Floats) -> Floats:
    """Return the observations at each gap for K numbers of tight gaps, (K (N-1), SIZE)."""
    pairs = int(features[2]) - 1
    k = np.asarray(tight, dtype=np.float64)
    at = np.broadcast_to(np.arange(pairs, dtype=np.float64), (len(k), pairs))
    left = np.maximum(pairs - 1 - k[:, None] - at, 0.0)  # gaps before the tight ones begin
    parts = np.empty((len(k), pairs, SIZE))
    parts[..., :SCENE] = scaled(features)
    c = SCENE
    parts[..., c] = 2.0 * at / (pairs - 1) - 1.0
    parts[..., c + 1], parts[..., c + 2] = np.log1p(at) / 2.0 - 1.0, np.log1p(left) / 2.0 - 1.0
    parts[..., c + 3], parts[..., c + 4] = k[:, None] / 6.0 - 1.0, np.exp(-k / 2.0)[:, None]
    for j, scale in enumerate(SCALES):
        parts[..., c + 5 + 2 * j] = np.exp(-at / scale)
        parts[..., c + 6 + 2 * j] = np.exp(-left / scale)
    return parts.reshape(-1, SIZE)
