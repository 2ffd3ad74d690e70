"""Named parts and bounds of observations, and the number of entries of an action."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from domino_env.kernels.step import observation
from domino_env.scenes.scene import Scene

SCALES = (1.0, 2.0, 4.0, 8.0)  # [dominoes] decay lengths of near_start and near_end
FEATURE_LIMIT = 3.0  # bound of the features of scenes outside the ranges


class ObservationLayout(dict[str, slice]):
    """Slice of each part of an observation, by name, in the order of the page of `DominoChain`.

    Parts that a scene does not have are left out.

    Parameters
    ----------
    scene
        The scene, or one of those that are sampled.
    window
        W, number of gaps (and thicknesses, growths, places ahead) observed.
    features
        F, number of features of a sampled scene.

    Attributes
    ----------
    space
        Box(O,) of observations.
    starts
        (1,) OBSERVATION, the same for the kernels.
    """

    def __init__(self, scene: Scene, window: int, features: int) -> None:
        has_length, grows = int(scene.length is not None), int(scene.free_height)
        in_tempo = int(scene.as_placed.tempo is not None)
        ahead = window * int(scene.ground is not None)
        kinds = 0 if scene.stock is None else len(scene.stock.thickness)
        parts = {
            "front": (1, 0.0, observation.FRONT_LIMIT),
            "lead": (1, -observation.LEAD_LIMIT, observation.LEAD_LIMIT),
            "speed": (1, -1.0, observation.SPEED_LIMIT),
            "lateness": (in_tempo, -1.0, 1.0),
            "intervals": (window * in_tempo, -1.0, 1.0),
            "length_left": (has_length, 0.0, 1.0),
            "pitch_left": (has_length, -1.0, 1.0),
            "gaps": (window * scene.free_spacing, -1.0, 1.0),
            "thicknesses": (window * scene.free_thickness, -1.0, 1.0),
            "growths": (window * grows, -1.0, 1.0),
            "height": (grows, 0.0, 1.0),
            "hand": (kinds * (scene.hand > 0), 0.0, 1.0),
            "stock": (kinds, 0.0, 1.0),
            "placed": (1, 0.0, 1.0),
            "near_start": (len(SCALES), 0.0, 1.0),
            "near_end": (len(SCALES), 0.0, 1.0),
            "features": (features, -FEATURE_LIMIT, FEATURE_LIMIT),
            "slopes": (ahead, -1.0, 1.0),
            "rises": (ahead, -observation.RISE_LIMIT, observation.RISE_LIMIT),
        }
        super().__init__()
        self.starts = np.full(1, -1, observation.OBSERVATION)
        self.starts["window"] = window
        size = 0
        for name, (entries, _, _) in parts.items():
            if entries:
                self[name] = slice(size, size + entries)
                self.starts[name] = size
                size += entries
        sizes, low, high = zip(*parts.values(), strict=True)
        bounds = np.repeat(np.array([low, high], np.float32), sizes, axis=1)
        self.space = Box(*bounds, dtype=np.float32)


def closeness(count: int) -> NDArray[np.float32]:
    """Return exp(-k / c) for k = 0 … N-1 dominoes to an end and c in SCALES, (N, 4)."""
    away = np.arange(count)[:, None]
    return np.asarray(np.exp(-away / np.array(SCALES)), dtype=np.float32)


def action_entries(scene: Scene) -> int:
    """Return the number of entries of an action for each domino that is placed."""
    return int(scene.free_spacing) + int(scene.free_thickness) + int(scene.free_height)
