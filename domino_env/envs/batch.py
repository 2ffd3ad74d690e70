"""Batches of environments: their arrays, and the tables of scenes that they share."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from domino_env.core.checks import require
from domino_env.core.models import plain
from domino_env.core.types import Floats, Ints
from domino_env.envs.catalogue import Catalogue
from domino_env.envs.spaces import FEATURE_LIMIT, ObservationLayout, closeness
from domino_env.kernels.arrays import CONTACT, STATE, UNEVEN_CONTACT
from domino_env.kernels.step.batch import EPISODE, RULES, UNIFORM, Batch
from domino_env.physics.wave import MAX_RTOL, MIN_RTOL
from domino_env.scenes.objectives.tempo import LEAST_SCORE
from domino_env.scenes.placement import LEAST_GAP
from domino_env.scenes.scene import Scene

PARTS = ("gap", "thickness", "growth")  # names of the parts of a design space in kernels
Sizes = tuple[Floats, Floats, Floats]
MAX_RING = 1024  # most dominoes stored behind the leader; some thirty influence the wave


class SceneArrays:
    """Arrays of the S scenes of a catalogue for the kernels, and batches of environments of them.

    Parameters
    ----------
    catalogue
        The scenes.
    rtol
        Relative error allowed in the arrival times.
    window
        Largest number of gaps and thicknesses that are observed.

    Attributes
    ----------
    rtol
        Relative error allowed in the arrival times.
    layout
        Slice of each part of an observation, by name.
    rules
        RULES of each scene, (S,). "score_unit" is the divisor of positive scores in the gain: the
        score of the uniform baseline if that is positive, else `Objective.typical`.
    features
        Observed numbers of each scene, scaled to [-1, 1] over their ranges, (S, F); F = 0 if the
        scene is fixed.
    uniform
        UNIFORM of each domino of the uniform baseline of each scene, (S, N).
    kinds
        Thicknesses of the kinds of a stock [m] and numbers of pieces of each scene, (S, 2, K).
    pieces
        Kinds of the pieces that are drawn in random order, (S, P); P = 0 without a hand.
    schedule
        Scheduled arrival times [s], and intervals scaled to [-1, 1], (S, N, 2); (S, 0, 2) without
        a schedule.
    """

    def __init__(self, catalogue: Catalogue, rtol: float, window: int) -> None:
        require("rtol", rtol, MIN_RTOL, MAX_RTOL)
        require("window", window, 0, whole=True, hint="the number of gaps observed")
        self.rtol = float(rtol)
        self.first, self.names = catalogue.first, catalogue.names
        self.observed, size, longest = catalogue.observed, catalogue.size, catalogue.longest
        self.run_out = self.first.row_count - self.first.count
        window = min(int(window), catalogue.count - 1)
        self.layout = ObservationLayout(self.first, window, len(self.observed))
        self.rules, self.uniform = np.zeros(size, RULES), np.zeros((size, longest), UNIFORM)
        self.features = np.zeros((size, len(self.observed)), np.float32)
        self.kinds = np.zeros((size, *self.first.space.kinds.shape))
        self.pieces = np.zeros((size, len(piece_kinds(self.first))), np.int16)
        # thickness of the first domino, and gap of the run-out, of each scene [m]
        self.first_thickness, self.run_out_gap = np.zeros((2, size))
        self.schedule = np.zeros((size, 0 if self.first.tempo is None else longest, 2))

    def store(self, i: int, scene: Scene, features: Floats, sizes: Sizes) -> None:
        """Store scene i with its sampled numbers, and the sizes of its uniform baseline [m].

        They are gaps (N-1,), thicknesses of dominoes 1 … N-1 and heights (N,).
        """
        spacing, thickness, height = sizes
        self.rules[i] = _make_rules(scene, self.rtol)
        self.features[i] = np.clip(features[self.observed], -FEATURE_LIMIT, FEATURE_LIMIT)
        self.first_thickness[i] = scene.first_thickness
        self.kinds[i], self.pieces[i] = scene.space.kinds, piece_kinds(scene)
        self.run_out_gap[i] = 0.0 if scene.run_out is None else scene.run_out.spacing
        tempo = scene.tempo
        if tempo is not None:
            scheduled = np.append(0.0, tempo.schedule(scene.count))
            intervals = np.diff(scheduled)
            low, high = intervals.min(), intervals.max()
            middle, half = 0.5 * (low + high), max(0.5 * (high - low), 1e-12)  # not 0 if all equal
            self.schedule[i, : scene.count, 0] = scheduled
            self.schedule[i, 1 : scene.count, 1] = (intervals - middle) / half
        uniform = self.uniform[i, : scene.count]
        measured = scene.space.measure(spacing, thickness, height[1:])
        for name, values in zip(PARTS, measured, strict=True):
            uniform[name][:-1] = values

    def begin_layouts(self, batch: Batch, envs: Ints) -> None:
        """Write the first domino and the run-out of some environments into a batch."""
        scenes = batch.scene[envs]
        batch.thickness[envs, 0] = self.first_thickness[scenes]
        if self.run_out:
            places = self.rules["count"][scenes][:, None] + np.arange(self.run_out)
            batch.spacing[envs[:, None], places - 1] = self.run_out_gap[scenes, None]
            batch.thickness[envs[:, None], places] = self.first_thickness[scenes, None]
        if len(batch.height) == len(batch.scene):  # else environments share the heights
            batch.height[envs] = self.rules["unit"][scenes, None]

    def new_batch(self, num_envs: int) -> Batch:
        """Return the arrays of environments before their first reset; scenes are shared."""
        scene, longest = self.first, self.uniform.shape[1] + self.run_out
        own_height = scene.growth is not None or "height" in self.names
        # a power of two for the whole chain, or for the part that influences the wave
        ring_size = 1 << min(longest, MAX_RING - 1).bit_length()
        contact = CONTACT if scene.ground is None else UNEVEN_CONTACT
        batch = Batch(
            scene=np.zeros(num_envs, np.int64),
            rules=self.rules,
            entries=self.layout.starts,
            features=self.features,
            uniform=self.uniform,
            schedule=self.schedule,
            closeness=closeness(longest),
            kinds=self.kinds,
            box=np.zeros((num_envs, self.kinds.shape[2])),
            order=np.zeros((num_envs, self.pieces.shape[1]), np.int16),
            errors=np.zeros((num_envs if scene.placement else 0, longest - 1)),
            rings=np.zeros((num_envs, ring_size), contact),
            states=np.zeros(num_envs, STATE),
            episodes=np.zeros(num_envs, EPISODE),
            spacing=np.full((num_envs, longest - 1), scene.spacing[0]),
            thickness=np.full((num_envs, longest), scene.first_thickness),
            height=np.full((num_envs if own_height else 1, longest), scene.height),
            density=np.full((1, longest), scene.density),
        )
        if scene.ground is None:
            return batch
        _, tilt = scene.ground.rise_and_tilt(np.empty(0), batch.thickness[0, :1])
        return batch._replace(
            rise=np.zeros((num_envs, longest - 1)),
            tilt=np.full((num_envs, longest), tilt[0]),
            places=np.zeros((num_envs, longest)),
            curve=scene.ground.curve,
        )


def piece_kinds(scene: Scene, taken: Floats | None = None) -> NDArray[np.int16]:
    """Return the kinds (P,) of the pieces that are drawn in random order; empty without a hand.

    taken: thicknesses of the dominoes placed so far [m]; None for the first one alone.
    """
    if not scene.hand or scene.stock is None or not scene.free_thickness:
        return np.zeros(0, np.int16)
    left = scene.stock.without(*([scene.first_thickness] if taken is None else taken)).dominoes
    return np.searchsorted(scene.space.kinds[0], left).astype(np.int16)


def _make_rules(scene: Scene, rtol: float) -> tuple[Any, ...]:
    """Return the fields of RULES of a scene; those of its uniform baseline are 0."""
    bounds = {
        f"{name}_{bound}": getattr(part, bound)
        for name, part in zip(PARTS, scene.space.parts, strict=True)
        for bound in ("low", "high")
    }
    tempo = scene.tempo
    values = plain(scene.physics) | bounds
    values |= {
        "count": scene.count,
        "run_out": scene.row_count - scene.count,
        "hand": scene.hand,
        "rtol": rtol,
        "uniform_speed": 0.0,
        "length": scene.length or 0.0,
        "least_placed": LEAST_GAP,
        "unit": scene.height,
        "grows": scene.space.grows,
        "in_heights": scene.in_heights,
        "rewards_steps": scene.criterion.rewards_steps,
        "tolerance": 0.0 if tempo is None else tempo.tolerance,
        "score_unit": 0.0,
        "least_score": 0.0 if tempo is None else LEAST_SCORE,
        "fixed": not (scene.hand or scene.placement),
        "score_is_speed": scene.as_placed.scoring.is_mean_speed and scene.limits is None,
    }
    return tuple(values[name] for name in RULES.names or ())
