"""Parts of observations with their names and bounds, and the size and checks of actions."""

from __future__ import annotations

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from domino_env.core.checks import numbers, require
from domino_env.core.types import Bools, Floats
from domino_env.kernels.step import action, observation
from domino_env.scenes.scene import Scene

DECAY_LENGTHS = (1.0, 2.0, 4.0, 8.0)  # [dominoes] of near_start and near_end
FEATURE_LIMIT = 3.0  # size at which features are clipped; beyond 1 they are outside the ranges


class ObservationLayout(dict[str, slice]):
    """Slice of each part of an observation, by name, in the order of the table of `DominoChain`.

    Parts that observations of the scene do not have are left out.

    Parameters
    ----------
    scene
        The scene, or one of those that are sampled.
    window
        W, number of gaps, thicknesses, growths, intervals and places ahead that are observed.
    num_features
        F, number of observed features; 0 if the scene is fixed.

    Attributes
    ----------
    space
        Space of the observations, (O,).
    starts
        (1,) OBSERVATION for the kernels: the window, and the start of each part, -1 if absent.
    """

    def __init__(self, scene: Scene, window: int, num_features: int) -> None:
        has_length, kinds = int(scene.length is not None), len(scene.space.kinds[0])
        gaps, thicknesses, growths = (int(part.is_free) for part in scene.space.parts)
        has_schedule = int(scene.tempo is not None)
        places = window * int(scene.ground is not None)
        most = observation.RATIO_LIMIT
        parts = {  # number of entries, lowest and highest value
            "front": (1, 0.0, observation.FRONT_LIMIT),
            "lead": (1, -observation.LEAD_LIMIT, observation.LEAD_LIMIT),
            "speed": (1, -1.0, observation.SPEED_LIMIT),
            "lateness": (has_schedule, -observation.LATE_LIMIT, observation.LATE_LIMIT),
            "intervals": (window * has_schedule, -1.0, 1.0),
            "length_left": (has_length, 0.0, 1.0),
            "pitch_left": (has_length, -1.0, 1.0),
            "gaps": (window * gaps, -most, most),
            "thicknesses": (window * thicknesses, -most, most),
            "growths": (window * growths, -most, most),
            "height": (growths, 0.0, 1.0),
            "hand": (kinds * (scene.hand > 0), 0.0, 1.0),
            "stock": (kinds, 0.0, 1.0),
            "placed": (1, 0.0, 1.0),
            "near_start": (len(DECAY_LENGTHS), 0.0, 1.0),
            "near_end": (len(DECAY_LENGTHS), 0.0, 1.0),
            "features": (num_features, -FEATURE_LIMIT, FEATURE_LIMIT),
            "slopes": (places, -1.0, 1.0),
            "rises": (places, -observation.RISE_LIMIT, observation.RISE_LIMIT),
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
    """Return exp(-k / c) for k = 0 … N-1 dominoes to an end and the decay lengths c, (N, 4)."""
    distances = np.arange(count)[:, None]
    return np.asarray(np.exp(-distances / np.array(DECAY_LENGTHS)), dtype=np.float32)


def action_entries(scene: Scene) -> int:
    """Return the number of entries of the action that places one domino."""
    return len(scene.space.free) + max(len(scene.space.kinds[0]) - 1, 0)


def gap_entries(scene: Scene, gaps: Floats) -> Floats:
    """Return the entries of actions that choose gaps [m] of any shape, unless rules narrow them."""
    entries = np.empty(np.shape(gaps))
    values, uniform = np.ascontiguousarray(gaps, np.float64).ravel(), scene.uniform().layout
    action.encode_values(values, *scene.spacing, float(uniform.spacing[0]), entries.reshape(-1))
    return entries


def check_actions(
    actions: ArrayLike, shape: tuple[int, ...] | None, ignored: Bools | None = None
) -> Floats:
    """Return actions as float64; raise a ValueError for another shape or entries not finite.

    ignored: (B,) True for environments whose action is not used and may have any entries.
    """
    values = numbers("action", actions, None, shape, "entries from -1 to 1")
    if np.count_nonzero(np.isfinite(values)) < values.size:  # faster than all()
        if ignored is not None:
            values = np.where(ignored[:, None], 0.0, values)
        require("action", values, hint="from -1 to 1", array=True)
    return values
