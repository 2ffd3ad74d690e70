"""Observations of the scene-conditioned policy: the scene, the plan, how far the row has come."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PLANS = 13  # 0 … 12 tight gaps
SCALES = (1.0, 2.0, 4.0, 8.0, 16.0)  # [dominoes] over which the ends of a row make themselves felt
LOW = np.array([0.0, 0.2, 15.0, 0.02, 0.4, 0.08, 0.08, 1.0])  # scaled to -1, HIGH to 1
HIGH = np.array([0.5, 1.4, 80.0, 0.2, 0.95, 0.25, 0.25, 5.0])
BY_LOGARITHM = np.array([False, True, True, True, True, False, False, True])
SCENE = len(LOW) + 3  # entries that describe the scene
SIZE = SCENE + 5 + 2 * len(SCALES)  # entries of an observation


def plans_of(count: int) -> int:
    """Count the plans there are for a row of `count` dominoes: at most half of it is tight."""
    return min(PLANS, count // 2)


def scaled(features: Floats) -> Floats:
    """Describe scenes to a network by numbers of about -1 to 1.

    Parameters
    ----------
    features
        (…, 9) of scenes, see `agents.conditioned.features.FEATURES`.

    Returns
    -------
    NDArray
        (…, SCENE): friction, push, count, bounds of the gap, first thickness, least thickness,
        largest over least; whether a length is asked for, where its pitch lies between the
        smallest and the largest that the bounds allow, and the logarithm of the mean gap that it
        leaves between the thinnest dominoes (these two 0 where none is).
    """
    values = np.asarray(features, dtype=np.float64)
    least, largest, thin, thick, pitch = (values[..., i] for i in (3, 4, 6, 7, 8))
    plain = np.concatenate([values[..., :7], (thick / thin)[..., None]], axis=-1)
    low, high = (np.where(BY_LOGARITHM, np.log(np.maximum(x, 1e-3)), x) for x in (LOW, HIGH))
    plain = np.where(BY_LOGARITHM, np.log(np.maximum(plain, 1e-9)), plain)
    asked = pitch > 0.0
    place = (pitch - least - thin) / (largest + thick - least - thin)
    mean = np.log(np.where(asked, np.maximum(pitch - thin, least), 1.0))
    course = [asked, np.where(asked, 2.0 * place - 1.0, 0.0), np.where(asked, mean + 1.0, 0.0)]
    described = [2.0 * (plain - low) / (high - low) - 1.0, np.stack(course, axis=-1)]
    return np.concatenate(described, axis=-1)


def observations(features: Floats, plans: Floats) -> Floats:
    """Make the observations at each gap under each of K plans, (K (N-1), SIZE)."""
    pairs = int(features[2]) - 1
    k = np.asarray(plans, dtype=np.float64)
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
