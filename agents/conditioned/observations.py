"""Observations of the scene-conditioned policy: the scene, the plan, how far the row has come."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from agents.conditioned.distribution import FEATURES, SceneDistribution

Floats = NDArray[np.float64]

PLANS = 13  # 0 … 12 tight gaps
SCALES = (1.0, 2.0, 4.0, 8.0, 16.0)  # [dominoes] over which the ends of a row make themselves felt
SIZE = len(FEATURES) + 5 + 2 * len(SCALES)  # entries of an observation
TRAINED_ON = SceneDistribution()  # what the policy that ships was trained on, the unit of features


def plans_of(count: int) -> int:
    """Count the plans there are for a row of `count` dominoes: at most half of it is tight."""
    return min(PLANS, count // 2)


def scaled(features: Floats) -> Floats:
    """Scale a scene's features (…, 6) for a network: about -1 to 1."""
    low, high = _ends()
    values = np.asarray(features, dtype=np.float64).copy()
    values[..., 1:5] = np.log(values[..., 1:5])
    return np.asarray(2.0 * (values - low) / (high - low) - 1.0)


@lru_cache(maxsize=1)
def _ends() -> tuple[Floats, Floats]:
    f = TRAINED_ON
    ranges = np.array([f.friction, f.push, f.count, f.least, f.largest, f.thickness], np.float64)
    ranges[1:5] = np.log(ranges[1:5])
    return ranges[:, 0], ranges[:, 1]


def observations(features: Floats, plans: Floats) -> Floats:
    """Make the observations at each gap under each of K plans, (K (N-1), SIZE)."""
    pairs = int(features[2]) - 1
    k = np.asarray(plans, dtype=np.float64)
    at = np.broadcast_to(np.arange(pairs, dtype=np.float64), (len(k), pairs))
    left = np.maximum(pairs - 1 - k[:, None] - at, 0.0)  # gaps before the tight ones begin
    parts = np.empty((len(k), pairs, SIZE))
    parts[..., : len(FEATURES)] = scaled(features)
    c = len(FEATURES)
    parts[..., c] = 2.0 * at / (pairs - 1) - 1.0
    parts[..., c + 1], parts[..., c + 2] = np.log1p(at) / 2.0 - 1.0, np.log1p(left) / 2.0 - 1.0
    parts[..., c + 3], parts[..., c + 4] = k[:, None] / 6.0 - 1.0, np.exp(-k / 2.0)[:, None]
    for j, scale in enumerate(SCALES):
        parts[..., c + 5 + 2 * j] = np.exp(-at / scale)
        parts[..., c + 6 + 2 * j] = np.exp(-left / scale)
    return parts.reshape(-1, SIZE)
