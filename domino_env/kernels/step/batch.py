"""Batch of environments: rules, episodes and arrays."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from domino_env.kernels.arrays import Arrays, Curve, Setting, record_type
from domino_env.kernels.jit import always_inline, select

# phases of an episode: not begun, between two steps, ended, to begin in the next call
IDLE, RUNNING, OVER, BEGINNING = 0, 1, 2, 3

RULES = record_type(  # of a scene
    count=int,  # number of dominoes that are placed by actions, with the first
    run_out=int,  # number of fixed dominoes after them
    hand=int,  # pieces held at a time, drawn in random order; 0 if the whole stock can be placed
    **Setting.__annotations__,
    uniform_speed=float,  # [m/s] of the uniform baseline; √(g h) if it stops
    length=float,  # from the first pivot to the last [m], 0 if it is free
    gap_low=float,  # bounds [m], in heights if `in_heights`
    gap_high=float,
    thickness_low=float,
    thickness_high=float,
    least_placed=float,  # least gap that placement errors leave [m]
    growth_low=float,
    growth_high=float,
    unit=float,  # height of the first domino, by which observations are scaled [m]
    grows=np.bool_,  # heights differ by the growth
    in_heights=np.bool_,  # gaps are multiples of the smaller height, thicknesses of their own
    rewards_steps=np.bool_,  # else all rewards but the last are 0
    tolerance=float,  # RMS error that halves the score [s], if hits have a schedule, else 0
    score_unit=float,  # score by which a success is divided in the gain
    least_score=float,  # scores of hits on a schedule that are smaller count as this in the gain
    fixed=np.bool_,  # the same layout has the same score in every episode
    score_is_speed=np.bool_,  # known when the wave ends, without another simulation
)
UNIFORM = record_type(  # domino k of the uniform baseline
    gap=float,  # after it, in the unit of the bounds; like the next two, the values of entries of 0
    thickness=float,  # of domino k+1, in the unit of the bounds
    growth=float,  # of domino k+1
    length_left=float,  # from domino k to the last one [m]
    thickness_left=float,  # of the dominoes after k together [m]
    time_left=float,  # from the hit of domino k to that of the last one [s]
)
EPISODE = record_type(  # besides its ring and state
    distance=float,  # first pivot to last [m]
    reward_sum=float,  # sum of the rewards, including the dominoes given at reset
    squared_errors=float,  # sum of those of the arrival times [s²], with a schedule
    reach=float,  # of the wave; this, score and outcome are valid if the phase is OVER
    score=float,
    placed=int,  # number of dominoes after the first; if BEGINNING, of those given with it
    phase=int,
    outcome=int,
    uncertain=np.bool_,  # the score must be computed from the whole layout
    as_uniform=np.bool_,  # the layout is the uniform baseline, whose score is known
)


class Batch(NamedTuple):
    """Arrays of B environments, and those that they share."""

    scene: NDArray[np.int64]  # (B,) index of the scene of each environment, of S
    rules: NDArray[np.record]  # (S,) RULES
    entries: NDArray[np.record]  # (1,) OBSERVATION
    features: NDArray[np.float32]  # (S, F) of sampled scenes; F = 0 if the scene is fixed
    uniform: NDArray[np.record]  # (S, N) UNIFORM
    schedule: NDArray[np.float64]  # (S, N, 2) arrival times [s]; intervals, -1 to 1; or (S, 0, 2)
    closeness: NDArray[np.float32]  # (N, C) exp(-k / c) of k dominoes to an end, for C lengths c
    kinds: NDArray[np.float64]  # (S, 2, K) thicknesses of a stock, and numbers of pieces
    box: NDArray[np.float64]  # (B, K) pieces of a stock that are still in the box; or (B, 0)
    order: NDArray[np.int16]  # (B, P) kinds of all pieces, those placed, in hand, to draw; (B, 0)
    errors: NDArray[np.float64]  # (B, N-1) placement errors, added to the gaps [m]; or (0, N-1)
    rings: NDArray[np.record]  # (B, R) CONTACT or UNEVEN_CONTACT
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
    return batch.rules[batch.scene[b]]


@always_inline
def uniform_of(batch, b):
    """Return the uniform baseline (N,) of environment b."""
    return batch.uniform[batch.scene[b]]


@always_inline
def kinds_of(batch, b):
    """Return thicknesses [m] and numbers of pieces (2, K) of the stock of environment b."""
    return batch.kinds[batch.scene[b]]


@always_inline
def schedule_of(batch, b):
    """Return the schedule of environment b."""
    return batch.schedule[batch.scene[b]]


@always_inline
def layout_in(batch, b):
    """Return the layout of environment b, with as many dominoes as its scene has."""
    return _first_dominoes(batch, b, rules_of(batch, b).count)


@always_inline
def row_in(batch, b):
    """Return the whole row of environment b: its layout with the run-out."""
    rules = rules_of(batch, b)
    return _first_dominoes(batch, b, rules.count + rules.run_out)


@always_inline
def _first_dominoes(batch, b, count):
    """Return the first dominoes of environment b."""
    height, density = b if len(batch.height) > 1 else 0, b if len(batch.density) > 1 else 0
    return Arrays(
        batch.spacing[b, : count - 1],
        batch.thickness[b, :count],
        batch.height[height, :count],
        batch.density[density, :count],
        select(batch.rise, (b, slice(0, count - 1))),
        select(batch.tilt, (b, slice(0, count))),
    )
