"""What is observed of a row: the bounds of the entries, and those that no wave has a say in."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from domino_env import kernels
from domino_env.envs.problems import FEATURE_LIMIT, Problems, choices

SCALES = (1.0, 2.0, 4.0, 8.0)  # [dominoes] over which the ends of the row make themselves felt


def observation_space(batch: kernels.Batch | kernels.HillBatch, problems: Problems) -> Box:
    """Bound each entry of an observation; the order is that of `kernels.observation`."""
    scene = problems.like
    low = [0.0, -kernels.LEAD_LIMIT, -1.0]
    high = [kernels.FRONT_LIMIT, kernels.LEAD_LIMIT, kernels.SPEED_LIMIT]
    if scene.length is not None:
        low, high = [*low, 0.0, -1.0], [*high, 1.0, 1.0]
    behind = problems.window * choices(scene)
    ends = progress_entries() + int(scene.free_height)
    ends += len(batch.kinds) * (scene.stock is not None)
    features = problems.features.shape[1]
    low += [-1.0] * behind + [0.0] * ends + [-FEATURE_LIMIT] * features
    high += [1.0] * (behind + ends) + [FEATURE_LIMIT] * features
    if scene.ground is not None:
        ahead = np.repeat([1.0, kernels.RISE_LIMIT], problems.window)
        low, high = [*low, *-ahead], [*high, *ahead]
    return Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)


def progress_entries() -> int:
    """Count the entries that tell how much of a row is placed: its part, closeness to both ends."""
    return 1 + 2 * len(SCALES)


def closeness(count: int) -> NDArray[np.float32]:
    """Return (N, S) exp(-k / c) for 0 … N-1 dominoes between here and an end."""
    away = np.arange(count)[:, None]
    return np.asarray(np.exp(-away / np.array(SCALES)), dtype=np.float32)
