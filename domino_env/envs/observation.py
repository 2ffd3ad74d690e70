"""What is observed of a row: the bounds of the entries, and those that no wave has a say in."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from domino_env import kernels
from domino_env.scenes.scene import Scene

SCALES = (1.0, 2.0, 4.0, 8.0)  # [dominoes] over which the ends of the row make themselves felt


def observation_space(batch: kernels.Batch, scene: Scene, choices: int) -> Box:
    """Bound each entry of an observation; the order is that of `kernels.observation`."""
    low = [0.0, -kernels.LEAD_LIMIT, -1.0]
    high = [kernels.FRONT_LIMIT, kernels.LEAD_LIMIT, kernels.SPEED_LIMIT]
    if scene.length is not None:
        low, high = [*low, 0.0, -1.0], [*high, 1.0, 1.0]
    behind = int(batch.rules[0].window) * choices
    ends = batch.progress.shape[1] + int(scene.free_height)
    ends += len(batch.kinds) * (scene.stock is not None)
    low += [-1.0] * behind + [0.0] * ends
    high += [1.0] * (behind + ends)
    return Box(np.array(low, np.float32), np.array(high, np.float32), dtype=np.float32)


def progress_features(count: int) -> NDArray[np.float32]:
    """Return (N, 1 + 2 S) for 0 … N-1 dominoes placed: part of the row, closeness to both ends."""
    placed = np.arange(count)[:, None]
    scales = np.array(SCALES)
    features = [
        placed / (count - 1),
        np.exp(-placed / scales),
        np.exp((placed - count + 1) / scales),
    ]
    return np.concatenate(features, axis=1).astype(np.float32)
