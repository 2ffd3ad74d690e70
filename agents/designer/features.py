"""Features of a scene, and observations of the designer's networks.

The speed of a layout with given gaps and thicknesses depends only on the features. The unit of
length is the height h of a domino and the unit of time √(h/g), so scenes that differ only in scale
(lengths × k, push / √k) have the same features. Density and width cancel if all dominoes have the
same height. A tight gap is one at its lower bound; fast layouts end with a few of them.
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
"""Names of the features, in units of h and √(h/g); "pitch": mean pitch, 0 without a length."""
BOUNDS = 3, 4, 6, 7  # indices of the bounds of gaps and of thicknesses

TRIES = 13  # candidates for the number of tight gaps at the end: 0 … 12
# [gaps] decay lengths of the entries for the ends of the chain
DECAY_LENGTHS = (1.0, 2.0, 4.0, 8.0, 16.0)
# values of the first eight entries that `scale_features` maps to -1 and 1
LOW = np.array([0.0, 0.2, 15.0, 0.02, 0.4, 0.08, 0.08, 1.0])
HIGH = np.array([0.5, 1.4, 80.0, 0.2, 0.95, 0.25, 0.25, 5.0])
# True for entries that are scaled by their logarithms
LOGARITHMIC = np.array([False, True, True, True, True, False, False, True])
SCENE_SIZE = len(LOW) + 3  # number of entries that describe the scene
# number of entries of an observation, which `observations` describes
OBSERVATION_SIZE = SCENE_SIZE + 5 + 2 * len(DECAY_LENGTHS)


def scene_features(scene: Scene) -> Floats:
    """Return the `FEATURES` of a scene, shape (9,)."""
    h, gravity = scene.height, scene.physics.gravity
    unit = 1.0 if scene.in_heights else h
    pitch = 0.0 if scene.length is None else scene.length / (scene.count - 1) / h
    return np.array([
        scene.physics.friction, scene.physics.push * np.sqrt(h / gravity), scene.count,
        scene.spacing[0] / unit, scene.spacing[1] / unit, scene.first_thickness / h,
        scene.thickness[0] / unit, scene.thickness[1] / unit, pitch,
    ])  # fmt: skip


_distribution = lru_cache(load_distribution)


def range_violations(scene: Scene) -> tuple[str, ...]:
    """Return a text for each feature of a scene that is outside the range of the training.

    The ranges are those of "varied", "varied-thickness" or "varied-course", in units of h and
    √(h/g). No training had both free thickness and a given length.
    """
    free, has_length = scene.free_thickness, scene.length is not None
    if free and has_length:
        return ("free thickness with a given length",)
    kind = "varied-thickness" if free else "varied-course" if has_length else "varied"
    distribution = _distribution(kind)
    values = dict(zip(FEATURES, scene_features(scene), strict=True))
    values["length"] = values["pitch"] * (scene.count - 1)
    if not free:
        values["thickness fixed"] = values["thickness min"]
    return tuple(
        f"{name} {values[name]:.4g} is outside {bounds.min:.4g} to {bounds.max:.4g}"
        for name, bounds in zip(distribution.features, distribution.ranges.values(), strict=True)
        if not bounds.min * (1.0 - 1e-9) <= values[name] <= bounds.max * (1.0 + 1e-9)
    )


def require_kind(scene: Scene) -> None:
    """Raise ValueError for a scene whose rules or objective no training scene has."""
    is_restricted = (scene.stock, scene.growth) != (None, None)
    reasons = {
        "its dominoes stand on a floor": scene.simulator.is_slow,
        "a run-out follows its dominoes": scene.run_out is not None,
        f"its objective is {scene.objective}": not scene.criterion.is_mean_speed,
        "its scores are those of draws of placement noise": scene.scoring.placement is not None,
        "its gaps are not free": not scene.space.spacing.is_free,
        "its ground is not flat": scene.ground is not None,
        "its dominoes are from a stock, or grow": is_restricted,
        "it limits the wave": scene.limits is not None,
        f"it has {scene.count} dominoes": scene.count < 4,
    }
    if differences := [reason for reason, applies in reasons.items() if applies]:
        raise ValueError(
            f"scene '{scene.name}': {', '.join(differences)}; this policy was trained to maximise "
            "the mean speed of 4 or more dominoes of one height with free gaps, with or without "
            "free thickness or a given length: use `domino optimize` for this scene"
        )


def tight_candidates(count: int) -> int:
    """Return the number of candidates 0, 1, … for the tight gaps, at most half of all gaps."""
    return min(TRIES, count // 2)


def scale_features(features: Floats) -> Floats:
    """Scale the features of scenes to inputs of a network, of about -1 to 1.

    Parameters
    ----------
    features
        (…, 9) features of scenes, see `FEATURES`.

    Returns
    -------
    ndarray
        (…, SCENE_SIZE): friction, push, count, bounds of the gap, first thickness, least thickness,
        largest over least thickness; then three entries that are 0 without a given length: 1, the
        mean pitch scaled to [-1, 1] by its bounds, and 1 plus the logarithm of the mean gap of a
        layout with the smallest thicknesses.
    """
    values = np.asarray(features, dtype=np.float64)
    least, largest, thin, thick, pitch = (values[..., i] for i in (*BOUNDS, 8))
    entries = np.concatenate([values[..., :7], (thick / thin)[..., None]], axis=-1)
    # entries that are not LOGARITHMIC may be 0, and their logarithms are not used
    low, high = (np.where(LOGARITHMIC, np.log(np.maximum(x, 1e-3)), x) for x in (LOW, HIGH))
    entries = np.where(LOGARITHMIC, np.log(np.maximum(entries, 1e-9)), entries)
    has_length = pitch > 0.0
    relative = 2.0 * (pitch - least - thin) / (largest + thick - least - thin) - 1.0
    log_gap = np.log(np.where(has_length, np.maximum(pitch - thin, least), 1.0)) + 1.0
    length = np.where(has_length, np.stack([np.ones_like(pitch), relative, log_gap]), 0.0)
    scaled = 2.0 * (entries - low) / (high - low) - 1.0
    return np.concatenate([scaled, np.moveaxis(length, 0, -1)], axis=-1)


def observations(features: Floats, tight: Floats) -> Floats:
    """Return the observations of the network that returns gaps and thicknesses.

    Parameters
    ----------
    features
        (9,) features of a scene with N dominoes, see `FEATURES`.
    tight
        (K,) numbers of tight gaps.

    Returns
    -------
    ndarray
        (K (N-1), O) observations: for each number k of tight gaps, one per gap n = 0 … N-2. The
        entries are the scaled features; n; log(1 + n); log(1 + m), with the m gaps between gap n
        and the tight ones; k; exp(-k / 2); and exp(-n / c), exp(-m / c) for each decay length c.
        All but the exponentials are scaled to about [-1, 1].
    """
    pairs = int(features[2]) - 1
    k = np.asarray(tight, dtype=np.float64)
    index = np.broadcast_to(np.arange(pairs, dtype=np.float64), (len(k), pairs))
    distance = np.maximum(pairs - 1 - k[:, None] - index, 0.0)  # gaps up to the tight ones
    entries = np.empty((len(k), pairs, OBSERVATION_SIZE))
    entries[..., :SCENE_SIZE] = scale_features(features)
    rest = entries[..., SCENE_SIZE:]
    rest[..., 0] = 2.0 * index / (pairs - 1) - 1.0
    rest[..., 1] = np.log1p(index) / 2.0 - 1.0
    rest[..., 2] = np.log1p(distance) / 2.0 - 1.0
    rest[..., 3], rest[..., 4] = k[:, None] / 6.0 - 1.0, np.exp(-k / 2.0)[:, None]
    for j, c in enumerate(DECAY_LENGTHS):
        rest[..., 5 + 2 * j] = np.exp(-index / c)
        rest[..., 6 + 2 * j] = np.exp(-distance / c)
    return entries.reshape(-1, OBSERVATION_SIZE)
