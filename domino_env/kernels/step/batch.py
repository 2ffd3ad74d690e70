"""A batch of environments: rules, episodes and arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from domino_env.kernels.arrays import Arrays, Curve, record_type
from domino_env.kernels.jit import always_inline, select

IDLE, RUNNING, OVER = 0, 1, 2  # phases of an episode

RULES = record_type(  # of a scene: one that all environments share, or each its own
    count=int,  # of dominoes
    friction=float,
    gravity=float,
    push=float,
    rtol=float,
    reference_speed=float,  # [m/s] to lead against
    length=float,  # of the course [m], 0 where it is free
    gap_low=float,  # bounds [m], in heights where `in_heights`
    gap_high=float,
    thick_low=float,
    thick_high=float,
    largest_change=float,  # of a gap from the one before, 0 where it is free
    least_placed=float,  # gap that placement errors leave [m]
    growth_low=float,
    growth_high=float,
    unit=float,  # the height that rewards and observations are scaled by [m]
    grows=np.bool_,
    in_heights=np.bool_,
    reward_scale=float,  # 1 where single steps are paid, else 0
    score_is_speed=np.bool_,  # and so known at once
)
EPISODE = record_type(  # what is kept between two steps, besides the ring and the state
    distance=float,  # first pivot to last [m]
    rewarded=float,  # sum of the rewards; what was given at reset counts as paid
    reach=float,  # and once it is over: how far the wave came, the score and why it ended
    score=float,
    placed=int,  # dominoes after the first
    phase=int,
    outcome=int,
    uncertain=np.bool_,  # whether the score has to be computed from the layout as a whole
)


class Batch(NamedTuple):
    """B environments: what they share, and their arrays."""

    rules: NDArray[np.record]  # (1,) RULES, or (B,) where each has its own scene
    entries: NDArray[np.record]  # (1,) OBSERVATION
    features: NDArray[np.float32]  # (B, F) of the scene, to be observed; F = 0 where it is fixed
    closeness: NDArray[np.float32]  # (N, S) exp(-k / c), k dominoes away from an end
    gap_values: NDArray[np.float64]  # the only gaps allowed, or none
    kinds: NDArray[np.float64]  # (2, K) the only thicknesses allowed, and how many of each
    left: NDArray[np.float64]  # (B, K) how many of them each has left
    errors: NDArray[np.float64]  # (B, N-1) placement errors, added to the gaps [m]; or (0, N-1)
    rings: NDArray[np.record]  # (B, …) LINK or UNEVEN_LINK
    states: NDArray[np.record]  # (B,) STATE
    episodes: NDArray[np.record]  # (B,) EPISODE
    spacing: NDArray[np.float64]  # (B, N-1) [m]
    thickness: NDArray[np.float64]  # (B, N) [m]
    height: NDArray[np.float64]  # (1, N), or (B, N) where they differ [m]
    density: NDArray[np.float64]  # (1, N) [kg/m³]; N is the largest count
    rise: NDArray[np.float64] | None = None  # (B, N-1) [m]; these four only on uneven ground
    tilt: NDArray[np.float64] | None = None  # (B, N) [rad]
    places: NDArray[np.float64] | None = None  # (B, N) x of the pivots [m]
    curve: Curve | None = None


@always_inline
def rules_of(batch, b):
    """Return the rules of environment b."""
    return batch.rules[b if len(batch.rules) > 1 else 0]


@always_inline
def layout_in(batch, b):
    """Return the row of environment b, as long as its scene has it."""
    count = rules_of(batch, b).count
    height, density = b if len(batch.height) > 1 else 0, b if len(batch.density) > 1 else 0
    return Arrays(
        batch.spacing[b, : count - 1],
        batch.thickness[b, :count],
        batch.height[height, :count],
        batch.density[density, :count],
        select(batch.rise, (b, slice(0, count - 1))),
        select(batch.tilt, (b, slice(0, count))),
    )
