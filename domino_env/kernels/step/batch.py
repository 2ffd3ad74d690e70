"""Batch of environments: rules, episodes and arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from domino_env.kernels.arrays import Arrays, Curve, record_type
from domino_env.kernels.jit import always_inline, select

IDLE, RUNNING, OVER = 0, 1, 2  # phases of an episode

RULES = record_type(  # of a scene
    count=int,  # of dominoes
    hand=int,  # pieces held at a time, drawn in random order; 0 if the whole stock is at hand
    friction=float,
    gravity=float,
    push=float,
    rtol=float,
    uniform_speed=float,  # [m/s] of the uniform baseline; √(g h) if it stops
    reference_speed=float,  # [m/s] of the wave that observed leads and speeds refer to
    length=float,  # of the course [m], 0 where it is free
    gap_low=float,  # bounds [m], in heights where `in_heights`
    gap_high=float,
    thickness_low=float,
    thickness_high=float,
    largest_change=float,  # of a gap from the one before, 0 if it is free
    least_placed=float,  # gap that placement errors leave [m]
    growth_low=float,
    growth_high=float,
    unit=float,  # height by which rewards and observations are scaled [m]
    grows=np.bool_,
    in_heights=np.bool_,
    rewards_steps=np.bool_,  # else all rewards but the last are 0
    tolerance=float,  # RMS error that halves the score [s], if hits have a schedule, else 0
    score_unit=float,  # score by which a success is divided in the gain
    score_is_speed=np.bool_,  # known when the wave ends, without another simulation
)
EPISODE = record_type(  # between two steps, besides the ring and the state
    distance=float,  # first pivot to last [m]
    reward_sum=float,  # sum of the rewards, including the dominoes given at reset
    lateness=float,  # sum of the squared errors of the arrival times [s²], with a schedule
    reach=float,  # when it is over: reach of the wave, score and outcome
    score=float,
    placed=int,  # dominoes after the first
    phase=int,
    outcome=int,
    uncertain=np.bool_,  # the score must be computed from the whole layout
)


class Batch(NamedTuple):
    """Arrays of B environments, and those that they share."""

    rules: NDArray[np.record]  # (1,) RULES, or (B,) if each has its own scene
    entries: NDArray[np.record]  # (1,) OBSERVATION
    features: NDArray[np.float32]  # (B, F) of sampled scenes; F = 0 if the scene is fixed
    uniform_left: NDArray[np.float64]  # (1, N, 2) or (B, N, 2), see `expected_gain`
    schedule: NDArray[np.float64]  # (1, N, 2) or (B, N, 2) arrival times [s]; intervals, -1 to 1
    closeness: NDArray[np.float32]  # (N, S) exp(-k / c) of k dominoes to an end
    gap_values: NDArray[np.float64]  # the only gaps allowed, or empty
    kinds: NDArray[np.float64]  # (2, K) thicknesses in stock, and how many of each
    box: NDArray[np.float64]  # (B, K) how many are left in the box, without those in hand
    hand: NDArray[np.float64]  # (B, K) how many are in hand
    order: NDArray[np.int16]  # (B, S) kinds in the order in which they are drawn; or (B, 0)
    errors: NDArray[np.float64]  # (B, N-1) placement errors, added to the gaps [m]; or (0, N-1)
    rings: NDArray[np.record]  # (B, …) CONTACT or UNEVEN_CONTACT
    states: NDArray[np.record]  # (B,) STATE
    episodes: NDArray[np.record]  # (B,) EPISODE
    spacing: NDArray[np.float64]  # (B, N-1) [m]
    thickness: NDArray[np.float64]  # (B, N) [m]
    height: NDArray[np.float64]  # (1, N), or (B, N) if they differ [m]
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
def schedule_of(batch, b):
    """Return the schedule of environment b."""
    return batch.schedule[b if len(batch.schedule) > 1 else 0]


@always_inline
def layout_in(batch, b):
    """Return the layout of environment b, as long as its scene."""
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
